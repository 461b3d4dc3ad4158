"""The cycles of a long motion: where each begins, which of them agree, and which belong to one steady state.

They are counted on the displacement, in arrays of all rows or of all cycles at once.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import comb, prod

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.measurement import Complex, Floats
from bushfit.reading.parallel import CHUNK
from bushfit.reduction.scatter import MEDIAN_TO_SIGMA, scatter

#: Rows of an array.
Integers = NDArray[np.intp]

#: Standard deviations of the noise by which a turning point stands out; chosen: noise goes half as far in 10^6 rows.
_PROMINENCE_NOISE = 10.0
#: Steps of the analogue-to-digital converter by which a turning point stands out; chosen: it flickers between two.
_PROMINENCE_STEPS = 4.0
#: Share of the whole range by which a turning point stands out; chosen: the range of a step is far larger.
_PROMINENCE_SHARE = 1e-3
#: Order of the differences that leave noise and no motion; chosen: 0.2 % of a sine of ten rows a cycle stays.
_DIFFERENCE_ORDER = 6
#: Standard deviation of such differences over that of a row: the root of the sum of squared binomials.
_DIFFERENCE_GAIN = comb(2 * _DIFFERENCE_ORDER, _DIFFERENCE_ORDER) ** 0.5
#: Rows of a window in which noise is measured; chosen: enough for a median.
_WINDOW_ROWS = 256
#: Windows in which noise is measured; chosen: more tell nothing new of a long record.
_MOST_WINDOWS = 2000
#: Quantile of the windows that gives the noise: those with the least motion.
_QUIET_QUANTILE = 0.1
#: Variance of a row less the cubic through two neighbours on either side at even times, over that of a row: their
#: weights are -1/6, 4/6, 4/6 and -1/6.
_EVEN_GAIN = 1.0 + (2.0 * 4.0**2 + 2.0) / 36.0
#: [cycles] Distance from its phase up to which a motion goes on; chosen: another start meets it once in ten times.
SAME_PHASE = 0.05
#: [ln of a period] Difference from which neighbouring cycles are not of one run; chosen: far beyond that of a step.
_SAME_PERIOD = 0.1
#: [ln of a range] Difference from which neighbouring cycles are not of one run; chosen: far beyond that of a step.
_SAME_RANGE = 0.25
#: Share of a cycle that its longest hole may take; chosen: a fundamental needs rows on all sides of it.
HOLE = 0.34
#: Determinant of the normal equations, relative to its rows, from which a cycle's fundamental can be solved for.
_LEAST_DETERMINANT = 1e-3
#: Chi-square that a split has to save; chosen: scatter saves half as much at the best of many places.
_SPLIT_GAIN = 40.0
#: Relative difference of two frequencies that are worth a split; chosen: smaller ones are a rig's wander.
_OTHER_FREQUENCY = 1e-3
#: Relative difference of two amplitudes that are worth a split; chosen: smaller ones are a rig's wander.
_OTHER_AMPLITUDE = 0.02
#: Share of a period to which a crossing is known at best; chosen: no rig is more even.
_LEAST_JITTER = 5e-4
#: Share of an amplitude to which it is known at best; chosen: no rig is more even.
_LEAST_SCATTER = 5e-4
#: Cycles on either side of a split: two crossings more than a line needs.
_FEWEST_CYCLES = 2
#: Pieces of the shortest sweep of frequency; chosen: fewer may be steps.
_FEWEST_IN_SWEEP = 4
#: Share of the change between pieces that lies within them in a sweep: 1 in a perfect one, 0 between steps.
_SWEPT_SHARE = 0.5
#: Share of a step that may be transient at its start; chosen: half of it has to be steady.
_MOST_TRANSIENT = 0.5
#: Share of a step that may be no longer steady at its end; chosen: a rig that stops takes less.
_MOST_ENDING = 0.25


@dataclass(frozen=True, eq=False)
class Cycles:
    """The cycles of a motion, from one upward crossing of its middle to the next.

    Args:
        time: of each row [s], (n,).
        edges: time of the crossings [s], (m + 1,).
        first_rows: first row after each crossing, (m + 1,).
        range: peak to peak of each cycle [m or rad], (m,).
    """

    time: Floats
    edges: Floats
    first_rows: Integers
    range: Floats

    @classmethod
    def of(cls, time: Floats, motion: Floats) -> "Cycles":
        """The cycles of a motion, at any frequency and of any amplitude that stands out of the noise."""
        turns = turning_points(motion, least_prominence(motion))
        if turns.size < 4:
            return cls(time, np.empty(0), np.empty(0, dtype=np.intp), np.empty(0))
        height = motion[turns]
        middle = (height[1:] + height[:-1]) / 2.0
        if middle.size > 4:  # the record cuts the first and the last stroke short
            middle[[0, -1]] = 2.0 * middle[[1, -2]] - middle[[2, -3]]
        upward = np.flatnonzero((height[:-1] < middle) & (middle < height[1:]))
        edges = middle_crossings(time, motion, turns, middle)[upward]
        peak, trough = height[upward[:-1] + 1], height[upward[:-1] + 2]
        return cls(time, edges, np.searchsorted(time, edges).astype(np.intp), peak - trough)

    def runs(self) -> list[slice]:
        """Runs of cycles whose periods and ranges are alike from one to the next, without holes."""
        if self.range.size == 0:
            return []
        period = np.diff(self.edges)
        before = self.first_rows - 1
        gap = np.maximum.reduceat(np.diff(self.time[: before[-1] + 2]), before[:-1])
        hole = gap > HOLE * period
        other = (np.abs(np.diff(np.log(period))) > _SAME_PERIOD) | (np.abs(np.diff(np.log(self.range))) > _SAME_RANGE)
        border = np.concatenate(([0], 1 + np.flatnonzero(other | hole[1:] | hole[:-1]), [period.size]))
        return [slice(int(a), int(b)) for a, b in pairwise(border) if not hole[a]]

    def fundamentals(self, run: slice, values: Floats) -> Complex:
        """Complex fundamental of a channel, (n,), in each cycle of a run, (k,): least squares, with its mean."""
        edges, first = self.edges[run.start : run.stop + 1], self.first_rows[run.start : run.stop + 1]
        rows = slice(first[0], first[-1])
        count = np.diff(first)
        phase = (self.time[rows] - np.repeat(edges[:-1], count)) / np.repeat(np.diff(edges), count)
        turn = np.exp(-2j * np.pi * phase)

        def summed(series: NDArray[np.generic]) -> NDArray[np.generic]:
            return np.add.reduceat(series, first[:-1] - first[0])

        once, twice, wave = summed(turn), summed(turn * turn), summed(values[rows] * turn)
        size, total = count.astype(float), summed(values[rows])
        # unknowns: mean, cosine and negative sine; turn = cosine - i sine
        rows_of_gram = [
            [size, once.real, once.imag],
            [once.real, (size + twice.real) / 2.0, twice.imag / 2.0],
            [once.imag, twice.imag / 2.0, (size - twice.real) / 2.0],
        ]
        gram = np.moveaxis(np.array(rows_of_gram), -1, 0)
        right = np.stack((total, wave.real, wave.imag), axis=1)
        solved = np.full((count.size, 3), np.nan)
        sound = np.abs(np.linalg.det(gram / np.maximum(size, 1.0)[:, None, None])) > _LEAST_DETERMINANT
        solved[sound] = np.linalg.solve(gram[sound], right[sound][..., None])[..., 0]
        fundamental = solved[:, 1] + 1j * solved[:, 2]
        rough = (self.range[run] / 2.0).astype(complex)  # for cycles of too few rows, which make no point
        return np.where(sound, fundamental, rough)


def middle_crossings(time: Floats, motion: Floats, turns: Integers, middle: Floats) -> Floats:
    """Time at which each stroke from one turning point to the next crosses its middle [s], (strokes,)."""
    sense, length = np.sign(np.diff(motion[turns])), np.diff(turns)
    strokes = motion[turns[0] : turns[-1]]
    before = (strokes - np.repeat(middle, length)) * np.repeat(sense, length) < 0.0
    row = turns[:-1] + np.add.reduceat(before, turns[:-1] - turns[0], dtype=np.intp)
    row = np.clip(row, turns[:-1] + 1, turns[1:])
    rise = motion[row] - motion[row - 1]
    part = np.clip((middle - motion[row - 1]) / np.where(rise == 0.0, 1.0, rise), 0.0, 1.0)
    return time[row - 1] + part * (time[row] - time[row - 1])


def least_prominence(values: Floats) -> float:
    """How far a turning point of a channel has to stand out to be none of noise, in the units of the values."""
    change = np.abs(np.diff(values))
    converter_step = float(change[change > 0.0].min(initial=np.inf))
    least = _PROMINENCE_SHARE * float(np.ptp(values))
    rows = min(_WINDOW_ROWS, values.size)
    if rows > _DIFFERENCE_ORDER:
        count = min(_MOST_WINDOWS, values.size // rows)
        starts = np.linspace(0, values.size - rows, count).astype(np.intp)
        windows = np.lib.stride_tricks.sliding_window_view(values, rows)[starts]
        differences = np.abs(np.diff(windows, _DIFFERENCE_ORDER, axis=1))
        noise = np.median(differences, axis=1) * (MEDIAN_TO_SIGMA / _DIFFERENCE_GAIN)
        least = max(least, _PROMINENCE_NOISE * float(np.quantile(noise, _QUIET_QUANTILE)))
    return max(least, _PROMINENCE_STEPS * converter_step if converter_step < least else 0.0)


def lone_outliers(time: Floats, values: Floats) -> NDArray[np.bool_]:
    """Which rows of a channel, (n,), lie alone far off their neighbours, as faults of a record do, (n,).

    Notes:
        Such a row is farther off the cubic through the two rows before and the two after it than these spread, and
        than noise goes; a cubic through rows at uneven times magnifies noise, which is allowed for. No sine does that,
        however few rows it has, nor the kink of dry friction.
    """
    outliers = np.zeros(values.size, dtype=bool)
    least = least_prominence(values)
    for start in range(0, values.size - 4, CHUNK):
        rows = slice(start, start + CHUNK + 4)
        own, clock = values[rows], time[rows]
        stop = own.size - 4
        near = [own[place : stop + place] for place in (0, 1, 3, 4)]
        apart = [clock[place : stop + place] - clock[2 : stop + 2] for place in (0, 1, 3, 4)]
        cubic, gain = np.zeros(stop), np.ones(stop)
        for value, node in zip(near, apart, strict=True):
            weight = prod(other / (other - node) for other in apart if other is not node)
            cubic += weight * value
            gain += weight * weight
        reach = least * np.sqrt(gain / _EVEN_GAIN)
        outliers[start + 2 : start + 2 + stop] = np.abs(own[2:-2] - cubic) > np.ptp(near, axis=0) + reach
    return outliers


def turning_points(values: Floats, least: float) -> Integers:
    """Rows of the turning points that stand out by `least` or more, highs and lows in turn.

    Notes:
        Neighbouring turning points that are less than `least` apart are taken out in pairs, the closest first, many
        pairs at a time. The extremes between which the values go up or down by more than that stay.
    """
    moved = np.concatenate(([0], 1 + np.flatnonzero(np.diff(values) != 0.0)))
    sense = np.sign(np.diff(values[moved]))
    inner = 1 + np.flatnonzero(sense[1:] != sense[:-1])
    turns = np.concatenate((moved[:1], moved[inner], moved[1:][-1:]))
    while turns.size > 2:
        height = np.abs(np.diff(values[turns]))
        padded = np.concatenate(([np.inf], height, [np.inf]))
        close = (height < least) & (height <= padded[:-2]) & (height <= padded[2:])
        if not close.any():
            break
        # of closest pairs that touch, every other one
        index = np.arange(close.size)
        start = np.maximum.accumulate(np.where(close & ~np.concatenate(([False], close[:-1])), index, -1))
        close &= (index - start) % 2 == 0
        at = np.flatnonzero(close)
        gone = np.zeros(turns.size, dtype=bool)
        gone[at] = gone[at + 1] = True
        # an end has no partner: it goes alone
        gone[1] &= not close[0]
        gone[-2] &= not close[-1]
        turns = turns[~gone]
    return turns


def pieces(edges: Floats, log_amplitude: Floats) -> list[slice]:
    """The pieces of a run of cycles between which its frequency or amplitude goes from one steady value to another.

    Args:
        edges: time of the crossings [s], (m + 1,).
        log_amplitude: ln of the amplitude of each cycle, (m,).

    Notes:
        The crossings of a steady sine lie on a straight line over their number, and its amplitudes on a level one. A
        run is cut in two where two lines fit better than one by far more than the scatter allows, and each part again.
    """
    period = float(np.median(np.diff(edges)))
    phase = (edges - edges[0]) / period - np.arange(edges.size)
    # of white noise, squared weights of second differences sum up to 6, of first ones to 2
    jitter = spread = 0.0
    if log_amplitude.size > 1:
        jitter, spread = scatter(np.diff(phase, 2))[1] / 6.0**0.5, scatter(np.diff(log_amplitude))[1] / 2.0**0.5
    jitter, spread = max(jitter, _LEAST_JITTER), max(spread, _LEAST_SCATTER)
    found, open_parts = [], [slice(0, log_amplitude.size)]
    while open_parts:
        part = open_parts.pop()
        cut = _cut(phase[part.start : part.stop + 1] / jitter, log_amplitude[part] / spread, jitter, spread)
        if cut:
            open_parts += [slice(part.start + cut, part.stop), slice(part.start, part.start + cut)]
        else:
            found.append(part)
    return found


def keeps_changing(edges: Floats, parts: list[slice]) -> bool:
    """Whether the frequency of a run of crossings [s], (m + 1,), sweeps all the time and does not step between parts.

    Notes:
        In a sweep the period changes within the pieces as it does between them; in steps it is constant within.
    """
    parts = [part for part in parts if part.stop - part.start > _FEWEST_CYCLES]
    if len(parts) < _FEWEST_IN_SWEEP:
        return False
    middle = np.array([(part.start + part.stop) / 2.0 for part in parts])
    fits = [
        np.polyfit(np.arange(part.start, part.stop + 1) - m, edges[part.start : part.stop + 1], 2)
        for part, m in zip(parts, middle, strict=True)
    ]
    curve, period, _ = np.array(fits).T
    within, between = 2.0 * curve / period, np.gradient(np.log(period), middle)
    return bool(np.median(within / np.where(between == 0.0, np.inf, between)) > _SWEPT_SHARE)


def _cut(phase: Floats, level: Floats, jitter: float, spread: float) -> int:
    """Number of cycles after which to cut a run; 0 where it is one.

    Args:
        phase: of the crossings, less that of an even sine [jitter], (m + 1,).
        level: ln of the amplitude of each cycle [spread], (m,).
        jitter, spread: standard deviation of a crossing [periods], and of ln of an amplitude.
    """
    count = level.size
    if count < 2 * _FEWEST_CYCLES:
        return 0
    at = np.arange(_FEWEST_CYCLES, count - _FEWEST_CYCLES + 1)
    # a cut after `k` cycles gives the crossings 0..k to the first part and k..count to the second
    before, after = _line_squares(phase)[at], _line_squares(phase[::-1])[::-1][at]
    first = np.cumsum(level)[at - 1] / at
    second = (level.sum() - np.cumsum(level)[at - 1]) / (count - at)
    level_gain = at * (count - at) / count * (first - second) ** 2
    gain = _line_squares(phase)[-1] - before - after + level_gain
    best = int(np.argmax(gain))
    k = int(at[best])
    if gain[best] < _SPLIT_GAIN:
        return 0
    slopes = [np.polyfit(np.arange(part.size), part, 1)[0] * jitter for part in (phase[: k + 1], phase[k:])]
    other_frequency = abs(slopes[0] - slopes[1]) > _OTHER_FREQUENCY
    other_amplitude = abs(first[best] - second[best]) * spread > _OTHER_AMPLITUDE
    return k if other_frequency or other_amplitude else 0


def _line_squares(values: Floats) -> Floats:
    """Sum of squares that a straight line leaves of the values up to and with each, (n,)."""
    n = np.arange(1, values.size + 1, dtype=float)
    x = n - 1.0
    values = values - values.mean()
    sy, syy, sxy = np.cumsum(values), np.cumsum(values**2), np.cumsum(x * values)
    sx, sxx = n * (n - 1.0) / 2.0, n * (n - 1.0) * (2.0 * n - 1.0) / 6.0
    spread = np.maximum(sxx - sx**2 / n, 1e-300)
    return np.maximum(syy - sy**2 / n - (sxy - sx * sy / n) ** 2 / spread, 0.0)


def mean_from_steady(motion: Complex, stiffness: Complex, fewest: int) -> slice:
    """The steady cycles of a step: those left when both ends are cut so that the mean is most certain.

    Args:
        motion, stiffness: complex, in each cycle [m or rad, N/m or N m/rad], (m,).
        fewest: cycles that are kept at least.

    Notes:
        The marginal standard error rule (White 1997), over displacement and stiffness together.
    """
    series = np.stack((motion / np.median(np.abs(motion)), stiffness / np.median(np.abs(stiffness))))
    count = motion.size
    start = _truncation(series, min(int(_MOST_TRANSIENT * count), count - fewest))
    ending = _truncation(series[:, start:][:, ::-1], min(int(_MOST_ENDING * count), count - start - fewest))
    return slice(start, count - ending)


def _truncation(series: Complex, most: int) -> int:
    """Entries of series, (k, m), to cut at the start, up to `most`, so that the means have the least squared error."""
    if most < 1:
        return 0
    back = (series - series.mean(axis=1, keepdims=True))[:, ::-1]
    n = np.arange(1, series.shape[1] + 1)
    squares = np.cumsum(np.abs(back) ** 2, axis=1) - np.abs(np.cumsum(back, axis=1)) ** 2 / n
    error = (squares.sum(axis=0) / n**2)[::-1]
    return int(np.argmin(error[: most + 1]))
