"""Profile likelihood: how far one parameter can go when all others follow it.

A standard error takes the misfit for a parabola. The profile asks the data: it moves one parameter, fits the others
anew, and looks where chi-square has risen too far. The two differ where a parameter is barely determined.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.assess import linear_errors, reduced
from bushfit.fitting.coordinates import Bounds, Coordinates, Solution, coordinate_bounds
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.solve import solve
from bushfit.model.covariance import Z95, Covariance
from bushfit.progress import track

#: Longest step of the search, in coordinates, which are of order one: one that the fit of the others follows.
_LONGEST_STEP = 0.5
#: Step away from a bound where a parameter does next to nothing, so that the others have nothing to follow.
_BLIND_STEP = 4.0 * _LONGEST_STEP
#: First step of the search over the distance at which a parabola would end: the first step then passes most ends.
_FIRST_REACH = 1.1
#: Steps of the search to either side at most: beyond a hundred factors e a side counts as open.
_MOST_STEPS = 200
#: How closely an end is found, in steps: far closer than the three digits that are printed.
_PRECISION = 1e-4
#: Noise that was itself estimated widens an interval by no more than this factor (Student's t of two degrees of
#: freedom).
_WIDEST = 2.2
#: Share of the allowed rise that is due to the bounds of others from which on these may be what holds an end: chosen.
_HELD_BY_OTHERS = 0.1
#: Distance of such an end from the best value, in coordinates, from which on it is open: a factor e.
_FAR = 1.0

#: Standard deviations beyond which one in twenty lies on one side.
_ONE_SIDED = 1.6448536269514722

Interval = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class _Profile:
    """The rise of chi-square by the coordinate of one parameter, the others fitted from the nearest `known` fit."""

    name: str
    best: Solution
    data_sets: Sequence[MeasuredTest]
    bounds: Bounds
    known: dict[float, Solution]

    def value(self, coordinate: float) -> float:
        """Value of the parameter at a coordinate."""
        minimum, maximum = self.best.model.parameters[self.name].bounds  # exp(log(bound)) may lie beyond it
        return float(
            np.clip(
                Coordinates.of_parameters(self.best.model, [self.name]).values([coordinate])[self.name],
                minimum,
                maximum,
            )
        )

    def fitted(self, coordinate: float) -> Solution:
        """The fit of the others, with the parameter held at a coordinate."""
        if coordinate not in self.known:
            near = self.known[min(self.known, key=lambda known: abs(known - coordinate))].model
            self.known[coordinate] = solve(
                near.with_values({self.name: self.value(coordinate)}),
                self.data_sets,
                [name for name in self.best.coordinates.names if name != self.name],
                self.bounds,
                evaluations=100,  # chosen: five to ten are the rule
                tolerance=1e-7,  # far less than what the rise of chi-square is compared with
                strict=False,
            )
        return self.known[coordinate]

    def root_rise(self, coordinate: float) -> float:
        """Root of the rise over the least chi-square."""
        return float(np.sqrt(max(self.fitted(coordinate).chi_square - self.best.chi_square, 0.0)))

    def end(self, start: float, bound: float, step: float, allowed: float) -> float | None:
        """Value at which the root of the rise, in steps from the best one to the bound, is as allowed, if anywhere."""
        from scipy.optimize import brentq

        steps = start + np.copysign(step, bound - start) * np.arange(_MOST_STEPS + 1)
        for current, ahead in pairwise(np.clip(steps, min(start, bound), max(start, bound)).tolist()):
            if self.root_rise(ahead) >= allowed:
                crossing = brentq(
                    lambda coordinate: self.root_rise(coordinate) - allowed, current, ahead, xtol=_PRECISION * step
                )
                held_by_others = abs(crossing - start) > _FAR and self._bounded(crossing) > _HELD_BY_OTHERS * allowed**2
                return None if held_by_others else self.value(crossing)
        return None

    def _bounded(self, coordinate: float) -> float:
        """How far chi-square would fall there if others could leave the bounds that they met on the way."""
        found = self.fitted(coordinate)
        return 0.0 if set(found.at_bound) <= set(self.best.at_bound) else found.gain(self.best.at_bound)


def profile95(
    best: Solution, data_sets: Sequence[MeasuredTest], covariance: Covariance, bounds: Bounds
) -> Mapping[str, Interval]:
    """95 % intervals of the fitted parameters by profile likelihood.

    The residuals are in units of a known noise, so the rise of chi-square itself is the measure, 3.84 for 95 %, and not
    an F-test that takes its scale from the misfit. What the covariance counts beyond that (noise that was itself
    estimated, a model that misses the data) widens the profile by the same factor as the symmetric interval:
    chi-square may rise to the square of that interval's half width over the linear standard error.

    Args:
        best: end of the fit.
        data_sets: tests, with the weights of the fit.
        covariance: of the fitted parameters.
        bounds: limits inside the parameters' own [SI].

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
    start, limits = best.coordinates.point(best.model.values), np.transpose(coordinate_bounds(best.coordinates, bounds))
    linear = linear_errors(best.jacobian)
    allowed = _allowed(best, data_sets, covariance, linear)
    found: dict[str, Interval] = {}
    for i, name in enumerate(track("profiles", names)):
        profile = _Profile(name, best, data_sets, bounds, {start[i]: best})
        step = min(_FIRST_REACH * allowed[i] * linear[i], _LONGEST_STEP)
        low, high = (profile.end(start[i], bound, step, allowed[i]) for bound in limits[i])
        found[name] = low, high
    return found


def limit95(best: Solution, data_sets: Sequence[MeasuredTest], name: str, bounds: Bounds) -> float | None:
    """One-sided 95 % limit of a parameter that ended at a bound; None if the data set no limit.

    A model that misses the data may miss them by as much more.

    Args:
        best: end of the fit.
        data_sets: tests, with the weights of the fit.
        name: parameter at a bound.
        bounds: limits inside the parameters' own [SI].
    """
    i = best.coordinates.names.index(name)
    start, inward = best.coordinates.point(best.model.values)[i], int(best.at_bound[name] == "min")
    profile = _Profile(name, best, data_sets, bounds, {start: best})
    other_end = coordinate_bounds(best.coordinates, bounds)[inward][i]
    return profile.end(start, other_end, _BLIND_STEP, _ONE_SIDED * np.sqrt(_excess(best, data_sets)))


def _excess(best: Solution, data_sets: Sequence[MeasuredTest]) -> float:
    """Reduced chi-square, 1 at the least."""
    return max(reduced(best.model, data_sets, len(best.coordinates.names))[0], 1.0)


def _allowed(best: Solution, data_sets: Sequence[MeasuredTest], covariance: Covariance, linear: Array) -> Array:
    """Root of the rise of chi-square that each parameter's interval may reach."""
    names = best.coordinates.names  # of what counts as held where it rests on a bound the covariance tells nothing
    half = np.array([covariance.half(name) if name in covariance.names else 0.0 for name in names])
    missed = any(data_set.model_error for data_set in data_sets)  # how far it bends parameters, no weight tells
    widest = np.inf if missed else _WIDEST * Z95 * np.sqrt(_excess(best, data_sets))
    return np.clip(half / best.coordinates.slopes(best.model.values) / linear, Z95, widest)
