"""What was measured, gathered for drawing: operating points over their repeats, loops over the phase of the cycle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.terms import LoopTerm, SweepTerm
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
    def of(cls, terms: Sequence[SweepTerm]) -> Repeats:
        """The points of the sweeps' rows; none where there is no sweep."""
        amplitude, frequency = (
            np.concatenate([np.empty(0), *(getattr(term, name) for term in terms)])
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


def means(terms: Sequence[SweepTerm]) -> Points:
    """Mean, least and largest of the repeats of each operating point, those without weight aside."""
    terms = [term.standing() for term in terms]
    repeats = Repeats.of(terms)
    stiffness = np.concatenate([np.empty(0, dtype=complex), *(term.measured for term in terms)])

    def band(quantity: Callable[[Array], Array]) -> Band:
        values = quantity(stiffness)
        return Band(repeats.mean(values), *(repeats.summed(values, extreme) for extreme in (np.minimum, np.maximum)))

    return Points(repeats.frequency, repeats.amplitude, band(np.abs), band(lambda k: k.imag / k.real))


def wild_points(term: LoopTerm) -> tuple[Array, Array]:
    """Phase [cycles] and force [N or N m] of a loop's rows that are faults of the record, (k,) each."""
    loop, rows = term.loop, term.drive.wild["force"].rows
    return (loop.time[rows] - loop.time[0]) * term.drive.frequency, loop.force[rows]


def turn(term: LoopTerm) -> Array:
    """Phase of each row after the upper turn of the motion [deg], (n,)."""
    drive = term.drive
    return 360.0 * ((drive.phase + np.angle(drive.coefficients[1]) / (2.0 * np.pi)) % 1.0)


def over_sectors(term: LoopTerm, residual: Array) -> tuple[Array, Array, Array]:
    """Middle [deg] of each sector of the cycle that holds rows, mean residual there, and number of rows."""
    sector = (turn(term) * (SECTORS / 360.0)).astype(int) % SECTORS
    filled, count = np.unique(sector, return_counts=True)
    return (filled + 0.5) * (360.0 / SECTORS), np.bincount(sector, residual)[filled] / count, count
