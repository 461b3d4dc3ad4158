"""Prior of the parameters of a refitted effect, for the evidence by Laplace's method."""

from math import log, log1p, pi

import numpy as np
from scipy.special import log_ndtr, logsumexp

from bushfit.diagnosis.fits import within_reach
from bushfit.diagnosis.priors import SIZES
from bushfit.effects import get_effect, qualified_name
from bushfit.fitting.problem import FitResult
from bushfit.model.model import Model

#: Range of the natural log of each parameter, beyond those of the branch, of an effect that replaces a branch.
_LOG_RANGE = 3.0
#: Amount, relative to the typical one, and relative change of |K|, below which they are none.
_NEGLIGIBLE = 1e-12


def laplace(name: str, fit: FitResult, before: FitResult) -> tuple[float, dict[str, float], float]:
    """Compute the prior of the parameters of a refitted effect as a Gaussian distribution around the fit.

    Args:
        name: name of the effect.
        fit: fit with the effect, with errors that the tests share if there are any.
        before: fit without the effect.

    Returns:
        Natural log of the factor on the evidence due to parameters at a bound; prior precision (inverse variance) by
        coordinate name, infinite at a bound; and largest relative change of |K| due to the effect.

    Notes:
        The Gaussian distribution has the density of the prior at its centre. A shape parameter is uniform over the
        range in which it is fitted; at an end of this range, the slope of the likelihood sets the effective width. For
        an amount, see `amount_precision`. If an effect replaces a branch, its parameters beyond the two of the branch
        are uniform over a factor of 20, and two have the prior of the branch (see `SearchState.log_weight`).
    """
    effect, model, reach = get_effect(name), fit.model, within_reach(fit.model, fit.data_sets)

    def change(reference: Model) -> float:
        return max(data_set.largest_difference(model, reference) for data_set in fit.data_sets)

    if effect.replaces is not None:
        uniform = 2.0 * pi / _LOG_RANGE**2
        precisions = {qualified_name(effect, parameter): uniform for parameter in effect.parameters}
        return -log(uniform), precisions, change(before.model)
    stated = {name for prior in model.constraints.priors for name in prior.names}  # their prior is in the likelihood
    parameters = {qualified_name(effect, parameter): parameter for parameter in effect.parameters}
    numbers = {name: number for number, name in enumerate(fit.names) if name in parameters and name not in stated}
    factor, precision = 0.0, np.zeros(len(fit.names))
    for coordinate, number in numbers.items():
        if (parameter := parameters[coordinate]).neutral is None:
            ends = np.array(reach.get(coordinate, parameter.bounds))
            width = float(np.ptp(np.log(ends) if parameter.log else ends / parameter.typical))
            precision[number] = 2.0 * pi / width**2
            if coordinate in fit.at_bound:
                pull = abs(float(fit.jacobian[number] @ fit.residual))
                factor -= log(max(pull * width, 1.0))
                precision[number] = np.inf
    inner, variances = np.isfinite(precision), np.zeros(len(fit.names))
    information = fit.jacobian[inner] @ fit.jacobian[inner].T + np.diag(precision[inner])
    variances[inner] = np.diag(np.linalg.pinv(information, rcond=1e-12, hermitian=True))
    size = change(model.without(name))
    for coordinate, number in numbers.items():
        if (parameter := parameters[coordinate]).neutral is not None:
            reference = None if parameter is effect.amount else model.with_values({coordinate: parameter.neutral})
            of_amount = max(change(reference) if reference else size, _NEGLIGIBLE)
            distance = abs(model.values[coordinate] - parameter.neutral) / parameter.typical
            slope = of_amount if parameter.log else of_amount / max(distance, _NEGLIGIBLE)
            one_sided = parameter.neutral == parameter.bounds[0]
            variance = max(float(variances[number]) * slope**2, _NEGLIGIBLE**2)
            of_size = amount_precision(of_amount, variance, one_sided=one_sided)
            precision[number] = of_size * slope**2
            if coordinate in fit.at_bound:  # no parameter of the linear model: its share of the evidence is a factor
                factor -= 0.5 * log1p(1.0 / (of_size * variance))
                precision[number] = np.inf
    return factor, {name: float(precision[number]) for name, number in numbers.items()}, size


def amount_precision(size: float, variance: float, *, one_sided: bool) -> float:
    """Precision of the Gaussian distribution around a fitted amount that replaces the prior of the amount.

    Args:
        size: fitted relative change of |K| by the amount, positive.
        variance: variance of this change due to the tests' noise, without a prior.
        one_sided: True if the amount cannot be negative.

    Notes:
        The prior is that of the linear model: normal around 0, or half of it, with a standard deviation that is
        log-uniform over `priors.SIZES`. With the precision p, the likelihood N(size, variance) has the same marginal
        likelihood under N(size, 1/p): with their ratio B to the largest likelihood, p = B^2/(1 - B^2)/variance.
    """
    total = np.square(SIZES) + variance
    log_share = 0.5 * np.log(variance / total) - 0.5 * size**2 / total
    if one_sided:
        log_share += log(2.0) + log_ndtr(size * SIZES / np.sqrt(variance * total))
    share = max(np.exp(2.0 * (logsumexp(log_share) - log(SIZES.size))), np.finfo(float).tiny)  # 0 for many times |K|
    return float(share / max(1.0 - share, 1e-12) / variance)
