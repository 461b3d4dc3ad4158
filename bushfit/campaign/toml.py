"""Reads a TOML file that a user wrote, and checks it against a schema."""

import re
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from bushfit.errors import CampaignError
from bushfit.reading.files import line_of, read_utf8
from bushfit.validation import check_tables

T = TypeVar("T")

#: A key of more than 16 parts, such as a.b.c; parsing one takes time in proportion to the square of their number.
_DEEP_KEY = re.compile(rb"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){16}""")

#: What to do about an error of TOML, by how it begins.
_WAYS = {
    ("Unescaped", "Invalid hex"): "write / for each \\ of a path, or the text in single quotes",
    ("Cannot",): "name each table and key once; several tests stand under [[loops]] or [[sweeps]], in two brackets",
}


def read_toml(path: Path, schema: type[T], *, what: str = "a campaign file", largest: int = 1_000_000) -> T:
    """The content of a TOML file as the dataclass `schema`, all quantities in SI.

    Args:
        schema: a pydantic dataclass, or one of its tables; unknown keys are refused.
        what: the file in words, for errors.
        largest: size of the file at most [bytes]; that of a campaign of thousands of tests.

    Raises:
        CampaignError: the file is missing, too large, no TOML, or has keys or values that are not understood.
        UnitError: a quantity without a unit, or with one that does not fit.
    """
    return check_tables(_parse(path, what, largest), path, schema)


def _parse(path: Path, what: str, largest: int) -> dict[str, Any]:
    data = read_utf8(path, CampaignError, largest=largest, hint=f"give {what}, not a measurement")
    if chain := _DEEP_KEY.search(data):
        raise _too_deep(path, line_of(data, chain.start()))
    try:
        tables = tomllib.loads(data.decode("utf-8-sig"))
        repr(tables)  # an error may have to quote any part of it
        return tables
    except ValueError as error:
        reason = re.fullmatch(r"(?P<problem>.*) \(at (?P<place>.*)\)", str(error), re.DOTALL)
        raise CampaignError(
            "this is not valid TOML",
            file=path,
            place=reason["place"] if reason else None,
            found=reason["problem"] if reason else "a whole number of thousands of digits",
            expected='lines such as length = "34 mm"',
            hint=next(
                (_WAYS[start] for start in _WAYS if str(error).startswith(start)), "put texts and quantities in quotes"
            ),
        ) from error
    except RecursionError:
        pass
    raise _too_deep(path, None)  # outside of `except`: an error of a thousand frames cannot be pickled


def _too_deep(file: Path, place: str | None) -> CampaignError:
    return CampaignError(
        "the tables are nested too deeply",
        file=file,
        place=place,
        expected="keys of a few parts, such as simulate.effects.inertia.mass",
    )
