"""Option types, options shared by several commands, and commands with examples."""

from collections.abc import Callable
from functools import reduce
from pathlib import Path
from typing import Any

import click

from bushfit.errors import error_location, quote_path

Function = Callable[..., Any]
#: Decorator that adds an option or an argument to the function of a command.
Parameter = Callable[[Function], Function]
#: Key of the command line as the user typed it, in `meta` of the context of a command.
TYPED = "bushfit.typed"
#: Type of an option or an argument that names a file or a folder.
FILE = click.Path(path_type=Path)
#: Maximum width of option names in help texts [characters]; the text of longer names starts on the next line.
_NAMES = 26


#: Argument of a command's function that collects the values of several options: its name, and the function that makes
#: it from the context and these values by name.
Record = tuple[str, Callable[[click.Context, dict[str, Any]], Any]]


class Option(click.Option):
    """Option of a command, with the heading under which the help text lists the option.

    If the option has a `record` (see `option_group`), its value is not passed to the command's function. The record
    names one argument for the values of all options of the group, and a function that makes the argument from them.
    """

    heading: str | None = None
    record: Record | None = None

    def get_help_extra(self, ctx: click.Context) -> Any:
        """Texts that click appends to the help text of the option: none, because the help text states the default."""
        return {}

    def type_cast_value(self, ctx: click.Context, value: Any) -> Any:
        """Convert the text of the option by its type; errors name the option."""
        with error_location(place=self.opts[0]):
            return super().type_cast_value(ctx, value)


def option(usage: str, help_text: str | None = None, **more: Any) -> Parameter:
    """Create an option of a command.

    Args:
        usage: names of the option, an optional name of the Python argument, and the placeholder of the value in
            capitals, such as "-o --output DIR"; a flag has no placeholder.
        help_text: help text, which ends with the default in brackets; None if the option shares the text of the next
            option.
        **more: further arguments of click.option; an option with `multiple=True` says that it may be given again.
    """
    if help_text and more.get("multiple"):
        text, bracket, default = help_text.removesuffix(".").partition(" [")
        help_text = f"{text}; may be given again{bracket}{default}."
    names = [word for word in usage.split() if word == word.lower()]
    metavar = usage.split()[-1] if len(names) < len(usage.split()) else None
    return click.option(*names, cls=Option, metavar=metavar, help=help_text, **more)


def flag(names: str, help_text: str | None = None, **more: Any) -> Parameter:
    """Create an option without a value, which is True if given.

    Args:
        names: names separated by blanks; the last may be the name of the Python argument.
        help_text: help text; None if the option shares the text of the next option.
        **more: further arguments of click.option.
    """
    return option(names, help_text, is_flag=True, **more)


class Command(click.Command):
    """Command whose help lists its options under headings, in the order in which they are declared.

    Options without a help text share the line of the next option; at the end of a heading they form a paragraph.
    """

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the command line, and combine the options of each group with a `record` into one argument."""
        ctx.meta[TYPED] = f"{ctx.command_path} {' '.join(map(quote_path, args))}"
        rest, records = super().parse_args(ctx, args), dict[Record, dict[str, Any]]()
        for parameter in self.params:
            if (record := getattr(parameter, "record", None)) and parameter.expose_value:
                records.setdefault(record, {})[str(parameter.name)] = ctx.params.pop(str(parameter.name), None)
        for (name, make), values in () if ctx.resilient_parsing else records.items():  # none for the Tab key
            ctx.params[name] = make(ctx, values)
        return rest

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options with their help texts under headings."""
        heading, groups = "Options", dict[str, list[tuple[str, str]]]()
        for parameter in self.get_params(ctx):
            heading = getattr(parameter, "heading", None) or heading
            if not isinstance(parameter, click.Argument) and (record := parameter.get_help_record(ctx)):
                groups.setdefault(heading, []).append(record)
        for title, records in groups.items():
            names, lines = list[str](), list[tuple[str, str]]()
            for name, help_text in records:
                names.append(name)
                if help_text:
                    lines.append((", ".join(names), help_text))
                    names = []
            with formatter.section(title):
                if lines:
                    formatter.write_dl(lines, col_max=_NAMES)
                if names:
                    formatter.write_text(", ".join(names))


class Folder(click.Path):
    """Option type for a results folder; an empty text is an error."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Convert the text of an option to the path of a folder; an empty text is an error."""
        return super().convert(value, param, ctx) if value else self.fail("an empty text is not a folder", param, ctx)


def command_called(name: str, *examples: str) -> Callable[[Function], click.Command]:
    """Decorator that makes a function a command, with examples at the end of its help.

    Args:
        name: name of the command.
        examples: arguments of the example command lines, which work in a copy of the repository.
    """
    title = f"Example{'s' * (len(examples) > 1)}:"
    return click.command(
        name, cls=Command, epilog="\n".join(["\b", title, *(f"  bushfit {name} {line}".rstrip() for line in examples)])
    )


def combined(*parameters: Parameter) -> Parameter:
    """Combine decorators of options and arguments into one that adds them before the existing ones, in this order."""
    return lambda function: reduce(lambda decorated, add: add(decorated), reversed(parameters), function)


def option_group(heading: str, *parameters: Parameter, record: Record | None = None) -> Parameter:
    """Group options under a heading of the help, in the given order.

    Args:
        heading: heading above the options.
        *parameters: decorators of the options.
        record: name of the argument that collects the values of the options, and function that makes it from the
            context and these values by name; None to pass each value by itself.

    Returns:
        Decorator that adds the options to the function of a command.
    """

    def decorate(function: Function) -> Function:
        before = len(getattr(function, "__click_params__", ()))
        combined(*parameters)(function)
        for parameter in vars(function)["__click_params__"][before:]:
            parameter.heading, parameter.record = heading, record
        return function

    return decorate


def option_name(key: str) -> str:
    """Name of the option for a key, such as --force-sign for force_sign."""
    return "--" + key.replace("_", "-")


def direction_option(action: str, default: str, name: str = "directions") -> Parameter:
    """Create the option --direction, for directions or specimens.

    Args:
        action: verb of what the command does with a direction, such as "fit".
        default: default, as the help text states it.
        name: argument of the command's function.
    """
    help_text = f"Direction (axial, radial, torsion) or specimen to {action} [{default}]."
    return option(f"--direction {name} PLACE", help_text, multiple=True)


def file_option(name: str, help_text: str) -> Parameter:
    """Create an option whose value is a file, with the help text `help_text`."""
    return option(f"{name} FILE", help_text, type=FILE)
