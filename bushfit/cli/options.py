"""What options are made of: their types, those that several commands have, and commands with examples."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Literal, get_args

import click
from click.shell_completion import CompletionItem

from bushfit.cli import completion
from bushfit.reading.tablefile import Form
from bushfit.report.contents import Picture

Function = Callable[..., Any]
#: Decorator that gives the function of a command an option or an argument.
Parameter = Callable[[Function], Function]

#: Type of an option or an argument that names a file or a folder.
FILE = click.Path(path_type=Path)
#: Characters of names in a help beside which their words stand; longer ones have them on the next line.
_NAMES = 26


class Option(click.Option):
    """An option that stands under a heading of its command's help, with its words alone: they say what a default is."""

    heading: str | None = None

    def get_help_extra(self, ctx: click.Context) -> Any:
        return {}


def option(names: str, metavar: str | None, words: str | None = None, **more: Any) -> Parameter:
    """An option of a command: its names (the last may be that in Python), what stands for its value, and its words."""
    return click.option(*names.split(), cls=Option, metavar=metavar, help=words, **more)


def flag(names: str, words: str | None = None, **more: Any) -> Parameter:
    """An option without a value."""
    return option(names, None, words, is_flag=True, **more)


class Command(click.Command):
    """A command whose help has its options under headings, in the order in which they are declared.

    Options without words share the line of the next that has some; without one, they are a paragraph of their own.
    """

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        heading, groups = "Options", dict[str, list[tuple[str, str]]]()
        for parameter in self.get_params(ctx):
            heading = getattr(parameter, "heading", None) or heading
            if not isinstance(parameter, click.Argument) and (record := parameter.get_help_record(ctx)):
                groups.setdefault(heading, []).append(record)
        for title, records in groups.items():
            names, lines = list[str](), list[tuple[str, str]]()
            for name, words in records:
                names.append(name)
                if words:
                    lines.append((", ".join(names), words))
                    names = []
            with formatter.section(title):
                if lines:
                    formatter.write_dl(lines, col_max=_NAMES)
                if names:
                    formatter.write_text(", ".join(names))


class _Place(click.ParamType[str]):
    """A direction, or a specimen of a campaign, which only the campaign knows."""

    name = "place"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> str:
        return str(value) if str(value).strip() else self.fail("this is no direction: an empty text", param, ctx)


class Folder(click.Path):
    """A folder for results; an empty text, as of a variable that is not set, is none."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        return [CompletionItem(incomplete, type="dir")]

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return (
            super().convert(value, param, ctx) if value else self.fail("this is no folder: an empty text", param, ctx)
        )


class Size(click.ParamType[float]):
    """A number above zero and below or at `most`, called by what it is of; a share also in per cent."""

    def __init__(self, name: str, most: float) -> None:
        self.name, self._most = name, most

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        text = str(value).strip()
        with suppress(ValueError):
            if 0.0 < (size := float(text.removesuffix("%")) * (0.01 if "%" in text else 1.0)) <= self._most:
                return size
        return self.fail(f"{text} is no {self.name}", param, ctx)


def command_called(name: str, *examples: str) -> Callable[[Function], click.Command]:
    """Decorator that makes a function a command, with command lines at the end of its help.

    These work in a copy of the repository.
    """
    title = f"Example{'s' * (len(examples) > 1)}:"
    return click.command(
        name, cls=Command, epilog="\n".join(["\b", title, *(f"  bushfit {name} {line}".rstrip() for line in examples)])
    )


def in_order(function: Function, *parameters: Parameter) -> Function:
    """A command with options and arguments in the order of its help, before those that it has."""
    for parameter in reversed(parameters):
        function = parameter(function)
    return function


def under(heading: str, *parameters: Parameter) -> Parameter:
    """Options that stand under a heading of the help, in this order."""

    def decorate(function: Function) -> Function:
        made: list[Any] = vars(function).setdefault("__click_params__", [])
        before = len(made)
        in_order(function, *parameters)
        for parameter in made[before:]:
            parameter.heading = heading
        return function

    return decorate


def option_of(key: str) -> str:
    """The option of a key: --force-sign of force_sign."""
    return "--" + key.replace("_", "-")


def place_option(words: str) -> Parameter:
    """Directions or specimens by name, as `directions`."""
    return option(
        "--direction directions", "PLACE", words, type=_Place(), multiple=True, shell_complete=completion.places
    )


def effect_option(words: str) -> Parameter:
    """Effects to add by name, as `effects`."""
    return option("--effect effects", "NAME", words, multiple=True, shell_complete=completion.effects)


def file_option(name: str, words: str) -> Parameter:
    """A file."""
    return option(name, "FILE", words, type=FILE)


#: What a command writes that has forms, and the option of these.
Written = Literal["tables", "pictures", "pages"]
FORMS: dict[Written, Parameter] = {
    "tables": option(
        "--table-format",
        "FORM",
        "csv, decimal-comma (German Excel) or xlsx [csv].",
        type=click.Choice(get_args(Form)),
        default="csv",
        envvar="BUSHFIT_TABLE_FORMAT",
        show_envvar=True,
    ),
    "pictures": option(
        "--plot-format",
        "FORM",
        "png, svg, pdf; may be given again [png].",
        type=click.Choice(get_args(Picture)),
        multiple=True,
        default=["png"],
        envvar="BUSHFIT_PLOT_FORMAT",
        show_envvar=True,
    ),
    "pages": flag("--no-report", "Write no page (HTML)."),
}
