"""Model of a bushing: its geometry, the effects that make up its response, and their parameter values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import prod
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from bushfit import geometry
from bushfit.effects import BASE, Branch, Effect, Level, Parameter, Setting, get_effect, qualified_name, twins_of
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions, Value, Values
from bushfit.effects.history import History
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.effects.unnamed import SmoothCorrection
from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction, Place
from bushfit.model.constraints import UNCONSTRAINED, Constraints
from bushfit.model.stack import Stack, acting_layers
from bushfit.model.structure import Structure, structure_of, values_for_effect
from bushfit.units import display_unit

#: Kind of test: stepped-sine sweep or hysteresis loop. The two may use different force channels of the rig.
Kind = Literal["sweep", "loop"]

#: Names of the paper's five parameters.
FIVE = tuple(parameter.name for name in BASE for parameter in get_effect(name).parameters)


@dataclass(frozen=True)
class Model:
    """Immutable model of a bushing: its geometry, its effects, and one value for each parameter.

    Args:
        bushing: geometry; None for a compound that is known from specimens alone.
        effects: names of effects from the library, in any order.
        values: SI value of every parameter, by its name in files and reports.
        unnamed: data of the smooth correction `unnamed`; None if `effects` does not include it.
        constraints: priors and ties of its parameters; the values of tied parameters follow from the others.

    Raises:
        ModelError: an effect is unknown, listed twice or without its data, or a value is missing, unknown, not finite
            or outside the parameter's bounds.
    """

    bushing: Bushing | None
    effects: tuple[str, ...]
    values: Mapping[str, float]
    unnamed: SmoothCorrection | None = None
    constraints: Constraints = field(default=UNCONSTRAINED, compare=False)

    def __post_init__(self) -> None:
        """Compute the values of tied parameters, and check the values of all parameters."""
        object.__setattr__(self, "effects", tuple(self.effects))
        tied_values = self.constraints.tied_values(self.values)
        object.__setattr__(self, "values", MappingProxyType(tied_values))
        if (UNNAMED in self.effects) != (self.unnamed is not None):
            expected = "both, or neither"
            raise ModelError("an effect without its data, or data without an effect", place=UNNAMED, expected=expected)
        parameters = self.parameters
        for name in dict.fromkeys([*parameters, *self.values]):
            if name not in self.values:
                raise ModelError("a parameter has no value", place=name, expected=f"a number [{parameters[name].unit}]")
            if name not in parameters:
                raise ModelError("unknown parameter", place=name, expected="one of " + ", ".join(parameters))
            self._check(name, parameters[name])

    def _check(self, name: str, parameter: Parameter) -> None:
        """Raise a ModelError if a value is outside the bounds of its parameter; the neutral value is always valid."""
        value, (low, high) = self.values[name], parameter.bounds
        if parameter.neutral is not None:
            low, high = min(low, parameter.neutral), max(high, parameter.neutral)
        if not low <= value <= high:
            unit = "" if parameter.unit == "1" else f" {parameter.unit}"
            tie = next((tie for tie in self.constraints.active_ties(self.values) if tie.name == name), None)
            raise ModelError(
                "impossible value",
                file=tie.file if tie else None,
                place=f"fit.{name}" if tie else name,
                found=f"{tie.expression} = {value:g}{unit}" if tie else f"{value:g}{unit}",
                expected=f"{low:g} to {high:g}{unit} ({parameter.meaning})",
                hint="correct the expression, or limit its parameters by min and max in [fit]" if tie else None,
            )

    def __reduce__(self) -> tuple[Any, ...]:
        """Support copies and pickles: the read-only mapping of the values has none."""
        return Model, (self.bushing, self.effects, dict(self.values), self.unnamed, self.constraints)

    @cached_property
    def tied_names(self) -> tuple[str, ...]:
        """Names of the parameters whose values follow from other parameters."""
        return tuple(tie.name for tie in self.constraints.active_ties(self.values))

    @cached_property
    def structure(self) -> Structure:
        """Effects of the model by kind: branches of the rubber, modifiers of parameters, layers around the rubber."""
        return structure_of(self.effects)

    @property
    def records(self) -> tuple[Effect, ...]:
        """Effects of the model from the rubber outward: material, component, then instrument, each in library order."""
        return self.structure.records

    @property
    def parameters(self) -> Mapping[str, Parameter]:
        """Definitions (unit, bounds, meaning) of all parameters, by name in files and reports."""
        return self.structure.parameters

    @property
    def without_time_law(self) -> list[str]:
        """Names of the effects with a law for the steady first harmonic only, and no law in time."""
        return [effect.name for effect in self.records if effect.harmonic_only]

    def require_time_law(self) -> None:
        """Raise a ModelError if an effect has no law in time."""
        if names := self.without_time_law:
            raise ModelError(
                "an effect of the model has no law in time, which this calculation needs",
                place=" and ".join(names),
                found="a law for the steady first harmonic only",
                expected="effects whose force can be computed over time",
                hint="use a model without this effect, or predict the steady state",
            )

    @property
    def constant_modifiers(self) -> list[str]:
        """Names of the modifiers that a simulation in time evaluates only once, at the amplitude of the whole motion.

        Modifiers are effects that change parameters with frequency or amplitude; temperature shifts are not listed.
        """
        return [effect.name for effect in self.structure.modifiers if not effect.shift_factor]

    @property
    def depends_on(self) -> set[str]:
        """Conditions of a test, named as in `RubberConditions` ("temperature"), that the response depends on."""
        return {condition for effect in self.records for condition in effect.depends_on}

    @property
    def is_transient(self) -> bool:
        """True if the response changes from cycle to cycle until it is steady."""
        return any(effect.is_transient for effect in self.records)

    @property
    def name(self) -> str:
        """Name of the bushing; "compound" for a model without a bushing."""
        return self.bushing.name if self.bushing else "compound"

    def unit_strain(self, place: Place) -> float:
        """Equivalent strain of the rubber per displacement [1/m], rotation [1/rad] or stated strain [1] of a test."""
        return geometry.unit_strain(self.bushing, place)

    def stiffness_per_modulus(self, place: Place) -> float:
        """Stiffness of a direction or specimen per shear modulus: [m], [m^3/rad] in torsion, [1] for modulus tests."""
        return geometry.stiffness_per_modulus(self.bushing, place)

    def with_values(self, values: Mapping[str, float]) -> "Model":
        """Copy the model with some parameter values [SI] replaced."""
        return replace(self, values={**self.values, **values})

    @classmethod
    def with_defaults(
        cls,
        bushing: Bushing | None,
        effects: Sequence[str],
        values: Mapping[str, float],
        unnamed: SmoothCorrection | None = None,
        constraints: Constraints = UNCONSTRAINED,
    ) -> "Model":
        """Create a model; parameters without a given value have their neutral value, or else a typical value.

        Args:
            bushing: geometry, or None for a compound.
            effects: names of the effects.
            values: parameter values [SI] by name in files; values of other effects are ignored.
            unnamed: data of the smooth correction `unnamed`, if it is among the effects.
            constraints: priors and ties of its parameters.

        Returns:
            The model.

        >>> Model.with_defaults(paper.bushing, ["elastic", "viscous"], {"mu": 1e6}).values["viscous.eta"]
        0.0
        """
        found = {
            name: values.get(name, parameter.typical if parameter.neutral is None else parameter.neutral)
            for name, parameter in structure_of(tuple(effects)).parameters.items()
        }
        return cls(bushing, tuple(effects), found, unnamed, constraints)

    def with_effect(self, name: str, values: Mapping[str, float] | None = None) -> "Model":
        """Create a model with one more effect, without the branch that the effect replaces, if any.

        Args:
            name: name of the effect.
            values: values [SI] of its parameters; others are derived from the replaced branch, or are the defaults.

        >>> paper.with_effect("sliders").effects
        ('elastic', 'springpot', 'sliders')
        """
        effect = get_effect(name)
        names = [present for present in self.effects if present != effect.replaces]
        start = {**self.values, **self.start_values_for(effect)[0], **(values or {})}
        return Model.with_defaults(self.bushing, (*names, name), start, self.unnamed, self.constraints)

    def start_values_for(self, effect: Effect) -> list[dict[str, float]]:
        """Compute start values of an effect that is added to the model, from the branch that the effect replaces.

        Returns:
            Parameter values [SI] of each start by qualified name; one empty start if the effect replaces no branch.
        """
        if effect.replaces not in self.effects or not effect.in_place_of:
            return [{}]
        parameters = [(qualified_name(effect, parameter), parameter) for parameter in effect.parameters]
        return [
            {key: float(np.clip(suggested[parameter.name], *parameter.bounds)) for key, parameter in parameters}
            for suggested in effect.in_place_of(self.values)
        ]

    def with_twin(self, name: str) -> "Model":
        """Replace the twins of an effect (effects that no test can distinguish from it) by the effect itself.

        Returns:
            The changed model, or the same model if it includes no twin of the effect.
        """
        twins = [effect for effect in self.records if effect.name in twins_of(name) and effect.name != name]
        if not twins:
            return self
        values = dict(self.values)
        for twin in twins:
            for old, new in zip(twin.parameters, get_effect(name).parameters, strict=True):
                values[qualified_name(get_effect(name), new)] = self.values[qualified_name(twin, old)]
        effects = dict.fromkeys([*(effect.name for effect in self.records if effect not in twins), name])
        return Model.with_defaults(self.bushing, [*effects], values, self.unnamed, self.constraints)

    def without(self, *left: Level | str) -> "Model":
        """Create a model without the effects of the given levels (such as the rig's) or names.

        >>> paper.with_effect("inertia").without(Level.INSTRUMENT).effects
        ('elastic', 'springpot', 'friction')
        """
        names = [effect.name for effect in self.records if not {effect.level, effect.name} & {*left}]
        unnamed = self.unnamed if UNNAMED in names else None
        return Model.with_defaults(self.bushing, names, self.values, unnamed, self.constraints)

    def equation(self) -> str:
        """Describe the model as text: formula of the first-harmonic stiffness, other effects, and parameter values.

        Returns:
            Lines of text: stiffness formula, other effects, then parameter values.

        >>> print(paper.equation().splitlines()[1])
          mu = 1.09 MPa
        """
        branches = " + ".join(effect.equation for effect in self.structure.branches)
        symbols = "k: stiffness of this shape for a modulus of 1; omega: angular frequency"
        friction = "; A, B: stress in and out of phase at the strain amplitude e0" * ("A + iB" in branches)
        lines = [f"K = k ({branches}); {symbols}{friction}"]
        lines += [f"  {effect.name}: {effect.equation}" for effect in self.records if not isinstance(effect, Branch)]
        for name, parameter in self.parameters.items():
            unit, factor = display_unit(parameter.unit, 1.0, self.values[name])
            lines.append(f"  {name} = {self.values[name] * factor:.6g} {unit}".removesuffix(" -"))
        return "\n".join(lines)

    def stiffness(
        self,
        direction: Place | str,
        frequency: Array | float,
        amplitude: Array | float,
        *,
        kind: Kind = "sweep",
        values: Values | None = None,
        conditions: RubberConditions = UNKNOWN,
    ) -> Array:
        """Complex dynamic stiffness of the steady first harmonic [N/m or N m/rad].

        Args:
            direction: direction of the motion, or its name (axial, radial, torsion), or the specimen under test.
            frequency: frequency [Hz], broadcast with amplitude.
            amplitude: zero-to-peak displacement [m] or rotation [rad].
            kind: kind of test, "loop" or "sweep"; only effects of the instrument differ between them.
            values: parameter values [SI] in place of those of the model; arrays whose last axis has
                length 1 add leading axes to the result.
            conditions: temperature and strain history of the rubber in the test.

        Returns:
            Complex stiffness, in the common shape of frequency and amplitude.

        Notes:
            The rubber has k = G mu^(omega, e0) with G of Eqs. 10 to 12 and e0 of Eqs. 7 and 8 of Garcia Tarrago et al.
            2007; the layers of the model are applied to it.

        >>> k = paper.stiffness("axial", 100.0, 1e-4)
        >>> print(f"{abs(k) / 1e3:.1f} N/mm, loss factor {k.imag / k.real:.3f}")
        675.5 N/mm, loss factor 0.135
        """
        omega = 2.0 * np.pi * np.asarray(frequency, dtype=float)
        amplitude = np.asarray(amplitude, dtype=float)
        if omega.shape != amplitude.shape:
            omega, amplitude = np.broadcast_arrays(omega, amplitude)
        stack = self.stack(direction, kind, conditions, values)
        stiffness = stack(np.atleast_1d(omega), np.atleast_1d(amplitude))
        return stiffness if omega.ndim else stiffness[..., 0]

    def force(
        self,
        direction: Place | str,
        displacement: History,
        *,
        kind: Kind = "sweep",
        values: Values | None = None,
        conditions: RubberConditions = UNKNOWN,
    ) -> Array:
        """Force over time for a displacement history, from rest or in a steady cycle.

        Args:
            direction: direction or specimen, or the name of a direction.
            displacement: history of displacement [m] or rotation [rad], (..., n).
            kind: kind of test, "loop" or "sweep"; only effects of the instrument differ between them.
            values: parameter values [SI] in place of those of the model.
            conditions: temperature and strain history of the rubber in the test.

        Returns:
            Force [N] or moment [N m], (..., n).

        >>> motion = History.steady(1e-3 * np.sin(np.linspace(0.0, 2.0 * np.pi, 256)), 0.1)
        >>> round(float(paper.force("axial", motion).max()), 1)
        458.1
        """
        return self.stack(direction, kind, conditions, values).force(displacement)

    def setting(self, place: Place | str, kind: Kind = "sweep", conditions: RubberConditions = UNKNOWN) -> Setting:
        """Collect the properties of a test that its response depends on.

        Args:
            place: direction or specimen, or the name of a direction.
            kind: kind of test, "loop" or "sweep".
            conditions: temperature and strain history of the rubber in the test.

        Returns:
            Geometry, direction, kind and test conditions.
        """
        direction = Direction(place) if isinstance(place, str) else place
        return Setting(self.bushing, direction, kind, conditions, self.unnamed)

    def stack(
        self,
        place: Place | str,
        kind: Kind = "sweep",
        conditions: RubberConditions = UNKNOWN,
        values: Values | None = None,
    ) -> Stack:
        """Rubber and layers (effects around it, such as the rig's) that act in a test, to evaluate stiffness and force.

        Args:
            place: direction or specimen, or the name of a direction.
            kind: kind of test, "loop" or "sweep".
            conditions: temperature and strain history of the rubber in the test.
            values: parameter values [SI] in place of those of the model.
        """
        setting, values = self.setting(place, kind, conditions), self.values if values is None else values
        return Stack(self, setting, values, acting_layers(self, setting, values))

    def values_at(
        self, place: Place, frequency: float, amplitude: float, conditions: RubberConditions = UNKNOWN
    ) -> dict[str, float]:
        """Parameter values after all modifiers, at one operating condition.

        Args:
            place: direction or specimen.
            frequency: frequency [Hz].
            amplitude: zero-to-peak displacement [m] or rotation [rad].
            conditions: temperature and strain history of the rubber in the test.

        Returns:
            Parameter values [SI] by qualified name.

        >>> model = paper.with_effect("rate_dependent_friction", {"rate_dependent_friction.n": 0.1})
        >>> round(model.values_at("axial", 50.0, 1e-3)["sigma_fmax"])
        15648
        """
        omega, reached = 2.0 * np.pi * np.atleast_1d(frequency), np.atleast_1d(amplitude)
        setting = self.setting(place, conditions=conditions)
        strain = reached * self.unit_strain(setting.direction)
        adjusted = Stack(self, setting, self.values).adjusted_values(omega, reached, strain)
        return {name: float(np.asarray(value).item()) for name, value in adjusted.items()}

    def shift_factor(self, conditions: RubberConditions, values: Values | None = None) -> Value:
        """Time-temperature shift factor a_T at the temperature of a test: ratio of reduced to actual frequency."""
        values = self.values if values is None else values
        shifts = ((modifier, modifier.shift_factor) for modifier in self.structure.modifiers)
        return prod(shift(values_for_effect(modifier, values), conditions) for modifier, shift in shifts if shift)
