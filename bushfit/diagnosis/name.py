"""Which effect is missing: every effect of the library proposes itself with evidence, and the best are refitted.

A score test ranks them all: residuals projected on the candidate's sensitivity beside the model's own parameters.
The few best are then fitted together with all parameters of the model, from the amounts the score suggests.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from bushfit.diagnosis.calibrate import SENSITIVITY_LEFT, Questions
from bushfit.diagnosis.evidence import EVALUATIONS, Evidence, fit
from bushfit.effects import LIBRARY, Effect, Parameter, qualified
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.solve import Bounds, jacobian
from bushfit.fitting.terms import Term
from bushfit.model import Model

#: Candidates that are refitted in each round, the best scores first.
REFITTED = 6
_PROBES = 5
#: Evaluations after which a candidate must show that it is worth more.
_FIRST = 14
#: Reduced chi-square beyond which a model's own values are no place to start from.
_BENT = 1.5


@dataclass(frozen=True, eq=False)
class Proposal:
    """One effect's claim before any refit.

    Args:
        name: the effect.
        model: the model with the effect at the amount the score suggests.
        score: what it would take off chi-square if everything were linear.
        column: its sensitivity, whitened, (n,).
        sense: +1 where only positive amounts are physical, 0 where both signs are.
        visible: whether these tests could show the effect at all, beside the model's own parameters.
    """

    name: str
    model: Model
    score: float
    column: Array
    sense: int
    visible: bool


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect refitted together with everything else."""

    name: str
    evidence: Evidence
    gain: float


def proposals(evidence: Evidence, excluded: Collection[str]) -> list[Proposal]:
    """Every effect of the library that is not yet in the model, best score first."""
    found = [_propose(evidence, effect) for name, effect in LIBRARY.items() if _free(evidence.model, name, excluded)]
    return sorted(found, key=lambda proposal: -proposal.score)


def _free(model: Model, name: str, excluded: Collection[str]) -> bool:
    return name not in model.effects and name not in excluded


def _propose(evidence: Evidence, effect: Effect) -> Proposal:
    """The best of an effect's probes: its shape parameters on a grid that the tests suggest, its amount by score."""
    amount = next(parameter for parameter in effect.parameters if parameter.neutral is not None)
    name = qualified(effect, amount)
    sense = 1 if amount.neutral == amount.bounds[0] else 0
    models = [
        evidence.model.with_effect(effect.name, shape) for shape in _shapes(evidence.terms, evidence.model, effect)
    ]
    columns = np.concatenate([jacobian(model, evidence.terms, [name]) for model in models])
    questions = Questions(evidence, columns, [np.array([i]) for i in range(len(models))], SENSITIVITY_LEFT)
    amounts = np.array([float(answer[0]) for answer in questions.answers()])
    scores = np.where((amounts > 0.0) | (sense == 0), questions.gains(), 0.0)
    best = int(np.argmax(scores))
    step = float(np.clip(amounts[best] * amount.typical, *amount.bounds)) if scores[best] > 0.0 else 0.0
    model = models[best].with_values({name: step})
    return Proposal(effect.name, model, float(scores[best]), columns[best], sense, questions.sizes[best] > 0)


def _shapes(terms: Sequence[Term], model: Model, effect: Effect) -> list[Mapping[str, float]]:
    """Values of the parameters that have no neutral value, on a grid scaled by the tests."""
    axes = {
        qualified(effect, parameter): _probes(terms, model, parameter)
        for parameter in effect.parameters
        if parameter.neutral is None
    }
    return [dict(zip(axes, point, strict=True)) for point in product(*axes.values())]


def _probes(terms: Sequence[Term], model: Model, parameter: Parameter) -> Array:
    frequencies = np.concatenate([term.frequency for term in terms])
    match parameter.scale:
        case "period":
            low, high = 0.1 / (2.0 * np.pi * frequencies.max()), 2.0 / (2.0 * np.pi * np.median(frequencies))
        case "frequency":
            low, high = 0.7 * frequencies.max(), 4.0 * frequencies.max()
        case "displacement":
            low, high = _stroke(terms)
        case "strain":
            strains = [term.amplitude * model.bushing.unit_strain(term.direction) for term in terms]
            low, high = 0.03 * np.concatenate(strains).min(), np.concatenate(strains).max()
        case None:
            return np.array([parameter.typical])
    return np.clip(np.geomspace(low, high, _PROBES), *parameter.bounds)


def _stroke(terms: Sequence[Term]) -> tuple[float, float]:
    """Displacements that some test reaches and some test just misses [m]."""
    amplitudes = np.concatenate([term.amplitude for term in terms])
    return 0.8 * float(amplitudes.min()), 0.95 * float(amplitudes.max())


def _within_stroke(terms: Sequence[Term], name: str) -> Bounds:
    """Limits of an effect's displacements to what the tests can show: a stop that is always met is no stop."""
    low, high = _stroke(terms)
    effect = LIBRARY[name]
    scaled = [parameter for parameter in effect.parameters if parameter.scale == "displacement"]
    return {qualified(effect, parameter): (low, high) for parameter in scaled}


def refit(
    evidence: Evidence, proposal: Proposal, start: Mapping[str, float], held: Sequence[str], bounds: Bounds
) -> Candidate | None:
    """The proposal fitted together with the model, for a few steps; None where the fit fails.

    A model that lacks something large has bent its own parameters to make up for it: then they begin at the start
    values read off the data, and only else where the model ended.
    """
    model = proposal.model if evidence.reduced < _BENT else proposal.model.with_values(start)
    return _fitted(evidence, proposal.name, model, held, bounds, _FIRST)


def finished(evidence: Evidence, candidate: Candidate, held: Sequence[str], bounds: Bounds) -> Candidate:
    """A candidate fitted to its end, where it had stopped on its way."""
    if candidate.evidence.solution.evaluations < _FIRST:
        return candidate
    model = candidate.evidence.model
    return _fitted(evidence, candidate.name, model, held, bounds, EVALUATIONS) or candidate


def _fitted(
    evidence: Evidence, name: str, model: Model, held: Sequence[str], bounds: Bounds, evaluations: int
) -> Candidate | None:
    limits = {**_within_stroke(evidence.terms, name), **bounds}
    try:
        fitted = fit(model, evidence.terms, held, limits, evaluations)
    except (FitError, ModelError):
        return None
    return Candidate(name, fitted, evidence.chi_square - fitted.chi_square)
