"""Kinds of values in a campaign file, and model parameters by name: texts such as "10 mm" become SI."""

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, TypeVar

import numpy as np
from pydantic import BeforeValidator, Field, WithJsonSchema

from bushfit.effects import is_parameter, parameter_named, parameter_names
from bushfit.errors import CampaignError, naming
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Place
from bushfit.units import quantity, sized, stepped, temperature
from bushfit.validation import LARGEST_NUMBER, converted, unknown_key

#: Mass [kg], acceleration [m/s^2] and frequency [Hz] of a resonance test at most, and their inverse at least; chosen:
#: far beyond every shaker, and numbers stay finite.
LARGEST_SHAKEN = 1e6
T = TypeVar("T")
#: A list that is not empty; its check ends at the first error, as those of a hundred thousand would fill the memory.
Several = Annotated[tuple[T, ...], Field(fail_fast=True), Field(min_length=1)]
#: The second to the power of alpha, at the end of the unit of m.
_S_TO_ALPHA = re.compile(r"[\s*·]*s\s*(\^|\*\*)\s*alpha\s*$")
#: A value of a parameter: a number here, a text or a number in the file.
Size = Annotated[
    float, WithJsonSchema({"type": ["string", "number"], "description": "with its unit; a ratio may be a number"})
]


def si(*units: str) -> BeforeValidator:
    """A validator that takes a text with any of these units, and gives SI."""
    return converted(lambda raw, _: quantity(raw, *units), text(f"a number with a unit of {' or '.join(units)}"))


def text(words: str) -> dict[str, Any]:
    """The JSON Schema of a text that is described in words."""
    return {"type": "string", "description": words}


def motion(per: str = "") -> BeforeValidator:
    """A validator as `si("m")`, but by the motion of the table's direction: [rad], or a strain; "/s" for a speed."""

    def unit(direction: object) -> str:
        return (direction.motion if isinstance(direction, Place) else TRANSLATION).displacement_unit + per

    units = " or ".join(f"{each.displacement_unit}{per}" for each in (TRANSLATION, ROTATION, STRAINING))
    written = text(f"a number with a unit of {units}, by what is tested")
    return converted(lambda raw, info: quantity(raw, unit(info.data.get("direction"))), written)


def table(convert: Callable[[dict[str, Any]], Any], written: Mapping[str, Any] | None = None) -> BeforeValidator:
    """A validator that converts a table, whose JSON Schema is `written`; what is none it leaves to pydantic."""
    return converted(lambda raw, _: convert(raw) if isinstance(raw, dict) else raw, written)


def _frequencies(raw: dict[str, Any]) -> list[str]:
    """A list of frequencies as texts from { start, stop, step }, with both ends."""
    expected = '{ start = "5 Hz", stop = "155 Hz", step = "10 Hz" }, or a list such as ["5 Hz", "15 Hz"]'
    if set(raw) != {"start", "stop", "step"}:
        raise CampaignError("this is no range of frequencies", found=str(raw), expected=expected)
    values = stepped(*(quantity(raw[key], "Hz") for key in ("start", "stop", "step")))
    if not values:
        raise CampaignError("this is no range of frequencies", found=str(raw), expected="0 < start <= stop, step > 0")
    return [f"{value!r} Hz" for value in values]


_HERTZ = text("a number with a unit of Hz")
#: How frequencies are written: a list, or a range with both ends.
_FREQUENCIES = {
    "anyOf": [
        {"type": "array", "items": _HERTZ, "minItems": 1},
        {
            "type": "object",
            "properties": dict.fromkeys(("start", "stop", "step"), _HERTZ),
            "required": ["start", "stop", "step"],
            "additionalProperties": False,
        },
    ]
}

Temperature = Annotated[float, converted(lambda raw, _: temperature(raw), text('a temperature, such as "23 degC"'))]
Length = Annotated[float, si("m"), Field(gt=0)]
Angle = Annotated[float, si("rad"), Field(gt=0)]
Strain = Annotated[float, si("1"), Field(gt=0)]
Frequency = Annotated[float, si("Hz"), Field(gt=0)]
Frequencies = Annotated[
    tuple[Frequency, ...], Field(fail_fast=True), table(_frequencies, _FREQUENCIES), Field(min_length=1)
]
Displacement = Annotated[float, motion(), Field(gt=0)]
SHAKEN = Field(ge=1.0 / LARGEST_SHAKEN, le=LARGEST_SHAKEN)
Share = Annotated[float, si("1"), Field(ge=0, lt=1)]
Count = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]  # of repeats or cycles: more than any rig runs


def parameter_value(place: str, name: str, raw: Any) -> float:
    """The SI value of a model parameter by its name in files; an error names the place.

    Ratios, and parameters of added effects, may be plain numbers.
    """
    with naming(place=place):
        if not is_parameter(name):
            raise unknown_key(name, parameter_names())
        stated = parameter_named(name).unit
        unit = _S_TO_ALPHA.sub("", stated)
        is_number = isinstance(raw, int | float) and not isinstance(raw, bool)
        if is_number and (unit == "1" or "." in name) and abs(raw) <= LARGEST_NUMBER:
            return sized(float(raw), unit)
        return quantity(_S_TO_ALPHA.sub("", raw) if unit != stated and isinstance(raw, str) else raw, unit)


def parameter_values(raw: dict[str, Any]) -> dict[str, float]:
    """Values by parameter, in SI."""
    return {name: parameter_value(name, name, value) for name, value in raw.items()}


def effect_values(raw: dict[str, Any]) -> dict[str, Any]:
    """Values by effect and parameter, in SI."""

    def values(effect: str, own: dict[str, Any]) -> dict[str, float]:
        return {key: parameter_value(f"{effect}.{key}", f"{effect}.{key}", value) for key, value in own.items()}

    return _each_table(raw, values)


def with_sizes(raw: dict[str, Any], keys: Sequence[str]) -> dict[str, Any]:
    """Tables by parameter with the values of some keys in SI; what is no table is left alone."""

    def sized_table(name: str, own: dict[str, Any]) -> dict[str, Any]:
        return own | {key: parameter_value(f"{name}.{key}", name, own[key]) for key in keys if key in own}

    return _each_table(raw, sized_table)


def _each_table(raw: dict[str, Any], convert: Callable[[str, dict[str, Any]], Any]) -> dict[str, Any]:
    """Tables by name, each converted; what is no table is left to pydantic."""
    return {name: convert(name, own) if isinstance(own, dict) else own for name, own in raw.items()}


def parameter_settings(raw: dict[str, Any]) -> dict[str, Any]:
    """Tables of value, min, max and vary by parameter, with the first three in SI.

    A min or a max beyond what the parameter can have is moved there: "0 MPa" as the least modulus is meant well.
    """
    keys = ("min", "value", "max")
    settings = with_sizes(raw, keys)
    for name, table in settings.items():
        if isinstance(table, dict):
            ordered = [table[key] for key in keys if key in table]
            parameter = parameter_named(name)
            low, high = parameter.bounds
            ends = np.clip([table.get("min", low), table.get("max", high)], low, high)
            if ordered != sorted(ordered) or ends[0] == ends[1]:
                expected = f"min below max within {low:g} to {high:g} {parameter.unit}, and value between them"
                raise CampaignError("these limits hold no value", place=name, found=str(raw[name]), expected=expected)
            table |= {key: float(end) for key, end in zip(("min", "max"), ends, strict=True) if key in table}
    return settings
