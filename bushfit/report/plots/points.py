"""What was measured, gathered for drawing: operating points over their repeats, loops over the phase of the cycle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import LoopData, SweepData
from bushfit.prediction import Band

#: Parts of a cycle over which a loop's residuals are averaged.
SECTORS = 36


@dataclass(frozen=True, eq=False)
class Points:
    """Stiffness over operating points: means of repeats, or a model's lines."""

    frequency: Array
    amplitude: Array
    stiffness: Band
    loss_factor: Band


@dataclass(frozen=True, eq=False)
class Repeats:
    """Operating points of some sweeps, sorted by amplitude, then frequency, and which rows repeat each.

    Args:
        frequency: [Hz], (k,).
        amplitude: [m or rad], (k,).
        count: rows at each point, (k,).
        rows: all rows of the sweeps, one after the other, in the order of the points, (n,).
    """

    frequency: Array
    amplitude: Array
    count: Array
    rows: Array

    @classmethod
    def of(cls, data_sets: Sequence[SweepData]) -> Repeats:
        """The points of the sweeps' rows; none where there is no sweep."""
        amplitude, frequency = (
            np.concatenate([np.empty(0), *(getattr(data_set, name) for data_set in data_sets)])
            for name in ("amplitude", "frequency")
        )
        spots, place = np.unique(np.stack((amplitude, frequency)), axis=1, return_inverse=True)
        place = place.ravel()
        return cls(spots[1], spots[0], np.bincount(place), np.argsort(place, kind="stable"))

    def summed(self, values: Array, function: np.ufunc = np.add) -> Array:
        """Sum of a row's values (or their least, largest) at each point, (n,) -> (k,)."""
        return function.reduceat(values[self.rows], np.cumsum(self.count) - self.count)

    def mean(self, values: Array) -> Array:
        """(n,) -> (k,)"""
        return self.summed(values) / self.count


def means(data_sets: Sequence[SweepData]) -> Points:
    """Mean, least and largest of the repeats of each operating point, those without weight aside."""
    data_sets = [data_set.standing() for data_set in data_sets]
    repeats = Repeats.of(data_sets)
    stiffness = np.concatenate([np.empty(0, dtype=complex), *(data_set.measured for data_set in data_sets)])

    def band(quantity: Callable[[Array], Array]) -> Band:
        values = quantity(stiffness)
        return Band(repeats.mean(values), *(repeats.summed(values, extreme) for extreme in (np.minimum, np.maximum)))

    return Points(repeats.frequency, repeats.amplitude, band(np.abs), band(lambda k: k.imag / k.real))


def wild_points(data_set: LoopData) -> tuple[Array, Array]:
    """Phase [cycles] and force [N or N m] of a loop's rows that are faults of the record, (k,) each."""
    loop, rows = data_set.test, data_set.drive.outliers["force"].rows
    return (loop.time[rows] - loop.time[0]) * data_set.drive.frequency, loop.force[rows]


def turn(data_set: LoopData) -> Array:
    """Phase of each row after the upper turn of the motion [deg], (n,)."""
    drive = data_set.drive
    return 360.0 * ((drive.phase + np.angle(drive.coefficients[1]) / (2.0 * np.pi)) % 1.0)


def over_sectors(data_set: LoopData, residual: Array) -> tuple[Array, Array, Array]:
    """Middle [deg] of each sector of the cycle that holds rows, mean residual there, and number of rows."""
    sector = (turn(data_set) * (SECTORS / 360.0)).astype(int) % SECTORS
    filled, count = np.unique(sector, return_counts=True)
    return (filled + 0.5) * (360.0 / SECTORS), np.bincount(sector, residual)[filled] / count, count
