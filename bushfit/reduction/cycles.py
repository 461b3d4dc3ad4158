"""Cycles of a motion: their limits, runs of similar cycles, and the steady part of a run.

Cycles are found in the displacement; all functions work on arrays of all rows or of all cycles.
"""

from dataclasses import dataclass
from itertools import pairwise
from math import prod

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.measurement import Complex, Floats
from bushfit.reduction.arrays import CHUNK, median_and_scatter
from bushfit.reduction.harmonics import basis
from bushfit.reduction.turning_points import Integers, middle_crossings, motion_turns, noise_threshold, stroke_middles

#: Longest gap without rows in a cycle, relative to its period; chosen: a fundamental needs rows all around the cycle.
HOLE = 0.34
#: [cycles] Longest interruption of a sine, beyond which it has stopped: three cycles, give or take a tenth.
_LONGEST_INTERRUPTION = 3.1
#: [cycles] Largest phase jump of a motion that resumes; chosen: an independent start meets it once in ten times.
_SAME_PHASE = 0.05
#: [ln] Difference of period and of range above which neighbouring cycles are of different runs: far above the scatter.
_OTHER_PERIOD, _OTHER_RANGE = 0.1, 0.25
#: Smallest determinant of a cycle's normal equations per row with which its fundamental is solved for.
_LEAST_DETERMINANT = 1e-3
#: Smallest decrease of chi-square by a split; chosen: scatter decreases chi-square by half as much at best.
_SPLIT_GAIN = 40.0
#: Smallest relative difference of frequency and of amplitude for a split; chosen: rigs wander by less.
_SPLIT_FREQUENCY, _SPLIT_AMPLITUDE = 1e-3, 0.02
#: Smallest relative scatter of periods and amplitudes; chosen: no rig is more even.
_LEAST_SCATTER = 5e-4
#: Cycles on either side of a split: two crossings more than a line needs.
_FEWEST_CYCLES = 2


@dataclass(frozen=True, eq=False)
class Cycles:
    """The m cycles of a motion, each from one upward crossing of the middle of the stroke to the next.

    Args:
        time: time of each row of the record [s], (n,).
        edges: times of the upward crossings [s], (m + 1,).
        first_rows: index of the first row after each crossing, (m + 1,).
        range: peak-to-peak displacement of each cycle [m or rad], (m,).
    """

    time: Floats
    edges: Floats
    first_rows: Integers
    range: Floats

    @classmethod
    def find(cls, time: Floats, motion: Floats) -> "Cycles":
        """Find the cycles of a motion, of any frequency and of any amplitude above the noise.

        Args:
            time: time of each row [s], (n,).
            motion: displacement [m or rad], (n,).

        Returns:
            Cycles between upward crossings; empty if the motion has fewer than four turning points.
        """
        turns, _ = motion_turns(time, motion)
        if turns.size < 4:
            return cls(time, np.empty(0), np.empty(0, dtype=np.intp), np.empty(0))
        height = motion[turns]
        middle = stroke_middles(height)
        upward = np.flatnonzero((height[:-1] < middle) & (middle < height[1:]))
        edges = middle_crossings(time, motion, turns, middle)[upward]
        peak, trough = height[upward[:-1] + 1], height[upward[:-1] + 2]
        return cls(time, edges, np.searchsorted(time, edges).astype(np.intp), peak - trough)

    def runs(self) -> list[slice]:
        """Find runs of consecutive cycles with similar periods and ranges, and without gaps in the rows.

        Returns:
            Slices of the cycles (not rows), in order.
        """
        if self.range.size == 0:
            return []
        period = np.diff(self.edges)
        before = self.first_rows - 1
        gap = np.maximum.reduceat(np.diff(self.time[: before[-1] + 2]), before[:-1])
        hole = gap > HOLE * period
        change = np.abs(np.diff(np.log([period, self.range])))
        changes = (change[0] > _OTHER_PERIOD) | (change[1] > _OTHER_RANGE) | hole[1:] | hole[:-1]
        return [run for run in stretches(changes) if not hole[run.start]]

    def fundamentals(self, run: slice, *channels: Floats) -> Complex:
        """Fit the fundamental of displacement, force or both in each of the k cycles of a run by least squares.

        Args:
            run: slice of the cycles.
            channels: displacement or force at all rows of the record, (n,) each.

        Returns:
            Complex amplitude of the fundamental, (channels, k); half the displacement range in cycles with too few
            rows.
        """
        edges, first = self.edges[run.start : run.stop + 1], self.first_rows[run.start : run.stop + 1]
        rows, count = slice(first[0], first[-1]), np.diff(first)
        phase = (self.time[rows] - np.repeat(edges[:-1], count)) / np.repeat(np.diff(edges), count)
        columns, starts = basis(phase, 2).T, first[:-1] - first[0]
        # the squares of the first harmonic are half the second
        n, c1, c2, s1, s2 = np.add.reduceat(columns, starts, axis=-1)
        gram = np.array([[n, c1, s1], [c1, (n + c2) / 2.0, s2 / 2.0], [s1, s2 / 2.0, (n - c2) / 2.0]]).T
        first_columns = columns[[0, 1, 3]]
        right = np.array([np.add.reduceat(first_columns * values[rows], starts, axis=-1) for values in channels]).T
        sound = np.abs(np.linalg.det(gram / np.maximum(count, 1)[:, None, None])) > _LEAST_DETERMINANT
        _, cosine, sine = np.linalg.solve(gram[sound], right[sound]).T.swapaxes(0, 1)
        fundamentals = np.tile((self.range[run] / 2.0).astype(complex), (len(channels), 1))
        fundamentals[:, sound] = cosine + 1j * sine
        return fundamentals


def stretches(changes: NDArray[np.bool_], fewest: int = 1) -> list[slice]:
    """Split a sequence of n entries, such as cycles, at given borders.

    Args:
        changes: true at the borders between neighbouring entries where the sequence is split, (n - 1,).
        fewest: smallest number of entries of a slice; shorter slices are omitted.

    Returns:
        Slices of the entries, in order.
    """
    border = np.concatenate(([0], 1 + np.flatnonzero(changes), [changes.size + 1])).tolist()
    return [slice(first, end) for first, end in pairwise(border) if end - first >= fewest]


def resumes_in_phase(gap: float, *, step: float = 1.0) -> bool:
    """True if a gap [cycles] is at most three cycles long and a multiple of `step`, so that a sine resumes in phase."""
    return gap < _LONGEST_INTERRUPTION and abs(gap - step * round(gap / step)) < _SAME_PHASE


def shifted_difference(time: Floats, motion: Floats, shift: float, rows: slice) -> Floats:
    """Compute the change of a motion over a given time; it is nearly zero if the motion is periodic with this time.

    Args:
        time: time of each row [s], (n,).
        motion: displacement [m or rad], (n,).
        shift: time from each row to the compared instant [s]; negative for an earlier instant.
        rows: rows to compare.

    Returns:
        Magnitude of the change [m or rad], (rows,).
    """
    return np.abs(np.interp(time[rows] + shift, time, motion) - motion[rows])


def lone_outliers(time: Floats, values: Floats) -> NDArray[np.bool_]:
    """Find single rows of a channel that are far from their neighbours because of a fault of the recording.

    Args:
        time: time of each row [s], (n,).
        values: values of the channel, (n,).

    Returns:
        Mask of the outliers, (n,).

    Notes:
        The distance of an outlier from the cubic through the two rows before and the two rows after it exceeds the
        range of these four rows plus the noise, which the cubic magnifies at uneven times. No sine reaches this
        distance, however few rows it has, nor does the kink of dry friction.
    """
    outliers = np.zeros(values.size, dtype=bool)
    smallest = noise_threshold(values)
    for start in range(0, values.size - 4, CHUNK):
        rows = slice(start, start + CHUNK + 4)
        chunk_values, clock = values[rows], time[rows]
        stop = chunk_values.size - 4
        near = [chunk_values[place : stop + place] for place in (0, 1, 3, 4)]
        nodes = [clock[place : stop + place] - clock[2 : stop + 2] for place in (0, 1, 3, 4)]
        cubic, gain = np.zeros(stop), np.ones(stop)
        for value, node in zip(near, nodes, strict=True):
            weight = prod(node_b / (node_b - node) for node_b in nodes if node_b is not node)
            cubic += weight * value
            gain += weight * weight
        # at even times the weights are -1/6, 4/6, 4/6 and -1/6
        reach = smallest * np.sqrt(gain / (1.0 + 34.0 / 36.0))
        outliers[start + 2 : start + 2 + stop] = np.abs(chunk_values[2:-2] - cubic) > np.ptp(near, axis=0) + reach
    return outliers


def steady_pieces(edges: Floats, log_amplitude: Floats) -> list[slice]:
    """Split a run of cycles into pieces of steady frequency and amplitude.

    Args:
        edges: times of the upward crossings [s], (m + 1,).
        log_amplitude: natural log of the amplitude of each cycle, (m,).

    Returns:
        Slices of the cycles, in order.

    Notes:
        Plotted over their number, the crossings of a steady sine lie on a straight line, and its amplitudes on a
        horizontal one. A run is cut in two if two lines fit far better than one, compared with the scatter; then each
        part again.
    """
    period = float(np.median(np.diff(edges)))
    phase = (edges - edges[0]) / period - np.arange(edges.size)
    # of white noise, squared weights of second differences sum up to 6, of first ones to 2
    jitter = spread = _LEAST_SCATTER
    if log_amplitude.size > 1:
        jitter = max(jitter, median_and_scatter(np.diff(phase, 2))[1] / 6.0**0.5)
        spread = max(spread, median_and_scatter(np.diff(log_amplitude))[1] / 2.0**0.5)
    steady_parts, open_parts = [], [slice(0, log_amplitude.size)]
    while open_parts:
        part = open_parts.pop()
        cut = _change_point(phase[part.start : part.stop + 1] / jitter, log_amplitude[part] / spread, jitter, spread)
        if cut:
            open_parts += [slice(part.start + cut, part.stop), slice(part.start, part.start + cut)]
        else:
            steady_parts.append(part)
    return steady_parts


def keeps_changing(edges: Floats, parts: list[slice]) -> bool:
    """Return True if the frequency of a run sweeps continuously instead of in steps.

    Args:
        edges: times of the upward crossings [s], (m + 1,).
        parts: slices of the run's cycles, from `steady_pieces`.

    Returns:
        True if the period changes within the parts as fast as between them; in steps it is constant within a part.
    """
    parts = [part for part in parts if part.stop - part.start > _FEWEST_CYCLES]
    if len(parts) < 4:  # which may be steps
        return False
    middle = np.array([(part.start + part.stop) / 2.0 for part in parts])
    fits = [
        np.polyfit(np.arange(part.start, part.stop + 1) - m, edges[part.start : part.stop + 1], 2)
        for part, m in zip(parts, middle, strict=True)
    ]
    curve, period, _ = np.array(fits).T
    within_parts, between_parts = 2.0 * curve / period, np.gradient(np.log(period), middle)
    return bool(np.median(within_parts / np.where(between_parts == 0.0, np.inf, between_parts)) > 0.5)


def _change_point(phase: Floats, level: Floats, jitter: float, spread: float) -> int:
    """Number of cycles after which the frequency or amplitude of a run of m cycles changes; 0 for a steady run.

    Args:
        phase: deviation of the crossings from those of an even sine, in units of `jitter`, (m + 1,).
        level: natural log of the amplitude of each cycle, in units of `spread`, (m,).
        jitter: scatter of the crossings [periods].
        spread: scatter of the log amplitudes.
    """
    count = level.size
    if count < 2 * _FEWEST_CYCLES:
        return 0
    # residual squares of straight lines through the first 1, 2, ... crossings, forwards and backwards
    n = np.arange(1.0, count + 2.0)
    values = np.stack((phase, phase[::-1])) - phase.mean()
    sums, squares, moments = (np.cumsum(part, axis=1) for part in (values, values**2, (n - 1.0) * values))
    sx, sxx = n * (n - 1.0) / 2.0, n * (n - 1.0) * (2.0 * n - 1.0) / 6.0
    curvature = np.maximum(sxx - sx**2 / n, 1e-300)
    forwards, backwards = np.maximum(squares - sums**2 / n - (moments - sx * sums / n) ** 2 / curvature, 0.0)
    # a cut after `k` cycles gives the crossings 0..k to the first part and k..count to the second
    cuts = np.arange(_FEWEST_CYCLES, count - _FEWEST_CYCLES + 1)
    first = np.cumsum(level)[cuts - 1] / cuts
    second = (level.sum() - np.cumsum(level)[cuts - 1]) / (count - cuts)
    level_gain = cuts * (count - cuts) / count * (first - second) ** 2
    gain = forwards[-1] - forwards[cuts] - backwards[::-1][cuts] + level_gain
    best = int(np.argmax(gain))
    k = int(cuts[best])
    if gain[best] < _SPLIT_GAIN:
        return 0
    slopes = [np.polyfit(np.arange(part.size), part, 1)[0] * jitter for part in (phase[: k + 1], phase[k:])]
    other_frequency = abs(slopes[0] - slopes[1]) > _SPLIT_FREQUENCY
    other_amplitude = abs(first[best] - second[best]) * spread > _SPLIT_AMPLITUDE
    return k if other_frequency or other_amplitude else 0


def select_steady_cycles(motion: Complex, stiffness: Complex, fewest: int) -> slice:
    """Select the steady cycles of a step: cut both ends so that the standard error of the mean is smallest.

    Args:
        motion, stiffness: complex displacement and stiffness of each cycle [m or rad, N/m or N m/rad], (m,).
        fewest: smallest number of cycles to keep.

    Returns:
        Slice of the cycles.

    Notes:
        The marginal standard error rule (White 1997), over displacement and stiffness together. Up to half of the
        cycles are cut at the beginning, and up to a quarter at the end.
    """
    series = np.stack((motion / np.median(np.abs(motion)), stiffness / np.median(np.abs(stiffness))))
    count = motion.size
    start = _truncation(series, min(count // 2, count - fewest))
    ending = _truncation(series[:, start:][:, ::-1], min(count // 4, count - start - fewest))
    return slice(start, count - ending)


def _truncation(series: Complex, most_cut: int) -> int:
    """Number of values to cut at the start of several series so that the standard error of their means is smallest.

    Args:
        series: k series of equal length, (k, m); the same number of values is cut from each.
        most_cut: largest number of values to cut.
    """
    if most_cut < 1:
        return 0
    back = (series - series.mean(axis=1, keepdims=True))[:, ::-1]
    n = np.arange(1, series.shape[1] + 1)
    squares = np.cumsum(np.abs(back) ** 2, axis=1) - np.abs(np.cumsum(back, axis=1)) ** 2 / n
    error = (squares.sum(axis=0) / n**2)[::-1]
    return int(np.argmin(error[: most_cut + 1]))
