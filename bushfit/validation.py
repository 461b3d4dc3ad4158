"""Validation of parsed TOML and JSON files against frozen dataclasses, with pydantic and the project's error messages.

Texts such as "10 mm" become SI values. `field(metadata=inline_keys(keys))` marks a field whose keys are in the table
itself instead of under the name of the field.
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
from bushfit.units import parse_quantity, parse_temperature, regular_steps

T = TypeVar("T")

#: Maximum number of known keys in a message.
_MAXIMUM_LISTED = 12
#: Error type of pydantic for an unknown key.
_UNKNOWN = "unexpected_keyword_argument"
#: Expected kind of value in the words of TOML, by error type of pydantic.
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
#: A number with many digits in a message of pydantic.
_ZEROS = re.compile(r"\d{16,}")
#: Python constants as TOML and JSON write them.
_WORDS = {"None": "null", "True": "true", "False": "false"}
#: Key in the metadata of a field for the function that returns its inline keys.
_INLINE = "inline keys"

#: Largest magnitude of a number; its square is finite.
LARGEST_NUMBER = 1e100
#: Largest magnitude of a whole number that a float represents exactly.
_LARGEST_COUNT = 2**53
#: A finite number; texts and booleans are refused.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST_NUMBER, le=LARGEST_NUMBER)]
#: A whole number; texts, booleans and 3.0 are refused.
WholeNumber = Annotated[int, Field(strict=True, ge=-_LARGEST_COUNT, le=_LARGEST_COUNT)]
#: True or false; texts and numbers are refused.
Flag = Annotated[bool, Field(strict=True)]
#: A text that is not empty.
Text = Annotated[str, Field(min_length=1)]
#: A title of tables, plots and folders: one line without control characters.
Name = Annotated[str, Field(strict=True, min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]*$")]


def unknown_key(key: str, known_names: Collection[str], otherwise: str | None = None) -> CampaignError:
    """Make the error for an unknown key, with the known keys and the most similar one.

    Args:
        key: unknown key.
        known_names: known keys.
        otherwise: hint if no known key is similar.
    """
    hint = did_you_mean(key, known_names, similarity=0.5) or otherwise
    hint = f"{hint} It is half of a diameter" if hint and "diameter" in key and "radius" in hint else hint
    listed = [*known_names][:_MAXIMUM_LISTED]
    expected = "one of " + ", ".join(listed) + (", ..." if len(known_names) > _MAXIMUM_LISTED else "")
    return CampaignError("unknown key", found=f'"{key}"', expected=expected, hint=hint)


def converter(
    convert: Callable[[Any, ValidationInfo], Any], written: Mapping[str, Any] | None = None
) -> BeforeValidator:
    """Validator of pydantic that converts a raw value and keeps the message of a BushfitError.

    Args:
        convert: function that takes the raw value and pydantic's validation info, and returns the converted value.
        written: JSON Schema of the raw value in the file; None for the schema of the converted value.

    Returns:
        Validator for an Annotated type.
    """

    def run(raw: Any, info: ValidationInfo) -> Any:
        """Convert a raw value; a BushfitError becomes a ValueError, which pydantic reports."""
        try:
            return convert(raw, info)
        except BushfitError as error:
            raise ValueError(error) from error

    if written is None:
        return BeforeValidator(run)
    return BeforeValidator(run, json_schema_input_type=Annotated[Any, WithJsonSchema(dict(written))])


def inline_keys(keys: Callable[[], Iterable[str]]) -> Mapping[str, Any]:
    """Metadata of a dataclass field whose keys are written in the surrounding table, not in a table of their own.

    Args:
        keys: function that returns the keys.
    """
    return {_INLINE: keys}


@cache
def _adapter(schema: Any) -> TypeAdapter[Any]:
    """Cached validator of a schema; building it takes longer than most validations."""
    return TypeAdapter(schema)


def validate_tables(
    tables: Mapping[str, Any],
    file: Path | None,
    schema: type[T],
    place: str | None = None,
    *,
    kind: type[BushfitError] = CampaignError,
) -> T:
    """Convert a parsed TOML or JSON file to a dataclass, with all quantities in SI.

    Args:
        tables: parsed file, or a part of it.
        file: path of the file, for error messages.
        schema: dataclass with annotations of pydantic.
        place: location of the part in the file, for error messages.
        kind: class of the error for keys or values that are not valid.

    Returns:
        An instance of the schema.

    Raises:
        kind: invalid keys or values.
        UnitError: a quantity without a unit or with an incompatible unit.
    """
    try:
        return cast(T, _adapter(cast(Hashable, schema)).validate_python(tables))
    except ValidationError as error:
        # a mistyped key is both missing and unknown: report it as unknown
        details = sorted(error.errors(include_url=False), key=lambda detail: detail["type"] != _UNKNOWN)
        complaint = _complaint(details[0], schema, kind)
    complaint.file = file
    complaint.place = ", ".join(filter(None, (place, complaint.place)))
    raise complaint  # outside of `except`, because errors that refer to each other cannot be pickled


def to_json_data(value: Any, schema: Any) -> Any:
    """Convert a value of a type known to pydantic to JSON-compatible data."""
    return _adapter(schema).dump_python(value, mode="json")


def _complaint(detail: ErrorDetails, schema: type, kind: type[BushfitError]) -> BushfitError:
    """Convert an error of pydantic to a BushfitError with its location in the file."""
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
        message = re.sub("^(Input|String) should (be|have) ", "", detail["msg"])
        expected = _SHAPES.get(detail["type"], _ZEROS.sub(lambda digits: f"{float(digits[0]):g}", message))
        single = detail["type"] == "tuple_type" and isinstance(detail["input"], dict)
        hint = f"write [[{place}]], in two brackets: there may be several" if single else None
        error = kind("this value is not understood", found=found, expected=expected, hint=hint)
    error.place = place
    return error


def _place(table: type, location: tuple[int | str, ...]) -> str:
    """Location as messages show it, such as "simulate.loops #2.frequency"; tables of an array are numbered from 1."""
    words: list[str] = []
    for key in location:
        if isinstance(key, int):
            words[-1] += f" #{key + 1}"
        elif key not in inline_fields(table):
            words.append(key)
        table = _table_at(table, (key,))
    return ".".join(words)


def known_keys(table: type) -> Sequence[str]:
    """All keys that a table of a file may contain, from the dataclass that describes the table."""
    inside = inline_fields(table)
    return [key for entry in fields(table) for key in (inside[entry.name]() if entry.name in inside else [entry.name])]


def inline_fields(table: type) -> Mapping[str, Callable[[], Iterable[str]]]:
    """Fields of a dataclass with inline keys: by field name, the function that returns the keys."""
    members = fields(table) if is_dataclass(table) else ()
    return {member.name: member.metadata[_INLINE] for member in members if _INLINE in member.metadata}


def _table_at(table: type, location: tuple[int | str, ...]) -> type:
    """Dataclass that describes the table at a location below another table, or the nearest dataclass above it."""
    for key in location:
        if key in (hints := get_type_hints(table)):
            inside = (part for part in _type_arguments(hints[key]) if isinstance(part, type) and is_dataclass(part))
            table = next(inside, table)
    return table


def _type_arguments(hint: Any) -> Iterable[Any]:
    """Yield a type hint and, recursively, its arguments, such as list[int] and int."""
    yield hint
    for part in get_args(hint):
        yield from _type_arguments(part)


#: Largest mass [kg], acceleration [m/s^2] and frequency [Hz] of a resonance test; the least is the inverse.
LARGEST_SHAKEN = 1e6
#: A list that is not empty; validation stops at the first error, to save memory.
Several = Annotated[tuple[T, ...], Field(fail_fast=True), Field(min_length=1)]
#: Value of a parameter: a text or a number in the file.
ParameterValue = Annotated[
    float, WithJsonSchema({"type": ["string", "number"], "description": "with its unit; a ratio may be a number"})
]


def si(*units: str) -> BeforeValidator:
    """Validator that converts a text such as "10 mm" to SI; its unit must be compatible with one of the SI units."""
    return converter(lambda raw, _: parse_quantity(raw, *units), text(f"a number with a unit of {' or '.join(units)}"))


def text(description: str) -> dict[str, Any]:
    """JSON Schema of a value that is a text in the file, with a description for users."""
    return {"type": "string", "description": description}


def table(convert: Callable[[dict[str, Any]], Any], written: Mapping[str, Any] | None = None) -> BeforeValidator:
    """Validator that converts a table; pydantic checks other values. `written` is the JSON Schema of the table."""
    return converter(lambda raw, _: convert(raw) if isinstance(raw, dict) else raw, written)


def tables(convert: Callable[[str, dict[str, Any]], Any]) -> BeforeValidator:
    """Validator that converts each table by its name; pydantic checks entries that are no tables."""
    return table(
        lambda raw: {name: convert(name, entry) if isinstance(entry, dict) else entry for name, entry in raw.items()}
    )


def _frequencies(raw: dict[str, Any]) -> list[str]:
    """Frequencies, as texts in Hz, of a table with start, stop and step; both ends are included."""
    expected = '{ start = "5 Hz", stop = "155 Hz", step = "10 Hz" }, or a list such as ["5 Hz", "15 Hz"]'
    if set(raw) != {"start", "stop", "step"}:
        raise CampaignError("this is no range of frequencies", found=str(raw), expected=expected)
    values = regular_steps(*(parse_quantity(raw[key], "Hz") for key in ("start", "stop", "step")))
    if not values:
        raise CampaignError("this is no range of frequencies", found=str(raw), expected="0 < start <= stop, step > 0")
    return [f"{value!r} Hz" for value in values]


_HERTZ = text("a number with a unit of Hz")
#: JSON Schema of frequencies: a list, or a range.
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
SHAKEN = Field(ge=1.0 / LARGEST_SHAKEN, le=LARGEST_SHAKEN)
Share = Annotated[float, si("1"), Field(ge=0, lt=1)]
Count = Annotated[int, Field(strict=True, ge=1, le=1_000_000)]
#: Repeats or cycles of a simulated test; more would take minutes and gigabytes.
Repeats = Annotated[int, Field(strict=True, ge=1, le=1000)]
