"""TOML files of the user's: parsed, checked against a schema, and any complaint of pydantic's in our words."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from bushfit.errors import BushfitError, CampaignError
from bushfit.files import read_utf8
from bushfit.schema import FitSettings, fit_keys, unknown_key

T = TypeVar("T")

_LARGEST_BYTES = 1_000_000
#: A key of many parts costs the parser the square of their number.
_DEEP_KEY = re.compile(rb"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){16}""")
_UNKNOWN = "unexpected_keyword_argument"
#: pydantic's names for what has the wrong shape, in the words of TOML.
_SHAPES = {
    "dataclass_type": "a table",
    "dict_type": "a table",
    "mapping_type": "a table",
    "tuple_type": "a list",
    "too_short": "at least one value",
    "string_type": "a text in quotes",
    "string_too_short": "a text that is not empty",
    "string_pattern_mismatch": "one line without control characters",
    "string_unicode": "text in Unicode",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
}
_WORDS = {"None": "null", "True": "true", "False": "false"}


def read_toml(path: Path, schema: type[T], *, what: str = "a campaign file", largest: int = _LARGEST_BYTES) -> T:
    """The content of a TOML file as the dataclass `schema`, all quantities in SI.

    Args:
        path: the file.
        schema: a pydantic dataclass, or one of its tables; unknown keys are refused.
        what: the file in words, for errors.
        largest: refuse more bytes than this.

    Raises:
        CampaignError: the file is missing, too large, no TOML, or has keys or values that are not understood.
        UnitError: a quantity without a unit, or with one that does not fit.
    """
    return check_tables(_parse(path, what, largest), path, schema)


def _parse(path: Path, what: str, largest: int) -> dict[str, Any]:
    data = read_utf8(path, CampaignError, largest=largest, hint=f"give {what}, not a measurement")
    if chain := _DEEP_KEY.search(data):
        line = data.count(b"\n", 0, chain.start()) + 1
        raise _too_deep(path, f"line {line}")
    try:
        tables = tomllib.loads(data.decode("utf-8-sig"))
        repr(tables)  # an error may have to quote any part of it
    except ValueError as error:
        reason = re.fullmatch(r"(?P<problem>.*) \(at (?P<place>.*)\)", str(error), re.DOTALL)
        raise CampaignError(
            "this is not valid TOML",
            file=path,
            place=reason["place"] if reason else None,
            found=reason["problem"] if reason else "a whole number of thousands of digits",
            expected='lines such as length = "34 mm"',
            hint="put texts and quantities in quotes",
        ) from error
    except RecursionError:
        tables = None
    if tables is None:  # outside of `except`: an error of a thousand frames cannot be pickled
        raise _too_deep(path, None)
    return tables


@cache
def _adapter(schema: Any) -> TypeAdapter[Any]:
    return TypeAdapter(schema)


def _too_deep(file: Path, place: str | None) -> CampaignError:
    expected = "keys of a few parts, such as simulate.effects.inertia.mass"
    return CampaignError("the tables are nested too deeply", file=file, place=place, expected=expected)


def check_tables(
    tables: Mapping[str, Any],
    file: Path,
    schema: type[T],
    place: str | None = None,
    *,
    kind: type[BushfitError] = CampaignError,
) -> T:
    """Parsed TOML as the dataclass `schema`, all quantities in SI; errors say that it stands in `file`, at `place`.

    Raises:
        kind: keys or values that are not understood.
        UnitError: a quantity without a unit, or with one that does not fit.
    """
    try:
        checked: T = _adapter(cast(Hashable, schema)).validate_python(tables)
        return checked
    except ValidationError as error:
        # a mistyped key is missing and unknown: the latter says more
        details = sorted(error.errors(include_url=False), key=lambda detail: detail["type"] != _UNKNOWN)
        complaint = _complaint(details[0], schema, kind)
    complaint.file = file
    complaint.place = ", ".join(filter(None, (place, complaint.place)))
    raise complaint  # outside of `except`: pydantic's error holds ours, and a ring of errors cannot be pickled


def _complaint(detail: ErrorDetails, schema: type, kind: type[BushfitError]) -> BushfitError:
    """One error of pydantic's as one of ours; tables of an array are counted from 1."""
    location = detail["loc"]
    place = ".".join(str(key) for key in location)
    cause = detail.get("ctx", {}).get("error")
    if isinstance(cause, ValueError) and isinstance(cause.args[0], BushfitError):
        error = cause.args[0]
        place = ".".join(part for part in (place, error.place) if part)
    elif detail["type"] == _UNKNOWN:
        error = unknown_key(str(location[-1]), _keys(_table_at(schema, location[:-1])))
    elif detail["type"] == "missing":
        key = location[-1]
        error = kind("a key is missing", expected=f"{key} = ..." if isinstance(key, str) else "a further value")
    else:
        found = _WORDS.get(str(detail["input"]), str(detail["input"]))
        expected = _SHAPES.get(detail["type"], re.sub("^(Input|String) should (be|have) ", "", detail["msg"]))
        error = kind("this value is not understood", found=found, expected=expected)
    error.place = re.sub(r"\.(\d+)", lambda index: f" #{int(index[1]) + 1}", place.replace("fit.parameters.", "fit."))
    return error


def _keys(table: type) -> Sequence[str]:
    """The keys that a table of the file may have."""
    return fit_keys() if table is FitSettings else [entry.name for entry in fields(table)]


def _table_at(table: type, location: tuple[int | str, ...]) -> type:
    """The dataclass of the table at a place below another."""
    for key in location:
        if key in (hints := get_type_hints(table)):
            table = next(part for part in _parts(hints[key]) if isinstance(part, type) and is_dataclass(part))
    return table


def _parts(hint: Any) -> Iterable[Any]:
    """A type and all that it is made of."""
    yield hint
    for part in get_args(hint):
        yield from _parts(part)
