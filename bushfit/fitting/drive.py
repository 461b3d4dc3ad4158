"""What drives the model in a loop: the measured displacement, cleared of its noise.

A loop's displacement is periodic. It is written as the harmonics that rise above its noise, found by least
squares at the samples as they are (any number of cycles, sine or triangle, evenly sampled or not), so the
turning points that friction needs are those of the motion and not of the sensor.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.effects.history import History, reversals
from bushfit.errors import FitError
from bushfit.fitting.clock import fundamental
from bushfit.fitting.harmonics import (
    GRID,
    MOST_ROWS,
    OutlierRows,
    basis,
    harmonics,
    series,
    solve,
)
from bushfit.fitting.noise import FLOOR
from bushfit.fitting.runin import steady_part, thinned
from bushfit.fitting.waveform import wrong_clock
from bushfit.reading.measurement import Loop
from bushfit.reading.parallel import CHUNK, by_chunks
from bushfit.reduction.cycles import HOLE

#: Cycles whose bins are kept apart, and how fast the groups of later ones grow.
_APART, _GROWTH = 4, 1.5
#: Steps of the grid about a turning point in which rows carry no weight.
_JUMP = 1.5
#: Share of the half range below which both first displacement and first force count as a start from rest.
_AT_REST = 0.02
#: Share of a cycle at its start, and of the half range of the force by which it is another a cycle later.
_FIRST, _OTHER = 0.02, 5e-3
#: Standard deviations, and loss factor, by which a loop may give energy for its noise and the rig's delay.
_CERTAIN, _NO_LOSS = 5.0, 2e-3
#: Share of the amplitude by which a motion may lie off zero before its middle is taken for unknown.
_CENTRED = 0.01


@dataclass(frozen=True, eq=False)
class Drive:
    """A loop made ready for the model.

    Args:
        loop: the measured loop.
        frequency: [Hz], found from the displacement.
        cycles: whole and broken cycles in the record.
        from_rest: True where the record begins at rest, False where the loop had settled.
        phase: position of each row [cycles from the first row], (n,).
        force: measured force per row, or per bin of phase where the loop is long, (n,).
        weight: rows behind each entry of force, 0 at the turning points, (n,).
        noise: standard deviation of one row's force [N or N m].
        coefficients: complex harmonics of the displacement, mean first.
        half_range: half of the range of the measured force, wild rows aside [N or N m].
        datum: mean of the measured force where the motion lies off zero, else None. Whether a sensor's zero or
            a preload put it there is not known, so such a loop counts from its own middle.
        notes: sentences on what of the record was left out, and on a time that does not go with its rows.
        outliers: by column, rows of the loop that are faults of the record, and how far they lie off [noise].
        first_row: row of the whole record that the loop begins with.
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

    @property
    def amplitude(self) -> float:
        """Zero-to-peak displacement [m or rad]."""
        return float(self.history(settles=False).amplitude[0])

    def displacement(self, phase: Array) -> Array:
        """The motion at any phase [cycles], noise removed."""
        return series(self.coefficients, phase)

    def first_harmonic(self) -> complex:
        """Complex stiffness of the loop's fundamental, force over displacement [N/m or N m/rad]."""
        columns = basis(self.phase, 1)
        _, real, imag = solve(columns * np.sqrt(self.weight)[:, None], self.force * np.sqrt(self.weight))
        return complex(complex(real, imag) / self.coefficients[1])

    def history(self, settles: bool) -> History:
        """The motion as the model wants it: one settled cycle, or the whole record where it must be."""
        return self._settling if settles and not self.from_rest else self._motion

    @cached_property
    def _motion(self) -> History:
        spectrum = np.zeros(GRID // 2 + 1, dtype=complex)
        spectrum[1 : self.coefficients.size] = 0.5 * GRID * self.coefficients[1:]
        cycle = np.fft.irfft(spectrum)
        if not self.from_rest:
            return History.steady(cycle, self.frequency)
        motion = np.resize(cycle - cycle[0], int(np.ceil(self.cycles * GRID)) + 2)
        return History(motion, 1.0 / (self.frequency * GRID), periodic=False, frequency=self.frequency)

    @cached_property
    def _settling(self) -> History:
        count = int(np.ceil(self.cycles - 1e-6))
        return History.steady(np.tile(self._motion.value, count), self.frequency, cycles=count)

    def from_datum(self, response: Array) -> Array:
        """A response over `history`, less its mean where the loop counts from its own middle."""
        return response if self.datum is None else response - response.mean(axis=-1, keepdims=True)

    def at_rows(self, response: Array) -> Array:
        """A response over `history`, linearly interpolated at the rows: (..., n)."""
        length = response.shape[-1]
        if length not in self._places:
            position = self.phase * GRID
            index = position.astype(np.intp)
            ahead = np.minimum(index + 1, length - 1) if self.from_rest else (index + 1) % length
            self._places[length] = index % length, ahead, position - index
        index, ahead, part = self._places[length]
        return response.take(index, axis=-1) * (1.0 - part) + response.take(ahead, axis=-1) * part

    @cached_property
    def _places(self) -> dict[int, tuple[Array, Array, Array]]:
        """By length of the response: the samples before and after each row, and the part of the way between."""
        return {}


def drive_of(loop: Loop, *, without_outliers: bool = False) -> Drive:
    """Find the cycles of a loop and clear its displacement of noise; wild rows of either column do not disturb that.

    Args:
        loop: the measured loop.
        without_outliers: whether rows whose force is wild carry no weight; else they count like any other.

    Raises:
        FitError: the displacement is not one whole cycle or more of a periodic motion, rows are missing, or the loop
            gives energy.
    """
    whole, thin = loop, thinned(loop)
    loop, cut = steady_part(whole, *thin)
    first = int(np.searchsorted(whole.time, loop.time[0]))
    thin = thin if loop is whole else thinned(loop)
    frequency, cycles = fundamental(loop, *thin)
    _check_no_hole(loop, thin[0], frequency)
    motion, force_mean, force_noise, outliers = harmonics(loop, frequency, cycles)
    rows = outliers["force"].rows
    sound = np.delete(loop.force, rows) if rows.size else loop.force
    ends = np.array(by_chunks(lambda part: (sound[part].min(), sound[part].max()), sound.size))
    half_motion, half_force = np.ptp(series(motion, np.arange(GRID) / GRID)) / 2.0, float(np.ptp(ends)) / 2.0
    noise = loop.noise * half_force if loop.noise is not None else force_noise
    from_rest = first == 0 and _from_rest(loop, frequency, half_motion, half_force, noise)
    clock, force = (loop.time - loop.time[0] if loop.time[0] else loop.time), loop.force
    if force.size > MOST_ROWS:
        if without_outliers and rows.size:
            clock, force = np.delete(clock, rows), sound
        phase, force, weight = _binned(clock, force, frequency, cycles, each_cycle=from_rest)
    else:
        phase, weight = clock * frequency, np.ones(force.size)
        weight[rows] = 0.0 if without_outliers else 1.0
    noise = max(noise, FLOOR * half_force)
    off_zero = not from_rest and abs(motion[0]) > _CENTRED * half_motion
    datum = force_mean if off_zero else None
    notes = tuple(filter(None, (cut, wrong_clock(loop, motion))))
    drive = Drive(
        loop,
        frequency,
        cycles,
        from_rest,
        phase,
        force,
        weight,
        noise,
        motion,
        half_force,
        datum,
        notes,
        outliers,
        first,
    )
    drive = replace(drive, weight=np.where(_at_reversal(drive), 0.0, weight))
    _check_loses_energy(drive)
    return drive


def _check_no_hole(loop: Loop, clock: Array, frequency: float) -> None:
    """Across rows that are missing nothing tells how many turns the motion made, nor so its frequency."""
    steps = np.diff(clock)
    widest = int(np.argmax(steps))
    if steps[widest] > HOLE / frequency:
        raise FitError(
            "rows are missing inside the loop",
            file=loop.source.file if loop.source else None,
            found=f"none from {clock[widest]:.4g} to {clock[widest + 1]:.4g} s; how many cycles went by, and so the "
            "frequency, cannot be told",
            expected="no gap longer than a third of a cycle",
            hint="keep the whole cycles before the gap, or those after it",
        )


def _check_loses_energy(drive: Drive) -> None:
    """A bushing loses energy: its force runs ahead of its displacement, beyond noise."""
    stiffness = drive.first_harmonic()
    chance = drive.noise * np.sqrt(2.0 / drive.weight.sum()) / abs(drive.coefficients[1])
    if stiffness.imag < -max(_CERTAIN * chance, _NO_LOSS * abs(stiffness)):
        raise FitError(
            "the loop gives energy, which no bushing does",
            file=drive.loop.source.file if drive.loop.source else None,
            found=f"a loss factor of {stiffness.imag / stiffness.real:.3g}: the force lags behind the displacement",
            expected="a force that runs ahead of the displacement",
            hint="are the columns of displacement and force swapped, or do the rows run backwards in time? Name the "
            'columns in the campaign: columns = { displacement = "...", force = "..." }',
        )


def _at_reversal(drive: Drive) -> Array:
    """Rows within a step of the model's grid from a turning point, where dry friction jumps and no grid can tell when;
    they carry no weight."""
    motion = drive.history(settles=False).value
    cycle = motion if drive.from_rest else np.concatenate((motion[-1:], motion, motion[:1]))
    turns = np.flatnonzero(reversals(cycle)) - (0 if drive.from_rest else 1)
    position = drive.phase * GRID
    if not turns.size:
        return np.zeros(position.shape, dtype=bool)
    if not drive.from_rest:
        position = position % GRID
        turns = np.concatenate((turns, turns + GRID, turns - GRID))
    turns = np.sort(turns)
    after = np.clip(np.searchsorted(turns, position), 1, turns.size - 1)
    nearest = np.minimum(np.abs(position - turns[after - 1]), np.abs(turns[after] - position))
    return nearest < _JUMP


def _from_rest(loop: Loop, frequency: float, half_motion: float, half_force: float, noise: float) -> bool:
    """Whether the record begins with nothing moved, no force, and a force that is another a cycle later.

    A settled loop may pass the origin too, where its load cell is off zero, but then it passes it every cycle.
    """
    if abs(loop.displacement[0]) > _AT_REST * half_motion or abs(loop.force[0]) > _AT_REST * half_force + 3.0 * noise:
        return False
    end = np.searchsorted(loop.time, loop.time[0] + 2.0 / frequency)
    clock, force = loop.time[:end] - loop.time[0], loop.force[:end]
    first = clock[: np.searchsorted(clock, _FIRST / frequency)]
    change = np.interp(first + 1.0 / frequency, clock, force) - force[: first.size]
    chance = 5.0 * noise * np.sqrt(2.0 / first.size)
    return bool(abs(np.median(change)) > max(1.25 * chance, _OTHER * half_force))


def _binned(
    clock: Array, force: Array, frequency: float, cycles: float, each_cycle: bool
) -> tuple[Array, Array, Array]:
    """Mean phase, mean force and number of rows of each filled bin of every cycle, or of cycles taken together: the
    first few are kept apart, because a loop settles over them, and later ones go into ever larger groups."""
    number = np.arange(int(cycles) + 2)
    starts = number
    if not each_cycle:
        later = _APART * _GROWTH ** np.arange(np.log(number.size / _APART) / np.log(_GROWTH))
        starts = np.union1d(np.arange(_APART), later.astype(np.intp))
    group = np.searchsorted(starts, number, side="right") - 1
    middle = np.round(np.bincount(group, weights=number) / np.bincount(group))
    edges = np.append(np.arange(int(cycles * GRID) + 1) / (frequency * GRID), np.inf)

    def sums(bins: slice) -> Array:
        """Of some bins the filled ones, (k,), their rows, and sums of phase in bins and of force over these, (4, k)."""
        start, stop = np.searchsorted(clock, edges[[bins.start, bins.stop]])
        first = np.searchsorted(clock[start:stop], edges[bins])
        filled = np.flatnonzero(np.diff(first, append=stop - start))
        number, first = filled + bins.start, first[filled]
        count = np.diff(first, append=stop - start)
        in_bins = np.add.reduceat(clock[start:stop], first) * (frequency * GRID) - count * number
        return np.stack((number, count, in_bins, np.add.reduceat(force[start:stop], first)))

    chunks = by_chunks(sums, edges.size - 1, 1 + CHUNK * edges.size // clock.size)
    bins, *parts = np.concatenate(chunks, axis=1)
    bins = bins.astype(np.intp)
    place = GRID * group[bins // GRID] + bins % GRID
    rows, inside, total = (np.bincount(place, weights=part) for part in parts)
    filled = np.flatnonzero(rows)
    rows, inside, total = rows[filled], inside[filled], total[filled]
    phase = middle[filled // GRID] + (filled % GRID + inside / rows) / GRID
    return phase, total / rows, rows
