"""Checks a parsed TOML or JSON file against dataclasses with pydantic, whose errors become the project's own.

It knows no campaign and no model, but the kinds of values in their files: texts such as "10 mm" become SI. A table of
the file is a frozen dataclass. Where the keys of a field stand in the table itself and not under the field's own name,
the field says so with `field(metadata=standing_in_table(keys))`.
"""

import re
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, TypeVar, cast, get_args, get_type_hints

from pydantic import BeforeValidator, Field, TypeAdapter, ValidationError, ValidationInfo, WithJsonSchema
from pydantic_core import ErrorDetails

from bushfit.errors import BushfitError, CampaignError, did_you_mean
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Place
from bushfit.units import parse_quantity, parse_temperature, regular_steps

T = TypeVar("T")

#: Known keys that an error lists at most: one line of them.
_MOST_LISTED = 12
#: pydantic's name for an error about a key that the table does not have.
_UNKNOWN = "unexpected_keyword_argument"
#: pydantic's names for what has the wrong shape, in the words of TOML.
_SHAPES = {
    "dataclass_type": "a table",
    "dict_type": "a table",
    "mapping_type": "a table",
    "tuple_type": "a list",
    "too_short": "at least one value",
    "string_type": "a text in quotes",
    "path_type": "a text in quotes",
    "string_too_short": "a text that is not empty",
    "string_pattern_mismatch": "one line without control characters",
    "string_unicode": "text in Unicode",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
}
#: A number that pydantic writes with all its zeros.
_ZEROS = re.compile(r"\d{16,}")
#: Values of Python's as TOML and JSON write them.
_WORDS = {"None": "null", "True": "true", "False": "false"}
#: Key in the metadata of a field, for a function that gives the keys which stand in the table itself.
_IN_TABLE = "keys in the table itself"

#: Largest number, with either sign; chosen: its square is a number still, and nothing in SI comes near it.
LARGEST_NUMBER = 1e100
#: Largest whole number, with either sign: beyond, floats leave out some.
_LARGEST_COUNT = 2**53
#: A finite number; neither a text nor true is one.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
#: A whole number; neither a text, nor true, nor 3.0 is one.
WholeNumber = Annotated[int, Field(strict=True, ge=-_LARGEST_COUNT, le=_LARGEST_COUNT)]
#: True or false; neither a text nor a number is one.
Flag = Annotated[bool, Field(strict=True)]
#: A text that is not empty.
Text = Annotated[str, Field(min_length=1)]
#: What tables, plots, folders and the terminal are headed with: one line without control characters.
Name = Annotated[str, Field(strict=True, min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]*$")]


def unknown_key(key: str, known: Collection[str]) -> CampaignError:
    """The error for a key that is none of the known ones."""
    hint = did_you_mean(key, known, likeness=0.5)
    hint = f"{hint} It is half of a diameter" if hint and "diameter" in key and "radius" in hint else hint
    expected = "one of " + ", ".join([*known][:_MOST_LISTED]) + (", ..." if len(known) > _MOST_LISTED else "")
    return CampaignError("unknown key", found=f'"{key}"', expected=expected, hint=hint)


def converter(
    convert: Callable[[Any, ValidationInfo], Any], written: Mapping[str, Any] | None = None
) -> BeforeValidator:
    """A pydantic validator that calls convert(raw value, info); what it raises keeps its words.

    `written` is the JSON Schema of what stands in the file; without it, it is that of the converted value.
    """

    def run(raw: Any, info: ValidationInfo) -> Any:
        try:
            return convert(raw, info)
        except BushfitError as error:
            raise ValueError(error) from error

    if written is None:
        return BeforeValidator(run)
    return BeforeValidator(run, json_schema_input_type=Annotated[Any, WithJsonSchema(dict(written))])


def inline_keys(keys: Callable[[], Iterable[str]]) -> Mapping[str, Any]:
    """Metadata of a field whose keys, those that the function gives, stand in the table itself."""
    return {_IN_TABLE: keys}


@cache
def _adapter(schema: Any) -> TypeAdapter[Any]:
    """pydantic's validator of a schema, built once, because that takes longer than most checks."""
    return TypeAdapter(schema)


def validate_tables(
    tables: Mapping[str, Any],
    file: Path | None,
    schema: type[T],
    place: str | None = None,
    *,
    kind: type[BushfitError] = CampaignError,
) -> T:
    """A parsed TOML or JSON file as the dataclass `schema`, which pydantic can check; all quantities in SI.

    Errors name the file and the place in it, None for a whole file.

    Raises:
        kind: keys or values that are not understood.
        UnitError: a quantity without a unit, or with one that does not fit.
    """
    try:
        return cast(T, _adapter(cast(Hashable, schema)).validate_python(tables))
    except ValidationError as error:
        # a mistyped key is missing and unknown: the latter says more
        details = sorted(error.errors(include_url=False), key=lambda detail: detail["type"] != _UNKNOWN)
        complaint = _complaint(details[0], schema, kind)
    complaint.file = file
    complaint.place = ", ".join(filter(None, (place, complaint.place)))
    raise complaint  # outside of `except`: pydantic's error holds ours, and a ring of errors cannot be pickled


def to_json_data(value: Any, schema: Any) -> Any:
    """A value of the type `schema`, which pydantic can check, as JSON-ready data."""
    return _adapter(schema).dump_python(value, mode="json")


def _complaint(detail: ErrorDetails, schema: type, kind: type[BushfitError]) -> BushfitError:
    """One of pydantic's errors in the project's words, with its place in the file."""
    location = detail["loc"]
    place = _place(schema, location)
    cause = detail.get("ctx", {}).get("error")
    if isinstance(cause, ValueError) and isinstance(cause.args[0], BushfitError):
        error = cause.args[0]
        place = ".".join(part for part in (place, error.place) if part)
    elif detail["type"] == _UNKNOWN:
        error = unknown_key(str(location[-1]), known_keys(_table_at(schema, location[:-1])))
    elif detail["type"] == "missing":
        key = location[-1]
        error = kind("a key is missing", expected=f"{key} = ..." if isinstance(key, str) else "a further value")
    else:
        found = _WORDS.get(str(detail["input"]), str(detail["input"]))
        said = re.sub("^(Input|String) should (be|have) ", "", detail["msg"])
        expected = _SHAPES.get(detail["type"], _ZEROS.sub(lambda digits: f"{float(digits[0]):g}", said))
        single = detail["type"] == "tuple_type" and isinstance(detail["input"], dict)
        hint = f"write [[{place}]], in two brackets: there may be several" if single else None
        error = kind("this value is not understood", found=found, expected=expected, hint=hint)
    error.place = place
    return error


def _place(table: type, location: tuple[int | str, ...]) -> str:
    """A place as the file has it, such as "simulate.loops #2.frequency"; tables of an array are counted from 1."""
    words: list[str] = []
    for key in location:
        if isinstance(key, int):
            words[-1] += f" #{key + 1}"
        elif key not in inline_fields(table):
            words.append(key)
        table = _table_at(table, (key,))
    return ".".join(words)


def known_keys(table: type) -> Sequence[str]:
    """The keys that a table of the file may have."""
    inside = inline_fields(table)
    return [key for entry in fields(table) for key in (inside[entry.name]() if entry.name in inside else [entry.name])]


def inline_fields(table: type) -> Mapping[str, Callable[[], Iterable[str]]]:
    """The fields whose keys stand in the table itself, each with the function that gives these keys."""
    known = fields(table) if is_dataclass(table) else ()
    return {entry.name: entry.metadata[_IN_TABLE] for entry in known if _IN_TABLE in entry.metadata}


def _table_at(table: type, location: tuple[int | str, ...]) -> type:
    """The dataclass of the table at a place below another; the one nearest above where the place is no table."""
    for key in location:
        if key in (hints := get_type_hints(table)):
            inside = (part for part in _parts(hints[key]) if isinstance(part, type) and is_dataclass(part))
            table = next(inside, table)
    return table


def _parts(hint: Any) -> Iterable[Any]:
    """A type and all that it is made of."""
    yield hint
    for part in get_args(hint):
        yield from _parts(part)


#: Mass [kg], acceleration [m/s^2] and frequency [Hz] of a resonance test at most, and their inverse at least; chosen:
#: far beyond every shaker, and numbers stay finite.
LARGEST_SHAKEN = 1e6
#: A list that is not empty; its check ends at the first error, as those of a hundred thousand would fill the memory.
Several = Annotated[tuple[T, ...], Field(fail_fast=True), Field(min_length=1)]
#: A value of a parameter: a number here, a text or a number in the file.
ParameterValue = Annotated[
    float, WithJsonSchema({"type": ["string", "number"], "description": "with its unit; a ratio may be a number"})
]


def si(*units: str) -> BeforeValidator:
    """A validator that takes a text with any of these units, and gives SI."""
    return converter(lambda raw, _: parse_quantity(raw, *units), text(f"a number with a unit of {' or '.join(units)}"))


def text(words: str) -> dict[str, Any]:
    """The JSON Schema of a text that is described in words."""
    return {"type": "string", "description": words}


def motion(per: str = "") -> BeforeValidator:
    """A validator as `si("m")`, but by the motion of the table's direction: [rad], or a strain; "/s" for a speed."""

    def unit(direction: object) -> str:
        return (direction.motion if isinstance(direction, Place) else TRANSLATION).displacement_unit + per

    units = " or ".join(f"{each.displacement_unit}{per}" for each in (TRANSLATION, ROTATION, STRAINING))
    written = text(f"a number with a unit of {units}, by what is tested")
    return converter(lambda raw, info: parse_quantity(raw, unit(info.data.get("direction"))), written)


def table(convert: Callable[[dict[str, Any]], Any], written: Mapping[str, Any] | None = None) -> BeforeValidator:
    """A validator that converts a table, whose JSON Schema is `written`; what is none it leaves to pydantic."""
    return converter(lambda raw, _: convert(raw) if isinstance(raw, dict) else raw, written)


def _frequencies(raw: dict[str, Any]) -> list[str]:
    """A list of frequencies as texts from { start, stop, step }, with both ends."""
    expected = '{ start = "5 Hz", stop = "155 Hz", step = "10 Hz" }, or a list such as ["5 Hz", "15 Hz"]'
    if set(raw) != {"start", "stop", "step"}:
        raise CampaignError("this is no range of frequencies", found=str(raw), expected=expected)
    values = regular_steps(*(parse_quantity(raw[key], "Hz") for key in ("start", "stop", "step")))
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

Temperature = Annotated[
    float, converter(lambda raw, _: parse_temperature(raw), text('a temperature, such as "23 degC"'))
]
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
