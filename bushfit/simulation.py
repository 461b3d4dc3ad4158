"""Simulated campaigns: the loops, sweeps and resonance tests that a rig would write for a known model.

They come from `rig`, which steps Eqs. (3) and (5) through time. The closed form that the fits use carries its results
from one amplitude to another near by, and no farther (see `_near`). Noise is added as a rig has it: from point to
point, and shared by a run, which is what was recorded in one go.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from typing_extensions import TypedDict

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.naming import folder_name
from bushfit.campaign.noise import filtered_noise, of_levels, reached_over_asked, with_noise
from bushfit.campaign.schema import SimulatedLoop, SimulatedResonance, SimulatedSweep, SimulatedTest, SimulateSettings
from bushfit.campaign.session import planned_session
from bushfit.campaign.written import body_lines, table_lines
from bushfit.effects import Level, friction
from bushfit.effects.contract import UNKNOWN, Array, Circumstances
from bushfit.errors import CampaignError, typed
from bushfit.geometry import Direction, Place, Specimen
from bushfit.model import rig
from bushfit.model.document import ModelFile
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.reading.measurement import Loop, Source, Sweep
from bushfit.reading.resonance import ResonanceTest
from bushfit.reading.runs import runs_of
from bushfit.reading.tablefile import Form, ending, to_bytes
from bushfit.reduction.programme import programme
from bushfit.reduction.resonance import reduce_resonance, response

if TYPE_CHECKING:
    from numpy.random import Generator

#: The paper's loop: 1 mm at 0.1 Hz.
PAPER_LOOPS = (SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=3),)
#: Frequencies of the paper's sweeps and tables [Hz].
PAPER_FREQUENCIES = tuple(float(f) for f in range(5, 156, 10))
#: Amplitudes of the paper's sweeps and tables [m].
PAPER_AMPLITUDES = (1e-4, 2e-4, 5e-4)
#: The paper's sweeps, in two directions.
PAPER_SWEEPS = tuple(
    SimulatedSweep(direction, PAPER_AMPLITUDES, PAPER_FREQUENCIES) for direction in (Direction.AXIAL, Direction.RADIAL)
)
#: Rows of a simulated loop in a cycle; chosen: its curve is smooth.
_ROWS_PER_CYCLE = 1000
#: Time steps of a simulated loop between two rows; the error of the time steps falls in proportion to them.
_STEPS_PER_ROW = 2
#: Time steps of a programme at most: they take seconds, and a gigabyte.
_MOST_STEPS = 10_000_000
#: Cycles before a loop is recorded, so that it has settled, at least and at most; none where an effect's settling is
#: what there is to see.
_RUN_IN_CYCLES = 40, 300
#: Share of the mean stress from the start that friction may keep when a loop is recorded: chosen, no test sees it.
_KEPT = 1e-3


class SimulationDocument(TypedDict):
    """A simulated campaign.

    Args:
        truth: the model behind it, as in truth.json.
        files: that were written, by name.
    """

    truth: ModelFile
    files: list[str]


@dataclass(frozen=True, eq=False)
class Undisturbed:
    """What a rig without error writes of a model.

    Args:
        loops: each planned loop and its record.
        sweeps: each planned sweep and its complex stiffness, (held, steps).
        resonances: each planned resonance test and its complex transmissibility, (frequencies,).
    """

    truth: Model
    loops: tuple[tuple[SimulatedLoop, rig.Record], ...]
    sweeps: tuple[tuple[SimulatedSweep, Array], ...]
    resonances: tuple[tuple[SimulatedResonance, Array], ...] = ()


@dataclass(frozen=True, eq=False)
class Simulated:
    """A simulated campaign: the true model, the plan, and what the rig wrote.

    `resonances` has the mass [kg] and the record of each resonance test; `specimens`, those that were tested.
    """

    truth: Model
    plan: SimulateSettings
    loops: tuple[Loop, ...]
    sweeps: tuple[Sweep, ...]
    resonances: tuple[tuple[float, ResonanceTest], ...] = ()
    specimens: tuple[Specimen, ...] = ()

    @property
    def result(self) -> Result:
        """The truth as a result."""
        said = "simulated: the values a rig simulation was given, not a fit"
        return Result(self.truth, warnings=(said,), specimens=self.specimens)

    def campaign(self) -> Campaign:
        """The measurements as a campaign in memory, without the truth; resonance tests are reduced to sweeps."""
        reduced = tuple(reduce_resonance(test, mass).sweep for mass, test in self.resonances)
        bushing, name = self.truth.bushing, self.result.name
        loops = tuple(part for loop in self.loops for part in programme(loop))
        return Campaign(name, Path(name), bushing, loops, self.sweeps + reduced, specimens=self.specimens)


def simulate(truth: Model, plan: SimulateSettings) -> Simulated:
    """Put a model on the virtual rig and measure it as planned; the same seed gives the same data.

    The model has the effects of the rig too; a plan that names no tests has those of the paper.
    """
    return measure(undisturbed(truth, plan), plan)


def undisturbed(truth: Model, plan: SimulateSettings, *, steps_per_cycle: int = rig.STEPS_PER_CYCLE) -> Undisturbed:
    """What the rig would write if it measured without error: the slow part of a simulation.

    Args:
        steps_per_cycle: time steps of the sweeps; the rig's error falls in proportion to them.

    Raises:
        CampaignError: no tests, and no bushing for the paper's.
        ModelError: a direction without a bushing, or one that cannot be tested.
    """
    loops, sweeps, resonances = plan.loops, plan.sweeps, plan.resonances
    if not (loops or sweeps or resonances):
        if truth.bushing is None:
            raise CampaignError(
                "nothing says what to test",
                found="specimens alone",
                expected="a campaign with [[simulate.sweeps]] of a specimen; the paper's tests are those of a bushing",
            )
        loops, sweeps = PAPER_LOOPS, PAPER_SWEEPS
    under = planned_session(truth.bushing, [*loops, *sweeps, *resonances], plan.repeats)
    return Undisturbed(
        truth,
        tuple((test, _clean_loop(truth, test, own.at(0))) for test, own in zip(loops, under, strict=False)),
        tuple((test, _clean_sweep(truth, test, steps_per_cycle)) for test in sweeps),
        tuple((test, _clean_resonance(truth, test, steps_per_cycle)) for test in resonances),
    )


def measure(clean: Undisturbed, plan: SimulateSettings) -> Simulated:
    """What the rig writes with the plan's noise, repeats and seed; quick, so that many seeds can be drawn.

    Notes:
        Where a sweep does not reach its amplitudes, the stiffness is that at the amplitude reached (see `_near`), and
        where it depends on the order of the tests, that at each point's turn: the plan's loops come first.
    """
    planned = [test for kind in (clean.loops, clean.sweeps, clean.resonances) for test, _ in kind]
    under = planned_session(clean.truth.bushing, planned, plan.repeats)[len(clean.loops) :]
    named = zip(_names("sweep", [test for test, _ in clean.sweeps]), clean.sweeps, under, strict=False)
    random, gains = np.random.default_rng(plan.seed), dict[SimulatedLoop, float]()
    loops = tuple(
        _loop(test, force, number, plan, random, gains) for number, (test, force) in enumerate(clean.loops, start=1)
    )
    sweeps = tuple(_sweep(clean.truth, test, k, name, plan, random, own) for name, (test, k), own in named)
    shaken = [each for each in clean.resonances for _ in range(plan.repeats)]
    resonances = tuple(
        (test.mass, _resonance(test, ratio, name, plan, random))
        for name, (test, ratio) in zip(_names("resonance", [t for t, _ in shaken]), shaken, strict=True)
    )
    specimens = dict.fromkeys(test.direction for test in planned if isinstance(test.direction, Specimen))
    return Simulated(clean.truth, plan, loops, sweeps, resonances, tuple(specimens))


def _names(kind: str, tests: Sequence[SimulatedTest]) -> list[str]:
    """A name for each test that is that of its file: by what was tested, with a number where several tests have one."""
    stems = [f"{kind}_{folder_name(str(test.direction))}" for test in tests]
    return [stem if stems.count(stem) == 1 else f"{stem}_{place}" for place, stem in enumerate(stems, start=1)]


def _clean_loop(truth: Model, test: SimulatedLoop, under: Circumstances) -> rig.Record:
    """The record of a loop or a programme without noise, `_ROWS_PER_CYCLE` rows a cycle of its highest frequency."""
    if len(test.parts) > 1:
        return _clean_programme(truth, test, under)
    measured = rig.record(
        truth,
        test.direction,
        test.frequency,
        test.amplitude,
        cycles=test.cycles,
        run_in=0 if any(effect.settles for effect in truth.records) else _run_in(truth, test),
        steps_per_cycle=_ROWS_PER_CYCLE * _STEPS_PER_ROW,
        waveform=test.waveform,
        kind="loop",
        under=under,
    )
    return _thinned(measured)


def _run_in(truth: Model, test: SimulatedLoop) -> int:
    """Cycles until friction forgets where it began; at a tenth of eps_half a cycle keeps 95 % of a mean stress."""
    if "eps_half" not in truth.values:
        return _RUN_IN_CYCLES[0]
    strain = np.array(test.amplitude * truth.unit_strain(test.direction))
    each = np.maximum(friction.forgotten(strain / truth.values["eps_half"]), np.finfo(float).tiny)
    return int(np.clip(np.ceil(-np.log(_KEPT) / each), *_RUN_IN_CYCLES))


def _clean_programme(truth: Model, test: SimulatedLoop, under: Circumstances) -> rig.Record:
    """The record of a programme from rest, without noise, all of it under what it begins under."""
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
    motion = np.concatenate([*motions[:-1], [0.0]])
    return _thinned(rig.imposed(truth, test.direction, motion, step, test.parts[0][0], under=under))


def _thinned(record: rig.Record) -> rig.Record:
    """One row of a record for so many time steps."""
    every = _STEPS_PER_ROW
    return rig.Record(record.time[::every], record.displacement[::every], record.force[::every])


def _clean_sweep(truth: Model, test: SimulatedSweep, steps_per_cycle: int) -> Array:
    """Complex stiffness, (held, steps)."""
    points = (values.ravel() for values in test.points)
    under = Circumstances(test.temperature)
    found = rig.dynamic_stiffness(truth, test.direction, *points, steps_per_cycle=steps_per_cycle, under=under)
    return found.reshape(len(test.held), -1)


def _clean_resonance(truth: Model, test: SimulatedResonance, steps_per_cycle: int) -> Array:
    """Complex transmissibility, (frequencies,), at the amplitudes that the mount reaches.

    Notes:
        The closed form tells where these amplitudes are about; the rig is asked there, and they are found again with
        its stiffness. Errors of the instrument are those of a test machine, which a shaker does not have.
    """
    mount, frequency = truth.without(Level.INSTRUMENT), np.array(test.frequencies)
    base = test.base_acceleration / (2.0 * np.pi * frequency) ** 2

    def closed(amplitude: Array) -> Array:
        return mount.stiffness(test.direction, frequency, amplitude)

    about, _ = response(closed, test.mass, frequency, base)
    stiffness = rig.dynamic_stiffness(mount, test.direction, frequency, about, steps_per_cycle=steps_per_cycle)
    return response(_near(mount, test.direction, frequency, about, stiffness), test.mass, frequency, base)[1]


def _near(
    truth: Model,
    place: Place,
    frequency: Array,
    amplitude: Array,
    stiffness: Array,
    known: Circumstances = UNKNOWN,
    wanted: Circumstances = UNKNOWN,
) -> Callable[[Array], Array]:
    """The rig's stiffness at amplitudes near those at which it is known, and under what is wanted: it changes as that
    of the closed form does.

    Notes:
        The rig is within 0.1 % of the closed form, and this ratio hardly changes with the amplitude: 2 % away the error
        is below 1e-5, and 10 % away below 4e-5, a tenth of the rig's own.
    """
    ratio = stiffness / truth.stiffness(place, frequency, amplitude, under=known)
    return lambda reached: ratio * truth.stiffness(place, frequency, reached, under=wanted)


def _loop(
    test: SimulatedLoop,
    clean: rig.Record,
    number: int,
    plan: SimulateSettings,
    random: Generator,
    gains: dict[SimulatedLoop, float],
) -> Loop:
    """One record; `gains` has those of the loops before, which their repeats share, and takes that of this loop."""
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
    """All repeats of a sweep; where the amplitude is stepped, with the levels that a reader finds in those reached."""
    plan = replace(plan, repeats=test.repeats or plan.repeats)
    shape = (len(test.held), plan.repeats, len(test.steps))
    frequency, level = (np.broadcast_to(values[:, None], shape).ravel() for values in test.points)
    repeat = np.broadcast_to(np.arange(1, plan.repeats + 1)[:, None], shape).ravel()
    stiffness, reached = np.broadcast_to(clean[:, None], shape), None
    if test.reached:
        reached = level * reached_over_asked(test, plan, random)
    if test.reached or truth.knows_circumstances:
        planned = frequency, level, stiffness.ravel(), Circumstances(test.temperature)
        near = _near(truth, test.direction, *planned, under)
        stiffness = near(level if reached is None else reached).reshape(shape)
    stiffness = stiffness * of_levels(len(test.held), plan, random)
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
    """One run, with the gain and phase of its two accelerometers."""
    return ResonanceTest(
        name,
        test.direction,
        np.array(test.frequencies),
        with_noise(clean[None], plan, random)[0],
        np.full(clean.shape, test.base_acceleration),
        Source(Path(f"{name}.csv"), ""),
    )


def to_files(simulated: Simulated, form: Form = "csv") -> dict[str, bytes]:
    """The campaign as files: tables, `campaign.toml` that names them, and `truth.json`, the model behind them.

    A resonance test is what `bushfit reduce` takes; `campaign.toml` says how.
    """
    from bushfit.model.file import to_document
    from bushfit.reading.rawtable import raw_loop_table, raw_resonance_table, raw_sweep_table

    tables = {
        **{loop.name: raw_loop_table(loop) for loop in simulated.loops},
        **{sweep.name: raw_sweep_table(sweep) for sweep in simulated.sweeps},
        **{test.name: raw_resonance_table(test) for _, test in simulated.resonances},
    }
    return {
        **{f"{name}.{ending(form)}": to_bytes(name, table, form) for name, table in tables.items()},
        "campaign.toml": _campaign_toml(simulated, form).encode(),
        "truth.json": (json.dumps(to_document(simulated.result), indent=1) + "\n").encode(),
    }


def _campaign_toml(simulated: Simulated, form: Form) -> str:
    seed, end = simulated.plan.seed, ending(form)
    lines = [f"# Simulated by bushfit simulate with seed {seed}: no rubber was tested. The model is in truth.json."]
    lines += body_lines(simulated.truth.bushing, simulated.specimens)
    plan = simulated.plan
    if plan.level_gain_error or plan.level_phase_error:  # which no repeat shows, so that a fit has to be told
        errors = {"gain_error": (plan.level_gain_error, "1"), "phase_error": (plan.level_phase_error, "rad")}
        lines += ["", "[rig]", *(f'{key} = "{size:.6g} {unit}"' for key, (size, unit) in errors.items())]
    for kind, tests in (("loops", simulated.loops), ("sweeps", simulated.sweeps)):
        for each in tests:
            lines += table_lines(kind, f"{each.name}.{end}", each.direction, each.temperature)
    for mass, test in simulated.resonances:
        file, folder = (typed(Path(name)) for name in (f"{test.name}.{end}", test.name))
        tested = "specimen" if isinstance(test.direction, Specimen) else "direction"
        place = typed(Path(str(test.direction)))
        lines += ["", "# A sweep comes of this resonance test with:"]
        lines += [f'# bushfit reduce {file} --mass "{mass:.6g} kg" --{tested} {place} -o {folder}']
        lines += [f"# {line}" for line in table_lines("sweeps", f"{test.name}/sweep.{end}", test.direction) if line]
    return "\n".join(lines) + "\n"
