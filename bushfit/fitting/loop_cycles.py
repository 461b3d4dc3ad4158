"""Steady cycles of a loop: their selection, frequency and number, and the name of the waveform.

The longest part of constant amplitude and rate is kept; a record that is steady throughout is unchanged, so it may
start and end anywhere in its cycle. If rows are missing, only the longest part without missing rows is kept, because
the number of missing cycles is unknown.
"""

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.loop_harmonics import outlier_distance
from bushfit.fitting.outliers import gross_outliers
from bushfit.reading.measurement import Loop
from bushfit.reduction.cycles import HOLE, shifted_difference
from bushfit.reduction.harmonics import basis, least_squares, resolved_order, spread_rows
from bushfit.reduction.programme import ENOUGH_ROWS, THREE_CYCLES, omitted_rows_sentence, steady_spans

#: Share of a period up to which a break in the steady motion, or a part left out, is ignored.
_BRIEF = 0.02
#: Largest numbers of harmonics and of rows that refine a frequency; chosen: higher harmonics of a triangle shift no
#: phase.
_MOST_HARMONICS, _ROWS_TO_REFINE = 15, 2000
#: Gauss-Newton step relative to the frequency: limit of convergence (rounding), and largest step (for longer steps the
#: motion is not linear in the frequency).
_SETTLED, _LARGEST_STEP = 1e-12, 0.05
#: Distance between first and last displacement of a record, relative to its range, above which the record contains no
#: whole cycle: larger than any noise.
_OPEN = 0.1
#: Largest distance between the ends of a closed cycle, relative to the cycle or to its amplitude.
_CLOSED = 0.04
#: Number of cycles, estimated from the duration of one stroke, above which a record is more than a single cycle; the
#: second limit is for records whose ends meet, where the two strokes may differ in duration or the motion may pause.
_MORE_THAN_ONE, _MORE_THAN_ONE_THAT_MEETS = 1.01, 1.1
#: Largest root mean square difference of the motion after one cycle from its start, relative to the amplitude, or in
#: units of the scatter of neighbouring rows, whichever is larger.
_REPEATS, _REPEATS_SCATTER = 0.02, 6.0
#: Largest difference of the ratio of third to first harmonic from that of a sine or triangle for a motion of this form.
_LIKE = 0.03
#: Share of the amplitude beyond which rows are counted.
_OUTER = 0.9


def steady_cycles(loop: Loop) -> tuple[Loop, float, float, str | None]:
    """Cut a loop to its steady cycles; if rows are missing, to those of its longest part without a gap.

    Returns:
        The loop without the rows before and after its steady cycles, the frequency of its motion [Hz], the number of
        steady cycles, including fractions, and a note on the rows that were left out, or None.

    Raises:
        FitError: the loop does not contain a whole cycle, or rows are missing in its steady part.
    """
    time, motion = _thin_rows(loop)
    part, note = _steady_part(loop, time, motion)
    if part is not loop:
        time, motion = _thin_rows(part)
    frequency, cycles = _frequency_and_cycles(part, time, motion)
    widest = int(np.argmax(np.diff(time)))
    if time[widest + 1] - time[widest] > HOLE / frequency:
        raise FitError(
            "rows are missing inside the loop",
            file=part.source.file if part.source else None,
            found=f"none from {time[widest]:.4g} to {time[widest + 1]:.4g} s; the number of cycles, and "
            "therefore the frequency, is unknown",
            expected="no gap longer than a third of a cycle",
            hint="keep only the whole cycles before the gap, or only the cycles after the gap",
        )
    return part, frequency, cycles, note


def _thin_rows(loop: Loop) -> tuple[Array, Array]:
    """Time [s] and displacement [m or rad] of every k-th row, enough to find the cycles, without gross outliers."""
    selection = slice(None, None, -(-loop.time.size // ENOUGH_ROWS))
    time, motion = loop.time[selection], loop.displacement[selection]
    rows = gross_outliers(motion)
    return np.delete(time, rows), np.delete(motion, rows)


def _crossings(motion: Array) -> tuple[Array, Array, Array]:
    """Motion relative to the middle of its range, (n,), and the rows just before and after each crossing, (k,) each.

    Rows within a tenth of the range on either side of the middle, more than any noise, are skipped.
    """
    centred = motion - (motion.max() + motion.min()) / 2.0
    marks = np.flatnonzero(np.abs(centred) > 0.1 * np.ptp(centred))
    across = np.flatnonzero(np.diff(centred[marks] > 0.0))
    return centred, marks[across], marks[across + 1]


def _steady_part(loop: Loop, time: Array, motion: Array) -> tuple[Loop, str | None]:
    """Return a loop without the rows before and after its steady cycles, and a note on these rows or None.

    Args:
        loop: the whole record.
        time, motion: time [s] and displacement [m or rad] of every k-th row, from `_thin_rows`, (n,) each.
    """
    period = _period(time, motion)
    holes = np.flatnonzero(np.diff(time) > HOLE * (period or np.inf))
    if period and time[-1] - time[0] > period and holes.size:
        starts, ends = time[np.append(0, holes + 1)], time[np.append(holes, time.size - 1)]
        first, last = max(zip(starts, ends, strict=True), key=lambda part: part[1] - part[0])
        whole = _select_interval(loop, first, last)
        part, note = _steady_part(whole, *_thin_rows(whole))
        sentence = f"rows are missing; of {time[-1] - time[0]:.3g} s only {first:.4g} to {last:.4g} s are used"
        return part, sentence if note is None else f"{sentence}; in this part, {note}"
    spans = steady_spans(loop, time, motion)  # even if a ramp to a preload shifts the middle of the record
    longest = max(spans, key=lambda span: round(span.cycles), default=None)
    if longest is None:
        return loop, None
    first, last = longest.begin, longest.end
    if first > time[0] and longest.cycles > THREE_CYCLES:
        first += longest.period  # the first cycle after a run-in is not yet steady
    gaps = [f"{gap:.3g} s" if gap > _BRIEF * longest.period else "" for gap in (first - time[0], time[-1] - last)]
    if not any(gaps):
        return loop, None
    equal_cycles = sum(equal.cycles for equal in spans if equal is not longest)
    note = omitted_rows_sentence(gaps, (last - first) / longest.period, equal_cycles)
    return _select_interval(loop, first, last if gaps[1] else np.inf), note


def _select_interval(loop: Loop, first: float, last: float) -> Loop:
    """Keep only the rows of a loop from the time `first` [s] to the time `last` [s]."""
    return loop.select(slice(np.searchsorted(loop.time, first), np.searchsorted(loop.time, last, side="right")))


def _period(time: Array, motion: Array) -> float | None:
    """Period of a motion [s]: median time between crossings of the middle in the same direction, in the later half.

    For a single cycle, twice the time between two crossings. Intervals with missing rows are ignored; None if no
    interval remains.
    """
    after = _crossings(motion)[2]
    strokes, steps = np.diff(time[after]), np.diff(time)
    widest = np.maximum(np.maximum.reduceat(steps, after - 1)[:-1], steps[after[1:] - 1])
    intervals = strokes[1:] + strokes[:-1]
    intervals = intervals[np.maximum(widest[1:], widest[:-1]) < HOLE * intervals]
    if not intervals.size:
        intervals = 2.0 * strokes[widest < HOLE * strokes]
    return float(np.median(intervals[intervals.size // 2 :])) if intervals.size else None


def _frequency_and_cycles(loop: Loop, time: Array, displacement: Array) -> tuple[float, float]:
    """Frequency [Hz] and number of cycles of a loop that consists of steady cycles.

    Args:
        loop: steady cycles of the record.
        time, displacement: time [s] and displacement [m or rad] of every k-th row, from `_thin_rows`, (n,) each.

    Notes:
        Several cycles are counted by crossings of the middle in one direction, and their frequency is refined by
        Gauss-Newton on the motion. A single cycle is recognised by its two ends, which meet with the same slope.
    """
    (x, before, after), time = _crossings(displacement), time - loop.time[0]
    times = time[before] - x[before] * (time[after] - time[before]) / (x[after] - x[before])
    rows = loop.time.size
    closed = float(loop.time[-1] - loop.time[0]) * rows / (rows - 1)
    same_sense = max(times[x[after] > 0.0], times[x[after] < 0.0], key=len)
    if same_sense.size > 1:
        counted = (same_sense.size - 1) / float(same_sense[-1] - same_sense[0])
        frequency = _refine_frequency(time, x, counted, rows / (closed * counted))
        return frequency, closed * frequency
    return _frequency_of_single_cycle(loop, time, x, times)


def _frequency_of_single_cycle(loop: Loop, time: Array, x: Array, crossings: Array) -> tuple[float, float]:
    """Frequency [Hz] and number of cycles of a loop whose motion crosses its middle once upwards and once downwards.

    Args:
        loop: steady cycles of the record.
        time, x: time [s] and motion relative to its middle at every k-th row, (n,) each.
        crossings: times of the two crossings [s].
    """
    rows, motion = loop.time.size, loop.displacement
    duration = float(loop.time[-1] - loop.time[0])
    closed = duration * rows / (rows - 1)
    gap = abs(motion[-1] - motion[0])
    stride = np.abs(np.diff(motion[[0, 1, -2, -1]]))[[0, 2]].mean()
    whole = duration if gap < 0.5 * stride else closed
    period = _period_by_ends(time, x, duration, whole)
    if period is not None:
        return 1.0 / period, closed / period
    stroke = float(crossings[1] - crossings[0]) if crossings.size == 2 else np.inf
    meets = gap < _CLOSED * np.ptp(x) / 2.0 + 1.5 * stride
    if closed > (_MORE_THAN_ONE_THAT_MEETS if meets else _MORE_THAN_ONE) * 2.0 * stroke:
        frequency = _refine_frequency(time, x, 0.5 / stroke, rows)
        if closed * frequency > 1.0 and _is_periodic(time, x, 1.0 / frequency):
            return frequency, closed * frequency
    if gap > _OPEN * np.ptp(x):
        raise FitError(
            "the loop does not contain a whole cycle",
            file=loop.source.file if loop.source else None,
            found=f"displacement from {motion[0]:.4g} to {motion[-1]:.4g} {loop.direction.motion.displacement_unit}",
            expected="at least one closed cycle",
            hint="export the whole cycle, or several",
        )
    return 1.0 / whole, closed / whole


def _period_by_ends(time: Array, x: Array, duration: float, whole: float) -> float | None:
    """Period [s] of a motion whose last rows meet its first rows with the same slope; None if they do not.

    Straight lines through both ends determine how much the duration of the record differs from one cycle.

    Args:
        time, x: time [s] and motion relative to its middle, (n,) each.
        duration: duration of the record [s].
        whole: expected period [s], which is returned unless the ends show a shorter one.
    """
    few, ends = max(3, int(0.02 * x.size)), []
    for rows, origin in ((slice(few), time[0]), (slice(-few, None), time[-1])):
        line = np.polynomial.Polynomial.fit(time[rows] - origin, x[rows], 1)
        ends.append((line(0.0), line.deriv()(0.0), np.std(x[rows] - line(time[rows] - origin))))
    (first, first_slope, first_scatter), (last, last_slope, last_scatter) = ends
    slope, step = (first_slope + last_slope) / 2.0, duration / (x.size - 1)
    if first_slope * last_slope <= 0.0 or abs(last - first) > _CLOSED * duration * abs(slope):
        return None
    error = np.hypot(first_scatter, last_scatter) * np.sqrt(4.0 / few) / abs(slope)
    if error > 0.25 * few * step:
        return None
    period = duration - float((last - first) / slope)
    return period if period < whole - max(1.5 * step, 4.0 * error) else whole


def _refine_frequency(time: Array, x: Array, frequency: float, rows_per_cycle: float) -> float:
    """Refine the frequency of several cycles by Gauss-Newton on the harmonics of the motion.

    Args:
        time: time of each row [s], (n,).
        x: displacement relative to the middle of its range, (n,).
        frequency: first estimate of the frequency [Hz].
        rows_per_cycle: number of rows in a cycle, which limits the number of harmonics.

    Returns:
        Frequency [Hz].
    """
    chosen = spread_rows(x.size, _ROWS_TO_REFINE)
    time, motion = time[chosen], x[chosen]
    order = resolved_order(rows_per_cycle * chosen.size / x.size, _MOST_HARMONICS)
    number, columns = np.arange(1, order + 1), basis(time * frequency, order)
    solution = least_squares(columns, motion)
    for _ in range(10):  # of Gauss-Newton; chosen: nearly all frequencies take three to six
        residual = motion - columns @ solution
        inliers = np.abs(residual) <= outlier_distance(solution, residual, residual.size)
        by_phase = np.concatenate(([0.0], -number * solution[order + 1 :], number * solution[1 : order + 1]))
        by_frequency = 2.0 * np.pi * time * (columns @ by_phase)
        found = least_squares(np.column_stack((columns, by_frequency)), motion, inliers)
        step = float(np.clip(found[-1], -_LARGEST_STEP * frequency, _LARGEST_STEP * frequency))
        frequency += step
        if abs(step) < _SETTLED * frequency:
            break
        columns, solution = basis(time * frequency, order), found[:-1]
    return frequency


def _is_periodic(time: Array, x: Array, period: float) -> bool:
    """True if the last rows of a motion agree with its rows one period earlier.

    Args:
        time: time of each row [s], (n,).
        x: displacement relative to the middle of its range, (n,).
        period: duration of the assumed cycle [s].
    """
    begin = int(np.searchsorted(time, period))
    if x.size - begin < 2:
        return True
    difference = shifted_difference(time, x, -period, slice(begin, None))
    scatter = np.median(np.abs(np.diff(x, 2))) if x.size > 4 else 0.0
    return float(np.sqrt(np.mean(np.square(difference)))) < max(_REPEATS * np.ptp(x) / 2.0, _REPEATS_SCATTER * scatter)


def waveform(coefficients: Array) -> str:
    """Name of a waveform, "a sine" or "a triangle" for example, from its complex harmonics, mean first."""
    share = abs(coefficients[3]) / abs(coefficients[1]) if coefficients.size > 3 else 0.0
    if abs(share - 1.0 / 9.0) < _LIKE:
        return "a triangle"
    return "a sine" if share < _LIKE else f"neither sine nor triangle (third harmonic {100 * share:.2g} %)"


def wrong_clock(loop: Loop, coefficients: Array) -> str | None:
    """Sentence on a loop without a time column whose rows cannot be evenly spaced in time, as the waveform shows.

    Args:
        loop: steady cycles, with the time that follows from the stated waveform.
        coefficients: complex harmonics of the displacement over this time, mean first.

    Returns:
        The sentence, or None without contradiction.
    """
    if loop.has_recorded_time:
        return None
    motion = loop.displacement
    half = np.ptp(motion) / 2.0
    outer = float(np.mean(np.abs(motion - motion.min() - half) > _OUTER * half))
    # of rows evenly spaced in time, 10 % are this far out for a triangle, and 29 % for a sine
    like, opposite = ("a sine", "a triangle") if outer > 0.2 else ("a triangle", "a sine")
    if waveform(coefficients) != opposite:
        return None
    return (
        f"{100 * outer:.2g} % of the rows lie beyond {_OUTER:g} of the amplitude, as for {like} recorded "
        f"evenly in time, but the {loop.direction.motion.words[0]} over time is {opposite}. For a file without time, "
        'rate means a triangle, and frequency with waveform = "sine" means a sine'
    )
