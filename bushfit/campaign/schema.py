"""The tables of a campaign file, key by key: pydantic checks them, quantities become SI."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, InstanceOf

from bushfit.campaign.parameters import effect_values, parameter_settings, parameter_values
from bushfit.campaign.places import KEYS, with_places
from bushfit.effects import is_parameter, parameter_names
from bushfit.errors import CampaignError
from bushfit.geometry import TRANSLATION, Direction, Place, Shape, Specimen, SpecimenKind, StatedStrain
from bushfit.reading.headers import AmplitudeConvention
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Stepped, Waveform
from bushfit.reading.resonance import FEWEST_ROWS
from bushfit.reading.words import LOOP_COLUMNS, SWEEP_COLUMNS
from bushfit.units import quantity, temperature
from bushfit.validation import Flag, Name, Text, converted, known_keys, standing_in_table, unknown_key

#: What a sweep's residuals compare: real and imaginary part, or |K| and loss factor.
Residuals = Literal["complex", "magnitude_loss_factor"]
#: What is summed over the residuals: their squares, or soft_l1 with outliers left out.
Loss = Literal["linear", "soft_l1"]

#: Steps of a range of frequencies at most: more than any sweep has, and quick to predict.
_LARGEST_GRID = 100_000
#: Relative width by which a range of frequencies is widened, so that rounding does not drop its last step.
_ROUNDING = 1e-9
#: Repeats or cycles at most: more than any rig runs.
_LARGEST_COUNT = 1_000_000
#: Mass [kg], acceleration [m/s^2] and frequency [Hz] of a resonance test at most, and their inverse at least; chosen:
#: far beyond every shaker, and numbers stay finite.
_LARGEST_SHAKEN = 1e6
#: [s] Pause in a simulated programme at most: a day is more than any rig rests between two loops.
_LONGEST_PAUSE = 86_400.0
#: Ends the check of a list at its first error: those of a hundred thousand would fill the memory.
_FIRST_ERROR = Field(fail_fast=True)


def _si(*units: str) -> BeforeValidator:
    """A validator that takes a text with any of these units, and gives SI."""
    return converted(lambda raw, _: quantity(raw, *units))


def _motion(per: str = "") -> BeforeValidator:
    """A validator as `_si("m")`, but by the motion of the table's direction: [rad], or a strain; "/s" for a speed."""

    def unit(direction: object) -> str:
        return (direction.motion if isinstance(direction, Place) else TRANSLATION).displacement_unit + per

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


def _fit_table(raw: dict[str, Any]) -> dict[str, Any]:
    """[fit] with its tables by parameter, such as [fit.mu] or [fit."inertia.mass"], under the key "parameters"."""
    if "parameters" in raw:
        raise unknown_key("parameters", known_keys(FitSettings))
    settings = {key: value for key, value in raw.items() if not is_parameter(key)}
    return {**settings, "parameters": {key: value for key, value in raw.items() if key not in settings}}


def _roles(known: Collection[str]) -> BeforeValidator:
    """A validator that refuses other keys than these roles of columns."""

    def check_keys(raw: dict[str, Any]) -> dict[str, Any]:
        for role in raw:
            if role not in known:
                raise unknown_key(role, known)
        return raw

    return _table(check_keys)


#: Puts the direction or specimen itself into each test of [simulate].
_SIMULATED_PLACES = converted(
    lambda raw, info: with_places(raw, [Specimen(**vars(table)) for table in info.data.get("specimens", ())])
)
Temperature = Annotated[float, converted(lambda raw, _: temperature(raw))]
Length = Annotated[float, _si("m"), Field(gt=0)]
Angle = Annotated[float, _si("rad"), Field(gt=0)]
Strain = Annotated[float, _si("1"), Field(gt=0)]
Frequency = Annotated[float, _si("Hz"), Field(gt=0)]
Frequencies = Annotated[tuple[Frequency, ...], _FIRST_ERROR, _table(_frequencies), Field(min_length=1)]
Displacement = Annotated[float, _motion(), Field(gt=0)]
_SHAKEN = Field(ge=1.0 / _LARGEST_SHAKEN, le=_LARGEST_SHAKEN)
Share = Annotated[float, _si("1"), Field(ge=0, lt=1)]
Count = Annotated[int, Field(strict=True, ge=1, le=_LARGEST_COUNT)]


@dataclass(frozen=True)
class BushingTable:
    """[bushing]: geometry [m], and the radial formulas to go by."""

    name: Name
    inner_radius: Length
    outer_radius: Length
    length: Length
    shape: Shape = "paper"


@dataclass(frozen=True)
class SpecimenTable:
    """[[specimens]]: another body of the same compound, and what its tests give. See geometry.Specimen."""

    name: Name
    kind: SpecimenKind
    strain: StatedStrain = "engineering"
    area: Annotated[float, _si("m^2"), Field(gt=0)] | None = None
    thickness: Length | None = None
    elements: Count = 1

    def __post_init__(self) -> None:
        if self.name in (*Direction, "loops", "sweeps", "gap", "candidates", "measured", "shear"):
            expected = "a name of its own: its tables are named after it"
            raise ValueError(CampaignError("this name is taken", place="name", found=self.name, expected=expected))


@dataclass(frozen=True)
class TestFile(FileFormat):
    """What [[loops]] and [[sweeps]] say alike: a file, what was tested in it, and under which conditions.

    Args:
        direction: of the bushing; a specimen has none, which may be written "shear".
        specimen: by its name in [[specimens]]; the bushing unless stated.
        noise: relative standard deviation of a point, where it is known.
        weight: of the test in the fit, a share of the weight that its noise gives it.
        temperature: [K]; it selects the rows of a file that has several.
        preload, date, operator, specimen_number: carried on to results as they are written.
    """

    __test__ = False

    file: Text
    direction: Annotated[Direction | None, converted(lambda raw, _: None if raw == "shear" else raw)] = None
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
        stepped: what was stepped while the other was held, where the order of the rows does not tell it.
    """

    columns: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS)] = field(default_factory=dict)
    units: Annotated[Mapping[str, Text], _roles(SWEEP_COLUMNS)] = field(default_factory=dict)
    amplitude: AmplitudeConvention | None = None
    at_amplitude: Text | None = None
    at_frequency: Frequency | None = None
    stepped: Stepped | None = None


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
        effects: added to the paper's model, such as "stiffness_factor.mount".
    """

    dynamic_amplitudes: Annotated[tuple[Annotated[float, _si("m", "rad"), Field(gt=0)], ...], _FIRST_ERROR] = ()
    residuals: Residuals = "complex"
    loss: Loss = "linear"
    effects: tuple[Text, ...] = ()
    parameters: Annotated[Mapping[str, ParameterSetting], _table(parameter_settings)] = field(
        default_factory=dict, metadata=standing_in_table(parameter_names)
    )


@dataclass(frozen=True)
class PredictSettings:
    """[predict]: what to predict, and where; None for the default.

    Args:
        frequencies: [Hz].
        amplitudes, torsion_amplitudes, strain_amplitudes: zero-to-peak [m], [rad] and, of a modulus, [1].
        directions: of the bushing, or specimens by name.
    """

    frequencies: Frequencies | None = None
    amplitudes: Annotated[tuple[Length, ...], _FIRST_ERROR, Field(min_length=1)] | None = None
    torsion_amplitudes: Annotated[tuple[Angle, ...], _FIRST_ERROR, Field(min_length=1)] | None = None
    directions: Annotated[tuple[Name, ...], _FIRST_ERROR, Field(min_length=1)] | None = None
    strain_amplitudes: Annotated[tuple[Strain, ...], _FIRST_ERROR, Field(min_length=1)] | None = None


@dataclass(frozen=True)
class SimulatedTest:
    """What [[simulate.loops]], [[simulate.sweeps]] and [[simulate.resonances]] say alike: what is tested."""

    direction: Annotated[Place, InstanceOf[Place]] = field(metadata=standing_in_table(lambda: KEYS))


@dataclass(frozen=True)
class SimulatedLoop(SimulatedTest):
    """[[simulate.loops]]: zero-to-peak amplitude [m or rad, or strain], frequency [Hz], cycles and waveform.

    In place of one amplitude or one frequency a programme has amplitudes or frequencies: all amplitudes in turn at each
    frequency, `cycles` of each, recorded in one go from rest, with `pause` [s] at zero between them.
    """

    amplitude: Displacement = 0.0
    frequency: Frequency = 0.0
    cycles: Count = 3
    waveform: Waveform = "sine"
    amplitudes: Annotated[tuple[Displacement, ...], _FIRST_ERROR, Field(min_length=1)] = ()
    frequencies: Annotated[tuple[Frequency, ...], _FIRST_ERROR, Field(min_length=1)] = ()
    pause: Annotated[float, _si("s"), Field(ge=0, le=_LONGEST_PAUSE)] = 0.0

    def __post_init__(self) -> None:
        for one, several in (("amplitude", "amplitudes"), ("frequency", "frequencies")):
            given = [key for key in (one, several) if getattr(self, key)]
            if len(given) != 1:
                message = "one of these keys is too many" if given else "a key is missing"
                expected = f"{one} = ..., or {several} = [...] of a programme"
                raise ValueError(CampaignError(message, found=" and ".join(given) or None, expected=expected))

    @property
    def parts(self) -> list[tuple[float, float]]:
        """Frequency [Hz] and amplitude [m or rad] of each part of a programme; one of a single loop."""
        amplitudes = self.amplitudes or (self.amplitude,)
        return [(frequency, size) for frequency in self.frequencies or (self.frequency,) for size in amplitudes]


@dataclass(frozen=True)
class SimulatedSweep(SimulatedTest):
    """[[simulate.sweeps]]: all combinations of amplitudes, zero-to-peak [m or rad, or strain], and frequencies [Hz].

    Args:
        stepped: what changes from point to point of a run; the other is held.
        reached: standard deviation of the amplitude that a point really reached, relative to the one that was asked.
    """

    amplitudes: Annotated[tuple[Displacement, ...], _FIRST_ERROR, Field(min_length=1)]
    frequencies: Frequencies
    stepped: Stepped = "frequency"
    reached: Share = 0.0

    @property
    def held(self) -> tuple[float, ...]:
        """What the points of a run have in common: amplitudes [m or rad, or strain] or frequencies [Hz]."""
        return self.amplitudes if self.stepped == "frequency" else self.frequencies

    @property
    def steps(self) -> tuple[float, ...]:
        """What changes from point to point of a run: frequencies [Hz] or amplitudes [m or rad, or strain]."""
        return self.frequencies if self.stepped == "frequency" else self.amplitudes


@dataclass(frozen=True)
class SimulatedResonance(SimulatedTest):
    """[[simulate.resonances]]: a mass [kg] on the bushing, or on blocks in shear, whose base is shaken with a sine.

    `base_acceleration` is zero-to-peak [m/s^2], the same at all frequencies [Hz].
    """

    mass: Annotated[float, _si("kg"), _SHAKEN]
    base_acceleration: Annotated[float, _si("m/s^2"), _SHAKEN]
    frequencies: Frequencies

    def __post_init__(self) -> None:
        if self.direction.motion is not TRANSLATION:
            expected = "a direction with a displacement, or a specimen in shear"
            raise ValueError(CampaignError("no mass swings on this", found=str(self.direction), expected=expected))
        known = [f for f in self.frequencies if 1.0 / _LARGEST_SHAKEN <= f <= _LARGEST_SHAKEN]
        if len(known) < max(FEWEST_ROWS, len(self.frequencies)):
            expected = f"at least {FEWEST_ROWS}, through the resonance"
            raise ValueError(CampaignError("no frequencies of a shaker", found=f"{len(known)}", expected=expected))


@dataclass(frozen=True)
class SimulateSettings:
    """[simulate]: what the virtual rig tests, and how well it measures.

    Args:
        parameters: values by name [SI].
        effects: added effects, each with the values of its parameters [SI].
        seed: of the random numbers.
        repeats: of each sweep and resonance test.
        noise: standard deviation of a sweep point's real and imaginary part, relative to |K|; of a resonance test's
            transmissibility likewise.
        force_noise, displacement_noise: standard deviation of a loop's samples, relative to the amplitude.
        gain_error: standard deviation of the gain of a run: of one repeat of what is held, or of a resonance test.
        phase_error: standard deviation of the phase of a run [rad].
        loops, sweeps, resonances: the tests; empty for the rig's own choice.
    """

    parameters: Annotated[Mapping[str, float], _table(parameter_values)] = field(default_factory=dict)
    effects: Annotated[Mapping[str, Mapping[str, float]], _table(effect_values)] = field(default_factory=dict)
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    repeats: Count = 1
    noise: Share = 0.0
    force_noise: Share = 0.0
    displacement_noise: Share = 0.0
    gain_error: Share = 0.0
    phase_error: Annotated[float, _si("rad"), Field(ge=0)] = 0.0
    loops: tuple[SimulatedLoop, ...] = ()
    sweeps: tuple[SimulatedSweep, ...] = ()
    resonances: tuple[SimulatedResonance, ...] = ()


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
    simulate: Annotated[SimulateSettings | None, _SIMULATED_PLACES] = None
