"""Options for metadata that test files do not contain, and errors that name these options."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Literal

import click

from bushfit.cli.options import DIRECTIONS, FILE, Parameter, add_parameters, option, option_group, option_name
from bushfit.errors import BushfitError, MeasurementError

#: Options for metadata that a loop or sweep file may not contain: campaign key with its placeholder, and help text.
_OF_TESTS = {
    "amplitude COUNTING": "Meaning of the amplitudes in the file: zero-to-peak, peak-to-peak or rms [from the header].",
    "at_amplitude SIZE": 'Amplitude of the whole file, such as "0.1 mm" [from a column or the file name].',
    "at_frequency FREQUENCY": 'Frequency of the whole file, such as "10 Hz" [from a column or the file name].',
    "temperature TEMP": 'Temperature of the test, such as "23 degC". If the file has several, it selects the rows.',
    "preload LOAD": 'Static preload of the test, such as "500 N axial" or "none"; shown in the report.',
    **dict.fromkeys(("rate SPEED", "frequency FREQUENCY", "waveform WAVE")),
    "sampling_rate FREQUENCY": 'For a loop without time: speed ("10 mm/min"), frequency ("0.1 Hz") with waveform '
    "(sine, triangle), or sampling rate [from the file].",
    "specimen NAME": "Name of the specimen, if no bushing was tested [coupon, or bar for tension].",
    **dict.fromkeys(("area AREA", "thickness LENGTH")),
    "elements N": 'For a specimen of N rubber blocks in shear [1]: sheared area ("772 mm^2") and thickness ("6 mm") '
    "of one block.",
    "specimen_number NUMBER": "Serial number of the part. If the file has several parts, it selects the rows.",
}
#: Options for the file format: campaign key with its placeholder.
_AS_WRITTEN = ("encoding NAME", "delimiter WORD", "decimal MARK", "thousands MARK", "header_line LINE", "sheet NAME")
#: Descriptions of files that are not test files, by extension.
_NO_TESTS = {".toml": "a campaign or another TOML file", ".json": "a model or another JSON file"}
#: click types of the options by key; other options are texts.
TYPES: dict[str, "click.ParamType[Any]"] = {
    "direction": click.Choice(DIRECTIONS),
    "delimiter": click.Choice(["comma", "semicolon", "tab", "pipe", "caret", "blanks", ",", ";", "\t", "|", "^"]),
    "waveform": click.Choice(["sine", "triangle"]),
    "amplitude": click.Choice(["zero-to-peak", "peak-to-peak", "rms"]),
    **dict.fromkeys(("force_sign", "elements", "header_line"), click.INT),
}
_SAME_NAME = ("force_sign", *(usage.split()[0] for usage in (*_OF_TESTS, *_AS_WRITTEN)))
#: Keys of all metadata options, except columns and units.
STATED = ("direction", *_SAME_NAME)
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
    """
    unit, header = ("axial=mm", "radial=Sy") if kind == "displacements" else ("force=kN", "force=Fz")
    words = f'Header of a column, such as "{header}". An unknown ROLE prints all roles.'
    columns = (
        option("--unit units ROLE=UNIT", f'Unit of a column, such as "{unit}".', multiple=True),
        option("--column columns ROLE=HEADER", words, multiple=True),
    )
    written = map(_metadata_option, _AS_WRITTEN)
    record = "test_options", partial(_test_options, kind)
    file_format = option_group("File format, if it is not detected", *written, record=record)
    heading = "Information that is missing in the file"
    if kind == "displacements":
        return lambda function: add_parameters(function, option_group(heading, *columns, record=record), file_format)
    sign = "Reverse the sign of the force: use -1 if the force falls while the displacement rises."
    information = (
        _metadata_option("direction DIRECTION", "Direction: axial, radial or torsion [from file names]."),
        *columns,
        _metadata_option("force_sign SIGN", sign),
        *(_metadata_option(usage, words) for usage, words in _OF_TESTS.items() if kind == "tests"),
    )
    return lambda function: add_parameters(
        function,
        click.argument("files", metavar="FILE...", nargs=-1, required=True, type=FILE, callback=require_tests),
        option_group(f"{heading}s", *information, record=record),
        file_format,
    )


def _test_options(kind: str, _: click.Context, values: dict[str, Any]) -> dict[str, Any]:
    """Campaign keys that the metadata options state, with columns and units by the role of a column.

    Args:
        kind: kind of the files, as of `metadata_options`, which determines the roles.
        values: values of the options by key.
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


def _metadata_option(usage: str, words: str | None = None) -> Parameter:
    """Create the option of a campaign key from its name and placeholder (`usage`) and its help text (`words`)."""
    return option(option_name(usage), words, type=TYPES.get(usage.split()[0]))


def require_tests(context: click.Context, _: click.Parameter, value: Any) -> Any:
    """Callback for an argument of test files: raise a MeasurementError if a file is missing or not a test file."""
    from bushfit.reading.files import view_bytes

    files: Sequence[Path] = value if isinstance(value, tuple) else [value]
    for file in () if context.resilient_parsing else files:  # no error during shell completion
        if not os.path.exists(file):  # noqa: PTH110  # Path.exists raises an error for a name that is too long
            view_bytes(file, MeasurementError)
        if (found := _NO_TESTS.get(file.suffix.lower())) and file.is_file():
            hint = "bushfit diagnose looks at all tests of a campaign together; name its files, or their folder, here"
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
        named += [option_name(key) for key in _SAME_NAME if re.search(rf"\b{key} = ", keys)]
        if error.file is None and error.place in _SAME_NAME:
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
