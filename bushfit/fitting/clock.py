"""The clock of a loop: its frequency and how many cycles it holds, from the displacement alone."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.harmonics import basis, order, reach, sample, solve, turned
from bushfit.reading.measurement import Loop

_HARMONICS, _MOST_ROUNDS, _SETTLED = 15, 10, 1e-12
#: Rows that are enough to refine a frequency.
_ENOUGH = 2000
#: Share of the range on either side of the middle within which the motion is not yet across.
_BAND = 0.1
#: A closed cycle ends where it began within this share of it, or of its amplitude; part of it by which its ends are
#: drawn.
_CLOSED, _END = 0.04, 0.02
#: Cycles, counted by one stroke, from which on a record is no single closed one, and where its ends meet all the same:
#: standing still at an extreme they may, and a motion may take longer one way than the other.
_MORE_THAN_ONE, _MEETS_ALL_THE_SAME = 1.01, 1.1
#: An end whose line is no better known than this share of its length stands still.
_STANDS = 0.25
#: Standard deviations within which a period is taken for that of the record.
_SAME = 4.0
#: Share of the amplitude, and scatter, within which what comes after one cycle repeats its start.
_REPEATS, _REPEATS_SCATTER = 0.02, 6.0


def fundamental(loop: Loop, clock: Array, x: Array) -> tuple[float, float]:
    """Frequency [Hz] and number of cycles of a loop.

    Several cycles are counted by crossings in one sense, and their frequency is refined by Gauss-Newton on the motion.
    A single one is known by its ends, which meet going the same way.

    Args:
        loop: periodic, without run-in.
        clock: and
        x: time and displacement of rows that are enough to find the cycles, gross ones left out.

    Raises:
        FitError: the loop does not hold a whole cycle.
    """
    x, clock = x - (x.max() + x.min()) / 2.0, clock - loop.time[0]
    band = _BAND * np.ptp(x)
    state = np.where(x > band, 1, np.where(x < -band, -1, 0))
    marks = np.flatnonzero(state)
    across = np.flatnonzero(state[marks[1:]] != state[marks[:-1]])
    before, after = marks[across], marks[across + 1]
    times = clock[before] - x[before] * (clock[after] - clock[before]) / (x[after] - x[before])
    crossings = max((times[state[after] == sense] for sense in (1, -1)), key=len)
    rows = loop.time.size
    duration = float(loop.time[-1] - loop.time[0])
    closed = duration * rows / (rows - 1)
    if crossings.size > 1:
        counted = (crossings.size - 1) / float(crossings[-1] - crossings[0])
        frequency = _refined(clock, x, counted, rows / (closed * counted))
        return frequency, closed * frequency
    apart = abs(loop.displacement[-1] - loop.displacement[0])
    stride = np.abs(np.diff(loop.displacement[[0, 1, -2, -1]]))[[0, 2]].mean()
    whole = duration if apart < 0.5 * stride else closed
    period = _met(clock, x, duration, whole)
    if period is None and times.size == 2:
        stroke = float(times[1] - times[0])
        meets = apart < _CLOSED * np.ptp(x) / 2.0 + 1.5 * stride
        least = _MEETS_ALL_THE_SAME if meets else _MORE_THAN_ONE
        if closed > least * 2.0 * stroke:
            frequency = _refined(clock, x, 0.5 / stroke, rows)
            if closed * frequency > 1.0 and _repeats(clock, x, 1.0 / frequency):
                return frequency, closed * frequency
    if period is None and apart > band:
        unit = loop.direction.motion.displacement_unit
        raise FitError(
            "the loop does not hold a whole cycle",
            file=loop.source.file if loop.source else None,
            found=f"displacement from {loop.displacement[0]:.4g} to {loop.displacement[-1]:.4g} {unit}",
            expected="at least one closed cycle",
            hint="export the whole cycle, or several",
        )
    period = period or whole
    return 1.0 / period, closed / period


def _met(clock: Array, x: Array, duration: float, whole: float) -> float | None:
    """Period of a motion whose last rows meet its first, going the same way; None where they do not, or stand still.

    Both ends are drawn as straight lines. They tell how far beyond one cycle the record goes, or how short of it it
    stops; within their error it is the whole record.
    """
    few = max(3, int(_END * x.size))
    first, one, scatter = _end(clock[:few] - clock[0], x[:few])
    last, other, more = _end(clock[-few:] - clock[-1], x[-few:])
    slope, step = (one + other) / 2.0, duration / (x.size - 1)
    if one * other <= 0.0 or abs(last - first) > _CLOSED * duration * abs(slope):
        return None
    error = np.hypot(scatter, more) * np.sqrt(4.0 / few) / abs(slope)
    if error > _STANDS * few * step:
        return None
    period = duration - (last - first) / slope
    return period if period < whole - max(1.5 * step, _SAME * error) else whole


def _end(time: Array, x: Array) -> tuple[float, float, float]:
    """Value at time 0, slope, and scatter about them, of the line through some rows."""
    line = np.polynomial.Polynomial.fit(time, x, 1)
    return float(line(0.0)), float(line.deriv()(0.0)), float(np.std(x - line(time)))


def _refined(clock: Array, x: Array, frequency: float, rows_per_cycle: float) -> float:
    """Gauss-Newton on the motion's harmonics and their frequency together."""
    chosen = sample(x.size, _ENOUGH)
    time, motion = clock[chosen], x[chosen]
    number = order(rows_per_cycle * chosen.size / x.size, _HARMONICS)
    columns = basis(time * frequency, number)
    shape = solve(columns, motion)
    for _ in range(_MOST_ROUNDS):
        left = motion - columns @ shape
        sound = np.abs(left) <= reach(shape, left, left.size)
        angle_slope = 2.0 * np.pi * time * (columns @ turned(shape))
        solution = solve(np.column_stack((columns, angle_slope)), motion, sound)
        step = float(np.clip(solution[-1], -0.05 * frequency, 0.05 * frequency))
        frequency += step
        if abs(step) < _SETTLED * frequency:
            break
        columns, shape = basis(time * frequency, number), solution[:-1]
    return frequency


def _repeats(clock: Array, x: Array, period: float) -> bool:
    """Whether what comes after one period is what the motion began with."""
    begin = int(np.searchsorted(clock, period))
    if x.size - begin < 2:
        return True
    off = x[begin:] - np.interp(clock[begin:] - period, clock, x)
    scatter = np.median(np.abs(np.diff(x, 2))) if x.size > 4 else 0.0
    return float(np.sqrt(np.mean(np.square(off)))) < max(_REPEATS * np.ptp(x) / 2.0, _REPEATS_SCATTER * scatter)
