"""The tables of a campaign file, key by key: pydantic checks them, quantities become SI."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field, InstanceOf, WithJsonSchema

from bushfit.campaign.bodies import BushingSettings, SeveralBushings, SpecimenSettings, specimens_of
from bushfit.campaign.quantities import (
    Compound,
    EffectsSettings,
    ReportSettings,
    effect_values,
    parameter_settings,
    parameter_value,
)
from bushfit.effects import is_parameter, parameter_names
from bushfit.effects.contract import Array
from bushfit.errors import CampaignError
from bushfit.geometry import TRANSLATION, Place
from bushfit.reading.measurement import Stepped, Waveform
from bushfit.reading.preload import Preload, parse_preload
from bushfit.reading.resonance import FEWEST_ROWS
from bushfit.reading.stated import PLACE_KEYS, Displacement, LoopFile, SweepFile, ValidationFile, with_places
from bushfit.validation import (
    LARGEST_SHAKEN,
    SHAKEN,
    Angle,
    Flag,
    Frequencies,
    Frequency,
    Length,
    Name,
    ParameterValue,
    Repeats,
    Several,
    Share,
    Strain,
    Temperature,
    Text,
    converter,
    inline_keys,
    known_keys,
    si,
    table,
    unknown_key,
)

#: Residuals of a sweep: differences of real and imaginary part, or of |K| and loss factor.
Residuals = Literal["complex", "magnitude_loss_factor"]
#: Loss function of the residuals: squares, or soft_l1 with outliers left out.
Loss = Literal["linear", "soft_l1"]


def _fit_table(raw: dict[str, Any]) -> dict[str, Any]:
    """Move the parameter tables of [fit], such as [fit.mu] or [fit."inertia.mass"], below the key "parameters"."""
    if "parameters" in raw:
        raise unknown_key("parameters", known_keys(FitSettings))
    settings = {key: value for key, value in raw.items() if not is_parameter(key)}
    return {**settings, "parameters": {key: value for key, value in raw.items() if key not in settings}}


#: Validator that replaces the name of a direction or specimen in each test of [simulate] by the object.
_SIMULATED_PLACES = converter(
    lambda raw, info: with_places(raw, specimens_of(info.data.get("bushings", ()), info.data.get("specimens", ())))
)


@dataclass(frozen=True)
class ParameterSetting:
    """[fit.<parameter>]: start value and bounds [SI]; None for the default.

    Args:
        value: start value of the fit, or fixed value.
        min, max: smallest and largest value.
        vary: false keeps the parameter fixed.
        equal: name of a parameter that this one is equal to.
        expression: expression of other parameters in SI units that gives the value, such as "0.5 * mu".
        prior: earlier knowledge, as value and standard deviation such as "0.24 +- 0.03", or the model file of an
            earlier fit to other tests.
    """

    value: ParameterValue | None = None
    min: ParameterValue | None = None
    max: ParameterValue | None = None
    vary: Flag = True
    equal: Text | None = None
    expression: Text | None = None
    prior: Text | None = None

    @property
    def tie(self) -> str | None:
        """Expression that gives the value; None for a parameter that is not tied."""
        return self.equal or self.expression


@dataclass(frozen=True)
class RigSettings:
    """[rig]: accuracy class and limits of the test machine; None if not stated.

    Args:
        gain_error, displacement_error: relative standard deviation of the calibration of force and of displacement,
            which all repeats of a test may share.
        phase_error: standard deviation of the phase [rad], which all repeats of a test may share.
        max_force, max_moment: largest zero-to-peak force or moment [N, N m].
        max_displacement, max_rotation: largest zero-to-peak displacement or rotation [m, rad].
        max_frequency: largest frequency [Hz].
        max_velocity: largest zero-to-peak velocity [m/s].
        minutes_per_point: time for a point of a sweep, with settling [s].
        minutes_per_setup: time to mount the bushing in another direction [s].
    """

    gain_error: Share | None = None
    phase_error: Annotated[float, si("rad"), Field(ge=0)] | None = None
    displacement_error: Share | None = None
    max_force: Annotated[float, si("N"), Field(gt=0)] | None = None
    max_moment: Annotated[float, si("N*m"), Field(gt=0)] | None = None
    max_displacement: Length | None = None
    max_rotation: Angle | None = None
    max_frequency: Frequency | None = None
    max_velocity: Annotated[float, si("m/s"), Field(gt=0)] | None = None
    minutes_per_point: Annotated[float, si("s"), Field(gt=0)] | None = None
    minutes_per_setup: Annotated[float, si("s"), Field(ge=0)] | None = None

    @property
    def stiffness_errors(self) -> tuple[float | None, float | None]:
        """Standard deviations of the stiffness in gain [1] and phase [rad]; None if the campaign does not state them.

        The gain error of K = F/x combines the calibrations of force and displacement.
        """
        gains = [error for error in (self.gain_error, self.displacement_error) if error is not None]
        return float(np.linalg.norm(gains)) if gains else None, self.phase_error


#: Settings of a rig if the campaign states nothing.
UNSTATED = RigSettings()


@dataclass(frozen=True)
class FitSettings:
    """Table [fit] of a campaign: settings of the fit.

    Args:
        dynamic_amplitudes: amplitudes [m or rad] that fit-dynamic uses; empty for the smallest.
        residuals: residuals of real and imaginary part, or of |K| and loss factor.
        loss: "linear" for least squares; "soft_l1" reduces the weight of distant points and leaves outliers out.
        effects: effects added to the paper's model, such as "stiffness_factor.mount".
        prior: model file of an earlier fit to other tests, whose values and covariance are a prior of all parameters
            that both fits have.
    """

    dynamic_amplitudes: Annotated[tuple[Annotated[float, si("m", "rad"), Field(gt=0)], ...], Field(fail_fast=True)] = ()
    residuals: Residuals = "complex"
    loss: Loss = "linear"
    effects: tuple[Text, ...] = ()
    prior: Text | None = None
    parameters: Annotated[Mapping[str, ParameterSetting], table(parameter_settings)] = field(
        default_factory=dict, metadata=inline_keys(parameter_names)
    )


@dataclass(frozen=True)
class PredictSettings:
    """[predict]: grid and directions of the prediction; None for the default.

    Args:
        frequencies: frequencies [Hz].
        amplitudes, torsion_amplitudes, strain_amplitudes: zero-to-peak displacements [m], rotations [rad], strains [1].
        directions: directions of the bushing, or names of specimens.
    """

    frequencies: Frequencies | None = None
    amplitudes: Several[Length] | None = None
    torsion_amplitudes: Several[Angle] | None = None
    directions: Several[Name] | None = None
    strain_amplitudes: Several[Strain] | None = None


@dataclass(frozen=True)
class SimulatedTest:
    """Common keys of [[simulate.loops]], [[simulate.sweeps]] and [[simulate.resonances]].

    Args:
        direction: direction of the bushing that is tested; for a specimen, none or "shear".
        specimen: name in [[specimens]] of the specimen that is tested in place of the bushing.
        bushing: name in [[bushings]] of the bushing that is tested, if there are several.
        temperature: temperature of the test [K]; None if not stated.
        preload: displacement or force about which the test is made, such as "500 N"; None if not stated.
    """

    direction: Annotated[Place, InstanceOf[Place], WithJsonSchema({"type": "string"})] = field(
        metadata=inline_keys(lambda: PLACE_KEYS)
    )
    temperature: Temperature | None = field(default=None, kw_only=True)
    preload: Text | None = field(default=None, kw_only=True)

    @property
    def static(self) -> Preload | None:
        """Preload of the test; None if not stated."""
        return parse_preload(self.preload, self.direction)


@dataclass(frozen=True)
class SimulatedLoop(SimulatedTest):
    """[[simulate.loops]]: one loop, or one record of several loops: all amplitudes in turn at each frequency.

    Args:
        amplitude: zero-to-peak amplitude [m or rad, or strain].
        frequency: frequency [Hz].
        cycles: number of cycles of each loop.
        waveform: waveform of the displacement.
        amplitudes: amplitudes of a record of several loops, in place of `amplitude`.
        frequencies: frequencies of a record of several loops [Hz], in place of `frequency`.
        pause: pause at zero displacement between two loops of a record [s].
    """

    amplitude: Displacement = 0.0
    frequency: Frequency = 0.0
    cycles: Repeats = 3
    waveform: Waveform = "sine"
    amplitudes: Several[Displacement] = ()
    frequencies: Several[Frequency] = ()
    pause: Annotated[float, si("s"), Field(ge=0, le=86_400.0)] = 0.0  # a day: no rig rests for longer

    def __post_init__(self) -> None:
        for one, several in (("amplitude", "amplitudes"), ("frequency", "frequencies")):
            stated_keys = [key for key in (one, several) if getattr(self, key)]
            if len(stated_keys) != 1:
                message = "these keys exclude each other" if stated_keys else "a key is missing"
                expected = f"{one} = ..., or {several} = [...] of a programme"
                raise ValueError(CampaignError(message, found=" and ".join(stated_keys) or None, expected=expected))

    @property
    def parts(self) -> list[tuple[float, float]]:
        """Frequency [Hz] and amplitude [m or rad, or strain] of each loop of the record."""
        amplitudes = self.amplitudes or (self.amplitude,)
        return [(frequency, size) for frequency in self.frequencies or (self.frequency,) for size in amplitudes]


@dataclass(frozen=True)
class SimulatedSweep(SimulatedTest):
    """[[simulate.sweeps]]: all combinations of amplitudes and frequencies.

    Args:
        amplitudes: zero-to-peak amplitudes [m or rad, or strain].
        frequencies: frequencies [Hz].
        stepped: quantity that changes from point to point of a run, frequency or amplitude; the other is constant.
        reached: standard deviation of the reached amplitude, relative to the requested amplitude.
        repeats: number of repeats of this sweep; None for `repeats` of [simulate].
    """

    amplitudes: Several[Displacement]
    frequencies: Frequencies
    stepped: Stepped = "frequency"
    reached: Share = 0.0
    repeats: Repeats | None = None

    @property
    def levels(self) -> tuple[float, ...]:
        """Constant quantity of each run: amplitudes [m or rad, or strain] or frequencies [Hz]."""
        return self.amplitudes if self.stepped == "frequency" else self.frequencies

    @property
    def steps(self) -> tuple[float, ...]:
        """Stepped quantity of a run: frequencies [Hz] or amplitudes [m or rad, or strain]."""
        return self.frequencies if self.stepped == "frequency" else self.amplitudes

    @property
    def points(self) -> tuple[Array, Array]:
        """Frequency [Hz] and amplitude [m or rad, or strain] of each point, (levels, steps) each."""
        level, step = np.meshgrid(self.levels, self.steps, indexing="ij")
        return (step, level) if self.stepped == "frequency" else (level, step)


@dataclass(frozen=True)
class SimulatedResonance(SimulatedTest):
    """[[simulate.resonances]]: a mass on the bushing, or on blocks in shear, whose base is shaken with a sine.

    Args:
        mass: mass on the bushing [kg].
        base_acceleration: zero-to-peak acceleration of the base, equal at all frequencies [m/s^2].
        frequencies: frequencies [Hz].
    """

    mass: Annotated[float, si("kg"), SHAKEN]
    base_acceleration: Annotated[float, si("m/s^2"), SHAKEN]
    frequencies: Frequencies

    def __post_init__(self) -> None:
        if self.direction.motion is not TRANSLATION:
            expected = "a direction with a displacement, or a specimen in shear"
            raise ValueError(CampaignError("this cannot carry a mass", found=str(self.direction), expected=expected))
        usable = [f for f in self.frequencies if 1.0 / LARGEST_SHAKEN <= f <= LARGEST_SHAKEN]
        if len(usable) < max(FEWEST_ROWS, len(self.frequencies)):
            expected = f"at least {FEWEST_ROWS}, through the resonance"
            raise ValueError(CampaignError("no frequencies of a shaker", found=f"{len(usable)}", expected=expected))


@dataclass(frozen=True)
class SimulatedRecord(SimulatedTest):
    """[[simulate.validation]]: a record of displacement and force under a motion from rest.

    Args:
        motion: "sines" adds a sine for each frequency; "random" has a spectral density that goes in straight lines over
            log f through the squares of the amplitudes; "road" has one that falls with the square of the frequency.
        frequencies: frequencies in ascending order [Hz]; of a random motion, the first and last are its band.
        amplitudes: zero-to-peak amplitude of each sine; for "random" relative amplitudes at the frequencies, as
            displacements; none for "road".
        rms: root mean square of a random or road-like displacement [m or rad, or strain].
        duration: duration [s].
    """

    motion: Literal["random", "sines", "road"]
    frequencies: Several[Frequency]
    amplitudes: Several[Displacement] = ()
    rms: Displacement | None = None
    duration: Annotated[float, si("s"), Field(gt=0, le=3600.0)] = 10.0

    def __post_init__(self) -> None:
        needed = 0 if self.motion == "road" else len(self.frequencies)
        if len(self.amplitudes) != needed or (self.rms is None) != (self.motion == "sines"):
            found = f"{len(self.amplitudes)} amplitudes, {'no' if self.rms is None else 'an'} rms"
            expected = "an amplitude for each frequency of sines and random, and rms for random and road"
            raise ValueError(CampaignError("these keys do not state a motion", found=found, expected=expected))
        if min(np.diff(self.frequencies), default=self.motion == "sines") <= 0.0:
            raise ValueError(CampaignError("these frequencies are no band", expected="two or more, in ascending order"))


@dataclass(frozen=True)
class SimulateSettings:
    """[simulate]: tests, noise and errors of the virtual rig.

    Args:
        parameters: parameter values by name [SI].
        effects: added effects, each with the values of its parameters [SI].
        seed: seed of the random numbers.
        repeats: repeats of each sweep and resonance test that does not state its own.
        noise: standard deviation of the real and imaginary part of a sweep point, relative to |K|, or of the
            transmissibility of a resonance test.
        force_noise, displacement_noise: standard deviation of a loop's samples, relative to the amplitude.
        force_correlation: correlation of the force noise between successive rows, as a filter causes it (AR(1)).
        gain_error: standard deviation of the relative gain of a run: one repeat of one level, or a resonance test.
        phase_error: standard deviation of the phase of a run [rad].
        level_gain_error: standard deviation of the relative gain that all repeats of a level share, or that applies to
            the record of a loop.
        level_phase_error: standard deviation of the phase that all repeats of a level share [rad].
        loops, sweeps, resonances: tests; without any, the tests of the paper.
        validation: validation records.
    """

    parameters: Annotated[
        Mapping[str, ParameterValue],
        table(lambda raw: {name: parameter_value(name, name, value) for name, value in raw.items()}),
    ] = field(default_factory=dict)
    effects: Annotated[Mapping[str, Mapping[str, ParameterValue]], table(effect_values)] = field(default_factory=dict)
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    repeats: Repeats = 1
    noise: Share = 0.0
    force_noise: Share = 0.0
    force_correlation: Share = 0.0
    displacement_noise: Share = 0.0
    gain_error: Share = 0.0
    phase_error: Annotated[float, si("rad"), Field(ge=0)] = 0.0
    level_gain_error: Share = 0.0
    level_phase_error: Annotated[float, si("rad"), Field(ge=0)] = 0.0
    loops: tuple[SimulatedLoop, ...] = ()
    sweeps: tuple[SimulatedSweep, ...] = ()
    resonances: tuple[SimulatedResonance, ...] = ()
    validation: tuple[SimulatedRecord, ...] = ()


@dataclass(frozen=True)
class CampaignFile:
    """A whole campaign file: a bushing, or specimens of a compound, and their tests. Quantities are texts with a unit.

    Args:
        bushing: geometry of the bushing.
        name: name of the campaign and its results folder; default the name of the bushing.
        bushings: several bushings of one compound, in place of `bushing`.
        specimens: other bodies of the same compound.
        loops: hysteresis loops.
        sweeps: stepped sines.
        validation: records of displacement and force under any motion, which are compared with the model and never
            fitted.
        simulate: tests and errors of the virtual rig, used only by bushfit simulate.
        rig: accuracy and limits of the test machine.
        compound: rubber of a bushing that was not tested yet.
        fit: settings of the fit.
        predict: grid and directions of the prediction.
        report: texts and logo in the head of the report.
        effects: an effect of the user's own.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    bushing: BushingSettings | None = None
    name: Name | None = None
    bushings: tuple[SeveralBushings, ...] = ()
    specimens: tuple[SpecimenSettings, ...] = ()
    loops: tuple[LoopFile, ...] = ()
    sweeps: tuple[SweepFile, ...] = ()
    validation: tuple[ValidationFile, ...] = ()
    rig: RigSettings = field(default_factory=RigSettings)
    compound: Compound | None = None
    fit: Annotated[FitSettings, table(_fit_table)] = field(default_factory=FitSettings)
    predict: PredictSettings = field(default_factory=PredictSettings)
    simulate: Annotated[SimulateSettings | None, _SIMULATED_PLACES] = None
    report: ReportSettings = field(default_factory=ReportSettings)
    effects: EffectsSettings | None = None
