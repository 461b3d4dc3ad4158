"""Outliers of a sweep: points that stand out from the model, from their neighbours, and from their repeats."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from bushfit.effects.contract import Array
from bushfit.fitting.outliers import NEIGHBOURS, from_neighbours, outlier_limit

if TYPE_CHECKING:
    from bushfit.fitting.sweep_data import SweepData
    from bushfit.model.model import Model

#: Points of a block that count as neighbours of one where a model was taken off: few, since stiffness that the model
#: misses bends with frequency.
_NEAR_NEIGHBOURS = 5


def outlying_points(data_set: SweepData, model: Model) -> Array:
    """Points that lie farther off the model than noise reaches, and as far off their neighbours, by number, (k,).

    A point that was repeated must stand out from its repeats as well: what all of them do is no fault of one row.
    Where two repeats or more agree against it that is enough, so that outliers side by side do not hide each other.
    """
    deviation = data_set.deviation(model)
    distance = data_set.apart(deviation)
    scale = misfit_scale(distance, 2)
    limit = outlier_limit(deviation.size, 2, data_set.noise.scatter_freedom or np.inf) * scale
    far = distance > limit
    if not far.any():
        return np.flatnonzero(far)
    local = _from_neighbours(data_set, deviation, _NEAR_NEIGHBOURS)
    repeats, beside = _from_repeats(data_set, local)
    alone = np.minimum(
        data_set.apart(local, shared=False), np.where(repeats > 0, data_set.apart(beside, shared=False), np.inf)
    )
    against = _from_neighbours(data_set, _from_repeats(data_set, deviation)[1], NEIGHBOURS)
    # the median of n repeats has pi/(2 n) of the variance of one
    agreed = data_set.apart(against, shared=False) / np.sqrt(1.0 + np.pi / 2.0 / np.maximum(repeats, 1))
    return np.flatnonzero(far & (np.where(repeats > 1, agreed, alone) > limit))


def misfit_scale(distance: Array, parts: int) -> float:
    """Median distance of all points from the model over the median that noise alone makes; at least 1.

    Args:
        distance: of each point, in units of noise, (n,).
        parts: numbers that make up a point: 1 for a force, 2 for a complex stiffness.
    """
    if not distance.size:
        return 1.0
    return max(1.0, float(np.median(distance) / np.sqrt(chdtri(parts, 0.5))))


def _from_neighbours(data_set: SweepData, values: Array, window: int) -> Array:
    """Distance of each point from the median of those around it in its block, complex (n,)."""
    local = np.zeros_like(values)
    for first, last in pairwise([*data_set.block_starts.tolist(), values.size]):
        rows = np.arange(last - first)
        real, imag = (from_neighbours(part[first:last], rows, window) for part in (values.real, values.imag))
        local[first:last] = real + 1j * imag
    return local


def _from_repeats(data_set: SweepData, values: Array) -> tuple[Array, Array]:
    """How many other repeats each point has, (n,), and its distance from their median, 0 without any, complex (n,)."""
    repeats, distance = np.zeros(values.size, dtype=int), np.zeros_like(values)
    points = np.stack((data_set.frequency, data_set.amplitude))
    _, place = np.unique(points, axis=1, return_inverse=True)
    for row, same in enumerate(place == place[:, None]):
        same[row] = False
        repeats[row] = np.count_nonzero(same)
        if repeats[row]:
            distance[row] = values[row] - np.median(values[same].real) - 1j * np.median(values[same].imag)
    return repeats, distance
