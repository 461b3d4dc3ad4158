"""What a gap figure shows: how far measurement and model are apart, in units of noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import DataSet, LoopData, SweepData
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.report.plots.points import Repeats, over_sectors

_T = TypeVar("_T", SweepData, LoopData)


class Map(NamedTuple):
    """Measured less model at each operating point of a direction, over the noise of its mean."""

    points: Repeats
    storage: Array
    loss: Array


class Curve(NamedTuple):
    """Measured less model over the cycle of a loop [deg], over the noise of a sector's mean."""

    phase: Array
    values: Array


class Side(NamedTuple):
    """A column: a model's title and all that is drawn of it."""

    title: str
    gap: float
    maps: Mapping[Direction, Map]
    loops: Mapping[Direction, Sequence[Curve]]


def by_direction(data_sets: Sequence[_T]) -> dict[Direction, list[_T]]:
    """In the order of the tests."""
    directions = dict.fromkeys(data_set.direction for data_set in data_sets)
    return {
        direction: [data_set for data_set in data_sets if data_set.direction is direction] for direction in directions
    }


def columns(before: Model, after: Model, data_sets: Sequence[DataSet]) -> list[tuple[Model, str]]:
    """What stands side by side, and its title: one model where both respond alike."""
    if all(np.array_equal(data_set.residual(before), data_set.residual(after)) for data_set in data_sets):
        return [(before, "nothing added")]
    added = [name for name in after.effects if name not in before.effects]
    return [(before, "before"), (after, f"after adding {' and '.join(added)}" if added else "after")]


def side_of(
    model: Model,
    name: str,
    data_sets: Sequence[DataSet],
    sweeps: Mapping[Direction, Sequence[SweepData]],
    loops: Mapping[Direction, Sequence[LoopData]],
) -> Side:
    """A model against all tests."""
    gap = float(np.sqrt(np.mean(np.square(np.concatenate([data_set.residual(model) for data_set in data_sets])))))
    return Side(
        name,
        gap,
        {direction: _map(model, mine) for direction, mine in sweeps.items()},
        {direction: [_curve(model, data_set) for data_set in mine] for direction, mine in loops.items()},
    )


def _map(model: Model, data_sets: Sequence[SweepData]) -> Map:
    """Repeats differ by what scatters from point to point and by what each block shares: both average out."""
    points = Repeats.of(data_sets)
    deviation = -np.concatenate([data_set.deviation(model) for data_set in data_sets])
    noise = np.array(
        [data_set.noise.random[data_set.name, float(x)] for data_set in data_sets for x in data_set.amplitude]
    )
    shared = np.array([data_set.noise.shared for data_set in data_sets for _ in data_set.amplitude])
    variance = np.square(noise) + np.square(shared)
    storage, loss = (
        points.summed(part) / np.sqrt(points.summed(square))
        for part, square in zip((deviation.real, deviation.imag), variance.T, strict=True)
    )
    return Map(points, storage, loss)


def _curve(model: Model, data_set: LoopData) -> Curve:
    phase, mean, count = over_sectors(data_set, -data_set.residual(model))
    return Curve(phase, mean * np.sqrt(count))


def has_holes(drawn: Map) -> bool:
    """Whether a level lacks a frequency that another has."""
    points = drawn.points
    return points.frequency.size < np.unique(points.frequency).size * np.unique(points.amplitude).size
