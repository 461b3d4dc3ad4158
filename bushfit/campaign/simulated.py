"""Table [simulate] of a campaign file: tests, noise and errors of the virtual rig."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, InstanceOf, WithJsonSchema

from bushfit.campaign.quantities import convert_effect, parameter_value
from bushfit.effects.contract import Array
from bushfit.errors import CampaignError
from bushfit.geometry import TRANSLATION, Place
from bushfit.reading.measurement import Stepped, Waveform
from bushfit.reading.preload import Preload, parse_preload
from bushfit.reading.resonance import FEWEST_ROWS
from bushfit.reading.stated import PLACE_KEYS, Displacement
from bushfit.validation import (
    LARGEST_SHAKEN,
    SHAKEN,
    Frequencies,
    Frequency,
    ParameterValue,
    Repeats,
    Several,
    Share,
    Temperature,
    Text,
    inline_keys,
    si,
    table,
    tables,
)


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
    def parsed_preload(self) -> Preload | None:
        """Static displacement or force about which the test is made, parsed from `preload`; None if not stated."""
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
        """Frequency [Hz] and amplitude [m or rad, or strain] of each loop in the simulated record."""
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
        """Constant quantity of each run of the sweep: amplitudes [m or rad, or strain] or frequencies [Hz]."""
        return self.amplitudes if self.stepped == "frequency" else self.frequencies

    @property
    def steps(self) -> tuple[float, ...]:
        """Stepped quantity of every run of the sweep: frequencies [Hz] or amplitudes [m or rad, or strain]."""
        return self.frequencies if self.stepped == "frequency" else self.amplitudes

    @property
    def points(self) -> tuple[Array, Array]:
        """Frequency [Hz] and amplitude [m or rad, or strain] of each point of the sweep, (levels, steps) each."""
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
            raise ValueError(CampaignError("a mass needs a translation", found=str(self.direction), expected=expected))
        usable = [f for f in self.frequencies if 1.0 / LARGEST_SHAKEN <= f <= LARGEST_SHAKEN]
        if len(usable) < max(FEWEST_ROWS, len(self.frequencies)):
            expected = f"at least {FEWEST_ROWS}, from below to above the resonance"
            raise ValueError(CampaignError("too few frequencies", found=f"{len(usable)}", expected=expected))


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
            raise ValueError(CampaignError("these keys do not describe a motion", found=found, expected=expected))
        if min(np.diff(self.frequencies), default=self.motion == "sines") <= 0.0:
            raise ValueError(CampaignError("this is not a frequency band", expected="two or more, ascending"))


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
    effects: Annotated[Mapping[str, Mapping[str, ParameterValue]], tables(convert_effect)] = field(default_factory=dict)
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

    @property
    def effect_parameters(self) -> dict[str, float]:
        """Values of the parameters of the added effects [SI], by qualified name such as "inertia.mass"."""
        return {f"{effect}.{name}": value for effect, table in self.effects.items() for name, value in table.items()}
