"""Data sets of a campaign, one per measured loop, one per sweep; and of tests that are not made yet."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np

from bushfit.campaign.schema import UNSTATED, Residuals, RigSettings
from bushfit.effects.contract import Array
from bushfit.fitting.drive import Drive, drive_of
from bushfit.fitting.measured_loop import MeasuredLoop
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.fitting.outliers import contradictions
from bushfit.fitting.rig_class import of_class
from bushfit.geometry import Bushing, Place, Specimen, unit_strain
from bushfit.model.model import Model
from bushfit.model.sensitivity import stiffness_and_slopes
from bushfit.reading.measurement import Loop, Source, Sweep
from bushfit.units import number

__all__ = [
    "MeasuredLoop",
    "MeasuredSweep",
    "MeasuredTest",
    "prepare_loops",
    "prepare_sweeps",
    "sources",
    "split_by_kind",
]

#: Relative difference of two loops' amplitudes, or frequencies, up to which one repeats the other; chosen: rigs come
#: back to an amplitude within it.
_SAME_LOOP = 0.02
#: Step in temperature up to which tests count as made at one [K].
_SAME_KELVIN = 1.0

#: One measured test with its noise, see `data_set.MeasuredBase`.
MeasuredTest = MeasuredLoop | MeasuredSweep

_Kind = TypeVar("_Kind", MeasuredLoop, MeasuredSweep)


def prepare_loops(
    loops: Sequence[Loop], rig: RigSettings = UNSTATED, *, without_outliers: bool = False
) -> list[MeasuredLoop]:
    """One data set per loop; rows that are outliers carry no weight where they are to be left out.

    Args:
        loops: measured loops.
        rig: class of the rig.
        without_outliers: True to give outlying rows no weight.
    """
    drives = [drive_of(loop, without_outliers=without_outliers) for loop in loops]
    found = [MeasuredLoop(drive).weighted(np.array(drive.loop.weight)) for drive in drives]
    return with_gain_errors(with_contradictions(found, [_first_alike(found)]), rig)


def with_gain_errors(loops: Sequence[MeasuredLoop], rig: RigSettings) -> list[MeasuredLoop]:
    """Loops with the gain error that a rig of the class makes, stated or assumed.

    Notes:
        All repeats of a loop share it. Independent errors larger by the root of their number leave the mean of the
        repeats, which alone describes the bushing, with the same error.
    """
    errors = of_class(rig)[0] * np.sqrt(np.count_nonzero(repeats_of(loops), axis=1))
    weighs = rig.stiffness_errors[0] is not None
    return [
        replace(loop, gain_error=error, gain_weighs=weighs) for loop, error in zip(loops, errors.tolist(), strict=True)
    ]


def with_gains(data_sets: Iterable[MeasuredTest], *, weigh: bool) -> list[MeasuredTest]:
    """Tests whose loops' gain errors are part of their noise, or not."""
    return [
        replace(data_set, gain_weighs=weigh) if isinstance(data_set, MeasuredLoop) else data_set
        for data_set in data_sets
    ]


def repeats_of(loops: Sequence[MeasuredLoop]) -> Array:
    """Mask of the loops that repeat one another, themselves among them, (n, n)."""
    conditions = np.log([(loop.drive.amplitude, loop.drive.frequency) for loop in loops]).reshape(-1, 2)
    place = np.array([str(loop.direction) for loop in loops])
    return np.all(np.abs(conditions[:, None] - conditions) <= _SAME_LOOP, axis=-1) & (place[:, None] == place)


def _first_alike(loops: Sequence[MeasuredLoop]) -> Array:
    """The number of the first loop that each repeats, (n,)."""
    return np.argmax(repeats_of(loops), axis=1) if loops else np.empty(0, dtype=np.intp)


def group_repeats(loops: Sequence[MeasuredLoop]) -> list[list[MeasuredLoop]]:
    """Loops in groups that repeat one another; each is in one, that of the first that it repeats."""
    first = _first_alike(loops)
    return [[loops[place] for place in np.flatnonzero(first == lead).tolist()] for lead in np.unique(first).tolist()]


def prepare_sweeps(
    sweeps: Sequence[Sweep], residuals: Residuals = "complex", rig: RigSettings = UNSTATED
) -> list[MeasuredSweep]:
    """One data set per sweep; the noise of those of one rig, the bushing's or a specimen's, is estimated together.

    Args:
        sweeps: measured sweeps.
        residuals: definition of the residuals, complex or magnitude and loss factor.
        rig: class of the rig.

    Returns:
        Measured sweeps with their noise, in the order given.
    """
    rigs = [sweep.direction if isinstance(sweep.direction, Specimen) else None for sweep in sweeps]
    noises = {
        direction: sweep_noise(
            [sweep for sweep, rig_direction in zip(sweeps, rigs, strict=True) if rig_direction == direction], rig
        )
        for direction in dict.fromkeys(rigs)
    }
    data_sets = [
        MeasuredSweep(sweep, noises[direction], residuals) for sweep, direction in zip(sweeps, rigs, strict=True)
    ]
    found = [data_set.weighted(np.array(data_set.sweep.weight)) for data_set in data_sets]
    names = [str(one.direction) for one in found]
    places = [np.full(one.measured.size, names.index(name)) for one, name in zip(found, names, strict=True)]
    conditions = (places, [one.frequency for one in found], [one.amplitude for one in found])
    return with_contradictions(found, [np.concatenate([np.empty(0), *values]) for values in conditions])


def with_contradictions(found: Sequence[_Kind], conditions: Sequence[Array]) -> list[_Kind]:
    """Loops, or sweeps, each with a sentence on the earlier one whose points it repeats and lies farthest from; points
    repeat one another where all of `at`, (n,) each, and their temperatures are the same.

    Args:
        found: loops, or sweeps.
        conditions: values that repeats have in common, (n,) each, over all operating points.

    Returns:
        The tests, with `contradiction` set where one contradicts an earlier test.
    """
    if len(found) < 2:
        return list(found)
    owner = np.repeat(np.arange(len(found)), [one.measured.size for one in found])
    points = np.stack([*conditions, _sessions(np.hstack([one.temperature for one in found]))])
    stiffness = np.concatenate([one.measured for one in found])
    marked = list(found)
    for separation, one, second in reversed(
        contradictions(stiffness, np.unique(points, axis=1, return_inverse=True)[1])
    ):
        first, later = sorted((int(owner[one]), int(owner[second])))
        if first != later:  # a file that contradicts itself tells so
            sentence = (
                f"it repeats {found[first].name}, and their stiffness differs by {number(100.0 * separation, 2)} %"
            )
            marked[later] = replace(found[later], contradiction=sentence)
    return marked


def _sessions(temperature: Array) -> Array:
    """A number for each group of temperatures [K], (n,), that count as one; those that are not known are a group."""
    kelvin = np.nan_to_num(temperature)
    order = np.argsort(kelvin)
    groups = np.empty(kelvin.size, dtype=np.intp)
    groups[order] = np.cumsum(np.diff(kelvin[order], prepend=kelvin[order[0]]) > _SAME_KELVIN)
    return groups


def with_level_errors(
    sweeps: Sequence[MeasuredSweep], error: tuple[float, float], freedom: int
) -> tuple[MeasuredSweep, ...]:
    """Sweeps with gain and phase errors [rad] that all runs of a level share, known by so many degrees of freedom; 0
    where they count as exact.

    Args:
        sweeps: measured sweeps.
        error: standard deviation of gain and of phase [rad].
        freedom: degrees of freedom behind the error; 0 if it is exact.
    """
    noises = {id(sweep.noise): replace(sweep.noise, level=error, level_freedom=freedom) for sweep in sweeps}
    return tuple(replace(sweep, noise=noises[id(sweep.noise)]) for sweep in sweeps)


def split_by_kind(data_sets: Iterable[MeasuredTest]) -> tuple[list[MeasuredLoop], list[MeasuredSweep]]:
    """Loops and sweeps among some data sets, as two lists."""
    tests = list(data_sets)
    loops = [data_set for data_set in tests if isinstance(data_set, MeasuredLoop)]
    return loops, [data_set for data_set in tests if isinstance(data_set, MeasuredSweep)]


def rows_of(data_sets: Iterable[MeasuredTest]) -> list[slice]:
    """Slices of the residuals of each data set among those of all."""
    ends = accumulate((data_set.size for data_set in data_sets), initial=0)
    return [slice(*pair) for pair in pairwise(ends)]


def operating_conditions(bushing: Bushing | None, data_sets: Iterable[MeasuredTest]) -> tuple[Array, Array]:
    """Frequencies [Hz] and equivalent strains of all operating points, loops included, (n,) each."""
    tests = list(data_sets)
    strains = [data_set.amplitude * unit_strain(bushing, data_set.direction) for data_set in tests]
    return np.concatenate([data_set.frequency for data_set in tests]), np.concatenate(strains)


def log_slopes(model: Model, data_set: MeasuredTest, names: Sequence[str]) -> Array:
    """Derivatives of ln K of a model at the operating points of a test by parameter, complex (len(names), n).

    Args:
        model: model at whose values the derivatives are taken.
        data_set: test of n operating points.
        names: parameters.
    """
    test = data_set.direction, data_set.frequency, data_set.amplitude
    stiffness, slopes = stiffness_and_slopes(model, *test, names, data_set.kind, data_set.circumstances)
    return slopes / stiffness


def sources(data_sets: Iterable[MeasuredTest]) -> tuple[Source, ...]:
    """The files that data sets came from, each once: a record may hold several loops."""
    found = [data_set.source for data_set in data_sets if data_set.source is not None]
    return tuple(source for place, source in enumerate(found) if source not in found[:place])


def new_loop(
    model: Model,
    place: Place,
    frequency: float,
    amplitude: float,
    noise: float,
    *,
    cycles: float = 1.0,
    rows: int,
    from_rest: bool = False,
) -> MeasuredLoop:
    """A sinusoidal loop of so many rows in all.

    Args:
        frequency: [Hz].
        amplitude: zero-to-peak [m or rad].
        noise: standard deviation of one row, relative to half the force range.

    Returns:
        Loop without noise in its force, with the standard deviation `noise`.
    """
    phase, nil = cycles * np.arange(rows) / rows, np.zeros(rows)
    motion = amplitude * np.sin(2.0 * np.pi * phase)
    silent = Drive(
        loop=Loop("new", place, phase / frequency, motion, nil),
        frequency=frequency,
        cycles=cycles,
        from_rest=from_rest,
        phase=phase,
        force=nil,
        weight=np.ones(rows),
        noise=1.0,
        coefficients=np.array([0.0, -1j * amplitude]),
        half_range=1.0,
    )
    return MeasuredLoop(silent).noise_free(model).with_noise(noise)


def new_sweep(
    model: Model,
    place: Place,
    frequency: Array,
    amplitude: Array,
    scatter: tuple[float, float],
    shared: tuple[float, float],
) -> MeasuredSweep:
    """A sweep at operating points [Hz, m or rad], (n,) each, a run for each amplitude.

    Args:
        scatter, shared: standard deviations of gain and phase, from point to point and of a run.
    """
    noise = SweepNoise({("new", float(x)): scatter for x in np.unique(amplitude)}, shared, "stated", 0)
    return MeasuredSweep(Sweep("new", place, frequency, amplitude, model.stiffness(place, frequency, amplitude)), noise)
