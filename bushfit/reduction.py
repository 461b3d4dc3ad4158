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
from scipy.special import fdtri

from bushfit.cycles import Cycles, keeps_changing, mean_from_steady, pieces
from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.measurement import Floats, Loop

Complex = NDArray[np.complex128]

#: Overtones in the fit, as far as the rows can tell them apart.
_HARMONICS = 15
_WORST_CONDITION = 100.0
#: Terms of the drift: mean, slope, curvature.
_DRIFT = 3
_CHUNK = 1 << 14
#: The frequency is found when the phase drifts by no more than this over the whole step [cycles].
_SETTLED = 1e-7
#: Rows that the search for the frequency takes of a long step.
_FREQUENCY_ROWS = 1 << 17
#: Cycles disagree with white noise where that is this unlikely.
_WHITE_P = 0.01
_FEWEST_ROWS_PER_CYCLE = 5.0
#: A frequency that changes by this share within a step, or differs by it between steps.
_SAME_FREQUENCY = 2e-3
#: Amplitudes further apart than this are levels of their own.
_LEVEL_GAP = 0.1
#: What is said: amplitudes off their level by this share, fewer rows a cycle, more distortion of the displacement, and
#: how many stretches that make no point.
_MISSED, _COARSE, _DISTORTED, _MOST_TOLD = 0.03, 12, 0.02, 5


_CHANGING = "the frequency keeps changing"


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
    """What histories of one direction were reduced to; steps in the order of the histories and of time."""

    direction: Direction
    steps: tuple[Step, ...]
    skipped: tuple[Skipped, ...]

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
        MeasurementError: no steady sine in any of them.
    """
    found = [_steps_of(history, fewest_cycles) for history in histories]
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
    return Reduction(histories[0].direction, tuple(_grouped(steps, levels)), skipped)


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
    steps: list[Step] = []
    skipped: list[Skipped] = []
    cycles = Cycles.of(history.time, history.displacement)
    for run in cycles.runs():
        motion, force = (cycles.fundamentals(run, values) for values in (history.displacement, history.force))
        mine: list[Step] = []
        edges = cycles.edges[run.start : run.stop + 1]
        parts = pieces(edges, np.log(np.abs(motion)))
        if keeps_changing(edges, parts):
            skipped.append(Skipped(history.name, float(edges[0]), float(edges[-1]), _CHANGING, True))
            continue
        for part in parts:
            inside = slice(run.start + part.start, run.start + part.stop)
            why = _unusable(cycles, inside, fewest)
            steady = part.stop - part.start >= fewest
            step = None if why else _step(history, cycles, inside, motion[part], force[part], fewest)
            if step is None:
                why = why or _CHANGING
                start, end = float(edges[part.start]), float(edges[part.stop])
                skipped.append(Skipped(history.name, start, end, why, steady))
            elif mine and _same_point(mine[-1], step):  # a step in parts, for instance with an amplitude that creeps
                mine[-1] = max(mine[-1], step, key=lambda one: one.cycles)
            else:
                mine.append(step)
        steps += mine
    return steps, skipped


def _same_point(one: Step, other: Step) -> bool:
    return (
        abs(np.log(one.frequency / other.frequency)) < _SAME_FREQUENCY
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
    number = np.arange(count + 1) - count / 2.0
    if count > 3:
        curve, slope, _ = np.polyfit(number, edges, 2)
        if abs(2.0 * curve * count / slope) > _SAME_FREQUENCY + 10.0 * _slope_noise(edges) / slope:
            return None
    rows = slice(cycles.first_rows[used.start], cycles.first_rows[used.stop])
    fit = _Fit.of(history.time[rows], history.displacement[rows], history.force[rows], edges)
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


def _slope_noise(edges: Floats) -> float:
    """What the scatter of the crossings does to a period, over a whole step [s]."""
    return float(np.median(np.abs(np.diff(edges, 2)))) / np.sqrt(edges.size)


@dataclass(frozen=True, eq=False)
class _Fit:
    """Drift and harmonics of displacement and force over the whole cycles of one step, and what they leave.

    Args:
        frequency: [Hz].
        solution: drift, then cosine and negative sine of each harmonic, of both channels, (p, 2).
        covariance: of the solution for unit variance of the values, (p, p).
        freedom: rows less unknowns.
        squares: products of the residuals of the channels, summed over the rows, (2, 2).
        left_over: what each cycle's fundamental differs by from the fit's, (2, cycles).
    """

    frequency: float
    solution: Floats
    covariance: Floats
    freedom: int
    squares: Floats
    left_over: Complex

    @classmethod
    def of(cls, time: Floats, displacement: Floats, force: Floats, edges: Floats) -> _Fit:
        """Fit with the frequency at which the phase of the displacement does not drift from cycle to cycle."""
        middle = (edges[0] + edges[-1]) / 2.0
        time, values = time - middle, np.stack((displacement, force))
        count = edges.size - 1
        frequency = count / float(edges[-1] - edges[0])
        thin = slice(None, None, max(1, time.size // _FREQUENCY_ROWS))
        number = np.arange(count) - (count - 1) / 2.0
        for _ in range(4):
            fit = cls._solved(time[thin], values[:, thin], count, frequency, 3)
            phase = np.unwrap(np.angle(fit.coefficients[0, 1] + fit.left_over[0]))
            drift = float(number @ phase / (number @ number)) / (2.0 * np.pi)
            frequency *= 1.0 + drift
            if abs(drift) * count < _SETTLED:
                break
        return cls._solved(time, values, count, frequency, _HARMONICS)

    @classmethod
    def _solved(cls, time: Floats, values: Floats, count: int, frequency: float, order: int) -> _Fit:
        size = _DRIFT + 2 * max(1, min(order, (time.size - _DRIFT) // 4))
        gram, moments = np.zeros((size, size)), np.zeros((size, 2))
        for rows, basis in _bases(time, frequency, size):
            gram += basis @ basis.T
            moments += basis @ values[:, rows].T
        scale = 1.0 / np.sqrt(np.diag(gram))
        unit = gram * np.outer(scale, scale)
        while size > _DRIFT + 2 and np.linalg.cond(unit[:size, :size]) > _WORST_CONDITION:
            size -= 2
        covariance = np.linalg.inv(unit[:size, :size]) * np.outer(scale[:size], scale[:size])
        solution = covariance @ moments[:size]
        squares, sums, rows_in = np.zeros((2, 2)), np.zeros((2, 2, count)), np.zeros(count)
        for rows, basis in _bases(time, frequency, size):
            left = values[:, rows] - solution.T @ basis
            squares += left @ left.T
            number = np.clip(time[rows] * frequency + count / 2.0, 0, count - 1).astype(np.intp)
            rows_in += np.bincount(number, minlength=count)
            for channel, part in np.ndindex(2, 2):  # times exp(-i omega t)
                sums[channel, part] += np.bincount(number, left[channel] * basis[_DRIFT + part], count)
        sums *= 2.0 / np.maximum(rows_in, 1.0)
        left_over = sums[:, 0] + 1j * sums[:, 1]
        return cls(frequency, solution, covariance, max(time.size - size, 1), squares, left_over)

    @property
    def coefficients(self) -> Complex:
        """Complex harmonics of displacement and force, with the mean at 0: (2, order + 1)."""
        waves = self.solution[_DRIFT::2] + 1j * self.solution[_DRIFT + 1 :: 2]
        return np.vstack((self.solution[:1], waves)).T

    @property
    def chance(self) -> Floats:
        """Expected square of each harmonic of white noise of unit variance, (order,)."""
        return np.diag(self.covariance)[_DRIFT:].reshape(-1, 2).sum(axis=1)

    def errors(self) -> tuple[float, float]:
        """Standard errors of |K| relative to |K|, and of its phase [rad].

        e = f - K x is what the noise of both channels leaves in the force. Its scatter over the rows gives the errors
        where it is white; where the cycles scatter otherwise than white noise would let them (hum, slow wander; or
        overtones beyond the fit, which repeat in each cycle), their own scatter does.
        """
        x, f = self.coefficients[:, 1]
        k = f / x
        (xx, xf), (_, ff) = self.squares
        white = (ff - 2.0 * k.real * xf + abs(k) ** 2 * xx) / self.freedom * self.chance[0] / 2.0
        variance = np.full(2, white)
        cycles = self.left_over.shape[1]
        if cycles > 2:
            scatter = (self.left_over[1] - k * self.left_over[0]) / (f / abs(f))
            own = np.array([scatter.real.var(ddof=1), scatter.imag.var(ddof=1)]) / cycles
            low, high = fdtri(2 * (cycles - 1), self.freedom, [_WHITE_P / 2, 1 - _WHITE_P / 2])
            if not low <= own.mean() / max(white, 1e-300) <= high:
                variance = own
        gain, phase = np.sqrt(variance) / abs(f)
        return float(gain), float(phase)

    def distortion(self) -> tuple[float, float]:
        """Total harmonic distortion of displacement and force, less what noise alone would show."""
        power = np.square(np.abs(self.coefficients[:, 1:]))
        noise = np.outer(np.diag(self.squares) / self.freedom, self.chance)
        overtones = np.maximum((power - noise)[:, 1:].sum(axis=1), 0.0)
        displacement, force = np.sqrt(overtones / power[:, 0])
        return float(displacement), float(force)


def _bases(time: Floats, frequency: float, size: int) -> Iterator[tuple[slice, Floats]]:
    """Chunk by chunk: its rows, and drift, then cosine and negative sine of each harmonic there, (size, m)."""
    half = max(float(np.abs(time[[0, -1]]).max()), 1e-300)
    for start in range(0, time.size, _CHUNK):
        rows = slice(start, min(start + _CHUNK, time.size))
        basis = np.empty((size, rows.stop - start))
        span = time[rows] / half
        basis[0], basis[1], basis[2] = 1.0, span, 1.5 * span**2 - 0.5
        turn = np.exp(2j * np.pi * frequency * time[rows])
        power = turn.copy()
        for column in range(_DRIFT, size, 2):
            basis[column], basis[column + 1] = power.real, -power.imag
            power *= turn
        yield rows, basis


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
        mean = float(amplitude[rank == level].mean())
        grouped.append(replace(step, nominal_frequency=float(middle), level=mean, repeat=repeat))
    return grouped


def _clusters(values: Floats, gap: float) -> NDArray[np.intp]:
    """Number of the group of each value: groups lie further apart than `gap`, neighbours in one do not."""
    order = np.argsort(values)
    number = np.concatenate(([0], np.cumsum(np.diff(values[order]) > gap)))
    groups = np.empty(values.size, dtype=np.intp)
    groups[order] = number
    return groups


def _warnings(reduction: Reduction) -> Iterator[str]:
    unit, factor = ("deg", 180.0 / np.pi) if reduction.direction is Direction.TORSION else ("mm", 1e3)
    steps = reduction.steps
    slope = _amplitude_slope(steps)
    for level in sorted({step.level for step in steps}):
        mine = [step for step in steps if step.level == level]
        off = np.array([step.amplitude / level - 1.0 for step in mine])
        if np.abs(off).max() > _MISSED:
            low, high = (factor * level * (1.0 + end) for end in (off.min(), off.max()))
            yield (
                f"the rig reached {low:.4g} to {high:.4g} {unit} at the level of {factor * level:.4g} {unit}: |K| "
                f"there is up to {100 * abs(slope) * np.abs(off).max():.2g} % off that at the level (fits count with "
                "what was reached)"
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
            f"{100 * worst.displacement_distortion:.2g} % harmonic distortion ({worst.frequency:.4g} Hz, "
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
