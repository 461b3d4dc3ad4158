"""Tests prepared for a fit, one per measured loop and one per sweep; and simulated tests for planning."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np

from bushfit.campaign.schema import UNSTATED, Residuals, RigSettings
from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.fitting.measured_loop import MeasuredLoop
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.fitting.outliers import contradictions
from bushfit.fitting.prepare_loop import prepare_loop
from bushfit.fitting.rig_class import class_errors
from bushfit.geometry import Bushing, Place, unit_strain
from bushfit.model.model import Model
from bushfit.model.sensitivity import difference_quotients, stepped_values
from bushfit.reading.measurement import Loop, Source, Sweep
from bushfit.units import number

__all__ = ["MeasuredLoop", "MeasuredSweep"]

#: Largest relative difference of the amplitudes, or frequencies, of two loops that repeat each other; chosen: rigs
#: return to an amplitude within it.
SAME_LOOP = 0.02
#: Step in temperature [K] up to which tests belong to the same temperature.
_SAME_KELVIN = 1.0

#: One measured test with its noise, see `MeasuredBase`.
MeasuredTest = MeasuredLoop | MeasuredSweep

_Kind = TypeVar("_Kind", MeasuredLoop, MeasuredSweep)


def prepare_loops(
    loops: Sequence[Loop], rig: RigSettings = UNSTATED, *, without_outliers: bool = False
) -> list[MeasuredLoop]:
    """Prepare measured loops for a fit, each with its noise and a warning if it contradicts an earlier loop.

    Args:
        loops: measured loops.
        rig: accuracy class of the rig (gain and phase errors).
        without_outliers: True to give weight 0 to rows whose force is an outlier.
    """
    found = [prepare_loop(loop, without_outliers=without_outliers).weighted(np.array(loop.weight)) for loop in loops]
    first = np.argmax(repeats_of(found), axis=1) if found else np.empty(0)
    return with_gain_errors(_with_contradictions(found, [first]), rig)


def with_gain_errors(loops: Sequence[MeasuredLoop], rig: RigSettings) -> list[MeasuredLoop]:
    """Return loops with the gain error of the rig (relative error of all forces), as stated in [rig] or assumed.

    Notes:
        All n repeats of a loop share the gain error. It is represented by independent errors that are larger by
        sqrt(n), which give the mean of the repeats the same error.
    """
    errors = class_errors(rig)[0] * np.sqrt(np.count_nonzero(repeats_of(loops), axis=1))
    weighs = rig.stiffness_errors[0] is not None
    return [
        replace(loop, gain_error=float(error), gain_weighs=weighs) for loop, error in zip(loops, errors, strict=True)
    ]


def with_gain_weighting(data_sets: Iterable[MeasuredTest], *, weigh: bool) -> list[MeasuredTest]:
    """Return tests whose loops' gain errors are part of the weights of the fit (`weigh`), or only of uncertainties."""
    return [replace(test, gain_weighs=weigh) if isinstance(test, MeasuredLoop) else test for test in data_sets]


def repeats_of(loops: Sequence[MeasuredLoop]) -> Array:
    """Mask of the pairs of n loops with equal direction and preload, and amplitude and frequency within 2 %, (n, n)."""
    conditions = np.log([(*loop.amplitude, *loop.frequency) for loop in loops]).reshape(-1, 2)
    place = np.array([f"{loop.direction} {loop.test.preload}" for loop in loops])
    return np.all(np.abs(conditions[:, None] - conditions) <= SAME_LOOP, axis=-1) & (place[:, None] == place)


def group_repeats(loops: Sequence[MeasuredLoop]) -> list[list[MeasuredLoop]]:
    """Group loops that repeat each other: same direction and preload, amplitude and frequency within 2 %."""
    if not loops:
        return []
    first = np.argmax(repeats_of(loops), axis=1)
    return [[loops[i] for i in np.flatnonzero(first == lead).tolist()] for lead in np.unique(first).tolist()]


def prepare_sweeps(
    sweeps: Sequence[Sweep], residuals: Residuals = "complex", rig: RigSettings = UNSTATED
) -> list[MeasuredSweep]:
    """Prepare sweeps for a fit, each with its noise.

    The noise is estimated once for all sweeps of bushings, and once for all sweeps of each specimen.

    Args:
        sweeps: measured sweeps.
        residuals: definition of the residuals: complex, or magnitude and loss factor.
        rig: accuracy class of the rig (gain and phase errors).

    Returns:
        Measured sweeps with their noise, in the order given.
    """
    by_rig = dict[Place | None, list[Sweep]]()
    for sweep in sweeps:
        by_rig.setdefault(None if sweep.direction.axis else sweep.direction, []).append(sweep)
    noises = {id(sweep): noise for group in by_rig.values() for noise in [sweep_noise(group, rig)] for sweep in group}
    found = [
        MeasuredSweep(test=sweep, noise=noises[id(sweep)], residuals=residuals, weights=np.array([sweep.weight]))
        for sweep in sweeps
    ]
    names = [f"{test.direction} {test.test.preload}" for test in found]
    places = [np.full(test.measured.size, names.index(name)) for test, name in zip(found, names, strict=True)]
    conditions = (places, [test.frequency for test in found], [test.amplitude for test in found])
    return _with_contradictions(found, [np.concatenate([np.empty(0), *values]) for values in conditions])


def _with_contradictions(tests: Sequence[_Kind], conditions: Sequence[Array]) -> list[_Kind]:
    """Add a warning to each test whose stiffness differs by 10 % or more from an earlier test of the same point.

    Args:
        tests: loops, or sweeps.
        conditions: labels or values of the n operating points of all tests, (n,) each; points with equal conditions
            and temperatures repeat each other.
    """
    if len(tests) < 2:
        return list(tests)
    kelvin = np.nan_to_num(np.hstack([test.temperature for test in tests]))  # unknown temperatures are one group
    order, session = np.argsort(kelvin), np.empty(kelvin.size, dtype=np.intp)
    session[order] = np.cumsum(np.diff(kelvin[order], prepend=kelvin[order[0]]) > _SAME_KELVIN)
    points = np.unique(np.stack([*conditions, session]), axis=1, return_inverse=True)[1]
    owner = np.repeat(np.arange(len(tests)), [test.measured.size for test in tests])
    marked = list(tests)
    for separation, *pair in reversed(contradictions(np.concatenate([test.measured for test in tests]), points)):
        first, later = np.sort(owner[pair])
        if first != later:  # contradictions within one test have their own warning
            difference = f"their stiffness differs by {number(100.0 * separation, 2)} %"
            contradiction = Caveat("test_repeat_differs", f"it repeats {tests[first].name}, and {difference}")
            marked[later] = replace(tests[later], contradiction=contradiction)
    return marked


def with_level_errors(tests: Sequence[MeasuredTest], error: tuple[float, float], freedom: int) -> list[MeasuredTest]:
    """Return tests with new sizes of the gain and phase errors that all runs at one amplitude or frequency share.

    Args:
        tests: loops, which are unchanged, and sweeps.
        error: standard deviation of gain and of phase [rad].
        freedom: degrees of freedom behind the error; 0 if it is exact.
    """
    return with_sweep_noise(tests, partial(replace, level=error, level_freedom=freedom))


def with_sweep_noise(tests: Sequence[MeasuredTest], change: Callable[[SweepNoise], SweepNoise]) -> list[MeasuredTest]:
    """Return tests whose sweeps have a changed noise; sweeps that share one noise share the changed noise.

    Args:
        tests: loops, which are unchanged, and sweeps.
        change: function from the noise of sweeps to the changed noise.
    """
    noises = {id(sweep.noise): sweep.noise for sweep in split_by_kind(tests)[1]}
    changed = {key: change(noise) for key, noise in noises.items()}
    return [replace(test, noise=changed[id(test.noise)]) if isinstance(test, MeasuredSweep) else test for test in tests]


def split_by_kind(data_sets: Iterable[MeasuredTest]) -> tuple[list[MeasuredLoop], list[MeasuredSweep]]:
    """Split tests into a list of loops and a list of sweeps."""
    tests = list(data_sets)
    loops = [test for test in tests if isinstance(test, MeasuredLoop)]
    return loops, [test for test in tests if isinstance(test, MeasuredSweep)]


def residual_slices(data_sets: Iterable[MeasuredTest]) -> list[slice]:
    """Slice of each test's residuals in the array of the residuals of all tests, in order."""
    ends = accumulate((test.size for test in data_sets), initial=0)
    return [slice(*pair) for pair in pairwise(ends)]


def operating_conditions(bushing: Bushing | None, data_sets: Iterable[MeasuredTest]) -> tuple[Array, Array]:
    """Frequencies [Hz] and equivalent strain amplitudes of all operating points, one per loop, (n,) each."""
    tests = list(data_sets)
    strains = [test.amplitude * unit_strain(bushing, test.direction) for test in tests]
    return np.concatenate([test.frequency for test in tests]), np.concatenate(strains)


def log_slopes(model: Model, data_set: MeasuredTest, names: Sequence[str]) -> Array:
    """Derivatives of a model's ln K at a test's operating points with respect to parameters [SI], (len(names), n).

    Args:
        model: model at whose values the derivatives are taken.
        data_set: test of n operating points.
        names: names of the parameters.
    """
    values, steps = stepped_values(model, names, data_set.direction)
    stack = model.stack(data_set.direction, data_set.kind, data_set.conditions, values)
    stiffness, slopes = difference_quotients(stack(2.0 * np.pi * data_set.frequency, data_set.amplitude), steps)
    return slopes / stiffness


def sources(data_sets: Iterable[MeasuredTest]) -> tuple[Source, ...]:
    """Source files of tests, each listed once, because a record may contain several loops."""
    found = list[Source]()
    for test in data_sets:
        if test.source is not None and test.source not in found:
            found.append(test.source)
    return tuple(found)


def planned_loop(
    model: Model, place: Place, frequency: float, amplitude: float, noise: float, *, cycles: float = 1.0, rows: int
) -> MeasuredLoop:
    """Build a sinusoidal loop of a planned test, with the force of a model.

    Args:
        model: model that gives the force.
        place: direction or specimen of the test.
        frequency: frequency [Hz].
        amplitude: zero-to-peak displacement [m or rad].
        noise: standard deviation of one row, relative to half the force range.
        cycles: number of cycles.
        rows: number of rows.

    Returns:
        Settled loop without noise in its force; its residuals are in units of `noise`.
    """
    phase, nil = cycles * np.arange(rows) / rows, np.zeros(rows)
    motion = amplitude * np.sin(2.0 * np.pi * phase)
    silent = MeasuredLoop(
        test=Loop("new", place, phase / frequency, motion, nil),
        frequency=np.array([frequency]),
        cycles=cycles,
        from_rest=False,
        phase=phase,
        measured_force=nil,
        weights=np.ones(rows),
        noise=1.0,
        coefficients=np.array([0.0, -1j * amplitude]),
        half_range=1.0,
    )
    loop = silent.noise_free(model)
    return replace(loop, noise=noise * loop.half_range)


def planned_sweep(
    model: Model,
    place: Place,
    frequency: Array,
    amplitude: Array,
    scatter: tuple[float, float],
    shared: tuple[float, float],
) -> MeasuredSweep:
    """Build a sweep of a planned test, with one run for each amplitude and the stiffness of a model.

    Args:
        model: model that gives the stiffness.
        place: direction or specimen of the test.
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak amplitude of each point [m or rad], (n,).
        scatter: standard deviations of gain and phase [rad] from point to point.
        shared: standard deviations of the gain and phase errors [rad] shared by a run.
    """
    noise = SweepNoise({("new", float(x)): scatter for x in np.unique(amplitude)}, shared, "stated", 0)
    sweep = Sweep("new", place, frequency, amplitude, model.stiffness(place, frequency, amplitude))
    return MeasuredSweep(test=sweep, noise=noise)
