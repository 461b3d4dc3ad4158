"""Outliers of a sweep: points that stand out from the model, from their neighbours, and from their repeats."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chdtri

from bushfit.effects.contract import Array
from bushfit.fitting.outliers import WINDOW, from_neighbours, limit

if TYPE_CHECKING:
    from bushfit.fitting.sweep_data import SweepData
    from bushfit.model.model import Model

#: Points of a block that count as neighbours of one: few, since stiffness bends with frequency.
_NEIGHBOURS = 5


def outlying_points(data_set: SweepData, model: Model) -> Array:
    """Points that lie farther off the model than noise reaches, and as far off their neighbours, by number.

    Where the same point was repeated, it must stand out from its repeats as well: what all of them do is no fault of
    one row. Where two repeats or more agree against it that is enough, so that outliers side by side do not hide each
    other.
    """
    deviation = data_set.deviation(model)
    distance = data_set.apart(deviation)
    reach = limit(deviation.size, 2, data_set.noise.scatter_freedom or np.inf) * misfit(distance, 2)
    far = distance > reach
    if not far.any():
        return np.flatnonzero(far)
    local = _from_neighbours(data_set, deviation, _NEIGHBOURS)
    repeats, beside = _from_repeats(data_set, local)
    alone = np.minimum(
        data_set.apart(local, shared=False), np.where(repeats > 0, data_set.apart(beside, shared=False), np.inf)
    )
    against = _from_neighbours(data_set, _from_repeats(data_set, deviation)[1], WINDOW)
    agreed = data_set.apart(against, shared=False) / np.sqrt(1.0 + np.pi / 2.0 / np.maximum(repeats, 1))
    return np.flatnonzero(far & (np.where(repeats > 1, agreed, alone) > reach))


def misfit(distance: Array, parts: int) -> float:
    """How far the bulk of all points lies off, over what noise alone makes; at least 1.

    Args:
        distance: of each point, in units of noise, (n,).
        parts: numbers that make up a point.
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
