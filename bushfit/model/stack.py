"""Response of a model: the stiffness and force of its branches, modifiers and layers together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial, reduce
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bushfit.effects import Layer, Setting
from bushfit.effects.contract import Array, Condition, ForceBelow, StiffnessBelow, Values
from bushfit.effects.history import History
from bushfit.model.structure import as_one_layer, in_groups, seen_by

if TYPE_CHECKING:
    from bushfit.model.model import Model


def stack_stiffness(model: Model, setting: Setting, values: Values) -> Callable[[Array, Array], Array]:
    """Stiffness of the rubber and all layers around it.

    Args:
        model: the model.
        setting: direction and circumstances of the test.
        values: parameter values [SI] by qualified name.

    Returns:
        Function of omega [rad/s] and amplitude [m or rad], (n,) each: the complex stiffness [N/m or N m/rad].
    """

    def rubber(omega: Array, amplitude: Array) -> Array:
        strain = amplitude * model.unit_strain(setting.direction)
        base = adjusted_values(model, setting, values, omega, amplitude, strain)
        return branch_stiffness(model, setting, values, omega, strain, base)

    layers = model.layers(setting)
    if not layers:
        return rubber
    groups = in_groups(layers)
    per_sample = {
        name: value if np.ndim(value) == 0 else np.asarray(value)[..., None] for name, value in values.items()
    }

    def below(count: int) -> StiffnessBelow:
        """Response of the rubber and the innermost `count` groups of layers.

        Returns:
            Stiffness and steady-cycle force of these layers.
        """

        def cycle(omega: Array, motion: Array, points: Any) -> Array:
            """Force over one steady cycle of the rubber and these layers.

            Args:
                omega: angular frequencies [rad/s], (..., k).
                motion: displacement [m] or rotation [rad] over a cycle, (..., k, n).
                points: index of the operating points among those of the test.

            Returns:
                Force [N] or moment [N m], (..., k, n).
            """
            cycles = replace(setting, under=setting.under.select(points).select((..., None)))
            force = stack_force(model, cycles, per_sample, [layer for group in groups[:count] for layer in group])
            return force(History.steady(motion, cast(float, omega[..., None] / (2.0 * np.pi))))

        if count == 0:
            return StiffnessBelow(rubber, cycle)
        inner, (layer, layer_values) = below(count - 1), as_one_layer(groups[count - 1], values)
        return StiffnessBelow(
            lambda omega, amplitude: layer.stiffness(layer_values, inner, omega, amplitude, setting), cycle
        )

    return below(len(groups))


def stack_force(model: Model, setting: Setting, values: Values, layers: Sequence[Layer]) -> ForceBelow:
    """Force of the rubber and the layers around it.

    Args:
        model: the model.
        setting: direction and circumstances of the test.
        values: parameter values [SI] by qualified name.
        layers: layers to include, from the rubber outward.

    Returns:
        Function of a history of displacement [m or rad] that gives the force [N or N m], (..., n).
    """
    per_displacement = model.unit_strain(setting.direction)
    factor = model.stiffness_per_modulus(setting.direction) / (2.0 * per_displacement)

    structure, cached_moduli = model.structure, dict[int, tuple[Any, Array]]()

    def rubber(displacement: History) -> Array:
        """Force of the rubber alone over a history of displacement.

        Returns:
            Force [N] or moment [N m], (..., n).
        """
        strain, base = displacement.scaled(per_displacement), values
        if structure.modifiers:
            omega = np.atleast_1d(displacement.omega)
            base = adjusted_values(model, setting, values, omega, displacement.amplitude, strain.amplitude)
        if any(modifier.shift_factor for modifier in structure.modifiers):
            strain = strain.faster(model.shift_factor(setting.under, values))
        together = displacement.periodic and structure.viscoelastic
        alone = structure.others if together else structure.branches
        stresses = [branch.stress(seen_by(branch, base), strain) for branch in alone]
        if together:
            stresses.append(strain.response(lambda omega: modulus(omega, base, strain)))
        return factor * sum(stresses, start=np.zeros(1))

    def modulus(omega: Array, base: Values, strain: History) -> Array:
        """Modulus [Pa] of the linear branches at harmonics, cached for motions with the same time step.

        Args:
            omega: angular frequencies of the harmonics [rad/s].
            base: parameter values [SI].
            strain: history of strain.

        Returns:
            Complex moduli, twice their sum, (..., harmonics).
        """
        count, step = strain.value.shape[-1], strain.step
        if base is values and count in cached_moduli and cached_moduli[count][0] is step:
            return cached_moduli[count][1]
        linear = structure.viscoelastic
        moduli = (branch.modulus(seen_by(branch, base), omega, strain.amplitude) for branch in linear)
        found = np.asarray(2.0 * sum(moduli))
        if base is values:
            cached_moduli[count] = step, found
        return found

    def wrap(below: ForceBelow, group: Sequence[Layer]) -> ForceBelow:
        layer, layer_values = as_one_layer(group, values)
        return lambda displacement: layer.force(layer_values, below, displacement, setting)

    return reduce(wrap, in_groups(layers), cast(ForceBelow, rubber))


def branch_stiffness(
    model: Model, setting: Setting, values: Values, omega: Array, strain: Array, base: Values
) -> Array:
    """Complex stiffness of the rubber without layers.

    Args:
        model: the model.
        setting: direction and circumstances of the test.
        values: parameter values [SI] by qualified name, for the shift factor.
        omega: angular frequencies [rad/s], (n,).
        strain: strain amplitudes, (n,).
        base: parameter values [SI] after the modifiers, for the branches.

    Returns:
        Stiffness [N/m or N m/rad], (..., n).
    """
    omega = omega * model.shift_factor(setting.under, values)
    moduli = (branch.modulus(seen_by(branch, base), omega, strain) for branch in model.structure.branches)
    return np.atleast_1d(model.stiffness_per_modulus(setting.direction) * sum(moduli))


def adjusted_values(
    model: Model, setting: Setting, values: Values, omega: Array, amplitude: Array, strain: Array
) -> Values:
    """Parameter values after all modifiers at operating points.

    Args:
        model: the model.
        setting: direction and circumstances of the test.
        values: parameter values [SI] by qualified name.
        omega: angular frequencies [rad/s], (n,).
        amplitude: zero-to-peak displacements [m] or rotations [rad], (n,).
        strain: strain amplitudes, (n,).

    Returns:
        Parameter values [SI]; those that a modifier adjusts are arrays.
    """
    if not model.structure.modifiers:
        return values
    stiffness = partial(branch_stiffness, model, setting, values, omega, strain)
    condition = Condition(setting, omega, amplitude, strain, stiffness, model.structure.moduli)
    base = values
    for modifier in model.structure.modifiers:
        if modifier.acts_at(setting.direction):
            base = {**base, **modifier.adjust(seen_by(modifier, base), condition)}
    return base
