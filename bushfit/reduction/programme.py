"""Loop programmes: a record of several amplitudes or rates, one after the other, split into loops.

The strokes of the motion, from one turning point to the next, are compared by their range and by the time between the
crossings of their middles. A run of similar strokes between two rests is a part of the record; ramps, rests and single
cycles between the parts are omitted.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from bushfit.errors import NoTestError
from bushfit.reading.headers import ERRORS
from bushfit.reading.measurement import Floats, Loop, RecordPart
from bushfit.reading.stated import LoopFile
from bushfit.reduction.cycles import lone_outliers, resumes_in_phase, shifted_difference, stretches
from bushfit.reduction.harmonics import cycle_harmonics
from bushfit.reduction.turning_points import (
    Integers,
    middle_crossings,
    motion_turns,
    moving_parts,
    prominent_turns,
    stroke_middles,
)

#: Rows that are enough to find the cycles.
ENOUGH_ROWS = 200_000
#: Number of cycles above which the first cycle, which depends on the history, is omitted: three, minus a tolerance.
THREE_CYCLES = 2.95
#: Largest difference from the motion a period later, relative to its range, with which a motion is periodic.
SAME_MOTION = 0.05
#: Largest relative difference of two equal half cycles, or of the periods within one part; chosen: rigs are more even.
_SAME_RATE = 0.08
#: Share of the range of a steady part from which on a stroke is similar to its strokes; smallest share of these strokes
#: in steady parts: in a swept, modulated or superposed motion, few successive cycles are equal.
_SIMILAR, _LEAST_COVERED = 0.7, 0.5
#: Largest scatter of the cycles of a loop, relative to their amplitude; chosen: a larger one spans several levels.
_MOST_SCATTER = 0.05
#: Largest relative difference of the ranges of two parts with one amplitude; chosen: rigs step by more.
_SAME_AMPLITUDE = 0.08
#: Smallest number of cycles of a steady part; chosen: a single cycle has no equal one.
_FEWEST_CYCLES = 1.4
#: Distance from an end of the record, relative to a cycle, up to which a part is extended to that end.
_AT_END = 0.1
#: Smallest reported softening: absolute, and over the loss factor for a part after other cycles and a part from rest;
#: chosen: less does not matter to a fit, and the memory of springpot and friction makes up to 0.15 and 0.6 of the loss
#: factor.
_LEAST_SOFTENING, _MEMORY, _MEMORY_FROM_REST = 0.02, 0.25, 0.75
#: Number of harmonics fitted to a cycle of force (loops of rubber have hardly more), and number of unknowns with mean
#: and slope.
_HARMONICS, _UNKNOWNS = 5, 12
#: Campaign keys of a record that has a time column.
_TIMED = LoopFile(file="")


@dataclass(frozen=True)
class SteadySpan:
    """Part of a record with constant amplitude and rate.

    Args:
        begin, end: limits of its cycles [s, or row numbers if the record has no time].
        period: duration of one cycle, in the same unit.
        range: peak-to-peak displacement [m or rad].
    """

    begin: float
    end: float
    period: float
    range: float

    @property
    def cycles(self) -> float:
        """Number of cycles in this part of the record, not necessarily whole."""
        return (self.end - self.begin) / self.period

    def is_like(self, span: "SteadySpan") -> bool:
        """Return True if another part of the record has the same amplitude and rate, both within 8 %."""
        ranges, periods = np.log(self.range / span.range), np.log(self.period / span.period)
        return bool(abs(ranges) < _SAME_AMPLITUDE and abs(periods) < _SAME_RATE)


def split_record(loop: Loop, test: LoopFile = _TIMED) -> tuple[Loop, ...]:
    """Split a record into loops, one for each part of constant amplitude and rate.

    Args:
        loop: the whole record.
        test: keys of the record in a campaign; rate, frequency and waveform define the time of a record without a time
            column.

    Returns:
        Loops in order, each with its times in the record and its softening (relative excess of |K| in the first cycle
        over the last). A record with one amplitude and rate is returned whole.

    Raises:
        MeasurementError: amplitude or rate change all the time, so that no two cycles are alike.

    Notes:
        A part at the beginning of the record keeps all its cycles. Any other part loses its first cycle, which still
        depends on the motion before, if two more cycles remain.
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
    """Time of each row of a record [s], (n,), or row numbers if the record has no time."""
    return loop.time if loop.has_recorded_time else np.arange(loop.displacement.size, dtype=float)


def steady_spans(loop: Loop, time: Floats, motion: Floats) -> list[SteadySpan]:
    """Find the parts of a motion with constant amplitude and rate.

    Args:
        loop: record of the motion, for error messages.
        time: time of each row [s], or row numbers, (n,).
        motion: displacement without outliers [m or rad], (n,).

    Returns:
        Parts in order; empty if there are fewer than three strokes (motions from one turning point to the next).

    Raises:
        NoTestError: there are cycles, but no two of them are alike.
    """
    turns, noise = motion_turns(time, motion)
    if turns.size < 4:
        return []
    parts = list[tuple[Floats, Floats, Integers]]()
    for rows in moving_parts(time, motion, turns, noise):
        inner = turns[(turns > rows.start) & (turns < rows.stop - 1)] - rows.start
        ends = np.concatenate(([0], inner, [rows.stop - rows.start - 1]))
        parts.append((time[rows], motion[rows], prominent_turns(motion[rows], ends, noise)))
    spans = list(chain.from_iterable(_spans_of_part(*part, noise) for part in parts))
    if not spans and len(parts) > 1:  # rests that belong to a wave, or one cycle between them
        spans = _single_cycles(parts, noise) or _spans_of_part(time, motion, turns, noise)
    inner = np.abs(np.diff(motion[turns]))[1:-1]
    similar = inner > _SIMILAR * min((span.range for span in spans), default=0.0)
    if inner.size < 4 or 2.0 * sum(span.cycles for span in spans) > _LEAST_COVERED * np.count_nonzero(similar):
        return spans
    begins = middle_crossings(time, motion, turns, stroke_middles(motion[turns]))[1:-1]
    if _cycle_scatter(begins, inner) > _MOST_SCATTER:
        unit, factor = loop.direction.display.displacement
        low, high = factor * inner.min() / 2.0, factor * inner.max() / 2.0
        periods = time[turns[3:-1]] - time[turns[1:-3]]
        found = f"{inner.size / 2.0:.2g} cycles from {low:.3g} to {high:.3g} {unit} and from {periods.min():.3g} to "
        found += f"{periods.max():.3g} {'s' if loop.has_recorded_time else 'rows'}, "
        found += f"{'few' if spans else 'no two'} successive ones equal"
        raise NoTestError(**ERRORS["no_loop"], file=loop.source.file if loop.source else loop.name, found=found)
    return []


def _cycle_scatter(begins: Floats, sizes: Floats) -> float:
    """Root mean square deviation of the cycles of a motion from equal cycles, relative to their amplitude.

    Upward and downward strokes may differ from each other.

    Args:
        begins: times at which successive strokes cross their middle, (n,), in any unit.
        sizes: ranges of these strokes, (n,), in any unit.

    Notes:
        To first order, its square is the share of the variance of the rows that the mean cycle leaves: the variance of
        the phases [rad] at which strokes begin, plus that of the logarithms of their ranges.
    """
    number = np.arange(begins.size)
    columns = np.stack((np.ones(number.size), number % 2, number)).T
    course = np.linalg.lstsq(columns, begins, rcond=None)[0]
    log_sizes, of_senses = np.log(sizes), columns[:, :2]
    deviations = log_sizes - of_senses @ np.linalg.lstsq(of_senses, log_sizes, rcond=None)[0]
    return float(np.hypot(np.std(begins - columns @ course) * np.pi / course[2], np.std(deviations)))


def _single_cycles(parts: Sequence[tuple[Floats, Floats, Integers]], noise: float) -> list[SteadySpan]:
    """Return a span for each part between rests if all parts are closed single cycles; else none.

    Args:
        parts: time [s], displacement [m or rad] and turning points of each part, with both ends.
        noise: smallest stroke that is not noise [m or rad].
    """
    spans = list[SteadySpan]()
    senses = {bool(motion[turns[1]] > motion[turns[0]]) for _, motion, turns in parts}
    for time, motion, turns in parts:
        range_ = float(np.ptp(motion))
        is_closed = abs(motion[-1] - motion[0]) < max(noise, SAME_MOTION * range_)
        # half cycles of opposite sense between rests are no cycles
        if not is_closed or not (turns.size == 4 or (turns.size == 3 and len(senses) == 1)):
            return []
        begin, end = float(time[0]), float(time[-1])
        spans.append(SteadySpan(begin, end, end - begin, range_))
    return spans


def _spans_of_part(time: Floats, motion: Floats, turns: Integers, noise: float) -> list[SteadySpan]:
    """Find the spans of constant amplitude and rate in a part of a record without rests.

    Args:
        time: time of each row [s], or row numbers, (n,).
        motion: displacement without outliers [m or rad], (n,).
        turns: row indices of the turning points, and of both ends, (turns,).
        noise: smallest stroke that is not noise [m or rad].
    """
    if turns.size < 4:
        return []
    height = motion[turns]
    size = np.abs(np.diff(height))
    across = middle_crossings(time, motion, turns, (height[1:] + height[:-1]) / 2.0)
    # ranges are alike within 3 %, which rigs keep better and step by more, and within three deviations of the noise
    same_size = 0.03 * size + 0.3 * noise
    spans, last_stroke = list[SteadySpan](), 0
    for strokes in _alike_runs(size, same_size):
        halves = np.diff(across[strokes])
        for run in _alike_runs(halves, _SAME_RATE * halves):
            first, last = strokes.start + run.start, strokes.start + run.stop
            if _cycle_scatter(across[first : last + 1], size[first : last + 1]) > _MOST_SCATTER:
                continue  # a swept sine, or two neighbouring rates
            begin, end = float(across[first]), float(across[last])
            period, stroke = 2.0 * (end - begin) / (last - first), float(np.median(size[first : last + 1]))
            span, previous = SteadySpan(begin, end, period, stroke), spans[-1] if spans else None
            gap = (begin - previous.end) / previous.period if previous else np.inf
            # a rest has too few strokes for its time
            is_moving = np.count_nonzero(size[last_stroke + 1 : first] > 0.25 * stroke) > 2.0 * gap - 1.5
            if previous and previous.is_like(span) and resumes_in_phase(gap, step=0.5) and is_moving:
                spans[-1] = replace(previous, end=end)  # a disturbance broke it off
            else:
                spans.append(span)
            last_stroke = last
    if not spans:
        return []
    before = [float(time[0]), *(span.end for span in spans[:-1])]
    after = [*(span.begin for span in spans[1:]), float(time[-1])]
    extended = [_extend_span(span, time, motion, *ends) for span, *ends in zip(spans, before, after, strict=True)]
    return [span for span in extended if span.cycles > _FEWEST_CYCLES]


def _alike_runs(values: Floats, reach: Floats) -> Iterator[slice]:
    """Yield slices of two or more neighbouring strokes of equal range or duration.

    Upward and downward strokes may differ by three times the tolerance, as in a drift, if each equals the next stroke
    of its kind. Over two cycles the values may change by 1.5 times the tolerance.

    Args:
        values: ranges or durations of the strokes, upward and downward in turn, (n,).
        reach: tolerance of each value, in its unit, (n,).
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


def _extend_span(span: SteadySpan, time: Floats, motion: Floats, before: float, after: float) -> SteadySpan:
    """Extend a part of constant amplitude and rate by half a cycle at each end where the motion continues alike.

    Args:
        span: part of the record.
        time: time of each row [s], or row numbers, (n,).
        motion: displacement [m or rad], (n,).
        before: end of the previous part, in the unit of the time; the part is not extended beyond it.
        after: beginning of the next part; the part is not extended beyond it either.
    """
    limits = []
    for limit, neighbour, shift in ((span.begin, before, span.period), (span.end, after, -span.period)):
        extended = limit - shift / 2.0
        extended = max(extended, neighbour) if shift > 0.0 else min(extended, neighbour)
        rows = slice(*np.searchsorted(time, (extended, limit) if shift > 0.0 else (limit, extended)))
        change = shifted_difference(time, motion, shift, rows)
        is_periodic = not change.size or float(np.quantile(change, 0.9)) < SAME_MOTION * span.range
        limits.append(extended if is_periodic else limit)
    begin, end = limits
    near = _AT_END * span.period
    begin = float(time[0]) if begin - time[0] < near else begin
    return replace(span, begin=begin, end=float(time[-1]) if time[-1] - end < near else end)


def cut_loops(loop: Loop, time: Floats, spans: Sequence[SteadySpan], test: LoopFile) -> Iterator[Loop]:
    """Cut a loop for each part out of a record, without the first cycle if two more remain.

    Args:
        loop: the whole record.
        time: time of the rows that were searched for the parts [s, or row numbers], (n,).
        spans: parts of constant amplitude and rate.
        test: keys of the record in a campaign, which define the time of a record without a time column.

    Yields:
        One loop for each part, in order.
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
            "" if gap <= _AT_END * span.period else f"{gap:.3g} s" if loop.has_recorded_time else f"{gap:.0f} rows"
            for gap in gaps
        ]
        sentence = omitted_rows_sentence(gap_texts, (span.end - begin) / span.period) if any(gap_texts) else None
        part = replace(
            loop.select(rows),
            name=f"{loop.name}_part_{number}",
            part=RecordPart(rows.start, sentence),
            softening=measure_softening(loop, span, from_rest=number == 1),
        )
        yield part if loop.has_recorded_time else replace(part, time=test.rebuild_time(part.displacement))
        last_end = span.end


def omitted_rows_sentence(gaps: Iterable[str], cycles: float, equal_cycles: float = 0.0) -> str:
    """Write a sentence on the omitted durations before and after the steady cycles, and on the number of cycles used.

    Args:
        gaps: durations before and after the steady cycles, formatted with a unit; "" for no gap.
        cycles: number of cycles used.
        equal_cycles: number of cycles of the same amplitude and rate in the omitted durations.
    """
    parts = [f"{gap} {side} the steady cycles" for gap, side in zip(gaps, ("before", "after"), strict=True) if gap]
    used = f"{cycles:.3g} cycle{'s are' if cycles > 1.005 else ' is'} used"
    unused = f", {equal_cycles:.3g} more of the same amplitude and rate are not" * (equal_cycles > 0.0)
    return f"{' and '.join(parts)} are left out; {used}{unused}"


def measure_softening(loop: Loop, span: SteadySpan, *, from_rest: bool) -> float | None:
    """Measure the softening of rubber during a loop test: relative excess of |K| of the first over the last cycle.

    Args:
        loop: the whole record.
        span: part of the record with constant amplitude and rate.
        from_rest: True if the part begins from rest, as the first part of a record does.

    Returns:
        |K_first|/|K_last| - 1; None if it is within noise and the memory of the rubber (springpot and friction).
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
    """Complex stiffness of one cycle of a record, from the first harmonics of force and displacement.

    Args:
        loop: the whole record.
        begin: beginning of the cycle [s, or row number].
        period: duration of the cycle, in the same unit.

    Returns:
        Stiffness [N/m or N m/rad], and the standard error of |K| due to the scatter of the force, relative to |K|;
        1 and infinity if the cycle has too few rows.
    """
    clock = _clock(loop)
    first, last = np.searchsorted(clock, [begin, begin + period])
    rows = slice(first, last, max(1, (last - first) // 10_000))
    phase = (clock[rows] - begin) / period
    if phase.size <= _UNKNOWNS:
        return 1.0, np.inf
    values = np.column_stack((loop.displacement[rows], loop.force[rows]))
    _, (x, force), (_, scatter) = cycle_harmonics(phase, values, _HARMONICS, drift=1)
    return complex(force / x), scatter * np.sqrt(2.0 / (phase.size - _UNKNOWNS)) / float(abs(force))
