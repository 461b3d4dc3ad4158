"""Raw stepped-sine histories -> operating points: steps found, each reduced to its complex stiffness and its noise.

A history is cut into cycles at the upward crossings of its displacement, cycles that agree become steps, and each step
is evaluated by least squares on all of its steady cycles at once.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.measurement import Complex, Floats, Loop
from bushfit.reduction.cycles import Cycles, keeps_changing, mean_from_steady, pieces, wild_rows
from bushfit.reduction.harmonics import HarmonicFit
from bushfit.units import number

_FEWEST_ROWS_PER_CYCLE = 5.0
#: A frequency that changes by this share within a step, or differs by it between steps.
_SAME_FREQUENCY = 2e-3
#: While a controller swings in, the frequency may be off by this share, and a step by so much from start to end.
_SWINGING = 0.01
#: An amplitude that changes by this share within a step, and both by so many standard errors.
_SAME_AMPLITUDE, _SURELY = 0.03, 4.0
#: A sine that goes on after fewer cycles, as far from its phase as this [cycles], was interrupted and not stopped.
_INTERRUPTED, _IN_PHASE = 3.1, 0.05
#: Amplitudes further apart than this are levels of their own.
_LEVEL_GAP = 0.1
#: A step belongs to a level that is stated if it lies within this share of it.
_LEVEL_REACH = 0.3
#: What is said: amplitudes off their level by this share, fewer rows a cycle, more distortion of the displacement, and
#: how many stretches that make no point.
_MISSED, _COARSE, _DISTORTED, _MOST_TOLD = 0.03, 12, 0.02, 5


_CHANGING = "its frequency or amplitude keeps changing"


@dataclass(frozen=True, eq=False)
class Step:
    """One operating point, as the steady cycles of one step give it.

    Args:
        name: of the history.
        start, end: of the cycles used [s].
        cycles: whole cycles used; found: cycles of the whole step.
        rows_per_cycle: mean number of rows in a cycle.
        frequency: fundamental [Hz].
        amplitude: of the displacement's fundamental, zero-to-peak, as really reached [m or rad].
        stiffness: complex K = F1/X1 [N/m or N m/rad].
        gain_error: standard error of |K|, relative to |K|.
        phase_error: standard error of the phase of K [rad].
        displacement_distortion, force_distortion: total harmonic distortion, relative to the fundamental.
        nominal_frequency, level: frequency [Hz] and amplitude [m or rad] of the group of steps it belongs to.
        repeat: number of this step among those at the same nominal frequency and level, from 1.
    """

    name: str
    start: float
    end: float
    cycles: int
    found: int
    rows_per_cycle: float
    frequency: float
    amplitude: float
    stiffness: complex
    gain_error: float
    phase_error: float
    displacement_distortion: float
    force_distortion: float
    nominal_frequency: float = 0.0
    level: float = 0.0
    repeat: int = 1

    @property
    def loss_factor(self) -> float:
        return self.stiffness.imag / self.stiffness.real


@dataclass(frozen=True, eq=False)
class Skipped:
    """A stretch of a history with cycles that make no operating point, and why; steady where it has enough cycles of
    one frequency and amplitude, and is no mere ramp or pause."""

    name: str
    start: float
    end: float
    why: str
    steady: bool


@dataclass(frozen=True, eq=False)
class Reduction:
    """What histories of one direction were reduced to: steps in the order of the histories and of time, stretches
    that make none, and the number of wild rows that were left out."""

    direction: Direction
    steps: tuple[Step, ...]
    skipped: tuple[Skipped, ...]
    wild: int = 0

    def array(self, name: str) -> NDArray[np.generic]:
        """One quantity of all steps, (n,)."""
        return np.array([getattr(step, name) for step in self.steps])

    @property
    def warnings(self) -> tuple[str, ...]:
        return tuple(_warnings(self))


def reduce(histories: Sequence[Loop], *, fewest_cycles: int = 3, levels: Sequence[float] = ()) -> Reduction:
    """Find the steps of raw histories and reduce each to one operating point.

    Args:
        histories: time, displacement and force, of one direction; steps may be joined by ramps and pauses.
        fewest_cycles: steady cycles that make a point.
        levels: amplitudes the test was meant to have [m or rad]; without them amplitudes group where they lie close.

    Raises:
        MeasurementError: no steady sine in any of them, or one far off every level.
    """
    sound = [_without_wild_rows(history) for history in histories]
    wild = sum(one.time.size for one in histories) - sum(one.time.size for one in sound)
    found = [_steps_of(history, fewest_cycles) for history in sound]
    steps = [step for some, _ in found for step in some]
    skipped = tuple(skip for _, some in found for skip in some)
    if not steps:
        raise MeasurementError(
            "no steady sine was found",
            file=histories[0].source.file if histories[0].source else histories[0].name,
            found="; ".join(f"{skip.start:.4g} to {skip.end:.4g} s: {skip.why}" for skip in skipped[:3])
            or "a displacement that does not go up and down",
            expected=f"a stepped sine with at least {fewest_cycles} whole cycles at one frequency and amplitude",
            hint="a slow loop needs no reduction: name it under [[loops]]",
        )
    direction = histories[0].direction
    _check_reach(steps, levels, direction)
    return Reduction(direction, tuple(_grouped(steps, levels)), skipped, wild)


def _without_wild_rows(history: Loop) -> Loop:
    """A history without the rows at which one of its channels lies alone far off; the fits need no even clock."""
    kept = ~(wild_rows(history.time, history.displacement) | wild_rows(history.time, history.force))
    return replace(history, **{name: getattr(history, name)[kept] for name in ("time", "displacement", "force")})


def sines(history: Loop) -> list[tuple[float, float, int]]:
    """Frequency [Hz], rough amplitude [m or rad] and cycles of each stretch of one frequency and amplitude."""
    cycles = Cycles.of(history.time, history.displacement)
    found = []
    for run in cycles.runs():
        edges = cycles.edges[run.start : run.stop + 1]
        size = cycles.range[run] / 2.0
        for part in pieces(edges, np.log(size)):
            count = part.stop - part.start
            if count > 1:
                frequency = count / float(edges[part.stop] - edges[part.start])
                found.append((frequency, float(np.median(size[part])), count))
    return found


def _steps_of(history: Loop, fewest: int) -> tuple[list[Step], list[Skipped]]:
    found: list[tuple[float, float, Step]] = []
    skipped: list[Skipped] = []
    cycles = Cycles.of(history.time, history.displacement)
    for run in cycles.runs():
        motion, force = (cycles.fundamentals(run, values) for values in (history.displacement, history.force))
        edges = cycles.edges[run.start : run.stop + 1]
        parts = pieces(edges, np.log(np.abs(motion)))
        if keeps_changing(edges, parts):
            skipped.append(Skipped(history.name, float(edges[0]), float(edges[-1]), _CHANGING, True))
            continue
        for part in parts:
            inside = slice(run.start + part.start, run.start + part.stop)
            start, end = float(edges[part.start]), float(edges[part.stop])
            why = _unusable(cycles, inside, fewest)
            step = None if why else _step(history, cycles, inside, motion[part], force[part], fewest)
            if step:
                found.append((start, end, step))
            else:
                steady = part.stop - part.start >= fewest
                skipped.append(Skipped(history.name, start, end, why or _CHANGING, steady))
    return _joined(found), skipped


def _joined(found: Sequence[tuple[float, float, Step]]) -> list[Step]:
    """Steps with the start and end of the cycles they were taken from; of two that are parts of one, the longer.

    A wild row, or an amplitude that creeps, parts a step: the sine goes on in phase, after a cycle or two at most.
    """
    kept: list[Step] = []
    last_end = -np.inf
    for start, end, step in found:
        gap = (start - last_end) * step.frequency
        if gap < _INTERRUPTED and abs(gap - round(gap)) < _IN_PHASE and _same_point(kept[-1], step):
            kept[-1] = max(kept[-1], step, key=lambda one: one.found)
        else:
            kept.append(step)
        last_end = end
    return kept


def _same_point(one: Step, other: Step) -> bool:
    """Whether two steps in a row are one: near in frequency and amplitude, or nearly so and one is brief."""
    brief = 2 * min(one.found, other.found) < max(one.found, other.found)
    return (
        abs(np.log(one.frequency / other.frequency)) < (_SWINGING if brief else _SAME_FREQUENCY)
        and abs(np.log(one.amplitude / other.amplitude)) < _LEVEL_GAP
    )


def _unusable(cycles: Cycles, inside: slice, fewest: int) -> str:
    """Why some cycles make no point, as far as that is seen without a fit."""
    count = inside.stop - inside.start
    frequency = count / (cycles.edges[inside.stop] - cycles.edges[inside.start])
    if count < fewest:
        return f"{count} cycle{'s' * (count != 1)} of {frequency:.4g} Hz, fewer than {fewest}"
    rows = (cycles.first_rows[inside.stop] - cycles.first_rows[inside.start]) / count
    if rows < _FEWEST_ROWS_PER_CYCLE:
        return f"{rows:.2g} rows a cycle at {frequency:.4g} Hz, fewer than {_FEWEST_ROWS_PER_CYCLE:g}"
    return ""


def _step(history: Loop, cycles: Cycles, inside: slice, motion: Complex, force: Complex, fewest: int) -> Step | None:
    """The point of one piece of cycles, its transient left out; None where it is not steady."""
    steady = mean_from_steady(motion, force / motion, fewest)
    used = slice(inside.start + steady.start, inside.start + steady.stop)
    edges = cycles.edges[used.start : used.stop + 1]
    count = used.stop - used.start
    own = motion[steady]
    starts = edges[:-1] - np.angle(1j * own) / (2.0 * np.pi) * np.diff(edges)  # nearer than single crossings are
    if _creeps(np.log(np.diff(starts)), _SWINGING) or _creeps(np.log(np.abs(own)), _SAME_AMPLITUDE):
        return None
    rows = slice(cycles.first_rows[used.start], cycles.first_rows[used.stop])
    fit = HarmonicFit.of(history.time[rows], history.displacement[rows], history.force[rows], edges)
    x, f = fit.coefficients[:, 1]
    errors = fit.errors()
    distortion = fit.distortion()
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
        errors[0],
        errors[1],
        distortion[0],
        distortion[1],
    )


def _creeps(values: Floats, least: float) -> bool:
    """Whether values change steadily from first to last, by that much and beyond their scatter."""
    if values.size < 3:
        return False
    number = np.arange(values.size) - (values.size - 1) / 2.0
    squares = float(number @ number)
    slope = float(number @ values) / squares
    left = values - values.mean() - slope * number
    error = np.sqrt(float(left @ left) / max(values.size - 2, 1) / squares)
    return bool(abs(slope) * values.size > least and abs(slope) > _SURELY * error)


def _check_reach(steps: Sequence[Step], levels: Sequence[float], direction: Direction) -> None:
    """Refuse a step far off every level that is stated."""
    unit, factor = direction.display.displacement
    for step in steps:
        if levels and min(abs(step.amplitude / level - 1.0) for level in levels) > _LEVEL_REACH:
            raise MeasurementError(
                "a step is at none of the levels",
                place=f"{step.name}, {step.start:.4g} to {step.end:.4g} s",
                found=f"{factor * step.amplitude:.4g} {unit} at {step.frequency:.4g} Hz",
                expected=f"within {100 * _LEVEL_REACH:g} % of "
                + " or ".join(f"{factor * level:.4g} {unit}" for level in levels),
                hint="name all levels, zero-to-peak, or leave --levels out",
            )


def _grouped(steps: Sequence[Step], levels: Sequence[float]) -> list[Step]:
    """The steps with their nominal frequency, level and repeat."""
    frequency = np.array([step.frequency for step in steps])
    amplitude = np.array([step.amplitude for step in steps])
    groups = _clusters(np.log(frequency), _SAME_FREQUENCY)
    nominal = np.array([np.median(frequency[groups == group]) for group in groups])
    if levels:
        rank = np.argmin(np.abs(np.log(amplitude[:, None] / np.asarray(levels))), axis=1)
    else:
        rank = _clusters(np.log(amplitude), _LEVEL_GAP)
    seen: dict[tuple[int, int], int] = {}
    grouped = []
    for step, group, level, middle in zip(steps, groups.tolist(), rank.tolist(), nominal, strict=True):
        seen[group, level] = repeat = seen.get((group, level), 0) + 1
        asked = float(levels[level] if levels else amplitude[rank == level].mean())
        grouped.append(replace(step, nominal_frequency=float(middle), level=asked, repeat=repeat))
    return grouped


def _clusters(values: Floats, gap: float) -> NDArray[np.intp]:
    """Number of the group of each value: groups lie further apart than `gap`, neighbours in one do not."""
    order = np.argsort(values)
    number = np.concatenate(([0], np.cumsum(np.diff(values[order]) > gap)))
    groups = np.empty(values.size, dtype=np.intp)
    groups[order] = number
    return groups


def _warnings(reduction: Reduction) -> Iterator[str]:
    unit, factor = reduction.direction.display.displacement
    steps = reduction.steps
    if reduction.wild:
        yield f"{reduction.wild} row{'s' * (reduction.wild > 1)} far off the rows around left out"
    slope = _amplitude_slope(steps)
    for level in sorted({step.level for step in steps}):
        mine = [step for step in steps if step.level == level]
        off = np.array([step.amplitude / level - 1.0 for step in mine])
        if np.abs(off).max() > _MISSED:
            low, high = (factor * level * (1.0 + end) for end in (off.min(), off.max()))
            yield (
                f"the rig reached {low:.4g} to {high:.4g} {unit} at the level of {factor * level:.4g} {unit}: |K| "
                f"there is up to {number(100 * abs(slope) * np.abs(off).max(), 2)} % off that at the level (fits count "
                "with what was reached)"
            )
    coarse = [step for step in steps if step.rows_per_cycle < _COARSE]
    if coarse:
        worst = min(coarse, key=lambda step: step.rows_per_cycle)
        yield (
            f"{len(coarse)} of {len(steps)} points have fewer than {_COARSE} rows a cycle ({worst.rows_per_cycle:.3g} "
            f"at {worst.frequency:.4g} Hz): overtones above half the sampling rate may fold onto the fundamental"
        )
    bent = [step for step in steps if step.displacement_distortion > _DISTORTED]
    if bent:
        worst = max(bent, key=lambda step: step.displacement_distortion)
        yield (
            f"the displacement is no clean sine at {len(bent)} of {len(steps)} points: up to "
            f"{number(100 * worst.displacement_distortion, 2)} % harmonic distortion ({worst.frequency:.4g} Hz, "
            f"{factor * worst.amplitude:.3g} {unit})"
        )
    rejected = [skip for skip in reduction.skipped if skip.steady]
    for skip in rejected[:_MOST_TOLD]:
        yield f"{skip.name}, {skip.start:.4g} to {skip.end:.4g} s makes no point: {skip.why}"
    if len(rejected) > _MOST_TOLD:
        yield f"{len(rejected) - _MOST_TOLD} more stretches make no point"


def _amplitude_slope(steps: Sequence[Step]) -> float:
    """d ln|K| / d ln X: of the smallest and largest amplitude at one frequency, the steepest; 0 where there is one."""
    slopes = [0.0]
    for frequency in {step.nominal_frequency for step in steps}:
        same = sorted((step for step in steps if step.nominal_frequency == frequency), key=lambda step: step.amplitude)
        for one, other in pairwise(same):
            if other.level != one.level:
                change = np.log(abs(other.stiffness / one.stiffness)) / np.log(other.amplitude / one.amplitude)
                slopes.append(float(change))
    return max(slopes, key=abs)
