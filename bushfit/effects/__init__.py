"""The library of effects: one physics a file, one line here."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from functools import cache
from importlib import import_module

from bushfit.effects import unnamed
from bushfit.effects.contract import Branch as Branch
from bushfit.effects.contract import Effect as Effect
from bushfit.effects.contract import Family as Family
from bushfit.effects.contract import Layer as Layer
from bushfit.effects.contract import Level as Level
from bushfit.effects.contract import Modifier as Modifier
from bushfit.effects.contract import Parameter as Parameter
from bushfit.effects.contract import Setting as Setting
from bushfit.effects.history import History as History
from bushfit.errors import ModelError
from bushfit.geometry import Direction

#: Files of all effects, the paper's three branches first. Within a level this is the order from the rubber outward.
_FILES = (
    "elastic",
    "springpot",
    "friction",
    "viscous",
    "hysteretic_loss",
    "second_springpot",
    "maxwell",
    "second_maxwell",
    "strain_stiffening",
    "fifth_power_stiffening",
    "asymmetry",
    "second_friction",
    "mullins_softening",
    "rate_dependent_friction",
    "coupled_breakdown",
    "intrinsic_time",
    "fractional_zener",
    "kraus",
    "sliders",
    "self_heating",
    "temperature",
    "mullins_levels",
    "filler_recovery",
    "elastic_preload",
    "strain_scale",
    "clearance",
    "interface_slip",
    "bump_stop",
    "one_sided_stop",
    "stiffness_factor",
    "preload_stiffening",
    "sleeve_compliance",
    "sleeve_compliance_of_direction",
    "transducer_gain",
    "rig_compliance",
    "rig_compliance_of_direction",
    "fixture_play",
    "guide_friction",
    "inertia",
    "fixture_resonance",
    "high_pass",
    "force_saturation",
    "displacement_gain",
    "delay",
    "amplitude_rolloff",
    "loop_clock",
    "force_gain",
    "drift",
    "force_offset",
)

_MODULES = [import_module(f"{__name__}.{file}") for file in _FILES]
#: Every kind of effect that belongs to a place, by name: where a file has one, it is called FAMILY there.
FAMILIES: dict[str, Family] = {each.FAMILY.record.name: each.FAMILY for each in _MODULES if hasattr(each, "FAMILY")}
_EFFECTS: list[Effect] = [
    each.FAMILY.of_place(Direction.RADIAL) if hasattr(each, "FAMILY") else each.EFFECT for each in _MODULES
]
#: Every effect by name, in that order; of a kind that belongs to a place, that of the radial direction.
LIBRARY: dict[str, Effect] = {effect.name: effect for effect in _EFFECTS}

#: The paper's model.
BASE = ("elastic", "springpot", "friction")


def with_base(names: Iterable[str]) -> tuple[str, ...]:
    """The paper's branches, less those that these effects replace, and these."""
    own = tuple(names)
    replaced = {effect_named(name).replaces for name in own}
    return (*(name for name in BASE if name not in replaced), *own)


def effect_named(name: str) -> Effect:
    """The effect of that name.

    Raises:
        ModelError: there is none; the nearest name is suggested.
    """
    if name in LIBRARY:
        return LIBRARY[name]
    if name == unnamed.NAME:
        return unnamed.EFFECT
    if place := place_of(name):
        return FAMILIES[name.partition(".")[0]].of_place(place)
    near = difflib.get_close_matches(name, LIBRARY, n=1)
    raise ModelError(
        "unknown effect",
        found=name,
        expected="one of " + ", ".join(LIBRARY),
        hint=f"did you mean {near[0]}?" if near else None,
    )


def place_of(name: str) -> str | None:
    """The place in the name of an effect that belongs to one, and of its parameter: `stiffness_factor.radial`."""
    family, _, place = name.partition(".")
    own = name in LIBRARY or name not in _parameters()
    return place or None if family in FAMILIES and own else None


def twins_of(name: str) -> tuple[str, ...]:
    """The names of an effect and of all that no test tells from it, the bushing's first; (name,) without twins."""
    place = place_of(name)
    known = [*LIBRARY.values(), *(family.of_place(place) for family in FAMILIES.values() if place)]
    sets = ((effect.name, *effect.twins) for effect in known if effect.twins)
    return next((names for names in sets if name in names), (name,))


def qualified(effect: Effect, parameter: Parameter) -> str:
    """Name of a parameter in files and reports: plain for the paper's three, `<effect>.<name>` for the rest.

    An effect that belongs to a place, such as `stiffness_factor.radial`, is named like its one parameter.
    """
    if effect.name in BASE:
        return parameter.name
    return effect.name if "." in effect.name else f"{effect.name}.{parameter.name}"


def effect_of(name: str) -> str:
    """The name of the effect that a parameter belongs to, by the name of the parameter in files and reports."""
    if place_of(name):
        return name
    effect, dot, _ = name.partition(".")
    return effect if dot else next(base for base in BASE for own in LIBRARY[base].parameters if own.name == name)


@cache
def _parameters() -> dict[str, Parameter]:
    """Every parameter of the library by its name in files and reports."""
    return {qualified(effect, parameter): parameter for effect in LIBRARY.values() for parameter in effect.parameters}


def parameter_names() -> tuple[str, ...]:
    """Names of all parameters of the library, in its order."""
    return tuple(_parameters())


def is_parameter(name: str) -> bool:
    """Whether a name in files and reports is that of a parameter."""
    return name in _parameters() or place_of(name) is not None


def parameter_named(name: str) -> Parameter:
    """A parameter by its name in files and reports; `is_parameter` tells whether there is one."""
    return _parameters()[name] if name in _parameters() else effect_named(name).parameters[0]


def at_places(places: Iterable[str]) -> dict[str, Effect]:
    """The library for tests at these places: of each kind that belongs to a place, those that are to be sought there.

    Of twins that of the bushing is there alone.

    Args:
        places: directions, or specimens by name; one that is axial counts as the first, which the moduli go by.
    """
    known = list(dict.fromkeys(sorted(places, key=lambda place: place != Direction.AXIAL)))
    found = [family.of_place(place) for family in FAMILIES.values() for place in sorted(family.places(known))]
    of_places = {effect.name: effect for effect in found}
    sought = {name: effect for name, effect in LIBRARY.items() if not place_of(name) or name in of_places} | of_places
    return {name: effect for name, effect in sought.items() if name == twins_of(name)[0]}
