"""Turning points of a motion, without those caused by noise and by ripple."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.measurement import Floats
from bushfit.reduction.arrays import difference_noise

#: Array of row indices.
Integers = NDArray[np.intp]

#: Stroke relative to the record's range below which strokes may be a ripple; chosen: rigs miss amplitudes by more.
_RIPPLE = 0.02
#: Smallest share of a half cycle spent at one value if small strokes there are a test; chosen: larger than for a sine.
_DWELL = 0.3
#: [ln] Largest difference of stroke and of duration between a half cycle and its repetition a cycle later.
_SAME_HALF_CYCLE = 0.1
#: Smallest duration of a pause over that of the neighbouring half cycles; chosen: sawtooth waves are more even.
_PAUSE = 2.5
#: Change of the motion during a rest, relative to the stroke; chosen: rigs at rest creep by less.
_REST_CHANGE = 0.02
#: Smallest duration of a rest over that of half a cycle: inside a stroke, where a sine changes fast; at an end of the
#: record; and at a turning point, where a wave may dwell; chosen.
_REST, _REST_AT_END, _REST_AT_TURN = 0.1, 0.3, 2.0
#: Strokes below this multiple of the noise are too small to find rests in them.
_CLEAR = 10.0


def reversals(value: NDArray[Any]) -> NDArray[np.bool_]:
    """Mark the samples at which a motion reverses.

    Args:
        value: samples of the motion in any unit, (..., n).

    Returns:
        True at each sample, except the last, at which the motion reverses, (..., n - 1). If the motion rests before it
        reverses, the last sample of the rest is the reversal.

    >>> reversals(np.array([0.0, 0.0, 1.0, 1.0, 0.0]))
    array([False, False, False,  True])
    """
    steps = np.diff(value, axis=-1)
    rising = steps > 0.0
    if not (moves := steps != 0.0).all():
        moving = np.maximum.accumulate(np.where(moves, np.arange(steps.shape[-1]), 0), axis=-1)
        rising, moves = (np.take_along_axis(array, moving, axis=-1) for array in (rising, moves))
        moves[..., 1:] &= moves[..., :-1]
    turned = np.zeros_like(rising)
    turned[..., 1:] = (rising[..., 1:] != rising[..., :-1]) & moves[..., 1:]
    return turned


def reversal_rows(values: Floats, rows: Integers) -> Integers:
    """Select those of the given rows at which the values change direction, and the first and the last row.

    Args:
        values: values of a channel, (n,).
        rows: row indices, increasing, (k,).
    """
    return np.concatenate((rows[:1], rows[:-1][reversals(values[rows])], rows[1:][-1:]))


def prominent_turns(values: Floats, turns: Integers, prominence: float) -> Integers:
    """Select the turning points that differ from their neighbours by `prominence` or more.

    Args:
        values: values of a channel, (n,).
        turns: row indices of turning points, maxima and minima in turn, (turns,).
        prominence: smallest difference between neighbouring turning points, in the unit of the values.

    Returns:
        Row indices of the selected turning points, maxima and minima in turn.

    Notes:
        Neighbouring turning points less than `prominence` apart are removed in pairs, the closest first, many pairs at
        a time. The extremes between which the values rise or fall by more than that remain.
    """
    while turns.size > 2:
        height = np.abs(np.diff(values[turns]))
        padded = np.concatenate(([np.inf], height, [np.inf]))
        close = (height < prominence) & (height <= padded[:-2]) & (height <= padded[2:])
        if not close.any():
            break
        # of closest pairs that touch, every second one
        index = np.arange(close.size)
        start = np.maximum.accumulate(np.where(close & ~np.concatenate(([False], close[:-1])), index, -1))
        close &= (index - start) % 2 == 0
        pair = np.flatnonzero(close)
        removed = np.zeros(turns.size, dtype=bool)
        removed[pair] = removed[pair + 1] = True
        # an end has no partner: it is removed alone
        removed[1] &= not close[0]
        removed[-2] &= not close[-1]
        turns = turns[~removed]
    return turns


def motion_turns(time: Floats, motion: Floats) -> tuple[Integers, float]:
    """Find the turning points of a motion, ignoring noise and ripple (hum, servo hunting, sensor flicker).

    Args:
        time: time of each row [s], or row numbers, (n,).
        motion: displacement [m or rad], (n,).

    Returns:
        Row indices of the turning points, (turns,), increasing, maxima and minima in turn, both ends included; and the
        smallest stroke that is not noise [m or rad].

    Notes:
        Strokes below 2 % of the record's range may be a ripple, because rigs miss their set amplitude by more. They may
        also be a test of small amplitude in a record with larger amplitudes or with a preload. A test of small
        amplitude is separate in time from larger motions, whereas a ripple coincides with one. Therefore each half
        cycle of the larger motion, from one crossing of its middle to the next, is classified:

        - If the half cycle recurs a cycle later, the larger motion is the test, and small strokes are a ripple.
        - Otherwise small strokes are a ripple unless the motion stays near one value for 30 % of the half cycle. A sine
          is within 2 % of its range of a peak for 18 % of the time.
        - If the half cycle is much longer than its neighbours, the larger motion pauses, and small strokes are a test.
    """
    prominence = noise_threshold(motion)
    moving = np.concatenate(([0], 1 + np.flatnonzero(np.diff(motion) != 0.0)))
    fine = prominent_turns(motion, reversal_rows(motion, moving), prominence)
    small = max(prominence, _RIPPLE * float(np.ptp(motion)))
    coarse = prominent_turns(motion, fine, small)
    if coarse.size < 2 or coarse.size == fine.size:
        return fine, prominence
    height = motion[coarse]
    crossings = middle_crossings(time, motion, coarse, stroke_middles(height))
    borders = np.concatenate(([time[0]], crossings, [time[-1]]))
    half, row_time = np.searchsorted(crossings, time), np.gradient(time)
    duration = np.maximum(np.diff(borders), float(row_time.min()))  # a record may begin at a crossing
    dwell = np.bincount(half, row_time * (np.abs(motion - height[half]) < small), coarse.size) / duration
    neighbour = np.maximum(np.append(duration[1:], 0.0), np.append(0.0, duration[:-1]))
    again = np.abs(np.log(duration[2:] / duration[:-2])) < _SAME_HALF_CYCLE
    again &= np.abs(height[2:] - height[:-2]) < _SAME_HALF_CYCLE * np.abs(height[1:-1] - height[:-2])
    is_repeated = np.append(again, [False] * 2) | np.append([False] * 2, again)  # a cycle later or earlier
    rippled = is_repeated | (dwell < _DWELL)
    if rippled.size > 2:
        rippled[[0, -1]] = rippled[[1, -2]]  # the record cuts the first and the last half cycle short
    rippled &= duration < _PAUSE * neighbour
    ripple = rippled[half[fine]] & ~np.isin(fine, coarse)
    return reversal_rows(motion, fine[~ripple]), prominence


def moving_parts(time: Floats, motion: Floats, turns: Integers, noise: float) -> list[slice]:
    """Find the parts of a record between its rests, in which the displacement changes by no more than noise and creep.

    Args:
        time: time of each row [s], or row numbers, (n,).
        motion: displacement [m or rad], (n,).
        turns: row indices of the turning points, from `motion_turns`.
        noise: smallest stroke that is not noise [m or rad].

    Returns:
        Slices of the rows, in order; one slice of all rows if the motion does not rest.

    Notes:
        The path is the distance travelled since the first row, without noise. A rest is a stretch of path of
        2 % of a stroke (more if the noise is larger) that takes much longer than half a cycle before or after it, which
        is a path of one stroke, suggests.
    """
    height = motion[turns]
    stroke = np.repeat(np.arange(turns.size - 1), np.diff([0, *turns[1:-1], time.size]))
    sizes = np.abs(np.diff(height))
    padded = np.concatenate(([0.0], sizes, [0.0]))
    whole = np.maximum(np.maximum(padded[:-2], padded[2:]), sizes)[stroke]  # the first and the last may be incomplete
    size, base = sizes[stroke], (np.cumsum(sizes) - sizes)[stroke]
    path = np.maximum.accumulate(base + np.sign(np.diff(height))[stroke] * (motion - height[stroke]))
    band, last = np.maximum(noise, _REST_CHANGE * size), time.size - 1
    end = np.searchsorted(path, path + band)
    before = np.where(path < whole, 0.0, time - time[np.searchsorted(path, path - whole)])
    half_end = np.searchsorted(path, path + band + whole)
    after = np.where(half_end > last, 0.0, time[np.minimum(half_end, last)] - time[np.minimum(end, last)])
    half = np.maximum(before, after)
    position = (path - base) / size
    is_inside = (position > 0.1) & (position + band / size < 0.9)
    at_end = ((base == 0.0) & (position <= 0.1)) | (end > last)
    factor = np.select([at_end, is_inside], [_REST_AT_END, _REST + 2.0 * band / size], _REST_AT_TURN)
    starts = np.flatnonzero((time[end - 1] - time > factor * half) & (half > 0.0) & (size > _CLEAR * noise))
    parts, begin = list[slice](), 0
    if not starts.size:
        return [slice(begin, time.size)]
    borders = np.flatnonzero(starts[1:] > end[starts[:-1]])
    for first, stop in zip(starts[np.append(0, borders + 1)], end[starts[np.append(borders, -1)]], strict=True):
        distance = np.abs(motion[first:stop] - np.median(motion[first:stop]))
        still = first + np.flatnonzero(distance <= 1.2 * np.quantile(distance, 0.9))  # without the motion around it
        parts.append(slice(begin, int(still[0]) + 1))
        begin = int(still[-1])
    parts.append(slice(begin, time.size))
    return [rows for rows in parts if rows.stop - rows.start > 2]


def stroke_middles(height: Floats) -> Floats:
    """Mean displacement of each stroke, (turns - 1,), from the displacements of the turning points, (turns,).

    The first and the last stroke may be incomplete: their values are extrapolated from their neighbours.
    """
    middle = (height[1:] + height[:-1]) / 2.0
    if middle.size > 4:
        middle[[0, -1]] = 2.0 * middle[[1, -2]] - middle[[2, -3]]
    return middle


def middle_crossings(time: Floats, motion: Floats, turns: Integers, middle: Floats) -> Floats:
    """Interpolate the time at which each stroke, from one turning point to the next, crosses its middle.

    Args:
        time: time of each row [s], (n,).
        motion: displacement [m or rad], (n,).
        turns: row indices of the turning points, (strokes + 1,).
        middle: displacement in the middle of each stroke [m or rad], (strokes,).

    Returns:
        Times of the crossings [s], (strokes,).
    """
    sense, length = np.sign(np.diff(motion[turns])), np.diff(turns)
    strokes = motion[turns[0] : turns[-1]]
    before = (strokes - np.repeat(middle, length)) * np.repeat(sense, length) < 0.0
    row = turns[:-1] + np.add.reduceat(before, turns[:-1] - turns[0], dtype=np.intp)
    row = np.clip(row, turns[:-1] + 1, turns[1:])
    rise = motion[row] - motion[row - 1]
    part = np.clip((middle - motion[row - 1]) / np.where(rise == 0.0, 1.0, rise), 0.0, 1.0)
    return time[row - 1] + part * (time[row] - time[row - 1])


def noise_threshold(values: Floats) -> float:
    """Estimate the smallest difference between neighbouring turning points that is not noise.

    Args:
        values: values of a channel, (n,).

    Returns:
        Smallest difference, in the unit of the values.

    Notes:
        The largest of 0.1 % of the range, ten standard deviations of the noise (whose extremes in 10^6 rows are half
        as large), and four steps of the analogue-to-digital converter. The noise is estimated from sixth differences in
        the windows with the least motion; a sine of ten rows per cycle contributes 0.2 % of its amplitude to them.
    """
    change = np.abs(np.diff(values))
    converter_step = float(change[change > 0.0].min(initial=np.inf))
    smallest = 1e-3 * float(np.ptp(values))
    rows, order = min(256, values.size), 6
    if rows > order:
        starts = np.linspace(0, values.size - rows, min(2000, values.size // rows)).astype(np.intp)
        windows = np.lib.stride_tricks.sliding_window_view(values, rows)[starts]
        smallest = max(smallest, 10.0 * float(np.quantile(difference_noise(windows, order), 0.1)))
    return max(smallest, 4.0 * converter_step if converter_step < smallest else 0.0)
