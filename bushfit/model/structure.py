"""Structure of a model: its effects by kind, their parameters, and the parameter values that each effect uses."""

from collections.abc import Mapping
from functools import lru_cache
from types import MappingProxyType

from bushfit.effects import BASE, LIBRARY, Branch, Effect, Layer, Modifier, Parameter, get_effect, qualified_name
from bushfit.effects.contract import Values
from bushfit.errors import ModelError


class Structure:
    """Effects of a model sorted by kind, and their parameters; equal for all models with the same effects.

    Args:
        names: names of the effects, in any order.

    Attributes:
        records: all effects, from the rubber outward.
        parameters: definitions of all parameters by name in files and reports.
        branches: effects that add a stress, in parallel.
        viscoelastic: linear viscoelastic branches, whose steady responses add up harmonic by harmonic.
        modifiers: effects that change parameter values of other effects.
        layers: effects around the rubber, such as the rig, from the rubber outward.
        moduli: names of the moduli and stresses, to which together the stiffness of the rubber is proportional.

    Raises:
        ModelError: an effect is unknown or listed twice.
    """

    def __init__(self, names: tuple[str, ...]) -> None:
        if doubles := {name for name in names if names.count(name) > 1}:
            raise ModelError("an effect is listed twice", found=", ".join(sorted(doubles)))
        kinds = [name.partition(".")[0] for name in LIBRARY]

        def outward(effect: Effect) -> tuple[int, int, str]:
            kind = effect.name.partition(".")[0]
            return effect.level, kinds.index(kind) if kind in kinds else len(kinds), effect.name

        self.records = tuple(sorted(map(get_effect, names), key=outward))
        self.parameters: Mapping[str, Parameter] = MappingProxyType(
            {qualified_name(effect, parameter): parameter for effect in self.records for parameter in effect.parameters}
        )
        self.branches = tuple(effect for effect in self.records if isinstance(effect, Branch))
        self.viscoelastic = tuple(branch for branch in self.branches if branch.size)
        self.modifiers = tuple(effect for effect in self.records if isinstance(effect, Modifier))
        self.layers = tuple(effect for effect in self.records if isinstance(effect, Layer))
        self.moduli = tuple(
            qualified_name(branch, parameter)
            for branch in self.branches
            for parameter in branch.parameters
            if parameter.unit.startswith("Pa")
        )


#: Structure of the models with the given names of effects; cached for fits.
structure_of = lru_cache(maxsize=256)(Structure)


def values_for_effect(effect: Effect, values: Values) -> Values:
    """Parameter values for the functions of an effect: all by full name, and its own values by short name as well."""
    if effect.name in BASE:
        return values
    return {**values, **{parameter.name: values[qualified_name(effect, parameter)] for parameter in effect.parameters}}
