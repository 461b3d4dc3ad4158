"""What the commands on test files share: options for what a file does not say itself, and errors that name them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import reduce, wraps
from pathlib import Path
from typing import Any, TypeVar

import click

from bushfit.cli.common import direction_option
from bushfit.errors import BushfitError, MeasurementError
from bushfit.reading.headers import LOOP_COLUMNS, RESONANCE_COLUMNS, SWEEP_COLUMNS

F = TypeVar("F", bound=Callable[..., Any])
#: Keys of a campaign's tables that are an option of the same name here, and its help.
_SAME_NAME = {
    "force_sign": "-1: the load cell counts the other way.",
    "rate": 'Of a loop without time: a triangle at this speed, such as "10 mm/min".',
    "frequency": 'Of a loop without time, with --waveform, such as "0.1 Hz".',
    "waveform": "sine or triangle.",
    "amplitude": "Of sweeps whose header does not say: zero-to-peak or peak-to-peak.",
    "encoding": 'Such as "cp1252" [detected].',
    "delimiter": "comma, semicolon, tab, pipe or blanks [detected].",
    "decimal": '"." or "," [detected].',
    "thousands": 'What parts thousands: ".", ",", " ", "\'" or none [detected].',
    "header_line": "Line of the header, from 1 [found].",
    "sheet": "Of a workbook [the only one with such a table].",
}
#: Keys that are whole numbers.
_NUMBERS = ("force_sign", "header_line")
#: An inline table of TOML in the hint of an error.
_TABLE = re.compile(r"\{[^}]*\}")
#: One entry of such a table that is an option here.
_PAIRED = re.compile(r'(column|unit)s = \{ (\w+) = "([^"]*)"')


def file_options(*keys: str, sweeps: bool = True) -> Callable[[F], F]:
    """--direction, --column, --unit and an option for each of some keys, gathered into one `stated` argument.

    Args:
        keys: of [[loops]] and [[sweeps]], as a campaign would have them.
        sweeps: whether the command takes sweeps, or else resonance tests, beside loops.
    """

    known = tuple(dict.fromkeys((*LOOP_COLUMNS, *(SWEEP_COLUMNS if sweeps else RESONANCE_COLUMNS))))

    def decorate(function: F) -> F:
        @wraps(function)
        def wrapped(*args: Any, **kwargs: Any) -> Any:
            stated = {key: kwargs.pop(key) for key in ("direction", *keys)}
            stated["columns"] = _pairs(kwargs.pop("columns"), "--column", "force=Kraft", known)
            stated["units"] = _pairs(kwargs.pop("units"), "--unit", "force=kN", known)
            return function(*args, stated={key: value for key, value in stated.items() if value}, **kwargs)

        return reduce(lambda command, option: option(command), reversed(_options(keys, sweeps=sweeps)), wrapped)  # type: ignore[return-value]

    return decorate


def _options(keys: Sequence[str], *, sweeps: bool) -> list[Callable[[Any], Any]]:
    """The options that state what a file does not say itself."""
    roles, of_all = (
        f"ROLEs: {', '.join(LOOP_COLUMNS)}; of resonance tests: {', '.join(RESONANCE_COLUMNS)}",
        "all files given",
    )
    if sweeps:
        roles = f"ROLEs of loops: {', '.join(LOOP_COLUMNS)}; of sweeps: {', '.join(SWEEP_COLUMNS)}"
        of_all = "all files given that have the role"
    return [
        direction_option(help="{directions}, of all files given [found from their names and columns]."),
        click.option(
            "--column",
            "columns",
            multiple=True,
            metavar="ROLE=HEADER",
            help=f'Such as "force=Fz", of files that have this header; may be given again. {roles}.',
        ),
        click.option(
            "--unit",
            "units",
            multiple=True,
            metavar="ROLE=UNIT",
            help=f'Such as "force=kN", of {of_all}; ROLEs as above.',
        ),
        *(
            click.option("--" + key.replace("_", "-"), key, type=int if key in _NUMBERS else str, help=_SAME_NAME[key])
            for key in keys
        ),
    ]


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


def _pairs(texts: Sequence[str], option: str, example: str, known: Sequence[str]) -> Mapping[str, str]:
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
