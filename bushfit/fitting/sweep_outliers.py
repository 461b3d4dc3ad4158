"""Outliers of a sweep: points that stand out from the model, from their neighbours, and from their repeats."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from scipy.special import chdtri

from bushfit.effects.contract import Array
from bushfit.fitting.outliers import NEIGHBOURS, from_neighbours, outlier_limit

#: Points of a block that count as neighbours of one where a model was taken off: few, since stiffness that the model
#: misses bends with frequency.
_NEAR_NEIGHBOURS = 5


def outlying_points(
    deviation: Array, apart: Callable[..., Array], starts: Array, points: Array, freedom: float
) -> Array:
    """Points that lie farther off the model than noise reaches, and as far off their neighbours, by number, (k,).

    A point that was repeated must stand out from its repeats as well: what all of them do is no fault of one row.
    Where two repeats or more agree against it that is enough, so that outliers side by side do not hide each other.

    Args:
        deviation: of each point from the model, gain and phase, complex (n,).
        apart: length of deviations in units of noise; `shared=False` leaves in what blocks share.
        starts: index of the first point of each block.
        points: frequency and amplitude, (2, n); where both agree, points are repeats.
        freedom: degrees of freedom behind the noise; inf where it is known.
    """
    distance = apart(deviation)
    limit = outlier_limit(deviation.size, 2, freedom) * misfit_scale(distance, 2)
    far = distance > limit
    if not far.any():
        return np.flatnonzero(far)
    local = _from_neighbours(deviation, starts, _NEAR_NEIGHBOURS)
    repeats, beside = _from_repeats(local, points)
    alone = np.minimum(apart(local, shared=False), np.where(repeats > 0, apart(beside, shared=False), np.inf))
    against = _from_neighbours(_from_repeats(deviation, points)[1], starts, NEIGHBOURS)
    # the median of n repeats has pi/(2 n) of the variance of one
    agreed = apart(against, shared=False) / np.sqrt(1.0 + np.pi / 2.0 / np.maximum(repeats, 1))
    return np.flatnonzero(far & (np.where(repeats > 1, agreed, alone) > limit))


def misfit_scale(distance: Array, parts: int) -> float:
    """Median distance from the model, in units of noise, over the median that noise alone makes; at least 1.

    A point is made of so many `parts`: 1 for a force, 2 for a complex stiffness.
    """
    if not distance.size:
        return 1.0
    return max(1.0, float(np.median(distance) / np.sqrt(chdtri(parts, 0.5))))


def _from_neighbours(values: Array, starts: Array, window: int) -> Array:
    """Distance of each point from the median of those around it in its block, complex (n,)."""
    local = np.zeros_like(values)
    for first, last in pairwise([*starts.tolist(), values.size]):
        rows = np.arange(last - first)
        real, imag = (from_neighbours(part[first:last], rows, window) for part in (values.real, values.imag))
        local[first:last] = real + 1j * imag
    return local


def _from_repeats(values: Array, points: Array) -> tuple[Array, Array]:
    """How many other repeats each point has, (n,), and its distance from their median, 0 without any, complex (n,)."""
    repeats, distance = np.zeros(values.size, dtype=int), np.zeros_like(values)
    _, place = np.unique(points, axis=1, return_inverse=True)
    for row, same in enumerate(place == place[:, None]):
        same[row] = False
        repeats[row] = np.count_nonzero(same)
        if repeats[row]:
            distance[row] = values[row] - np.median(values[same].real) - 1j * np.median(values[same].imag)
    return repeats, distance
