"""Simulated measurements: tests of a known model with the noise of a rig, and gain and phase errors of its runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.session import planned_session
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulatedTest, SimulateSettings
from bushfit.caveat import Caveat
from bushfit.effects.contract import Array, RubberConditions
from bushfit.geometry import Specimen
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.reading.measurement import Loop, Source, Sweep
from bushfit.reading.resonance import ResonanceTest
from bushfit.reading.runs import runs_of
from bushfit.reading.tablefile import folder_name
from bushfit.reduction.programme import split_record
from bushfit.reduction.resonance import reduce_resonance
from bushfit.simulation.exact import ExactTests, simulate_exact

if TYPE_CHECKING:
    from numpy.random import Generator


@dataclass(frozen=True, eq=False)
class SimulatedData:
    """Simulated tests of a campaign with noise, and the true model, as `simulate` writes them to files.

    Args:
        truth: true model, with effects of the rig.
        plan: settings [simulate].
        loops, sweeps: simulated tests.
        resonances: mass [kg] and record of each resonance test.
        specimens: tested specimens.
        validation: validation records: motions that no fit uses.
    """

    truth: Model
    plan: SimulateSettings
    loops: tuple[Loop, ...]
    sweeps: tuple[Sweep, ...]
    resonances: tuple[tuple[float, ResonanceTest], ...] = ()
    specimens: tuple[Specimen, ...] = ()
    validation: tuple[Loop, ...] = ()

    @property
    def result(self) -> Result:
        """True model in the form of a fitted result, without uncertainty."""
        note = Caveat("simulated", "simulated: the values a rig simulation was given, not a fit")
        return Result(self.truth, warnings=(note,), specimens=self.specimens)

    def campaign(self) -> Campaign:
        """Convert the simulated tests to a campaign that can be fitted; resonance tests are reduced to sweeps."""
        reduced = tuple(reduce_resonance(test, mass).sweep for mass, test in self.resonances)
        bushing, name = self.truth.bushing, self.result.name
        loops = tuple(part for loop in self.loops for part in split_record(loop))
        tests = loops, self.sweeps + reduced, self.validation
        return Campaign(name, Path(name), bushing, *tests, specimens=self.specimens)


def simulate(truth: Model, plan: SimulateSettings) -> SimulatedData:
    """Simulate the tests of a campaign on the virtual rig, with noise; equal seeds give equal data.

    Args:
        truth: true model, including effects of the rig.
        plan: settings [simulate] with tests and noise; without tests, those of Garcia Tarrago et al. 2007.
    """
    return measure(simulate_exact(truth, plan), plan)


def measure(clean: ExactTests, plan: SimulateSettings) -> SimulatedData:
    """Add noise and repeats to tests that were simulated without errors.

    Args:
        clean: simulated tests without noise.
        plan: settings [simulate] with noise, repeats and seed.

    Returns:
        The simulated campaign.

    Notes:
        If a sweep does not reach its amplitudes, its stiffness is evaluated at the amplitude reached, as
        `simulation.exact` states. If the model depends on the order of the tests, the loops come first.
    """
    planned = [test for kind in (clean.loops, clean.sweeps, clean.resonances) for test, _ in kind]
    conditions = planned_session(clean.truth.bushing, planned, plan.repeats)[len(clean.loops) :]
    random, gains, loops = np.random.default_rng(plan.seed), dict[SimulatedLoop, float](), []
    for number, (loop, record) in enumerate(clean.loops, start=1):
        if loop not in gains:  # the gain error of each level, which its repeats share
            gains[loop] = 1.0 + plan.level_gain_error * random.standard_normal() if plan.level_gain_error else 1.0
        rows, largest = record.time.size, max(amplitude for _, amplitude in loop.parts)
        displacement = record.displacement + plan.displacement_noise * largest * random.standard_normal(rows)
        noise = _force_noise(record, plan, random)
        name, force = f"loop_{loop.direction}_{number}", gains[loop] * record.force + noise
        noisy = replace(record, name=name, displacement=displacement, force=force)
        loops.append(replace(noisy, temperature=loop.temperature, preload=loop.parsed_preload))
    named = zip(_test_names("sweep", [test for test, _ in clean.sweeps]), clean.sweeps, conditions, strict=False)
    sweeps = [
        _noisy_sweep(clean.truth, test, k, name, plan, random, conditions) for name, (test, k), conditions in named
    ]
    shaken = [resonance for resonance in clean.resonances for _ in range(plan.repeats)]
    resonances = []
    for name, (test, ratio) in zip(_test_names("resonance", [test for test, _ in shaken]), shaken, strict=True):
        frequency, measured = np.array(test.frequencies), _with_noise(ratio[None], plan, random)[0]
        base, source = np.full(ratio.shape, test.base_acceleration), Source(Path(f"{name}.csv"), "")
        resonances.append((test.mass, ResonanceTest(name, test.direction, frequency, measured, base, source)))
    records = []
    for name, (planned_record, record) in zip(_test_names("record", plan.validation), clean.validation, strict=True):
        force = record.force + _force_noise(record, plan, random)
        records.append(replace(record, name=name, force=force, temperature=planned_record.temperature))
    tested = (*planned, *plan.validation)
    specimens = dict.fromkeys(test.direction for test in tested if isinstance(test.direction, Specimen))
    tests = tuple(loops), tuple(sweeps), tuple(resonances)
    return SimulatedData(clean.truth, plan, *tests, tuple(specimens), tuple(records))


def _test_names(kind: str, tests: Sequence[SimulatedTest]) -> list[str]:
    """Names of tests and their files, from kind and direction or specimen, with a number where names are equal."""
    stems = [f"{kind}_{folder_name(str(test.direction))}" for test in tests]
    return [stem if stems.count(stem) == 1 else f"{stem}_{place}" for place, stem in enumerate(stems, start=1)]


def _noisy_sweep(
    truth: Model,
    test: SimulatedSweep,
    clean: Array,
    name: str,
    plan: SimulateSettings,
    random: Generator,
    conditions: RubberConditions,
) -> Sweep:
    """Add noise to all repeats of a sweep.

    Args:
        truth: true model.
        test: settings of the sweep.
        clean: exact complex stiffness [N/m or N m/rad], (levels, steps).
        name: name of the sweep.
        plan: settings [simulate] with the noise.
        random: random number generator.
        conditions: temperature and strain history of the rubber at the points.

    Notes:
        If the rig does not reach its amplitudes, amplitudes reached and requested have a lognormal ratio; half of its
        variance is common to all points at a frequency. All repeats of a level (the points at one constant amplitude or
        frequency) share a gain and a phase error. Amplitudes that are stepped through are computed from the amplitudes
        reached, as the reader of a file does.
    """
    repeats = test.repeats or plan.repeats
    shape = (len(test.levels), repeats, len(test.steps))
    frequency, level = (np.broadcast_to(values[:, None], shape).ravel() for values in test.points)
    repeat = np.broadcast_to(np.arange(1, repeats + 1)[:, None], shape).ravel()
    stiffness, reached = np.broadcast_to(clean[:, None], shape), None
    if test.reached:
        of_frequency = random.standard_normal(len(test.frequencies))
        of_frequency = of_frequency if test.stepped == "frequency" else of_frequency[:, None, None]
        ratios = np.exp(test.reached * np.sqrt(0.5) * (of_frequency + random.standard_normal(shape)))
        reached = level * ratios.ravel()
    if test.reached or truth.depends_on:
        planned, place = RubberConditions(test.temperature, preload=test.parsed_preload), test.direction
        ratio = stiffness.ravel() / truth.stiffness(place, frequency, level, conditions=planned)
        amplitude = level if reached is None else reached
        stiffness = (ratio * truth.stiffness(place, frequency, amplitude, conditions=conditions)).reshape(shape)
    if plan.level_gain_error or plan.level_phase_error:
        gain, phase = random.standard_normal((2, shape[0], 1, 1))
        stiffness = stiffness * (1.0 + plan.level_gain_error * gain) * np.exp(1j * plan.level_phase_error * phase)
    measured = np.stack([_with_noise(stiffness[:, number], plan, random) for number in range(repeats)], axis=1)
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
        preload=test.parsed_preload,
    )


def _force_noise(record: Loop, plan: SimulateSettings, random: Generator) -> Array:
    """Draw the noise of a recorded force [N or N m], (rows,), from a first-order autoregressive process, AR(1).

    Args:
        record: record without noise, whose force range scales the noise.
        plan: settings [simulate], with the noise and the correlation between successive rows.
        random: random number generator.
    """
    noise = random.standard_normal(record.time.size)
    if plan.force_correlation:
        from scipy.signal import lfilter

        noise[1:] *= np.sqrt(1.0 - plan.force_correlation**2)
        noise = lfilter([1.0], [1.0, -plan.force_correlation], noise)
    return plan.force_noise * np.ptp(record.force) / 2.0 * noise


def _with_noise(clean: Array, plan: SimulateSettings, random: Generator) -> Array:
    """Add a gain and a phase error to each run, and noise to each point, of a complex stiffness.

    Args:
        clean: exact complex stiffness [N/m or N m/rad], (runs, steps).
        plan: settings [simulate] with the noise.
        random: random number generator.
    """
    runs = (clean.shape[0], 1)
    gain = plan.gain_error * random.standard_normal(runs)
    phase = plan.phase_error * random.standard_normal(runs)
    scatter = plan.noise * (random.standard_normal(clean.shape) + 1j * random.standard_normal(clean.shape))
    return clean * (1.0 + gain) * np.exp(1j * phase) * (1.0 + scatter)
