"""Reduce raw stepped-sine histories to operating points: find the steps, and the complex stiffness in each step.

A history is cut into cycles at the upward crossings of its displacement. Consecutive cycles of equal frequency and
amplitude form a step, and a step is evaluated by one least-squares fit to all of its steady cycles.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import count
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.geometry import Place
from bushfit.progress import track
from bushfit.reading.headers import ERRORS
from bushfit.reading.measurement import Complex, Floats, Loop
from bushfit.reduction.arrays import median_and_scatter
from bushfit.reduction.cycles import (
    Cycles,
    keeps_changing,
    lone_outliers,
    resumes_in_phase,
    select_steady_cycles,
    steady_pieces,
)
from bushfit.reduction.harmonics import HarmonicFit
from bushfit.reduction.result import Reduction, SkippedStretch, Step

#: Smallest number of steady cycles of an operating point.
FEWEST_CYCLES = 3
#: Share of a record above which two cycles of one frequency are a test; chosen: steps take less between each other.
_SLOW_SHARE = 0.1
#: [ln] Largest difference of the frequency of cycles from that of their step.
_SAME_RATE = 0.1
#: Smallest ratio of the largest step to the range of its record; chosen: steps beside a larger motion are not the test.
_SMALLEST_LEVEL = 0.6
#: Smallest number of rows per cycle for an operating point; chosen: drift and fundamental have five unknowns.
_FEWEST_ROWS_PER_CYCLE = 5.0
#: Largest relative difference of equal frequencies; chosen: rigs are far more accurate, and frequency steps larger.
_SAME_FREQUENCY = 2e-3
#: Largest relative change of the frequency in a step, or difference from a step in which the controller settles.
_SETTLING_FREQUENCY = 0.01
#: [ln of an amplitude] Smallest gap between two levels; chosen: rigs miss a level by less.
_LEVEL_GAP = 0.1
#: Largest relative distance of a step from its stated level; chosen: rigs miss a level by less.
_LEVEL_REACH = 0.3
#: Smallest robust standard deviation of a motion that does not rest, relative to its amplitude; chosen: a sine has 1.
_LEAST_MOTION = 0.5
#: Reason why a stretch whose frequency or amplitude is not steady gives no point.
_CHANGING = "the frequency or amplitude changes all the time"


def reduce(histories: Sequence[Loop], *, fewest_cycles: int = FEWEST_CYCLES, levels: Sequence[float] = ()) -> Reduction:
    """Find the steps of raw histories and reduce each to one operating point.

    Args:
        histories: records of time, displacement and force of one direction, with ramps and pauses between the steps.
        fewest_cycles: smallest number of steady cycles for an operating point.
        levels: set amplitudes of the test, zero-to-peak [m or rad]; if empty, close amplitudes form a level.

    Returns:
        Operating points, stretches without an operating point, and the number of outliers.

    Raises:
        MeasurementError: no history has a steady sine, or the amplitude of a step is far from every level.
    """
    outliers, steps, skipped = 0, list[Step](), list[SkippedStretch]()
    for history in track("histories reduced", histories):
        faults = lone_outliers(history.time, history.displacement) | lone_outliers(history.time, history.force)
        outliers += int(faults.sum())
        found, rejected = find_steps(history.select(~faults), fewest_cycles)  # the fits need no even clock
        steps += found
        skipped += rejected
    if not steps:
        file = histories[0].source.file if histories[0].source else histories[0].name
        why = "; ".join(f"{skip.start:.4g} to {skip.end:.4g} s: {skip.why}" for skip in skipped[:3])
        why = why or "a displacement that does not oscillate"
        expected = f"a stepped sine with at least {fewest_cycles} whole cycles at one frequency and amplitude"
        raise MeasurementError(**ERRORS["no_steady_sine"], file=file, found=why, expected=expected)
    direction = histories[0].direction
    return Reduction(direction, tuple(group_steps(steps, levels, direction)), tuple(skipped), outliers)


class SteadySine(NamedTuple):
    """Stretch of a record with a steady sine: frequency [Hz], zero-to-peak amplitude [m or rad], number of cycles."""

    frequency: float
    amplitude: float
    cycles: int


def steady_sines(history: Loop) -> tuple[list[SteadySine], int]:
    """Find the steady stretches of a history without computing operating points.

    Returns:
        Stretches of two cycles or more, and the number of all cycles of the history.
    """
    cycles = Cycles.find(history.time, history.displacement)
    sines = []
    for run in cycles.runs():
        edges, amplitude = cycles.edges[run.start : run.stop + 1], cycles.range[run] / 2.0
        for part in _steady_parts(edges, np.log(amplitude), FEWEST_CYCLES):
            if (count := part.stop - part.start) > 1:
                frequency = count / float(edges[part.stop] - edges[part.start])
                sines.append(SteadySine(frequency, float(np.median(amplitude[part])), count))
    return sines, cycles.range.size


def distinct_points(sines: Sequence[SteadySine]) -> set[tuple[float, float]]:
    """Distinct operating points of steady sines: ln of the frequency to 0.01, and ln of the amplitude to 0.1."""
    return {(round(np.log(sine.frequency), 2), round(np.log(sine.amplitude), 1)) for sine in sines}


def is_stepped_sine(history: Loop, sines: Sequence[SteadySine], cycles: int) -> bool:
    """Test whether the steady stretches of a record are the steps of a stepped sine.

    Args:
        history: record of time, displacement and force.
        sines: steady stretches of the record, from `steady_sines`.
        cycles: number of all cycles of the record.

    Returns:
        True if stretches with enough cycles for an operating point give several points, and hold most of the cycles,
        the largest motion, and each frequency whose cycles take much of the record.
    """
    steps = [sine for sine in sines if sine.cycles >= FEWEST_CYCLES]
    if len(distinct_points(steps)) < 2 or 2 * sum(step.cycles for step in steps) < cycles:
        return False
    frequencies, levels, _ = np.array(steps).T
    slow = [sine.frequency for sine in sines if 2.0 / sine.frequency > _SLOW_SHARE * np.ptp(history.time)]
    has_slow = all(np.abs(np.log(frequencies / frequency)).min() < _SAME_RATE for frequency in slow)
    return has_slow and levels.max() > _SMALLEST_LEVEL * np.ptp(history.displacement) / 2.0


def _steady_parts(edges: Floats, log_amplitude: Floats, fewest: int) -> list[slice]:
    """Split a run of cycles into steady parts, as slices of its cycles; empty if its frequency sweeps continuously.

    Args:
        edges: times of the upward crossings [s], (m + 1,).
        log_amplitude: natural log of the amplitude of each cycle, (m,).
        fewest: smallest number of cycles of a step; if no part has as many, all but the cycles in which the motion
            starts and stops are one part.
    """
    parts = steady_pieces(edges, log_amplitude)
    if keeps_changing(edges, parts):
        return []
    if max(part.stop - part.start for part in parts) < fewest <= edges.size - 3:
        return [slice(1, edges.size - 2)]
    return parts


def find_steps(history: Loop, fewest: int) -> tuple[list[Step], list[SkippedStretch]]:
    """Find the steps of a history and compute their operating points.

    Args:
        history: record of time, displacement and force, without outliers.
        fewest: smallest number of steady cycles for an operating point.

    Returns:
        Operating points, and the stretches without an operating point.
    """
    found: list[tuple[float, float, Step]] = []
    skipped: list[SkippedStretch] = []
    cycles = Cycles.find(history.time, history.displacement)
    for run in cycles.runs():
        motion, force = cycles.fundamentals(run, history.displacement, history.force)
        edges = cycles.edges[run.start : run.stop + 1]
        parts = _steady_parts(edges, np.log(np.abs(motion)), fewest)
        if not parts:
            skipped.append(SkippedStretch(history.name, float(edges[0]), float(edges[-1]), _CHANGING, True))
        for part in parts:
            inside = slice(run.start + part.start, run.start + part.stop)
            start, end, count = float(edges[part.start]), float(edges[part.stop]), part.stop - part.start
            rows = (cycles.first_rows[inside.stop] - cycles.first_rows[inside.start]) / count
            frequency, why = f"{count / (end - start):.4g} Hz", _CHANGING
            if count < fewest:
                why = f"{count} cycle{'s' * (count != 1)} of {frequency}, fewer than {fewest}"
            elif rows < _FEWEST_ROWS_PER_CYCLE:
                why = f"{rows:.2g} rows per cycle at {frequency}, fewer than {_FEWEST_ROWS_PER_CYCLE:g}"
            elif step := _step(history, cycles, inside, motion[part], force[part], fewest):
                found.append((start, end, step))
                continue
            skipped.append(SkippedStretch(history.name, start, end, why, count >= fewest))
    return join_broken_steps(history, found), skipped


def join_broken_steps(history: Loop, timed_steps: Sequence[tuple[float, float, Step]]) -> list[Step]:
    """Merge steps that are parts of one interrupted step: the longest part remains.

    An outlier or a creeping amplitude splits a step; its sine resumes in phase after a cycle or two, without a rest.
    The frequencies of the parts may differ by up to 1 % if one part is much shorter, else by 0.2 %.

    Args:
        history: record of the steps.
        timed_steps: beginning [s] and end [s] of the cycles of each step, and the step, in order of time.

    Returns:
        Steps in order of time.
    """
    joined: list[Step] = []
    last_end = -np.inf
    for start, end, step in timed_steps:
        if resumes_in_phase((start - last_end) * step.frequency):
            before, (shorter, longer) = joined[-1], sorted((joined[-1].found, step.found))
            reach = _SETTLING_FREQUENCY if 2 * shorter < longer else _SAME_FREQUENCY
            is_same_frequency = abs(np.log(before.frequency / step.frequency)) < reach
            between = history.displacement[slice(*np.searchsorted(history.time, (last_end, start)))]
            rests = between.size > 0 and median_and_scatter(between)[1] < _LEAST_MOTION * step.amplitude
            if is_same_frequency and not rests and abs(np.log(before.amplitude / step.amplitude)) < _LEVEL_GAP:
                step = max(joined.pop(), step, key=lambda one: one.found)
        joined.append(step)
        last_end = end
    return joined


def _step(history: Loop, cycles: Cycles, inside: slice, motion: Complex, force: Complex, fewest: int) -> Step | None:
    """Compute the operating point of one step, without its transient; None if its cycles are not steady.

    Args:
        history: record of time, displacement and force.
        cycles: all cycles of the record.
        inside: slice of the k cycles of the step.
        motion, force: complex fundamentals of each of these cycles [m or rad, N or N m], (k,) each.
        fewest: smallest number of steady cycles.
    """
    steady = select_steady_cycles(motion, force / motion, fewest)
    used = slice(inside.start + steady.start, inside.start + steady.stop)
    edges = cycles.edges[used.start : used.stop + 1]
    count = used.stop - used.start
    steady_motion = motion[steady]
    # by the phase of each cycle's fundamental, which scatters less than single crossings
    starts = edges[:-1] - np.angle(1j * steady_motion) / (2.0 * np.pi) * np.diff(edges)
    if _has_trend(np.log(np.diff(starts)), _SETTLING_FREQUENCY) or _has_trend(np.log(np.abs(steady_motion)), 0.03):
        return None
    rows = slice(cycles.first_rows[used.start], cycles.first_rows[used.stop])
    fit = HarmonicFit.to_cycles(history.time[rows], history.displacement[rows], history.force[rows], edges)
    x, f = fit.coefficients[:, 1]
    errors, distortion = fit.errors().tolist(), fit.distortion().tolist()
    return Step(
        history.name,
        float(edges[0]),
        float(edges[-1]),
        count,
        inside.stop - inside.start,
        (rows.stop - rows.start) / count,
        fit.frequency,
        float(abs(x)),
        complex(f / x),
        gain_error=errors[0],
        phase_error=errors[1],
        displacement_distortion=distortion[0],
        force_distortion=distortion[1],
        mean_displacement=float(fit.coefficients[0, 0].real),
        mean_force=float(fit.coefficients[1, 0].real),
    )


def _has_trend(values: Floats, smallest: float) -> bool:
    """True if the total linear trend of values is larger than `smallest` and than their scatter explains.

    Args:
        values: log of the period, or of the amplitude, of each cycle in order, (n,).
        smallest: smallest total change of a trend.
    """
    if values.size < 3:
        return False
    (slope, _), covariance = np.polyfit(np.arange(values.size), values, 1, cov=True)
    error = float(np.sqrt(covariance[0, 0]))
    return bool(abs(slope) * values.size > smallest and abs(slope) > 4.0 * error)  # noise hardly ever goes that far


def group_steps(steps: Sequence[Step], levels: Sequence[float], direction: Place) -> list[Step]:
    """Group steps by frequency and amplitude, and number the repeats in each group.

    Args:
        steps: operating points of one direction.
        levels: set amplitudes of the test, zero-to-peak [m or rad]; if empty, close amplitudes form a level.
        direction: direction or specimen of the steps.

    Returns:
        The steps with their nominal frequency, level and repeat.

    Raises:
        MeasurementError: the amplitude of a step is far from every stated level.
    """
    frequency, amplitude = np.array([(step.frequency, step.amplitude) for step in steps]).T
    groups = _clusters(np.log(frequency), _SAME_FREQUENCY)
    nominal = np.array([np.median(frequency[groups == group]) for group in groups])
    if levels:
        nominal_levels, (unit, factor) = np.array(levels, dtype=float), direction.display.displacement
        level = nominal_levels[np.argmin(np.abs(np.log(amplitude[:, None] / nominal_levels)), axis=1)]
        far = np.flatnonzero(np.abs(amplitude[:, None] / nominal_levels - 1.0).min(axis=1) > _LEVEL_REACH)
        if far.size:
            step, listed = steps[far[0]], " or ".join(f"{factor * value:.4g} {unit}" for value in levels)
            raise MeasurementError(
                "the amplitude of a step is none of the stated levels",
                place=f"{step.name}, {step.start:.4g} to {step.end:.4g} s",
                found=f"{factor * step.amplitude:.4g} {unit} at {step.frequency:.4g} Hz",
                expected=f"within {100 * _LEVEL_REACH:g} % of {listed}",
                hint="name all levels, zero-to-peak, or leave --levels out",
            )
    else:
        rank = _clusters(np.log(amplitude), _LEVEL_GAP)
        level = np.array([amplitude[rank == number].mean() for number in rank])
    repeats: defaultdict[tuple[float, float], Iterator[int]] = defaultdict(lambda: count(1))
    return [
        replace(step, nominal_frequency=f, level=x, repeat=next(repeats[f, x]))
        for step, f, x in zip(steps, nominal.tolist(), level.tolist(), strict=True)
    ]


def _clusters(values: Floats, gap: float) -> NDArray[np.intp]:
    """Group index of each value, (n,): sorted neighbours more than `gap` apart are in different groups."""
    order = np.argsort(values)
    return np.concatenate(([0], np.cumsum(np.diff(values[order]) > gap)))[np.argsort(order)]
