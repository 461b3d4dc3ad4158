"""The cycles of a long motion: where it goes up and down, which cycles agree, and where one steady state ends.

Everything is counted on the displacement and works on arrays of all rows or all cycles at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.measurement import Complex, Floats
from bushfit.reduction.scatter import MEDIAN_TO_SIGMA, scatter

Integers = NDArray[np.intp]

#: A turning point stands out by so many standard deviations of the noise, steps of the converter, and this share of
#: the whole range.
_NOISE, _CONVERTER, _RANGE = 10.0, 4.0, 1e-3
#: Order of the differences that leave noise and no motion, rows of a block, most blocks, and the share of the blocks
#: (those with the least motion) that count.
_ORDER, _BLOCK, _MOST_BLOCKS, _QUIET = 6, 256, 2000, 0.1
_DIFFERENCE_GAIN = 924.0**0.5  # square root of the sum of squared binomials of that order
#: Variance of a row less the cubic through its neighbours at even times, over that of a row.
_EVEN_GAIN = 1.0 + (2.0 * 4.0**2 + 2.0) / 36.0
#: Rows that are looked at in one go.
_CHUNK = 1 << 18
#: Neighbours in one run differ by less than this, in ln of period and of range.
_SAME_PERIOD, _SAME_RANGE = 0.1, 0.25
#: A cycle has no hole longer than this share of it.
HOLE = 0.34
#: A split takes this much off chi-square, and parts frequencies or amplitudes by these shares at least.
_SPLIT_GAIN, _OTHER_FREQUENCY, _OTHER_AMPLITUDE = 40.0, 1e-3, 0.02
#: No crossing is known better than this share of a period, no amplitude better than this share of itself.
_LEAST_JITTER, _LEAST_SCATTER = 5e-4, 5e-4
#: Cycles on either side of a split.
_FEWEST = 2
#: A run of so many pieces sweeps where this share of the change between them is within them.
_FEWEST_IN_SWEEP, _SWEPT = 4, 0.5
#: Shares of a step that may be transient at its start, and no longer steady at its end.
_TRANSIENT, _ENDING = 0.5, 0.25


@dataclass(frozen=True, eq=False)
class Cycles:
    """The cycles of a motion, from one upward crossing of its middle to the next.

    Args:
        time: of every row [s], (n,).
        edges: the crossings [s], (m + 1,).
        first_rows: first row after each crossing, (m + 1,).
        range: peak to peak of each cycle [m or rad], (m,).
    """

    time: Floats
    edges: Floats
    first_rows: Integers
    range: Floats

    @classmethod
    def of(cls, time: Floats, motion: Floats) -> Cycles:
        """Find the cycles, at any frequency and of any amplitude that stands out of the noise."""
        turns = turning_points(motion, least_turn(motion))
        if turns.size < 4:
            return cls(time, np.empty(0), np.empty(0, dtype=np.intp), np.empty(0))
        height = motion[turns]
        middle, sense = (height[1:] + height[:-1]) / 2.0, np.sign(np.diff(height))
        if middle.size > 4:  # the record cuts the first and the last stroke short
            middle[[0, -1]] = 2.0 * middle[[1, -2]] - middle[[2, -3]]
        length = np.diff(turns)
        stroke = motion[turns[0] : turns[-1]]
        before = (stroke - np.repeat(middle, length)) * np.repeat(sense, length) < 0.0
        row = turns[:-1] + np.add.reduceat(before, turns[:-1] - turns[0], dtype=np.intp)
        row = np.clip(row, turns[:-1] + 1, turns[1:])
        rise = motion[row] - motion[row - 1]
        part = np.clip((middle - motion[row - 1]) / np.where(rise == 0.0, 1.0, rise), 0.0, 1.0)
        crossed = (middle - height[:-1]) * (height[1:] - middle) > 0.0
        upward = np.flatnonzero((sense > 0.0) & crossed)
        edges = (time[row - 1] + part * (time[row] - time[row - 1]))[upward]
        peak, trough = height[upward[:-1] + 1], height[upward[:-1] + 2]
        return cls(time, edges, np.searchsorted(time, edges).astype(np.intp), peak - trough)

    def runs(self) -> list[slice]:
        """Cycles in a row whose periods and ranges are alike from one to the next."""
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
        """Complex fundamental of each cycle of a run, by least squares with its mean, (k,)."""
        edges, first = self.edges[run.start : run.stop + 1], self.first_rows[run.start : run.stop + 1]
        rows = slice(first[0], first[-1])
        count = np.diff(first)
        phase = (self.time[rows] - np.repeat(edges[:-1], count)) / np.repeat(np.diff(edges), count)
        turn = np.exp(-2j * np.pi * phase)
        own = values[rows]

        def summed(series: NDArray[np.generic]) -> NDArray[np.generic]:
            return np.add.reduceat(series, first[:-1] - first[0])

        one, twice, wave = summed(turn), summed(turn * turn), summed(own * turn)
        size, total = count.astype(float), summed(own)
        # unknowns: mean, cosine and negative sine; turn = cosine - i sine
        gram = np.empty((count.size, 3, 3))
        gram[:, 0, 0] = size
        gram[:, 0, 1] = gram[:, 1, 0] = one.real
        gram[:, 0, 2] = gram[:, 2, 0] = one.imag
        gram[:, 1, 1], gram[:, 2, 2] = (size + twice.real) / 2.0, (size - twice.real) / 2.0
        gram[:, 1, 2] = gram[:, 2, 1] = twice.imag / 2.0
        right = np.stack((total, wave.real, wave.imag), axis=1)
        solved = np.full((count.size, 3), np.nan)
        sound = np.abs(np.linalg.det(gram / np.maximum(size, 1.0)[:, None, None])) > 1e-3
        solved[sound] = np.linalg.solve(gram[sound], right[sound][..., None])[..., 0]
        fundamental = solved[:, 1] + 1j * solved[:, 2]
        rough = (self.range[run] / 2.0).astype(complex)  # for cycles of too few rows, which make no point
        return np.where(sound, fundamental, rough)


def least_turn(values: Floats) -> float:
    """How far a turning point has to stand out so that noise makes none."""
    change = np.abs(np.diff(values))
    converter = float(change[change > 0.0].min(initial=np.inf))
    least = _RANGE * float(np.ptp(values))
    if values.size <= _BLOCK:
        blocks = values[None, :]
    else:
        starts = np.linspace(0, values.size - _BLOCK, min(_MOST_BLOCKS, values.size // _BLOCK)).astype(np.intp)
        blocks = values[starts[:, None] + np.arange(_BLOCK)]
    if blocks.shape[1] > _ORDER:
        rough = np.median(np.abs(np.diff(blocks, _ORDER, axis=1)), axis=1) * (MEDIAN_TO_SIGMA / _DIFFERENCE_GAIN)
        least = max(least, _NOISE * float(np.quantile(rough, _QUIET)))
    return max(least, _CONVERTER * converter if converter < least else 0.0)


def wild_rows(time: Floats, values: Floats) -> NDArray[np.bool_]:
    """Rows that lie alone far off the cubic through the two before and the two after them: further than those spread,
    and than noise goes, which a cubic through rows at uneven times magnifies. No sine does that, however few rows it
    has, nor the kink of dry friction."""
    wild = np.zeros(values.size, dtype=bool)
    least = least_turn(values)
    for start in range(0, values.size - 4, _CHUNK):
        rows = slice(start, start + _CHUNK + 4)
        own, clock = values[rows], time[rows]
        stop = own.size - 4
        near = [own[place : stop + place] for place in (0, 1, 3, 4)]
        apart = [clock[place : stop + place] - clock[2 : stop + 2] for place in (0, 1, 3, 4)]
        middle, gain = np.zeros(stop), np.ones(stop)
        for value, node in zip(near, apart, strict=True):
            weight = np.ones(stop)
            for other in apart:
                if other is not node:
                    weight *= other / (other - node)
            middle += weight * value
            gain += weight * weight
        reach = least * np.sqrt(gain / _EVEN_GAIN)
        wild[start + 2 : start + 2 + stop] = np.abs(own[2:-2] - middle) > np.ptp(near, axis=0) + reach
    return wild


def turning_points(values: Floats, least: float) -> Integers:
    """Rows of the turning points that stand out by `least` at least, highs and lows in turn.

    Pairs of neighbouring turning points less than `least` apart are taken out, the closest first, many at a time: what
    stays are the extremes between which the values go up or down by more than that.
    """
    moved = np.concatenate(([0], 1 + np.flatnonzero(np.diff(values) != 0.0)))
    sense = np.sign(np.diff(values[moved]))
    inner = 1 + np.flatnonzero(sense[1:] != sense[:-1])
    turns = np.concatenate((moved[:1], moved[inner], moved[-1:] if moved.size > 1 else moved[:0]))
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
    """Cycles in a row, cut where frequency or amplitude change from one steady value to another.

    The crossings of a steady sine lie on a straight line over their number, and its amplitudes on a level one. A run
    is cut in two where two lines fit better than one by far more than the scatter allows, and each part again.

    Args:
        edges: crossings [s], (m + 1,).
        log_amplitude: ln of the amplitude of each cycle, (m,).
    """
    period = float(np.median(np.diff(edges)))
    phase = (edges - edges[0]) / period
    phase = phase - np.arange(phase.size)
    jitter = max(_robust(np.diff(phase, 2)) / 6.0**0.5, _LEAST_JITTER)
    scatter = max(_robust(np.diff(log_amplitude)) / 2.0**0.5, _LEAST_SCATTER)
    found, open_parts = [], [slice(0, log_amplitude.size)]
    while open_parts:
        part = open_parts.pop()
        cut = _cut(phase[part.start : part.stop + 1] / jitter, log_amplitude[part] / scatter, jitter, scatter)
        if cut:
            open_parts += [slice(part.start + cut, part.stop), slice(part.start, part.start + cut)]
        else:
            found.append(part)
    return found


def keeps_changing(edges: Floats, parts: list[slice]) -> bool:
    """Whether the frequency sweeps through the pieces of a run rather than stepping from one to the next.

    In a sweep the period changes within the pieces as it does between them; in steps it is constant within.
    """
    parts = [part for part in parts if part.stop - part.start > _FEWEST]
    if len(parts) < _FEWEST_IN_SWEEP:
        return False
    middle = np.array([(part.start + part.stop) / 2.0 for part in parts])
    fits = [
        np.polyfit(np.arange(part.start, part.stop + 1) - m, edges[part.start : part.stop + 1], 2)
        for part, m in zip(parts, middle, strict=True)
    ]
    curve, period, _ = np.array(fits).T
    within, between = 2.0 * curve / period, np.gradient(np.log(period), middle)
    return bool(np.median(within / np.where(between == 0.0, np.inf, between)) > _SWEPT)


def _cut(phase: Floats, level: Floats, jitter: float, scatter: float) -> int:
    """Where to cut a run, as a number of cycles; 0 where it is one. Both series in units of their scatter."""
    count = level.size
    if count < 2 * _FEWEST:
        return 0
    number = np.arange(count, dtype=float)
    at = np.arange(_FEWEST, count - _FEWEST + 1)
    # a cut after `k` cycles gives the crossings 0..k to the first part and k..count to the second
    before, after = _line_squares(phase)[at], _line_squares(phase[::-1])[::-1][at]
    gain = _line_squares(phase)[-1] - before - after
    first = np.cumsum(level)[at - 1] / at
    second = (level.sum() - np.cumsum(level)[at - 1]) / (count - at)
    level_gain = at * (count - at) / count * (first - second) ** 2
    best = int(np.argmax(gain + level_gain))
    k = int(at[best])
    if gain[best] + level_gain[best] < _SPLIT_GAIN:
        return 0
    slopes = [np.polyfit(number[: part.size], part, 1)[0] * jitter for part in (phase[: k + 1], phase[k:])]
    parted = abs(slopes[0] - slopes[1]) > _OTHER_FREQUENCY or abs(first[best] - second[best]) * scatter > (
        _OTHER_AMPLITUDE
    )
    return k if parted else 0


def _line_squares(values: Floats) -> Floats:
    """Sum of squares about a straight line of the values up to and with each, (n,)."""
    n = np.arange(1, values.size + 1, dtype=float)
    x = n - 1.0
    values = values - values.mean()
    sy, syy, sxy = np.cumsum(values), np.cumsum(values**2), np.cumsum(x * values)
    sx, sxx = n * (n - 1.0) / 2.0, n * (n - 1.0) * (2.0 * n - 1.0) / 6.0
    spread = np.maximum(sxx - sx**2 / n, 1e-300)
    return np.maximum(syy - sy**2 / n - (sxy - sx * sy / n) ** 2 / spread, 0.0)


def mean_from_steady(motion: Complex, stiffness: Complex, fewest: int) -> slice:
    """Cycles of a step that are steady: what is left out at either end makes the mean of the others most certain.

    The marginal standard error rule (White 1997) over displacement and stiffness of the cycles together.
    """
    series = np.stack((motion / np.median(np.abs(motion)), stiffness / np.median(np.abs(stiffness))))
    count = motion.size
    start = _truncation(series, min(int(_TRANSIENT * count), count - fewest))
    ending = _truncation(series[:, start:][:, ::-1], min(int(_ENDING * count), count - start - fewest))
    return slice(start, count - ending)


def _truncation(series: Complex, most: int) -> int:
    """Entries to leave out at the start, at most that many, so that the squared standard error of the mean is least."""
    if most < 1:
        return 0
    back = (series - series.mean(axis=1, keepdims=True))[:, ::-1]
    n = np.arange(1, series.shape[1] + 1)
    squares = np.cumsum(np.abs(back) ** 2, axis=1) - np.abs(np.cumsum(back, axis=1)) ** 2 / n
    error = (squares.sum(axis=0) / n**2)[::-1]
    return int(np.argmin(error[: most + 1]))


def _robust(values: Floats) -> float:
    return scatter(values)[1] if values.size else 0.0
