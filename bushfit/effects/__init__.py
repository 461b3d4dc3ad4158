"""Library of effects: records in library.toml, laws in one file each; and effects from other packages."""

import tomllib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any

from bushfit.caveat import Caveat
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

#: Directions of translation.
_LINES = (Direction.AXIAL, Direction.RADIAL)
#: Functions that select the places (directions and specimens) that a search considers from the tested places (axial
#: first), by keyword in library.toml.
_SOUGHT: dict[str, Callable[[Sequence[str]], Sequence[str]]] = {
    "others": lambda places: places[1:],
    "lines": lambda places: [place for place in places if place in _LINES],
    "compared lines": lambda places: [place for place in places if place in _LINES and len(places) > 1],
}
_TABLE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("library.toml").read_text(encoding="utf-8"))
#: Fields of an effect's record that the Python file of the effect may define.
_LAW = (
    *("modulus", "stress", "in_place_of"),  # of a branch
    *("adjust", "shift_factor", "stiffness", "force", "response_factor"),  # of a modifier, and of a layer
)
#: Kind of an effect, by the field that only this kind has.
_KINDS: dict[str, type[Effect]] = {"modulus": Branch, "adjust": Modifier, "stiffness": Layer, "response_factor": Layer}


def _full_entry(name: str) -> dict[str, Any]:
    """Return the table of an effect in library.toml, completed by the table of the effect named under its key "like".

    The key "law" names the Python file with the equations.
    """
    entry: dict[str, Any] = dict(_TABLE[name])
    if "like" not in entry:
        return {"law": name.partition(".")[0], **entry}
    return {**_full_entry(entry.pop("like")), "radial": {}, **entry}


def _build(name: str, entry: dict[str, Any], module: ModuleType) -> Effect | Family:
    """Build an effect, or a family of effects (one per direction or specimen).

    Args:
        name: name of the effect.
        entry: table with the keys of library.toml.
        module: module with the functions of the effect.
    """
    law = {part: getattr(module, part) for part in _LAW if hasattr(module, part)}
    kind = next(kind for part, kind in _KINDS.items() if part in law)
    parameters = [
        Parameter(key, **{"neutral": None, **table, "bounds": tuple(table["bounds"])})
        for key, table in entry.pop("parameters").items()
    ]
    if "assumption" in entry:
        entry["assumption"] = Caveat(**entry["assumption"])
    if "level" in entry:
        entry["level"] = Level[entry["level"].upper()]
    radial, places = entry.pop("radial", {}), _SOUGHT[entry.pop("sought", "others")]
    fields: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()}
    record = kind(name=name, parameters=tuple(parameters), **fields, **law)
    return Family(record, places, radial) if name.endswith(".{place}") else record


_ENTRIES = {name: _full_entry(name) for name in _TABLE}
_RECORDS = [_build(name, entry, import_module(f"{__name__}.{entry.pop('law')}")) for name, entry in _ENTRIES.items()]
#: Families of effects (one effect per direction or specimen), by name.
FAMILIES = {family.record.name.partition(".")[0]: family for family in _RECORDS if isinstance(family, Family)}
#: All effects by name, from the rubber outward; a family is represented by its effect for the radial direction.
LIBRARY = {
    effect.name: effect
    for effect in (entry.of_place(Direction.RADIAL) if isinstance(entry, Family) else entry for entry in _RECORDS)
}


@dataclass(frozen=True)
class Origin:
    """Origin of an effect from outside the package: an installed package, or a Python file.

    Args:
        package, version: name and version of the package; empty for a file.
        file: path of the Python file; empty for a package.
        sha256: SHA-256 of the file.
    """

    package: str = ""
    version: str = ""
    file: str = ""
    sha256: str = ""

    def __str__(self) -> str:
        return self.file or f"{self.package} {self.version}"


#: Origins of the effects from outside the package, by name of the effect.
ORIGINS: dict[str, Origin] = {}


def register(name: str, law: ModuleType, origin: Origin) -> None:
    """Add an effect from outside the package to the library.

    Args:
        name: name of the effect.
        law: module with the functions of the effect, and with its record as a dictionary EFFECT, which has the keys of
            library.toml.
        origin: origin of the module.

    Raises:
        ModelError: another effect has this name, or the record or a function is missing or invalid.
    """
    if not name.isidentifier() or (name in LIBRARY and name not in ORIGINS):
        expected = "a name of letters, digits and _, different from all names of the library"
        raise ModelError(f"the effect of {origin} cannot have this name", found=name, expected=expected)
    try:
        effect = _build(name, dict(law.EFFECT), law)
    except (AttributeError, LookupError, TypeError, ValueError, StopIteration) as error:
        raise ModelError(
            f"the effect {name} of {origin} cannot be used",
            found=f"{error} ({type(error).__name__})",
            expected="a dictionary EFFECT with keys as in library.toml, and the functions that its kind requires",
        ) from error
    assert isinstance(effect, Effect)  # the name has no place
    LIBRARY[name] = replace(effect, sentence=f"{effect.sentence} (Law of {origin}.)")
    ORIGINS[name] = origin
    library_parameters.cache_clear()


#: Names of the effects in the paper's model.
BASE = ("elastic", "springpot", "friction")


def with_base(names: Iterable[str]) -> tuple[str, ...]:
    """Add effects to the branches elastic, springpot and friction, leaving out the branches that they replace.

    Args:
        names: names of the effects to add.

    Returns:
        Names of the remaining branches, followed by the added names.

    >>> with_base(["sliders", "inertia"])
    ('elastic', 'springpot', 'sliders', 'inertia')
    """
    added = tuple(names)
    replaced = {get_effect(name).replaces for name in added}
    return (*(name for name in BASE if name not in replaced), *added)


def get_effect(name: str) -> Effect:
    """Return the effect with the given name.

    Raises:
        ModelError: the name is unknown; the message suggests the most similar name.

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
    """Direction or specimen in the name of an effect or parameter, the part after the dot; None if it names neither.

    >>> place_suffix("stiffness_factor.radial"), place_suffix("inertia.mass")
    ('radial', None)
    """
    family, _, place = name.partition(".")
    of_place = place and family in FAMILIES and (name in LIBRARY or name not in library_parameters())
    return place if of_place else None


def twins_of(name: str) -> tuple[str, ...]:
    """Names of the effects that no test can distinguish from the named effect (its twins), including its own name.

    The effect of the bushing comes first. Without twins the result is (name,).

    >>> twins_of("guide_friction")
    ('interface_slip', 'guide_friction')
    """
    place = place_suffix(name)
    effects = [*LIBRARY.values(), *(family.of_place(place) for family in FAMILIES.values() if place)]
    sets = ((effect.name, *effect.twins) for effect in effects if effect.twins)
    return next((names for names in sets if name in names), (name,))


def qualified_name(effect: Effect, parameter: Parameter) -> str:
    """Name of a parameter in files and reports: `<effect>.<name>`, or `<name>` for elastic, springpot and friction.

    If the effect is for one direction or specimen, as `stiffness_factor.radial`, its parameter has the effect's name.

    >>> names = ("elastic", "inertia", "stiffness_factor.radial")
    >>> [qualified_name(LIBRARY[name], LIBRARY[name].amount) for name in names]
    ['mu', 'inertia.mass', 'stiffness_factor.radial']
    """
    if effect.name in BASE:
        return parameter.name
    return effect.name if "." in effect.name else f"{effect.name}.{parameter.name}"


def effect_name_of(name: str) -> str:
    """Name of the effect that a parameter, given by its name in files and reports, belongs to.

    >>> effect_name_of("inertia.mass"), effect_name_of("alpha")
    ('inertia', 'springpot')
    """
    if place_suffix(name):
        return name
    effect, dot, _ = name.partition(".")
    return effect if dot else next(base for base in BASE for one in LIBRARY[base].parameters if one.name == name)


@cache
def library_parameters() -> dict[str, Parameter]:
    """All parameters by their names in files and reports, in the order of the library; cached."""
    return {
        qualified_name(effect, parameter): parameter for effect in LIBRARY.values() for parameter in effect.parameters
    }


def is_parameter(name: str) -> bool:
    """Return True if a parameter has this name in files and reports."""
    return name in library_parameters() or place_suffix(name) is not None


def get_parameter(name: str) -> Parameter:
    """Return the parameter with the given name in files and reports.

    >>> get_parameter("inertia.mass").meaning
    'moving mass'
    """
    return library_parameters()[name] if name in library_parameters() else get_effect(name).parameters[0]


def effects_for_places(places: Iterable[str]) -> dict[str, Effect]:
    """Effects that `diagnose` considers for tests of the given directions and specimens.

    Args:
        places: names of the tested directions and specimens. The axial direction, or else the first name, is the
            reference for the factors of the others.

    Returns:
        Effects by name. Of effects that no test can distinguish (twins), only the effect of the bushing is included.

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


for _point in entry_points(group="bushfit.effects"):
    _origin = Origin(*((_point.dist.name, _point.dist.version) if _point.dist else (_point.value,)))
    try:
        _law = _point.load()
    except Exception as error:  # of a package that bushfit does not know
        raise ModelError(
            f"the effect {_point.name} of {_origin} cannot be imported",
            found=f"{error} ({type(error).__name__})",
            hint=f"update or remove the package {_origin.package}",
        ) from error
    register(_point.name, _law, _origin)
