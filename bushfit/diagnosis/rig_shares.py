"""Alternatives to the model of a diagnosis: the same tests, with a part of the gap taken for effects of the rig."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import softmax

from bushfit.diagnosis.fits import misfit_covariance
from bushfit.diagnosis.hypotheses import Hypothesis, mean_parameters
from bushfit.effects import get_effect, qualified_name
from bushfit.effects.contract import Array, Level, RubberConditions
from bushfit.effects.unnamed import Patch
from bushfit.fitting.problem import FitResult
from bushfit.geometry import Place
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Alternative, Result

#: Least probability of an alternative: beyond each end of a 95 % band are 2.5 %.
_LEAST = 0.025
#: Iterations for a correction with which a model keeps its stiffness; each reduces a change of 5 % twentyfold.
_ITERATIONS = 3


def with_alternatives(result: Result, hypotheses: Sequence[Hypothesis], base: FitResult, tolerance: float) -> Result:
    """Add models with other effects of the rig, which the tests do not rule out, to a result.

    Models with different effects of the rubber predict nearly the same in the tested range, because the rubber is the
    same in the car; the rig is not in the car. So hypotheses are grouped by their effects of the rig, and each group
    gives one model: its most probable fit, or, if a smooth correction closes the gap whatever its cause, a model with
    the measured stiffness of the result.

    Args:
        result: result of the diagnosis.
        hypotheses: all hypotheses about the gap.
        base: starting model, fitted to the tests.
        tolerance: relative change of |K| up to which an explanation is neglected.

    Returns:
        The result with these alternatives and their probabilities. The remaining probability is that of the result's
        own effects of the rig.
    """
    shares = softmax([hypothesis.log_posterior for hypothesis in hypotheses]).tolist()
    probability: dict[frozenset[str], float] = defaultdict(float)
    members: dict[frozenset[str], list[Hypothesis]] = defaultdict(list)
    for hypothesis, share in zip(hypotheses, shares, strict=True):
        is_large = hypothesis.change > tolerance
        effects = _rig_effects(hypothesis.effects if is_large else ())
        probability[effects] += share
        if is_large and hypothesis.is_refitted and not hypothesis.mistake:
            members[effects].append(hypothesis)
    current = _rig_effects(result.model.effects) - {*base.model.effects}
    places = {str(test.direction): test.direction for test in base.data_sets}
    alternatives = []
    for effects, share in probability.items():
        if effects == current or share < _LEAST or not members[effects]:
            continue
        if not result.model.unnamed:
            fit = members[effects][0].state.plain
            alternatives.append(Alternative(fit.model, share, misfit_covariance(fit)))
            continue
        names = [qualified_name(effect, p) for effect in map(get_effect, sorted(effects)) for p in effect.parameters]
        amounts, posterior = mean_parameters(members[effects], names)
        model = result.model.without(*current)
        for name in sorted(effects):
            model = model.with_effect(name, amounts)
        corrected = _with_stiffness_of(result.model, model, places)
        parameters = result.covariance.select([name for name in model.values if name not in names])
        matrix = block_diag(parameters.matrix, posterior.matrix)
        alternatives.append(Alternative(corrected, share, Covariance((*parameters.names, *posterior.names), matrix)))
    return replace(result, alternatives=tuple(alternatives))


def _rig_effects(names: Iterable[str]) -> frozenset[str]:
    """Names of the effects of the rig among `names`, and of effects with a twin (an equal response) in the rig."""
    return frozenset(name for name in names if get_effect(name).twins or get_effect(name).level is Level.INSTRUMENT)


def _with_stiffness_of(measured: Model, model: Model, places: Mapping[str, Place]) -> Model:
    """Change the smooth correction of a model so that it has the stiffness of another model at the nodes.

    Args:
        measured: model with the stiffness to keep, with a smooth correction.
        model: model with other effects of the rig and the same correction.
        places: tested directions and specimens by name.
    """
    assert measured.unnamed is not None
    single = [replace(patch, directions=(name,)) for patch in measured.unnamed.patches for name in patch.directions]
    unnamed = replace(measured.unnamed, patches=tuple(single))
    for _ in range(_ITERATIONS):
        model = replace(model, unnamed=unnamed)
        patches = []
        for patch in unnamed.patches:
            place = places[patch.directions[0]]
            ratio = _node_stiffness(measured, patch, place) / _node_stiffness(model, patch, place)
            share = (1.0 + np.array(patch.in_phase) + 1j * np.array(patch.in_quadrature)) * ratio - 1.0
            in_phase, in_quadrature = (tuple(part.tolist()) for part in (share.real, share.imag))
            patches.append(replace(patch, in_phase=in_phase, in_quadrature=in_quadrature))
        unnamed = replace(unnamed, patches=tuple(patches))
    return replace(model, unnamed=unnamed)


def _node_stiffness(model: Model, patch: Patch, place: Place) -> Array:
    """Stiffness of a model at the nodes of a smooth correction [N/m or N m/rad], (m,)."""
    amplitude = np.array(patch.strain) / model.unit_strain(place)
    conditions = RubberConditions(np.array(patch.temperature_K) if patch.temperature_K else None)
    return model.stiffness(place, np.array(patch.frequency_Hz), amplitude, conditions=conditions)
