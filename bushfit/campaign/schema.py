"""The tables of a campaign file, key by key: pydantic checks them, quantities become SI."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, ConfigDict, Field, InstanceOf

from bushfit.campaign.parameters import effect_values, parameter_settings, parameter_values
from bushfit.campaign.places import KEYS, with_places
from bushfit.campaign.quantities import (
    FIRST_ERROR,
    LARGEST_SHAKEN,
    SHAKEN,
    Angle,
    Count,
    Displacement,
    Frequencies,
    Frequency,
    Length,
    Share,
    Strain,
    Temperature,
    motion,
    si,
    table,
)
from bushfit.effects import is_parameter, parameter_names
from bushfit.effects.contract import Array
from bushfit.errors import CampaignError
from bushfit.geometry import TRANSLATION, Direction, Place, Shape, Specimen, SpecimenKind, StatedStrain
from bushfit.reading.headers import AmplitudeConvention
from bushfit.reading.layout import FileFormat
from bushfit.reading.measurement import Stepped, Waveform
from bushfit.reading.resonance import FEWEST_ROWS
from bushfit.reading.words import LOOP_COLUMNS, SWEEP_COLUMNS
from bushfit.validation import Flag, Name, Text, converted, known_keys, standing_in_table, unknown_key

#: What a sweep's residuals compare: real and imaginary part, or |K| and loss factor.
Residuals = Literal["complex", "magnitude_loss_factor"]
#: What is summed over the residuals: their squares, or soft_l1 with outliers left out.
Loss = Literal["linear", "soft_l1"]

#: [s] Pause in a simulated programme at most: a day is more than any rig rests between two loops.
_LONGEST_PAUSE = 86_400.0


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

    return table(check_keys)


#: Puts the direction or specimen itself into each test of [simulate].
_SIMULATED_PLACES = converted(
    lambda raw, info: with_places(raw, [Specimen(**vars(table)) for table in info.data.get("specimens", ())])
)


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
    area: Annotated[float, si("m^2"), Field(gt=0)] | None = None
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
        order: number of the test in the session; its place among all [[loops]], then all [[sweeps]], unless stated.
        preload, date, operator, specimen_number: carried on to results as they are written.
    """

    __test__ = False

    file: Text
    direction: Annotated[Direction | None, converted(lambda raw, _: None if raw == "shear" else raw)] = None
    specimen: Name | None = None
    noise: Share | None = None
    weight: Annotated[float, Field(gt=0, le=1)] = 1.0
    temperature: Temperature | None = None
    order: Count | None = None
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
    rate: Annotated[float, motion("/s"), Field(gt=0)] | None = None
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
class RigSettings:
    """[rig]: the class of the test machine, standard deviations of errors that all repeats of a test may share.

    Args:
        gain_error, displacement_error: of the force's and of the displacement's calibration, relative.
        phase_error: [rad].
    """

    gain_error: Share | None = None
    phase_error: Annotated[float, si("rad"), Field(ge=0)] | None = None
    displacement_error: Share | None = None

    @property
    def stated(self) -> tuple[float | None, float | None]:
        """Standard deviation of the stiffness in gain and phase, None where nothing is stated; K is force over
        displacement, so either calibration is a gain error of it."""
        gains = [error for error in (self.gain_error, self.displacement_error) if error is not None]
        return float(np.linalg.norm(gains)) if gains else None, self.phase_error


#: The class of a rig of which nothing is stated.
UNSTATED = RigSettings()


@dataclass(frozen=True)
class FitSettings:
    """[fit]: how the model is fitted.

    Args:
        dynamic_amplitudes: [m or rad] that fit-dynamic uses; none for the smallest.
        effects: added to the paper's model, such as "stiffness_factor.mount".
    """

    dynamic_amplitudes: Annotated[tuple[Annotated[float, si("m", "rad"), Field(gt=0)], ...], FIRST_ERROR] = ()
    residuals: Residuals = "complex"
    loss: Loss = "linear"
    effects: tuple[Text, ...] = ()
    parameters: Annotated[Mapping[str, ParameterSetting], table(parameter_settings)] = field(
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
    amplitudes: Annotated[tuple[Length, ...], FIRST_ERROR, Field(min_length=1)] | None = None
    torsion_amplitudes: Annotated[tuple[Angle, ...], FIRST_ERROR, Field(min_length=1)] | None = None
    directions: Annotated[tuple[Name, ...], FIRST_ERROR, Field(min_length=1)] | None = None
    strain_amplitudes: Annotated[tuple[Strain, ...], FIRST_ERROR, Field(min_length=1)] | None = None


@dataclass(frozen=True)
class SimulatedTest:
    """What [[simulate.loops]], [[simulate.sweeps]] and [[simulate.resonances]] say alike: what is tested, and at which
    temperature [K], where that is to be known."""

    direction: Annotated[Place, InstanceOf[Place]] = field(metadata=standing_in_table(lambda: KEYS))
    temperature: Temperature | None = field(default=None, kw_only=True)


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
    amplitudes: Annotated[tuple[Displacement, ...], FIRST_ERROR, Field(min_length=1)] = ()
    frequencies: Annotated[tuple[Frequency, ...], FIRST_ERROR, Field(min_length=1)] = ()
    pause: Annotated[float, si("s"), Field(ge=0, le=_LONGEST_PAUSE)] = 0.0

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

    amplitudes: Annotated[tuple[Displacement, ...], FIRST_ERROR, Field(min_length=1)]
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

    @property
    def points(self) -> tuple[Array, Array]:
        """Frequency [Hz] and amplitude [m or rad, or strain] of each point, (held, steps) each."""
        held, step = np.meshgrid(self.held, self.steps, indexing="ij")
        return (step, held) if self.stepped == "frequency" else (held, step)


@dataclass(frozen=True)
class SimulatedResonance(SimulatedTest):
    """[[simulate.resonances]]: a mass [kg] on the bushing, or on blocks in shear, whose base is shaken with a sine.

    `base_acceleration` is zero-to-peak [m/s^2], the same at all frequencies [Hz].
    """

    mass: Annotated[float, si("kg"), SHAKEN]
    base_acceleration: Annotated[float, si("m/s^2"), SHAKEN]
    frequencies: Frequencies

    def __post_init__(self) -> None:
        if self.direction.motion is not TRANSLATION:
            expected = "a direction with a displacement, or a specimen in shear"
            raise ValueError(CampaignError("no mass swings on this", found=str(self.direction), expected=expected))
        known = [f for f in self.frequencies if 1.0 / LARGEST_SHAKEN <= f <= LARGEST_SHAKEN]
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
        force_correlation: of the noise of one row's force with that of the next, as a filter makes it (AR(1)).
        gain_error: standard deviation of the gain of a run: of one repeat of what is held, or of a resonance test.
        phase_error: standard deviation of the phase of a run [rad].
        loops, sweeps, resonances: the tests; empty for the rig's own choice.
    """

    parameters: Annotated[Mapping[str, float], table(parameter_values)] = field(default_factory=dict)
    effects: Annotated[Mapping[str, Mapping[str, float]], table(effect_values)] = field(default_factory=dict)
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    repeats: Count = 1
    noise: Share = 0.0
    force_noise: Share = 0.0
    force_correlation: Share = 0.0
    displacement_noise: Share = 0.0
    gain_error: Share = 0.0
    phase_error: Annotated[float, si("rad"), Field(ge=0)] = 0.0
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
    rig: RigSettings = field(default_factory=RigSettings)
    fit: Annotated[FitSettings, table(_fit_table)] = field(default_factory=FitSettings)
    predict: PredictSettings = field(default_factory=PredictSettings)
    simulate: Annotated[SimulateSettings | None, _SIMULATED_PLACES] = None
