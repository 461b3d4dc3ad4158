"""The steady cycles of a loop: what comes before them (a ramp, a hold, smaller cycles) and after them is left out, and
what lies beyond a hole in the record, because nobody knows how many cycles went by there.

A motion is steady where it comes again a period later. The longest stretch that does so is kept; without a stretch that
does not, nothing is touched, so a record may start and end anywhere in its cycle.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.harmonics import ENOUGH_ROWS
from bushfit.fitting.outliers import gross_rows
from bushfit.reading.measurement import Loop
from bushfit.reduction.cycles import HOLE

#: The motion comes again where it is the same a period later within this share of its range, for all but this share
#: of a period.
_SAME, _BRIEF = 0.05, 0.02
#: The ends of the stretch are drawn in, by half a period at most, to where the difference is within so many times its
#: median and this share of the range.
_WITHIN, _LEAST, _EDGE = 8.0, 5e-4, 0.5
#: Cycles, for what noise may take off them, from which on the first one can go.
_THREE = 2.95
#: Share of the range by which the motion passes its middle, before that counts as a crossing.
_BAND = 0.1


def thinned(loop: Loop) -> tuple[Array, Array]:
    """Time and displacement of rows that are enough to find the cycles, gross ones left out."""
    every = slice(None, None, -(-loop.time.size // ENOUGH_ROWS))
    time, motion = loop.time[every], loop.displacement[every]
    rows = gross_rows(motion)
    return np.delete(time, rows), np.delete(motion, rows)


def steady_part(loop: Loop, time: Array, motion: Array) -> tuple[Loop, str | None]:
    """A loop without what comes before and after its steady cycles, and a sentence on what was left out, if anything.

    After a run-in the first cycle still remembers it, and goes too where two more are left.

    Args:
        loop: the whole record.
        time: and
        motion: of the loop `thinned`.
    """
    period = _period(time, motion)
    if period is None or time[-1] - time[0] <= period:
        return loop, None
    holes = np.flatnonzero(np.diff(time) > HOLE * period)
    if holes.size:
        whole, first, last = _between(loop, time, holes)
        part, note = steady_part(whole, *thinned(whole))
        said = f"rows are missing; of {time[-1] - time[0]:.3g} s only {first:.4g} to {last:.4g} s are used"
        return part, said if note is None else f"{said}, and of these {note}"
    again = np.interp(time + period, time, motion)
    comparable = time + period <= time[-1]
    off, clock = np.abs(again - motion)[comparable], time[comparable]
    start, end = _longest(off < _SAME * np.ptp(motion), clock, _BRIEF * period)
    before, after = start > 0, end < off.size
    if start == end or not (before or after):
        return loop, None
    other = np.flatnonzero(off[start:end] > _WITHIN * np.median(off[start:end]) + _LEAST * np.ptp(motion)) + start
    if before:
        start = max(other[clock[other] < clock[start] + _EDGE * period], default=start - 1) + 1
    if after:
        end = min(other[clock[other] > clock[end - 1] - _EDGE * period], default=end)
    first, last = float(time[start]), float(time[end - 1]) + period
    if before and last - first > _THREE * period:
        first += period
    left_out = [
        f"{duration:.3g} s {where} its steady cycles"
        for duration, where in ((first - time[0], "before"), (time[-1] - last, "after"))
        if duration > _BRIEF * period
    ]
    note = f"{' and '.join(left_out)} are left out; {(last - first) / period:.3g} cycles are used"
    return _cut(loop, first, last if after else None), note


def _between(loop: Loop, time: Array, holes: Array) -> tuple[Loop, float, float]:
    """The longest part of a loop without a hole, and its first and last time; `holes` are the steps of `time` that
    are one."""
    starts, ends = time[np.append(0, holes + 1)], time[np.append(holes, time.size - 1)]
    longest = int(np.argmax(ends - starts))
    first, last = float(starts[longest]), float(ends[longest])
    return _cut(loop, first, last), first, last


def _cut(loop: Loop, first: float, last: float | None) -> Loop:
    """The rows between two times, both counted in; to the end where there is no last."""
    end = None if last is None else np.searchsorted(loop.time, last, side="right")
    kept = slice(np.searchsorted(loop.time, first), end)
    return replace(loop, **{name: getattr(loop, name)[kept] for name in ("time", "displacement", "force")})


def _period(time: Array, motion: Array) -> float | None:
    """Usual time between crossings in one sense of the middle in the later half; twice a stroke where there is one
    cycle. What holds a hole does not count."""
    centred = motion - (motion.max() + motion.min()) / 2.0
    band = _BAND * np.ptp(motion)
    marks = np.flatnonzero(np.abs(centred) > band)
    upper = centred[marks] > 0.0
    crossings = marks[1:][upper[1:] != upper[:-1]]
    if crossings.size < 2:
        return None
    strokes, steps = np.diff(time[crossings]), np.diff(time)
    widest = np.maximum(np.maximum.reduceat(steps, crossings - 1)[:-1], steps[crossings[1:] - 1])
    intervals = strokes[1:] + strokes[:-1]
    intervals = intervals[np.maximum(widest[1:], widest[:-1]) < HOLE * intervals]
    if not intervals.size:
        intervals = 2.0 * strokes[widest < HOLE * strokes]
    if not intervals.size:
        return None
    return float(np.median(intervals[intervals.size // 2 :]))


def _longest(alike: Array, time: Array, brief: float) -> tuple[int, int]:
    """Start and end of the longest stretch of rows that are alike; brief breaks count as alike."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], (~alike).astype(np.int8), [0]))))
    breaks = [(start, end) for start, end in edges.reshape(-1, 2) if time[end - 1] - time[start] > brief]
    starts = [0, *(end for _, end in breaks)]
    ends = [*(start for start, _ in breaks), alike.size]
    return max(zip(starts, ends, strict=True), key=lambda stretch: stretch[1] - stretch[0])
