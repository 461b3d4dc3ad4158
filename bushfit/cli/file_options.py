"""What the commands on test files share: options for what a file does not say itself, and errors that name them."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any, get_args

import click

from bushfit.cli.options import FILE, Direction, Function, Parameter, in_order, option_of
from bushfit.errors import BushfitError, MeasurementError
from bushfit.reading.headers import AmplitudeConvention
from bushfit.reading.words import LOOP_COLUMNS, RESONANCE_COLUMNS, SWEEP_COLUMNS

#: What a test file does not say itself, as keys of a campaign: of loops and sweeps, and how any file is written.
_OF_TESTS = {
    "rate": 'Of a loop without time, a triangle: "10 mm/min".',
    "frequency": 'Of a loop without time, with --waveform: "0.1 Hz".',
    "waveform": "sine or triangle.",
    "amplitude": "zero-to-peak or peak-to-peak, if headers do not say.",
    "at_amplitude": 'Without a column: "0.1 mm" [found in the name].',
    "at_frequency": 'Without a column: "10 Hz" [found in the name].',
    "temperature": 'Of the test, or of the rows to take: "23 degC".',
    "specimen": "Its name, if no bushing [coupon, or bar in tension].",
    "specimen_number": "Of the part, or of the rows to take.",
    "area": 'Of one rubber block in shear, such as "772 mm^2".',
    "thickness": 'Of one rubber block in shear, such as "6 mm".',
    "elements": "Rubber blocks in parallel [1].",
}
_AS_WRITTEN = {
    "encoding": 'Such as "cp1252" [detected].',
    "delimiter": "comma, semicolon, tab, pipe or blanks [detected].",
    "decimal": '"." or "," [detected].',
    "thousands": '".", ",", " ", "\'" or none [detected].',
    "header_line": "Line of the header, from 1 [found].",
    "sheet": "Of a workbook, or group of channels [all with a test].",
}
#: What test files are not, by their endings.
_NO_TESTS = {".toml": "a campaign, or what else TOML holds", ".json": "a model, or other JSON"}
_WHOLE_NUMBERS = ("elements", "header_line")
_SAME_NAME = ("force_sign", *_OF_TESTS, *_AS_WRITTEN)
#: An inline table of TOML in the hint of an error.
_TABLE = re.compile(r"\{[^}]*\}")
#: One entry of such a table that is an option here.
_PAIRED = re.compile(r'(column|unit)s = \{ (\w+) = "([^"]*)"')


def with_stated(*, sweeps: bool = True) -> Parameter:
    """Decorator of a command on test `files`: what its options say of them becomes one `stated`.

    Beside loops there are `sweeps`, with all keys of a campaign, or else resonance tests, with those of any file.
    """
    others = SWEEP_COLUMNS if sweeps else RESONANCE_COLUMNS
    known = tuple(dict.fromkeys((*LOOP_COLUMNS, *others)))
    roles = (
        f"ROLEs{' of loops' if sweeps else ''}: {', '.join(LOOP_COLUMNS)}; "
        f"of {'sweeps' if sweeps else 'resonance tests'}: {', '.join(others)}"
    )
    keys = (_OF_TESTS if sweeps else {}) | _AS_WRITTEN

    def decorate(function: Function) -> Function:
        @wraps(function)
        def wrapped(columns: Sequence[str], units: Sequence[str], **given: Any) -> Any:
            stated = {key: given.pop(key) for key in ("direction", "force_sign", *keys)}
            stated["columns"] = _pairs(columns, "--column", "force=Kraft", known)
            stated["units"] = _pairs(units, "--unit", "force=kN", known)
            _check_amplitude(stated.get("amplitude"))
            return function(stated={key: value for key, value in stated.items() if value}, **given)

        return in_order(
            wrapped,
            click.argument("files", metavar="FILE...", nargs=-1, required=True, type=FILE, callback=_tests_alone),
            click.option("--direction", type=Direction(), help="axial, radial or torsion [names, columns]."),
            click.option(
                "--column",
                "columns",
                multiple=True,
                metavar="ROLE=HEADER",
                help=f'Such as "force=Fz", of files that have this header; may be given again. {roles}.',
            ),
            click.option(
                "--unit", "units", multiple=True, metavar="ROLE=UNIT", help='Such as "force=kN"; ROLEs as above.'
            ),
            click.option("--force-sign", type=int, help="-1: the load cell counts the other way."),
            *(
                click.option(option_of(key), type=int if key in _WHOLE_NUMBERS else None, help=words)
                for key, words in keys.items()
            ),
        )

    return decorate


def _tests_alone(_: click.Context, __: click.Parameter, files: tuple[Path, ...]) -> tuple[Path, ...]:
    """Refuse a campaign or a model among test files."""
    for file in files:
        if (found := _NO_TESTS.get(file.suffix.lower())) and file.is_file():
            hint = "bushfit diagnose looks at all tests of a campaign together; name its files, or their folder, here"
            raise MeasurementError("a test file is needed", file=file, found=found, expected="a table", hint=hint)
    return files


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
    """The error for a file, or a part of it, of a direction that nothing settles."""
    from bushfit.reading.instruments import word_for_part

    return MeasurementError(
        "nothing says in which direction this was tested",
        file=file,
        place=sheet and f'{word_for_part(file)} "{sheet}"',
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
