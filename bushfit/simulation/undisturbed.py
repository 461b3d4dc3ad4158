"""What a rig without error writes of a known model: its loops, sweeps and resonance tests.

They come from `rig`, which steps Eqs. (3) and (5) through time. The closed form that the fits use carries its results
from one amplitude to another near by, and no farther (see `near`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bushfit.campaign.schema import SimulatedLoop, SimulatedResonance, SimulatedSweep, SimulateSettings
from bushfit.campaign.session import planned_session
from bushfit.effects import Level, Modifier, friction
from bushfit.effects.contract import UNKNOWN, Array, Circumstances
from bushfit.errors import CampaignError
from bushfit.geometry import Direction, Place
from bushfit.model import rig
from bushfit.model.model import Model
from bushfit.progress import track
from bushfit.reduction.resonance import response

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
#: Rows of a simulated loop in a cycle, so that its curve is smooth, and time steps between two rows, in proportion to
#: which the error of the time steps falls.
_ROWS_PER_CYCLE, _STEPS_PER_ROW = 1000, 2
#: Time steps of a programme at most: they take seconds, and a gigabyte.
_MOST_STEPS = 10_000_000
#: Cycles before a loop is recorded, so that it has settled, at least and at most; none where an effect's settling is
#: what there is to see.
_LEAST_RUN_IN, _MOST_RUN_IN = 40, 300
#: Cycles before these in which the motion swells and dies out, and its largest strain amplitude over eps_half, where
#: friction would take longer than both to forget its start: chosen, of a mean force it then keeps next to nothing. Not
#: where parameters follow the amplitude, which is that of the whole motion.
_SWELL_CYCLES, _SWELL_TO = 100, 0.3


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
        tuple(
            (test, _clean_loop(truth, test, own.select(0)))
            for test, own in track("loops simulated", list(zip(loops, under, strict=False)))
        ),
        tuple((test, _clean_sweep(truth, test, steps_per_cycle)) for test in track("sweeps simulated", sweeps)),
        tuple((test, _clean_resonance(truth, test, steps_per_cycle)) for test in resonances),
    )


def _clean_loop(truth: Model, test: SimulatedLoop, under: Circumstances) -> rig.Record:
    """The record of a loop or a programme without noise, `_ROWS_PER_CYCLE` rows a cycle of its highest frequency."""
    if len(test.parts) > 1:
        return _clean_programme(truth, test, under)
    ((frequency, amplitude),) = test.parts
    run_in, swell = _run_in(truth, test.direction, amplitude)
    measured = rig.record(
        truth,
        test.direction,
        frequency,
        amplitude,
        cycles=test.cycles,
        run_in=run_in,
        swell=swell,
        steps_per_cycle=_ROWS_PER_CYCLE * _STEPS_PER_ROW,
        waveform=test.waveform,
        kind="loop",
        under=under,
    )
    return _thinned(measured)


def _run_in(truth: Model, place: Place, amplitude: float) -> tuple[int, tuple[int, float]]:
    """Cycles until friction forgets where it began; before them those in which a small motion swells, and how far.

    It may keep a thousandth of the mean stress from the start, which no test sees. At a tenth of eps_half a cycle
    keeps 95 % of it, at a hundredth 99.96 %: thousands of cycles.
    """
    if any(effect.settles for effect in truth.records):
        return 0, (0, 1.0)
    if "eps_half" not in truth.values:
        return _LEAST_RUN_IN, (0, 1.0)
    strain = np.array(amplitude * truth.unit_strain(place) / truth.values["eps_half"])
    cycles = -np.log(1e-3) / np.maximum(friction.mean_stress_decay(strain), np.finfo(float).tiny)
    follows = any(isinstance(effect, Modifier) for effect in truth.records)
    if cycles > _LEAST_RUN_IN + _SWELL_CYCLES and not follows:
        return _LEAST_RUN_IN, (_SWELL_CYCLES, float(_SWELL_TO / strain))
    return int(np.clip(np.ceil(cycles), _LEAST_RUN_IN, _MOST_RUN_IN)), (0, 1.0)


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
    return response(near(mount, test.direction, frequency, about, stiffness), test.mass, frequency, base)[1]


def near(
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
