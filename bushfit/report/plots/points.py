"""What was measured, gathered for drawing: operating points over their repeats, loops over the phase of the cycle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple, TypeVar

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import LoopData, SweepData
from bushfit.geometry import Place
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


def outliers(data_set: LoopData) -> tuple[Array, Array]:
    """Phase [cycles] and force [N or N m] of a loop's outliers, the rows that are faults of the record, (k,) each."""
    loop, rows = data_set.test, data_set.drive.outliers["force"].rows
    return (loop.time[rows] - loop.time[0]) * data_set.drive.frequency, loop.force[rows]


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
