"""Read TOML files, and write tables of a campaign file as TOML text."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bushfit.errors import CONTROL, CampaignError
from bushfit.geometry import Specimen
from bushfit.reading.files import line_of, read_utf8

#: A key of more than 16 parts, such as a.b.c; parsing one takes time in proportion to the square of their number.
_DEEP_KEY = re.compile(rb"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){16}""")
#: A key that is written without quotes.
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")

#: Hint for an error of the TOML parser, by the first words of its message.
_WAYS = {
    ("Unescaped", "Invalid hex"): "write / instead of \\ in a path, or put the path in single quotes",
    ("Cannot",): "name each table and key once; list several tests under [[loops]] or [[sweeps]], in two brackets",
}


def parse_toml(path: Path, description: str = "a campaign file", largest: int = 1_000_000) -> dict[str, Any]:
    """Read a TOML file as dictionaries and lists, without checking it against a schema.

    Args:
        path: TOML file.
        description: kind of file, for error messages.
        largest: maximum size of the file [bytes].

    Returns:
        Content of the file: tables, values and texts as TOML gives them.

    Raises:
        CampaignError: the file is missing, too large or not TOML.
    """
    data = read_utf8(path, CampaignError, largest=largest, hint=f"give {description}, not a measurement")
    chain = _DEEP_KEY.search(data)
    try:
        if not chain:
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
    place = line_of(data, chain.start()) if chain else None
    # outside of `except`: an error of a thousand frames cannot be pickled
    expected = "keys of a few parts, such as simulate.effects.inertia.mass"
    raise CampaignError("the tables are nested too deeply", file=path, place=place, expected=expected)


def specimen_lines(specimen: Specimen) -> list[str]:
    """Write one [[specimens]] table of a campaign file.

    Args:
        specimen: body of the compound.

    Returns:
        Lines of TOML.
    """
    lines = ["[[specimens]]", f"name = {toml_value(specimen.name)}", f'kind = "{specimen.kind}"']
    if specimen.strain != "engineering":
        lines.append(f'strain = "{specimen.strain}"')
    if specimen.area and specimen.thickness:
        lines += [f'area = "{specimen.area * 1e6:.12g} mm^2"', f'thickness = "{specimen.thickness * 1e3:.12g} mm"']
        lines.append(f"elements = {specimen.elements}")
    return lines


def toml_value(value: Any) -> str:
    """Format a text, a number or a table as a TOML value.

    Returns:
        Text of the value, such as '"23 degC"' or '{ block = "1" }'.
    """
    if isinstance(value, Mapping):
        keys = {key: key if _BARE_KEY.fullmatch(key) else toml_value(key) for key in value}
        return "{ " + ", ".join(f"{keys[key]} = {toml_value(entry)}" for key, entry in value.items()) + " }"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + CONTROL.sub(lambda character: f"\\u{ord(character[0]):04x}", escaped) + '"'
    return str(value)
