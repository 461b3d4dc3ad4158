"""What a gap figure shows: how far measurement and model are apart, in units of noise."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, cast

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import DataSet, LoopData, SweepData
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.report.plots.points import Kind, Repeats, curves_of, held_with, over_sectors

#: Most rows of a map: each is then 1.7 mm high, and its bars and the lines between rows are still seen.
_MOST_ROWS = 24


class Map(NamedTuple):
    """Measured less model at each operating point of a kind of sweeps, over the noise of its mean.

    Args:
        points: the operating points, by what is stepped (the frequency where nothing is held) and by row: what is held,
            or the number of the curve; neighbouring values count as one where there are more than rows, (k,).
        storage: the real part of what is left, (k,).
        loss: the imaginary part, (k,).
        repeated: whether an operating point was measured more than once.
        merged: how many held values a row stands for at most.
    """

    points: Repeats
    storage: Array
    loss: Array
    repeated: bool
    merged: int


class Side(NamedTuple):
    """A column: a model's title and all that is drawn of it.

    Of each loop the phase of the cycle [deg], and measured less model over the noise of a sector's mean.
    """

    title: str
    gap: float
    maps: Mapping[Kind, Map]
    loops: Mapping[Place, Sequence[tuple[Array, Array]]]


def columns(before: Model, after: Model, later: Mapping[DataSet, DataSet]) -> list[tuple[Model, str]]:
    """The models that stand side by side, and their titles: one model where both respond alike.

    `later` has for each test the one that belongs to the model after: the same, or the test as mended.
    """
    if all(np.array_equal(test.residual(before), mended.residual(after)) for test, mended in later.items()):
        return [(before, "nothing added")]
    if added := [name for name in after.effects if name not in before.effects]:
        return [(before, "before"), (after, f"after adding {' and '.join(added)}")]
    if any(test is not mended for test, mended in later.items()):
        return [(before, "the tests as they are"), (after, "if the record is mistaken")]
    return [(before, "before"), (after, "after")]


def side_of(
    model: Model,
    name: str,
    later: Mapping[DataSet, DataSet],
    sweeps: Mapping[Kind, Sequence[SweepData]],
    loops: Mapping[Place, Sequence[LoopData]],
) -> Side:
    """What is drawn of a model against all tests, each in place of the one that `later` has it for."""
    squares = sum(np.square(data_set.residual(model)).sum() for data_set in later.values())
    gap = float(np.sqrt(squares / max(sum(data_set.counted for data_set in later.values()), 1)))
    maps = {kind: _map(model, kind, [cast("SweepData", later[test]) for test in each]) for kind, each in sweeps.items()}
    curves = {place: [_curve(model, cast("LoopData", later[test])) for test in each] for place, each in loops.items()}
    return Side(name, gap, maps, curves)


def _map(model: Model, kind: Kind, data_sets: Sequence[SweepData]) -> Map:
    """Mean deviation of each cell over the noise of that mean, of sweeps of one kind.

    Repeats differ by what scatters from point to point and by what each block shares: both average out.
    """
    axes = kind.axis, held_with(kind.axis)
    along, held = (np.concatenate([getattr(data_set, name) for data_set in data_sets]) for name in axes)
    if curves := curves_of(data_sets, kind):
        own = [np.empty(data_set.frequency.size) for data_set in data_sets]
        for number, curve in enumerate(curves, start=1):
            own[curve.test][curve.points] = number
        held = np.concatenate(own)
    repeated = bool(Repeats.at(along, held).count.max() > 1)
    row = map_rows(held)
    points = Repeats.at(along, row)
    merged = max(np.unique(held[row == level]).size for level in np.unique(row))
    deviation = -np.concatenate([data_set.deviation(model) for data_set in data_sets])
    noise = np.array([data_set.noise.random[data_set.name, float(x)] for data_set in data_sets for x in data_set.held])
    shared = np.array([data_set.noise.shared for data_set in data_sets for _ in data_set.amplitude])
    variance = np.square(noise) + np.square(shared)
    storage, loss = (
        points.summed(part) / np.sqrt(points.summed(square))
        for part, square in zip((deviation.real, deviation.imag), variance.T, strict=True)
    )
    return Map(points, storage, loss, repeated, merged)


def map_rows(held: Array) -> Array:
    """The held value of each point's row in a map, (n,) -> (n,).

    Its own, but where there are more values than rows: then the geometric mean of those in its row, one of as many
    equal steps of the logarithm as there are rows.
    """
    levels, place = np.unique(held, return_inverse=True)
    if levels.size <= _MOST_ROWS:
        return held
    size = np.log(levels)
    row = np.minimum((_MOST_ROWS * (size - size[0]) / (size[-1] - size[0])).astype(int), _MOST_ROWS - 1)
    _, row = np.unique(row, return_inverse=True)
    means = np.exp(np.bincount(row, size) / np.bincount(row))
    return means[row[place]]


def _curve(model: Model, data_set: LoopData) -> tuple[Array, Array]:
    """Phase of the cycle [deg], and mean residual of each sector of a loop's cycle over the noise of that mean."""
    phase, shares = over_sectors(data_set)
    return phase, -shares @ data_set.misfit(model) / data_set.drive.row_noise.error_of_sums(shares)
