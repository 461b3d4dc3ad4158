"""The library of effects: what is said of them in library.toml, their laws one physics a file."""

import tomllib
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

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
from bushfit.errors import ModelError, did_you_mean
from bushfit.geometry import Direction

#: Directions along lines.
_LINES = (Direction.AXIAL, Direction.RADIAL)
#: Of the places tested, axial first, those that a search gives an effect of a place, by the word in library.toml.
_SOUGHT: dict[str, Callable[[Sequence[str]], Sequence[str]]] = {
    "others": lambda places: places[1:],
    "lines": lambda places: [place for place in places if place in _LINES],
}
_TABLE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("library.toml").read_text(encoding="utf-8"))
#: What a file may have of the law of an effect: fields of its record.
_LAW = (
    *("modulus", "stress", "modulus_sensitivities", "stress_sensitivities", "in_place_of"),  # of a branch
    *("adjust", "shift_factor", "stiffness", "force"),  # of a modifier, and of a layer
)
#: The kind of an effect, by a part of the law that no other kind has.
_KINDS: dict[str, type[Effect]] = {"modulus": Branch, "adjust": Modifier, "stiffness": Layer}


def _entry(name: str) -> dict[str, Any]:
    """What library.toml says of an effect, itself or by the effect that it is like; "law" is the file of its law."""
    entry: dict[str, Any] = dict(_TABLE[name])
    if "like" not in entry:
        return {"law": name.partition(".")[0], **entry}
    return {**_entry(entry.pop("like")), "radial": {}, **entry}


def _record(name: str) -> Effect | Family:
    """The effect of a table of library.toml, or the family where each place may have one."""
    entry = _entry(name)
    module = import_module(f"{__name__}.{entry.pop('law')}")
    law = {part: getattr(module, part) for part in _LAW if hasattr(module, part)}
    kind = next(kind for part, kind in _KINDS.items() if part in law)
    parameters = [
        Parameter(own, **{"neutral": None, **each, "bounds": tuple(each["bounds"])})
        for own, each in entry.pop("parameters").items()
    ]
    if "level" in entry:
        entry["level"] = Level[entry["level"].upper()]
    radial, places = entry.pop("radial", {}), _SOUGHT[entry.pop("sought", "others")]
    said: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()}
    record = kind(name=name, parameters=tuple(parameters), **said, **law)
    return Family(record, places, radial) if name.endswith(".{place}") else record


_RECORDS = [_record(name) for name in _TABLE]
#: Every kind of effect that belongs to a place, by name.
FAMILIES = {each.name: each for each in _RECORDS if isinstance(each, Family)}
#: Every effect by name, from the rubber outward; of a kind that belongs to a place, that of the radial direction.
LIBRARY = {
    effect.name: effect
    for effect in (each.of_place(Direction.RADIAL) if isinstance(each, Family) else each for each in _RECORDS)
}

#: The paper's model.
BASE = ("elastic", "springpot", "friction")


def with_base(names: Iterable[str]) -> tuple[str, ...]:
    """The paper's branches, less those that these effects replace, and these.

    >>> with_base(["sliders", "inertia"])
    ('elastic', 'springpot', 'sliders', 'inertia')
    """
    own = tuple(names)
    replaced = {get_effect(name).replaces for name in own}
    return (*(name for name in BASE if name not in replaced), *own)


def get_effect(name: str) -> Effect:
    """The effect of that name.

    Raises:
        ModelError: there is none; the nearest name is suggested.

    >>> get_effect("inertia").phrase
    'moving mass between bushing and load cell'
    """
    if name in LIBRARY:
        return LIBRARY[name]
    if name == unnamed.NAME:
        return unnamed.EFFECT
    if place := place_suffix(name):
        return FAMILIES[name.partition(".")[0]].of_place(place)
    near = did_you_mean(name, LIBRARY, similarity=0.5)
    raise ModelError("unknown effect", found=name, expected="one of " + ", ".join(LIBRARY), hint=near)


def place_suffix(name: str) -> str | None:
    """The place in the name of an effect that belongs to one, and of its parameter: `stiffness_factor.radial`.

    >>> place_suffix("stiffness_factor.radial"), place_suffix("inertia.mass")
    ('radial', None)
    """
    family, _, place = name.partition(".")
    own = name in LIBRARY or name not in _parameters()
    return place or None if family in FAMILIES and own else None


def twins_of(name: str) -> tuple[str, ...]:
    """The names of an effect and of all that no test tells from it, the bushing's first; (name,) without twins.

    >>> twins_of("guide_friction")
    ('interface_slip', 'guide_friction')
    """
    place = place_suffix(name)
    known = [*LIBRARY.values(), *(family.of_place(place) for family in FAMILIES.values() if place)]
    sets = ((effect.name, *effect.twins) for effect in known if effect.twins)
    return next((names for names in sets if name in names), (name,))


def qualified_name(effect: Effect, parameter: Parameter) -> str:
    """Name of a parameter in files and reports: plain for the paper's three, `<effect>.<name>` for the rest.

    An effect that belongs to a place, such as `stiffness_factor.radial`, is named like its one parameter.

    >>> names = ("elastic", "inertia", "stiffness_factor.radial")
    >>> [qualified_name(LIBRARY[name], LIBRARY[name].amount) for name in names]
    ['mu', 'inertia.mass', 'stiffness_factor.radial']
    """
    if effect.name in BASE:
        return parameter.name
    return effect.name if "." in effect.name else f"{effect.name}.{parameter.name}"


def effect_name_of(name: str) -> str:
    """The name of the effect that a parameter belongs to, by the name of the parameter in files and reports.

    >>> effect_name_of("inertia.mass"), effect_name_of("alpha")
    ('inertia', 'springpot')
    """
    if place_suffix(name):
        return name
    effect, dot, _ = name.partition(".")
    return effect if dot else next(base for base in BASE for own in LIBRARY[base].parameters if own.name == name)


@cache
def _parameters() -> dict[str, Parameter]:
    """Every parameter of the library by its name in files and reports."""
    return {
        qualified_name(effect, parameter): parameter for effect in LIBRARY.values() for parameter in effect.parameters
    }


def parameter_names() -> tuple[str, ...]:
    """Names of all parameters of the library, in its order."""
    return tuple(_parameters())


def is_parameter(name: str) -> bool:
    """Whether a name in files and reports is that of a parameter."""
    return name in _parameters() or place_suffix(name) is not None


def get_parameter(name: str) -> Parameter:
    """A parameter by its name in files and reports; `is_parameter` tells whether there is one.

    >>> get_parameter("inertia.mass").meaning
    'moving mass'
    """
    return _parameters()[name] if name in _parameters() else get_effect(name).parameters[0]


def effects_for_places(places: Iterable[str]) -> dict[str, Effect]:
    """The library for tests at these places: of each kind that belongs to a place, those that are to be sought there.

    Of twins that of the bushing is there alone.

    Args:
        places: directions, or specimens by name; one that is axial counts as the first, which the moduli go by.

    >>> [name for name in effects_for_places(["axial", "mount"]) if name.endswith("mount")]
    ['elastic_preload.mount', 'strain_scale.mount', 'stiffness_factor.mount', 'displacement_gain.mount']
    """
    known = list(dict.fromkeys(sorted(places, key=lambda place: place != Direction.AXIAL)))
    found = [family.of_place(place) for family in FAMILIES.values() for place in sorted(family.places(known))]
    of_places = {effect.name: effect for effect in found}
    sought = {
        name: effect for name, effect in LIBRARY.items() if not place_suffix(name) or name in of_places
    } | of_places
    return {name: effect for name, effect in sought.items() if name == twins_of(name)[0]}
