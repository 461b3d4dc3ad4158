"""The tables of a campaign file, key by key: pydantic checks them, quantities become SI."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field

from bushfit.errors import CampaignError, naming
from bushfit.geometry import TRANSLATION, Direction
from bushfit.reading.headers import AmplitudeConvention
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Waveform
from bushfit.reading.words import LOOP_COLUMNS, SWEEP_COLUMNS
from bushfit.units import quantity, temperature
from bushfit.validation import Flag, Name, Text, converted, known_keys, standing_in_table, unknown_key

#: What a sweep's residuals compare: real and imaginary part, or |K| and loss factor.
Residuals = Literal["complex", "magnitude_loss_factor"]
#: What is summed over the residuals: their squares, or soft_l1 with outliers left out.
Loss = Literal["linear", "soft_l1"]

#: Steps of a range of frequencies at most: more than any sweep has, and quick to predict.
_LARGEST_GRID = 100_000
#: Size of a plain number at most: no parameter comes near it, and its square is still finite.
_LARGEST_NUMBER = 1e100
#: Relative width by which a range of frequencies is widened, so that rounding does not drop its last step.
_ROUNDING = 1e-9
#: Repeats or cycles at most: more than any rig runs.
_LARGEST_COUNT = 1_000_000
#: Ends the check of a list at its first error: those of a hundred thousand would fill the memory.
_FIRST_ERROR = Field(fail_fast=True)
#: The second to the power of alpha, at the end of the unit of m.
_S_TO_ALPHA = re.compile(r"[\s*·]*s\s*(\^|\*\*)\s*alpha\s*$")


def _si(*units: str) -> BeforeValidator:
    """A validator that takes a text with any of these units, and gives SI."""
    return converted(lambda raw, _: quantity(raw, *units))


def _motion(per: str = "") -> BeforeValidator:
    """A validator as `_si("m")`, but for [rad] in a table whose direction is a rotation; with "/s" for a speed."""

    def unit(direction: object) -> str:
        return (direction.motion if isinstance(direction, Direction) else TRANSLATION).displacement_unit + per

    return converted(lambda raw, info: quantity(raw, unit(info.data.get("direction"))))


def _table(convert: Callable[[dict[str, Any]], Any]) -> BeforeValidator:
    """A validator that converts a table; what is none it leaves to pydantic."""
    return converted(lambda raw, _: convert(raw) if isinstance(raw, dict) else raw)


def _frequencies(raw: dict[str, Any]) -> list[str]:
    """A list of frequencies as texts from { start, stop, step }, with both ends."""
    expected = '{ start = "5 Hz", stop = "155 Hz", step = "10 Hz" }, or a list such as ["5 Hz", "15 Hz"]'
    if set(raw) != {"start", "stop", "step"}:
        raise CampaignError("this is no range of frequencies", found=str(raw), expected=expected)
    start, stop, step = (quantity(raw[key], "Hz") for key in ("start", "stop", "step"))
    if not (0.0 < start <= stop and step > 0.0 and (stop - start) / step < _LARGEST_GRID):
        raise CampaignError("this is no range of frequencies", found=str(raw), expected="0 < start <= stop, step > 0")
    count = int((stop - start) / step * (1.0 + _ROUNDING)) + 1
    return [f"{value!r} Hz" for value in (start + step * np.arange(count)).tolist()]


def _parameter_names() -> tuple[str, ...]:
    """Names of all parameters of the library; a stiffness factor may have other places than are listed."""
    from bushfit.effects import parameter_names

    return parameter_names()


def _is_parameter(name: str) -> bool:
    from bushfit.effects import is_parameter

    return is_parameter(name)


def parameter_value(place: str, name: str, raw: Any) -> float:
    """The SI value of a model parameter by its name in files; an error names the place.

    Ratios, and parameters of added effects, may be plain numbers.
    """
    from bushfit.effects import parameter_named

    with naming(place=place):
        if not _is_parameter(name):
            raise unknown_key(name, _parameter_names())
        unit = _S_TO_ALPHA.sub("", parameter_named(name).unit)
        is_number = isinstance(raw, int | float) and not isinstance(raw, bool)
        if is_number and (unit == "1" or "." in name) and abs(raw) <= _LARGEST_NUMBER:
            return float(raw)
        return quantity(_S_TO_ALPHA.sub("", raw) if name == "m" and isinstance(raw, str) else raw, unit)


def _parameters(raw: dict[str, Any]) -> dict[str, float]:
    """Values by parameter, in SI."""
    return {name: parameter_value(name, name, value) for name, value in raw.items()}


def _effects(raw: dict[str, Any]) -> dict[str, Any]:
    """Values by effect and parameter, in SI."""
    return {
        effect: {key: parameter_value(f"{effect}.{key}", f"{effect}.{key}", value) for key, value in table.items()}
        if isinstance(table, dict)
        else table
        for effect, table in raw.items()
    }


def _parameter_settings(raw: dict[str, Any]) -> dict[str, Any]:
    """Tables of value, min, max and vary by parameter, with the first three in SI."""
    settings = {}
    for name, table in raw.items():
        if isinstance(table, dict):
            given = [key for key in ("min", "value", "max") if key in table]
            numbers = {key: parameter_value(f"{name}.{key}", name, table[key]) for key in given}
            ordered = list(numbers.values())
            if ordered != sorted(ordered) or numbers.get("min", -np.inf) == numbers.get("max", np.inf):
                expected = "min below max, and value between them"
                raise CampaignError("these limits hold no value", place=name, found=str(table), expected=expected)
            table = {**table, **numbers}
        settings[name] = table
    return settings


def _fit_table(raw: dict[str, Any]) -> dict[str, Any]:
    """[fit] with its tables by parameter, such as [fit.mu] or [fit."inertia.mass"], under the key "parameters"."""
    if "parameters" in raw:
        raise unknown_key("parameters", known_keys(FitSettings))
    settings = {key: value for key, value in raw.items() if not _is_parameter(key)}
    return {**settings, "parameters": {key: value for key, value in raw.items() if key not in settings}}


def _roles(known: Collection[str]) -> BeforeValidator:
    """A validator that refuses other keys than these roles of columns."""

    def check_keys(raw: dict[str, Any]) -> dict[str, Any]:
        for role in raw:
            if role not in known:
                raise unknown_key(role, known)
        return raw

    return _table(check_keys)


Temperature = Annotated[float, converted(lambda raw, _: temperature(raw))]
Length = Annotated[float, _si("m"), Field(gt=0)]
Angle = Annotated[float, _si("rad"), Field(gt=0)]
Frequency = Annotated[float, _si("Hz"), Field(gt=0)]
Frequencies = Annotated[tuple[Frequency, ...], _FIRST_ERROR, _table(_frequencies), Field(min_length=1)]
Displacement = Annotated[float, _motion(), Field(gt=0)]
Share = Annotated[float, _si("1"), Field(ge=0, lt=1)]
Count = Annotated[int, Field(strict=True, ge=1, le=_LARGEST_COUNT)]


@dataclass(frozen=True)
class BushingTable:
    """[bushing]: geometry [m]."""

    name: Name
    inner_radius: Length
    outer_radius: Length
    length: Length


@dataclass(frozen=True)
class SpecimenTable:
    """[[specimens]]: another body of the same compound, and what its tests give. See geometry.Specimen."""

    name: Name
    kind: Literal["modulus", "shear"]
    strain: Literal["engineering", "tensor", "tension"] = "engineering"
    area: Annotated[float, _si("m^2"), Field(gt=0)] | None = None
    thickness: Length | None = None
    elements: Count = 1

    def __post_init__(self) -> None:
        if self.name in (*Direction, "loops", "sweeps", "gap", "candidates", "shear"):
            expected = "a name of its own: its tables are named after it"
            raise ValueError(CampaignError("this name is taken", place="name", found=self.name, expected=expected))


@dataclass(frozen=True)
class TestFile(FileFormat):
    """What [[loops]] and [[sweeps]] say alike: a file, what was tested in it, and under which conditions.

    Args:
        file: from the campaign's folder.
        direction: of the bushing, or "shear" of a specimen.
        specimen: by its name in [[specimens]]; the bushing unless stated.
        noise: relative standard deviation of a point, where it is known.
        weight: of the test in the fit, a share of the weight that its noise gives it.
        temperature: [K]; it selects the rows of a file that has several.
        preload, date, operator, specimen_number: carried on to results as they are written.
    """

    __test__ = False

    file: Text
    direction: Direction | Literal["shear"] | None = None
    specimen: Name | None = None
    noise: Share | None = None
    weight: Annotated[float, Field(gt=0, le=1)] = 1.0
    temperature: Temperature | None = None
    preload: Text | None = None
    date: Text | None = None
    operator: Text | None = None
    specimen_number: Text | None = None


@dataclass(frozen=True)
class LoopFile(TestFile):
    """[[loops]]: a file and what it does not say itself. See reading.read_loop."""

    columns: Annotated[Mapping[str, Text], _roles(LOOP_COLUMNS)] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(LOOP_COLUMNS)] = field(default_factory=dict)
    force_sign: Literal[1, -1] = 1
    rate: Annotated[float, _motion("/s"), Field(gt=0)] | None = None
    frequency: Frequency | None = None
    waveform: Waveform | None = None

    def __post_init__(self) -> None:
        if (self.frequency is None) != (self.waveform is None) or (self.rate and self.frequency):
            raise ValueError(
                CampaignError(
                    "these keys do not settle the time of a loop",
                    found=", ".join(key for key in ("rate", "frequency", "waveform") if getattr(self, key)),
                    expected='rate, or frequency and waveform ("sine" or "triangle") together',
                )
            )


@dataclass(frozen=True)
class SweepFile(TestFile):
    """[[sweeps]]: a file and what it does not say itself. See reading.read_sweep.

    Args:
        at_amplitude: of a file without a column for it, with its unit: "0.1 mm", "0.15 %".
        at_frequency: likewise [Hz].
    """

    columns: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS)] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS)] = field(default_factory=dict)
    amplitude: AmplitudeConvention | None = None
    at_amplitude: Text | None = None
    at_frequency: Frequency | None = None


@dataclass(frozen=True)
class ParameterSetting:
    """[fit.<parameter>]: start value and bounds [SI], None where the fit chooses; vary = False holds the value."""

    value: float | None = None
    min: float | None = None
    max: float | None = None
    vary: Flag = True


@dataclass(frozen=True)
class FitSettings:
    """[fit]: how the model is fitted.

    Args:
        dynamic_amplitudes: [m or rad] that fit-dynamic uses; none for the smallest.
        residuals: what a sweep's residuals compare.
        loss: what is summed over the residuals.
        effects: added to the paper's model, such as "stiffness_factor.mount".
        parameters: start value and bounds by parameter.
    """

    dynamic_amplitudes: Annotated[tuple[Annotated[float, _si("m", "rad"), Field(gt=0)], ...], _FIRST_ERROR] = ()
    residuals: Residuals = "complex"
    loss: Loss = "linear"
    effects: tuple[Text, ...] = ()
    parameters: Annotated[Mapping[str, ParameterSetting], _table(_parameter_settings)] = field(
        default_factory=dict, metadata=standing_in_table(_parameter_names)
    )


@dataclass(frozen=True)
class PredictSettings:
    """[predict]: frequencies [Hz], amplitudes [m], rotation amplitudes [rad] and directions; None for the default."""

    frequencies: Frequencies | None = None
    amplitudes: Annotated[tuple[Length, ...], _FIRST_ERROR, Field(min_length=1)] | None = None
    torsion_amplitudes: Annotated[tuple[Angle, ...], _FIRST_ERROR, Field(min_length=1)] | None = None
    directions: Annotated[tuple[Direction, ...], _FIRST_ERROR, Field(min_length=1)] | None = None


@dataclass(frozen=True)
class SimulatedLoop:
    """[[simulate.loops]]: zero-to-peak amplitude [m or rad], frequency [Hz], cycles and waveform."""

    direction: Direction
    amplitude: Displacement
    frequency: Frequency
    cycles: Count = 3
    waveform: Waveform = "sine"


@dataclass(frozen=True)
class SimulatedSweep:
    """[[simulate.sweeps]]: zero-to-peak amplitudes [m or rad] and frequencies [Hz], all combinations."""

    direction: Direction
    amplitudes: Annotated[tuple[Displacement, ...], _FIRST_ERROR, Field(min_length=1)]
    frequencies: Frequencies


@dataclass(frozen=True)
class SimulateSettings:
    """[simulate]: what the virtual rig tests, and how well it measures.

    Args:
        parameters: values by name [SI].
        effects: added effects, each with the values of its parameters [SI].
        seed: of the random numbers.
        repeats: of each sweep.
        noise: standard deviation of a sweep point's real and imaginary part, relative to |K|.
        force_noise, displacement_noise: standard deviation of a loop's samples, relative to the amplitude.
        gain_error: standard deviation of the gain of a block (one repeat of one level).
        phase_error: standard deviation of the phase of a block [rad].
        loops, sweeps: the tests; empty for the rig's own choice.
    """

    parameters: Annotated[Mapping[str, float], _table(_parameters)] = field(default_factory=dict)
    effects: Annotated[Mapping[str, Mapping[str, float]], _table(_effects)] = field(default_factory=dict)
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    repeats: Count = 1
    noise: Share = 0.0
    force_noise: Share = 0.0
    displacement_noise: Share = 0.0
    gain_error: Share = 0.0
    phase_error: Annotated[float, _si("rad"), Field(ge=0)] = 0.0
    loops: tuple[SimulatedLoop, ...] = ()
    sweeps: tuple[SimulatedSweep, ...] = ()


@dataclass(frozen=True)
class CampaignFile:
    """A whole campaign file."""

    __pydantic_config__ = ConfigDict(extra="forbid")

    bushing: BushingTable | None = None
    name: Name | None = None
    specimens: tuple[SpecimenTable, ...] = ()
    loops: tuple[LoopFile, ...] = ()
    sweeps: tuple[SweepFile, ...] = ()
    fit: Annotated[FitSettings, _table(_fit_table)] = field(default_factory=FitSettings)
    predict: PredictSettings = field(default_factory=PredictSettings)
    simulate: SimulateSettings | None = None
