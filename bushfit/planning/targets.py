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
from bushfit.reading.measurement import loss_factor
from bushfit.units import number, told

#: Runs of each test that stand for no end of them; chosen: a year of the rig and more, and what scatters is gone.
ENDLESS = 1000
#: Variance that is aimed at where a target cannot be reached, over the one that tests without end leave; chosen.
_NEAR = 1.2
#: The same over the variance that no test lowers: with it, the interval is a twentieth wider than without; chosen.
_BELOW = 0.1
#: Interval, over the one that tests without end leave, that is as near to a target beyond it as it gets; chosen.
_NEARLY = 1.1


@dataclass(frozen=True, eq=False)
class Goal:
    """What a target asks for, as tests tell it; k parameters, the bounded among them, at n operating points.

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

    def halves(self, off: Array) -> Array:
        """Half of the 95 % interval over the value at each point, (n,), of a covariance of the parameters, (k, k)."""
        return self.open + Z95 * np.sqrt(self.variance(off) + self.own**2)

    def half(self, off: Array) -> float:
        """The widest of them."""
        return float(self.halves(off).max())

    def met(self, off: Array) -> bool:
        """Whether it is as narrow as asked for, but for rounding."""
        return self.half(off) <= self.target.half * (1.0 + 1e-9)

    def reached(self, off: Array, endless: Array) -> bool:
        """Whether it is met; or where not even tests without end meet it, nearly as narrow as those make it."""
        return self.met(off) or (not self.met(endless) and self.half(off) <= _NEARLY * self.half(endless))

    def variance(self, off: Array) -> Array:
        """What the parameters' errors make of the quantity, relative, (n,)."""
        return np.asarray(np.einsum("nk,kl,nl->n", self.rows, off, self.rows))

    def weight(self, endless: Array) -> Array:
        """Of the parameters' covariance, (k, k): its mean variance over what the target leaves to them, or over what is
        near the least that tests without end reach, where that is more."""
        left = np.square(np.maximum(self.target.half - self.open, 0.0) / Z95) - self.own**2
        floor = self.own**2 + np.square(self.open / Z95)
        allowed = np.maximum(left, np.maximum(_NEAR * self.variance(endless), _BELOW * floor))
        return np.asarray((self.rows / allowed[:, None]).T @ self.rows / len(self.rows))

    def why_not(self, known: Knowledge, endless: Array, faultless: Array) -> str:
        """By what the target fails with endless tests of the rig, and of one without errors that repeats share."""
        halves = self.halves(endless)
        worst = int(np.argmax(halves))
        root = np.sqrt(np.diag(endless))
        named = (*known.names, *known.bounded)[int(np.argmax(np.abs(self.rows[worst]) * root))]
        parts = {
            "own": Z95 * float(self.own[worst]),
            "open": float(self.open[worst]),
            "tests": Z95 * float(np.sqrt(self.variance(endless)[worst])),
        }
        largest, where = max(parts, key=lambda part: parts[part]), self._where(worst)
        size = percent(parts[largest])
        if largest == "own":
            of_model = f"the model's own error is {size} {where}"
            return f"{of_model}: no test lowers it, naming what it lacks may (bushfit diagnose)"
        if largest == "open":
            return (
                f"what the tests so far leave undecided is {size} {where}: bushfit diagnose names the test that tells"
            )
        if self.variance(faultless)[worst] < 0.5 * self.variance(endless)[worst]:
            gain, phase = known.noise.level
            of_class = f"{number(100.0 * gain, 2)} % of gain and {number(1e3 * phase, 2)} mrad of phase"
            return (
                f"the class of the rig, {of_class} that all repeats of a test share, leaves {size} {where} by {named}"
            )
        return f"no test on offer tells {named} well enough: it leaves {size} {where}"

    def _where(self, point: int) -> str:
        if self.points is None:
            return "of it"
        unit, factor = self.points.place.display.displacement
        frequency, amplitude = float(self.points.frequency[point]), float(self.points.amplitude[point])
        return f"at {told('Hz', frequency)} and {told(unit, factor * amplitude)}"


def goals(known: Knowledge, wanted: Wanted, slopes: Array) -> Iterator[Goal]:
    """A goal for each target.

    Args:
        slopes: gain and phase of the stiffness at all points wanted by relative change of the parameters, (k, 2, n).
    """
    ends = np.cumsum([each.frequency.size for each in wanted.points])[:-1]
    at = {each.place: (each, part) for each, part in zip(wanted.points, np.split(slopes, ends, axis=-1), strict=True)}
    names = (*known.names, *known.bounded)
    for target in wanted.targets:
        if target.place is None:
            row = np.array([[float(name == target.quantity) for name in names]])
            yield Goal(target, row, np.zeros(1), np.zeros(1))
        else:
            points, (gain, phase) = at[target.place][0], np.swapaxes(at[target.place][1], 0, 1)
            yield _of_points(known, target, points, gain, phase)


def _of_points(known: Knowledge, target: Target, points: Points, gain: Array, phase: Array) -> Goal:
    """The goal of a predicted quantity. With no error of its parameters, the band of `predict` is what stays open."""
    exact = replace(known.result or Result(known.model), covariance=Covariance())
    found = predict(exact, points.place, points.frequency, points.amplitude)
    frequencies, amplitudes = np.unique(points.frequency), np.unique(points.amplitude)
    here = np.searchsorted(amplitudes, points.amplitude) * frequencies.size
    here += np.searchsorted(frequencies, points.frequency)
    band = found.stiffness if target.quantity == "stiffness" else found.loss_factor
    value = band.value[here]
    own = np.linalg.norm(band.root, axis=0)[here] / value
    wide = np.maximum(band.high - band.value, band.value - band.low)[here] / value
    rows = gain.T
    if target.quantity != "stiffness":
        loss = loss_factor(known.model.stiffness(points.place, points.frequency, points.amplitude))
        rows = phase.T * ((1.0 + loss**2) / loss)[:, None]
    return Goal(target, rows, own, np.maximum(wide - Z95 * own, 0.0), points)


def untested(known: Knowledge, place: Place, tested: Iterable[str]) -> str | None:
    """What no interval at a place holds where no test was or will be made there; None where it holds all."""
    measured = known.result.measured if known.result else None
    directions = dict.fromkeys([*(measured.directions if measured else ()), *tested])
    reached = measured or Range((1.0, 1.0), (1.0, 1.0))
    result = Result(known.model, known.names, measured=replace(reached, directions=tuple(directions)))
    return next(unfitted(result, place), None) if str(place) not in directions else None


def percent(half: float, digits: int = 2) -> str:
    """Half an interval, over its value, in words."""
    return f"+/-{number(100.0 * half, digits)} %"
