"""What drives the model in a loop: the measured displacement, cleared of its noise.

A loop's displacement is periodic. It is written as the harmonics that rise above its noise, found by least
squares at the samples as they are (any number of cycles, sine or triangle, evenly sampled or not), so the
turning points that friction needs are those of the motion and not of the sensor.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bushfit.effects.contract import Array
from bushfit.effects.history import History, reversals
from bushfit.errors import FitError
from bushfit.fitting.noise import FLOOR
from bushfit.fitting.runin import steady_part
from bushfit.measurement import Loop

#: Samples of the model's cycle; measured rows lie between them and are reached by linear interpolation.
GRID = 1024
#: Loops with more rows than this are averaged into as many bins of phase.
MOST_ROWS = 4 * GRID
#: Rows that are enough to find the cycles.
_ENOUGH_ROWS = 200_000
#: Cycles whose bins are kept apart, and how fast the groups of later ones grow.
_APART, _GROWTH = 4, 1.5
_GOLDEN = 0.6180339887498949
_HARMONICS = 60
_CLOCK_HARMONICS = 15
#: Harmonics of one cycle that count as slow, when the scatter between cycles is taken.
_SLOW_HARMONICS = 3
#: Steps of the grid about a turning point in which rows carry no weight.
_JUMP = 1.5
_SIGNIFICANT = 4.0
#: A motion is a triangle where that leaves no more than this times what free harmonics leave.
_ALIKE = 1.02
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
        datum: mean of the measured force where the motion lies off zero, else None. Whether a sensor's zero or
            a preload put it there is not known, so such a loop counts from its own middle.
        note: what of the record was left out, in words; None where nothing was.
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
    datum: float | None = None
    note: str | None = None

    @property
    def half_range(self) -> float:
        """Half of the range of the measured force [N or N m]."""
        return float(np.ptp(self.force)) / 2.0

    @property
    def amplitude(self) -> float:
        """Zero-to-peak displacement [m or rad]."""
        return float(self.history(settles=False).amplitude[0])

    def displacement(self, phase: Array) -> Array:
        """The motion at any phase [cycles], noise removed."""
        return series(self.coefficients, phase)

    def first_harmonic(self) -> complex:
        """Complex stiffness of the loop's fundamental, force over displacement [N/m or N m/rad]."""
        basis = _basis(self.phase, 1)
        _, real, imag = _solve(basis * np.sqrt(self.weight)[:, None], self.force * np.sqrt(self.weight))
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


def series(coefficients: Array, phase: Array) -> Array:
    """Re sum_k c_k exp(2 pi i k phase) at any phase [cycles], (n,)."""
    turn, value = np.exp(2j * np.pi * phase), np.zeros(phase.shape, dtype=complex)
    for coefficient in coefficients[::-1]:
        value = value * turn + coefficient
    return value.real


def drive_of(loop: Loop) -> Drive:
    """Find the cycles of a loop and clear its displacement of noise.

    Raises:
        FitError: the displacement is not one whole cycle or more of a periodic motion, or the loop gives energy.
    """
    begin = loop.time[0]
    loop, note = steady_part(loop)
    frequency, cycles = _fundamental(loop)
    half_motion, half_force = np.ptp(loop.displacement) / 2.0, np.ptp(loop.force) / 2.0
    motion, force_mean, force_noise = _harmonics(loop, frequency, cycles)
    noise = loop.noise * half_force if loop.noise is not None else force_noise
    from_rest = loop.time[0] == begin and _from_rest(loop, frequency, half_motion, half_force, noise)
    if loop.force.size > MOST_ROWS:
        phase, force, weight = _binned(loop, frequency, cycles, each_cycle=from_rest)
    else:
        phase, force, weight = (loop.time - loop.time[0]) * frequency, loop.force, np.ones(loop.force.size)
    noise = max(noise, FLOOR * half_force)
    off_zero = not from_rest and abs(motion[0]) > _CENTRED * half_motion
    datum = force_mean if off_zero else None
    drive = Drive(loop, frequency, cycles, from_rest, phase, force, weight, noise, motion, datum, note)
    drive = replace(drive, weight=np.where(_at_reversal(drive), 0.0, weight))
    _check_loses_energy(drive)
    return drive


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
    clock = loop.time - loop.time[0]
    first = clock[: np.searchsorted(clock, _FIRST / frequency)]
    change = np.interp(first + 1.0 / frequency, clock, loop.force) - loop.force[: first.size]
    chance = 5.0 * noise * np.sqrt(2.0 / first.size)
    return bool(abs(change.mean()) > max(chance, _OTHER * half_force))


def _fundamental(loop: Loop) -> tuple[float, float]:
    """Frequency [Hz] and number of cycles: from crossings in one sense, refined by Gauss-Newton on the motion."""
    step = -(-loop.time.size // _ENOUGH_ROWS)
    x = loop.displacement[::step] - (loop.displacement.max() + loop.displacement.min()) / 2.0
    band = 0.1 * np.ptp(x)
    state = np.where(x > band, 1, np.where(x < -band, -1, 0))
    marks = np.flatnonzero(state)
    turns = marks[1:][state[marks[1:]] != state[marks[:-1]]]
    crossings = step * max((turns[state[turns] == sense] for sense in (1, -1)), key=len)
    duration = float(loop.time[-1] - loop.time[0])
    closed = duration * loop.time.size / (loop.time.size - 1)
    if crossings.size < 2:
        apart = abs(loop.displacement[-1] - loop.displacement[0])
        if apart > band:
            unit = loop.direction.displacement_unit
            raise FitError(
                "the loop does not hold a whole cycle",
                file=loop.source.file if loop.source else None,
                found=f"displacement from {loop.displacement[0]:.4g} to {loop.displacement[-1]:.4g} {unit}",
                expected="at least one closed cycle",
                hint="export the whole cycle, or several",
            )
        stride = np.abs(np.diff(loop.displacement[[0, 1, -2, -1]]))[[0, 2]].mean()
        period = duration if apart < 0.5 * stride else closed
        return 1.0 / period, closed / period
    frequency = (crossings.size - 1) / float(loop.time[crossings[-1]] - loop.time[crossings[0]])
    order = _order(loop.time.size / (closed * frequency), _CLOCK_HARMONICS)
    sample = slice(None, None, max(1, x.size // 2000))
    time, motion = loop.time[::step][sample] - loop.time[0], x[sample]
    for _ in range(4):
        basis = _basis(time * frequency, order)
        angle_slope = 2.0 * np.pi * time * (basis @ _turned(_solve(basis, motion)))
        solution = _solve(np.column_stack((basis, angle_slope)), motion)
        frequency += float(np.clip(solution[-1], -0.05 * frequency, 0.05 * frequency))
    return frequency, closed * frequency


def _order(rows_per_cycle: float, most: int) -> int:
    """As many harmonics as the rows of one cycle carry."""
    return int(np.clip(rows_per_cycle / 5, 1, most))


def _basis(phase: Array, order: int) -> Array:
    """Columns 1, cos, -sin of each harmonic, (n, 2 order + 1)."""
    turn = np.exp(2j * np.pi * phase)
    powers = np.cumprod(np.broadcast_to(turn, (order, phase.size)), axis=0)
    rows = np.empty((2 * order + 1, phase.size))
    rows[0], rows[1 : order + 1] = 1.0, powers.real
    np.negative(powers.imag, out=rows[order + 1 :])
    return rows.T


def _solve(basis: Array, values: Array) -> Array:
    """Least squares by normal equations; harmonics over whole cycles are nearly orthogonal."""
    return np.linalg.solve(basis.T @ basis, basis.T @ values)


def _turned(solution: Array) -> Array:
    """Coefficients of the derivative by phase (in radians) of a harmonic series."""
    order = (solution.size - 1) // 2
    number = np.arange(1, order + 1)
    return np.concatenate(([0.0], number * -solution[order + 1 :], number * solution[1 : order + 1]))


def _harmonics(loop: Loop, frequency: float, cycles: float) -> tuple[Array, float, float]:
    """Significant harmonics of the displacement, and the force's mean and scatter about its own harmonics.

    The scatter holds what does not repeat from cycle to cycle and what is too fast for the rubber, but not what
    changes slowly from one cycle to the next, which is settling or drift.
    """
    sample = _sample(loop.time.size)
    phase = (loop.time[sample] - loop.time[0]) * frequency
    values = np.column_stack((loop.displacement[sample], loop.force[sample]))
    order = _order(loop.time.size / max(cycles, 1.0), _HARMONICS)
    basis = _basis(phase, order)
    solution = _solve(basis, values)
    freedom = max(phase.size - 2 * order - 1, 1)
    left = values - basis @ solution
    motion_noise = np.sqrt(np.sum(np.square(left[:, 0])) / freedom)
    force_noise = _scatter(phase, left[:, 1], freedom)
    motion = solution[:, 0]
    coefficients = np.concatenate((motion[:1], motion[1 : order + 1] + 1j * motion[order + 1 :]))
    keep = np.abs(coefficients) > _SIGNIFICANT * motion_noise * np.sqrt(2.0 / phase.size)
    keep[:2] = True
    motion = np.where(keep, coefficients, 0.0)[: int(np.flatnonzero(keep)[-1]) + 1]
    triangle = _triangle(motion[0], motion[1])
    if np.std(values[:, 0] - series(triangle, phase)) < _ALIKE * motion_noise:
        motion = triangle
    return motion, float(solution[0, 1]), force_noise


def _scatter(phase: Array, left: Array, freedom: int) -> float:
    """Standard deviation of what is left of the force once each cycle has given up its own slow part."""
    number = np.floor(phase).astype(np.intp)
    order = 2 * _SLOW_HARMONICS + 1
    left = left.copy()
    for cycle in np.unique(number):
        rows = np.flatnonzero(number == cycle)
        if rows.size > 4 * order:
            slow = _basis(phase[rows], _SLOW_HARMONICS)
            left[rows] -= slow @ np.linalg.lstsq(slow, left[rows], rcond=None)[0]
            freedom -= order
    return float(np.sqrt(np.sum(np.square(left)) / max(freedom, 1)))


def _triangle(mean: complex, fundamental: complex) -> Array:
    """Harmonics of the triangle of that mean and fundamental: c_k falls as 1/k^2, so its corners need them all."""
    order = np.arange(1, GRID // 2, 2)
    turn = 1j * fundamental / abs(fundamental)
    coefficients = np.zeros(GRID // 2, dtype=complex)
    coefficients[0] = mean
    coefficients[order] = -1j * abs(fundamental) * (-1.0) ** (order // 2) / order**2 * turn**order
    return coefficients


def _binned(loop: Loop, frequency: float, cycles: float, each_cycle: bool) -> tuple[Array, Array, Array]:
    """Mean phase, mean force and number of rows of each filled bin of every cycle, or of cycles taken together: the
    first few are kept apart, because a loop settles over them, and later ones go into ever larger groups."""
    number = np.arange(int(cycles) + 2)
    starts = number
    if not each_cycle:
        later = _APART * _GROWTH ** np.arange(np.log(number.size / _APART) / np.log(_GROWTH))
        starts = np.union1d(np.arange(_APART), later.astype(np.intp))
    group = np.searchsorted(starts, number, side="right") - 1
    middle = np.round(np.bincount(group, weights=number) / np.bincount(group))
    clock = loop.time - loop.time[0]
    first_rows = np.searchsorted(clock, np.arange(int(cycles * GRID) + 1) / (frequency * GRID))
    bins = np.flatnonzero(np.diff(first_rows, append=clock.size))  # the filled ones
    edges = first_rows[bins]
    count = np.diff(edges, append=clock.size).astype(float)
    place = GRID * group[bins // GRID] + bins % GRID
    rows, inside, force = (
        np.bincount(place, weights=sums)
        for sums in (
            count,
            np.add.reduceat(clock, edges) * (frequency * GRID) - count * bins,
            np.add.reduceat(loop.force, edges),
        )
    )
    filled = np.flatnonzero(rows)
    rows, inside, force = rows[filled], inside[filled], force[filled]
    phase = middle[filled // GRID] + (filled % GRID + inside / rows) / GRID
    return phase, force / rows, rows


def _sample(rows: int) -> NDArray[np.intp]:
    """Rows that stand for all: every one of few, else spread evenly, but in no step that could keep time with the
    cycles."""
    count = min(rows, MOST_ROWS)
    number = np.arange(count)
    return (number if count == rows else (number + number * _GOLDEN % 1.0) * (rows / count)).astype(np.intp)
