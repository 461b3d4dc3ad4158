"""What a model is built of: its effects by kind, and their parameters."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

from bushfit.effects import LIBRARY, Branch, Effect, Layer, Modifier, Parameter, effect_named, qualified
from bushfit.errors import ModelError


@dataclass(frozen=True)
class Structure:
    """The effects of a model by kind, and their parameters; the same for all models with these effects.

    Args:
        fading: the linear branches that fade with memory, whose steady answers add up harmonic by harmonic.
        others: the branches that do not.
        paced: the modifiers that shift the rubber's time scale.
        moduli: names of the rubber's moduli and stresses, to which its stiffness is proportional together.
    """

    records: tuple[Effect, ...]
    parameters: Mapping[str, Parameter]
    branches: tuple[Branch, ...]
    modifiers: tuple[Modifier, ...]
    layers: tuple[Layer, ...]
    fading: tuple[Branch, ...]
    others: tuple[Branch, ...]
    paced: tuple[Modifier, ...]
    moduli: tuple[str, ...]

    @classmethod
    @lru_cache(maxsize=256)
    def of(cls, names: tuple[str, ...]) -> "Structure":
        """The structure of a model with these effects, in any order; kept, because a fit makes thousands of models."""
        doubles = {name for name in names if names.count(name) > 1}
        if doubles:
            raise ModelError("an effect is listed twice", found=", ".join(sorted(doubles)))
        place = {name.partition(".")[0]: place for place, name in enumerate(LIBRARY)}
        known = map(effect_named, names)
        order = sorted(
            known, key=lambda effect: (effect.level, place.get(effect.name.partition(".")[0], len(place)), effect.name)
        )
        records = tuple(order)
        return cls(
            records,
            MappingProxyType(
                {qualified(effect, parameter): parameter for effect in records for parameter in effect.parameters}
            ),
            tuple(effect for effect in records if isinstance(effect, Branch)),
            tuple(effect for effect in records if isinstance(effect, Modifier)),
            tuple(effect for effect in records if isinstance(effect, Layer)),
            tuple(effect for effect in records if isinstance(effect, Branch) and effect.size),
            tuple(effect for effect in records if isinstance(effect, Branch) and not effect.size),
            tuple(effect for effect in records if isinstance(effect, Modifier) and effect.pace),
            tuple(
                qualified(effect, parameter)
                for effect in records
                for parameter in effect.parameters
                if isinstance(effect, Branch) and parameter.unit.startswith("Pa")
            ),
        )
