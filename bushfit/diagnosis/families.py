"""Model families on one campaign: the paper's and others in place of its branches, fitted and held out alike."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.special import logsumexp, ndtr

from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.holdout import HoldOut, Predicted, parts, predicted_parts
from bushfit.diagnosis.laplace import laplace
from bushfit.effects import BASE, get_effect
from bushfit.errors import FitError, ModelError
from bushfit.fitting.assess import apart_in_temperature
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.design import with_effect
from bushfit.fitting.model_error import log_likelihood, with_model_error
from bushfit.fitting.preparation import MeasuredTest
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.prediction.comparison import CHANCE
from bushfit.progress import track
from bushfit.units import number

#: Laws of rate and of amplitude beside the paper's or in their place, of which families are made, each with each.
_RATE = ("second_springpot", "fractional_zener", "maxwell")
_AMPLITUDE = ("kraus", "sliders", "distributed_sliders", "coupled_breakdown", "intrinsic_time")
#: Of all families that are known, those that are held out and shown beside the first: of these odds, and so many.
_LIKELY, _MOST = 0.01, 5
#: Share by which a held-out error has to differ for two families not to count as alike, sure or not; chosen: no use
#: of a bushing's model feels less.
_ALIKE = 0.01
#: Standard error of a gain over that of the delta method; from 20 redraws of the noise of five pairs of families, where
#: it was 1.3 to 2.2.
_BEYOND_LINEAR = 1.75


@dataclass(frozen=True, eq=False)
class FittedFamily:
    """A model family fitted to a campaign, beside the first one.

    Args:
        name: effects that it adds to the first or puts in place of its branches, joined by +; of the first "paper"
            and those that it has.
        held: root mean squares of what was held out, before of the first family and after of this one; the same parts.
        gain: by how much its held-out mean square, in units of noise, is less than that of the first family, over
            parts that share no point, with the 95 % interval that the noise of these tests leaves; None where nothing
            is held out.
        p: probability of so large a gain, or loss, where both are equally near the truth; None as of the gain.
        log_evidence: of the tests under it, a smooth error of the model counted where they are likelier with it.
        probability: of all families fitted, each as likely beforehand.
    """

    name: str
    evidence: Evidence
    held: HoldOut
    gain: tuple[float, float, float] | None = None
    p: float | None = None
    log_evidence: float = 0.0
    probability: float = 1.0

    @property
    def words(self) -> str:
        """True if the family predicts the held-out data better than the first family, beyond chance."""
        if self.gain is None or self.p is None or self.held.before is None or self.held.after is None:
            return "nothing can be held out of both"
        figures = f"held out {number(self.held.after, 3)} x noise, the first {number(self.held.before, 3)}"
        if abs(self.held.after / self.held.before - 1.0) < _ALIKE:
            return f"{figures}: alike within {number(100.0 * _ALIKE, 2)} %"
        better = sum(part.after < part.before for part in self.held.parts)
        figures += f", nearer in {better} of {len(self.held.parts)} parts"
        if self.p >= CHANCE or (self.gain[0] > 0.0) is (self.held.after > self.held.before):
            return f"{figures}: no more than chance (p {number(self.p, 2)})"
        return f"{figures}: {'better' if self.gain[0] > 0.0 else 'worse'} by more than chance"


def known_families(model: Model, data_sets: Sequence[MeasuredTest]) -> tuple[str, ...]:
    """Each law of rate with each law of amplitude, as far as a model can take them; with the effect of temperature
    where the tests are apart in it and the model has none. The paper's laws with each other are the model itself."""
    warm = ["temperature"] if apart_in_temperature(model, data_sets) else []
    rates, amplitudes = (["", *(name for name in laws if _fits(model, name))] for laws in (_RATE, _AMPLITUDE))
    found = [[*warm, *filter(None, pair)] for pair in product(rates, amplitudes)]
    return tuple("+".join(names) for names in found if names and not _clash(names))


def _clash(names: Sequence[str]) -> bool:
    """True if one of some effects vanishes beside another."""
    return any({*get_effect(name).never_with} & {*names} for name in names)


def _fits(model: Model, name: str) -> bool:
    """True if a model lacks an effect and has the branch that it replaces."""
    return name not in model.effects and get_effect(name).replaces in (None, *model.effects)


def fit_families(
    model: Model,
    data_sets: Sequence[MeasuredTest],
    names: Sequence[str],
    fixed: Sequence[str],
    bounds: Bounds,
) -> tuple[list[FittedFamily], dict[str, float]]:
    """The model as it comes first, and it with each of these families, fitted to the tests and held out alike.

    Args:
        names: of effects, several of one family joined by +; all that are known where there are none.
        held, bounds: parameters that do not move, and limits inside the parameters' own.

    Returns:
        The first and those named, or else the likeliest, held out; and the probability of each family that is left.

    Raises:
        FitError: data that cannot support the fit of a family that is named.
        ModelError: an unknown effect, one that the model has already, or one in place of what it has not.
    """
    first = fit(model, data_sets, fixed, bounds)
    base_name = "+".join(["paper", *(name for name in model.effects if name not in BASE)])
    chains = {base_name: [first]}
    requested = names or known_families(model, data_sets)
    for name in track("families fitted", requested):
        with nullcontext() if names else suppress(FitError):
            chains[name] = _chain(chains, first, name, fixed, bounds)
    effects = {name: [] if name == base_name else name.split("+") for name in chains}
    worth = {name: _log_evidence(chain, effects[name], bounds) for name, chain in chains.items()}
    odds = np.exp(np.array([*worth.values()]) - logsumexp([*worth.values()]))
    probability = dict(zip(worth, odds.tolist(), strict=True))
    alternatives = sorted((name for name in worth if name != base_name), key=worth.__getitem__, reverse=True)
    likely = [name for name in alternatives if names or probability[name] >= _LIKELY] or alternatives[:1]
    reported, found = {base_name, *(likely if names else likely[:_MOST])}, []
    for name in track("families held out", [name for name in worth if name in reported]):
        predictions, skipped = predicted_parts(first, chains[name][-1], bounds)
        out = HoldOut.from_residuals({part: prediction.residuals for part, prediction in predictions.items()}, skipped)
        gain = _gain(predictions, data_sets) if name != base_name else (None, None)
        found.append(FittedFamily(name, chains[name][-1], out, *gain, worth[name], probability[name]))
    return found, {name: share for name, share in probability.items() if name not in reported}


def _chain(
    chains: Mapping[str, list[Evidence]], first: Evidence, name: str, fixed: Sequence[str], bounds: Bounds
) -> list[Evidence]:
    """The fits of a family's effects one after the other, from the longest beginning that was fitted before."""
    before, _, last = name.rpartition("+")
    chain = [first] if not before else chains.get(before) or _chain(chains, first, before, fixed, bounds)
    effect, present = get_effect(last), chain[-1].model.effects
    if not _fits(chain[-1].model, last):
        has = "the model has this effect already"
        problem = has if last in present else "what this effect stands in place of is not in the model"
        laws = " or ".join(name for name in (*_RATE, *_AMPLITUDE) if _fits(chain[-1].model, name))
        raise ModelError(problem, found=last, expected=f"such as {laws}")
    solution = with_effect(chain[-1].solution, chain[-1].data_sets, effect, fixed, bounds)
    return [*chain, Evidence(solution, chain[-1].data_sets)]


def _log_evidence(chain: Sequence[Evidence], names: Sequence[str], bounds: Bounds) -> float:
    """The logarithm of the evidence of the last of some models, each with one effect more than that before it; what
    all families have in common counts nothing."""
    *before, last = chain
    found = with_model_error(last.estimate, bounds)[0]
    priors = [
        laplace(name, replace(last, solution=found.solution), one) for name, one in zip(names, before, strict=True)
    ]
    precisions = {name: value for _, precision, _ in priors for name, value in precision.items()}
    return sum(density for density, *_ in priors) + log_likelihood(found, precisions)


def _gain(
    predictions: Mapping[str, Predicted], data_sets: Sequence[MeasuredTest]
) -> tuple[tuple[float, float, float] | None, float | None]:
    """Fall of the mean squared held-out residual, with its 95 % interval and its probability.

    Notes: by the delta method the variance of the gain is the sum, over the rows of all tests, of the squares of its
    slope by the noise of each, times what the better model leaves of a mean square, at least 1. A row counts where it
    is held out, and through the parameters where it is not. Models that bend and an estimated noise add to that, see
    `_BEYOND_LINEAR`.
    """
    disjoint = [predictions[name] for name in _disjoint_parts(data_sets, predictions)]
    if not disjoint:
        return None, None
    plain = np.concatenate([prediction.residuals[:, 0] for prediction in disjoint], axis=1)
    before, after = np.mean(np.square(plain), axis=1)
    slope = np.sum([prediction.pulls[0] - prediction.pulls[1] for prediction in disjoint], axis=0)
    error = 2.0 * _BEYOND_LINEAR * np.sqrt(max(1.0, min(before, after))) * float(np.linalg.norm(slope)) / plain.shape[1]
    gain = float(before - after)
    p = float(2.0 * ndtr(-abs(gain) / error)) if error else 1.0
    return (gain, float(gain - Z95 * error), float(gain + Z95 * error)), p


def _disjoint_parts(data_sets: Sequence[MeasuredTest], among: Collection[str]) -> Iterator[str]:
    """Those of the parts of these names that share no point with one that came before."""
    used_rows = np.zeros(sum(data_set.size for data_set in data_sets), dtype=bool)
    for part in parts(data_sets):
        rows = part.rows(data_sets)
        if part.name in among and not (rows & used_rows).any():
            yield part.name
            used_rows |= rows
