"""What the commands on test files share: options that state what a file does not say itself, and errors that name
them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import reduce, wraps
from pathlib import Path
from typing import Any, TypeVar

import click

from bushfit.errors import BushfitError, MeasurementError

F = TypeVar("F", bound=Callable[..., Any])
#: Keys of a campaign's tables that are an option of the same name here.
_SAME_NAME = {
    "force_sign": "-1: the load cell counts the other way.",
    "rate": 'Of a loop without time: a triangle at this speed, such as "10 mm/min".',
    "frequency": 'Of a loop without time, with --waveform, such as "0.1 Hz".',
    "waveform": "sine or triangle.",
    "amplitude": "How sweeps count amplitudes, where the header does not say: zero-to-peak or peak-to-peak.",
    "encoding": 'Such as "cp1252" [detected].',
    "delimiter": "comma, semicolon, tab, pipe or blanks [detected].",
    "decimal": '"." or "," [detected].',
    "thousands": 'What parts thousands: ".", ",", " ", "\'" or none [detected].',
    "header_line": "Line of the header, from 1 [found].",
    "sheet": "Sheet of a workbook.",
}
_NUMBERS = ("force_sign", "header_line")
_TABLE = re.compile(r"\{[^}]*\}")
_PAIRED = re.compile(r'(column|unit)s = \{ (\w+) = "([^"]*)"')


def file_options(*keys: str) -> Callable[[F], F]:
    """--direction, --column, --unit and an option for each of some keys, gathered into one `stated` argument: keys of
    [[loops]] and [[sweeps]] as a campaign would have them."""

    def decorate(function: F) -> F:
        @wraps(function)
        def wrapped(*args: Any, **kwargs: Any) -> Any:
            stated = {key: kwargs.pop(key) for key in ("direction", *keys)}
            stated["columns"] = _pairs(kwargs.pop("columns"), "--column", "force=Kraft")
            stated["units"] = _pairs(kwargs.pop("units"), "--unit", "force=kN")
            return function(*args, stated={key: value for key, value in stated.items() if value}, **kwargs)

        decorators = [
            click.option(
                "--direction",
                type=click.Choice(["axial", "radial", "torsion"]),
                help="Of all files given [found from their names and columns].",
            ),
            click.option(
                "--column",
                "columns",
                multiple=True,
                metavar="ROLE=HEADER",
                help='Such as "force=Fz", of all loops given; roles of a sweep, of all sweeps.',
            ),
            click.option(
                "--unit",
                "units",
                multiple=True,
                metavar="ROLE=UNIT",
                help='Such as "force=kN", of all loops given; roles of a sweep, of all sweeps.',
            ),
            *(
                click.option(
                    "--" + key.replace("_", "-"), key, type=int if key in _NUMBERS else str, help=_SAME_NAME[key]
                )
                for key in keys
            ),
        ]
        return reduce(lambda command, decorator: decorator(command), reversed(decorators), wrapped)  # type: ignore[return-value]

    return decorate


@contextmanager
def options_named() -> Iterator[None]:
    """Where an error says what to write in the campaign, it says which option does the same here."""
    try:
        yield
    except BushfitError as error:
        hint = error.hint or ""
        named = [f'--{kind} "{role}={text}"' for kind, role, text in _PAIRED.findall(hint)]
        keys = _TABLE.sub("", hint)  # in a table, amplitude is a role
        named += ["--" + key.replace("_", "-") for key in _SAME_NAME if re.search(rf"\b{key} = ", keys)]
        if named:
            error.hint = f"{hint}; for this command: {', '.join(dict.fromkeys(named))}"
        raise


def direction_error(file: Path) -> MeasurementError:
    """The error for a file of a direction that nothing settles."""
    return MeasurementError(
        "nothing says in which direction this was tested",
        file=file,
        found="neither its name nor its columns say axial, radial or torsion",
        expected="a direction",
        hint="state it: --direction axial (or radial, torsion)",
    )


def _pairs(texts: Sequence[str], option: str, example: str) -> Mapping[str, str]:
    from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS

    known = list(dict.fromkeys([*LOOP_COLUMNS, *SWEEP_COLUMNS]))
    pairs = {}
    for text in texts:
        role, equals, value = text.partition("=")
        role = role.strip().replace(" ", "_").replace("-", "_")
        if not (equals and value.strip() and role in known):
            raise MeasurementError(
                "not a column's role with a value",
                place=option,
                found=f'"{text}"',
                expected=f'such as "{example}"; roles: {", ".join(known)}',
            )
        pairs[role] = value.strip()
    return pairs
