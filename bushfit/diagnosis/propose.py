"""Proposals: the effects of the library that a model lacks, ranked by a score test before any refit.

Notes:
    The score is the decrease of chi-square in a linear model: the residuals projected on the effect's sensitivity,
    less the part that the model's parameters can absorb.
"""

from collections.abc import Collection, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import compress, product

import numpy as np

from bushfit.diagnosis.explanations import Explanation, Signature
from bushfit.effects import Branch, Effect, effects_for_places, qualified_name, twins_of
from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.descent import Descent
from bushfit.fitting.design import shape_start_values
from bushfit.fitting.preparation import MeasuredTest, residual_slices
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.geometry import shared_labels
from bushfit.model.model import Model

#: Smallest share of a sensitivity vector, after projection on the model's parameters, at which an effect is visible.
_LEFT = 1e-4
#: Amount of an effect in the difference quotient of the sensitivity, relative to the typical amount: small enough for a
#: derivative, large enough to keep seven digits of the difference.
_STEP = 1e-5


@dataclass(frozen=True, eq=False)
class Proposal(Explanation):
    """Effect of the library that the model lacks, with the decrease of chi-square expected before any refit.

    A shape parameter is a parameter of an effect other than its amount, such as the frequency of a resonance. The
    signature has one column for each set of shape parameters tried; it is None if the effect replaces a branch.

    Args:
        model: model with the effect as a start for a refit: at the best shape parameters and zero amount (or the
            suggested amount if the amount is fitted in its logarithm). An effect that replaces a branch starts from
            values that the branch suggests.
        score: decrease of chi-square expected from the linearised model.
        visible: True if the tests can distinguish the effect from a change of the model's parameters.
    """

    model: Model
    score: float
    visible: bool


def proposals(fit: FitResult, excluded: Collection[str], fixed: Sequence[str] | None) -> list[Proposal]:
    """Rank the effects of the library that a fitted model lacks by their expected decrease of chi-square.

    Args:
        fit: the fitted model and the tests.
        excluded: names of effects not to consider, with effects of the same response (twins).
        fixed: names of parameters that are not fitted; None to leave out the effects that replace a branch.

    Returns:
        One proposal for each effect, at its best shape parameters, the highest score first.
    """
    relative_noise = np.zeros(fit.residual.size)
    for test, rows in fit.residual_rows.items():
        relative_noise[rows] = test.relative_noise
    ranked, basis = list[Proposal](), parameter_basis(fit.jacobian)
    places = shared_labels(test.direction for test in fit.data_sets)
    for effect in missing_effects(fit.model, places, excluded):
        family = effect.name.partition(".")[0]
        if effect.replaces is not None:
            replaced = fixed is not None and effect.replaces in fit.model.effects
            if replaced and (start := _replacement(fit, effect, fixed or ())):
                ranked.append(Proposal("effect", family, effect.name, None, *start, visible=True))
            continue
        shapes, columns = sensitivity(fit.model, fit.data_sets, effect)
        if not shapes:
            continue
        columns = np.pad(columns, ((0, 0), (0, fit.residual.size - columns.shape[1])))  # rows of priors
        gains, amounts, visible = scores(columns, fit.residual, basis)
        amount = effect.amount
        sign = 1 if amount.neutral == amount.bounds[0] else 0
        gains = np.where((amounts > 0.0) | (sign == 0), gains, 0.0)
        best = int(np.argmax(gains))
        suggested = float(np.clip(amounts[best] * amount.typical, *amount.bounds))
        shape = shapes[best] | ({qualified_name(effect, amount): suggested} if amount.log else {})
        model = fit.model.with_effect(effect.name, shape)
        signature = Signature(columns, np.abs(columns * relative_noise).max(axis=1), act_together=False, sign=sign)
        ranked.append(
            Proposal("effect", family, effect.name, signature, model, float(gains[best]), visible=bool(visible.any()))
        )
    return sorted(ranked, key=lambda proposal: (-proposal.score, proposal.signature is None))


def scores(columns: Array, residual: Array, basis: Array) -> tuple[Array, Array, Array]:
    """Decrease of chi-square if the amount of a change of the residuals is fitted together with the parameters.

    Args:
        columns: changes of the n whitened residuals per unit amount, (c, n).
        residual: whitened residuals of the fitted model, (n,).
        basis: basis of the residuals that its parameters can absorb, from `parameter_basis`, (n, k).

    Returns:
        Decrease of chi-square, best amount, and a mask of the visible changes: those that parameters do not absorb,
        (c,) each. Decrease and amount are 0 for the others.
    """
    lengths = np.linalg.norm(columns, axis=1)
    lengths = np.where(lengths > 0.0, lengths, 1.0)
    unit = columns / lengths[:, None]
    projected = unit - (unit @ basis) @ basis.T
    squares, products = np.einsum("ij,ij->i", projected, projected), projected @ residual
    visible = squares > _LEFT**2
    inverse = visible / np.where(visible, squares, 1.0)
    return inverse * np.square(products), -inverse * products / lengths, visible


def parameter_basis(jacobian: Array) -> Array:
    """Orthonormal basis of the residuals that parameters can absorb, (n, k), from their derivatives, (k, n)."""
    basis, size, _ = np.linalg.svd(jacobian.T, full_matrices=False)
    return basis[:, size > 1e-10 * size[0]]


def has_used_parameters(effect: Effect, model: Model) -> bool:
    """True if a model has all parameters of other branches that the law of an effect uses."""
    return not (isinstance(effect, Branch) and {*effect.uses} - {*model.values})


def missing_effects(model: Model, places: Collection[str], excluded: Collection[str] = ()) -> list[Effect]:
    """List the effects of the library that a model lacks and that tests in given directions could show.

    Args:
        model: the model.
        places: names of directions, specimens and bushings tested, see `geometry.shared_labels`.
        excluded: names of effects not to consider, with effects of the same response (twins).

    Returns:
        Effects. Of twins (an effect of the bushing and one of the rig with the same response), only that of the
        bushing.
    """
    present = (None, *model.effects)
    excluded_names = {name for member in (*model.effects, *excluded) for name in twins_of(member)}
    unavailable = {*excluded_names, *(effect.replaces for effect in model.records)}
    possible = [effect for effect in effects_for_places(places).values() if has_used_parameters(effect, model)]
    missing = [effect for effect in possible if effect.name not in unavailable]
    series = {name for effect in model.records for name in effect.never_with}
    series |= {effect.name for effect in missing if {*effect.never_with} & {*present}}
    return [
        effect
        for effect in missing
        if effect.name not in series and (effect.replaces is not None or effect.after in present)
    ]


def _replacement(fit: FitResult, effect: Effect, fixed: Sequence[str]) -> tuple[Model, float] | None:
    """Replace a branch of a fitted model by an effect, with the starting values that promise the best fit.

    Args:
        fit: the fitted model and the tests.
        effect: effect that replaces the branch.
        fixed: names of parameters that are not fitted.

    Returns:
        The model at these values, and the expected decrease of chi-square; None if the effect has no response.
    """
    ends = list[tuple[float, Model]]()
    for start in fit.model.start_values_for(effect):
        with suppress(FitError, ModelError):  # no response from there
            with_effect = fit.model.with_effect(effect.name, start)
            descent = Descent.start(FitProblem.with_fixed(with_effect, fit.data_sets, fixed, {}))
            ends.append((descent.chi_square - descent.expected_fall, descent.best.model))
    if not ends:
        return None
    chi_square, model = min(ends, key=lambda end: end[0])
    return model, max(fit.chi_square - chi_square, 0.0)


def sensitivity(
    model: Model, data_sets: Sequence[MeasuredTest], effect: Effect
) -> tuple[list[dict[str, float]], Array]:
    """Derivatives of residuals with respect to the amount of a missing effect, on a grid of its shape parameters.

    A shape parameter is any other than the amount, such as the frequency of a resonance. The derivative is the
    difference between a small amount and none in the same call, so that iterative solutions have the same error in
    both. Shape parameters without a finite response (such as a motion inside free play) are left out.

    Args:
        model: the fitted model.
        data_sets: the tests.
        effect: the missing effect.

    Returns:
        Sets of shape parameters by name, and the change of the n whitened residuals due to a typical amount of the
        effect for each set, (shapes, n).
    """
    model = model.with_effect(effect.name)
    axes = {
        qualified_name(effect, parameter): shape_start_values(data_sets, model, parameter)
        for parameter in effect.parameters
        if parameter.neutral is None
    }
    shapes = [dict(zip(axes, point, strict=True)) for point in product(*axes.values())]
    amount = qualified_name(effect, effect.amount)
    none = model.values[amount]

    for _ in range(2):  # the second time without shapes that have no finite response, such as the last one
        amounts = np.append(np.full(len(shapes), none + _STEP * effect.amount.typical), none)[:, None]
        grids = {name: np.array([[shape[name]] for shape in (*shapes, shapes[-1])]) for name in axes}
        values = {**model.values, **grids, amount: amounts}
        rows = np.zeros((len(amounts), sum(data_set.size for data_set in data_sets)))  # the last without the effect
        for data_set, columns in zip(data_sets, residual_slices(data_sets), strict=True):
            if effect.acts_at(data_set.direction):
                rows[:, columns] = data_set.residual_of(data_set.response(model, values))
        is_finite = np.asarray(np.isfinite(rows).all(axis=1))
        shapes, rows = list(compress(shapes, is_finite)), rows[[*is_finite[:-1], True]]
        if is_finite[-1] or not shapes:
            break
    return shapes, (rows[:-1] - rows[-1]) / _STEP
