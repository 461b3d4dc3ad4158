"""Rows of a long loop averaged into bins of phase."""

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.fourier import GRID
from bushfit.reading.parallel import CHUNK, by_chunks

#: First cycles whose bins are kept apart, because a loop settles over them.
_APART = 4
#: Length of each group of later cycles over that of the one before it; chosen: a loop settles ever more slowly.
_GROWTH = 1.5


def phase_bins(
    clock: Array, force: Array, frequency: float, cycles: float, *, each_cycle: bool
) -> tuple[Array, Array, Array]:
    """Mean phase [cycles], mean force and number of rows of each bin that holds rows, (k,) each.

    A bin is a GRID-th of a cycle. The first few cycles have bins of their own, and later ones share bins in ever larger
    groups, unless `each_cycle` has its own. The clock [s], (n,), rises from the first row.
    """
    group, middle = _groups(int(cycles) + 2, each_cycle=each_cycle)
    edges = np.append(np.arange(int(cycles * GRID) + 1) / (frequency * GRID), np.inf)

    def sums(bins: slice) -> Array:
        """Of some bins the filled ones, (k,), their rows, and sums of phase in bins and of force over these, (4, k)."""
        start, stop = np.searchsorted(clock, edges[[bins.start, bins.stop]])
        first = np.searchsorted(clock[start:stop], edges[bins])
        filled = np.flatnonzero(np.diff(first, append=stop - start))
        number, first = filled + bins.start, first[filled]
        count = np.diff(first, append=stop - start)
        in_bins = np.add.reduceat(clock[start:stop], first) * (frequency * GRID) - count * number
        return np.stack((number, count, in_bins, np.add.reduceat(force[start:stop], first)))

    chunks = by_chunks(sums, edges.size - 1, 1 + CHUNK * edges.size // clock.size)
    bins, *parts = np.concatenate(chunks, axis=1)
    bins = bins.astype(np.intp)
    filled, place = np.unique(GRID * group[bins // GRID] + bins % GRID, return_inverse=True)
    rows, inside, total = (np.bincount(place, weights=part) for part in parts)
    return middle[filled // GRID] + (filled % GRID + inside / rows) / GRID, total / rows, rows


def _groups(cycles: int, *, each_cycle: bool) -> tuple[Array, Array]:
    """The group that each cycle belongs to, (cycles,), and the cycle in the middle of each group, (groups,)."""
    number = np.arange(cycles)
    later = _APART * _GROWTH ** np.arange(np.log(number.size / _APART) / np.log(_GROWTH))
    starts = number if each_cycle else np.union1d(np.arange(_APART), later.astype(np.intp))
    group = np.searchsorted(starts, number, side="right") - 1
    return group, np.round(np.bincount(group, weights=number) / np.bincount(group))
