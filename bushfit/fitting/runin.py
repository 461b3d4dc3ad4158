"""The steady cycles of a loop: what comes before them (a ramp, a hold, smaller cycles) and after them is left out.

A motion is steady where it comes again a period later. The longest stretch that does so is kept; without a stretch that
does not, nothing is touched, so a record may start and end anywhere in its cycle. What lies beyond a hole in the record
is left out too, because nobody knows how many cycles went by there.
"""

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.outliers import gross_rows
from bushfit.reading.measurement import Loop
from bushfit.reduction.cycles import HOLE

#: Rows that are enough to find the cycles.
_ENOUGH_ROWS = 200_000
#: Difference from the motion a period later up to which it comes again, relative to its range.
_SAME = 0.05
#: Share of a period up to which a break in the steady motion, or what is left out, is too short to count.
_BRIEF = 0.02
#: Difference from the motion a period later, in units of its median, beyond which an end is drawn in.
_MOST_OFF = 8.0
#: The same relative to the range of the motion, which is added for motions without noise.
_LEAST_OFF = 5e-4
#: Periods by which an end is drawn in at most.
_EDGE = 0.5
#: Cycles from which on the first one can go: three, for what noise may take off them.
_THREE = 2.95
#: Share of the range on either side of the middle within which the motion is not yet across: more than any noise.
_BAND = 0.1


def thinned(loop: Loop) -> tuple[Array, Array]:
    """Time [s] and displacement [m or rad] of rows that are enough to find the cycles, gross outliers left out."""
    every = slice(None, None, -(-loop.time.size // _ENOUGH_ROWS))
    time, motion = loop.time[every], loop.displacement[every]
    rows = gross_rows(motion)
    return np.delete(time, rows), np.delete(motion, rows)


def crossings(motion: Array) -> tuple[Array, Array, Array]:
    """A motion about its middle, (n,), and the last row before and the first after each crossing of it, (k,) each."""
    centred = motion - (motion.max() + motion.min()) / 2.0
    marks = np.flatnonzero(np.abs(centred) > _BAND * np.ptp(centred))
    across = np.flatnonzero(np.diff(centred[marks] > 0.0))
    return centred, marks[across], marks[across + 1]


def steady_part(loop: Loop, time: Array, motion: Array) -> tuple[Loop, str | None]:
    """A loop without what comes before and after its steady cycles, and a sentence on what was left out or None."""
    period = _period(time, motion)
    if period is None or time[-1] - time[0] <= period:
        return loop, None
    holes = np.flatnonzero(np.diff(time) > HOLE * period)
    if holes.size:
        return _steady_part_between(loop, time, holes)
    ends = _steady_ends(time, motion, period)
    if ends is None:
        return loop, None
    first, last, after = ends
    left_out = [
        f"{duration:.3g} s {where} its steady cycles"
        for duration, where in ((first - time[0], "before"), (time[-1] - last, "after"))
        if duration > _BRIEF * period
    ]
    note = f"{' and '.join(left_out)} are left out; {(last - first) / period:.3g} cycles are used"
    return _cut(loop, first, last if after else np.inf), note


def _steady_ends(time: Array, motion: Array, period: float) -> tuple[float, float, bool] | None:
    """First and last time of the steady cycles [s], and whether anything follows; None where all or none are steady."""
    clock = time[time + period <= time[-1]]
    off = np.abs(np.interp(clock + period, time, motion) - motion[: clock.size])
    start, end = _longest_stretch(off < _SAME * np.ptp(motion), clock, _BRIEF * period)
    before, after = start > 0, end < off.size
    if start == end or not (before or after):
        return None
    most_off = _MOST_OFF * np.median(off[start:end]) + _LEAST_OFF * np.ptp(motion)
    other = np.flatnonzero(off[start:end] > most_off) + start
    if before:
        start = max(other[clock[other] < clock[start] + _EDGE * period], default=start - 1) + 1
    if after:
        end = min(other[clock[other] > clock[end - 1] - _EDGE * period], default=end)
    first, last = float(time[start]), float(time[end - 1]) + period
    if before and last - first > _THREE * period:
        first += period  # after a run-in the first cycle still remembers it
    return first, last, bool(after)


def _steady_part_between(loop: Loop, time: Array, holes: Array) -> tuple[Loop, str]:
    """As `steady_part`, of the longest part of a loop without a hole; `holes` are the steps of `time` that are one."""
    starts, ends = time[np.append(0, holes + 1)], time[np.append(holes, time.size - 1)]
    first, last = max(zip(starts, ends, strict=True), key=lambda part: part[1] - part[0])
    whole = _cut(loop, first, last)
    part, note = steady_part(whole, *thinned(whole))
    said = f"rows are missing; of {time[-1] - time[0]:.3g} s only {first:.4g} to {last:.4g} s are used"
    return part, said if note is None else f"{said}, and of these {note}"


def _cut(loop: Loop, first: float, last: float) -> Loop:
    """The rows between two times [s], both counted in."""
    kept = slice(np.searchsorted(loop.time, first), np.searchsorted(loop.time, last, side="right"))
    return loop.at(kept)


def _period(time: Array, motion: Array) -> float | None:
    """Usual time between crossings of the middle in one sense, in the later half of the record [s].

    Twice a stroke where there is one cycle. What holds a hole does not count; None where nothing is left.
    """
    after = crossings(motion)[2]
    strokes, steps = np.diff(time[after]), np.diff(time)
    widest = np.maximum(np.maximum.reduceat(steps, after - 1)[:-1], steps[after[1:] - 1])
    intervals = strokes[1:] + strokes[:-1]
    intervals = intervals[np.maximum(widest[1:], widest[:-1]) < HOLE * intervals]
    if not intervals.size:
        intervals = 2.0 * strokes[widest < HOLE * strokes]
    return float(np.median(intervals[intervals.size // 2 :])) if intervals.size else None


def _longest_stretch(alike: Array, time: Array, brief: float) -> Array:
    """Start and end of the longest stretch of rows that are alike; breaks no longer than `brief` [s] count as alike."""
    breaks = np.flatnonzero(np.diff(alike, prepend=True, append=True)).reshape(-1, 2)
    breaks = breaks[time[breaks[:, 1] - 1] - time[breaks[:, 0]] > brief]
    stretches = np.concatenate(([0], breaks.ravel(), [alike.size])).reshape(-1, 2)
    return stretches[np.argmax(np.diff(stretches))]
