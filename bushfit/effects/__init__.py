"""Library of effects: records in library.toml, laws in one file each."""

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
#: Selection of the places of a search from the tested places (axial first), by keyword in library.toml.
_SOUGHT: dict[str, Callable[[Sequence[str]], Sequence[str]]] = {
    "others": lambda places: places[1:],
    "lines": lambda places: [place for place in places if place in _LINES],
}
_TABLE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("library.toml").read_text(encoding="utf-8"))
#: Fields of the record of an effect that its file may define.
_LAW = (
    *("modulus", "stress", "modulus_sensitivities", "stress_sensitivities", "in_place_of"),  # of a branch
    *("adjust", "shift_factor", "stiffness", "force"),  # of a modifier, and of a layer
)
#: Kind of an effect, by the field that only this kind has.
_KINDS: dict[str, type[Effect]] = {"modulus": Branch, "adjust": Modifier, "stiffness": Layer}


def _entry(name: str) -> dict[str, Any]:
    """Table of an effect in library.toml, completed by the effect that it is like; "law" is the file of its law."""
    entry: dict[str, Any] = dict(_TABLE[name])
    if "like" not in entry:
        return {"law": name.partition(".")[0], **entry}
    return {**_entry(entry.pop("like")), "radial": {}, **entry}


def _record(name: str) -> Effect | Family:
    """Effect of a table of library.toml, or family of effects of places."""
    entry = _entry(name)
    module = import_module(f"{__name__}.{entry.pop('law')}")
    law = {part: getattr(module, part) for part in _LAW if hasattr(module, part)}
    kind = next(kind for part, kind in _KINDS.items() if part in law)
    parameters = [
        Parameter(key, **{"neutral": None, **table, "bounds": tuple(table["bounds"])})
        for key, table in entry.pop("parameters").items()
    ]
    if "level" in entry:
        entry["level"] = Level[entry["level"].upper()]
    radial, places = entry.pop("radial", {}), _SOUGHT[entry.pop("sought", "others")]
    fields: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()}
    record = kind(name=name, parameters=tuple(parameters), **fields, **law)
    return Family(record, places, radial) if name.endswith(".{place}") else record


_RECORDS = [_record(name) for name in _TABLE]
#: Families of effects of places, by name.
FAMILIES = {each.name: each for each in _RECORDS if isinstance(each, Family)}
#: All effects by name, from the rubber outward; of a family, the effect of the radial direction.
LIBRARY = {
    effect.name: effect
    for effect in (each.of_place(Direction.RADIAL) if isinstance(each, Family) else each for each in _RECORDS)
}

#: The paper's model.
BASE = ("elastic", "springpot", "friction")


def with_base(names: Iterable[str]) -> tuple[str, ...]:
    """Names of the paper's branches that the effects do not replace, followed by the effects.

    >>> with_base(["sliders", "inertia"])
    ('elastic', 'springpot', 'sliders', 'inertia')
    """
    added = tuple(names)
    replaced = {get_effect(name).replaces for name in added}
    return (*(name for name in BASE if name not in replaced), *added)


def get_effect(name: str) -> Effect:
    """Effect of a name.

    Returns:
        Record of the effect.

    Raises:
        ModelError: an unknown name; the message suggests the most similar one.

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
    """Place in the name of an effect of a family, or of its parameter; None for other names.

    >>> place_suffix("stiffness_factor.radial"), place_suffix("inertia.mass")
    ('radial', None)
    """
    family, _, place = name.partition(".")
    of_place = name in LIBRARY or name not in _parameters()
    return place or None if family in FAMILIES and of_place else None


def twins_of(name: str) -> tuple[str, ...]:
    """Names of an effect and its twins, the effect of the bushing first; (name,) without twins.

    >>> twins_of("guide_friction")
    ('interface_slip', 'guide_friction')
    """
    place = place_suffix(name)
    effects = [*LIBRARY.values(), *(family.of_place(place) for family in FAMILIES.values() if place)]
    sets = ((effect.name, *effect.twins) for effect in effects if effect.twins)
    return next((names for names in sets if name in names), (name,))


def qualified_name(effect: Effect, parameter: Parameter) -> str:
    """Name of a parameter in files and reports: `<effect>.<name>`, or `<name>` for the paper's three effects.

    The one parameter of an effect of a place, such as `stiffness_factor.radial`, has the name of the effect.

    >>> names = ("elastic", "inertia", "stiffness_factor.radial")
    >>> [qualified_name(LIBRARY[name], LIBRARY[name].amount) for name in names]
    ['mu', 'inertia.mass', 'stiffness_factor.radial']
    """
    if effect.name in BASE:
        return parameter.name
    return effect.name if "." in effect.name else f"{effect.name}.{parameter.name}"


def effect_name_of(name: str) -> str:
    """Name of the effect that a parameter belongs to.

    >>> effect_name_of("inertia.mass"), effect_name_of("alpha")
    ('inertia', 'springpot')
    """
    if place_suffix(name):
        return name
    effect, dot, _ = name.partition(".")
    return effect if dot else next(base for base in BASE for one in LIBRARY[base].parameters if one.name == name)


@cache
def _parameters() -> dict[str, Parameter]:
    """All parameters of the library by their names in files and reports."""
    return {
        qualified_name(effect, parameter): parameter for effect in LIBRARY.values() for parameter in effect.parameters
    }


def parameter_names() -> tuple[str, ...]:
    """Names of all parameters in the order of the library."""
    return tuple(_parameters())


def is_parameter(name: str) -> bool:
    """Return True if the name is that of a parameter."""
    return name in _parameters() or place_suffix(name) is not None


def get_parameter(name: str) -> Parameter:
    """Parameter of a name in files and reports.

    >>> get_parameter("inertia.mass").meaning
    'moving mass'
    """
    return _parameters()[name] if name in _parameters() else get_effect(name).parameters[0]


def effects_for_places(places: Iterable[str]) -> dict[str, Effect]:
    """Effects that a search considers for tests in some directions and specimens.

    Args:
        places: names of directions and specimens; the moduli are those of the axial direction, or else of the first.

    Returns:
        Effects by name; of twins, the effect of the bushing alone.

    >>> [name for name in effects_for_places(["axial", "mount"]) if name.endswith("mount")]
    ['elastic_preload.mount', 'strain_scale.mount', 'stiffness_factor.mount', 'displacement_gain.mount']
    """
    tested = list(dict.fromkeys(sorted(places, key=lambda place: place != Direction.AXIAL)))
    in_families = [family.of_place(place) for family in FAMILIES.values() for place in sorted(family.places(tested))]
    of_places = {effect.name: effect for effect in in_families}
    sought = {
        name: effect for name, effect in LIBRARY.items() if not place_suffix(name) or name in of_places
    } | of_places
    return {name: effect for name, effect in sought.items() if name == twins_of(name)[0]}
