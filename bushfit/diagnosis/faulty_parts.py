"""Faulty parts of the tests: a frequency, a level, a repeat or a loop that disagrees with the rest of the tests.

A level is the set of all points of a sweep at one constant amplitude, or at one constant frequency. A fault is an error
of gain and phase that all points of the part have in common (levels and repeats also have a slope of both), an error of
gain alone, or an error of each point.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, groupby
from math import log
from typing import Literal

import numpy as np
from scipy.special import bdtrc

from bushfit.diagnosis.explanations import Explanation, Signature
from bushfit.diagnosis.record import MisfitRegion
from bushfit.effects.contract import Array
from bushfit.fitting.measured_test import shown_amplitude
from bushfit.fitting.preparation import SAME_LOOP, MeasuredSweep, split_by_kind
from bushfit.fitting.problem import FitResult
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.model.result import Outlier
from bushfit.reading.preload import add_preload
from bushfit.units import number

#: Errors of the points of a faulty part.
Form = Literal["shift", "gain", "points"]
#: Maximum number of neighbouring frequencies that one disturbance covers: mains hum and its sidebands.
_WIDEST = 3
#: Ratio of frequencies or of amplitudes up to which they are the same.
_SAME = 1.05
#: Relative changes of the stiffness at both ends of a faulty part by errors of gain and phase, and by their slopes.
_SLOPING = np.kron([[1.0, 1.0], [1.0, -1.0]], [[1.0], [1.0j]])
#: Minimum number of frequencies in a campaign for one of them to be a suspect.
_FEWEST_FREQUENCIES = 5
#: Maximum number of single-frequency suspects; neighbours of more frequencies are joined. Chosen for time.
_MOST_FREQUENCIES = 100


@dataclass(frozen=True, eq=False)
class FaultyPart(Explanation):
    """Explanation of a gap by a fault of the tests: a frequency, level, repeat or loop whose points deviate together.

    A level is the set of all points of a sweep at one constant amplitude, or at one constant frequency.

    Args:
        direction: direction or specimen of the first test.
        frequency: lowest and highest frequency of the faulty points [Hz].
        amplitude: their smallest and largest amplitude, zero-to-peak [m or rad].
        may_be_physics: True if an effect that the model lacks could change the same points, and not a wrong test: the
            smallest or largest level of a direction, a loop that no other test covers, or frequencies in
            all directions at every amplitude.
        form: errors of the points: "shift", a common gain and phase error, which may slope; "gain", a common gain
            error; "points", an independent error of each point.
        amount: prior standard deviation of each error, relative to |K|; 0 before the fault is part of an explanation.
    """

    direction: Place
    frequency: tuple[float, float]
    amplitude: tuple[float, float]
    may_be_physics: bool = field(default=False, kw_only=True)
    form: Form = field(default="shift", kw_only=True)
    amount: float = field(default=0.0, kw_only=True)

    @property
    def columns(self) -> Array:
        """Changes of all n whitened residuals per unit of c errors (gain, phase [rad] and their slopes), (c, n)."""
        assert self.signature is not None
        return self.signature.whole

    @property
    def forms(self) -> tuple[Form, ...]:
        """Possible forms of the errors, equally probable: "shift", "gain" and "points", as far as the part has them."""
        by_family: dict[str, tuple[Form, ...]] = {"loop": ("shift",), "frequency": ("shift", "points")}
        return by_family.get(self.family, ("shift", "gain", "points"))

    def in_form(self, form: Form) -> FaultyPart:
        """Return this part with another assumption on the errors of its points.

        Args:
            form: "shift": all points have the same error of gain and phase; "gain": the same error of gain; "points":
                each point has an independent error.
        """
        assert self.signature is not None
        signature = self.signature
        if form == "gain":
            change = signature.stiffness_change[:1]
            signature = replace(signature, columns=signature.columns[:1], stiffness_change=change)
        elif form == "points":
            size = np.abs(signature.columns).max(axis=0)
            rows = np.flatnonzero(size)
            columns = size * (np.arange(size.size) == rows[:, None])
            signature = replace(signature, columns=columns, stiffness_change=np.eye(len(columns)))
        return replace(self, signature=signature, form=form)

    def region(self, residual: Array, change: float) -> MisfitRegion:
        """Describe this faulty part as a region in which tests and model disagree, for the report.

        Args:
            residual: whitened residuals of all tests, (n,).
            change: deviation of the part from the model, relative to |K|.
        """
        kind, component = ("loop", "force") if self.family == "loop" else ("sweep", "storage")
        reading = f"{self.name}: a deviation of {number(100 * change, 2)} % from all other tests"
        excess = self.distance(residual)
        return MisfitRegion(self.direction, kind, self.frequency, self.amplitude, component, excess, reading)

    def distance(self, residual: Array) -> float:
        """Root mean square deviation of this part's points from the model, in units of noise.

        Args:
            residual: whitened residuals of all tests, (n,).
        """
        columns = self.columns
        amounts = columns @ residual / np.maximum(np.linalg.norm(columns, axis=1), 1e-300)
        return float(np.sqrt(np.mean(amounts**2)))


@dataclass(frozen=True, eq=False)
class OutlierCluster(FaultyPart):
    """Explanation of several outliers at one frequency, all left out of the fit, by a disturbance at that frequency.

    Args:
        outlier_distance: root mean square distance of the outliers from the model, in units of noise.
        size: largest distance of a point from the model, |K_model - K_measured|/|K_measured|.
        log_odds: natural log of the odds of a disturbance against a chance coincidence of single wrong rows.
    """

    outlier_distance: float
    size: float
    log_odds: float

    def distance(self, residual: Array) -> float:  # noqa: ARG002
        return self.outlier_distance


def is_pattern(faulty_parts: Sequence[FaultyPart]) -> bool:
    """True if suspected faults look like an effect that the model lacks rather than like faults of single tests.

    Such patterns are:

    - two or more frequencies of a sweep, as by a resonance, or the same frequency in every direction;
    - the smallest or the largest level, as by a contact, unless the same level of another preload contradicts it;
    - two loops of the same direction, rate and amplitude.

    Returns:
        True for a pattern.
    """
    if sum(part.family == "frequency" for part in faulty_parts) > 1 or any(
        part.may_be_physics for part in faulty_parts
    ):
        return True
    loops = [(part.direction, *part.frequency, *part.amplitude) for part in faulty_parts if part.family == "loop"]
    return any(
        first[0] == second[0] and np.allclose(first[1:], second[1:], rtol=SAME_LOOP, atol=0.0)
        for first, second in combinations(loops, 2)
    )


def outlier_clusters(
    outliers: Sequence[Outlier], sweeps: Sequence[MeasuredSweep], model: Model
) -> list[OutlierCluster]:
    """Find frequencies with several outliers, which suggest a disturbance rather than single wrong rows.

    Args:
        outliers: points that were left out.
        sweeps: the sweeps as they were read.
        model: the fitted model.

    Returns:
        One explanation for each frequency with two or more outliers.

    Notes:
        Single wrong rows may have the same frequency by chance. The probability that k of n wrong rows do is the
        binomial probability of k - 1 or more among n - 1, with p = 1 / number of frequencies.
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
            OutlierCluster(
                "part",
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


def find_faulty_parts(fit: FitResult) -> list[FaultyPart]:
    """List the parts of the tests that may be faulty, as explanations of a gap.

    Args:
        fit: the fitted model and the tests.

    Returns:
        Frequencies, levels, repeats and, if there are sweeps too, loops.
    """
    loops, sweeps = split_by_kind(fit.data_sets)
    faulty_parts = [*_frequencies(fit, sweeps), *_levels(fit, sweeps), *_repeats(fit, sweeps)]
    for loop in loops if sweeps else ():  # wrong as a whole, in gain or offset
        signature = Signature(
            np.array(loop.gain_and_offset()),
            np.eye(2),
            act_together=True,
            covered_rows=(fit.residual_rows[loop], fit.residual.size),
        )
        frequency, amplitude = float(loop.frequency[0]), float(loop.amplitude[0])
        is_covered = any(
            test.frequency.min() / _SAME <= frequency <= test.frequency.max() * _SAME
            and test.amplitude.min() / _SAME <= amplitude <= test.amplitude.max() * _SAME
            for test in fit.data_sets
            if test is not loop and test.direction == loop.direction
        )
        ends, name = ((frequency,) * 2, (amplitude,) * 2), f"the loop {loop.name}"
        part = FaultyPart("part", "loop", name, signature, loop.direction, *ends, may_be_physics=not is_covered)
        faulty_parts.append(part)
    return faulty_parts


def _level_label(sweep: MeasuredSweep, point: int) -> str:
    """Name of the level (constant amplitude or frequency) to which a point of a sweep, given by its index, belongs."""
    if sweep.test.stepped == "frequency":
        return f"the {sweep.direction} level {shown_amplitude(sweep.direction, sweep.amplitude[point])}"
    if sweep.test.stepped == "amplitude":
        return f"the {sweep.direction} sweep of amplitudes at {sweep.frequency[point]:.4g} Hz"
    return f"run {sweep.repeat[point]} of {sweep.name}, {sweep.direction}"


def _levels(fit: FitResult, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPart]:
    """Generate suspected faults of levels (constant amplitude or frequency), and of single repeats of a level.

    A level is suspected only if the sweep has several, a repeat only if the level has three or more. An effect of the
    largest level, such as a contact, acts under every larger preload too, and one of the smallest under smaller ones.
    """
    preloads = {sweep: abs(sweep.test.preload.value) if sweep.test.preload else 0.0 for sweep in sweeps}
    for sweep in sweeps:
        members = [member for member in sweeps if member.direction == sweep.direction]
        levels, preload = np.concatenate([np.unique(member.run_level) for member in members]), preloads[sweep]
        for level in np.unique(sweep.run_level):
            mask = sweep.run_level == level
            label = add_preload(_level_label(sweep, int(np.argmax(mask))), sweep.test.preload, sweep.direction)
            if levels.size > 1:  # in this file or in others
                part = _common_fault(fit, "level", label, [sweep], [mask])
                rivals = [member for member in members if member is not sweep]
                distances = [np.abs(np.log(rival.run_level / level)).min() for rival in rivals]
                loads = [preloads[r] for r, d in zip(rivals, distances, strict=True) if d < np.log(_SAME)]
                is_largest = level == levels.max() and all(preload > load for load in loads)
                is_smallest = level == levels.min() and all(preload < load for load in loads)
                yield replace(part, may_be_physics=levels.size > 2 and (is_largest or is_smallest))
            numbers = np.unique(sweep.repeat[mask])
            for repeat in numbers if numbers.size > 2 else ():
                points = mask & (sweep.repeat == repeat)
                yield _common_fault(fit, "repeat", f"repeat {repeat} of {label}", [sweep], [points])


def _repeats(fit: FitResult, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPart]:
    """Generate suspected faults: each repeat, in one sweep, in all sweeps of a direction, or in all sweeps."""
    for _, label, members in _scopes(sweeps):
        if not all(np.unique(sweep.repeat).size > 1 for sweep in members):
            continue
        for repeat in sorted({int(repeat) for sweep in members for repeat in sweep.repeat}):
            chosen = [sweep.repeat == repeat for sweep in members]
            if all(mask.any() for mask in chosen):
                yield _common_fault(fit, "repeat", f"repeat {repeat} of {label}", members, chosen)


def _frequencies(fit: FitResult, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPart]:
    """Generate suspected faults: one to three frequencies, in one sweep, all sweeps of a direction, or all sweeps."""
    steps = np.unique(np.concatenate([sweep.frequency for sweep in sweeps])) if sweeps else np.empty(0)
    if steps.size < _FEWEST_FREQUENCIES:
        return
    bands = [part[[0, -1]].tolist() for part in np.array_split(steps, min(steps.size, _MOST_FREQUENCIES))]
    for location, _, members in _scopes(sweeps):
        masks = [[(low <= sweep.frequency) & (sweep.frequency <= high) for sweep in members] for low, high in bands]
        columns = [_shift_columns(fit, members, chosen) for chosen in masks]
        for width in range(1, _WIDEST + 1):
            for first in range(len(bands) - width + 1):
                window = slice(first, first + width)
                if not all(mask.any() for chosen in masks[window] for mask in chosen):
                    continue
                ends = dict.fromkeys((bands[first][0], bands[first + width - 1][-1]))
                name = f"{' to '.join(f'{end:.4g}' for end in ends)} Hz in {location}, at every amplitude"
                chosen = [np.any(of_sweep, axis=0) for of_sweep in zip(*masks[window], strict=True)]
                change = np.kron(np.eye(width), np.array([[1.0], [1.0j]]))
                part = _common_fault(fit, "frequency", name, members, chosen, np.concatenate(columns[window]), change)
                yield replace(part, may_be_physics=len({sweep.direction for sweep in members}) > 1)


def _scopes(sweeps: Sequence[MeasuredSweep]) -> Iterator[tuple[str, str, Sequence[MeasuredSweep]]]:
    """Generate the sets of sweeps that may have a common fault: each sweep, all sweeps of a direction, all sweeps.

    Yields:
        Text on the location, such as a direction; text on the sweeps; and the sweeps.
    """

    def direction_of(sweep: MeasuredSweep) -> str:
        return str(sweep.direction)

    by_direction = [(name, list(members)) for name, members in groupby(sorted(sweeps, key=direction_of), direction_of)]
    for name, members in by_direction:
        several = len(members) > 1
        for sweep in members:
            label = f"the {name} sweep {sweep.name}"
            yield label if several else name, label, [sweep]
        if several:
            yield name, f"every {name} sweep", members
    if len(by_direction) > 1:
        yield "all directions", "every sweep", sweeps


def _common_fault(
    fit: FitResult,
    family: str,
    name: str,
    sweeps: Sequence[MeasuredSweep],
    chosen: Sequence[Array],
    columns: Array | None = None,
    change: Array = _SLOPING,
) -> FaultyPart:
    """Explanation of a gap by errors of gain and phase, and their slopes, that some points of sweeps have in common.

    Args:
        fit: the fitted model and the tests.
        family: kind of the fault, such as "level" or "repeat".
        name: name of the fault for reports.
        sweeps: sweeps that have the fault.
        chosen: mask of the faulty points of each sweep, (n,) each.
        columns: change of the whitened residuals of `sweeps` per unit of each of c errors, (c, rows); None for gain,
            phase and their slopes.
        change: complex relative change of the stiffness per unit of each error at p points of the part, (c, p).
    """
    columns = _shift_columns(fit, sweeps, chosen, sloping=True) if columns is None else columns
    frequency, amplitude = (
        np.concatenate([getattr(sweep, axis)[mask] for sweep, mask in zip(sweeps, chosen, strict=True)])
        for axis in ("frequency", "amplitude")
    )
    ends = (float(frequency.min()), float(frequency.max())), (float(amplitude.min()), float(amplitude.max()))
    signature = Signature(columns, change, act_together=True, covered_rows=(fit.row_span(sweeps), fit.residual.size))
    return FaultyPart("part", family, name, signature, sweeps[0].direction, *ends)


def _shift_columns(
    fit: FitResult, sweeps: Sequence[MeasuredSweep], chosen: Sequence[Array], sloping: bool = False
) -> Array:
    """Changes of the whitened residuals of sweeps due to a gain error of 100 % and a phase error of 1 rad.

    Args:
        fit: the fitted model and the tests.
        sweeps: sweeps with the errors.
        chosen: mask of the points with the errors in each sweep, (n,) each.
        sloping: True to add gain and phase errors that vary linearly with the log of the stepped quantity (frequency or
            amplitude).

    Returns:
        Changes of the residuals of all rows from the first to the last of `sweeps`, (2, rows), or (4, rows) with
        slopes.
    """
    rows = fit.row_span(sweeps)
    columns = np.zeros((2 + 2 * sloping, rows.stop - rows.start))
    for sweep, mask in zip(sweeps, chosen, strict=True):
        log_step = np.log(sweep.step)
        slope = 2.0 * (log_step - log_step.mean()) / max(float(np.ptp(log_step)), 1e-9)
        shapes = [mask.astype(float), *([mask * slope] if sloping else [])]
        sweep_rows = fit.residual_rows[sweep]
        columns[:, sweep_rows.start - rows.start : sweep_rows.stop - rows.start] = [
            column for shape in shapes for column in sweep.shared_error_columns(shape)
        ]
    return columns
