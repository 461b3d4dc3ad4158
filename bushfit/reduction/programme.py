"""Loop programmes: a record of several amplitudes or rates, one after the other, split into loops.

The strokes of the motion, from one turning point to the next, are compared by their range and by the time between the
crossings of their middles. A run of similar strokes is a part; ramps, pauses and single cycles between are left out.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.errors import MeasurementError
from bushfit.reading.measurement import Floats, Loop, RecordPart
from bushfit.reading.stated import LoopFile
from bushfit.reduction.cycles import (
    change_after,
    lone_outliers,
    resumes_in_phase,
    stretches,
)
from bushfit.reduction.harmonics import cycle_harmonics
from bushfit.reduction.turning_points import middle_crossings, motion_turns

#: Rows that are enough to find the cycles.
ENOUGH_ROWS = 200_000
#: Cycles from which on the first one, which remembers what came before, goes: three, for what noise may take off them.
THREE_CYCLES = 2.95
#: Relative difference from the motion a period on up to which it comes again, relative to its range.
SAME_MOTION = 0.05
#: Relative difference of two half cycles, or two periods, that are alike; chosen: rigs keep theirs better.
_SAME_RATE = 0.08
#: Relative difference of the ranges of two parts up to which they have one amplitude; chosen: rigs step by more.
_SAME_AMPLITUDE = 0.08
#: Share of a cycle from either end of the record up to which a part reaches to it.
_AT_END = 0.1
#: Softening from which on it is told, as it is and over the loss factor of a part after other cycles and of one from
#: rest; chosen: less does not matter to a fit, and memory of springpot and friction makes up to 0.15 and 0.6 of it.
_LEAST_SOFTENING, _MEMORY, _MEMORY_FROM_REST = 0.02, 0.25, 0.75
#: Harmonics that are fitted to a cycle of force (a loop of rubber has next to nothing beyond), and the unknowns then,
#: with mean and slope.
_HARMONICS, _UNKNOWNS = 5, 12
#: What is said of a record with a time.
_TIMED = LoopFile(file="")


@dataclass(frozen=True)
class SteadySpan:
    """A part of a record with constant amplitude and rate.

    Args:
        begin, end: limits of its cycles, on the clock of the record.
        period: of its cycles, on that clock.
        range: peak to peak [m or rad].
    """

    begin: float
    end: float
    period: float
    range: float

    @property
    def cycles(self) -> float:
        """Number of its cycles."""
        return (self.end - self.begin) / self.period

    def is_like(self, span: "SteadySpan") -> bool:
        """Return True if two parts have one amplitude and one rate."""
        ranges, periods = np.log(self.range / span.range), np.log(self.period / span.period)
        return bool(abs(ranges) < _SAME_AMPLITUDE and abs(periods) < _SAME_RATE)


def programme(loop: Loop, test: LoopFile = _TIMED) -> tuple[Loop, ...]:
    """Split a record into its loops: one for each part of constant amplitude and rate.

    Args:
        loop: the whole record.
        test: keys of the record in a campaign; rate, frequency and waveform give the time of a record without one.

    Returns:
        The parts in order, with the time of the record and the softening of each. A record with one amplitude and rate
        is returned whole.

    Raises:
        MeasurementError: amplitude or rate change all the time, so that no two cycles are alike.

    Notes:
        The first part of a record that begins with it keeps all its cycles; of any other the first cycle, which still
        remembers what came before, is left out where two more are left.
    """
    step = slice(None, None, -(-loop.displacement.size // ENOUGH_ROWS))
    time, motion = _clock(loop)[step], loop.displacement[step]
    sound = ~lone_outliers(time, motion)
    time, motion = time[sound], motion[sound]
    spans = steady_spans(loop, time, motion)
    if not spans:
        return (loop,)
    if all(span.is_like(spans[0]) for span in spans[1:]):
        return (replace(loop, softening=measure_softening(loop, spans[0], from_rest=True)),)
    return tuple(cut_loops(loop, time, spans, test))


def _clock(loop: Loop) -> Floats:
    """Time of each row [s], or its number where no time was recorded, (n,)."""
    return loop.time if loop.timed else np.arange(loop.displacement.size, dtype=float)


def steady_spans(loop: Loop, time: Floats, motion: Floats) -> list[SteadySpan]:
    """Find the parts of a motion with constant amplitude and rate.

    Args:
        loop: record of the motion, for errors.
        time: of each row [s], or row numbers, (n,).
        motion: displacement without outliers [m or rad], (n,).

    Returns:
        Parts in order; none if there are fewer than three strokes.

    Raises:
        MeasurementError: there are cycles, but no two alike.
    """
    turns, prominence = motion_turns(time, motion)
    if turns.size < 4:
        return []
    height = motion[turns]
    size = np.abs(np.diff(height))
    across = middle_crossings(time, motion, turns, (height[1:] + height[:-1]) / 2.0)
    # ranges are alike within 3 %, which rigs keep better and step by more, and within three deviations of the noise
    same_size = 0.03 * size + 0.3 * prominence
    spans: list[SteadySpan] = []
    for strokes in _alike_runs(size, same_size):
        halves = np.diff(across[strokes])
        for run in _alike_runs(halves, _SAME_RATE * halves):
            first, last = strokes.start + run.start, strokes.start + run.stop
            begin, end = float(across[first]), float(across[last])
            period, stroke = 2.0 * (end - begin) / (last - first), float(np.median(size[first : last + 1]))
            span, previous = SteadySpan(begin, end, period, stroke), spans[-1] if spans else None
            gap = (begin - previous.end) / previous.period if previous else np.inf
            if previous and previous.is_like(span) and resumes_in_phase(gap, step=0.5):
                spans[-1] = replace(previous, end=end)  # a disturbance broke it off
            else:
                spans.append(span)
    inner = size[1:-1]
    if not spans and inner.size >= 4 and np.ptp(np.log(inner)) > 0.3:  # no rig misses its amplitude by a third
        unit, factor = loop.direction.display.displacement
        raise MeasurementError(
            "no part of the record is a loop",
            file=loop.source.file if loop.source else loop.name,
            found=f"{inner.size / 2.0:.2g} cycles from {factor * inner.min() / 2.0:.3g} to "
            f"{factor * inner.max() / 2.0:.3g} {unit}, no two successive ones equal",
            expected="at least two cycles of one amplitude and rate",
            hint="record more cycles of each amplitude, best five",
        )
    if not spans:
        return []
    before = [float(time[0]), *(span.end for span in spans[:-1])]
    after = [*(span.begin for span in spans[1:]), float(time[-1])]
    return [_to_its_ends(span, time, motion, *limits) for span, *limits in zip(spans, before, after, strict=True)]


def _alike_runs(values: Floats, reach: Floats) -> Iterator[slice]:
    """Runs of two or more values, (n,), each within its `reach`, (n,), of its neighbours, and of what comes after.

    Up and down may differ by three times as much, which a drift makes, where each is like the next of its kind. Over
    two cycles nothing creeps by more than 1.5 times as much.
    """
    change = np.abs(np.diff(values))
    of_a_kind = np.concatenate(([False], np.abs(values[2:] - values[:-2]) <= reach[2:], [False]))
    drifts = (of_a_kind[1:] | of_a_kind[:-1]) & (change <= 3.0 * reach[1:])
    for run in stretches((change > np.minimum(reach[1:], reach[:-1])) & ~drifts, fewest=2):
        run_values, ahead = values[run], 4  # strokes
        creeping = np.flatnonzero(np.abs(run_values[ahead:] - run_values[:-ahead]) > 1.5 * reach[run][ahead:])
        changes = np.zeros(run_values.size - 1, dtype=bool)
        changes[(creeping[:, None] + np.arange(ahead)).ravel()] = True
        for part in stretches(changes, fewest=2):
            yield slice(run.start + part.start, run.start + part.stop)


def _to_its_ends(span: SteadySpan, time: Floats, motion: Floats, before: float, after: float) -> SteadySpan:
    """Extend a part by half a cycle on either side if the motion is periodic there.

    The part is not extended beyond `before`, the end of the previous part, and `after`, the beginning of the next one.
    """
    limits = []
    for limit, neighbour, shift in ((span.begin, before, span.period), (span.end, after, -span.period)):
        extended = limit - shift / 2.0
        extended = max(extended, neighbour) if shift > 0.0 else min(extended, neighbour)
        rows = slice(*np.searchsorted(time, (extended, limit) if shift > 0.0 else (limit, extended)))
        change = change_after(time, motion, shift, rows)
        is_periodic = not change.size or float(np.quantile(change, 0.9)) < SAME_MOTION * span.range
        limits.append(extended if is_periodic else limit)
    begin, end = limits
    near = _AT_END * span.period
    begin = float(time[0]) if begin - time[0] < near else begin
    return replace(span, begin=begin, end=float(time[-1]) if time[-1] - end < near else end)


def cut_loops(loop: Loop, time: Floats, spans: Sequence[SteadySpan], test: LoopFile) -> Iterator[Loop]:
    """Cut out a loop for each part; the first cycle is left out if two more remain.

    Args:
        loop: the whole record.
        time: clock of the rows in which the parts were found [s, or row numbers].
        spans: the parts.
        test: keys of the record in a campaign, for a record without time.

    Returns:
        Iterator over the loops.
    """
    whole, last_end = _clock(loop), float(time[0])
    for number, span in enumerate(spans, start=1):
        begin = span.begin
        if begin > time[0] and span.cycles > THREE_CYCLES:
            begin += span.period
        ends = np.searchsorted(whole, [begin, span.end])
        rows = slice(int(ends[0]), int(ends[1]) + (span.end == time[-1]))
        gaps = begin - last_end, float(time[-1]) - span.end if number == len(spans) else 0.0
        gap_texts = [
            "" if gap <= _AT_END * span.period else f"{gap:.3g} s" if loop.timed else f"{gap:.0f} rows" for gap in gaps
        ]
        sentence = left_out(gap_texts, (span.end - begin) / span.period) if any(gap_texts) else None
        part = replace(
            loop.select(rows),
            name=f"{loop.name}_part_{number}",
            part=RecordPart(rows.start, sentence),
            softening=measure_softening(loop, span, from_rest=number == 1),
        )
        yield part if loop.timed else replace(part, time=test.clock(part.displacement))
        last_end = span.end


def left_out(gaps: Iterable[str], cycles: float) -> str:
    """Sentence on the gaps before and after the steady cycles, "" for no gap, and on the number of cycles used."""
    parts = [f"{gap} {side} its steady cycles" for gap, side in zip(gaps, ("before", "after"), strict=True) if gap]
    return f"{' and '.join(parts)} are left out; {cycles:.3g} cycles are used"


def measure_softening(loop: Loop, span: SteadySpan, *, from_rest: bool) -> float | None:
    """Relative excess of the first cycle's stiffness over the last one.

    Args:
        loop: the whole record.
        span: part of the record.
        from_rest: whether the part begins from rest.

    Returns:
        Excess; None within chance and the memory of rubber.
    """
    if span.cycles < 1.95:  # first and last are one
        return None
    first, first_error = _stiffness(loop, span.begin, span.period)
    last, last_error = _stiffness(loop, span.end - span.period, span.period)
    softening = abs(first / last) - 1.0
    remembered = (_MEMORY_FROM_REST if from_rest else _MEMORY) * abs(last.imag / last.real)
    smallest = max(_LEAST_SOFTENING, remembered, 6.0 * float(np.hypot(first_error, last_error)))
    return softening if softening > smallest else None


def _stiffness(loop: Loop, begin: float, period: float) -> tuple[complex, float]:
    """Complex stiffness [N/m or N m/rad] of the cycle that starts at `begin`, and its relative error."""
    clock = _clock(loop)
    first, last = np.searchsorted(clock, [begin, begin + period])
    rows = slice(first, last, max(1, (last - first) // 10_000))
    phase = (clock[rows] - begin) / period
    if phase.size <= _UNKNOWNS:
        return 1.0, np.inf
    values = np.column_stack((loop.displacement[rows], loop.force[rows]))
    _, (x, force), (_, scatter) = cycle_harmonics(phase, values, _HARMONICS, drift=1)
    return complex(force / x), scatter * np.sqrt(2.0 / (phase.size - _UNKNOWNS)) / float(abs(force))
