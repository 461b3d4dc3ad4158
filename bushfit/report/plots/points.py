"""What was measured, gathered for drawing: operating points over repeats, loops over the phase, and the misfit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeVar, cast

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import DataSet, LoopData, SweepData
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.prediction.stiffness import Band
from bushfit.reading.measurement import SAME_TEMPERATURE, Stepped
from bushfit.units import CELSIUS, number, told

_T = TypeVar("_T", SweepData, LoopData)

#: Parts of a cycle over which a loop's residuals are averaged: 10 deg each, in which a slow loop has dozens of rows.
SECTORS = 36

#: Bins of time in which a long record is drawn, from its least to its largest value: more than a figure has pixels.
BINS = 1500
#: What is drawn along the x axis: what a test steps through while it holds the other.
Axis = Literal["frequency", "amplitude"]
#: Most rows of a map: each is then 1.7 mm high, and its bars and the lines between rows are still seen.
_MOST_ROWS = 24


def by_direction(data_sets: Sequence[_T]) -> dict[Place, list[_T]]:
    """The tests of each direction, in the order of the tests."""
    return {
        direction: [data_set for data_set in data_sets if data_set.direction == direction]
        for direction in dict.fromkeys(data_set.direction for data_set in data_sets)
    }


class Kind(NamedTuple):
    """What the sweeps of a row of panels have in common: where they were made, and what they step through."""

    place: Place
    stepped: Stepped | None

    @property
    def axis(self) -> Axis:
        """What lies along x; the frequency, too, where nothing was held."""
        return "amplitude" if self.stepped == "amplitude" else "frequency"

    @property
    def palette(self) -> str:
        """The colours of `curves_of` it."""
        return "temperature" if self.stepped else "loop"


def by_kind(data_sets: Sequence[SweepData]) -> dict[Kind, list[SweepData]]:
    """The sweeps of each place that step through the same, in the order of the tests."""
    kinds: dict[Kind, list[SweepData]] = {}
    for data_set in data_sets:
        kinds.setdefault(Kind(data_set.direction, data_set.sweep.stepped), []).append(data_set)
    return kinds


class Curve(NamedTuple):
    """Points that are drawn as one curve: the number of their test, which of its points, (n,) bool, and a name."""

    test: int
    points: Array
    name: str


def curves_of(data_sets: Sequence[SweepData], kind: Kind) -> list[Curve]:
    """The curves of sweeps whose levels tests do not share: each test where nothing was held, and of tests that lie
    apart in temperature each level of each, the coldest first; none of others."""
    if kind.stepped is None:
        return [Curve(at, np.ones(one.frequency.size, dtype=bool), one.name) for at, one in enumerate(data_sets)]
    degrees = [float(np.mean(one.temperature)) - CELSIUS for one in data_sets]
    if not np.ptp(degrees) > SAME_TEMPERATURE:
        return []
    held = [getattr(one, held_with(kind.axis)) for one in data_sets]
    unit, scale = ("Hz", 1.0) if kind.axis == "amplitude" else kind.place.display.displacement
    return [
        Curve(at, held[at] == level, f"{number(degrees[at], 3)} degC, {told(unit, scale * level)}")
        for at in np.argsort(degrees, kind="stable").tolist()
        for level in np.unique(held[at])
    ]


def held_with(axis: Axis) -> Axis:
    """What is held while the other is stepped through."""
    return "amplitude" if axis == "frequency" else "frequency"


@dataclass(frozen=True, eq=False)
class Points:
    """Dynamic stiffness over operating points: means of repeats, or a model's lines.

    Args:
        frequency: [Hz], (n,).
        amplitude: zero-to-peak [m or rad], (n,).
        stiffness: |K| [N/m or N m/rad], (n,).
        loss_factor: K''/K', (n,).
    """

    frequency: Array
    amplitude: Array
    stiffness: Band
    loss_factor: Band


@dataclass(frozen=True, eq=False)
class Repeats:
    """Operating points of some sweeps, sorted by what is held, then by what is stepped, and which rows repeat each.

    Args:
        along: what is stepped, such as the frequency [Hz], (k,).
        held: what is held meanwhile, such as the amplitude [m or rad], (k,).
        count: rows at each point, (k,).
        rows: all rows of the sweeps, one after the other, in the order of the points, (n,).
    """

    along: Array
    held: Array
    count: Array
    rows: Array

    @classmethod
    def at(cls, along: Array, held: Array) -> Repeats:
        """The points of some rows, each (n,)."""
        spots, place = np.unique(np.stack((held, along)), axis=1, return_inverse=True)
        place = place.ravel()
        return cls(spots[1], spots[0], np.bincount(place), np.argsort(place, kind="stable"))

    def summed(self, values: Array, function: np.ufunc = np.add) -> Array:
        """Sum of a row's values (or their least, largest) at each point, (n,) -> (k,)."""
        return function.reduceat(values[self.rows], np.cumsum(self.count) - self.count)

    def mean(self, values: Array) -> Array:
        """Mean of a row's values at each point, (n,) -> (k,)."""
        return self.summed(values) / self.count


def means(data_sets: Sequence[SweepData]) -> Points:
    """Mean, least and largest value over the repeats of each operating point; rows without weight do not count."""
    data_sets = [data_set.with_weight() for data_set in data_sets]
    rows = [(data_set.frequency, data_set.amplitude, data_set.measured) for data_set in data_sets]
    frequency, amplitude, stiffness = np.hstack([np.empty((3, 0), dtype=complex), *rows])
    repeats = Repeats.at(frequency.real, amplitude.real)

    def band(quantity: Callable[[Array], Array]) -> Band:
        values = quantity(stiffness)
        return Band(repeats.mean(values), *(repeats.summed(values, extreme) for extreme in (np.minimum, np.maximum)))

    return Points(repeats.along, repeats.held, band(np.abs), band(lambda k: k.imag / k.real))


def ranges(time: Array, values: Array) -> tuple[Array, Array, Array]:
    """Start of each bin of time that holds rows, and the least and the largest value there, (k,) each, k <= BINS."""
    first = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], BINS + 1)[:-1]))
    return time[first], np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)


def phase_after_turn(data_set: LoopData) -> Array:
    """Phase of each row after the upper turn of the motion [deg], (n,)."""
    drive = data_set.drive
    return 360.0 * ((drive.phase + np.angle(drive.coefficients[1]) / (2.0 * np.pi)) % 1.0)


def over_sectors(data_set: LoopData) -> tuple[Array, Array]:
    """Middle [deg] of each sector of the cycle that holds rows, (k,), and the share of each row in its mean, (k, n)."""
    sector = (phase_after_turn(data_set) * (SECTORS / 360.0)).astype(int) % SECTORS
    filled, count = np.unique(sector, return_counts=True)
    return (filled + 0.5) * (360.0 / SECTORS), (sector == filled[:, None]) / count[:, None]


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
    curves: dict[Place, list[tuple[Array, Array]]] = {place: [] for place in loops}
    for place, test in ((place, cast("LoopData", later[test])) for place, each in loops.items() for test in each):
        phase, shares = over_sectors(test)
        noise = test.drive.row_noise.error_of_sums(shares)
        curves[place].append((phase, -shares @ test.misfit(model) / noise))
    return Side(name, gap, maps, curves)


def _map(model: Model, kind: Kind, data_sets: Sequence[SweepData]) -> Map:
    """Mean deviation of each cell over the noise of that mean, of sweeps of one kind.

    Repeats differ by what scatters from point to point and by what each block shares: both average out.
    """
    axes = kind.axis, held_with(kind.axis)
    along, held = (np.concatenate([getattr(data_set, name) for data_set in data_sets]) for name in axes)
    repeated = bool(Repeats.at(along, held).count.max() > 1)
    if curves := curves_of(data_sets, kind):
        own = [np.empty(data_set.frequency.size) for data_set in data_sets]
        for number, curve in enumerate(curves, start=1):
            own[curve.test][curve.points] = number
        held = np.concatenate(own)
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
