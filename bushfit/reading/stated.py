"""The tables [[loops]] and [[sweeps]] of a campaign file: a file, what it does not say itself, and what was tested."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, ValidationInfo

from bushfit.errors import CampaignError, error_location
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Direction, Place, Specimen
from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS, AmplitudeConvention
from bushfit.reading.labelled import Rows
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Floats, Source, Stepped, Waveform, rebuild_time
from bushfit.units import CELSIUS, parse_quantity
from bushfit.validation import (
    Count,
    Frequency,
    Name,
    Share,
    Temperature,
    Text,
    converter,
    table,
    text,
    unknown_key,
)

#: Keys of a table that tell it.
PLACE_KEYS = ("direction", "specimen")
#: Lists of tests in [simulate].
_LISTS = ("loops", "sweeps", "resonances")
#: Takes the direction of a specimen for none.
_SHEAR = converter(lambda raw, _: None if raw == "shear" else raw, {"enum": [*Direction, "shear"]})


def motion_quantity(suffix: str = "") -> BeforeValidator:
    """Validator that converts a text to SI, with the unit of displacement of the table's direction or specimen.

    Args:
        suffix: of the SI unit, such as "/s" for a speed.

    Returns:
        Validator for values in m, rad or 1, times the suffix.
    """

    def convert(raw: Any, info: ValidationInfo) -> float:
        direction = info.data.get("direction")
        motion = direction.motion if isinstance(direction, Place) else TRANSLATION
        return parse_quantity(raw, motion.displacement_unit + suffix)

    units = " or ".join(f"{motion.displacement_unit}{suffix}" for motion in (TRANSLATION, ROTATION, STRAINING))
    return converter(convert, text(f"a number with a unit of {units}, by what is tested"))


#: Amplitude of the motion of a test.
Displacement = Annotated[float, motion_quantity(), Field(gt=0)]


def place_tested(specimen: object, direction: object, specimens: Sequence[Specimen]) -> Place:
    """The direction or the specimen that the two keys of a test mean.

    Raises:
        CampaignError: an unknown specimen, a bushing without a direction, or a specimen with one of the bushing's.
    """
    known = {specimen.name: specimen for specimen in specimens}
    if specimen is None:
        if isinstance(direction, str) and direction in [*Direction]:
            return Direction(direction)
        expected = "direction = " + " or ".join(f'"{choice}"' for choice in Direction)
        hint = f'or specimen = "{next(iter(known))}"' if known else None
        found = "none" if direction is None else str(direction)
        raise CampaignError("a test without a direction", found=found, expected=expected, hint=hint)
    if not isinstance(specimen, str) or specimen not in known:
        raise CampaignError(
            "this specimen is not in the campaign",
            found=str(specimen),
            expected="one of " + ", ".join(known) if known else "a [[specimens]] table with this name",
        )
    if direction not in (None, "shear"):
        expected = 'direction = "shear", or none: a specimen is tested in one way only'
        raise CampaignError("a specimen has no such direction", found=str(direction), expected=expected)
    return known[specimen]


def with_places(tables: Any, specimens: Sequence[Specimen]) -> Any:
    """A parsed [simulate] with the place itself for the keys that tell it; what is no table is left alone.

    Raises:
        CampaignError: as of `place_tested`.
    """

    def placed(test: Any, place: str) -> Any:
        if not isinstance(test, dict):
            return test
        with error_location(place=place):
            direction = place_tested(test.get("specimen"), test.get("direction"), specimens)
        return {**{key: value for key, value in test.items() if key not in PLACE_KEYS}, "direction": direction}

    if not isinstance(tables, dict):
        return tables
    return {
        key: [placed(test, f"{key} #{number}") for number, test in enumerate(table, 1)]
        if key in _LISTS and isinstance(table, list)
        else table
        for key, table in tables.items()
    }


def _roles(known: Collection[str], what: str) -> BeforeValidator:
    """A validator that refuses other keys than these roles of columns; `what` the file has of each."""
    written = {"properties": {role: text(f"{what} of {role.replace('_', ' ')}") for role in known}}
    closed = {"type": "object", **written, "additionalProperties": False}

    def check_keys(raw: dict[str, Any]) -> dict[str, Any]:
        for role in raw:
            if role not in known:
                raise unknown_key(role, known)
        return raw

    return table(check_keys, closed)


@dataclass(frozen=True)
class TestFile(FileFormat):
    """What [[loops]] and [[sweeps]] say alike: a file, what was tested in it, and under which conditions.

    Args:
        file: relative to the campaign file.
        direction: of the bushing; a specimen has none, which may be written "shear".
        specimen: by its name in [[specimens]]; the bushing unless stated.
        noise: relative standard deviation of a point, where it is known.
        weight: of the test in the fit, a share of the weight that its noise gives it.
        temperature: [K]; it selects the rows of a file that has several, as direction and specimen_number do where a
            column tells them.
        rows: that make the test: for columns by their headers, the text there.
        order: number of the test in the session; its place among all [[loops]], then all [[sweeps]], unless stated.
        preload, date, operator, specimen_number: carried on to results as they are written.
    """

    __test__ = False

    file: Text
    direction: Annotated[Direction | None, _SHEAR] = None
    specimen: Name | None = None
    noise: Share | None = None
    weight: Annotated[float, Field(gt=0, le=1)] = 1.0
    temperature: Temperature | None = None
    rows: Mapping[str, Text] = field(default_factory=dict)
    order: Count | None = None
    preload: Text | None = None
    date: Text | None = None
    operator: Text | None = None
    specimen_number: Text | None = None

    def source(self, sha256: str, temperature: float | None, notes: Iterable[str]) -> Source:
        """The provenance of the test: its file, and the conditions that results carry on, a temperature [K] in degC."""
        stated = {key: getattr(self, key) for key in ("order", "preload", "date", "operator", "specimen_number")}
        degrees = None if temperature is None else round(temperature - CELSIUS, 6)
        known = {key: each for key, each in {**stated, "temperature_degC": degrees}.items() if each is not None}
        return Source(Path(self.file), sha256, known, tuple(notes))

    def rows_of_test(self, *, shared: bool) -> Rows:
        """Selection of the rows that make the test; with `shared`, a column has to separate the tests of a file."""
        return Rows(self.direction, self.specimen_number, self.rows, shared)


@dataclass(frozen=True)
class LoopFile(TestFile):
    """[[loops]]: a file and what it does not say itself. See reading.read_loop.

    Args:
        columns: by their headers, where these are not the usual names.
        units: that the file does not carry.
        force_sign: -1 where the load cell counts the other way round.
        rate: of a file without time: speed of a triangle [m/s or rad/s].
        frequency: of a file without time, with waveform [Hz].
        waveform: of a file without time, with frequency.
    """

    columns: Annotated[Mapping[str, Text], _roles(LOOP_COLUMNS, "header")] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(LOOP_COLUMNS, "unit")] = field(default_factory=dict)
    force_sign: Literal[1, -1] = 1
    rate: Annotated[float, motion_quantity("/s"), Field(gt=0)] | None = None
    frequency: Frequency | None = None
    waveform: Waveform | None = None

    def __post_init__(self) -> None:
        if (self.frequency is None) != (self.waveform is None) or (self.rate and self.frequency):
            raise ValueError(
                CampaignError(
                    "these keys do not settle the time of a loop",
                    found=", ".join(key for key in ("rate", "frequency", "waveform") if getattr(self, key)),
                    expected='rate, or frequency and waveform ("sine" or "triangle") together',
                    hint='state waveform = "sine" beside it' if self.frequency and not self.rate else None,
                )
            )

    def clock(self, displacement: Floats) -> Floats:
        """Time of each row [s], (n,), of a file without it; its motion is a triangle unless stated."""
        return rebuild_time(
            displacement, rate=self.rate, frequency=self.frequency, waveform=self.waveform or "triangle"
        )


@dataclass(frozen=True)
class SweepFile(TestFile):
    """[[sweeps]]: a file and what it does not say itself. See reading.read_sweep.

    Args:
        columns: by their headers, where these are not the usual names.
        units: that the file does not carry.
        amplitude: how the file counts amplitudes; as its header says unless stated, else zero-to-peak.
        at_amplitude: of a file without a column for it, with its unit: "0.1 mm", "0.15 %".
        at_frequency: likewise [Hz].
        stepped: what was stepped while the other was held, where the order of the rows does not tell it.
        force_sign: -1 if the force counts the other way, which turns the phase by 180 deg; found in the phase unless
            stated.
        phase_sign: -1 if the loss counts the other way: as the phase of the displacement relative to the force; found
            in the values unless stated.
    """

    columns: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS, "header")] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS, "unit")] = field(default_factory=dict)
    amplitude: AmplitudeConvention | None = None
    at_amplitude: Text | None = None
    at_frequency: Frequency | None = None
    stepped: Stepped | None = None
    force_sign: Literal[1, -1] | None = None
    phase_sign: Literal[1, -1] | None = None
