"""Options for metadata that test files do not contain, and errors that name these options."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Literal

import click

from bushfit.cli.options import FILE, Parameter, combined, option, option_group, option_name
from bushfit.errors import BushfitError, MeasurementError

#: Metadata options by group and campaign key, each with its placeholder, help and permitted values; and questions.
_TABLES: dict[str, dict[str, Any]] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
#: Text of the question for a missing option, by key.
QUESTIONS: dict[str, str] = _TABLES.pop("questions")
#: All metadata options, except columns and units, by key.
STATED: dict[str, dict[str, Any]] = {key: table for group in _TABLES.values() for key, table in group.items()}
#: Files that are not test files: bytes that they begin with, and description, by extension.
_NO_TESTS = {
    ".toml": (rb"", "a campaign or another TOML file"),
    ".json": (rb'{\s*"schema": "bushfit/', "a model or another result of bushfit"),
}
#: Pattern of an inline table of TOML in the hint of an error.
_TABLE = re.compile(r"\{[^}]*\}")
#: Patterns of an inline table `columns` or `units`, and of one of its entries.
_PAIRED = re.compile(r"(column|unit)s = \{([^}]*)\}")
_ENTRY = re.compile(r'(\w+) = "([^"]*)"')


def metadata_options(kind: Literal["tests", "histories", "displacements"] = "tests") -> Parameter:
    """Create the metadata options of a command, whose function receives them in one argument `test_options`.

    Args:
        kind: "tests" for loops and sweeps, with the metadata of a campaign; "histories" for raw histories and resonance
            tests; both add the argument `files`. "displacements" for one displacement history.

    Returns:
        Decorator that adds the options, such as --direction, --unit and --format, to the function of a command.
    """
    unit, header = ("axial=mm", "radial=Sy") if kind == "displacements" else ("force=kN", "force=Fz")
    words = f'Header of a column, such as "{header}". To list all roles, state an unknown one.'
    columns = (
        option("--unit units ROLE=UNIT", f'Unit of a column, such as "{unit}".', multiple=True),
        option("--column columns ROLE=HEADER", words, multiple=True),
    )
    record = "test_options", partial(_test_options, kind)
    file_format = option_group("File format, if it is not detected", *_options("format"), record=record)
    heading = "Information that is missing in the file"
    if kind == "displacements":
        return combined(option_group(heading, *columns, record=record), file_format)
    direction, sign = _options("files")
    information = (direction, *columns, sign, *(_options("tests") if kind == "tests" else ()))
    return combined(
        click.argument("files", metavar="FILE...", nargs=-1, required=True, type=FILE, callback=require_tests),
        option_group(f"{heading}s", *information, record=record),
        file_format,
    )


def _options(group: str) -> list[Parameter]:
    """Create the metadata options of a group: "files", "tests" or "format"."""
    return [
        option(f"{option_name(key)} {table['placeholder']}", table.get("help"), type=value_type(key))
        for key, table in _TABLES[group].items()
    ]


def value_type(key: str) -> click.ParamType[Any] | None:
    """Type of the values of a metadata option, by its key; None for texts."""
    table = STATED.get(key, {})
    if "choices" in table:
        return click.Choice(table["choices"])
    return click.INT if "integer" in table else None


def _test_options(kind: str, _: click.Context, values: dict[str, Any]) -> dict[str, Any]:
    """Convert the values of the metadata options to keys of a campaign; options that are not given are left out.

    Args:
        kind: "tests", "histories" or "displacements", which determines the roles of columns.
        values: values of the options by key.

    Returns:
        Stated values by key, such as {"direction": "axial", "units": {"force": "kN"}}.
    """
    from bushfit.reading.headers import DISPLACEMENT_COLUMNS, LOOP_COLUMNS, RESONANCE_COLUMNS, SWEEP_COLUMNS

    roles = {
        "tests": (*LOOP_COLUMNS, *SWEEP_COLUMNS),
        "histories": (*LOOP_COLUMNS, *RESONANCE_COLUMNS),
        "displacements": tuple(DISPLACEMENT_COLUMNS),
    }[kind]
    values["columns"] = _pairs(values["columns"], "--column", "force=Kraft", roles)
    values["units"] = _pairs(values["units"], "--unit", "force=kN", roles)
    return {key: value for key, value in values.items() if value not in (None, {})}


def require_tests(context: click.Context, _: click.Parameter, value: Any) -> Any:
    """Callback for an argument of test files: raise a MeasurementError if a file is missing or not a test file."""
    from bushfit.reading.files import view_bytes

    files: Sequence[Path] = value if isinstance(value, tuple) else [value]
    for file in () if context.resilient_parsing else files:  # no error during shell completion
        if not os.path.exists(file):  # noqa: PTH110  # Path.exists raises an error for a name that is too long
            view_bytes(file, MeasurementError)
        start, found = _NO_TESTS.get(file.suffix.lower(), (b"", ""))
        if found and file.is_file() and re.match(start, view_bytes(file, MeasurementError)):
            hint = "name a table or a recording here; to evaluate a campaign: bushfit run CAMPAIGN"
            raise MeasurementError("a test file is needed", file=file, found=found, expected="a table", hint=hint)
    return value


@contextmanager
def options_named() -> Iterator[None]:
    """Context in which errors that name campaign keys also name the equivalent command-line options."""
    try:
        yield
    except BushfitError as error:
        hint = error.hint or ""
        tables = _PAIRED.findall(hint)
        named = [f'--{kind} "{role}={text}"' for kind, entries in tables for role, text in _ENTRY.findall(entries)]
        keys = _TABLE.sub("", hint)  # in a table, amplitude is a role
        named += [option_name(key) for key in STATED if key != "direction" and re.search(rf"\b{key} = ", keys)]
        if error.file is None and error.place in STATED:
            error.place = option_name(error.place)
        if named:
            error.hint = f"{hint}; for this command: {', '.join(dict.fromkeys(named))}"
        raise


def direction_error(file: Path, sheet: str | None = None) -> MeasurementError:
    """Create the error for a test file, or a sheet of it, whose direction cannot be determined."""
    from bushfit.reading.instruments import word_for_part

    return MeasurementError(
        "the direction of this test is not stated",
        file=file,
        place=sheet and f'{word_for_part(file)} "{sheet}"',
        found="neither the name nor the columns contain axial, radial or torsion",
        expected="a direction",
        hint="state it: --direction axial (or radial, torsion); or put it into the file name",
    )


def _pairs(texts: Sequence[str], option: str, example: str, roles: Sequence[str]) -> Mapping[str, str]:
    """Parse the texts of an option such as --unit "force=kN" to values by the role of their column.

    Args:
        texts: texts of the option, each a role and a value.
        option: name of the option, for errors.
        example: a valid text, for errors.
        roles: known roles.
    """
    pairs = {}
    for text in texts:
        role, equals, value = text.partition("=")
        role = role.strip().replace(" ", "_").replace("-", "_")
        if not (equals and value.strip() and role in roles):
            raise MeasurementError(
                "this is not ROLE=VALUE",
                place=option,
                found=f'"{text}"',
                expected=f'such as "{example}"; roles: {", ".join(dict.fromkeys(roles))}',
            )
        pairs[role] = value.strip()
    return pairs
