"""Fourier series of a periodic record, fitted by least squares to its rows as they are; of a long one in bins of phase.

A series of order m has real coefficients (mean, m cosines, m negative sines), (2 m + 1,), or complex ones, mean first,
(m + 1,): c_k stands for Re c_k exp(2 pi i k phase). Phase counts cycles.
"""

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from bushfit.effects.contract import Array
from bushfit.reading.parallel import CHUNK, by_chunks

#: Samples of one cycle where a series is drawn as a curve and the model answers; chosen: rows between two samples are
#: interpolated linearly, which is then off by 5e-6 of the amplitude.
GRID = 1024
#: Rows of a cycle behind each harmonic; two determine one, and more keep noise from being fitted.
_ROWS_PER_HARMONIC = 5
#: Golden ratio less 1; chosen: its multiples, less whole numbers, spread evenly and keep time with no cycle.
_GOLDEN = 0.6180339887498949
#: First cycles whose bins are kept apart, because a loop settles over them.
_APART = 4
#: Length of each group of later cycles over that of the one before it; chosen: a loop settles ever more slowly.
_GROWTH = 1.5


def spread_rows(rows: int, most: int) -> NDArray[np.intp]:
    """Rows that stand for all: every one of few, else `most`, spread by a step that keeps time with no cycle."""
    count = min(rows, most)
    number = np.arange(count)
    return (number if count == rows else (number + number * _GOLDEN % 1.0) * (rows / count)).astype(np.intp)


def resolved_order(rows_per_cycle: float, most: int) -> int:
    """As many harmonics as the rows of one cycle carry, from 1 to `most`."""
    return int(np.clip(rows_per_cycle / _ROWS_PER_HARMONIC, 1, most))


def basis(phase: Array, order: int) -> Array:
    """Columns 1, cos(2 pi k phase) and -sin(2 pi k phase) for k = 1 ... order, (n, 2 order + 1)."""
    rows = np.ones((2 * order + 1, phase.size))
    turn = np.exp(2j * np.pi * phase)
    power = turn.copy()
    for k in range(1, order + 1):  # row by row, which stays in the cache: ten times as fast as all powers at once
        rows[k] = power.real
        np.negative(power.imag, out=rows[order + k])
        power *= turn
    return rows.T


def least_squares(columns: Array, values: Array, weight: Array | None = None) -> Array:
    """Real coefficients that fit `values`, (n,) or (n, channels), by normal equations, each row with its weight, (n,).

    The columns are of `basis`, (n, k): nearly orthogonal over whole cycles, so that normal equations lose no digits.
    """
    weighed = columns.T if weight is None or np.all(weight == 1.0) else columns.T * weight
    return np.linalg.solve(weighed @ columns, weighed @ values)


def as_complex(real: Array) -> Array:
    """Complex coefficients of a series, (m + 1,), from its real ones."""
    order = real.size // 2
    return np.concatenate((real[:1], real[1 : order + 1] + 1j * real[order + 1 :]))


def derivative(real: Array) -> Array:
    """Real coefficients of the derivative of a series by its phase in radians."""
    order = real.size // 2
    number = np.arange(1, order + 1)
    return np.concatenate(([0.0], number * -real[order + 1 :], number * real[1 : order + 1]))


def first_amplitude(real: Array) -> float:
    """Amplitude of the first harmonic of a series."""
    return float(np.hypot(real[1], real[real.size // 2 + 1]))


def series(coefficients: Array, phase: Array) -> Array:
    """Values of a series with complex coefficients at any phase [cycles], (n,)."""
    return polyval(np.exp(2j * np.pi * phase), coefficients).real


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
