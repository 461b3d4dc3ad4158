"""Clean but awkward campaigns: nothing is hidden, and noise or plan are as real rigs have them."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.signal import butter, lfilter

from bushfit.campaign.schema import SimulatedSweep, SimulateSettings
from bushfit.effects.contract import Array
from bushfit.reading.measurement import Loop, Sweep
from bushfit.simulation.measured import Simulated
from cards.hidden import FORCE_NOISE, NOISE
from cards.recipe import Bench, Recipe

#: Frequencies of a strain sweep, and of a sweep with three of them only [Hz].
_THREE = (5.0, 35.0, 155.0)
#: Standard deviation of the amplitude reached, relative to that asked for.
_REACHED = 0.02
#: Degrees of freedom of Student's t for noise with heavy tails.
_TAILS = 3


def _changed(**changes: object) -> Callable[[Bench], SimulateSettings]:
    return lambda bench: replace(bench.plan, **changes)  # type: ignore[arg-type]


def _sweeps(**changes: object) -> Callable[[Bench], SimulateSettings]:
    """The plan with these changes to every sweep."""
    return lambda bench: replace(
        bench.plan,
        sweeps=tuple(replace(test, **changes) for test in bench.plan.sweeps),  # type: ignore[arg-type]
    )


def _strain_sweeps(bench: Bench) -> SimulateSettings:
    """Amplitudes from 3 % of the largest on, stepped at three frequencies, one to three repeats."""

    def turned(test: SimulatedSweep) -> SimulatedSweep:
        amplitudes = tuple((np.geomspace(0.03, 1.0, 12) * max(test.amplitudes)).tolist())
        return replace(test, amplitudes=amplitudes, frequencies=_THREE, stepped="amplitude", reached=_REACHED)

    sweeps = tuple(turned(test) for test in bench.plan.sweeps)
    return replace(bench.plan, sweeps=sweeps, repeats=int(bench.random.integers(1, 4)))


def _level_missing(bench: Bench) -> SimulateSettings:
    which, level = int(bench.random.integers(2)), int(bench.random.integers(3))
    sweeps = list(bench.plan.sweeps)
    kept = [x for number, x in enumerate(sweeps[which].amplitudes) if number != level]
    sweeps[which] = replace(sweeps[which], amplitudes=tuple(kept))
    return replace(bench.plan, sweeps=tuple(sweeps))


def each_loop(measured: Simulated, change: Callable[[Loop], Loop]) -> Simulated:
    return replace(measured, loops=tuple(map(change, measured.loops)))


def each_sweep(measured: Simulated, factor: Callable[[Sweep], Array]) -> Simulated:
    """The campaign with the stiffness of every sweep times a factor, (n,)."""
    sweeps = tuple(replace(sweep, stiffness=sweep.stiffness * factor(sweep)) for sweep in measured.sweeps)
    return replace(measured, sweeps=sweeps)


def _noisy_loops(measured: Simulated, bench: Bench, noise: Callable[[int], Array]) -> Simulated:
    """Loops with noise of unit standard deviation, scaled to what good rigs have."""
    size = bench.random.uniform(*FORCE_NOISE)
    return each_loop(
        measured,
        lambda loop: replace(loop, force=loop.force + size * np.ptp(loop.force) / 2.0 * noise(loop.force.size)),
    )


def _filtered(measured: Simulated, bench: Bench, numerator: Array, denominator: Array) -> Simulated:
    """Loops with white noise after a filter."""

    def noise(count: int) -> Array:
        coloured = lfilter(numerator, denominator, bench.random.standard_normal(count + 1000))[1000:]
        return np.asarray(coloured / coloured.std())

    return _noisy_loops(measured, bench, noise)


def _loop_noise(sentence: str, numerator: Array, denominator: Array) -> Recipe:
    noise = partial(_filtered, numerator=numerator, denominator=denominator)
    return Recipe(sentence, plan=_changed(force_noise=0.0), file=noise)


def _coloured(rho: float) -> Recipe:
    sentence = f"loop noise of which a row keeps {rho} of the one before"
    return _loop_noise(sentence, np.array([1.0]), np.array([1.0, -rho]))


def _heavy_tails(measured: Simulated, bench: Bench) -> Simulated:
    def tails(count: int) -> Array:
        return np.asarray(bench.random.standard_t(_TAILS, count) / np.sqrt(_TAILS / (_TAILS - 2.0)))

    size = bench.random.uniform(*NOISE)
    loops = _noisy_loops(measured, bench, tails)
    return each_sweep(loops, lambda sweep: 1.0 + size * (tails(sweep.step.size) + 1j * tails(sweep.step.size)))


def _levels_off(measured: Simulated, bench: Bench, error: float) -> Simulated:
    """A gain error of every level that all its repeats share."""

    def gain(sweep: Sweep) -> Array:
        levels, which = np.unique(sweep.amplitude, return_inverse=True)
        return np.asarray(1.0 + error * bench.random.standard_normal(levels.size)[which])

    return each_sweep(measured, gain)


def _low_frequency_scatter(measured: Simulated, bench: Bench) -> Simulated:
    size = bench.random.uniform(*NOISE) * bench.between(2.0, 6.0)

    def scatter(sweep: Sweep) -> Array:
        spread = size * sweep.frequency.min() / sweep.frequency
        white = bench.random.standard_normal((2, sweep.frequency.size))
        return np.asarray(1.0 + spread * (white[0] + 1j * white[1]))

    return each_sweep(measured, scatter)


def wild(measured: Simulated, bench: Bench, count: int, size: float) -> Simulated:
    """The campaign with single points off by a share of |K|, at any angle."""
    rows = [(test, row) for test, sweep in enumerate(measured.sweeps) for row in range(sweep.step.size)]
    stiffness = [sweep.stiffness.copy() for sweep in measured.sweeps]
    for number in bench.random.choice(len(rows), count, replace=False):
        test, row = rows[number]
        stiffness[test][row] *= 1.0 + size * np.exp(2j * np.pi * bench.random.random())
    pairs = zip(measured.sweeps, stiffness, strict=True)
    return replace(measured, sweeps=tuple(replace(sweep, stiffness=changed) for sweep, changed in pairs))


#: Every kind by name.
AWKWARD: dict[str, Recipe] = {
    "coloured_noise_90": _coloured(0.9),
    "coloured_noise_98": _coloured(0.98),
    "low_pass_noise": _loop_noise("loop noise after a low-pass", *butter(2, 0.03)),
    "heavy_tails": Recipe(
        "noise of Student's t with three degrees of freedom",
        plan=_changed(noise=0.0, force_noise=0.0),
        file=_heavy_tails,
    ),
    "one_repeat": Recipe("nothing repeated", plan=_changed(repeats=1)),
    "two_repeats": Recipe("two repeats", plan=_changed(repeats=2)),
    "level_errors_half": Recipe(
        "0.5 % of gain that all repeats of a level share", file=partial(_levels_off, error=0.005)
    ),
    "level_errors_one": Recipe("1 % of gain that all repeats of a level share", file=partial(_levels_off, error=0.01)),
    "low_frequency_scatter": Recipe("scatter that grows towards low frequency", file=_low_frequency_scatter),
    "wild_point": Recipe("one point 4 % off", file=partial(wild, count=1, size=0.04)),
    "strain_sweeps": Recipe("the amplitude stepped at three frequencies", plan=_strain_sweeps),
    "level_missing": Recipe("one level of one direction missing", plan=_level_missing),
    "as_reached": Recipe("amplitudes as they were reached", plan=_sweeps(reached=_REACHED)),
    "dense": Recipe("76 frequencies", plan=_sweeps(frequencies=tuple(np.arange(5.0, 156.0, 2.0).tolist()))),
    "long": Recipe(
        "loops of 25 cycles",
        plan=lambda bench: replace(bench.plan, loops=tuple(replace(test, cycles=25) for test in bench.plan.loops)),
    ),
    "one_direction": Recipe("axial tests alone", plan=lambda bench: replace(bench.plan, sweeps=bench.plan.sweeps[:1])),
    "three_frequencies": Recipe("three frequencies", plan=_sweeps(frequencies=_THREE)),
}
