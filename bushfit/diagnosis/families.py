"""Fit and compare model families on one campaign: the paper's model, and models that replace its branches.

A family is a choice of effects for rate and for amplitude; each is fitted to all tests and predicts held-out tests.
"""

from collections.abc import Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import ndtr, softmax

from bushfit.diagnosis.fits import fit_model
from bushfit.diagnosis.holdout import HoldOut, Predicted, hold_out_parts, predicted_parts
from bushfit.diagnosis.laplace import laplace
from bushfit.effects import BASE, get_effect
from bushfit.errors import FitError, ModelError
from bushfit.fitting.assess import temperature_warning
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.design import with_effect
from bushfit.fitting.model_error import log_likelihood, with_model_error
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.problem import FitResult
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.prediction.comparison import CHANCE
from bushfit.progress import track
from bushfit.units import number

#: Effects for rate and for amplitude that extend or replace the paper's branches; families are all combinations.
_RATE = ("second_springpot", "fractional_zener", "maxwell")
_AMPLITUDE = ("kraus", "sliders", "distributed_sliders", "coupled_breakdown", "intrinsic_time")
#: Least probability, and largest number, of the families that are held out and reported next to the first.
_LIKELY, _MOST = 0.01, 5
#: Relative difference of held-out errors below which two families are reported as alike, significant or not; chosen:
#: smaller differences matter in no use of a bushing's model.
_ALIKE = 0.01
#: Standard error of a gain over that of the delta method; from 20 redraws of the noise of five pairs of families, where
#: it was 1.3 to 2.2.
_BEYOND_LINEAR = 1.75


@dataclass(frozen=True, eq=False)
class FittedFamily:
    """Model family (set of effects) fitted to a campaign, and compared with the first family: the campaign's model.

    Args:
        name: effects that the family adds or puts in place of branches, joined by +; for the first family, "paper" and
            its other effects.
        fit: the fitted model and the tests.
        holdout: root mean square of the residuals of the held-out tests, in units of the noise: `before` for the first
            family, `after` for this family.
        gain: reduction of the held-out mean square relative to the first family, in squared units of noise, with the
            ends of its 95 % interval; None for the first family, or if nothing is held out.
        p: probability of a gain or loss this large if both families are equally good; None if `gain` is None.
        log_evidence: natural log of the marginal likelihood of the tests, with a smooth error of the model if that
            raises the likelihood.
        probability: posterior probability among all fitted families, with equal prior probabilities.
    """

    name: str
    fit: FitResult
    holdout: HoldOut
    gain: tuple[float, float, float] | None = None
    p: float | None = None
    log_evidence: float = 0.0
    probability: float = 1.0

    @property
    def bic(self) -> float:
        """Bayesian information criterion: chi-square + parameters ln n, n independent points; lower is better."""
        independent = sum(data_set.independent_count for data_set in self.fit.data_sets)
        return self.fit.chi_square + len(self.fit.names) * float(np.log(independent))

    @property
    def sentence(self) -> str:
        """Sentence that compares the held-out error of this model family with that of the campaign's own model.

        The held-out error is the root mean square residual of tests that were left out of the fit, in units of noise.
        """
        if self.gain is None or self.p is None or self.holdout.before is None or self.holdout.after is None:
            return "no part of the tests can be held out of both fits"
        figures = (
            f"held-out error {number(self.holdout.after, 3)} x noise (first family: {number(self.holdout.before, 3)})"
        )
        if abs(self.holdout.after / self.holdout.before - 1.0) < _ALIKE:
            return f"{figures}: equal within {number(100.0 * _ALIKE, 2)} %"
        better = sum(part.after < part.before for part in self.holdout.parts)
        figures += f", better in {better} of {len(self.holdout.parts)} parts"
        if self.p >= CHANCE or (self.gain[0] > 0.0) is (self.holdout.after > self.holdout.before):
            return f"{figures}: within chance (p {number(self.p, 2)})"
        return f"{figures}: {'better' if self.gain[0] > 0.0 else 'worse'} by more than chance"


def known_families(model: Model, data_sets: Sequence[MeasuredTest]) -> tuple[str, ...]:
    """List the model families that can replace a model: each effect of rate combined with each effect of amplitude.

    The effect of temperature is added if the tests differ in temperature and the model has no such effect. The model
    itself, with the branches elastic, springpot and friction unchanged, is left out.

    Args:
        model: starting model.
        data_sets: the tests.

    Returns:
        Names of families: names of effects joined by +.
    """
    warm = ["temperature"] if temperature_warning(model, data_sets) else []
    rates, amplitudes = (["", *(name for name in laws if _can_add(model, name))] for laws in (_RATE, _AMPLITUDE))
    found = [[*warm, *filter(None, pair)] for pair in product(rates, amplitudes)]
    possible = [names for names in found if not any({*get_effect(name).never_with} & {*names} for name in names)]
    return tuple("+".join(names) for names in possible if names)


def _can_add(model: Model, name: str) -> bool:
    """True if the effect `name` can be added to a model: it replaces no branch, or one that the model has."""
    return name not in model.effects and get_effect(name).replaces in (None, *model.effects)


def fit_families(
    model: Model,
    data_sets: Sequence[MeasuredTest],
    names: Sequence[str],
    fixed: Sequence[str],
    bounds: Bounds,
) -> tuple[list[FittedFamily], dict[str, float]]:
    """Fit model families to the tests, and compare their held-out errors with those of the model itself.

    Args:
        model: the model at its starting values.
        data_sets: the tests.
        names: names of families, each of effects joined by +; all known families if empty.
        fixed: names of parameters that are not fitted.
        bounds: limits of parameters inside their general limits.

    Returns:
        The first family and the requested families (without a request, the most probable), with held-out errors; and
        the probability of each family that is not reported.

    Raises:
        FitError: data that cannot support the fit of a family that is named.
        ModelError: an unknown effect, one that the model has already, or one that replaces a missing branch.
    """
    first = fit_model(model, data_sets, fixed, bounds)
    base_name = "+".join(["paper", *(name for name in model.effects if name not in BASE)])
    chains = {base_name: [first]}
    requested = names or known_families(model, data_sets)
    for name in track("families fitted", requested):
        with nullcontext() if names else suppress(FitError):
            chains[name] = _fit_in_turn(chains, first, name, fixed, bounds)
    effects = {name: [] if name == base_name else name.split("+") for name in chains}
    worth = {name: _log_evidence(chain, effects[name], bounds) for name, chain in chains.items()}
    probability = dict(zip(worth, softmax([*worth.values()]).tolist(), strict=True))
    alternatives = sorted((name for name in worth if name != base_name), key=worth.__getitem__, reverse=True)
    likely = [name for name in alternatives if names or probability[name] >= _LIKELY] or alternatives[:1]
    reported, found = {base_name, *(likely if names else likely[:_MOST])}, []
    for name in track("families held out", [name for name in worth if name in reported]):
        predictions, skipped = predicted_parts(first, chains[name][-1], bounds)
        out = HoldOut.from_residuals({part: prediction.residuals for part, prediction in predictions.items()}, skipped)
        gain = _held_out_gain(predictions, data_sets) if name != base_name else (None, None)
        found.append(FittedFamily(name, chains[name][-1], out, *gain, worth[name], probability[name]))
    return found, {name: share for name, share in probability.items() if name not in reported}


def _fit_in_turn(
    chains: Mapping[str, list[FitResult]], first: FitResult, name: str, fixed: Sequence[str], bounds: Bounds
) -> list[FitResult]:
    """Fit a model family by adding its effects one after another; fits of the family without the last are reused.

    Args:
        chains: fits of the families so far, by name: without added effects, with one, with two, and so on.
        first: fit of the campaign's model.
        name: name of the family: names of effects joined by +.
        fixed: names of parameters that are not fitted.
        bounds: limits of parameters inside their general limits.

    Returns:
        Fits with no effect added, one effect, two effects, and so on.
    """
    before, _, last = name.rpartition("+")
    chain = [first] if not before else chains.get(before) or _fit_in_turn(chains, first, before, fixed, bounds)
    effect, present = get_effect(last), chain[-1].model.effects
    if not _can_add(chain[-1].model, last):
        has = "the model has this effect already"
        problem = has if last in present else "the effect that this effect replaces is not in the model"
        laws = " or ".join(name for name in (*_RATE, *_AMPLITUDE) if _can_add(chain[-1].model, name))
        raise ModelError(problem, found=last, expected=f"such as {laws}")
    return [*chain, with_effect(chain[-1], chain[-1].data_sets, effect, fixed, bounds)]


def _log_evidence(chain: Sequence[FitResult], names: Sequence[str], bounds: Bounds) -> float:
    """Natural log of the marginal likelihood of the tests under a model family.

    Args:
        chain: fits with no effect added, one effect, two effects, and so on; the last is the fit of the family.
        names: names of the added effects, in this order.
        bounds: limits of parameters inside their general limits.
    """
    *before, last = chain
    found = with_model_error(last, bounds)[0]
    priors = [laplace(name, found, one) for name, one in zip(names, before, strict=True)]
    precisions = {name: value for _, precision, _ in priors for name, value in precision.items()}
    return sum(density for density, *_ in priors) + log_likelihood(found, precisions)


def _held_out_gain(
    predictions: Mapping[str, Predicted], data_sets: Sequence[MeasuredTest]
) -> tuple[tuple[float, float, float] | None, float | None]:
    """Reduction of the mean square held-out residual by a family against the first family, with interval and p-value.

    Args:
        predictions: residuals of each held-out part by both families, by name of the part.
        data_sets: the tests.

    Returns:
        Reduction in squared units of noise with the ends of its 95 % interval, and the p-value of no difference; None
        for both if nothing is held out.

    Notes:
        By the delta method, the variance of the gain is the sum over all rows of the squared derivative with respect to
        the noise of the row, times the smaller mean square (at least 1). A row that is not held out contributes through
        the fitted parameters. The factor `_BEYOND_LINEAR` accounts for nonlinearity and the estimated noise.
    """
    disjoint, used_rows = list[Predicted](), np.zeros(sum(data_set.size for data_set in data_sets), dtype=bool)
    for part in hold_out_parts(data_sets):
        rows = part.rows(data_sets)
        if part.name in predictions and not (rows & used_rows).any():  # no point counts twice
            disjoint.append(predictions[part.name])
            used_rows |= rows
    if not disjoint:
        return None, None
    plain = np.concatenate([prediction.residuals for prediction in disjoint], axis=1)
    before, after = np.mean(np.square(plain), axis=1)
    slope = np.sum([prediction.noise_gradients[0] - prediction.noise_gradients[1] for prediction in disjoint], axis=0)
    error = 2.0 * _BEYOND_LINEAR * np.sqrt(max(1.0, min(before, after))) * float(np.linalg.norm(slope)) / plain.shape[1]
    gain = float(before - after)
    p = float(2.0 * ndtr(-abs(gain) / error)) if error else 1.0
    return (gain, float(gain - Z95 * error), float(gain + Z95 * error)), p
