"""What the commands on test files share: options for what a file does not say itself, and errors that name them."""

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, get_args

from bushfit.cli.options import option_of, rows
from bushfit.errors import BushfitError, MeasurementError
from bushfit.reading.headers import AmplitudeConvention
from bushfit.reading.words import LOOP_COLUMNS, RESONANCE_COLUMNS, SWEEP_COLUMNS

_SAME_NAME = ("force_sign", *rows("test", "written"))
#: An inline table of TOML in the hint of an error.
_TABLE = re.compile(r"\{[^}]*\}")
#: One entry of such a table that is an option here.
_PAIRED = re.compile(r'(column|unit)s = \{ (\w+) = "([^"]*)"')


def with_stated(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator of a command on test files: what its options say of them becomes one `stated`.

    Beside loops there are sweeps, with all keys of a campaign, or else resonance tests, with those of any file.
    """

    @wraps(function)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        sweeps = "rate" in kwargs
        known = tuple(dict.fromkeys((*LOOP_COLUMNS, *(SWEEP_COLUMNS if sweeps else RESONANCE_COLUMNS))))
        keys = [*rows("file"), *(rows("test") if sweeps else ()), *rows("written")]
        stated = {key: kwargs.pop(key) for key in keys if key not in ("column", "unit")}
        stated["columns"] = _pairs(kwargs.pop("columns"), "--column", "force=Kraft", known)
        stated["units"] = _pairs(kwargs.pop("units"), "--unit", "force=kN", known)
        _check_amplitude(stated.get("amplitude"))
        return function(*args, stated={key: value for key, value in stated.items() if value}, **kwargs)

    return wrapped


@contextmanager
def options_named() -> Iterator[None]:
    """Where an error says what to write in the campaign, it says which option does the same here."""
    try:
        yield
    except BushfitError as error:
        hint = error.hint or ""
        named = [f'--{kind} "{role}={text}"' for kind, role, text in _PAIRED.findall(hint)]
        keys = _TABLE.sub("", hint)  # in a table, amplitude is a role
        named += [option_of(key) for key in _SAME_NAME if re.search(rf"\b{key} = ", keys)]
        if error.file is None and error.place in _SAME_NAME:
            error.place = option_of(error.place)
        if named:
            error.hint = f"{hint}; for this command: {', '.join(dict.fromkeys(named))}"
        raise


def direction_error(file: Path, sheet: str | None = None) -> MeasurementError:
    """The error for a file, or a sheet of it, of a direction that nothing settles."""
    return MeasurementError(
        "nothing says in which direction this was tested",
        file=file,
        place=sheet and f'sheet "{sheet}"',
        found="neither its name nor its columns say axial, radial or torsion",
        expected="a direction",
        hint="state it: --direction axial (or radial, torsion); or where others say another, name the file after it",
    )


def _check_amplitude(counting: str | None) -> None:
    """Refuse a value where the counting of amplitudes is stated."""
    known = get_args(AmplitudeConvention)
    if counting and counting not in known:
        raise MeasurementError(
            "this does not say how amplitudes are counted",
            place="--amplitude",
            found=f'"{counting}"',
            expected=" or ".join(known),
            hint=f'--at-amplitude "{counting if counting[0].isdigit() else "0.1 mm"}" states the amplitude of files '
            "that have no column for it",
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
