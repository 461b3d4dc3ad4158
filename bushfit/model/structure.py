"""Structure of a model: its effects by kind, their parameters, and the values that each effect reads."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby
from types import MappingProxyType

from bushfit.effects import BASE, LIBRARY, Branch, Effect, Layer, Modifier, Parameter, get_effect, qualified_name
from bushfit.effects.contract import Values
from bushfit.errors import ModelError


@dataclass(frozen=True)
class Structure:
    """The effects of a model by kind, and their parameters; the same for all models with these effects.

    Args:
        records: all of them, from the rubber outward.
        parameters: by their names in files and reports.
        viscoelastic: the linear branches that fade with memory, whose steady answers add up harmonic by harmonic.
        others: the branches that do not.
        moduli: names of the rubber's moduli and stresses, to which its stiffness is proportional together.
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
        """The structure of a model with these effects, in any order; kept, because a fit makes thousands of models.

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
                qualified_name(b, parameter)
                for b in branches
                for parameter in b.parameters
                if parameter.unit.startswith("Pa")
            ),
        )


def in_groups(layers: Sequence[Layer]) -> list[list[Layer]]:
    """Layers that act one after the other; neighbours of one law whose amounts add, in a group."""
    return [list(group) for _, group in groupby(layers, key=lambda layer: layer.force if layer.adds else layer.name)]


def as_one_layer(group: Sequence[Layer], values: Values) -> tuple[Layer, Values]:
    """A group of layers as the first of them, with the values that it reads."""
    first, layer_values = group[0], [seen_by(layer, values) for layer in group]
    return first, {
        **layer_values[0],
        **({first.adds: sum(values_of_layer[first.adds] for values_of_layer in layer_values)} if first.adds else {}),
    }


def seen_by(effect: Effect, values: Values) -> Values:
    """The values that an effect reads: all by their full names, and its own by short ones, too."""
    if effect.name in BASE:
        return values
    return {**values, **{parameter.name: values[qualified_name(effect, parameter)] for parameter in effect.parameters}}
