"""Simulated campaigns: the loops and sweeps that a rig would write for a known model.

They come from `rig`, which steps Eqs. (3) and (5) through time; the closed form that the fits use is not involved.
Noise is added as a rig has it: from point to point, and shared by a block (one repeat of one level).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.effects import BASE, effect_of
from bushfit.effects.contract import Array
from bushfit.errors import CampaignError, naming
from bushfit.geometry import Direction
from bushfit.model import rig
from bushfit.model.model import FIVE, Model
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reduction.programme import programme

if TYPE_CHECKING:
    from numpy.random import Generator

#: The paper's loop: 1 mm at 0.1 Hz.
PAPER_LOOPS = (SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=3),)
#: The paper's sweeps: 5 to 155 Hz at 0.1, 0.2 and 0.5 mm, in two directions.
PAPER_SWEEPS = tuple(
    SimulatedSweep(direction, (1e-4, 2e-4, 5e-4), tuple(float(f) for f in range(5, 156, 10)))
    for direction in (Direction.AXIAL, Direction.RADIAL)
)
#: Rows of a simulated loop in a cycle; chosen: its curve is smooth.
_ROWS_PER_CYCLE = 1000
#: Time steps of a simulated loop between two rows; the error of the time steps falls in proportion to them.
_STEPS_PER_ROW = 2
#: Time steps of a programme at most: they take seconds, and a gigabyte.
_MOST_STEPS = 10_000_000
#: Cycles before a loop is recorded, so that it has settled; none where an effect's settling is what there is to see.
_RUN_IN_CYCLES = 40


@dataclass(frozen=True, eq=False)
class Undisturbed:
    """What a rig without error writes.

    Args:
        truth: the model on the rig.
        loops: each planned loop and its record.
        sweeps: each planned sweep and its complex stiffness, (levels, frequencies).
    """

    truth: Model
    loops: tuple[tuple[SimulatedLoop, rig.Record], ...]
    sweeps: tuple[tuple[SimulatedSweep, Array], ...]


@dataclass(frozen=True, eq=False)
class Simulated:
    """A simulated campaign: the true model, the plan, and what the rig wrote."""

    truth: Model
    plan: SimulateSettings
    loops: tuple[Loop, ...]
    sweeps: tuple[Sweep, ...]

    def campaign(self) -> Campaign:
        """The measurements as a campaign in memory, without the truth."""
        bushing = self.truth.bushing
        name = self.truth.name
        loops = tuple(part for loop in self.loops for part in programme(loop))
        return Campaign(name, Path(name), bushing, loops, self.sweeps)


def model_of(campaign: Campaign) -> Model:
    """The model that a campaign's [simulate] table describes.

    Raises:
        CampaignError: no such table, or a parameter of the paper's five that has no value.
        ModelError: an unknown effect or an impossible value.
    """
    if campaign.simulate is None:
        raise CampaignError(
            "nothing says what to simulate",
            file=campaign.path,
            expected="a [simulate] table with parameters",
            hint="or fit the campaign first and simulate its model.json",
        )
    values = dict(campaign.simulate.parameters)
    missing = [name for name in FIVE if name not in values]
    if missing:
        raise CampaignError(
            "parameters without a value",
            file=campaign.path,
            place="[simulate.parameters]",
            found="no " + ", ".join(missing),
            expected="all of " + ", ".join(FIVE),
        )
    effects = campaign.simulate.effects
    own = {f"{effect}.{name}": value for effect, table in effects.items() for name, value in table.items()}
    with naming(campaign.path):
        return Model(campaign.bushing, (*BASE, *dict.fromkeys(map(effect_of, own))), {**values, **own})


def simulate(truth: Model, plan: SimulateSettings) -> Simulated:
    """Put a model on the virtual rig and measure it as planned; the same seed gives the same data.

    Args:
        truth: bushing and effects, those of the rig included.
        plan: tests, repeats, noise and seed; the paper's tests where it names none.
    """
    return measure(undisturbed(truth, plan), plan)


def undisturbed(truth: Model, plan: SimulateSettings, *, steps_per_cycle: int = rig.STEPS_PER_CYCLE) -> Undisturbed:
    """What the rig would write if it measured without error: the slow part of a simulation.

    Args:
        truth: bushing and effects.
        plan: the tests.
        steps_per_cycle: time steps of the sweeps; the rig's error falls in proportion to them.
    """
    tests = (plan.loops, plan.sweeps) if plan.loops or plan.sweeps else (PAPER_LOOPS, PAPER_SWEEPS)
    return Undisturbed(
        truth,
        tuple((test, _clean_loop(truth, test)) for test in tests[0]),
        tuple((test, _clean_sweep(truth, test, steps_per_cycle)) for test in tests[1]),
    )


def measure(clean: Undisturbed, plan: SimulateSettings) -> Simulated:
    """What the rig writes with the plan's noise, repeats and seed; quick, so that many seeds can be drawn."""
    random = np.random.default_rng(plan.seed)
    loops = tuple(_loop(test, force, number, plan, random) for number, (test, force) in enumerate(clean.loops, start=1))
    stems = [f"sweep_{test.direction}" for test, _ in clean.sweeps]
    names = [stem if stems.count(stem) == 1 else f"{stem}_{place}" for place, stem in enumerate(stems, start=1)]
    sweeps = tuple(
        _sweep(test, stiffness, name, plan, random) for name, (test, stiffness) in zip(names, clean.sweeps, strict=True)
    )
    return Simulated(clean.truth, plan, loops, sweeps)


def _clean_loop(truth: Model, test: SimulatedLoop) -> rig.Record:
    """The record of a loop or a programme without noise, `_ROWS_PER_CYCLE` rows a cycle of its highest frequency."""
    if len(test.parts) > 1:
        return _clean_programme(truth, test)
    measured = rig.record(
        truth,
        test.direction,
        test.frequency,
        test.amplitude,
        cycles=test.cycles,
        run_in=0 if any(effect.settles for effect in truth.records) else _RUN_IN_CYCLES,
        steps_per_cycle=_ROWS_PER_CYCLE * _STEPS_PER_ROW,
        waveform=test.waveform,
        kind="loop",
    )
    return _thinned(measured, _STEPS_PER_ROW)


def _clean_programme(truth: Model, test: SimulatedLoop) -> rig.Record:
    """The record of a programme from rest, without noise."""
    fastest = max(frequency for frequency, _ in test.parts)
    step = 1.0 / (fastest * _ROWS_PER_CYCLE * _STEPS_PER_ROW)
    duration = sum(test.cycles / frequency + test.pause for frequency, _ in test.parts)
    if duration > _MOST_STEPS * step:
        raise CampaignError(
            "a programme of loops is too long to simulate",
            place="simulate.loops",
            found=f"{duration:.3g} s at up to {fastest:.3g} Hz, {duration / step:.2g} steps",
            expected=f"no more than {_MOST_STEPS} steps, {_ROWS_PER_CYCLE * _STEPS_PER_ROW} a cycle of the fastest",
            hint="pause for less, or simulate slow and fast loops as programmes of their own",
        )
    rest = np.zeros(round(test.pause / step))
    motions = []
    for frequency, amplitude in test.parts:
        phase = np.arange(round(test.cycles / (frequency * step))) * (frequency * step)
        motions += [amplitude * rig.wave(test.waveform, phase), rest]
    whole = rig.imposed(truth, test.direction, np.concatenate([*motions[:-1], [0.0]]), step, test.parts[0][0])
    return _thinned(whole, _STEPS_PER_ROW)


def _thinned(record: rig.Record, every: int) -> rig.Record:
    """Every so many rows of a record."""
    return rig.Record(record.time[::every], record.displacement[::every], record.force[::every])


def _clean_sweep(truth: Model, test: SimulatedSweep, steps_per_cycle: int) -> Array:
    """Complex stiffness, (levels, frequencies)."""
    levels, steps = np.meshgrid(test.amplitudes, test.frequencies, indexing="ij")
    points = steps.ravel(), levels.ravel()
    return rig.dynamic_stiffness(truth, test.direction, *points, steps_per_cycle=steps_per_cycle).reshape(levels.shape)


def _loop(test: SimulatedLoop, clean: rig.Record, number: int, plan: SimulateSettings, random: Generator) -> Loop:
    largest = max(amplitude for _, amplitude in test.parts)
    return Loop(
        f"loop_{test.direction}_{number}",
        test.direction,
        clean.time,
        clean.displacement + plan.displacement_noise * largest * random.standard_normal(clean.time.size),
        clean.force + plan.force_noise * np.ptp(clean.force) / 2.0 * random.standard_normal(clean.time.size),
    )


def _sweep(test: SimulatedSweep, clean: Array, name: str, plan: SimulateSettings, random: Generator) -> Sweep:
    measured = np.stack([_with_noise(clean, plan, random) for _ in range(plan.repeats)], axis=1)
    axes = (test.amplitudes, np.arange(1, plan.repeats + 1), test.frequencies)
    level, repeat, frequency = (np.ravel(axis) for axis in np.meshgrid(*axes, indexing="ij"))
    return Sweep(name, test.direction, frequency, level, measured.ravel(), repeat)


def _with_noise(clean: Array, plan: SimulateSettings, random: Generator) -> Array:
    """One repeat of every level, (levels, frequencies): scatter of each point, gain and phase error of each block."""
    blocks = (clean.shape[0], 1)
    gain = plan.gain_error * random.standard_normal(blocks)
    phase = plan.phase_error * random.standard_normal(blocks)
    scatter = plan.noise * (random.standard_normal(clean.shape) + 1j * random.standard_normal(clean.shape))
    return clean * (1.0 + gain) * np.exp(1j * phase) * (1.0 + scatter)


def to_files(simulated: Simulated) -> dict[str, bytes]:
    """The campaign as files: CSVs, `campaign.toml` that names them, and `truth.json`, the model behind them."""
    from bushfit.model.file import to_document
    from bushfit.model.result import Result
    from bushfit.reading.csvfile import raw_loop_table, raw_sweep_table, to_csv

    files = {f"{loop.name}.csv": to_csv(raw_loop_table(loop)) for loop in simulated.loops}
    files |= {f"{sweep.name}.csv": to_csv(raw_sweep_table(sweep)) for sweep in simulated.sweeps}
    files["campaign.toml"] = _campaign_toml(simulated).encode()
    truth = Result(simulated.truth, warnings=("simulated: the values a rig simulation was given, not a fit",))
    files["truth.json"] = (json.dumps(to_document(truth), indent=1) + "\n").encode()
    return files


def _campaign_toml(simulated: Simulated) -> str:
    bushing, plan = simulated.truth.bushing, simulated.plan
    lines = [
        f"# Simulated by bushfit simulate with seed {plan.seed}: no rubber was tested. The model is in truth.json.",
    ]
    if bushing:
        lines += ["[bushing]", f"name = {json.dumps(bushing.name, ensure_ascii=False)}"]
        lines += [
            f'{key} = "{getattr(bushing, key) * 1e3:.6g} mm"' for key in ("inner_radius", "outer_radius", "length")
        ]
        lines += [f'shape = "{bushing.shape}"'] if bushing.shape != "paper" else []
    for kind, tests in (("loops", simulated.loops), ("sweeps", simulated.sweeps)):
        for test in tests:
            lines += ["", f"[[{kind}]]", f'file = "{test.name}.csv"', f'direction = "{test.direction}"']
    return "\n".join(lines) + "\n"
