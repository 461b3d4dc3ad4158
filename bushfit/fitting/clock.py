"""The clock of a loop: its frequency and how many cycles it holds, from the displacement alone."""

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.fourier import basis, derivative, least_squares, resolved_order, spread_rows
from bushfit.fitting.loop_harmonics import residual_limit
from bushfit.fitting.runin import crossings
from bushfit.reading.measurement import Loop

#: Harmonics by which a frequency is refined at most; chosen: what a triangle has beyond them shifts no phase.
_MOST_HARMONICS = 15
#: Rounds of Gauss-Newton at most; chosen: nearly all frequencies take three to six.
_MOST_ROUNDS = 10
#: Step relative to the frequency below which Gauss-Newton has ended: rounding.
_SETTLED = 1e-12
#: Step relative to the frequency that Gauss-Newton takes at most: farther off it is not linear.
_LARGEST_STEP = 0.05
#: Rows that are enough to refine a frequency.
_ENOUGH_ROWS = 2000
#: Distance between the ends of a record, as a share of its range, from which on it holds no whole cycle: more than
#: any noise.
_OPEN = 0.1
#: Distance between the ends of a closed cycle at most, as a share of it or of its amplitude.
_CLOSED = 0.04
#: Share of the record at either end through which a line is drawn.
_END = 0.02
#: Cycles, counted by one stroke, from which on a record is no single closed one.
_MORE_THAN_ONE = 1.01
#: The same where the ends of the record meet all the same: standing still at an extreme they may, and a motion may
#: take longer one way than the other.
_MORE_THAN_ONE_THAT_MEETS = 1.1
#: Error of an end's line relative to its length from which on the motion stands still there.
_STANDS_STILL = 0.25
#: Standard deviations within which a period is taken for that of the record.
_SAME = 4.0
#: Root mean square by which what comes after one cycle may differ from its start, relative to the amplitude.
_REPEATS = 0.02
#: The same in units of the scatter of neighbouring rows, where that is more.
_REPEATS_SCATTER = 6.0


def fundamental(loop: Loop, clock: Array, displacement: Array) -> tuple[float, float]:
    """Frequency [Hz] and number of cycles of a loop without run-in.

    The clock [s] and the displacement [m or rad], (n,) each, are of rows that are enough to find the cycles.

    Raises:
        FitError: the loop does not hold a whole cycle.

    Notes:
        Several cycles are counted by crossings of the middle in one sense, and their frequency is refined by
        Gauss-Newton on the motion. A single one is known by its ends, which meet going the same way.
    """
    (x, before, after), clock = crossings(displacement), clock - loop.time[0]
    times = clock[before] - x[before] * (clock[after] - clock[before]) / (x[after] - x[before])
    rows = loop.time.size
    closed = float(loop.time[-1] - loop.time[0]) * rows / (rows - 1)
    same_sense = max(times[x[after] > 0.0], times[x[after] < 0.0], key=len)
    if same_sense.size > 1:
        counted = (same_sense.size - 1) / float(same_sense[-1] - same_sense[0])
        frequency = _refined(clock, x, counted, rows / (closed * counted))
        return frequency, closed * frequency
    return _of_one_cycle(loop, clock, x, times)


def _of_one_cycle(loop: Loop, clock: Array, x: Array, across: Array) -> tuple[float, float]:
    """As `fundamental`, of a loop that crosses its middle but once in either sense, at the times `across` [s]."""
    rows, motion = loop.time.size, loop.displacement
    duration = float(loop.time[-1] - loop.time[0])
    closed = duration * rows / (rows - 1)
    apart = abs(motion[-1] - motion[0])
    stride = np.abs(np.diff(motion[[0, 1, -2, -1]]))[[0, 2]].mean()
    whole = duration if apart < 0.5 * stride else closed
    period = _period_by_ends(clock, x, duration, whole)
    if period is not None:
        return 1.0 / period, closed / period
    stroke = float(across[1] - across[0]) if across.size == 2 else np.inf
    meets = apart < _CLOSED * np.ptp(x) / 2.0 + 1.5 * stride
    if closed > (_MORE_THAN_ONE_THAT_MEETS if meets else _MORE_THAN_ONE) * 2.0 * stroke:
        frequency = _refined(clock, x, 0.5 / stroke, rows)
        if closed * frequency > 1.0 and _repeats(clock, x, 1.0 / frequency):
            return frequency, closed * frequency
    if apart > _OPEN * np.ptp(x):
        raise FitError(
            "the loop does not hold a whole cycle",
            file=loop.source.file if loop.source else None,
            found=f"displacement from {motion[0]:.4g} to {motion[-1]:.4g} {loop.direction.motion.displacement_unit}",
            expected="at least one closed cycle",
            hint="export the whole cycle, or several",
        )
    return 1.0 / whole, closed / whole


def _period_by_ends(clock: Array, x: Array, duration: float, whole: float) -> float | None:
    """Period of a motion whose last rows meet its first, going the same way; None where they do not, or stand still.

    Both ends are drawn as straight lines. They tell how far beyond one cycle the record goes, or how short of it it
    stops; within their error it is just one cycle, of the period `whole` [s].
    """
    few = max(3, int(_END * x.size))
    first, first_slope, first_scatter = _line(clock[:few] - clock[0], x[:few])
    last, last_slope, last_scatter = _line(clock[-few:] - clock[-1], x[-few:])
    slope, step = (first_slope + last_slope) / 2.0, duration / (x.size - 1)
    if first_slope * last_slope <= 0.0 or abs(last - first) > _CLOSED * duration * abs(slope):
        return None
    error = np.hypot(first_scatter, last_scatter) * np.sqrt(4.0 / few) / abs(slope)
    if error > _STANDS_STILL * few * step:
        return None
    period = duration - (last - first) / slope
    return period if period < whole - max(1.5 * step, _SAME * error) else whole


def _line(time: Array, x: Array) -> tuple[float, float, float]:
    """Value at time 0, slope, and scatter about them, of the line through some rows."""
    line = np.polynomial.Polynomial.fit(time, x, 1)
    return float(line(0.0)), float(line.deriv()(0.0)), float(np.std(x - line(time)))


def _refined(clock: Array, x: Array, frequency: float, rows_per_cycle: float) -> float:
    """Frequency [Hz] of several cycles, by Gauss-Newton on the motion's harmonics and their frequency together."""
    chosen = spread_rows(x.size, _ENOUGH_ROWS)
    time, motion = clock[chosen], x[chosen]
    order = resolved_order(rows_per_cycle * chosen.size / x.size, _MOST_HARMONICS)
    columns = basis(time * frequency, order)
    solution = least_squares(columns, motion)
    for _ in range(_MOST_ROUNDS):
        residual = motion - columns @ solution
        kept = np.abs(residual) <= residual_limit(solution, residual, residual.size)
        by_frequency = 2.0 * np.pi * time * (columns @ derivative(solution))
        found = least_squares(np.column_stack((columns, by_frequency)), motion, kept)
        step = float(np.clip(found[-1], -_LARGEST_STEP * frequency, _LARGEST_STEP * frequency))
        frequency += step
        if abs(step) < _SETTLED * frequency:
            break
        columns, solution = basis(time * frequency, order), found[:-1]
    return frequency


def _repeats(clock: Array, x: Array, period: float) -> bool:
    """Whether what comes after one period is what the motion began with."""
    begin = int(np.searchsorted(clock, period))
    if x.size - begin < 2:
        return True
    off = x[begin:] - np.interp(clock[begin:] - period, clock, x)
    scatter = np.median(np.abs(np.diff(x, 2))) if x.size > 4 else 0.0
    return float(np.sqrt(np.mean(np.square(off)))) < max(_REPEATS * np.ptp(x) / 2.0, _REPEATS_SCATTER * scatter)
