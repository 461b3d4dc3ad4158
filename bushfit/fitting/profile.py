"""Profile likelihood: 95 % interval of one parameter, with the other parameters refitted at each of its values.

A standard error assumes that chi-square is a parabola. A profile does not: one parameter is moved in steps, the others
are refitted at each step, and the interval ends where chi-square has risen by the allowed amount. Standard error and
profile differ if a parameter is barely determined.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from bushfit.errors import FitError
from bushfit.fitting.assess import linear_errors, reduced_chi_square
from bushfit.fitting.coordinates import Coordinates
from bushfit.fitting.descent import Descent
from bushfit.fitting.preparation import split_by_kind
from bushfit.fitting.problem import FitResult
from bushfit.model.covariance import Z95, Covariance
from bushfit.progress import track

#: Longest step of the search, in coordinates, which are of order one: one that the fit of the others follows.
_LONGEST_STEP = 0.5
#: Step away from a bound where a parameter does next to nothing, so that the others have nothing to follow.
_BLIND_STEP = 4.0 * _LONGEST_STEP
#: First step of the search over the distance at which a parabola would end: the first step then passes most ends.
_FIRST_REACH = 1.1
#: Largest number of steps of the search to either side: a side without end within a hundred factors e is open.
_MOST_STEPS = 200
#: Accuracy of an end, in steps: far better than the three digits that are printed.
_PRECISION = 1e-4
#: Noise that was itself estimated widens an interval by no more than this factor (Student's t of two degrees of
#: freedom).
_WIDEST = 2.2
#: Share of the allowed rise from which on bounds of other parameters, not the data, may determine an end: chosen.
_HELD_BY_OTHERS = 0.1
#: Distance of such an end from the best value, in coordinates, from which on that side is open: a factor e.
_FAR = 1.0

#: One-sided 95 % quantile of the normal distribution, in standard deviations.
_ONE_SIDED = 1.6448536269514722

Interval = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class _Profile:
    """Profile of chi-square over one parameter: its minimum over all others, at fixed values of the parameter.

    Args:
        name: name of the parameter.
        best: fit of all parameters.
        known: cache of fits of the other parameters, by the coordinate of this parameter.
    """

    name: str
    best: FitResult
    known: dict[float, FitResult]

    def value(self, coordinate: float) -> float:
        """Value of the parameter [SI] for a coordinate of the fit, which is mostly its natural log."""
        (value,) = Coordinates.of_parameters(self.best.model, [self.name]).values([coordinate]).values()
        return float(np.clip(value, *self.best.model.parameters[self.name].bounds))  # exp(log(bound)) may lie beyond it

    def fitted(self, coordinate: float) -> FitResult:
        """Fit the other parameters, with this parameter fixed at a coordinate."""
        if coordinate not in self.known:
            nearest = self.known[min(self.known, key=lambda known: abs(known - coordinate))]
            model = nearest.model.with_values({self.name: self.value(coordinate)})
            names = [name for name in self.best.names if name != self.name]
            problem = replace(self.best.problem, model=model, names=names)
            # five to ten evaluations are the rule, and the tolerance is far below what the rise is compared with
            self.known[coordinate] = Descent.start(problem, 1e-7).run(100).solution
        return self.known[coordinate]

    def root_rise(self, coordinate: float) -> float:
        """Square root of the rise of chi-square above its minimum, with the parameter fixed at a coordinate."""
        return float(np.sqrt(max(self.fitted(coordinate).chi_square - self.best.chi_square, 0.0)))

    def find_limit(self, start: float, bound: float, step: float, allowed: float) -> float | None:
        """Find one end [SI] of the interval: the root of the rise of chi-square is `allowed`; None if there is no end.

        Args:
            start: coordinate of the best value.
            bound: coordinate of the bound to search towards.
            step: step of the search, in coordinates.
            allowed: allowed square root of the rise of chi-square.
        """
        from scipy.optimize import brentq

        steps = start + np.copysign(step, bound - start) * np.arange(_MOST_STEPS + 1)
        for current, ahead in pairwise(np.clip(steps, min(start, bound), max(start, bound)).tolist()):
            if self.root_rise(ahead) < allowed:
                continue
            crossing = brentq(lambda u: self.root_rise(u) - allowed, current, ahead, xtol=_PRECISION * step)
            found = self.fitted(crossing)
            new_bounds = not set(found.at_bound) <= set(self.best.at_bound)
            # by which chi-square would fall there if others could leave the bounds that they met on the way
            fall = found.gain(self.best.at_bound) if new_bounds and abs(crossing - start) > _FAR else 0.0
            return None if fall > _HELD_BY_OTHERS * allowed**2 else self.value(crossing)
        return None


def profile95(best: FitResult, covariance: Covariance) -> Mapping[str, Interval]:
    """95 % intervals of the fitted parameters by profile likelihood.

    Residuals are in units of noise, so the allowed rise of chi-square is 3.84 for 95 %, without an F-test. The
    covariance also includes errors of an estimated noise, and of a model that misses the data. They widen the profile
    by the same factor as the symmetric interval: the allowed rise is the square of (half the width of that interval /
    linear standard error).

    Args:
        best: result of the fit.
        covariance: covariance of the fitted parameters.

    Returns:
        Lower and upper end [SI] by name; None for a side on which the data set no limit before the bound, or one that
        is far away and due to a bound of another parameter.

    Raises:
        FitError: fewer than two parameters were fitted.
    """
    names = best.names
    if len(names) < 2:
        raise FitError(
            "a profile needs two parameters or more",
            found=f"{len(names)} fitted",
            hint="leave out --profile, or fix fewer parameters in [fit]",
        )
    start, limits = best.coordinates.point(best.model.values), np.transpose(best.problem.limits)
    linear = linear_errors(best.jacobian)
    half = np.array([covariance.half_widths.get(name, 0.0) for name in names])  # 0 of one at a bound
    # how far a model error, or a gain of a loop that the weights do not contain, bends parameters, no weight tells
    loops, _ = split_by_kind(best.problem.tests)
    missed = any(test.model_error for test in best.problem.tests) or not all(loop.gain_weighs for loop in loops)
    widest = np.inf if missed else _WIDEST * Z95 * np.sqrt(_excess(best))
    allowed = np.clip(half / best.coordinates.slopes(best.model.values) / linear, Z95, widest)
    found: dict[str, Interval] = {}
    for i, name in enumerate(track("profiles", names)):
        profile = _Profile(name, best, {start[i]: best})
        step = min(_FIRST_REACH * allowed[i] * linear[i], _LONGEST_STEP)
        low, high = (profile.find_limit(start[i], bound, step, allowed[i]) for bound in limits[i])
        found[name] = low, high
    return found


def limit95(best: FitResult, name: str) -> float | None:
    """One-sided 95 % limit [SI] of a parameter that ended at a bound; None if the data set no limit.

    If the model misses the data, the allowed rise of chi-square is multiplied by the reduced chi-square.

    Args:
        best: result of the fit.
        name: name of the parameter.
    """
    i = list(best.names).index(name)
    start, inward = best.coordinates.point(best.model.values)[i], int(best.at_bound[name] == "min")
    profile = _Profile(name, best, {start: best})
    return profile.find_limit(start, best.problem.limits[inward][i], _BLIND_STEP, _ONE_SIDED * np.sqrt(_excess(best)))


def _excess(best: FitResult) -> float:
    """Factor on the allowed rise of chi-square for a model that misses its tests: reduced chi-square, at least 1."""
    return max(reduced_chi_square(best.model, best.problem.tests, len(best.names))[0], 1.0)
