"""Wild points: rows that stand out from the model, or from a smooth curve, and from their own neighbours as well.

Physics that a model lacks misses whole stretches of a test and leaves neighbours alike; only a fault of the record
puts one row far from the rows beside it. So a misfit, however large, makes no outliers.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.special import fdtri

from bushfit.effects.contract import Array
from bushfit.reduction.scatter import MEDIAN_TO_SIGMA

#: Probability that noise alone makes one outlier among all rows of a test.
_CHANCE = 0.01
#: Rows over which neighbours are taken together, and equal values in a row that count as a stuck channel.
WINDOW, _STUCK = 11, 4
#: Most rows of a burst.
_BURST = 8
#: Rows from which the bends of a record are taken, and the noise relative to its range beyond which it has any.
_MOST_BENDS, _NOISY = 100_000, 1e-4
#: Share of the half range that a gross row lies off its neighbours, and share of all rows beyond which none is gross.
_GROSS, _MOST_GROSS = 0.3, 0.1
#: Degrees of freedom of a noise that is as good as known.
_KNOWN = 1e6


def limit(rows: int, parts: int, freedom: float) -> float:
    """Distance, in units of noise, that noise alone reaches once in a hundred tests of so many rows.

    Args:
        rows: of the test.
        parts: numbers in a row: 1 for a force, 2 for a complex stiffness.
        freedom: degrees of freedom behind the noise.
    """
    return float(np.sqrt(parts * fdtri(parts, min(freedom, _KNOWN), 1.0 - _CHANCE / max(rows, 1))))


def from_neighbours(values: Array, rows: Array, window: int = WINDOW) -> Array:
    """Distance of some rows from the median over their neighbours and themselves, (len(rows),)."""
    width = min(window, values.size)
    first = np.clip(rows - width // 2, 0, values.size - width)
    around = values[first[:, None] + np.arange(width)]
    return values[rows] - np.median(around, axis=1)


def outlier_rows(left: Array, recorded: Array, reach: float) -> Array:
    """Rows farther than `reach` off a curve that are as far off their neighbours, or where the channel is stuck.

    Args:
        left: what the curve leaves of each row, (n,).
        recorded: what was recorded, (n,).
        reach: in the units of `left`.
    """
    far = np.abs(left) > reach
    rows = np.flatnonzero(far)
    if not rows.size:
        return rows
    alone = np.abs(from_neighbours(left, rows)) > reach
    stuck = _run_lengths(recorded[1:] == recorded[:-1])
    stuck = np.maximum(np.append(stuck, 0), np.append(0, stuck))[rows] >= _STUCK - 1
    return rows[alone | stuck | _burst(left, far, reach)[rows]]


def stuck_rows(recorded: Array) -> Array:
    """Rows that repeat the one before them over and over, where the channel has noise that forbids it.

    How often two neighbours are equal by the resolution of the record is counted outside such runs.
    """
    equal = recorded[1:] == recorded[:-1]
    runs = _run_lengths(equal)
    by_chance = max(int(np.count_nonzero(equal & (runs < _STUCK - 1))), 1) / recorded.size
    unlikely = (runs >= _STUCK - 1) & (recorded.size * by_chance ** np.minimum(runs, 99) < _CHANCE)
    if not unlikely.any():
        return np.empty(0, dtype=np.intp)
    bends = float(np.median(np.abs(np.diff(recorded[:_MOST_BENDS], 2)))) / np.sqrt(6.0)
    noisy = MEDIAN_TO_SIGMA * bends > _NOISY * float(np.ptp(recorded))
    return np.flatnonzero(unlikely) + 1 if noisy else np.empty(0, dtype=np.intp)


def _burst(left: Array, far: Array, reach: float) -> Array:
    """Rows of short runs of far rows that lie as far off the rows before and after the run, (n,)."""
    runs = np.where(far, _run_lengths(far), 0)
    near = np.flatnonzero(~far)
    if not near.size:
        return np.zeros(far.size, dtype=bool)
    index = np.arange(far.size)
    after = np.minimum(np.searchsorted(near, index), near.size - 1)
    before = np.maximum(np.searchsorted(near, index) - 1, 0)
    beside = np.minimum(np.abs(left - left[near[before]]), np.abs(left - left[near[after]]))
    return (runs > 0) & (runs <= _BURST) & (beside > reach)


def _run_lengths(mask: Array) -> Array:
    """Length of the run of equal entries that each entry belongs to, (n,)."""
    edges = np.flatnonzero(np.concatenate(([True], mask[1:] != mask[:-1], [True])))
    return np.where(mask, np.repeat(np.diff(edges), np.diff(edges)), 0)


def gross_rows(values: Array) -> Array:
    """Rows of a periodic motion that lie far off the median of those around them, before its period is known.

    None where these are many, down to a median of five: then the motion turns within so few rows.
    """
    for width in (WINDOW, 5):
        level = median_filter(values, width, mode="nearest")
        off = np.abs(values - level) > _GROSS / 2.0 * float(np.ptp(level))
        if np.mean(off) < _MOST_GROSS:
            return np.flatnonzero(off)
    return np.empty(0, dtype=np.intp)
