"""What the tests of this folder share: the tests of a rig, and campaigns cut down or tampered with."""

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.diagnosis.record import Diagnosis, DiagnosisSettings
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep
from bushfit.simulation.exact import ExactTests

BOTH = [Direction.AXIAL, Direction.RADIAL]
FREQUENCIES = tuple(float(f) for f in range(5, 156, 10))
LEVELS = (1e-4, 2e-4, 5e-4)
PLAN = SimulateSettings(
    repeats=3,
    noise=5e-3,
    force_noise=3e-3,
    displacement_noise=2e-4,
    loops=tuple(SimulatedLoop(Direction.AXIAL, amplitude, 0.1, cycles=3) for amplitude in (5e-4, 1e-3)),
    sweeps=tuple(SimulatedSweep(direction, LEVELS, FREQUENCIES) for direction in BOTH),
)
#: The same rig with a gain error of 0.4 % and a phase error of 0.2 deg in each block.
SHARED = replace(PLAN, gain_error=4e-3, phase_error=3.5e-3)

#: Parameters of effects by name: {"inertia": {"mass": 0.1}}.
Effects = Mapping[str, Mapping[str, float]]
Measured = Callable[..., Campaign]
Diagnosed = Callable[..., Diagnosis]
Fitted = Callable[..., FitResult]
Tamper = Callable[[Campaign], Campaign]
INERTIA = {"inertia": {"mass": 0.06}}
SLIP = {"interface_slip": {"force": 6.0}}
TWO = {"delay": {"tau": 1e-4}, "strain_stiffening": {"c3": 20.0}}


def in_closed_form(truth: Model, plan: SimulateSettings) -> ExactTests:
    """What the closed form that fits use has of a model in its steady state: for effects that the rig cannot make."""
    phase = np.arange(1000) / 1000
    loops = []
    for test in plan.loops:
        motion = test.amplitude * np.tile(np.sin(2.0 * np.pi * phase), test.cycles)
        steady = History.steady(motion, test.frequency, test.cycles)
        force = truth.force(test.direction, steady, kind="loop")
        loops.append((test, Loop("simulated", test.direction, steady.step * np.arange(motion.size), motion, force)))
    sweeps = [
        (test, truth.stiffness(test.direction, np.array(test.frequencies), np.array(test.amplitudes)[:, None]))
        for test in plan.sweeps
    ]
    return ExactTests(truth, tuple(loops), tuple(sweeps))


def cut(sweep: Sweep, kept: Array) -> Sweep:
    """The chosen points of a sweep."""
    columns = ("frequency", "amplitude", "stiffness", "repeat")
    return replace(sweep, **{name: getattr(sweep, name)[kept] for name in columns})


def changed(campaign: Campaign, number: int, factor: Array | complex) -> Campaign:
    """A campaign with the stiffness of one sweep multiplied."""
    sweeps = list(campaign.sweeps)
    sweeps[number] = replace(sweeps[number], stiffness=sweeps[number].stiffness * np.asarray(factor))
    return replace(campaign, sweeps=tuple(sweeps))


def off(number: int, factor: complex, **where: float | tuple[float, ...]) -> Tamper:
    """Some points of a sweep off by a factor: those at these frequencies, amplitudes and repeats; else all."""

    def made(campaign: Campaign) -> Campaign:
        sweep = campaign.sweeps[number]
        rows = [np.isin(getattr(sweep, name), values) for name, values in where.items()]
        return changed(campaign, number, np.where(np.all(rows, axis=0), factor, 1.0))

    return made


def both(one: Tamper, other: Tamper) -> Tamper:
    return lambda campaign: one(other(campaign))


def loop_too_strong(campaign: Campaign) -> Campaign:
    """The largest loop off by a factor."""
    first, second = campaign.loops
    return replace(campaign, loops=(first, replace(second, force=1.06 * second.force)))


def repeated_loop_too_strong(campaign: Campaign) -> Campaign:
    """A repeat of the largest loop off by a factor."""
    *_, repeat = loop_too_strong(campaign).loops
    return replace(campaign, loops=(*campaign.loops, replace(repeat, name="loop_axial_3")))


def asked(campaign: Campaign, model: Model | None = None, **settings: object) -> Diagnosis:
    return diagnose(PreparedCampaign.from_campaign(campaign), model, DiagnosisSettings(**settings))  # type: ignore[arg-type]


def said(diagnosis: Diagnosis) -> str:
    return f"{diagnosis.verdict} " + " + ".join(
        "|".join((e.name, *(other.label for other in e.alternatives))) for e in diagnosis.effects
    )


def names(diagnosis: Diagnosis) -> set[str]:
    return {effect.name for effect in diagnosis.effects}


def of_sweeps(chosen: Callable[[Sweep], Array]) -> Tamper:
    """The chosen points of each sweep."""
    return lambda c: replace(c, sweeps=tuple(cut(sweep, chosen(sweep)) for sweep in c.sweeps))


def missing_points(c: Campaign) -> Campaign:
    random = np.random.default_rng(3)
    return of_sweeps(lambda sweep: random.random(sweep.frequency.size) < 0.7)(c)


#: Smaller campaigns. Sweeps of several frequencies show a mass; loops at 0.1 Hz and sweeps at 25 Hz do not.
SHOW_MASS: dict[str, Tamper] = {
    "no loops": lambda c: replace(c, loops=()),
    "one direction": lambda c: replace(c, sweeps=c.sweeps[:1]),
    "no repeats": of_sweeps(lambda sweep: sweep.repeat == 1),
    "missing points": missing_points,
    "one level": of_sweeps(lambda sweep: sweep.amplitude == LEVELS[0]),
}
SMALLER: dict[str, Tamper] = {
    **SHOW_MASS,
    "no sweeps": lambda c: replace(c, sweeps=()),
    "one loop": lambda c: replace(c, sweeps=(), loops=c.loops[:1]),
    "one frequency": of_sweeps(lambda sweep: sweep.frequency == 25.0),
}
