"""Option types, options shared by several commands, shell completion, and commands with examples."""

import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args

import click
from click.shell_completion import CompletionItem

from bushfit.reading.tablefile import Form
from bushfit.report.results import Picture

#: In which a bushing is tested: geometry, which has them, is slow to import.
DIRECTIONS = ("axial", "radial", "torsion")
#: What click asks for the words at the cursor.
Offer = Callable[[click.Context, click.Parameter, str], list[str]]
#: What reads a file of this ending.
_READ: dict[str, Callable[[str], Any]] = {".toml": tomllib.loads, ".json": json.loads}
Function = Callable[..., Any]
#: Decorator that gives the function of a command an option or an argument.
Parameter = Callable[[Function], Function]
#: Type of an option or an argument that names a file or a folder.
FILE = click.Path(path_type=Path)
#: Characters of names in a help beside which their words stand; longer ones have them on the next line.
_NAMES = 26
#: What a command writes that has forms, and the option of these.
Written = Literal["tables", "pictures", "pages"]


def _named(ctx: click.Context, tables: str, key: str) -> Iterator[str]:
    """Values of a key of such tables in the campaigns and models that are typed already.

    While somebody types, no file is an error.
    """
    values = [path for value in ctx.params.values() for path in (value if isinstance(value, tuple) else [value])]
    for path in {Path(path) for path in (*values, *ctx.args) if isinstance(path, str | Path)}:
        with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
            for entry in _READ[path.suffix](path.read_text(encoding="utf-8")).get(tables, ()):
                with suppress(KeyError, TypeError):
                    yield str(entry[key])


def _offered(list_names: Callable[[click.Context], Iterable[str]], between: str = "") -> Offer:
    """Shell completion from a list of names; with `between`, for the last name of a list separated by these signs."""

    def offer(ctx: click.Context, _: click.Parameter, incomplete: str) -> list[str]:
        typed = re.match(f"(?:.*[{between}])?", incomplete) if between else None
        before = typed[0] if typed else ""
        return [before + name for name in list_names(ctx) if name.startswith(incomplete[len(before) :])]

    return offer


def _effects(_: click.Context) -> list[str]:
    from bushfit.effects import BASE, LIBRARY

    return [name for name in LIBRARY if name not in BASE]


def _explanations(ctx: click.Context) -> Iterator[str]:
    """Effects, and mistakes with the test that they may have been made in."""
    from bushfit.effects.mistakes import MISTAKES, labelled

    yield from _effects(ctx)
    for name, mistake in MISTAKES.items():
        yield from (
            labelled(name, Path(file).stem) for kind in mistake.kinds for file in _named(ctx, f"{kind}s", "file")
        )


#: What is offered in place of an option: an explanation, or several effects between commas and plus signs.
explanations, effect_lists = _offered(_explanations), _offered(_effects, ",+")


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


if TYPE_CHECKING:  # click before 8.2 has no generic types at run time
    NumberType: TypeAlias = click.ParamType[float]
else:
    NumberType = click.ParamType


class Folder(click.Path):
    """A folder for results; an empty text, as of a variable that is not set, is none."""

    def shell_complete(self, ctx: click.Context, param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        return [CompletionItem(incomplete, type="dir")]

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        return (
            super().convert(value, param, ctx) if value else self.fail("this is no folder: an empty text", param, ctx)
        )


class Size(NumberType):
    """Positive number up to `maximum`, also in per cent; error messages use the name of the quantity."""

    def __init__(self, name: str, maximum: float) -> None:
        self.name, self._maximum = name, maximum

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        text = str(value).strip()
        with suppress(ValueError):
            if 0.0 < (size := float(text.removesuffix("%")) * (0.01 if "%" in text else 1.0)) <= self._maximum:
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


def add_parameters(function: Function, *parameters: Parameter) -> Function:
    """A command with options and arguments in the order of its help, before those that it has."""
    for parameter in reversed(parameters):
        function = parameter(function)
    return function


def under(heading: str, *parameters: Parameter) -> Parameter:
    """Options that stand under a heading of the help, in this order."""

    def decorate(function: Function) -> Function:
        before = len(getattr(function, "__click_params__", ()))
        add_parameters(function, *parameters)
        for parameter in vars(function)["__click_params__"][before:]:
            parameter.heading = heading
        return function

    return decorate


def option_of(key: str) -> str:
    """The option of a key: --force-sign of force_sign."""
    return "--" + key.replace("_", "-")


def place_option(words: str) -> Parameter:
    """Directions or specimens by name, as `directions`; which specimens there are, only the campaign knows."""

    def check(ctx: click.Context, parameter: click.Parameter, places: tuple[str, ...]) -> tuple[str, ...]:
        if not all(place.strip() for place in places):
            raise click.BadParameter("this is no direction: an empty text", ctx, parameter)
        return places

    names = _offered(lambda ctx: (*DIRECTIONS, *_named(ctx, "specimens", "name")))
    return option(
        "--direction directions", "PLACE", words, type=str, multiple=True, callback=check, shell_complete=names
    )


def effect_option(words: str) -> Parameter:
    """Effects to add by name, as `effects`."""
    return option("--effect effects", "NAME", words, multiple=True, shell_complete=_offered(_effects))


def file_option(name: str, words: str) -> Parameter:
    """A file."""
    return option(name, "FILE", words, type=FILE)


def format_options(*kinds: Written) -> list[Parameter]:
    """Options for the formats of tables and figures, and for leaving pages out."""
    options: dict[Written, Parameter] = {
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
        "pages": flag("--no-report", "Do not write the HTML page."),
    }
    return [options[kind] for kind in kinds]
