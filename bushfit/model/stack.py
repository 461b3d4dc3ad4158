"""Response of a model in one test: the stress of its branches, adjusted by modifiers and wrapped by layers."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bushfit.effects import Layer, Setting
from bushfit.effects.contract import Array, Condition, Values
from bushfit.effects.history import History
from bushfit.model.structure import values_for_effect

if TYPE_CHECKING:
    from bushfit.model.model import Model


def acting_layers(model: Model, setting: Setting, values: Values) -> list[tuple[Layer, Values]]:
    """List the layers (effects around the rubber, such as the rig's) that act in a test, with their parameter values.

    Args:
        model: the model.
        setting: direction, kind and conditions of the test.
        values: parameter values [SI] by qualified name.

    Returns:
        Layers from the rubber outward. Adjacent layers with the same equation whose amounts add up, such as two
        compliances in series, are one layer with the sum.
    """
    acting: list[tuple[Layer, Values]] = []
    for layer in model.structure.layers:
        if not layer.acts_at(setting.direction):
            continue
        layer_values = values_for_effect(layer, values)
        if (amount := layer.adds) and acting and acting[-1][0].force is layer.force:
            layer, inner_values = acting.pop()
            layer_values = {**inner_values, amount: inner_values[amount] + layer_values[amount]}
        acting.append((layer, layer_values))
    return acting


@dataclass(frozen=True, eq=False)
class Stack:
    """Rubber and some of the layers around it (effects of sleeve and rig) in one test, to compute stiffness and force.

    It is the argument `below` of the functions of the next layer outward.

    Args:
        model: the model.
        setting: direction, kind and conditions of the test.
        values: parameter values [SI] by qualified name; arrays whose last axis has length 1 add leading axes.
        layers: layers to include, from the rubber outward, with their parameter values.
        modified: False for the stiffness of the rubber without its modifiers, which a modifier may use.
    """

    model: Model
    setting: Setting
    values: Values
    layers: list[tuple[Layer, Values]] = field(default_factory=list)
    modified: bool = True

    @cached_property
    def below(self) -> Stack:
        """The stack inside the outermost layer."""
        return replace(self, layers=self.layers[:-1])

    def __call__(self, omega: Array, amplitude: Array) -> Array:
        """Complex stiffness of the steady first harmonic [N/m or N m/rad], (..., n).

        Args:
            omega: angular frequencies [rad/s], (n,).
            amplitude: zero-to-peak displacements [m] or rotations [rad], (n,).
        """
        if self.layers:
            layer, layer_values = self.layers[-1]
            if layer.response_factor:
                return layer.response_factor(layer_values, self.setting) * self.below(omega, amplitude)
            assert layer.stiffness  # every other layer has it
            return layer.stiffness(layer_values, self.below, omega, amplitude, self.setting)
        model, place, values = self.model, self.setting.direction, self.values
        strain = amplitude * model.unit_strain(place)
        if self.modified and model.structure.modifiers:
            values = self.adjusted_values(omega, amplitude, strain)
        omega, modulus = omega * model.shift_factor(self.setting.conditions, values), np.zeros(omega.shape)
        for branch in model.structure.branches:
            modulus = modulus + branch.modulus(values_for_effect(branch, values), omega, strain)
        return model.stiffness_per_modulus(place) * modulus

    def cycle(self, omega: Array, motion: Array, points: Any) -> Array:
        """Compute the force over one steady cycle of any waveform.

        Args:
            omega: angular frequencies [rad/s], (..., k).
            motion: displacement [m] or rotation [rad] over a cycle, (..., k, n).
            points: numpy index of these k operating points in the test.

        Returns:
            Force [N] or moment [N m], (..., k, n).
        """
        setting = replace(self.setting, conditions=self.setting.conditions.select(points).select((..., None)))
        history = History.steady(motion, cast(float, omega[..., None] / (2.0 * np.pi)))
        arrays = {name: np.asarray(value)[..., None] for name, value in self.values.items() if np.ndim(value)}
        if arrays and motion.ndim == 2 and any(layer.adds for layer, _ in self.layers):
            # the implicit equation of a compliance is solved for the last model, from which all others start
            self._cycle_stack(setting, {name: value[-1] for name, value in arrays.items()}).force(history)
        return self._cycle_stack(setting, arrays).force(history)

    def _cycle_stack(self, setting: Setting, arrays: Values) -> Stack:
        """Copy the stack with some parameter values replaced by arrays, to compute a cycle at all points at once.

        Args:
            setting: the test, with the conditions of these operating points.
            arrays: values by qualified name, (..., k, 1), for k operating points.
        """
        values = {**self.values, **arrays}
        return Stack(self.model, setting, values, acting_layers(self.model, setting, values)[: len(self.layers)])

    def force(self, displacement: History) -> Array:
        """Compute the force over time.

        Args:
            displacement: history of displacement [m] or rotation [rad], (..., n).

        Returns:
            Force [N] or moment [N m], (..., n).
        """
        if self.layers:
            layer, layer_values = self.layers[-1]
            if layer.response_factor:
                return layer.response_factor(layer_values, self.setting) * self.below.force(displacement)
            assert layer.force  # every other layer has it
            return layer.force(layer_values, self.below.force, displacement, self.setting)
        model, setting, values, structure = self.model, self.setting, self.values, self.model.structure
        per_displacement = model.unit_strain(setting.direction)
        strain, stress = displacement.scaled(per_displacement), np.zeros(1)
        if structure.modifiers:
            omega = np.atleast_1d(displacement.omega)
            values = self.adjusted_values(omega, displacement.amplitude, strain.amplitude)
            if any(modifier.shift_factor for modifier in structure.modifiers):
                strain = strain.faster(model.shift_factor(setting.conditions, self.values))
        transfer: Any = 0.0  # stress over strain of the linear branches at each harmonic of a steady cycle
        for branch in structure.branches:
            branch_values = values_for_effect(branch, values)
            if branch.size and strain.periodic:
                transfer = transfer + 2.0 * branch.modulus(branch_values, strain.harmonics, strain.amplitude)
            else:
                stress = stress + branch.stress(branch_values, strain)
        if np.ndim(transfer):
            stress = stress + np.fft.irfft(transfer * strain.spectrum, n=strain.value.shape[-1])
        for modifier in structure.modifiers:
            if modifier.stress:
                stress = stress + modifier.stress(values_for_effect(modifier, self.values), strain, setting)
        return model.stiffness_per_modulus(setting.direction) / (2.0 * per_displacement) * stress

    def adjusted_values(self, omega: Array, amplitude: Array, strain: Array) -> Values:
        """Compute the parameter values at operating points, after the changes by all modifiers.

        Args:
            omega: angular frequencies [rad/s], (n,).
            amplitude: zero-to-peak displacements [m] or rotations [rad], (n,).
            strain: strain amplitudes, (n,).

        Returns:
            Parameter values [SI]; those that a modifier adjusts are arrays.
        """

        def unmodified_stiffness(values: Values) -> Array:
            return Stack(self.model, self.setting, values, modified=False)(omega, amplitude)

        structure, values = self.model.structure, self.values
        condition = Condition(self.setting, omega, amplitude, strain, unmodified_stiffness, structure.moduli)
        for modifier in structure.modifiers:
            if modifier.acts_at(self.setting.direction):
                values = {**values, **modifier.adjust(values_for_effect(modifier, values), condition)}
        return values
