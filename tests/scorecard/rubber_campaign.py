"""Simulated campaigns of rubber that does not follow the package's laws, with and without faults of the rig."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from held_back_rubbers import HELD_BACK_RUBBERS
from numpy.random import Generator
from rubber_in_time import Array, StrainHistory, StressLaw
from time_rig import AXIAL, RADIAL, Bushing, Complex, first_harmonic
from working_rubbers import WORKING_RUBBERS

RUBBERS = WORKING_RUBBERS | HELD_BACK_RUBBERS
#: The bushing of every campaign: inner radius, outer radius and length [m].
BUSHING = Bushing(0.007, 0.016, 0.040)
#: Relative standard deviation of the gain that the points of a run share, and of every point; of a loop's force,
#: relative to half its range; of a loop's displacement, relative to its amplitude.
GAIN_ERROR, POINT_NOISE, FORCE_NOISE, DISPLACEMENT_NOISE = 0.003, 0.004, 0.005, 2e-4
#: Frequency of a loop [Hz].
LOOP_FREQUENCY = 0.1
#: Samples per cycle of sweeps and of loops, and cycles of a loop that starts from rest.
SWEEP_SAMPLES, LOOP_SAMPLES, LOOP_CYCLES = 256, 600, 3
#: Iterations for the displacement of a bushing on a compliant rig; each reduces the error 14-fold.
_ITERATIONS = 5

Fault = Literal["", "delay", "moving_mass", "compliance", "radial_factor"]

#: Effects of the package that describe a fault correctly.
CORRECT_NAMES: dict[Fault, tuple[str, ...]] = {
    "": (),
    "delay": ("delay",),
    "moving_mass": ("inertia",),
    "compliance": ("rig_compliance", "sleeve_compliance"),
    "radial_factor": ("stiffness_factor", "transducer_gain", "preload_stiffening"),
}
FAULTS = tuple(CORRECT_NAMES)


@dataclass(frozen=True)
class TestPlan:
    """Tests of a campaign.

    Args:
        frequencies: of the sweeps [Hz].
        axial: amplitudes of the axial sweeps [m].
        radial: amplitudes of the radial sweeps [m].
        loops: amplitudes of the axial loops at 0.1 Hz [m].
        steady_loops: True if a loop is one steady cycle; False if it starts from rest.
        repeats: of every sweep.
    """

    __test__ = False

    frequencies: Array
    axial: tuple[float, ...]
    radial: tuple[float, ...]
    loops: tuple[float, ...]
    steady_loops: bool
    repeats: int


#: Plans of a laboratory with a long, a usual and a short session.
PLANS = (
    TestPlan(np.arange(5.0, 156.0, 10.0), (5e-5, 1e-4, 2.5e-4, 5e-4), (2e-5, 5e-5, 1e-4), (1e-3,), True, 3),
    TestPlan(np.arange(5.0, 156.0, 10.0), (1e-4, 2e-4, 5e-4), (5e-5, 1e-4), (1e-3, 2e-3), False, 2),
    TestPlan(np.geomspace(1.0, 200.0, 12).round(1), (1e-4, 4e-4), (4e-5, 1.2e-4), (1e-3,), False, 1),
)


@dataclass(frozen=True)
class RubberCampaign:
    """A campaign and its noise-free truth.

    Args:
        rubber: key of RUBBERS.
        fault: of the rig.
        plan: index into PLANS.
        sweeps: direction -> rows of frequency [Hz], amplitude [m], real and imaginary stiffness [N/m] as measured.
        loops: rows of time [s], displacement [m], force [N] of every loop, and its amplitude [m].
        truth: direction -> rows as those of sweeps: stiffness of the bushing without rig and noise, on a grid.
    """

    rubber: str
    fault: Fault
    plan: int
    sweeps: dict[str, Array]
    loops: tuple[tuple[Array, float], ...]
    truth: dict[str, Array]


@dataclass(frozen=True)
class Rig:
    """Faults of a rig.

    Args:
        delay: of the force signal [s].
        mass: between bushing and load cell [kg].
        compliance: in series with the bushing [m/N].
        radial_factor: true radial stiffness over that of the formula; belongs to the bushing.
    """

    delay: float = 0.0
    mass: float = 0.0
    compliance: float = 0.0
    radial_factor: float = 1.0


def measure(law: StressLaw, rig: Rig, direction: str, motion: StrainHistory) -> Array:
    """Force over time at the load cell.

    Args:
        law: of the rubber.
        rig: and its faults.
        direction: "axial" or "radial".
        motion: displacement [m] in place of strain, (n, samples).

    Returns:
        Force [N], (n, samples), in the recording's time.
    """
    per_displacement = BUSHING.strain(direction)
    area = BUSHING.stiffness(direction) / (2.0 * per_displacement)
    factor = rig.radial_factor if direction == RADIAL else 1.0

    def bushing_force(displacement: Array) -> Array:
        return factor * area * law(StrainHistory(per_displacement * displacement, motion.step, motion.periodic))

    force = bushing_force(motion.strain)
    for _ in range(_ITERATIONS if rig.compliance else 0):
        force = bushing_force(motion.strain - rig.compliance * force)
    if rig.mass:
        acceleration = StrainHistory(
            StrainHistory(motion.strain, motion.step, motion.periodic).rate, motion.step, motion.periodic
        ).rate
        force = force + rig.mass * acceleration
    if rig.delay:
        force = _delayed(force, motion, rig.delay)
    return force


def _delayed(force: Array, motion: StrainHistory, delay: float) -> Array:
    """The force as recorded late by the delay [s]."""
    count = force.shape[1]
    samples = np.arange(count) - delay / motion.step
    period = count if motion.periodic else None
    rows = [np.interp(row, np.arange(count), wave, period=period) for row, wave in zip(samples, force, strict=True)]
    return np.array(rows)


def stiffness(law: StressLaw, rig: Rig, direction: str, frequency: Array, amplitude: Array) -> Complex:
    """Complex stiffness [N/m] by the first harmonics of displacement and force, (n,)."""
    phase = 2.0 * np.pi * np.arange(SWEEP_SAMPLES) / SWEEP_SAMPLES
    displacement = amplitude[:, None] * np.sin(phase)
    motion = StrainHistory(displacement, 1.0 / (SWEEP_SAMPLES * frequency[:, None]), periodic=True)
    return first_harmonic(measure(law, rig, direction, motion)) / first_harmonic(displacement)


def simulate_campaign(rubber: str, fault: Fault, seed: int) -> RubberCampaign:
    """Simulate the tests of one campaign.

    Args:
        rubber: key of RUBBERS.
        fault: of the rig, "" for none.
        seed: the same seed makes the same campaign.
    """
    random = np.random.default_rng([seed, 1967])
    law = RUBBERS[rubber](random)
    number = int(random.integers(len(PLANS)))
    plan = PLANS[number]
    rig = _faulty_rig(law, fault, plan, random)
    bushing_only = Rig(radial_factor=rig.radial_factor)
    amplitudes = {AXIAL: plan.axial, RADIAL: plan.radial}
    sweeps, truth = {}, {}
    for direction, levels in amplitudes.items():
        sweeps[direction] = _sweep(law, rig, direction, plan, levels, random)
        frequency, amplitude = (
            values.ravel()
            for values in np.meshgrid(
                np.geomspace(plan.frequencies[0], plan.frequencies[-1], 8).round(2),
                np.geomspace(levels[0], levels[-1], 5).round(7),
            )
        )
        clean = stiffness(law, bushing_only, direction, frequency, amplitude)
        truth[direction] = np.column_stack([frequency, amplitude, clean.real, clean.imag])
    loops = tuple((_loop(law, rig, plan, amplitude, random), amplitude) for amplitude in plan.loops)
    return RubberCampaign(rubber, fault, number, sweeps, loops, truth)


def _faulty_rig(law: StressLaw, fault: Fault, plan: TestPlan, random: Generator) -> Rig:
    """A rig with the fault, of a size that changes the stiffness by about 7 % where it is largest."""
    top = plan.frequencies[-1:]
    axial = float(np.abs(stiffness(law, Rig(), AXIAL, top, np.array([plan.axial[0]])))[0])
    radial = float(np.abs(stiffness(law, Rig(), RADIAL, top, np.array([plan.radial[0]])))[0])
    change, omega = 0.07 * random.uniform(0.8, 1.2), 2.0 * np.pi * float(top[0])
    return {
        "": Rig(),
        "delay": Rig(delay=change / omega),
        "moving_mass": Rig(mass=change * axial / omega**2),
        "compliance": Rig(compliance=0.07 / radial),
        "radial_factor": Rig(radial_factor=0.93),
    }[fault]


def _sweep(
    law: StressLaw, rig: Rig, direction: str, plan: TestPlan, levels: tuple[float, ...], random: Generator
) -> Array:
    """Rows of frequency, amplitude, real and imaginary stiffness with noise; repeats of a level follow each other."""
    frequency, amplitude = (values.ravel() for values in np.meshgrid(plan.frequencies, levels))
    clean = stiffness(law, rig, direction, frequency, amplitude)
    rows = []
    for level in range(len(levels)):
        points = slice(level * plan.frequencies.size, (level + 1) * plan.frequencies.size)
        for _ in range(plan.repeats):
            noise = random.standard_normal((2, plan.frequencies.size))
            error = GAIN_ERROR * random.standard_normal() + POINT_NOISE * (noise[0] + 1j * noise[1])
            measured = clean[points] * (1.0 + error)
            rows.append(np.column_stack([frequency[points], amplitude[points], measured.real, measured.imag]))
    return np.vstack(rows)


def _loop(law: StressLaw, rig: Rig, plan: TestPlan, amplitude: float, random: Generator) -> Array:
    """Rows of time, displacement and force of an axial loop at 0.1 Hz, three cycles, with noise."""
    step = 1.0 / (LOOP_FREQUENCY * LOOP_SAMPLES)
    samples = LOOP_SAMPLES if plan.steady_loops else LOOP_CYCLES * LOOP_SAMPLES
    displacement = amplitude * np.sin(2.0 * np.pi * np.arange(samples) / LOOP_SAMPLES)[None, :]
    force = measure(law, rig, AXIAL, StrainHistory(displacement, np.array([[step]]), plan.steady_loops))
    cycles = LOOP_CYCLES if plan.steady_loops else 1
    force, displacement = np.tile(force[0], cycles), np.tile(displacement[0], cycles)
    gain = 1.0 + GAIN_ERROR * random.standard_normal()
    force = gain * force + FORCE_NOISE * np.max(force) * random.standard_normal(force.size)
    displacement = displacement + DISPLACEMENT_NOISE * amplitude * random.standard_normal(displacement.size)
    start = LOOP_CYCLES / LOOP_FREQUENCY if plan.steady_loops else 0.0
    return np.column_stack([start + step * np.arange(force.size), displacement, force])


def write_campaign(campaign: RubberCampaign, folder: Path) -> None:
    """Write bushing.toml and one CSV file per test into a folder, without the truth."""
    folder.mkdir(parents=True, exist_ok=True)
    text = [
        "[bushing]",
        'name = "other rubber"',
        *(
            f'{key} = "{1e3 * value:g} mm"'
            for key, value in zip(
                ("inner_radius", "outer_radius", "length"), (BUSHING.inner, BUSHING.outer, BUSHING.length), strict=True
            )
        ),
    ]
    for number, (rows, _) in enumerate(campaign.loops, 1):
        name = f"loop_{number}.csv"
        text += ["", "[[loops]]", f'file = "{name}"', 'direction = "axial"']
        lines = ["time [s],displacement [mm],force [N]"]
        lines += [f"{time:.5f},{1e3 * shift:.6f},{force:.4f}" for time, shift, force in rows.tolist()]
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    repeats = PLANS[campaign.plan].repeats
    for direction, rows in campaign.sweeps.items():
        name = f"sweep_{direction}.csv"
        text += ["", "[[sweeps]]", f'file = "{name}"', f'direction = "{direction}"']
        lines = ["frequency [Hz],amplitude [mm],repeat,stiffness [N/mm],phase [deg]"]
        for index, (frequency, amplitude, real, imaginary) in enumerate(rows.tolist()):
            repeat = index // PLANS[campaign.plan].frequencies.size % repeats + 1
            value = complex(real, imaginary)
            magnitude, phase = 1e-3 * abs(value), np.degrees(np.angle(value))
            lines.append(f"{frequency:g},{1e3 * amplitude:.5g},{repeat},{magnitude:.6g},{phase:.4f}")
        (folder / name).write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "bushing.toml").write_text("\n".join(text) + "\n", encoding="utf-8")
