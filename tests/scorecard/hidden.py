"""Random bushings with hidden effects, measured by the package's rig in time.

The closed forms that fits use never make these data. The size of an effect is random, from hardly visible to plain: it
is the largest misfit that the paper's model leaves.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.random import Generator

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.diagnosis.fits import fit_model
from bushfit.effects import BASE, LIBRARY, Effect, get_effect, qualified_name
from bushfit.effects.contract import Array
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep
from bushfit.simulation.exact import PAPER_FREQUENCIES, simulate_exact
from bushfit.simulation.measured import SimulatedData, measure

BOTH = (Direction.AXIAL, Direction.RADIAL)
#: Least and largest size of what stays visible, relative to |K| or half a loop's force range: hardly seen to plain.
_VISIBLE = (0.015, 0.12)
#: Least and largest scatter of a sweep point, relative to |K|: good rigs.
NOISE = (0.003, 0.006)
#: Least and largest scatter of a loop's force, relative to half its range.
FORCE_NOISE = (0.002, 0.004)
#: Least and largest temperature of a test where an effect of it is hidden [K]: within 12 K of the laboratory's.
_TEMPERATURES = (285.0, 308.0)
#: Time steps of a cycle: their error is a tenth of the noise.
STEPS = 1024


class _OutOfReachError(Exception):
    """No amount of an effect shows at a size in range."""


def hidden_campaign(seed: int, hidden: Sequence[str] = (), visible: tuple[float, float] = _VISIBLE) -> SimulatedData:
    """One simulated campaign, with its true model in `truth`; the same seed makes the same.

    Args:
        seed: of everything random.
        hidden: effects of the library to hide.
        visible: smallest and largest relative misfit that the paper's model leaves of each effect.
    """
    random = np.random.default_rng([seed, 7])
    for _ in range(30):  # the worst effect needs a dozen bushings until one shows it at a size in range
        plain = random_bushing(random)
        plan = plan_of(plain, random, seed)
        if any("temperature" in get_effect(name).depends_on for name in hidden):
            plan = _at_temperatures(plan, random)
        with suppress(_OutOfReachError):
            model = plain
            for name in hidden:
                wanted = float(np.exp(random.uniform(*np.log(visible))))
                model = model.with_effect(name, _sized(plain, get_effect(name), wanted, plan, random, visible))
            return measure(simulate_exact(model, plan, steps_per_cycle=STEPS), plan)
    raise RuntimeError(f"no visible size of {', '.join(hidden)} was found for seed {seed}")


def random_bushing(random: Generator) -> Model:
    """A random bushing and a random filled rubber, elastic, springpot and friction."""
    inner = random.uniform(0.006, 0.022)
    bushing = Bushing("hidden", inner, inner * random.uniform(1.4, 2.3), random.uniform(0.02, 0.07))
    mu = float(np.exp(random.uniform(np.log(0.6e6), np.log(1.8e6))))
    return Model(
        bushing,
        BASE,
        {
            "mu": mu,
            "m": mu * random.uniform(0.1, 0.3),
            "alpha": random.uniform(0.15, 0.3),
            "sigma_fmax": mu * random.uniform(0.008, 0.022),
            "eps_half": random.uniform(0.007, 0.02),
        },
    )


def plan_of(plain: Model, random: Generator, seed: int) -> SimulateSettings:
    """Two directions at three levels of like strain, as in the paper, two axial loops, three repeats; half of the rigs
    share errors of gain and phase in a block."""
    top = random.uniform(0.03, 0.06)
    axial, second = (float(f"{top / plain.unit_strain(direction):.2g}") for direction in BOTH)
    shared = random.random() < 0.5
    return SimulateSettings(
        seed=seed,
        repeats=3,
        noise=random.uniform(*NOISE),
        force_noise=random.uniform(*FORCE_NOISE),
        displacement_noise=2e-4,
        gain_error=0.004 if shared else 0.0,
        phase_error=float(np.radians(0.2)) if shared else 0.0,
        loops=tuple(SimulatedLoop(Direction.AXIAL, factor * axial, 0.1, cycles=3) for factor in (1.0, 2.0)),
        sweeps=tuple(
            SimulatedSweep(direction, tuple((np.array([0.2, 0.4, 1.0]) * largest).tolist()), PAPER_FREQUENCIES)
            for direction, largest in zip(BOTH, (axial, second), strict=True)
        ),
    )


def _at_temperatures(plan: SimulateSettings, random: Generator) -> SimulateSettings:
    """The plan with each of its tests at a temperature of its own."""
    loops = tuple(replace(test, temperature=random.uniform(*_TEMPERATURES)) for test in plan.loops)
    sweeps = tuple(replace(test, temperature=random.uniform(*_TEMPERATURES)) for test in plan.sweeps)
    return replace(plan, loops=loops, sweeps=sweeps)


def _sized(
    plain: Model, effect: Effect, wanted: float, plan: SimulateSettings, random: Generator, visible: tuple[float, float]
) -> dict[str, float]:
    """Values of an effect of which about the wanted size stays visible after a plain fit."""
    values = {
        qualified_name(effect, parameter): _shape(plain, plan, parameter.scale, parameter.typical, random)
        for parameter in effect.parameters
        if parameter.neutral is None
    }
    amount, share = effect.amount, 1.0
    amounts = {qualified_name(effect, each): each for each in effect.parameters if each.neutral is not None}
    if amount.bounds[0] < amount.value_at_share(0.0) and random.random() < 0.5:
        share = -share
    size = 0.0
    for _ in range(4):
        if not (amount.bounds[0] <= amount.value_at_share(share) <= amount.bounds[1] and abs(share) <= 30.0):
            raise _OutOfReachError
        values |= {name: each.value_at_share(share) for name, each in amounts.items()}
        model = plain.with_effect(effect.name, values)
        if not _plausible(model, plan):
            share *= 0.3
            continue
        size = _visible(plain, model, plan)
        if size <= 0.0 or abs(np.log(size / wanted)) < 0.15:
            break
        share *= float(np.clip(wanted / size, 0.1, 10.0))
    if not 0.7 * visible[0] < size < 2.0 * visible[1]:
        raise _OutOfReachError
    return values | {name: each.value_at_share(share) for name, each in amounts.items()}


def _shape(plain: Model, plan: SimulateSettings, scale: str | None, typical: float, random: Generator) -> float:
    """A random value of a parameter that has no neutral one, on the scale of the tests."""
    amplitudes = plan.sweeps[0].amplitudes
    largest = max(float(np.max(np.abs(plain.stiffness(t.direction, *_points(t))) * _points(t)[1])) for t in plan.sweeps)
    ranges = {
        "period": (1.0 / (2.0 * np.pi * 300.0), 1.0 / (2.0 * np.pi * 10.0)),
        "frequency": (190.0, 400.0),
        "displacement": (1.2 * amplitudes[1], 0.9 * amplitudes[2]),
        "force": (0.4 * largest, 0.9 * largest),
        "strain": tuple(x * plain.values["eps_half"] for x in (0.02, 0.1)),
        "order": (0.45, 0.85),
        "session": (0.02, 1.0),
        None: (0.7 * typical, 1.4 * typical),
    }
    return float(np.exp(random.uniform(*np.log(ranges[scale]))))


def _plausible(model: Model, plan: SimulateSettings) -> bool:
    """Whether every test meets a bushing: one that resists, which beyond its clearance it does not, and that does not
    lose more than it stores."""
    stiffness = np.concatenate([model.stiffness(test.direction, *_points(test)) for test in plan.sweeps])
    return bool(np.all(np.abs(stiffness.imag) < stiffness.real))


def _points(test: SimulatedSweep) -> tuple[Array, Array]:
    """Frequency and amplitude of each point, (n,) each."""
    frequency, amplitude = np.meshgrid(test.frequencies, test.amplitudes)
    return frequency.ravel(), amplitude.ravel()


def _visible(plain: Model, model: Model, plan: SimulateSettings) -> float:
    """Largest misfit of a plain model fitted to what the model itself predicts, relative."""
    data_sets = _noise_free_data(model, plan)
    fitted = fit_model(plain, data_sets, (), {}).model
    return max(data_set.largest_difference(fitted, model) for data_set in data_sets)


def _noise_free_data(model: Model, plan: SimulateSettings) -> list[MeasuredTest]:
    """The plan's tests as the model's own closed form has them: used for the choice of a size, never as data."""
    swept = [(test.direction, *_points(test)) for test in plan.sweeps]
    sweeps = [
        Sweep(str(points[0]), *points, model.stiffness(*points), noise=5e-3, temperature=test.temperature)
        for test, points in zip(plan.sweeps, swept, strict=True)
    ]
    phase = np.arange(600) / 200.0
    motions = [(test, test.amplitude * np.sin(2.0 * np.pi * phase)) for test in plan.loops]
    loops = [
        Loop(str(number), test.direction, phase / test.frequency, motion, motion, temperature=test.temperature)
        for number, (test, motion) in enumerate(motions)
    ]
    campaign = Campaign("plan", Path("plan"), model.bushing, tuple(loops), tuple(sweeps))
    data = PreparedCampaign.from_campaign(campaign)
    loops_of_model = [loop.noise_free(model) for loop in data.loops]
    silent = [replace(loop, noise=3e-3 * loop.half_range) for loop in loops_of_model]
    return [*silent, *(sweep.noise_free(model) for sweep in data.sweeps)]


def hideable() -> list[str]:
    """Effects of the library of today that the rig can make and the tests of a hidden campaign can show."""
    out_of_reach = {
        name
        for name, effect in LIBRARY.items()
        if effect.harmonic_only or effect.after not in (None, *BASE) or "preload" in effect.depends_on
    }
    return [name for name in LIBRARY if name not in {*BASE, *out_of_reach}]
