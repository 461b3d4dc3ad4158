"""Commands and their options by commands.toml, and the types of these."""

import math
import os
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, get_args

import click

from bushfit.cli import TABLES
from bushfit.errors import MeasurementError
from bushfit.reading.tablefile import Form
from bushfit.report.contents import Picture

#: Hours of the rig at most: months, as a typing error.
_MOST_HOURS = 2000.0


class _Direction(click.ParamType):  # type: ignore[type-arg]  # click 8.1 knows none
    """A direction of a test; geometry, which lists them, is slow to import, and is asked when they are needed."""

    name = "direction"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from bushfit.geometry import Direction

        return Direction(click.Choice([str(direction) for direction in Direction]).convert(value, param, ctx))


class _Place(click.ParamType):  # type: ignore[type-arg]  # click 8.1 knows none
    """A direction, or a specimen of a campaign, which only the campaign knows."""

    name = "place"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        return str(value) if str(value).strip() else self.fail("this is no direction: an empty text", param, ctx)


class _Folder(click.Path):
    """A folder for results; an empty text, as of a variable that is not set, is none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return (
            super().convert(value, param, ctx) if value else self.fail("this is no folder: an empty text", param, ctx)
        )


class _Size(click.FloatRange):
    """A number within ends, called by what it is of; nan, which click takes, is none."""

    def __init__(self, name: str, **ends: Any) -> None:
        super().__init__(**ends)
        self.name = name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        size = super().convert(value, param, ctx)
        return size if math.isfinite(size) else self.fail(f"{value} is no {self.name}", param, ctx)


#: What click takes for each type of commands.toml; of a place several may be given.
_TYPES: Mapping[str, Mapping[str, Any]] = {
    "direction": {"type": _Direction()},
    "flag": {"is_flag": True},
    "folder": {"type": _Folder(path_type=Path)},
    "hours": {"type": _Size("time in hours such as 8", min=0.0, max=_MOST_HOURS, min_open=True), "metavar": "HOURS"},
    "integer": {"type": int},
    "path": {"type": click.Path(path_type=Path)},
    "picture form": {"type": click.Choice(get_args(Picture))},
    "place": {"type": _Place(), "multiple": True},
    "share": {"type": _Size("share such as 0.02", min=0.0, min_open=True)},
    "table form": {"type": click.Choice(get_args(Form))},
}


def command_called(name: str) -> Callable[[Callable[..., Any]], click.Command]:
    """Decorator that makes a function a command, with its options, and its examples at the end of the help."""
    lines = TABLES["examples"][name]
    title = f"Example{'s' * (len(lines) > 1)}:"
    epilog = "\n".join(["\b", title, *(f"  bushfit {line}" for line in lines)])

    def decorate(function: Callable[..., Any]) -> click.Command:
        command = click.command(name, epilog=epilog)(function)
        command.params.extend(_options(name))
        return command

    return decorate


def rows(*tables: str) -> list[str]:
    """The arguments of a command for the options of some tables."""
    return [name.replace("-", "_") for table in tables for name in TABLES[table]]


def option_of(key: str) -> str:
    """The option of a key: --force-sign of force_sign."""
    return "--" + key.replace("_", "-")


#: What test files are not, by their endings.
_NO_TESTS = {".toml": "a campaign, or what else TOML holds", ".json": "a model, or other JSON"}


def _tests_alone(_: click.Context, __: click.Parameter, files: tuple[Path, ...]) -> tuple[Path, ...]:
    """Refuse a campaign or a model among test files."""
    for file in files:
        if (found := _NO_TESTS.get(file.suffix.lower())) and file.is_file():
            hint = "bushfit diagnose looks at all tests of a campaign together; name its files, or their folder, here"
            raise MeasurementError("a test file is needed", file=file, found=found, expected="a table", hint=hint)
    return files


#: Decorator of a command that takes files.
files_argument = click.argument(
    "files", metavar="FILE...", nargs=-1, required=True, type=click.Path(path_type=Path), callback=_tests_alone
)


def _options(table: str, without: str = "") -> Iterator[click.Option]:
    """The options of a table; `without` stands in their help where it says what holds without them."""
    for name, row in TABLES[table].items():
        if isinstance(row, str):  # the rows of another table stand here
            yield from _options(name, row)
            continue
        given = dict(row)
        kind, ends = given.pop("type", None), given.pop("range", None)
        known = {"type": click.Choice(kind)} if isinstance(kind, list) else _TYPES[kind] if kind else {}
        if ends:
            known = {"type": click.IntRange(*ends)}
        if given.get("default") == "cores":
            given["default"] = os.cpu_count() or 1
        to = given.pop("to", "directions" if kind == "place" else name.replace("-", "_"))
        short = [given.pop("short")] if "short" in given else []
        words = given.pop("help").replace("{}", without)
        yield click.Option([*short, f"--{name}", to], help=words, **known, **given)
