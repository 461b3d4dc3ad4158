"""Model: a bushing, an ordered list of effects, and their values."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial, reduce
from types import MappingProxyType
from typing import Any, Literal, cast

import numpy as np

from bushfit.effects import (
    BASE,
    LIBRARY,
    Branch,
    Effect,
    Layer,
    Level,
    Modifier,
    Parameter,
    Setting,
    effect_named,
    qualified,
)
from bushfit.effects.contract import Array, Condition, ForceBelow, StiffnessBelow, Values
from bushfit.effects.history import History
from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction
from bushfit.units import for_people

Kind = Literal["sweep", "loop"]

#: Names of the paper's five parameters.
FIVE = tuple(parameter.name for name in BASE for parameter in effect_named(name).parameters)


@dataclass(frozen=True)
class _Structure:
    """What follows from the names of a model's effects, whatever its values."""

    records: tuple[Effect, ...]
    parameters: Mapping[str, Parameter]
    branches: tuple[Branch, ...]
    modifiers: tuple[Modifier, ...]
    layers: tuple[Layer, ...]

    @classmethod
    @lru_cache(maxsize=256)
    def of(cls, names: tuple[str, ...]) -> _Structure:
        doubles = {name for name in names if names.count(name) > 1}
        if doubles:
            raise ModelError("an effect is listed twice", found=", ".join(sorted(doubles)))
        place = {name: place for place, name in enumerate(LIBRARY)}
        records = tuple(sorted(map(effect_named, names), key=lambda effect: (effect.level, place[effect.name])))
        return cls(
            records,
            MappingProxyType(
                {qualified(effect, parameter): parameter for effect in records for parameter in effect.parameters}
            ),
            tuple(effect for effect in records if isinstance(effect, Branch)),
            tuple(effect for effect in records if isinstance(effect, Modifier)),
            tuple(effect for effect in records if isinstance(effect, Layer)),
        )


@dataclass(frozen=True)
class Model:
    """A bushing, the effects its response is made of, and one value per parameter.

    Args:
        bushing: geometry.
        effects: names from the library, in any order.
        values: SI value of every parameter, by the names of files and reports.

    Raises:
        ModelError: an unknown effect, one named twice, or a value that is missing, unknown, not finite or
            outside the parameter's bounds.
    """

    bushing: Bushing
    effects: tuple[str, ...]
    values: Mapping[str, float]

    def __post_init__(self) -> None:
        object.__setattr__(self, "effects", tuple(self.effects))
        object.__setattr__(self, "values", MappingProxyType(dict(self.values)))
        known = self.parameters
        for name in dict.fromkeys([*known, *self.values]):
            if name not in self.values:
                raise ModelError("a parameter has no value", place=name, expected=f"a number [{known[name].unit}]")
            if name not in known:
                raise ModelError("unknown parameter", place=name, expected="one of " + ", ".join(known))
            value, parameter = self.values[name], known[name]
            low, high = parameter.bounds
            if parameter.neutral is not None:
                low, high = min(low, parameter.neutral), max(high, parameter.neutral)
            if not low <= value <= high:
                unit = "" if parameter.unit == "1" else f" {parameter.unit}"
                raise ModelError(
                    "impossible value",
                    place=name,
                    found=f"{value:g}{unit}",
                    expected=f"{low:g} to {high:g}{unit} ({parameter.meaning})",
                )

    def __reduce__(self) -> tuple[Any, ...]:
        return Model, (self.bushing, self.effects, dict(self.values))

    @cached_property
    def _structure(self) -> _Structure:
        return _Structure.of(self.effects)

    @property
    def records(self) -> tuple[Effect, ...]:
        """The effects' records, from the rubber outward: by level, and within one as the library lists them."""
        return self._structure.records

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Every parameter by its name in files and reports."""
        return self._structure.parameters

    @property
    def only_branches(self) -> bool:
        """Whether neither modifiers nor layers stand between the branches and the response."""
        return len(self._structure.branches) == len(self.records)

    def with_values(self, values: Mapping[str, float]) -> Model:
        """The same model with some values replaced."""
        return Model(self.bushing, self.effects, {**self.values, **values})

    @classmethod
    def started(cls, bushing: Bushing, effects: Sequence[str], values: Mapping[str, float]) -> Model:
        """A model with the values given, and neutral or typical ones where none is given."""
        defaults = {
            qualified(effect, parameter): parameter.typical if parameter.neutral is None else parameter.neutral
            for effect in map(effect_named, effects)
            for parameter in effect.parameters
        }
        return cls(bushing, tuple(effects), {name: values.get(name, default) for name, default in defaults.items()})

    def with_effect(self, name: str, values: Mapping[str, float] | None = None) -> Model:
        """The model with one effect more, at the given values or at its neutral and typical ones."""
        return Model.started(self.bushing, (*self.effects, name), {**self.values, **(values or {})})

    def without(self, level: Level) -> Model:
        """The model less every effect of that level."""
        kept = [effect for effect in self.records if effect.level is not level]
        names = {qualified(effect, parameter) for effect in kept for parameter in effect.parameters}
        return Model(
            self.bushing,
            tuple(effect.name for effect in kept),
            {name: value for name, value in self.values.items() if name in names},
        )

    def equation(self) -> str:
        """The model as text: its first-harmonic stiffness, the rubber inside, layers and modifiers named."""
        branches = " + ".join(effect.equation for effect in self._structure.branches)
        lines = [f"K = k ({branches}), k the stiffness of this shape per modulus"]
        lines += [f"  {effect.name}: {effect.equation}" for effect in self.records if not isinstance(effect, Branch)]
        for name, parameter in self.parameters.items():
            unit, factor = for_people(parameter.unit, 1.0, self.values[name])
            lines.append(f"  {name} = {self.values[name] * factor:.6g} {unit}".removesuffix(" -"))
        return "\n".join(lines)

    def stiffness(
        self,
        direction: Direction | str,
        frequency: Array | float,
        amplitude: Array | float,
        *,
        kind: Kind = "sweep",
        values: Values | None = None,
    ) -> Array:
        """Complex dynamic stiffness of the steady first harmonic (Eqs. 6 to 12).

        k = G mu^(omega, e0), with G of Eqs. 10, 11 and e0 of Eqs. 7, 8, inside whatever layers the model has.

        Args:
            direction: of the test, or its name: axial, radial or torsion.
            frequency: [Hz], broadcast with amplitude.
            amplitude: zero-to-peak displacement [m] or rotation [rad].
            kind: whether a loop or a sweep recorded it; only instrument effects care.
            values: parameter values in place of the model's own; arrays whose last axis has length 1 add
                leading axes to the result.

        Returns:
            [N/m] or [N m/rad].
        """
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
        amplitude = np.asarray(amplitude, dtype=float)
        if omega.shape != amplitude.shape:
            omega, amplitude = np.broadcast_arrays(omega, amplitude)
        points = np.atleast_1d(omega)
        respond = self._stack_stiffness(
            Setting(self.bushing, Direction(direction), kind), self.values if values is None else values
        )
        stiffness = respond(points, np.atleast_1d(amplitude))
        if stiffness.shape[-points.ndim :] != points.shape:
            stiffness = stiffness + np.zeros(points.shape)
        return stiffness if omega.ndim else stiffness[..., 0]

    def force(
        self,
        direction: Direction | str,
        displacement: History,
        *,
        kind: Kind = "sweep",
        values: Values | None = None,
    ) -> Array:
        """Force over a displacement history [N or N m], from rest or on the steady cycle."""
        setting = Setting(self.bushing, Direction(direction), kind)
        respond = self._stack_force(setting, self.values if values is None else values, self._structure.layers)
        return respond(displacement)

    def _stack_stiffness(self, setting: Setting, values: Values) -> Callable[[Array, Array], Array]:
        def rubber(omega: Array, amplitude: Array) -> Array:
            strain = amplitude * self.bushing.unit_strain(setting.direction)
            base = self._adjusted(setting, values, omega, amplitude, strain)
            return self._branch_stiffness(setting, values, omega, strain, base)

        layers = self._structure.layers
        if not layers:
            return rubber
        per_sample = {
            name: value if np.ndim(value) == 0 else np.asarray(value)[..., None] for name, value in values.items()
        }

        def below(count: int) -> StiffnessBelow:
            def cycle(omega: Array, motion: Array) -> Array:
                force = self._stack_force(setting, per_sample, layers[:count])
                return force(History.steady(motion, cast(float, omega[..., None] / (2.0 * np.pi))))

            if count == 0:
                return StiffnessBelow(rubber, cycle)
            layer, inner = layers[count - 1], below(count - 1)
            own = seen_by(layer, values, values)
            return StiffnessBelow(
                lambda omega, amplitude: layer.stiffness(own, inner, omega, amplitude, setting), cycle
            )

        return below(len(layers))

    def _stack_force(self, setting: Setting, values: Values, layers: Sequence[Layer]) -> ForceBelow:
        per_displacement = self.bushing.unit_strain(setting.direction)
        factor = self.bushing.stiffness_per_modulus(setting.direction) / (2.0 * per_displacement)

        def rubber(displacement: History) -> Array:
            strain = displacement.scaled(per_displacement)
            omega = np.atleast_1d(displacement.omega)
            base = self._adjusted(setting, values, omega, displacement.amplitude, strain.amplitude)
            stresses = (branch.stress(seen_by(branch, values, base), strain) for branch in self._structure.branches)
            return factor * sum(stresses, start=np.zeros(1))

        def wrap(below: ForceBelow, layer: Layer) -> ForceBelow:
            own = seen_by(layer, values, values)
            return lambda displacement: layer.force(own, below, displacement, setting)

        return reduce(wrap, layers, cast(ForceBelow, rubber))

    def _branch_stiffness(self, setting: Setting, values: Values, omega: Array, strain: Array, base: Values) -> Array:
        moduli = (branch.modulus(seen_by(branch, values, base), omega, strain) for branch in self._structure.branches)
        return np.atleast_1d(self.bushing.stiffness_per_modulus(setting.direction) * sum(moduli))

    def _adjusted(self, setting: Setting, values: Values, omega: Array, amplitude: Array, strain: Array) -> Values:
        """The paper's parameters as the modifiers leave them at an operating condition."""
        if not self._structure.modifiers:
            return values
        stiffness = partial(self._branch_stiffness, setting, values, omega, strain)
        condition, base = Condition(setting, omega, amplitude, strain, stiffness), values
        for modifier in self._structure.modifiers:
            base = {**base, **modifier.adjust(seen_by(modifier, values, base), condition)}
        return base


def seen_by(effect: Effect, values: Values, base: Values) -> Values:
    """What an effect sees: all values as modifiers left them, and its own by their short names."""
    if effect.name in BASE:
        return base
    return {**base, **{parameter.name: values[qualified(effect, parameter)] for parameter in effect.parameters}}
