"""What options are made of: their types, those that several commands have, and commands with examples."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args

import click

from bushfit.reading.tablefile import Form
from bushfit.report.contents import Picture

Function = Callable[..., Any]
#: Decorator that gives the function of a command an option or an argument.
Parameter = Callable[[Function], Function]

#: Type of an option or an argument that names a file or a folder.
FILE = click.Path(path_type=Path)


class Direction(click.ParamType):  # type: ignore[type-arg]  # click 8.1 knows none
    """A direction of a test; geometry, which lists them, is slow to import, and is asked when they are needed."""

    name = "direction"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        from bushfit import geometry

        choice = click.Choice([str(direction) for direction in geometry.Direction])
        return geometry.Direction(choice.convert(value, param, ctx))


class _Place(click.ParamType):  # type: ignore[type-arg]  # click 8.1 knows none
    """A direction, or a specimen of a campaign, which only the campaign knows."""

    name = "place"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        return str(value) if str(value).strip() else self.fail("this is no direction: an empty text", param, ctx)


class Folder(click.Path):
    """A folder for results; an empty text, as of a variable that is not set, is none."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return (
            super().convert(value, param, ctx) if value else self.fail("this is no folder: an empty text", param, ctx)
        )


class Size(click.FloatRange):
    """A number above zero, called by what it is of; nan, which click takes, is none."""

    def __init__(self, name: str, most: float | None = None) -> None:
        super().__init__(min=0.0, max=most, min_open=True)
        self.name = name

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        size = super().convert(value, param, ctx)
        return size if math.isfinite(size) else self.fail(f"{value} is no {self.name}", param, ctx)


def command_called(name: str, *examples: str) -> Callable[[Function], click.Command]:
    """Decorator that makes a function a command, with command lines at the end of its help.

    These work in a copy of the repository.
    """
    title = f"Example{'s' * (len(examples) > 1)}:"
    return click.command(
        name, epilog="\n".join(["\b", title, *(f"  bushfit {name} {line}".rstrip() for line in examples)])
    )


def in_order(function: Function, *parameters: Parameter) -> Function:
    """A command with options and arguments in the order of its help, before those that it has."""
    for parameter in reversed(parameters):
        function = parameter(function)
    return function


def option_of(key: str) -> str:
    """The option of a key: --force-sign of force_sign."""
    return "--" + key.replace("_", "-")


def place_option(words: str) -> Parameter:
    """Directions or specimens by name, as `directions`."""
    return click.option("--direction", "directions", type=_Place(), multiple=True, help=words)


#: Decorators of a command that writes tables, pictures or pages.
TABLE_FORMAT: Parameter = click.option(
    "--table-format",
    type=click.Choice(get_args(Form)),
    metavar="FORM",
    default="csv",
    envvar="BUSHFIT_TABLE_FORMAT",
    show_envvar=True,
    help="csv, decimal-comma (for a German Excel), xlsx [csv].",
)
PLOT_FORMAT: Parameter = click.option(
    "--plot-format",
    type=click.Choice(get_args(Picture)),
    multiple=True,
    metavar="FORM",
    default=["png"],
    envvar="BUSHFIT_PLOT_FORMAT",
    show_envvar=True,
    help="png, svg, pdf; may be given again [png].",
)
NO_REPORT: Parameter = click.option("--no-report", is_flag=True, help="Write no page (HTML).")
