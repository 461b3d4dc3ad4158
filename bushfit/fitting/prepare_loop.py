"""Preparation of a loop for a fit: its displacement without noise as input of the model, and its force with weights.

A loop's displacement is periodic. It is represented by the harmonics that exceed its noise, fitted by least squares to
the samples (any number of cycles, sine or triangle, evenly sampled or not). The turning points, on which friction
depends, are then free of the sensor's noise.
"""

from dataclasses import replace

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.loop_cycles import steady_cycles, wrong_clock
from bushfit.fitting.loop_harmonics import (
    GRID,
    MOST_ROWS,
    LoopHarmonics,
    loop_harmonics,
    phase_bins,
    remove_slow_changes,
)
from bushfit.fitting.measured_loop import MeasuredLoop
from bushfit.fitting.repeats import FLOOR
from bushfit.fitting.row_noise import noise_harmonics_of_single_cycle, row_noise
from bushfit.reading.measurement import Loop
from bushfit.reading.preload import Preload
from bushfit.reduction.arrays import difference_noise
from bushfit.reduction.harmonics import as_complex, basis, least_squares, series
from bushfit.reduction.turning_points import reversals
from bushfit.units import number

#: Largest difference between the amplitude of the mean cycle and half the range of the record, relative to half the
#: range (chosen: noise and drift of a steady loop are smaller); and number of rows that suffices to find the range.
_UNEQUAL, _ENOUGH_ROWS = 0.15, 100_000
#: Smallest covariance of displacement and force in a cycle, relative to the largest one of the opposite sign, that
#: shows a reversed force; chosen: a reversed force gives nearly -1, noise or an incomplete cycle much less.
_REVERSED = 0.5
#: Root mean square difference of the displacement from its mean cycle, without noise and relative to the amplitude,
#: above which cycles are unequal, and above which the record is not a loop (the mean cycle has then lost 4 % of the
#: amplitude); chosen: rigs repeat a motion within 1 %, and a drift adds some per cent.
_MISFIT, _NOT_PERIODIC = 0.05, 0.2
#: Share of the amplitude, or of half the force's range, above which a mean is reported as a preload; chosen: zero
#: errors of sensors are smaller.
REPORTED_MEAN = 0.05
#: Largest distance of the first displacement and force from rest, relative to half the range, for a start from rest.
_AT_REST = 0.02
#: Number of standard deviations above which a change of the force, or released energy, is not due to chance.
_CERTAIN = 5.0
#: Largest negative loss factor (released energy) that is attributed to a delay of the rig.
_NO_LOSS = 2e-3
#: Excess of the mean force over the second harmonic, relative to half the force range, above which a motion about zero
#: is taken to be preloaded; chosen: zero errors of load cells are smaller, and an asymmetric stiffness gives a mean
#: force of about the size of the second harmonic.
_PRELOADED = 0.25


def prepare_loop(loop: Loop, *, without_outliers: bool = False) -> MeasuredLoop:
    """Prepare a loop for a fit: find its cycles, remove the noise of its displacement, and weight its force.

    Outliers of displacement or force do not affect cycles, motion and noise.

    Args:
        loop: loop as read from a file.
        without_outliers: True to give weight 0 to rows whose force is an outlier.

    Returns:
        The loop as an input of the model, with the noise of its rows.

    Raises:
        FitError: the displacement is not one whole cycle or more of a periodic motion, rows are missing, or the loop
            releases energy.
    """
    whole = loop
    loop, frequency, cycles, left_out = steady_cycles(whole)
    first_row = int(np.searchsorted(whole.time, loop.time[0]))
    found = loop_harmonics(loop, frequency, cycles)
    rests = (False, False) if first_row else _starts_at_rest(loop, found, frequency)
    if from_rest := any(rests):
        found = loop_harmonics(loop, frequency, cycles, from_rest=True)
    outliers = found.outliers["force"].rows
    half_force = float(np.ptp(np.delete(loop.force, outliers))) / 2.0
    noise = loop.noise * half_force if loop.noise is not None else found.force_noise
    unweighted = outliers if without_outliers else outliers[:0]
    clock = loop.time - loop.time[0] if loop.time[0] else loop.time
    phase, force, weights = clock * frequency, loop.force, 1.0 - np.isin(np.arange(loop.force.size), unweighted)
    if loop.force.size > MOST_ROWS:
        rows = np.delete(clock, unweighted), np.delete(loop.force, unweighted)
        phase, force, weights = phase_bins(*rows, frequency, cycles, each_cycle=from_rest)
    notes = [*loop.source.notes] if loop.source else []
    if loop.part and loop.part.left_out:
        notes.append(Caveat("cycles_left_out", loop.part.left_out))
    if loop.softening is not None:
        sentence = f"the first cycle is {number(100 * loop.softening, 2)} % stiffer than the last (Mullins)"
        notes.append(Caveat("softening", sentence))
    if left_out:
        notes.append(Caveat("cycles_left_out", left_out))
    if mistaken := wrong_clock(loop, found.motion):
        notes.append(Caveat("wrong_waveform", mistaken))
    prepared = MeasuredLoop(
        test=loop,
        frequency=np.array([frequency]),
        cycles=cycles,
        from_rest=from_rest,
        phase=phase,
        measured_force=force,
        weights=weights,
        noise=max(noise, FLOOR * half_force),
        coefficients=found.motion,
        half_range=half_force,
        record_notes=tuple(notes),
        faulty_rows=found.outliers,
        first_row=first_row,
    )
    unequal = _unequal_cycles(prepared, found.motion_scatter)
    prepared = _with_row_noise(prepared, found)
    prepared = replace(prepared, weights=np.where(_at_reversal(prepared), 0.0, prepared.weights))
    _check_one_sign(loop, frequency)
    _check_loses_energy(prepared)
    if from_rest and not rests[0]:
        prepared = replace(prepared, datum=float(np.average(prepared.measured_force, weights=prepared.weights)))
    elif not from_rest:
        # an asymmetric stiffness also causes a mean force, with a second harmonic of about the same size
        mean, _, cosine, _, sine = least_squares(basis(prepared.phase, 2), prepared.measured_force, prepared.weights)
        preload = float(mean) if abs(mean) - np.hypot(cosine, sine) > _PRELOADED * half_force else None
        unknown = prepared.has_predecessor or abs(found.motion[0]) > 0.01 * float(prepared.amplitude[0])
        prepared = replace(prepared, datum=float(found.force[0].real) if unknown else preload)
    notes = [*prepared.record_notes, *unequal, *_preload_notes(prepared)]
    return replace(prepared, record_notes=tuple(notes))


def _unequal_cycles(prepared: MeasuredLoop, scatter: float) -> list[Caveat]:
    """Warning that the cycles of a loop are unequal, from the difference between its rows and its mean cycle.

    Args:
        prepared: the loop.
        scatter: standard deviation of the displacement of the rows from the mean cycle [m, rad or 1].

    Returns:
        A warning if the cycles are unequal, or an empty list.

    Raises:
        FitError: the mean cycle does not reproduce the rows.
    """
    motion, amplitude = prepared.test.displacement, float(prepared.amplitude[0])
    rows = motion[:: -(-motion.size // _ENOUGH_ROWS)]
    recorded = float(np.ptp(np.quantile(rows, (0.01, 0.99)))) / 2.0
    misfit = 0.0
    if scatter > _MISFIT * amplitude:  # this scatter may be noise
        misfit = float(np.sqrt(max(scatter**2 - float(difference_noise(motion, 3)) ** 2, 0.0))) / amplitude
    if abs(amplitude / recorded - 1.0) <= _UNEQUAL and misfit <= _MISFIT:
        return []
    unit, factor = prepared.test.direction.display.displacement
    sizes = (
        f"{number(factor * amplitude, 3)} {unit}, half the range of the record is {number(factor * recorded, 3)} {unit}"
    )
    if misfit > _NOT_PERIODIC:
        raise FitError(
            "the cycles of the loop are not equal",
            file=prepared.test.source.file if prepared.test.source else None,
            found=f"{prepared.cycles:.3g} cycles at {float(prepared.frequency[0]):.4g} Hz; their mean has an amplitude "
            f"of {sizes}; the displacement differs from it by {100 * misfit:.0f} % of the amplitude",
            expected=f"a difference of {100 * _NOT_PERIODIC:.0f} % or less",
            hint="is this a swept sine, or two sines at a time? A loop needs cycles of one amplitude, rate and mean",
        )
    return [Caveat("unequal_cycles", f"the cycles are not equal: their mean has an amplitude of {sizes}")]


def _check_one_sign(loop: Loop, frequency: float) -> None:
    """Raise a FitError if the force rises with the displacement in some cycles and falls in others."""
    cycle = ((loop.time - loop.time[0]) * frequency).astype(np.intp)
    covariance = np.bincount(cycle, (loop.displacement - loop.displacement.mean()) * (loop.force - loop.force.mean()))
    smaller, larger = sorted((float(covariance.min()), float(covariance.max())), key=abs)
    if smaller * larger < 0.0 and abs(smaller) > _REVERSED * abs(larger):
        row = int(np.argmax(np.sign(covariance)[cycle] != np.sign(covariance[0])))
        raise FitError(
            "the force changes its sign within the record",
            file=loop.source.file if loop.source else None,
            found=f"displacement and force in phase before or after {loop.time[row]:.4g} s, and in antiphase otherwise",
            expected="one sign, as one load cell has",
            hint="write each part to a file of its own; force_sign = -1 in the campaign turns the force of a file",
        )


def _check_loses_energy(prepared: MeasuredLoop) -> None:
    """Raise a FitError if a loop gains energy, by more than noise and a delay of the rig explain."""
    stiffness = complex(prepared.measured[0])
    rows = prepared.weights.sum() / prepared.row_noise.rows_as_one
    chance = prepared.noise * np.sqrt(2.0 / rows) / abs(prepared.coefficients[1])
    if stiffness.imag < -max(_CERTAIN * chance, _NO_LOSS * abs(stiffness)):
        late = number(-1e3 * np.angle(stiffness) / (2.0 * np.pi * float(prepared.frequency[0])), 2)
        raise FitError(
            "the loop releases energy, which no bushing does",
            file=prepared.test.source.file if prepared.test.source else None,
            found=f"a loss factor of {stiffness.imag / stiffness.real:.3g}: the force lags behind the displacement",
            expected="a force that leads the displacement",
            hint="are the columns of displacement and force swapped, or do the rows run backwards in time? Name the "
            'columns in the campaign: columns = { displacement = "...", force = "..." }. A filter or a delay of the '
            f"force by more than {late} ms has the same effect",
        )


def _with_row_noise(prepared: MeasuredLoop, loop_harmonics: LoopHarmonics) -> MeasuredLoop:
    """Estimate size and correlation of the noise of a loop's rows, or bins of phase, from its whole cycles.

    If there is no whole cycle, or the noise is below 1e-4 of half the force range, the rows are taken as independent.

    Returns:
        The loop with its noise; the rows of a long loop, which are bins of phase, may have other weights.
    """
    binned = prepared.measured_force.size < prepared.test.force.size
    cycle = prepared.phase.astype(np.intp)
    half_row = 0.5 * prepared.cycles / prepared.test.time.size
    rows = (cycle >= int(prepared.from_rest)) & (cycle < int(prepared.cycles + half_row))
    cycles = np.unique(cycle[rows]).size
    if not cycles or np.count_nonzero(rows) < 32 * cycles:  # too few to resolve a correlation
        return prepared
    phase, force, weight = prepared.phase[rows], prepared.measured_force[rows], prepared.weights[rows]
    harmonics = loop_harmonics.force
    if prepared.from_rest:
        harmonics = as_complex(least_squares(basis(phase, harmonics.size - 1), force, weight))
    if cycles == 1:
        harmonics = np.where(noise_harmonics_of_single_cycle(np.arange(harmonics.size)), 0.0, harmonics)
    misfit = force - series(harmonics, phase)
    if np.std(misfit) < FLOOR * prepared.half_range:
        return prepared
    if not weight.all():
        misfit = np.interp(phase, phase[weight > 0.0], misfit[weight > 0.0])
    settled, scale = remove_slow_changes(phase, misfit)[0], np.sqrt(weight) if binned else 1.0
    model, size = row_noise(misfit * scale, settled * scale, cycles)
    if binned and model.order:
        # the number of correlated rows in a bin says little about its accuracy: one weight for all bins of a cycle
        weighted = prepared.weights > 0.0
        count = np.bincount(cycle[weighted], minlength=cycle.max() + 1)
        mean = np.bincount(cycle[weighted], prepared.weights[weighted], minlength=count.size) / np.maximum(count, 1)
        prepared = replace(prepared, weights=np.where(weighted, mean[cycle], 0.0))
        scale = np.sqrt(prepared.weights[rows])
        model, size = row_noise(misfit * scale, settled * scale, cycles)
    if binned:
        breaks = () if prepared.from_rest else tuple((np.flatnonzero(np.diff(cycle)) + 1).tolist())
        model = replace(model, row_scale=max(size / loop_harmonics.force_noise, 1.0), breaks=breaks)
        return replace(prepared, row_noise=model)
    if not model.order:
        return prepared
    noise = prepared.noise if prepared.test.noise is not None else max(size, FLOOR * prepared.half_range)
    return replace(prepared, noise=noise, row_noise=model)


def _at_reversal(prepared: MeasuredLoop) -> Array:
    """Mask of the rows within 1.5/1024 of a cycle of a turning point, where the force of dry friction jumps, (n,)."""
    motion, position = prepared.history(is_transient=False).value, prepared.phase * GRID
    if prepared.from_rest:
        samples = np.flatnonzero(reversals(motion))
    else:
        samples, position = np.flatnonzero(reversals(np.tile(motion, 3))) - GRID, position % GRID
    samples = np.concatenate(([-np.inf], samples, [np.inf]))
    after = np.searchsorted(samples, position)
    # one step, and half a step because a turning point may be between two samples
    return np.minimum(position - samples[after - 1], samples[after] - position) < 1.5


def _starts_at_rest(loop: Loop, harmonics: LoopHarmonics, frequency: float) -> tuple[bool, bool]:
    """Test whether a record begins at rest at zero, or at rest about a preload.

    If a record begins at rest, the force at its start differs from the force one cycle later by more than noise
    explains. In a settled loop both are equal, even if it passes through the origin because of a zero error of its load
    cell.

    Args:
        loop: steady cycles of the record.
        harmonics: harmonics of the loop.
        frequency: frequency of the motion [Hz].

    Returns:
        Two flags: True if it begins at rest at zero, and True if it begins at rest about a preload.
    """
    half_motion = float(np.ptp(series(harmonics.motion, np.arange(GRID) / GRID))) / 2.0
    half_force = float(np.ptp(np.delete(loop.force, harmonics.outliers["force"].rows))) / 2.0
    noise = loop.noise * half_force if loop.noise is not None else harmonics.force_noise
    end = np.searchsorted(loop.time, loop.time[0] + 2.0 / frequency)
    clock, force = loop.time[:end] - loop.time[0], loop.force[:end]
    comparable = np.searchsorted(clock, clock[-1] - 1.0 / frequency, side="right")  # with a row one cycle later
    first = clock[: max(min(int(np.searchsorted(clock, 0.02 / frequency)), int(comparable)), 1)]
    change = abs(float(np.median(np.interp(first + 1.0 / frequency, clock, force) - force[: first.size])))
    # sqrt(2) for the difference of two rows; the standard error of a median is sqrt(pi/2) = 1.25 times that of a mean
    chance = 1.25 * _CERTAIN * noise * np.sqrt(2.0 / first.size)
    if change <= max(chance, 5e-3 * half_force):
        return False, False
    near, scatter, reach = _AT_REST * half_force, 3.0 * noise, _AT_REST * half_motion
    unmoved, unloaded = abs(loop.displacement[0]) <= reach, abs(loop.force[0]) <= near + scatter
    off_mean = abs(loop.displacement[0] - harmonics.motion[0].real), abs(loop.force[0] - harmonics.force[0].real)
    # the virgin curve moves the mean by up to 0.3 of the change
    in_middle = off_mean[0] <= reach and off_mean[1] <= max(near, 0.5 * change) + scatter
    is_first = loop.part is None or loop.part.first_row == 0
    return bool(unmoved and unloaded), bool(in_middle and is_first)


def recorded_means(prepared: MeasuredLoop) -> list[Preload]:
    """Mean displacement and mean force of a loop, each only if it is too large to be a zero error of a sensor.

    Returns:
        List of up to two means: displacement [m, rad or 1], then force [N or N m].
    """
    if prepared.datum is None:
        return []
    motion, means = prepared.test.direction.motion, list[Preload]()
    if abs(mean_motion := float(prepared.coefficients[0].real)) > REPORTED_MEAN * float(prepared.amplitude[0]):
        means.append(Preload(mean_motion, motion.displacement_unit))
    if abs(prepared.datum) > (REPORTED_MEAN if means else _PRELOADED) * prepared.half_range:
        means.append(Preload(prepared.datum, motion.force_unit))
    return means


def _preload_notes(prepared: MeasuredLoop) -> list[Caveat]:
    """Note on the mean displacement and force of a loop without a stated preload; none if they are small."""
    loop, motion = prepared.test, prepared.test.direction.motion
    means = recorded_means(prepared)
    if not means or (loop.preload and loop.preload.value):
        return []
    words = {motion.displacement_unit: motion.words[0], motion.force_unit: motion.words[1]}
    listed = " and ".join(f"a mean {words[mean.unit]} of {mean.text(loop.direction, 3)}" for mean in means)
    sentence = f"recorded about {listed}, but no preload is stated: the fit uses the loop about its mean"
    return [Caveat("mean_load", sentence)]


def correlation_text(loop: MeasuredLoop) -> str:
    """Text on the number of rows over which the noise of a loop's force is correlated; "" without correlation."""
    if not loop.row_noise.order:
        return ""
    frequency = float(loop.frequency[0])
    time = loop.row_noise.rows_as_one * float(np.median(np.diff(loop.phase))) / frequency
    rows = time * loop.test.time.size * frequency / loop.cycles
    return f", correlated over about {number(rows, 2)} rows ({number(time, 2)} s)"
