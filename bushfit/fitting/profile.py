"""Profile likelihood: how far one parameter can go when all others follow it.

A standard error takes the misfit for a parabola. The profile asks the data: it moves one parameter, fits the others
anew, and looks where chi-square has risen too far. The two differ where a parameter is barely determined.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.assess import linear_errors, quality
from bushfit.fitting.data_sets import DataSet
from bushfit.fitting.solve import Bounds, Coordinates, Solution, solve, walls
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.model import Model

#: Longest step of the search, in coordinates, which are of order one.
_STEP = 0.5
#: Most evaluations for the fit of the others at one point, and the relative change at which it stops.
_EVALUATIONS, _TOLERANCE = 100, 1e-7
#: Noise that was itself estimated widens an interval by no more than this (Student's t of two degrees of freedom).
_WIDEST = 2.2
#: Where more than this share of the rise is due to the bounds of others, and the end lies more than a coordinate
#: away (a factor e), it is these bounds that hold it and not the data.
_OTHERS, _FAR = 0.1, 1.0

Interval = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class _Profile:
    """The rise of chi-square by the coordinate of one parameter, the others fitted anew.

    Each fit starts from the nearest model that is known already.
    """

    name: str
    best: Solution
    data_sets: Sequence[DataSet]
    bounds: Bounds
    known: dict[float, Model]

    def value(self, at: float) -> float:
        """Of the parameter."""
        least, most = self.best.model.parameters[self.name].bounds  # exp(log(bound)) may lie beyond it
        return float(np.clip(Coordinates.of(self.best.model, [self.name]).values([at])[self.name], least, most))

    def fitted(self, at: float) -> Solution:
        """The fit of the others, with the parameter held there."""
        near = self.known[min(self.known, key=lambda known: abs(known - at))]
        others = [name for name in self.best.coordinates.names if name != self.name]
        found = solve(
            near.with_values({self.name: self.value(at)}),
            self.data_sets,
            others,
            self.bounds,
            evaluations=_EVALUATIONS,
            tolerance=_TOLERANCE,
            strict=False,
        )
        self.known[at] = found.model
        return found

    def root_rise(self, at: float) -> float:
        """Root of the rise over the least chi-square."""
        return float(np.sqrt(max(self.fitted(at).chi_square - self.best.chi_square, 0.0)))

    def interval(self, start: float, walls: Array, step: float, allowed: float) -> Interval:
        """Where the root of the rise reaches what is allowed, to either side of the best value; lmfit searches, in
        steps that suit the parameter."""
        from bushfit.fitting.interval import ends

        def at(steps: float) -> float:
            return float(np.clip(start + step * steps, *walls))

        found = ends(lambda steps: self.root_rise(at(steps)) / allowed, *(walls - start) / step)
        low, high = (
            None if end is None or self._held_far(start, at(end), allowed) else self.value(at(end)) for end in found
        )
        return low, high

    def _held_far(self, start: float, end: float, allowed: float) -> bool:
        """Whether it is the bounds of others that hold an end, and that far away."""
        return abs(end - start) > _FAR and self._walled(end) > _OTHERS * allowed**2

    def _walled(self, end: float) -> float:
        """How far chi-square would fall there if others could leave the bounds that they met on the way."""
        found = self.fitted(end)
        return 0.0 if set(found.at_bound) <= set(self.best.at_bound) else found.gain(self.best.at_bound)


def profile95(
    best: Solution,
    data_sets: Sequence[DataSet],
    covariance: Covariance,
    bounds: Bounds,
    advance: Callable[[str, int], None],
) -> Mapping[str, Interval]:
    """95 % intervals of the fitted parameters by profile likelihood.

    The residuals are in units of a known noise, so the rise of chi-square itself is the measure, 3.84 for 95 %, and
    not an F-test that takes its scale from the misfit. What the covariance counts beyond that (noise that was itself
    estimated, a model that misses the data) widens the profile by the same factor as the symmetric interval:
    chi-square may rise to the square of that interval's half width over the linear standard error.

    Args:
        best: the fit.
        data_sets: the data.
        covariance: of the fit.
        bounds: limits inside the parameters' own.
        advance: called with the name of each parameter when it is done, and how many are left.

    Returns:
        Lower and upper end by name; None where the data leave that side open up to the bound, or
        hold it only far away, by another parameter's bound.

    Raises:
        FitError: fewer than two parameters were fitted.
    """
    names = best.coordinates.names
    if len(names) < 2:
        raise FitError(
            "a profile needs two parameters or more",
            found=f"{len(names)} fitted",
            hint="leave out --profile, or hold fewer parameters in [fit]",
        )
    start, walled = best.coordinates.point(best.model.values), np.transpose(walls(best.coordinates, bounds))
    linear = linear_errors(best.jacobian)
    allowed = _allowed(best, data_sets, covariance, linear)
    found: dict[str, Interval] = {}
    for i, name in enumerate(names):
        profile = _Profile(name, best, data_sets, bounds, {start[i]: best.model})
        step = min(1.1 * allowed[i] * linear[i], _STEP)
        found[name] = profile.interval(start[i], walled[i], step, allowed[i])
        advance(name, len(names) - len(found))
    return found


def _allowed(best: Solution, data_sets: Sequence[DataSet], covariance: Covariance, linear: Array) -> Array:
    """Root of the rise of chi-square that each parameter's interval may reach."""
    names = best.coordinates.names
    half = covariance.half_width(np.eye(len(covariance.names)))[[covariance.names.index(name) for name in names]]
    excess = max(quality(best.model, data_sets, len(names)).reduced_chi_square, 1.0)
    return np.clip(half / best.coordinates.slopes(best.model.values) / linear, Z95, _WIDEST * Z95 * np.sqrt(excess))
