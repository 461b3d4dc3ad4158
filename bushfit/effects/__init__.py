"""The library of effects: one physics a file, one line here."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from functools import cache
from importlib import import_module

from bushfit.effects import stiffness_factor
from bushfit.effects.contract import Branch as Branch
from bushfit.effects.contract import Effect as Effect
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
    "maxwell",
    "strain_stiffening",
    "asymmetry",
    "second_friction",
    "mullins_softening",
    "rate_dependent_friction",
    "coupled_breakdown",
    "self_heating",
    "clearance",
    "interface_slip",
    "bump_stop",
    "stiffness_factor",
    "rig_compliance",
    "inertia",
    "fixture_resonance",
    "delay",
    "amplitude_rolloff",
    "force_gain",
    "force_offset",
)

_EFFECTS: list[Effect] = [import_module(f"{__name__}.{file}").EFFECT for file in _FILES]
#: Every effect by name, in that order.
LIBRARY: dict[str, Effect] = {effect.name: effect for effect in _EFFECTS}

#: The paper's model.
BASE = ("elastic", "springpot", "friction")


def effect_named(name: str) -> Effect:
    """The effect of that name.

    Raises:
        ModelError: there is none; the nearest name is suggested.
    """
    if name in LIBRARY:
        return LIBRARY[name]
    family, _, place = name.partition(".")
    if family == stiffness_factor.FAMILY and place:
        return stiffness_factor.stiffness_factor(place)
    near = difflib.get_close_matches(name, LIBRARY, n=1)
    raise ModelError(
        "unknown effect",
        found=name,
        expected="one of " + ", ".join(LIBRARY),
        hint=f"did you mean {near[0]}?" if near else None,
    )


def qualified(effect: Effect, parameter: Parameter) -> str:
    """Name of a parameter in files and reports: plain for the paper's three, `<effect>.<name>` for the rest.

    An effect that belongs to a place, such as `stiffness_factor.radial`, is named like its one parameter.
    """
    if effect.name in BASE:
        return parameter.name
    return effect.name if "." in effect.name else f"{effect.name}.{parameter.name}"


def effect_of(name: str) -> str:
    """The name of the effect that a parameter belongs to, by the name of the parameter in files and reports."""
    if name.startswith(f"{stiffness_factor.FAMILY}."):
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
    family, _, place = name.partition(".")
    return name in _parameters() or (family == stiffness_factor.FAMILY and bool(place))


def parameter_named(name: str) -> Parameter:
    """A parameter by its name in files and reports; `is_parameter` tells whether there is one."""
    return _parameters()[name] if name in _parameters() else effect_named(name).parameters[0]


def at_places(places: Iterable[str]) -> dict[str, Effect]:
    """The library for tests at these places: a stiffness factor for each but the first, which the moduli go by.

    Args:
        places: directions, or specimens by name; one that is axial counts as the first.
    """
    known = dict.fromkeys(sorted(places, key=lambda place: place != Direction.AXIAL))
    factors = {f"{stiffness_factor.FAMILY}.{place}" for place in list(known)[1:]}
    others = {name: effect_named(name) for name in sorted(factors)}
    kept = {name: effect for name, effect in LIBRARY.items() if name != stiffness_factor.EFFECT.name or name in factors}
    return kept | others
