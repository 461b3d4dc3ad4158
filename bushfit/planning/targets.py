"""Targets: 95 % intervals that tests are to reach, how wide they come out, and by what one fails that none reaches."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.result import Range, Result
from bushfit.planning.contract import Knowledge, Points, Target, Wanted
from bushfit.prediction.caveats import unfitted
from bushfit.prediction.stiffness import predict
from bushfit.units import format_range, number

#: Runs of each test that stand for no end of them; chosen: years of the rig, in which what scatters is gone.
ENDLESS = 1000
#: Half interval over that of endless tests, which is as near to a target beyond their reach as a plan goes; chosen.
_NEARLY = 1.1


@dataclass(frozen=True, eq=False)
class Goal:
    """A target as a function of the parameters' covariance; k parameters, with those at a bound, at n points.

    Args:
        rows: relative change of the quantity at each point by relative change of the parameters, (n, k).
        own: its relative standard error by the model's own error, which no test lowers, (n,).
        open: by how much readings widen the half interval that tests leave undecided, relative, (n,).
        points: where; None of a parameter.
    """

    target: Target
    rows: Array
    own: Array
    open: Array
    points: Points | None = None

    def halves(self, error_covariance: Array) -> Array:
        """Half of the 95 % interval over the value at each point, (n,), of a covariance of the parameters, (k, k)."""
        return self.open + Z95 * np.sqrt(self._variance(error_covariance) + self.own**2)

    def half(self, error_covariance: Array) -> float:
        """The widest of them."""
        return float(self.halves(error_covariance).max())

    def met(self, error_covariance: Array) -> bool:
        """True if the interval is as narrow as the target."""
        return self.half(error_covariance) <= self.target.half * (1.0 + 1e-9)

    def reached(self, error_covariance: Array, endless: Array) -> bool:
        """True if the target is met, or nearly as narrow as endless tests make it if these miss it, too."""
        return self.met(error_covariance) or (
            not self.met(endless) and self.half(error_covariance) <= _NEARLY * self.half(endless)
        )

    def weight(self, endless: Array) -> Array:
        """Weight of the parameters' covariance, (k, k): mean variance relative to the one that the target allows.

        If endless tests miss the target, relative to nearly the variance that these leave."""
        left = np.square(np.maximum(self.target.half - self.open, 0.0) / Z95) - self.own**2
        nearly = np.square(_NEARLY * self.halves(endless) / Z95) - self.own**2 - np.square(self.open / Z95)
        allowed = np.where(self.met(endless), left, nearly)
        return np.asarray((self.rows / allowed[:, None]).T @ self.rows / len(self.rows))

    def why_not(self, knowledge: Knowledge, endless: Array) -> str:
        """Sentence on the largest error that remains with endless tests, at the widest point."""
        worst, variance = int(np.argmax(self.halves(endless))), self._variance(endless)
        by = np.abs(self.rows[worst]) * np.sqrt(np.diag(endless))
        name = (*knowledge.names, *knowledge.bounded)[int(np.argmax(by))]
        gain, phase = knowledge.noise.level
        of_class = f"{number(100.0 * gain, 2)} % of gain and {number(1e3 * phase, 2)} mrad of phase"
        if variance[worst] > 0.25 * self._variance(knowledge.covariance)[worst]:
            of_tests = f"{name}, which no test on offer tells well enough"
        else:
            of_tests = f"the class of the rig, {of_class} that all repeats of a test share, in {name}"
        size, words = max(
            (Z95 * float(self.own[worst]), "the model's own error: no test lowers it, naming what it lacks may"),
            (float(self.open[worst]), "what the tests leave undecided: bushfit diagnose names the test that tells"),
            (Z95 * float(np.sqrt(variance[worst])), of_tests),
        )
        where = ""
        if self.points:
            unit, factor = self.points.place.display.displacement
            frequency, amplitude = (float(each[worst]) for each in (self.points.frequency, self.points.amplitude))
            where = f" at {format_range('Hz', frequency)} and {format_range(unit, factor * amplitude)}"
        return f"{percent(size)}{where} is {words}"

    def _variance(self, error_covariance: Array) -> Array:
        """Relative variance of the quantity by the parameters' errors, (n,)."""
        return np.asarray(np.einsum("nk,kl,nl->n", self.rows, error_covariance, self.rows))


def goals(knowledge: Knowledge, wanted: Wanted, slopes: Array) -> Iterator[Goal]:
    """A goal for each target.

    Args:
        slopes: gain and phase of the stiffness at all points wanted by relative change of the parameters, (k, 2, n).
    """
    names, ends = (
        (*knowledge.names, *knowledge.bounded),
        np.cumsum([each.frequency.size for each in wanted.points])[:-1],
    )
    at = {each.place: (each, part) for each, part in zip(wanted.points, np.split(slopes, ends, axis=-1), strict=True)}
    for target in wanted.targets:
        if target.place is None:
            row = np.array([[float(name == target.quantity) for name in names]])
            yield Goal(target, row, np.zeros(1), np.zeros(1))
        else:
            yield _of_points(knowledge, target, *at[target.place])


def own_bands(knowledge: Knowledge, points: Points) -> tuple[tuple[Array, Array, Array], ...]:
    """Errors of a prediction that no further test lowers: those of the model itself, and of readings left undecided.

    Returns:
        Of the stiffness and of the loss factor at each point: value, standard error of the model, and the half width
        that undecided readings add, (n,) each [SI].
    """
    exact = replace(knowledge.result or Result(knowledge.model), covariance=Covariance())
    found, sizes, rates = (
        predict(exact, points.place, points.frequency, points.amplitude),
        points.amplitude,
        points.frequency,
    )
    index = np.searchsorted(np.unique(sizes), sizes) * np.unique(rates).size + np.searchsorted(np.unique(rates), rates)
    bands = []
    for band in (found.stiffness, found.loss_factor):
        value, half = band.value[index], np.maximum(band.high - band.value, band.value - band.low)[index]
        error = np.linalg.norm(band.root, axis=0)[index]
        bands.append((value, error, np.maximum(half - Z95 * error, 0.0)))
    return tuple(bands)


def _of_points(knowledge: Knowledge, target: Target, points: Points, slopes: Array) -> Goal:
    """The goal of a predicted quantity."""
    stiffness, loss_factor = own_bands(knowledge, points)
    value, error, undecided = stiffness if target.quantity == "stiffness" else loss_factor
    loss = loss_factor[0]
    rows = slopes[:, 0] if target.quantity == "stiffness" else slopes[:, 1] * (1.0 + loss**2) / loss
    return Goal(target, rows.T, error / value, undecided / value, points)


def untested(knowledge: Knowledge, place: Place, tested: Iterable[str]) -> str | None:
    """Sentence on the error that intervals at an untested place lack; None if they lack none."""
    measured = knowledge.result.measured if knowledge.result else None
    directions = dict.fromkeys([*(measured.directions if measured else ()), *tested])
    reached = measured or Range((1.0, 1.0), (1.0, 1.0))
    result = Result(knowledge.model, knowledge.names, measured=replace(reached, directions=tuple(directions)))
    return next(unfitted(result, place), None) if str(place) not in directions else None


def percent(half: float, digits: int = 2) -> str:
    """Half an interval, over its value, in words."""
    return f"+/-{number(100.0 * half, digits)} %"
