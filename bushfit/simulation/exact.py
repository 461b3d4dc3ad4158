"""Tests of a known model on a rig without errors: loops, sweeps and resonance tests.

The virtual rig computes the tests in the time domain (Eqs. 3 and 5). The closed form of the fits is used only to
convert the results to nearby amplitudes: the ratio of the rig's stiffness to the closed form, within 0.1 % of 1, is
constant. The error is below 1e-5 at an amplitude 2 % away, and below 4e-5 at 10 %.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bushfit.campaign.session import planned_session
from bushfit.campaign.simulated import (
    SimulatedLoop,
    SimulatedRecord,
    SimulatedResonance,
    SimulatedSweep,
    SimulateSettings,
)
from bushfit.effects import Level, friction
from bushfit.effects.contract import Array, RubberConditions
from bushfit.effects.history import History
from bushfit.errors import CampaignError
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.progress import track
from bushfit.reading.measurement import Loop
from bushfit.reduction.resonance import shaken_response
from bushfit.simulation import rig

#: The paper's loop: 1 mm at 0.1 Hz.
PAPER_LOOPS = (SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=3),)
#: Frequencies of the paper's sweeps and tables [Hz].
PAPER_FREQUENCIES = tuple(float(f) for f in range(5, 156, 10))
#: Amplitudes of the paper's sweeps and tables [m].
PAPER_AMPLITUDES = (1e-4, 2e-4, 5e-4)
#: Sweeps of the paper, in two directions.
PAPER_SWEEPS = tuple(
    SimulatedSweep(direction, PAPER_AMPLITUDES, PAPER_FREQUENCIES) for direction in (Direction.AXIAL, Direction.RADIAL)
)
#: Rows of a simulated loop per cycle, and time steps per row.
_ROWS_PER_CYCLE, _STEPS_PER_ROW = 1000, 2
#: Rows per cycle of the fastest sine of a validation record, time steps per row, and share of its duration in which the
#: motion grows from rest.
_ROWS_PER_RECORD_CYCLE, _STEPS_PER_RECORD_ROW, _FADE_IN = 40, 10, 0.05
#: Maximum number of time steps of a programme; they take seconds and a gigabyte.
_MOST_STEPS = 10_000_000
#: Smallest and largest number of cycles before a loop is recorded in its steady state.
_LEAST_RUN_IN, _MOST_RUN_IN = 40, 300
#: Cycles of a preceding motion whose amplitude grows and decays, and its largest strain amplitude over eps_half. The
#: motion removes the mean force from the start if friction would keep the force longer than the largest run-in. It is
#: not used if parameters depend on the amplitude, which is the amplitude of the whole motion.
_SWELL_CYCLES, _SWELL_TO = 100, 0.3


@dataclass(frozen=True, eq=False)
class ExactTests:
    """Tests of a known model without noise and random errors, which `measure` adds.

    Args:
        truth: true model, including effects of the rig.
        loops: settings of each loop, with its record of time, displacement and force.
        sweeps: settings of each sweep, with its complex stiffness [N/m or N m/rad], (levels, steps).
        resonances: settings of each resonance test, with its complex transmissibility [-], (frequencies,).
        validation: settings of each validation record, with its time, displacement and force.
    """

    truth: Model
    loops: tuple[tuple[SimulatedLoop, Loop], ...]
    sweeps: tuple[tuple[SimulatedSweep, Array], ...]
    resonances: tuple[tuple[SimulatedResonance, Array], ...] = ()
    validation: tuple[tuple[SimulatedRecord, Loop], ...] = ()


def simulate_exact(truth: Model, plan: SimulateSettings, *, steps_per_cycle: int = rig.STEPS_PER_CYCLE) -> ExactTests:
    """Simulate the tests of a campaign without noise; this is the slow part of a simulation.

    Args:
        truth: true model, including effects of the rig.
        plan: settings [simulate] with the tests; without tests, those of Garcia Tarrago et al. 2007.
        steps_per_cycle: time steps per cycle of the sweeps; the error of the time integration is inversely
            proportional.

    Returns:
        The tests with their exact results.

    Raises:
        CampaignError: there are no tests, and no bushing for those of the paper.
        ModelError: a test is in a direction but there is no bushing, or an effect has no law in the time domain.
    """
    loops, sweeps, resonances = plan.loops, plan.sweeps, plan.resonances
    if not (loops or sweeps or resonances):
        if truth.bushing is None:
            raise CampaignError(
                "the tests to simulate are not stated",
                found="specimens alone",
                expected="a campaign with [[simulate.sweeps]] of a specimen; the paper's tests are those of a bushing",
            )
        loops, sweeps = PAPER_LOOPS, PAPER_SWEEPS
    conditions = planned_session(truth.bushing, [*loops, *sweeps, *resonances], plan.repeats)
    return ExactTests(
        truth,
        tuple(
            (test, _clean_loop(truth, test, conditions.select(0)))
            for test, conditions in track("loops simulated", list(zip(loops, conditions, strict=False)))
        ),
        tuple((test, _clean_sweep(truth, test, steps_per_cycle)) for test in track("sweeps simulated", sweeps)),
        tuple((test, _clean_resonance(truth, test, steps_per_cycle)) for test in resonances),
        tuple((test, _clean_record(truth, test, [plan.seed, number])) for number, test in enumerate(plan.validation)),
    )


def _clean_loop(truth: Model, test: SimulatedLoop, conditions: RubberConditions) -> Loop:
    """Simulate the record of a steady loop, or of a programme from rest, without noise, 1000 rows per cycle.

    Args:
        truth: true model, including effects of the rig.
        test: settings of the loop.
        conditions: temperature and earlier strains of the rubber.
    """
    motion, step, recorded = _programme(test) if len(test.parts) > 1 else _steady_loop(truth, test)
    frequency, rows = test.parts[0][0], slice(recorded, None, _STEPS_PER_ROW)
    return rig.simulate_motion(truth, test.direction, motion, step, frequency, rows=rows, conditions=conditions)


def _steady_loop(truth: Model, test: SimulatedLoop) -> tuple[Array, float, int]:
    """Motion of a loop from rest, with enough cycles before the record to make its friction steady.

    Args:
        truth: true model.
        test: settings of the loop.

    Returns:
        Displacement [m or rad], time step [s], and number of steps before the record.

    Notes:
        The mean friction stress from the start must decay to a thousandth. One cycle at a strain of eps_half/10 leaves
        95 % of the mean, one at eps_half/100 leaves 99.96 %. If this takes too many cycles, cycles of growing and
        decaying amplitude (Hann window) come first.
    """
    ((frequency, amplitude),) = test.parts
    run_in, swell_cycles, swell_factor = _LEAST_RUN_IN, 0, 1.0
    if truth.is_transient:
        run_in = 0
    elif "eps_half" in truth.values:
        strain = np.array(amplitude * truth.unit_strain(test.direction) / truth.values["eps_half"])
        cycles = -np.log(1e-3) / np.maximum(friction.mean_stress_decay(strain), np.finfo(float).tiny)
        if cycles > _LEAST_RUN_IN + _SWELL_CYCLES and not truth.structure.modifiers:
            swell_cycles, swell_factor = _SWELL_CYCLES, float(_SWELL_TO / strain)
        else:
            run_in = int(np.clip(np.ceil(cycles), _LEAST_RUN_IN, _MOST_RUN_IN))
    before, steps = swell_cycles + run_in, _ROWS_PER_CYCLE * _STEPS_PER_ROW
    phase = np.arange((before + test.cycles) * steps + 1) / steps
    motion = amplitude * rig.wave(test.waveform, phase)
    if swell_cycles:
        motion *= 1.0 + (swell_factor - 1.0) * np.sin(np.pi * np.minimum(phase / swell_cycles, 1.0)) ** 2
    return motion, 1.0 / (frequency * steps), before * steps


def _programme(test: SimulatedLoop) -> tuple[Array, float, int]:
    """Motion of a programme from rest: loops one after the other, with pauses.

    Returns:
        Displacement [m or rad], time step [s], and 0 steps before the record.
    """
    fastest = max(frequency for frequency, _ in test.parts)
    step = 1.0 / (fastest * _ROWS_PER_CYCLE * _STEPS_PER_ROW)
    duration = sum(test.cycles / frequency + test.pause for frequency, _ in test.parts)
    if duration > _MOST_STEPS * step:
        raise CampaignError(
            "a programme of loops is too long to simulate",
            place="simulate.loops",
            found=f"{duration:.3g} s at up to {fastest:.3g} Hz, {duration / step:.2g} steps",
            expected=f"no more than {_MOST_STEPS} steps ({_ROWS_PER_CYCLE * _STEPS_PER_ROW} per fastest cycle)",
            hint="use shorter pauses, or simulate slow and fast loops in separate programmes",
        )
    rest = np.zeros(round(test.pause / step))
    motions = []
    for frequency, amplitude in test.parts:
        phase = np.arange(round(test.cycles / (frequency * step))) * (frequency * step)
        motions += [amplitude * rig.wave(test.waveform, phase), rest]
    return np.concatenate([*motions[:-1], [0.0]]), step, 0


def _clean_record(truth: Model, test: SimulatedRecord, seed: list[int]) -> Loop:
    """Simulate a validation record from rest without noise, 40 rows and 400 time steps per cycle of its fastest sine.

    The motion fades in over the first twentieth of its duration, so that it begins without a step.

    Args:
        truth: true model, including effects of the rig.
        test: settings of the record.
        seed: seed of the random phases.
    """
    frequencies, random = np.array(test.frequencies), np.random.default_rng(seed)
    step = 1.0 / (frequencies[-1] * _ROWS_PER_RECORD_CYCLE * _STEPS_PER_RECORD_ROW)
    count = round(test.duration / (step * _STEPS_PER_RECORD_ROW)) * _STEPS_PER_RECORD_ROW + 1
    if count > _MOST_STEPS:
        raise CampaignError(
            "a validation record is too long to simulate",
            place="simulate.validation",
            found=f"{test.duration:.3g} s at up to {frequencies[-1]:.3g} Hz",
            expected=f"no more than {_MOST_STEPS} steps, {_ROWS_PER_RECORD_CYCLE * _STEPS_PER_RECORD_ROW} a cycle",
        )
    time = np.arange(count) * step
    if test.motion == "sines":
        phases = 2.0 * np.pi * random.random(frequencies.size)
        motion = np.zeros(count)
        for f, amplitude, phase in zip(frequencies, test.amplitudes, phases, strict=True):
            motion += amplitude * np.sin(2.0 * np.pi * f * time + phase)
    else:
        lines = np.fft.rfftfreq(count, step)
        inside = (lines >= frequencies[0]) & (lines <= frequencies[-1])
        sizes = 1.0 / frequencies if test.motion == "road" else np.array(test.amplitudes)
        spectrum = np.zeros(lines.size, dtype=complex)
        spectrum[inside] = np.exp(
            np.interp(np.log(lines[inside]), np.log(frequencies), np.log(sizes))
            + 2j * np.pi * random.random(inside.sum())
        )
        motion = np.fft.irfft(spectrum, count)
        motion *= (test.rms or 0.0) / np.std(motion)
    motion *= np.minimum(time / (_FADE_IN * test.duration), 1.0)
    frequency, rows = History.sampled(motion, step).frequency, slice(None, None, _STEPS_PER_RECORD_ROW)
    conditions = RubberConditions(test.temperature)
    return rig.simulate_motion(truth, test.direction, motion, step, frequency, rows=rows, conditions=conditions)


def _clean_sweep(truth: Model, test: SimulatedSweep, steps_per_cycle: int) -> Array:
    """Simulate the complex stiffness of a sweep without noise [N/m or N m/rad], (levels, steps).

    A level is a constant amplitude or frequency, at which the sweep steps through the other quantity.
    """
    points = (values.ravel() for values in test.points)
    conditions = RubberConditions(test.temperature, preload=test.parsed_preload)
    stiffness = rig.dynamic_stiffness(
        truth, test.direction, *points, steps_per_cycle=steps_per_cycle, conditions=conditions
    )
    return stiffness.reshape(len(test.levels), -1)


def _clean_resonance(truth: Model, test: SimulatedResonance, steps_per_cycle: int) -> Array:
    """Simulate the complex transmissibility of a resonance test without noise [-], (frequencies,).

    Notes:
        The closed form provides approximate amplitudes, for which the virtual rig computes the stiffness. Effects of
        the instrument are excluded: they belong to a test machine, not to a shaker.
    """
    mount, frequency = truth.without(Level.INSTRUMENT), np.array(test.frequencies)
    base = test.base_acceleration / (2.0 * np.pi * frequency) ** 2

    def closed_form_stiffness(amplitude: Array) -> Array:
        """Complex stiffness [N/m] by the model's closed form, at zero-to-peak deformations of the mount [m], (n,)."""
        return mount.stiffness(test.direction, frequency, amplitude)

    approximate, _ = shaken_response(closed_form_stiffness, test.mass, frequency, base)
    stiffness = rig.dynamic_stiffness(mount, test.direction, frequency, approximate, steps_per_cycle=steps_per_cycle)
    ratio: Array = stiffness / closed_form_stiffness(approximate)
    return shaken_response(lambda amplitude: ratio * closed_form_stiffness(amplitude), test.mass, frequency, base)[1]
