"""Explanations of a gap, each a name with columns and a prior: smooth curves, the compound's deviation, outliers.

Smooth curves without a name and the compound's own deviation are Gaussian processes over ln frequency and ln strain
(Kennedy and O'Hagan, 2001). No rubber follows a few parameters exactly. The deviation of the compound is the same
function in every direction and on every specimen, while errors of a rig differ between them. So it is part of every
hypothesis, at sizes that `priors.COMPOUND` weighs, and nothing is named for what it explains as well.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field, replace
from math import log

import numpy as np
from scipy.linalg import block_diag
from scipy.special import bdtrc

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.groups import Group
from bushfit.effects.contract import Array
from bushfit.fitting.loop_harmonics import smooth_waves
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep, MeasuredTest, group_repeats, split_by_kind
from bushfit.gaussian_process import coordinates, in_lengths, patterns
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.model.result import Outlier
from bushfit.reading.measurement import SAME_TEMPERATURE

#: Name of the compound's own deviation among explanations without a name.
COMPOUND = "compound"
#: Lengths in ln frequency and ln strain over which the compound's deviation changes: relaxation takes decades of
#: frequency, and breakdown more than one of strain. And its patterns: on plans of three to five levels more gain
#: nothing.
_COMPOUND_LENGTHS, _COMPOUND_PATTERNS = (8.0, 3.0), 12
#: Lengths over which a curve without a name changes: smooth, and rough.
_CURVE_LENGTHS = {"smooth": (1.5, 1.2), "rough": (0.5, 0.5)}
#: Points that a curve is made of at most, its patterns at most, and the least variance of one relative to the largest.
_CURVE_PATTERNS = {"nodes": 150, "count": 16, "minimum": 1e-4}
#: Phases of a cycle at which harmonics are summed up: six a wave of the fastest.
_PHASES = 32
#: First of the rows of `MeasuredLoop.contrasts` that the stiffness at the loop's frequency does not make.
_OVERTONES = 3


@dataclass(frozen=True, eq=False)
class Explanation:
    """One explanation of a gap.

    Args:
        kind: "effect", "place", "unnamed" or "record"; each kind has a prior probability.
        family: group that shares the prior probability: an effect in all places, or a kind of place.
        name: name of the explanation.
        group: its columns in the residuals; None for an effect that replaces a branch, which has to be refitted.
    """

    kind: str
    family: str
    name: str
    group: Group | None


@dataclass(frozen=True, eq=False)
class FaultyPlace(Explanation):
    """Points of the tests that deviate together.

    Args:
        direction: direction of the first test.
        frequency: lowest and highest [Hz].
        amplitude: lowest and highest, zero-to-peak [m or rad].
        extreme: True for the smallest or largest level of its direction, where a law of amplitude does the same.
    """

    direction: Place
    frequency: tuple[float, float]
    amplitude: tuple[float, float]
    extreme: bool = field(default=False, kw_only=True)

    @property
    def columns(self) -> Array:
        """Whitened residuals that a unit deviation of each kind makes, (c, n)."""
        assert self.group is not None
        return self.group.whole

    def point_by_point(self) -> FaultyPlace:
        """The place with an independent error of every point, for faults other than a shift or a slope."""
        if self.family == "loop":
            return self
        size = np.abs(self.columns).max(axis=0)
        rows = np.flatnonzero(size)
        columns = np.zeros((rows.size, size.size))
        columns[np.arange(rows.size), rows] = size[rows]
        return replace(self, group=Group(columns, np.eye(rows.size), together=True))

    def distance(self, residual: Array) -> float:
        """Root mean square deviation along the columns of the place, in units of noise, from residuals (n,)."""
        columns = self.columns
        amounts = columns @ residual / np.maximum(np.linalg.norm(columns, axis=1), 1e-300)
        return float(np.sqrt(np.mean(amounts**2)))


@dataclass(frozen=True, eq=False)
class Meeting(FaultyPlace):
    """Points that were left out as outliers, all at one frequency.

    Args:
        outlier_distance: root mean square distance of the points, in units of noise.
        size: largest distance of a point, relative to |K|.
        log_odds: log of the odds of a disturbance at the frequency over single rows that meet by chance.
    """

    outlier_distance: float
    size: float
    log_odds: float

    def distance(self, residual: Array) -> float:  # noqa: ARG002
        return self.outlier_distance


def is_pattern(places: Sequence[FaultyPlace]) -> bool:
    """True if places together may be physics: several frequencies, as of a resonance or a ripple, or a level at an end
    of the range, as of a contact or a law of amplitude."""
    return sum(place.family == "frequency" for place in places) > 1 or any(place.extreme for place in places)


def meetings(outliers: Sequence[Outlier], sweeps: Sequence[MeasuredSweep], model: Model) -> list[Meeting]:
    """Find frequencies at which several outliers lie: a disturbance there, and no rows that went wrong singly.

    Args:
        outliers: points that were left out.
        sweeps: the sweeps as they were read.
        model: the fitted model.

    Returns:
        One explanation for each frequency with two or more outliers.

    Notes:
        Single wrong rows meet at a frequency by chance: of n such rows, k lie at the frequency of one of them with the
        binomial probability of k - 1 or more among the n - 1 others, each with one over the number of frequencies.
    """
    distances = {(outlier.test, outlier.row): outlier.distance for outlier in outliers}
    points_by_frequency: dict[float, list[tuple[MeasuredSweep, int, float]]] = defaultdict(list)
    for sweep in sweeps:
        for point, (frequency, row) in enumerate(zip(sweep.frequency.tolist(), sweep.order.tolist(), strict=True)):
            points = points_by_frequency[frequency]
            if (sweep.name, row + 1) in distances:
                points.append((sweep, point, distances[sweep.name, row + 1]))
    found = []
    for frequency, points in points_by_frequency.items():
        if len(points) < 2:
            continue
        chance = float(bdtrc(len(points) - 2, len(outliers) - 1, 1.0 / len(points_by_frequency)))
        directions = dict.fromkeys(str(sweep.direction) for sweep, *_ in points)
        location = "several directions" if len(directions) > 1 else next(iter(directions))
        amplitudes = [float(sweep.amplitude[point]) for sweep, point, _ in points]
        found.append(
            Meeting(
                "place",
                "frequency",
                f"{frequency:.4g} Hz in {location} ({len(points)} points left out)",
                None,
                points[0][0].direction,
                (frequency, frequency),
                (min(amplitudes), max(amplitudes)),
                float(np.sqrt(np.mean(np.square([distance for *_, distance in points])))),
                max(float(np.linalg.norm(sweep.relative_difference(model)[:, point])) for sweep, point, _ in points),
                -log(max(chance, np.finfo(float).tiny)),
            )
        )
    return found


def compound(evidence: Evidence) -> Group | None:
    """Smooth relative deviation of the compound's modulus, the same in all directions and specimens.

    Args:
        evidence: fitted model and tests.

    Returns:
        Columns (c, n) and relative changes of |K| (c, points), where the deviation has unit variance at each operating
        point; the h-th harmonic of a loop has 1/h of it. None without an operating point.
    """
    if not evidence.data_sets:
        return None
    columns, share = _process(evidence, evidence.data_sets, _COMPOUND_LENGTHS, count=_COMPOUND_PATTERNS)
    for loops in group_repeats(split_by_kind(evidence.data_sets)[0]):
        overtones = _harmonics(evidence, loops)[_OVERTONES:]
        order = 2 + np.arange(len(overtones)) // 2
        columns = np.concatenate((columns, overtones / order[:, None]))
    unit = np.zeros((len(columns), share.shape[-1]), dtype=complex)
    unit[: len(share)] = share
    return Group(columns, unit, together=True)


def unnamed(evidence: Evidence) -> list[Explanation]:
    """List smooth curves as explanations.

    Sweeps of one direction and temperature share a curve, however many files they come in.

    Args:
        evidence: the fitted model and the tests.

    Returns:
        A smooth and a rough Gaussian process for each direction, a rough one for all, and the harmonics of the loops.
    """
    loops, sweeps = split_by_kind(evidence.data_sets)
    groups: dict[str, Group] = {}
    directions = dict.fromkeys(str(sweep.direction) for sweep in sweeps)
    for roughness, lengths in _CURVE_LENGTHS.items() if sweeps else ():
        columns, share = _process(evidence, sweeps, lengths, **_CURVE_PATTERNS)
        for direction in directions:
            curves: dict[Hashable, list[MeasuredSweep]] = defaultdict(list)
            for sweep in sweeps:
                if str(sweep.direction) == direction:
                    curves[_temperature_step(sweep)].append(sweep)
            parts = zip(*(_restricted(evidence, sweeps, c, columns, share) for c in curves.values()), strict=True)
            residuals, changes = map(np.concatenate, parts)
            groups[f"{roughness} {direction}"] = Group(residuals, changes, together=True)
        if roughness == "rough" and len(directions) > 1:  # a smooth curve in all directions is the compound's
            groups["rough all"] = Group(columns, share, together=True)
    if loops:
        repeats = group_repeats(loops)
        shapes = block_diag(*[smooth_waves(np.arange(_PHASES) / _PHASES)] * len(repeats))
        columns = np.concatenate([_harmonics(evidence, group) for group in repeats])
        groups["loops"] = Group(columns, shapes, together=True)
    return [Explanation("unnamed", "unnamed", name, group) for name, group in groups.items()]


def _process(
    evidence: Evidence, tests: Sequence[MeasuredTest], lengths: tuple[float, float], **limits: float
) -> tuple[Array, Array]:
    """Gaussian process of unit variance over the operating points of some tests, as a relative change of stiffness.

    Args:
        evidence: fitted model and all tests.
        tests: tests that share the process.
        lengths: correlation lengths in ln frequency and ln strain.
        limits: of `patterns`.

    Returns:
        Whitened residuals of independent amounts, in phase and in quadrature, (2 q, n), and their relative changes at
        the points of the tests, (2 q, points).
    """
    model = evidence.model
    points = [coordinates(test.frequency, test.amplitude * model.unit_strain(test.direction)) for test in tests]
    _, shapes = patterns(in_lengths(np.concatenate(points), lengths), **limits)  # type: ignore[arg-type]
    share = (shapes[:, None] * np.array([[1.0], [1.0j]])).reshape(-1, shapes.shape[-1])
    columns = np.zeros((len(share), evidence.residual.size))
    for test, change in zip(tests, np.split(share, np.cumsum([*map(len, points)])[:-1], axis=1), strict=True):
        stiffness = model.stiffness(test.direction, test.frequency, test.amplitude, kind=test.kind)
        columns[:, evidence.place[test]] = test.residual_change(change * stiffness, model)
    return columns, share


def _restricted(
    evidence: Evidence, tests: Sequence[MeasuredTest], chosen: Sequence[MeasuredTest], columns: Array, share: Array
) -> tuple[Array, Array]:
    """Columns and relative changes of a process that only some of the tests take part in."""
    rows = np.zeros(columns.shape[-1], dtype=bool)
    for test in chosen:
        rows[evidence.place[test]] = True
    points = np.concatenate([np.full(test.frequency.size, test in chosen) for test in tests])
    return columns * rows, share * points


def _harmonics(evidence: Evidence, loops: Sequence[MeasuredLoop]) -> Array:
    """Columns of the harmonics that repeated loops share, (c, n)."""
    columns = np.zeros((len(loops[0].contrasts()), evidence.residual.size))
    for loop in loops:
        columns[:, evidence.place[loop]] = loop.contrasts()
    return columns


def _temperature_step(sweep: MeasuredSweep) -> int | None:
    """Temperature of a sweep in steps of `SAME_TEMPERATURE`; None if it is not known."""
    kelvin = sweep.sweep.temperature
    return None if kelvin is None else round(float(np.mean(kelvin)) / SAME_TEMPERATURE)
