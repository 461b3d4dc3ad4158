"""Response of a model: the stiffness and force of its branches, modifiers and layers together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial, reduce
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bushfit.effects import Layer, Setting
from bushfit.effects.contract import Array, Condition, ForceBelow, StiffnessBelow, Values
from bushfit.effects.history import History
from bushfit.model.structure import as_one_layer, in_groups, values_for_effect

if TYPE_CHECKING:
    from bushfit.model.model import Model


def stack_stiffness(
    model: Model, setting: Setting, values: Values, layers: Sequence[Layer], omega: Array, amplitude: Array
) -> Array:
    """Complex stiffness in a test of the rubber and the layers around it, such as the rig.

    Args:
        model: the model.
        setting: direction, kind and conditions of the test.
        values: parameter values [SI] by qualified name.
        layers: layers to include, from the rubber outward.
        omega: angular frequencies [rad/s], (n,).
        amplitude: zero-to-peak displacements [m] or rotations [rad], (n,).

    Returns:
        Complex stiffness [N/m or N m/rad], (..., n).
    """
    groups = in_groups(layers)

    def below(count: int) -> StiffnessBelow:
        """Build the functions for the steady response of the rubber and its `count` innermost groups of layers.

        Args:
            count: number of groups of layers, from the rubber outward.

        Returns:
            Functions for the stiffness, and for the force over a steady cycle.
        """

        def cycle(omega: Array, motion: Array, points: Any) -> Array:
            """Force [N or N m] over one steady cycle, (..., k, n).

            Args:
                omega: angular frequencies [rad/s], (..., k).
                motion: displacement [m] or rotation [rad] over a cycle, (..., k, n).
                points: numpy index of these k operating points in the test.
            """
            per_sample = {
                name: value if np.ndim(value) == 0 else np.asarray(value)[..., None] for name, value in values.items()
            }
            cycles = replace(setting, conditions=setting.conditions.select(points).select((..., None)))
            force = stack_force(model, cycles, per_sample, [layer for group in groups[:count] for layer in group])
            return force(History.steady(motion, cast(float, omega[..., None] / (2.0 * np.pi))))

        if count == 0:
            return StiffnessBelow(partial(rubber_stiffness, model, setting, values), cycle)
        inner, (layer, layer_values) = below(count - 1), as_one_layer(groups[count - 1], values)
        return StiffnessBelow(
            lambda omega, amplitude: layer.stiffness(layer_values, inner, omega, amplitude, setting), cycle
        )

    return below(len(groups)).stiffness(omega, amplitude)


def rubber_stiffness(model: Model, setting: Setting, values: Values, omega: Array, amplitude: Array) -> Array:
    """Complex stiffness of the rubber alone [N/m or N m/rad], (..., n): without layers such as sleeve, rig and sensors.

    The parameters have the values at the conditions of the test, such as its temperature.

    Args:
        model: the model.
        setting: direction, kind and conditions of the test.
        values: parameter values [SI] by qualified name.
        omega: angular frequencies [rad/s], (n,).
        amplitude: zero-to-peak displacements [m] or rotations [rad], (n,).
    """
    strain = amplitude * model.unit_strain(setting.direction)
    base = adjusted_values(model, setting, values, omega, amplitude, strain)
    return branch_stiffness(model, setting, values, omega, strain, base)


def stack_force(model: Model, setting: Setting, values: Values, layers: Sequence[Layer]) -> ForceBelow:
    """Build the function that computes the force of the rubber and the layers around it.

    Args:
        model: the model.
        setting: direction, kind and conditions of the test.
        values: parameter values [SI] by qualified name.
        layers: layers to include, from the rubber outward.

    Returns:
        Function of a history of displacement [m or rad] that gives the force [N or N m], (..., n).
    """
    per_displacement = model.unit_strain(setting.direction)
    factor = model.stiffness_per_modulus(setting.direction) / (2.0 * per_displacement)
    structure, last_moduli = model.structure, dict[int, tuple[Any, Array]]()

    def rubber(displacement: History) -> Array:
        """Force of the rubber alone.

        Args:
            displacement: history of displacement [m] or rotation [rad].

        Returns:
            Force [N] or moment [N m], (..., n).
        """
        strain, base = displacement.scaled(per_displacement), values
        if structure.modifiers:
            omega = np.atleast_1d(displacement.omega)
            base = adjusted_values(model, setting, values, omega, displacement.amplitude, strain.amplitude)
            if any(modifier.shift_factor for modifier in structure.modifiers):
                strain = strain.faster(model.shift_factor(setting.conditions, values))
        together, stress = displacement.periodic and structure.viscoelastic, np.zeros(1)
        for branch in structure.others if together else structure.branches:
            stress = stress + branch.stress(values_for_effect(branch, base), strain)
        for modifier in structure.modifiers:
            if modifier.stress:
                stress = stress + modifier.stress(values_for_effect(modifier, values), strain, setting)
        if together:  # the linear branches add up harmonic by harmonic; motions of one time step share their moduli
            count = strain.value.shape[-1]
            step, moduli = last_moduli.get(count, (None, np.zeros(1)))
            if step is not strain.step or base is not values:
                moduli = np.zeros(1)
                for branch in structure.viscoelastic:
                    moduli = moduli + branch.modulus(
                        values_for_effect(branch, base), strain.harmonics, strain.amplitude
                    )
                if base is values:
                    last_moduli[count] = strain.step, moduli
            stress = stress + 2.0 * np.fft.irfft(moduli * strain.spectrum, n=count)
        return factor * stress

    def wrap(below: ForceBelow, group: Sequence[Layer]) -> ForceBelow:
        """Build the function for the force outside a group of layers from that for the force inside."""
        layer, layer_values = as_one_layer(group, values)
        return lambda displacement: layer.force(layer_values, below, displacement, setting)

    return reduce(wrap, in_groups(layers), cast(ForceBelow, rubber))


def branch_stiffness(
    model: Model, setting: Setting, values: Values, omega: Array, strain: Array, base: Values
) -> Array:
    """Complex stiffness of the sum of the branches, for given parameter values.

    Args:
        model: the model.
        setting: direction, kind and conditions of the test.
        values: parameter values [SI] by qualified name, for the shift factor.
        omega: angular frequencies [rad/s], (n,).
        strain: strain amplitudes, (n,).
        base: parameter values [SI] after the modifiers, for the branches.

    Returns:
        Stiffness [N/m or N m/rad], (..., n).
    """
    omega, modulus = omega * model.shift_factor(setting.conditions, values), np.zeros(1)
    for branch in model.structure.branches:
        modulus = modulus + branch.modulus(values_for_effect(branch, base), omega, strain)
    return model.stiffness_per_modulus(setting.direction) * modulus


def adjusted_values(
    model: Model, setting: Setting, values: Values, omega: Array, amplitude: Array, strain: Array
) -> Values:
    """Compute the parameter values at operating points, after the changes by all modifiers.

    Args:
        model: the model.
        setting: direction, kind and conditions of the test.
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
            base = {**base, **modifier.adjust(values_for_effect(modifier, base), condition)}
    return base
