"""Prior of the parameters of a refitted effect, for the evidence by Laplace's method."""

from math import log

import numpy as np

from bushfit.diagnosis.priors import LARGEST, SIZES
from bushfit.effects import get_effect, qualified_name
from bushfit.fitting.design import shape_start_values
from bushfit.fitting.problem import FitResult

#: Number of sizes over which the prior of an amount is averaged, and the smallest relative error that they resolve.
_FINE, _SHARPEST = 1000, 0.01


def laplace(name: str, fit: FitResult, before: FitResult) -> tuple[float, dict[str, float], float]:
    """Compute the prior density and precision of the parameters of a refitted effect.

    Args:
        name: name of the effect.
        fit: fit with the effect, with errors that the tests share if there are any.
        before: fit without the effect.

    Returns:
        Natural log of the prior density of the effect's fitting coordinates, with the factor (2 pi)^(k/2) of Laplace's
        method; prior precision (inverse variance) by coordinate name; and largest relative change of |K| due to the
        effect.

    Notes:
        The relative change of |K| due to the effect is log-uniform from the smallest size of `priors.SIZES`. A shape
        parameter is uniform over the range that the tests could show; for a shape at an end of this range, the slope of
        the likelihood sets the effective width. For an effect that replaces a branch, each parameter beyond the two of
        the branch is uniform over a factor of 20.
    """
    effect, names = get_effect(name), fit.names
    data_sets, model = fit.data_sets, fit.model
    reference = model.without(name) if effect.replaces is None else before.model
    size = max(data_set.largest_difference(model, reference) for data_set in data_sets)
    density, precision, count = 0.0, {}, 0
    variances = np.diag(np.linalg.pinv(fit.jacobian @ fit.jacobian.T, rcond=1e-12, hermitian=True))
    if effect.replaces is not None:
        count = max(len(effect.parameters) - 2, 0)
        precisions = {qualified_name(effect, parameter): 0.5 for parameter in effect.parameters}
        return count * (0.5 * log(2.0 * np.pi) - log(3.0)), precisions, size
    with_prior = [name for prior in model.constraints.priors for name in prior.names]
    times = np.geomspace(SIZES[0], LARGEST, _FINE) / max(size, 1e-12)  # prior sizes of the amount, over the fitted one
    for parameter in effect.parameters:
        coordinate = qualified_name(effect, parameter)
        if coordinate not in names or coordinate in with_prior:  # a stated prior is part of the likelihood
            continue
        count += 1
        if parameter is effect.amount:
            amount = max(abs(model.values[coordinate] - (parameter.neutral or 0.0)) / parameter.typical, 1e-12)
            precision[coordinate] = 0.25 if parameter.log else 0.25 / amount**2
            error = (1.0 if parameter.log else 1.0 / amount) * np.sqrt(variances[names.index(coordinate)])
            error = max(float(error), _SHARPEST)
            exponent = -0.5 * np.square((times - 1.0) / error)
            density += float(np.logaddexp.reduce(exponent)) - log(_FINE) - 0.5 * log(2.0 * np.pi) - log(error)
            density -= 0.0 if parameter.log else log(amount)
            density -= 0.0 if parameter.neutral == parameter.bounds[0] else log(2.0)
            continue
        tried = shape_start_values(data_sets, model, parameter)
        if parameter.log:
            wide = max(log(tried.max() / max(tried.min(), 1e-30)), 1.0)
        else:
            wide = max(float(np.ptp(tried)) / parameter.typical, 1.0)
        density -= log(wide)
        if coordinate in fit.at_bound:
            count -= 1
            pull = abs(float(fit.jacobian[names.index(coordinate)] @ fit.residual))
            density += log(min(wide, 1.0 / max(pull, 1e-12)))
            precision[coordinate] = np.inf
        else:
            precision[coordinate] = 12.0 / wide**2
    return density + 0.5 * count * log(2.0 * np.pi), precision, size
