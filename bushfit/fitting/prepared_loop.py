"""Loop prepared as an input of the model: the measured displacement without its noise, and the force with weights.

A loop's displacement is periodic. It is represented by the harmonics that exceed its noise, fitted by least squares to
the samples (any number of cycles, sine or triangle, evenly sampled or not). The turning points, on which friction
depends, are then free of the sensor's noise.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.errors import FitError
from bushfit.fitting.loop_cycles import steady_cycles, wrong_clock
from bushfit.fitting.loop_harmonics import (
    GRID,
    MOST_ROWS,
    LoopHarmonics,
    OutlierRows,
    loop_harmonics,
    phase_bins,
    remove_slow_changes,
)
from bushfit.fitting.repeats import FLOOR
from bushfit.fitting.row_noise import RowNoise, noise_harmonics_of_single_cycle, row_noise
from bushfit.reading.measurement import Loop
from bushfit.reading.preload import Preload
from bushfit.reduction.harmonics import as_complex, basis, least_squares, series
from bushfit.reduction.turning_points import reversals
from bushfit.units import number

#: Share of the amplitude, or of half the force's range, above which a mean is reported as a preload; chosen: zero
#: errors of sensors are smaller.
TOLD_MEAN = 0.05
#: Largest distance of the first displacement and force from rest, relative to half the range, for a start from rest.
_AT_REST = 0.02
#: Number of standard deviations beyond which a change of force, or energy that a loop releases, is not chance.
_CERTAIN = 5.0
#: Loss factor up to which a loop may give energy, for the delay of a rig.
_NO_LOSS = 2e-3
#: Share of half the force's range by which the mean force of a motion about zero may exceed its second harmonic before
#: it is taken for a preload; chosen: wrong zeros of load cells are less, and an uneven stiffness makes both alike.
_PRELOADED = 0.25
#: How far equations over a loop's motion may be from solved, relative to it: a ten-thousandth of the noise of the best
#: rigs. Derivatives are resolved apart from that.
_ACCURACY = 1e-8


@dataclass(frozen=True, eq=False)
class PreparedLoop:
    """A measured loop, prepared as an input of the model: its motion without noise, and its force with weights.

    Args:
        loop: measured loop, reduced to its steady cycles.
        frequency: frequency of the displacement [Hz].
        cycles: number of cycles in the loop, including fractions.
        from_rest: True if the record begins at rest, False if the loop is settled.
        phase: position of each row [cycles from the first row], (n,).
        force: measured force per row, or per bin of phase if the loop is long [N or N m], (n,).
        weight: number of rows averaged in each entry of `force`, 0 at the turning points, (n,).
        noise: standard deviation of one row's force [N or N m].
        coefficients: complex harmonics of the displacement, mean first [m or rad].
        half_range: half of the range of the measured force without outliers [N or N m].
        datum: mean force [N or N m] that the fit subtracts, because a zero error of the sensor, a preload and the
            memory of the rubber cannot be distinguished: the motion is not about zero or starts from rest at another
            position, the force has a preload, or other cycles precede the loop. None: the fit uses the force itself.
        notes: sentences on parts of the record that were left out, and on times that do not agree with the rows.
        outliers: by column, indices of faulty rows and their distances from the harmonics in units of noise.
        first_row: index of the loop's first row in the whole record.
        row_noise: correlation of the noise of a row with that of the rows before.
    """

    loop: Loop
    frequency: float
    cycles: float
    from_rest: bool
    phase: Array
    force: Array
    weight: Array
    noise: float
    coefficients: Array
    half_range: float
    datum: float | None = None
    notes: tuple[str, ...] = ()
    outliers: Mapping[str, OutlierRows] = field(default_factory=dict)
    first_row: int = 0
    row_noise: RowNoise = field(default_factory=RowNoise)
    # by length of a response: the samples before and after each row, and the part of the way between
    _samples: dict[int, tuple[Array, Array, Array]] = field(default_factory=dict, init=False, repr=False)

    @property
    def amplitude(self) -> float:
        """Zero-to-peak amplitude of the loop's displacement [m or rad]."""
        return float(self.history(is_transient=False).amplitude[0])

    @property
    def correlation_text(self) -> str:
        """Text on the number of rows over which the noise of the force is correlated; "" without correlation."""
        if not self.row_noise.order:
            return ""
        time = self.row_noise.rows_as_one * float(np.median(np.diff(self.phase))) / self.frequency
        rows = time * self.loop.time.size * self.frequency / self.cycles
        return f", correlated over about {number(rows, 2)} rows ({number(time, 2)} s)"

    def displacement(self, phase: Array) -> Array:
        """Displacement without noise [m or rad], (n,), at phases in cycles, (n,)."""
        return series(self.coefficients, phase)

    @cached_property
    def first_harmonic(self) -> complex:
        """Complex stiffness of the loop at its fundamental, force over displacement [N/m or N m/rad]."""
        root = np.sqrt(self.weight)
        _, force = as_complex(least_squares(basis(self.phase, 1) * root[:, None], self.force * root))
        return complex(force / self.coefficients[1])

    def history(self, is_transient: bool) -> History:
        """Displacement without noise that drives the model: one settled cycle of 1024 samples, or the whole record.

        Args:
            is_transient: True if the response of the model changes over the first cycles of a settled motion. Then, and
                if the record begins at rest, the whole record is returned, unless other cycles precede the loop.
        """
        return self._settling if is_transient and not (self.from_rest or self.has_predecessor) else self._motion

    @property
    def has_predecessor(self) -> bool:
        """True if the record has earlier rows before the loop; the rubber remembers their deformation."""
        return self.loop.part is not None and self.loop.part.first_row > 0

    @cached_property
    def _motion(self) -> History:
        cycle = np.fft.irfft(0.5 * GRID * np.append(0.0, self.coefficients[1:]), GRID)
        if not self.from_rest:
            return replace(History.steady(cycle, self.frequency), accuracy=_ACCURACY)
        motion, step = np.resize(cycle - cycle[0], int(np.ceil(self.cycles * GRID)) + 2), 1.0 / (self.frequency * GRID)
        return History(motion, step, periodic=False, frequency=self.frequency, accuracy=_ACCURACY)

    @cached_property
    def _settling(self) -> History:
        count = int(np.ceil(self.cycles - 0.5 * self.cycles / self.loop.time.size))  # but for half a row
        motion = History.steady(np.tile(self._motion.value, count), self.frequency, cycles=count)
        return replace(motion, accuracy=_ACCURACY)

    def interpolate_at_rows(self, response: Array) -> Array:
        """Interpolate a model response over the samples of `history`, (..., samples), at the measured rows.

        The mean is subtracted if the fit uses the loop about its mean (`datum`).

        Returns:
            Response at the rows, (..., n).
        """
        length = response.shape[-1]
        if self.datum is not None and not self.from_rest:
            response = response - response.mean(axis=-1, keepdims=True)
        if length not in self._samples:
            position = self.phase * GRID
            index = position.astype(np.intp)
            ahead = np.minimum(index + 1, length - 1) if self.from_rest else (index + 1) % length
            self._samples[length] = index % length, ahead, position - index
        index, ahead, part = self._samples[length]
        rows = response.take(index, axis=-1)
        rows *= 1.0 - part
        rows += response.take(ahead, axis=-1) * part
        if self.datum is not None and self.from_rest:
            rows = rows - np.average(rows, axis=-1, weights=self.weight)[..., None]
        return rows


def prepare_loop(loop: Loop, *, without_outliers: bool = False) -> PreparedLoop:
    """Prepare a loop for a fit: find its cycles, remove the noise of its displacement, and weight its force.

    Outliers of displacement or force do not affect cycles, motion and noise. With `without_outliers`, rows whose force
    is an outlier get no weight.

    Returns:
        The loop as an input of the model, with the noise of its rows.

    Raises:
        FitError: the displacement is not one whole cycle or more of a periodic motion, rows are missing, or the loop
            gives energy.
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
    points = clock * frequency, loop.force, 1.0 - np.isin(np.arange(loop.force.size), unweighted)
    if loop.force.size > MOST_ROWS:
        rows = np.delete(clock, unweighted), np.delete(loop.force, unweighted)
        points = phase_bins(*rows, frequency, cycles, each_cycle=from_rest)
    notes = [*loop.source.notes] if loop.source else []
    if loop.part and loop.part.left_out:
        notes.append(loop.part.left_out)
    if loop.softening is not None:
        notes.append(f"the first cycle is {number(100 * loop.softening, 2)} % stiffer than the last (Mullins)")
    prepared = PreparedLoop(
        loop,
        frequency,
        cycles,
        from_rest,
        *points,
        noise=max(noise, FLOOR * half_force),
        coefficients=found.motion,
        half_range=half_force,
        notes=(*notes, *filter(None, (left_out, wrong_clock(loop, found.motion)))),
        outliers=found.outliers,
        first_row=first_row,
    )
    prepared = _with_row_noise(prepared, found)
    prepared = replace(prepared, weight=np.where(_at_reversal(prepared), 0.0, prepared.weight))
    _check_loses_energy(prepared)
    if from_rest and not rests[0]:
        prepared = replace(prepared, datum=float(np.average(prepared.force, weights=prepared.weight)))
    elif not from_rest:
        # a stiffness that is not the same to either side makes a mean force too, and a second harmonic of its size
        mean, _, cosine, _, sine = least_squares(basis(prepared.phase, 2), prepared.force, prepared.weight)
        preload = float(mean) if abs(mean) - np.hypot(cosine, sine) > _PRELOADED * half_force else None
        unknown = prepared.has_predecessor or abs(found.motion[0]) > 0.01 * prepared.amplitude
        prepared = replace(prepared, datum=float(found.force[0].real) if unknown else preload)
    return replace(prepared, notes=(*prepared.notes, *_preload_notes(prepared)))


def _check_loses_energy(prepared: PreparedLoop) -> None:
    """Raise a FitError if a loop gains energy, by more than noise and a delay of the rig explain."""
    stiffness = prepared.first_harmonic
    rows = prepared.weight.sum() / prepared.row_noise.rows_as_one
    chance = prepared.noise * np.sqrt(2.0 / rows) / abs(prepared.coefficients[1])
    if stiffness.imag < -max(_CERTAIN * chance, _NO_LOSS * abs(stiffness)):
        late = number(-1e3 * np.angle(stiffness) / (2.0 * np.pi * prepared.frequency), 2)
        raise FitError(
            "the loop releases energy, which no bushing does",
            file=prepared.loop.source.file if prepared.loop.source else None,
            found=f"a loss factor of {stiffness.imag / stiffness.real:.3g}: the force lags behind the displacement",
            expected="a force that leads the displacement",
            hint="are the columns of displacement and force swapped, or do the rows run backwards in time? Name the "
            'columns in the campaign: columns = { displacement = "...", force = "..." }. A filter or a delay of the '
            f"force by more than {late} ms does the same",
        )


def _with_row_noise(prepared: PreparedLoop, loop_harmonics: LoopHarmonics) -> PreparedLoop:
    """Estimate size and correlation of the noise of a loop's rows, or bins of phase, from its whole cycles.

    If there is no whole cycle, or the noise is below that of any rig, the rows are taken to be independent.

    Returns:
        The loop with its noise; the rows of a long loop, which are bins of phase, may have other weights.
    """
    binned = prepared.force.size < prepared.loop.force.size
    turn = prepared.phase.astype(np.intp)
    half_row = 0.5 * prepared.cycles / prepared.loop.time.size
    rows = (turn >= int(prepared.from_rest)) & (turn < int(prepared.cycles + half_row))
    cycles = np.unique(turn[rows]).size
    if not cycles or np.count_nonzero(rows) < 32 * cycles:  # fewer resolve no correlation
        return prepared
    phase, force, weight = prepared.phase[rows], prepared.force[rows], prepared.weight[rows]
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
        # a row more or less in a bin of rows that depend on one another tells nothing: one weight for each turn
        weighted = prepared.weight > 0.0
        count = np.bincount(turn[weighted], minlength=turn.max() + 1)
        mean = np.bincount(turn[weighted], prepared.weight[weighted], minlength=count.size) / np.maximum(count, 1)
        prepared = replace(prepared, weight=np.where(weighted, mean[turn], 0.0))
        scale = np.sqrt(prepared.weight[rows])
        model, size = row_noise(misfit * scale, settled * scale, cycles)
    if binned:
        breaks = () if prepared.from_rest else tuple((np.flatnonzero(np.diff(turn)) + 1).tolist())
        model = replace(model, row_scale=max(size / loop_harmonics.force_noise, 1.0), breaks=breaks)
        return replace(prepared, row_noise=model)
    if not model.order:
        return prepared
    noise = prepared.noise if prepared.loop.noise is not None else max(size, FLOOR * prepared.half_range)
    return replace(prepared, noise=noise, row_noise=model)


def _at_reversal(prepared: PreparedLoop) -> Array:
    """Mask of the rows near a turning point of the motion, where the force of dry friction jumps, (rows,)."""
    motion, position = prepared.history(is_transient=False).value, prepared.phase * GRID
    if prepared.from_rest:
        turns = np.flatnonzero(reversals(motion))
    else:
        turns, position = np.flatnonzero(reversals(np.tile(motion, 3))) - GRID, position % GRID
    turns = np.concatenate(([-np.inf], turns, [np.inf]))
    after = np.searchsorted(turns, position)
    # one step, and the half by which the point may lie beside its sample
    return np.minimum(position - turns[after - 1], turns[after] - position) < 1.5


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
    comparable = np.searchsorted(clock, clock[-1] - 1.0 / frequency, side="right")  # a cycle later
    first = clock[: max(min(int(np.searchsorted(clock, 0.02 / frequency)), int(comparable)), 1)]
    change = abs(float(np.median(np.interp(first + 1.0 / frequency, clock, force) - force[: first.size])))
    # of a difference, and of a median, whose standard error is sqrt(pi/2) of that of a mean
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


def recorded_means(prepared: PreparedLoop) -> list[Preload]:
    """Mean displacement and mean force of a loop that are too large for a zero error of a sensor.

    Returns:
        Means [m, rad or 1, and N or N m] that are too large; none, one or both.
    """
    if prepared.datum is None:
        return []
    motion, means = prepared.loop.direction.motion, list[Preload]()
    if abs(mean_motion := float(prepared.coefficients[0].real)) > TOLD_MEAN * prepared.amplitude:
        means.append(Preload(mean_motion, motion.displacement_unit))
    if abs(prepared.datum) > (TOLD_MEAN if means else _PRELOADED) * prepared.half_range:
        means.append(Preload(prepared.datum, motion.force_unit))
    return means


def _preload_notes(prepared: PreparedLoop) -> Sequence[str]:
    """Note on the mean displacement and force of a loop without a stated preload; none if they are small."""
    loop, motion = prepared.loop, prepared.loop.direction.motion
    means = recorded_means(prepared)
    if not means or (loop.preload and loop.preload.value):
        return []
    words = {motion.displacement_unit: motion.words[0], motion.force_unit: motion.words[1]}
    listed = " and ".join(f"a mean {words[mean.unit]} of {mean.text(loop.direction, 3)}" for mean in means)
    return [f"recorded about {listed}, but no preload is stated: the fit uses the loop about its mean"]
