"""Profile likelihood: 95 % interval of one parameter, with the other parameters refitted at each of its values.

A standard error assumes that chi-square is a parabola. A profile does not: one parameter is moved in steps, the others
are refitted at each step, and the interval ends where chi-square has risen by the allowed amount. Standard error and
profile differ if a parameter is barely determined.
"""

from collections.abc import Mapping
from dataclasses import replace
from itertools import pairwise

import numpy as np

from bushfit.errors import FitError
from bushfit.fitting.assess import linear_errors, reduced_chi_square
from bushfit.fitting.coordinates import Coordinates
from bushfit.fitting.descent import Descent
from bushfit.fitting.preparation import split_by_kind
from bushfit.fitting.problem import FitResult
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.model import Model
from bushfit.model.result import End
from bushfit.progress import track

#: Longest step of the search, in coordinates of order one; the refit of the other parameters still converges quickly.
_LONGEST_STEP = 0.5
#: Step away from a bound at which the parameter has almost no influence, so that the other parameters hardly change.
_BLIND_STEP = 4.0 * _LONGEST_STEP
#: First step of the search relative to half the interval of a parabola: most ends are within the first step.
_FIRST_REACH = 1.1
#: Largest number of steps to each side: an interval without an end within a factor of e^100 is open.
_MOST_STEPS = 200
#: Accuracy of an end, in steps: far better than the three printed digits.
_PRECISION = 1e-4
#: Largest factor by which an estimated noise widens an interval (Student's t with two degrees of freedom).
_WIDEST = 2.2
#: Expected fall of chi-square without the bounds of other parameters, relative to the allowed rise, above which these
#: bounds, not the data, may determine an end; chosen.
_HELD_BY_OTHERS = 0.1
#: Distance of such an end from the best value, in coordinates, above which the interval is open: a factor of e.
_FAR = 1.0

#: One-sided 95 % quantile of the normal distribution, in standard deviations.
_ONE_SIDED = 1.6448536269514722

Interval = tuple[float | None, float | None]


def find_limit(
    best: FitResult,
    name: str,
    end: End,
    step: float = _BLIND_STEP,
    allowed: float | None = None,
    fits: dict[float, FitResult] | None = None,
) -> float | None:
    """Find the value of a parameter at which chi-square, minimised over all others, has risen by the allowed amount.

    Args:
        best: fit of all parameters.
        name: name of the parameter.
        end: bound to search towards.
        step: step of the search, in coordinates.
        allowed: allowed square root of the rise of chi-square; None for a one-sided 95 % limit. If the model misses the
            tests, the rise is then multiplied by the reduced chi-square.
        fits: cache of fits of the other parameters, by the coordinate of this parameter; shared by both ends.

    Returns:
        Value [SI]; None if there is no end before the bound, or if it is far away and due to a bound of another
        parameter.
    """
    from scipy.optimize import brentq

    i, coordinates = list(best.names).index(name), Coordinates.of_parameters(best.model, [name])
    start, bound = best.coordinates.point(best.model.values)[i], best.problem.limits[end == "max"][i]
    fits = {start: best} if fits is None else fits
    allowed = _ONE_SIDED * np.sqrt(misfit_factor(best)) if allowed is None else allowed

    def model_at(coordinate: float) -> Model:
        """Model of the nearest known fit, with the parameter at a coordinate, mostly its natural log."""
        value = np.clip(coordinates.values([coordinate])[name], *best.model.parameters[name].bounds)
        return fits[min(fits, key=lambda known: abs(known - coordinate))].model.with_values({name: float(value)})

    def root_rise(coordinate: float) -> float:
        """Square root of the rise of chi-square above its minimum, with the parameter fixed at a coordinate."""
        if coordinate not in fits:
            others = [other for other in best.names if other != name]
            problem = replace(best.problem, model=model_at(coordinate), names=others)
            # five to ten evaluations suffice, and the tolerance is far below the allowed rise
            fits[coordinate] = Descent.start(problem, 1e-7).run(100).solution
        return float(np.sqrt(max(fits[coordinate].chi_square - best.chi_square, 0.0))) - allowed

    steps = start + np.copysign(step, bound - start) * np.arange(_MOST_STEPS + 1)
    for current, ahead in pairwise(np.clip(steps, min(start, bound), max(start, bound)).tolist()):
        if root_rise(ahead) < 0.0:
            continue
        crossing = brentq(root_rise, current, ahead, xtol=_PRECISION * step)
        root_rise(crossing)  # so that `fits` contains it
        found = fits[crossing]
        new_bounds = not set(found.at_bound) <= set(best.at_bound)
        # expected fall of chi-square at this end if other parameters could leave bounds that they reached on the way
        fall = found.expected_fall(best.at_bound) if new_bounds and abs(crossing - start) > _FAR else 0.0
        return None if fall > _HELD_BY_OTHERS * allowed**2 else model_at(crossing).values[name]
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
    start = best.coordinates.point(best.model.values)
    linear = linear_errors(best.jacobian)
    half = np.array([covariance.half_widths.get(name, 0.0) for name in names])  # 0 at a bound
    # errors that are not in the weights of the fit, of the model or of gains of loops, widen intervals without a limit
    loops, _ = split_by_kind(best.problem.tests)
    missed = any(test.model_error for test in best.problem.tests) or not all(loop.gain_weighs for loop in loops)
    widest = np.inf if missed else _WIDEST * Z95 * np.sqrt(misfit_factor(best))
    allowed = np.clip(half / best.coordinates.slopes(best.model.values) / linear, Z95, widest)
    found: dict[str, Interval] = {}
    for i, name in enumerate(track("profiles", names)):
        fits, step = {start[i]: best}, min(_FIRST_REACH * allowed[i] * linear[i], _LONGEST_STEP)
        low = find_limit(best, name, "min", step, allowed[i], fits)
        found[name] = low, find_limit(best, name, "max", step, allowed[i], fits)
    return found


def misfit_factor(best: FitResult) -> float:
    """Reduced chi-square of a fit, at least 1: factor on the rise of chi-square that a 95 % interval allows."""
    return max(reduced_chi_square(best.model, best.problem.tests, len(best.names))[0], 1.0)
