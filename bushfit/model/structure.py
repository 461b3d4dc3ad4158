"""Structure of a model: its effects by kind, their parameters, and the values that each effect reads."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

from bushfit.effects import BASE, LIBRARY, Branch, Effect, Layer, Modifier, Parameter, get_effect, qualified_name
from bushfit.effects.contract import Values
from bushfit.errors import ModelError


@dataclass(frozen=True)
class Structure:
    """Effects of a model sorted by kind, and their parameters; equal for all models with the same effects.

    Args:
        records: all effects, from the rubber outward.
        parameters: definitions of all parameters by name in files and reports.
        branches: effects that add a stress, in parallel.
        viscoelastic: linear viscoelastic branches, whose steady responses add up harmonic by harmonic.
        others: all other branches.
        modifiers: effects that change parameter values of other effects.
        layers: effects around the rubber, such as the rig, from the rubber outward.
        moduli: names of the moduli and stresses; if all are scaled by a factor, so is the stiffness of the rubber.
    """

    records: tuple[Effect, ...]
    parameters: Mapping[str, Parameter]
    branches: tuple[Branch, ...]
    viscoelastic: tuple[Branch, ...]
    others: tuple[Branch, ...]
    modifiers: tuple[Modifier, ...]
    layers: tuple[Layer, ...]
    moduli: tuple[str, ...]

    @classmethod
    @lru_cache(maxsize=256)
    def from_names(cls, names: tuple[str, ...]) -> "Structure":
        """Create the structure of a model from the names of its effects, in any order; cached for fits.

        Returns:
            Effects by kind, from the rubber outward, and their parameters.
        """
        doubles = {name for name in names if names.count(name) > 1}
        if doubles:
            raise ModelError("an effect is listed twice", found=", ".join(sorted(doubles)))
        kinds = [name.partition(".")[0] for name in LIBRARY]

        def outward(effect: Effect) -> tuple[int, int, str]:
            kind = effect.name.partition(".")[0]
            return effect.level, kinds.index(kind) if kind in kinds else len(kinds), effect.name

        records = tuple(sorted(map(get_effect, names), key=outward))
        branches = tuple(effect for effect in records if isinstance(effect, Branch))
        return cls(
            records,
            MappingProxyType(
                {qualified_name(effect, parameter): parameter for effect in records for parameter in effect.parameters}
            ),
            branches,
            tuple(branch for branch in branches if branch.size),
            tuple(branch for branch in branches if not branch.size),
            tuple(effect for effect in records if isinstance(effect, Modifier)),
            tuple(effect for effect in records if isinstance(effect, Layer)),
            tuple(
                qualified_name(branch, parameter)
                for branch in branches
                for parameter in branch.parameters
                if parameter.unit.startswith("Pa")
            ),
        )


def values_for_effect(effect: Effect, values: Values) -> Values:
    """Parameter values for the functions of an effect: all by full name, those of the effect also by short name."""
    if effect.name in BASE:
        return values
    return {**values, **{parameter.name: values[qualified_name(effect, parameter)] for parameter in effect.parameters}}
