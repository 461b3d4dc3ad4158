"""Simulated measurements of a rig: noise of every point, and errors that the points of a run or of a level share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import SimulatedLoop, SimulatedResonance, SimulatedSweep, SimulatedTest, SimulateSettings
from bushfit.campaign.session import planned_session
from bushfit.effects.contract import Array, Circumstances
from bushfit.geometry import Specimen
from bushfit.model import rig
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.reading.measurement import Loop, Source, Sweep
from bushfit.reading.resonance import ResonanceTest
from bushfit.reading.runs import runs_of
from bushfit.reading.tablefile import folder_name
from bushfit.reduction.programme import programme
from bushfit.reduction.resonance import reduce_resonance
from bushfit.simulation.undisturbed import Undisturbed, near, undisturbed

if TYPE_CHECKING:
    from numpy.random import Generator


@dataclass(frozen=True, eq=False)
class Simulated:
    """A simulated campaign.

    Args:
        truth: true model.
        plan: settings of the simulation.
        loops, sweeps: simulated tests.
        resonances: mass [kg] and record of each resonance test.
        specimens: tested specimens.
    """

    truth: Model
    plan: SimulateSettings
    loops: tuple[Loop, ...]
    sweeps: tuple[Sweep, ...]
    resonances: tuple[tuple[float, ResonanceTest], ...] = ()
    specimens: tuple[Specimen, ...] = ()

    @property
    def result(self) -> Result:
        """True model as a result."""
        note = "simulated: the values a rig simulation was given, not a fit"
        return Result(self.truth, warnings=(note,), specimens=self.specimens)

    def campaign(self) -> Campaign:
        """Campaign with the tests; resonance tests are reduced to sweeps."""
        reduced = tuple(reduce_resonance(test, mass).sweep for mass, test in self.resonances)
        bushing, name = self.truth.bushing, self.result.name
        loops = tuple(part for loop in self.loops for part in programme(loop))
        return Campaign(name, Path(name), bushing, loops, self.sweeps + reduced, specimens=self.specimens)


def simulate(truth: Model, plan: SimulateSettings) -> Simulated:
    """Simulate the tests of a plan on the virtual rig.

    Args:
        truth: model, including effects of the rig.
        plan: settings; without tests, the tests of the paper are simulated. Equal seeds give equal data.
    """
    return measure(undisturbed(truth, plan), plan)


def measure(clean: Undisturbed, plan: SimulateSettings) -> Simulated:
    """Add the noise and repeats of a plan to undisturbed tests.

    Args:
        clean: tests without noise.
        plan: settings with noise, repeats and seed.

    Returns:
        The simulated campaign.

    Notes:
        If a sweep does not reach its amplitudes, its stiffness is evaluated at the amplitude reached (see `near`). If
        the model depends on the order of the tests, the loops come first.
    """
    planned = [test for kind in (clean.loops, clean.sweeps, clean.resonances) for test, _ in kind]
    under = planned_session(clean.truth.bushing, planned, plan.repeats)[len(clean.loops) :]
    named = zip(_names("sweep", [test for test, _ in clean.sweeps]), clean.sweeps, under, strict=False)
    random, gains = np.random.default_rng(plan.seed), dict[SimulatedLoop, float]()
    loops = tuple(
        _loop(test, force, number, plan, random, gains) for number, (test, force) in enumerate(clean.loops, start=1)
    )
    sweeps = tuple(
        _sweep(clean.truth, test, k, name, plan, random, circumstances) for name, (test, k), circumstances in named
    )
    shaken = [resonance for resonance in clean.resonances for _ in range(plan.repeats)]
    resonances = tuple(
        (test.mass, _resonance(test, ratio, name, plan, random))
        for name, (test, ratio) in zip(_names("resonance", [t for t, _ in shaken]), shaken, strict=True)
    )
    specimens = dict.fromkeys(test.direction for test in planned if isinstance(test.direction, Specimen))
    return Simulated(clean.truth, plan, loops, sweeps, resonances, tuple(specimens))


def _names(kind: str, tests: Sequence[SimulatedTest]) -> list[str]:
    """Names of the tests and their files: kind and direction or specimen, with a number if names are equal."""
    stems = [f"{kind}_{folder_name(str(test.direction))}" for test in tests]
    return [stem if stems.count(stem) == 1 else f"{stem}_{place}" for place, stem in enumerate(stems, start=1)]


def _loop(
    test: SimulatedLoop,
    clean: rig.Record,
    number: int,
    plan: SimulateSettings,
    random: Generator,
    gains: dict[SimulatedLoop, float],
) -> Loop:
    """Record of a loop; `gains` stores the gain error of each level, which its repeats share."""
    largest = max(amplitude for _, amplitude in test.parts)
    if test not in gains:
        gains[test] = 1.0 + plan.level_gain_error * random.standard_normal() if plan.level_gain_error else 1.0
    gain = gains[test]
    return Loop(
        f"loop_{test.direction}_{number}",
        test.direction,
        clean.time,
        clean.displacement + plan.displacement_noise * largest * random.standard_normal(clean.time.size),
        gain * clean.force
        + plan.force_noise * np.ptp(clean.force) / 2.0 * filtered_noise(clean.time.size, plan, random),
        temperature=test.temperature,
    )


def _sweep(
    truth: Model,
    test: SimulatedSweep,
    clean: Array,
    name: str,
    plan: SimulateSettings,
    random: Generator,
    under: Circumstances,
) -> Sweep:
    """All repeats of a sweep; for a stepped amplitude, with the levels that a reader determines."""
    plan = replace(plan, repeats=test.repeats or plan.repeats)
    shape = (len(test.levels), plan.repeats, len(test.steps))
    frequency, level = (np.broadcast_to(values[:, None], shape).ravel() for values in test.points)
    repeat = np.broadcast_to(np.arange(1, plan.repeats + 1)[:, None], shape).ravel()
    stiffness, reached = np.broadcast_to(clean[:, None], shape), None
    if test.reached:
        reached = level * amplitude_ratios(test, plan, random)
    if test.reached or truth.knows_circumstances:
        planned = frequency, level, stiffness.ravel(), Circumstances(test.temperature)
        nearby = near(truth, test.direction, *planned, under)
        stiffness = nearby(level if reached is None else reached).reshape(shape)
    stiffness = stiffness * level_errors(len(test.levels), plan, random)
    measured = np.stack([with_noise(stiffness[:, number], plan, random) for number in range(plan.repeats)], axis=1)
    if test.stepped == "amplitude" and reached is not None:
        level = runs_of(frequency, reached, repeat).amplitude
    return Sweep(
        name,
        test.direction,
        frequency,
        level,
        measured.ravel(),
        repeat,
        reached=reached,
        stepped=test.stepped,
        temperature=test.temperature,
    )


def _resonance(
    test: SimulatedResonance, clean: Array, name: str, plan: SimulateSettings, random: Generator
) -> ResonanceTest:
    """Record of one run with the gain and phase errors of its two accelerometers."""
    return ResonanceTest(
        name,
        test.direction,
        np.array(test.frequencies),
        with_noise(clean[None], plan, random)[0],
        np.full(clean.shape, test.base_acceleration),
        Source(Path(f"{name}.csv"), ""),
    )


def filtered_noise(rows: int, plan: SimulateSettings, random: Generator) -> Array:
    """Stationary noise of unit variance, as a first-order autoregressive process.

    Args:
        rows: number of rows.
        plan: settings with the correlation between neighbouring rows.
        random: generator.

    Returns:
        Noise [1], (rows,).
    """
    noise = random.standard_normal(rows)
    if not plan.force_correlation:
        return noise
    from scipy.signal import lfilter

    noise[1:] *= np.sqrt(1.0 - plan.force_correlation**2)
    return lfilter([1.0], [1.0, -plan.force_correlation], noise)


def with_noise(clean: Array, plan: SimulateSettings, random: Generator) -> Array:
    """Add noise to runs.

    Args:
        clean: complex stiffness, (runs, steps).
        plan: settings with the noise of points and the gain and phase errors of runs.
        random: generator.

    Returns:
        Complex stiffness with noise, (runs, steps).
    """
    runs = (clean.shape[0], 1)
    gain = plan.gain_error * random.standard_normal(runs)
    phase = plan.phase_error * random.standard_normal(runs)
    scatter = plan.noise * (random.standard_normal(clean.shape) + 1j * random.standard_normal(clean.shape))
    return clean * (1.0 + gain) * np.exp(1j * phase) * (1.0 + scatter)


def level_errors(levels: int, plan: SimulateSettings, random: Generator) -> Array:
    """Factors of the gain and phase errors that all repeats of a level share.

    Args:
        levels: number of levels.
        plan: settings with the errors.
        random: generator.

    Returns:
        Complex factors, (levels, 1, 1).
    """
    if not (plan.level_gain_error or plan.level_phase_error):
        return np.ones((levels, 1, 1))
    gain, phase = random.standard_normal((2, levels, 1, 1))
    return (1.0 + plan.level_gain_error * gain) * np.exp(1j * plan.level_phase_error * phase)


def amplitude_ratios(test: SimulatedSweep, plan: SimulateSettings, random: Generator) -> Array:
    """Ratios of the amplitude reached to the amplitude requested, lognormal.

    Args:
        test: sweep with the relative standard deviation `reached`; half of its variance is common to each frequency.
        plan: settings with the number of repeats.
        random: generator.

    Returns:
        (levels * repeats * steps,).
    """
    at_frequency = random.standard_normal(len(test.frequencies))
    at_frequency = at_frequency if test.stepped == "frequency" else at_frequency[:, None, None]
    at_point = random.standard_normal((len(test.levels), plan.repeats, len(test.steps)))
    return np.exp(test.reached * np.sqrt(0.5) * (at_frequency + at_point)).ravel()
