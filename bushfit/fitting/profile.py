"""Profile likelihood: how far one parameter can go when all others follow it.

A standard error takes the misfit for a parabola. The profile asks the data: it moves one parameter, fits the others
anew, and looks where chi-square has risen too far. The two differ where a parameter is barely determined.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.solve import Bounds, Coordinates, jacobian, residual, walls
from bushfit.fitting.terms import Term
from bushfit.model import Model
from bushfit.results import Z95, Covariance

_LEVEL = 0.95
#: lmfit steps by the standard error only where that is less than the value, and ends within 5e-5 of the value.
_CENTRE = 10.0

Interval = tuple[float | None, float | None]


@dataclass(frozen=True, eq=False)
class _Scale:
    """Parameters counted in standard errors of a linear fit, from _CENTRE at the best values."""

    coordinates: Coordinates
    best: Array
    unit: Array

    def values(self, counted: Sequence[float] | Array) -> dict[str, float]:
        return self.coordinates.values(self.best + (np.asarray(counted) - _CENTRE) * self.unit)

    def counted(self, point: Array) -> Array:
        return (point - self.best) / self.unit + _CENTRE


def profile95(
    model: Model,
    names: Sequence[str],
    terms: Sequence[Term],
    covariance: Covariance,
    bounds: Bounds,
    advance: Callable[[str, int], None],
) -> Mapping[str, Interval]:
    """95 % intervals of the fitted parameters by profile likelihood, with lmfit's conf_interval.

    The residuals are in units of a known noise, so the rise of chi-square itself is the measure, 3.84 for 95 %, and
    not an F-test that takes its scale from the misfit. What the covariance counts beyond that (noise that was itself
    estimated, a model that misses the data) widens the profile by the same factor as the symmetric interval:
    chi-square may rise to the square of that interval's half width over the linear standard error.

    Args:
        model: at the best values.
        names: of the parameters that were fitted.
        terms: the data.
        covariance: of the fit.
        bounds: limits inside the parameters' own.
        advance: called with the name of each parameter when it is done, and how many are left.

    Returns:
        Lower and upper end by name; None where the data leave that side open up to the bound.

    Raises:
        FitError: fewer than two parameters were fitted.
    """
    import lmfit

    if len(names) < 2:
        raise FitError(
            "a profile needs two parameters or more",
            found=f"{len(names)} fitted",
            hint="leave out --profile, or hold fewer parameters in [fit]",
        )
    coordinates = Coordinates.of(model, names)
    slope = jacobian(model, terms, names)
    linear = np.sqrt(np.diag(np.linalg.inv(slope @ slope.T)))
    scale = _Scale(coordinates, coordinates.point(model.values), linear)
    ends = scale.counted(np.array(walls(coordinates, bounds)))
    start = lmfit.Parameters()
    for i, (least, most) in enumerate(ends.T):
        start.add(f"u{i}", value=_CENTRE, min=least, max=most)

    def at(parameters: lmfit.Parameters) -> Model:
        return model.with_values(scale.values([parameter.value for parameter in parameters.values()]))

    def misfit(parameters: lmfit.Parameters) -> Array:
        return residual(at(parameters), terms)

    def slopes(parameters: lmfit.Parameters) -> Array:
        free = [i for i, parameter in enumerate(parameters.values()) if parameter.vary]
        return jacobian(at(parameters), terms, [names[i] for i in free]) * scale.unit[free, None]

    minimizer = lmfit.Minimizer(misfit, start, scale_covar=False, Dfun=slopes, col_deriv=True)
    best = minimizer.leastsq()
    wide = covariance.half_width(np.eye(len(covariance.names)))
    wide = wide / Coordinates.of(model, covariance.names).slopes(model.values)
    found: dict[str, Interval] = {}
    for i, name in enumerate(names):
        allowed = wide[covariance.names.index(name)] / scale.unit[i]

        def probability(best: object, other: object, allowed: float = allowed) -> float:
            rise = max(other.chisqr - best.chisqr, 0.0)  # type: ignore[attr-defined]
            return float(erf(np.sqrt(rise) / allowed * Z95 / np.sqrt(2.0)))

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # an end that stays open comes back as infinite
            table = lmfit.conf_interval(minimizer, best, [f"u{i}"], sigmas=[_LEVEL], prob_func=probability)
        low, high = (_value(scale, name, i, table[f"u{i}"][end][1]) for end in (0, -1))
        found[name] = low, high
        advance(name, len(names) - len(found))
    return found


def _value(scale: _Scale, name: str, index: int, counted: float) -> float | None:
    if not np.isfinite(counted):
        return None
    point = np.full(scale.best.shape, _CENTRE)
    point[index] = counted
    return scale.values(point)[name]
