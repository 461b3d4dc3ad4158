"""Tables [[loops]] and [[sweeps]] of a campaign file: a test file, its missing information, and what was tested."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, ValidationInfo

from bushfit.caveat import Caveat
from bushfit.errors import CampaignError, error_location
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Direction, Place, Specimen
from bushfit.reading.headers import ERRORS, LOOP_COLUMNS, SWEEP_COLUMNS, AmplitudeConvention
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Floats, Source, Stepped, Waveform, rebuild_time
from bushfit.reading.preload import parse_preload
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

#: Keys of [[loops]] and [[sweeps]] that state which direction or specimen was tested.
PLACE_KEYS = ("direction", "specimen", "bushing")
#: Lists of tests in [simulate].
_LISTS = ("loops", "sweeps", "resonances", "validation")
#: Validator that replaces the direction "shear" of a specimen by None.
_SHEAR = converter(lambda raw, _: None if raw == "shear" else raw, {"enum": [*Direction, "shear"]})


def motion_quantity(suffix: str = "") -> BeforeValidator:
    """Return a validator that converts texts such as "0.1 mm" to m, rad or strain, depending on what was tested.

    `suffix` is appended to the unit: "/s" for a speed.
    """

    def convert(raw: Any, info: ValidationInfo) -> float:
        """SI value of a text, in the unit of the direction or specimen that the same table states."""
        direction = info.data.get("direction")
        motion = direction.motion if isinstance(direction, Place) else TRANSLATION
        return parse_quantity(raw, motion.displacement_unit + suffix)

    units = " or ".join(f"{motion.displacement_unit}{suffix}" for motion in (TRANSLATION, ROTATION, STRAINING))
    return converter(convert, text(f"a number with a unit of {units}, depending on the test"))


#: Amplitude of the motion of a test [m or rad, or strain].
Displacement = Annotated[float, motion_quantity(), Field(gt=0)]


def place_tested(test: Mapping[str, object], specimens: Sequence[Specimen]) -> Place:
    """Find the direction of the bushing, or the specimen, that was tested, from the keys of a test.

    Args:
        test: keys of the test; direction, specimen and bushing are used, and a missing key may be None.
        specimens: all specimens of the campaign.

    Returns:
        Direction of the bushing, or specimen; one direction of one of several bushings is a specimen.

    Raises:
        CampaignError: an unknown specimen or bushing, a test of a bushing without a direction, or a test of a specimen
            with a direction of the bushing.
    """
    direction, specimen, bushing = (test.get(key) for key in PLACE_KEYS)
    bushings = dict.fromkeys(place.body for place in specimens if place.axis)
    if bushing is not None or (bushings and specimen is None):
        if bushing not in bushings or specimen is not None:
            raise CampaignError(
                "the test names no bushing of the campaign" if specimen is None else "the test names two bodies",
                found=" and ".join(str(name) for name in (bushing, specimen) if name is not None) or "no bushing",
                expected="bushing = " + (" or ".join(f'"{name}"' for name in bushings) or "a name in [[bushings]]"),
            )
        specimens = [place for place in specimens if place.body == bushing]
    by_name = {place.name: place for place in specimens if not place.axis}
    if specimen is None:
        if isinstance(direction, str) and direction in [*Direction]:
            return next((place for place in specimens if place.axis == direction), Direction(direction))
        expected = "direction = " + " or ".join(f'"{choice}"' for choice in Direction)
        hint = f'or specimen = "{next(iter(by_name))}"' if by_name else None
        found = "none" if direction is None else str(direction)
        raise CampaignError("the direction of the test is not stated", found=found, expected=expected, hint=hint)
    if not isinstance(specimen, str) or specimen not in by_name:
        raise CampaignError(
            "this specimen is not in the campaign",
            found=str(specimen),
            expected="one of " + ", ".join(by_name) if by_name else "a [[specimens]] table with this name",
        )
    if direction not in (None, "shear"):
        raise CampaignError(**ERRORS["direction_of_specimen"], found=str(direction))
    return by_name[specimen]


def with_places(tables: Any, specimens: Sequence[Specimen]) -> Any:
    """Replace the texts that state what was tested by a direction or specimen, in all tests of a table [simulate].

    Args:
        tables: table [simulate] as parsed from TOML; a value that is no table is returned unchanged.
        specimens: all specimens of the campaign.

    Returns:
        Copy of the table, in whose tests the key "direction" contains a `Place` instead of the texts under the keys
        "direction", "specimen" and "bushing".

    Raises:
        CampaignError: the keys of a test do not name a direction or specimen.
    """

    def with_place(test: Any, place: str) -> Any:
        """Replace the keys of one test that state what was tested; `place` locates the test in errors."""
        if not isinstance(test, dict):
            return test
        with error_location(place=place):
            direction = place_tested(test, specimens)
        return {**{key: value for key, value in test.items() if key not in PLACE_KEYS}, "direction": direction}

    if not isinstance(tables, dict):
        return tables
    return {
        key: [with_place(test, f"{key} #{number}") for number, test in enumerate(table, 1)]
        if key in _LISTS and isinstance(table, list)
        else table
        for key, table in tables.items()
    }


def _roles(roles: Collection[str], value_name: str) -> BeforeValidator:
    """Make a validator of a table such as { force = "F1" }, which refuses keys that are not roles of columns.

    Args:
        roles: roles of columns that are valid keys, such as "force".
        value_name: description of the values for the JSON Schema, such as "unit".
    """
    written = {"properties": {role: text(f"{value_name} of {role.replace('_', ' ')}") for role in roles}}
    closed = {"type": "object", **written, "additionalProperties": False}

    def check_keys(raw: dict[str, Any]) -> dict[str, Any]:
        """Return the table unchanged if all its keys are roles."""
        for role in raw:
            if role not in roles:
                raise unknown_key(role, roles)
        return raw

    return table(check_keys, closed)


@dataclass(frozen=True)
class TestFile(FileFormat):
    """Keys that [[loops]] and [[sweeps]] have in common.

    Args:
        file: path of the test file, relative to the campaign file.
        direction: direction of the bushing; None for a specimen, or if the file states it.
        specimen: name of the specimen in [[specimens]]; default the bushing.
        bushing: name in [[bushings]] of the bushing, if the campaign has several.
        noise: relative standard deviation of a point; None if it is not known.
        weight: weight of the test in the fit, relative to the weight that its noise gives.
        temperature: temperature of the test [K]; it selects the rows of a file with several temperatures. Direction and
            specimen_number select rows too if a column states them.
        rows: text that the rows of the test must have in further columns, by header.
        order: number of the test in the session; default its position among all [[loops]], then all [[sweeps]].
        preload, date, operator, specimen_number: texts that are copied to the results.
    """

    __test__ = False

    file: Text
    direction: Annotated[Direction | None, _SHEAR] = None
    specimen: Name | None = None
    bushing: Name | None = None
    noise: Share | None = None
    weight: Annotated[float, Field(gt=0, le=1)] = 1.0
    temperature: Temperature | None = None
    rows: Mapping[str, str] = field(default_factory=dict)
    order: Count | None = None
    preload: Text | None = None
    date: Text | None = None
    operator: Text | None = None
    specimen_number: Text | None = None

    def properties(self, place: Place, sha256: str, degrees: Floats | None, notes: Iterable[Caveat]) -> dict[str, Any]:
        """Collect what the campaign states of a measured test, and its provenance.

        Args:
            place: direction of the bushing, or the specimen.
            sha256: SHA-256 of the file in hexadecimal digits.
            degrees: recorded temperatures [degC], (n,), whose mean is used if no temperature is stated; None if
                not recorded.
            notes: warnings on how the file was read.

        Returns:
            Noise, weight, preload, temperature [K] or None, and source, by the names of the fields of Loop and Sweep.
        """
        conditions = {key: getattr(self, key) for key in ("order", "preload", "date", "operator", "specimen_number")}
        temperature = self.temperature
        if temperature is None and degrees is not None:
            temperature = round(float(degrees.mean()), 2) + CELSIUS
        conditions["temperature_degC"] = None if temperature is None else round(temperature - CELSIUS, 6)
        present = {key: value for key, value in conditions.items() if value is not None}
        source = Source(Path(self.file), sha256, present, tuple(notes))
        stated = {"noise": self.noise, "weight": self.weight, "preload": parse_preload(self.preload, place)}
        return {**stated, "temperature": temperature, "source": source}


@dataclass(frozen=True)
class LoopFile(TestFile):
    """Table [[loops]]: a file and its missing information, for `loops.read_loop`.

    Args:
        columns: header or number of each column with an unusual name, by its role, such as force.
        units: units that the file does not state, by role.
        force_sign: -1 if the load cell has the opposite sign; default automatic.
        sampling_rate: sampling rate [Hz], for a file without time that does not state it.
        rate: speed [m/s or rad/s, or 1/s], for a file without time.
        frequency: frequency of the waveform [Hz], for a file without time.
        waveform: shape of the displacement over time, for a file without time.
    """

    columns: Annotated[Mapping[str, Text], _roles(LOOP_COLUMNS, "header")] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(LOOP_COLUMNS, "unit")] = field(default_factory=dict)
    force_sign: Literal[1, -1] | None = None
    sampling_rate: Frequency | None = None
    rate: Annotated[float, motion_quantity("/s"), Field(gt=0)] | None = None
    frequency: Frequency | None = None
    waveform: Waveform | None = None

    def __post_init__(self) -> None:
        is_incomplete = (self.frequency is None) != (self.waveform is None)
        if is_incomplete or sum(map(bool, (self.sampling_rate, self.rate, self.frequency))) > 1:
            keys = [key for key in ("sampling_rate", "rate", "frequency", "waveform") if getattr(self, key)]
            hint = 'state waveform = "sine" and frequency together' if self.frequency and is_incomplete else None
            raise ValueError(CampaignError(**ERRORS["no_time"], found=", ".join(keys), hint=hint))

    @property
    def states_time(self) -> bool:
        """True if a sampling rate, speed or frequency is stated, from which the time of each row can be rebuilt."""
        return bool(self.sampling_rate or self.rate or self.frequency)

    def rebuild_time(self, displacement: Floats) -> Floats:
        """Rebuild the time [s], (n,), of a file without time from its displacement [m or rad], (n,)."""
        if self.sampling_rate:
            return np.arange(displacement.size) / self.sampling_rate
        return rebuild_time(
            displacement, rate=self.rate, frequency=self.frequency, waveform=self.waveform or "triangle"
        )


@dataclass(frozen=True)
class ValidationFile(LoopFile):
    """Table [[validation]]: a file of displacement and force under any motion, and its missing information.

    Args:
        lowpass: cut-off frequency of a low-pass filter for the displacement [Hz], against noise; None for no filter.
    """

    lowpass: Frequency | None = None


@dataclass(frozen=True)
class SweepFile(TestFile):
    """Table [[sweeps]]: a file and its missing information, for `sweeps.read_sweep`.

    Args:
        columns: header or number of each column with an unusual name, by its role, such as force.
        units: units that the file does not state, by role.
        amplitude: convention of the amplitudes; default that of the header, else zero-to-peak.
        at_amplitude: amplitude of all rows with its unit, "0.1 mm" or "0.15 %", for a file without an amplitude column.
        at_frequency: frequency of all rows [Hz], for a file without a frequency column.
        stepped: quantity that changes from point to point of a run; default detected from the order of the rows.
        force_sign: -1 if the force has the opposite sign, which turns the phase by 180 deg; default automatic.
        phase_sign: -1 if the loss has the opposite sign, as the phase of the displacement relative to the force;
            default automatic.
    """

    columns: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS, "header")] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS, "unit")] = field(default_factory=dict)
    amplitude: AmplitudeConvention | None = None
    at_amplitude: Text | None = None
    at_frequency: Frequency | None = None
    stepped: Stepped | None = None
    force_sign: Literal[1, -1] | None = None
    phase_sign: Literal[1, -1] | None = None
