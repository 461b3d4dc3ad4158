"""Faulty parts of the tests: a frequency, a level, a repeat or a loop that disagrees with the rest of the tests.

A level is the set of all points of a sweep at one constant amplitude, or at one constant frequency. A fault is an error
of gain and phase that all points of the part have in common; levels and repeats also have a slope of both.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import FaultyPart
from bushfit.diagnosis.groups import Group
from bushfit.effects.contract import Array
from bushfit.fitting.measured_test import shown_amplitude
from bushfit.fitting.preparation import MeasuredSweep, split_by_kind
from bushfit.reading.preload import add_preload

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


def find_faulty_parts(evidence: Evidence) -> list[FaultyPart]:
    """List the parts of the tests that may be faulty, as explanations of a gap.

    Args:
        evidence: the fitted model and the tests.

    Returns:
        Frequencies, levels, repeats and, if there are sweeps too, loops.
    """
    loops, sweeps = split_by_kind(evidence.data_sets)
    faulty_parts = [*_frequencies(evidence, sweeps), *_levels(evidence, sweeps), *_repeats(evidence, sweeps)]
    for loop in loops if sweeps else ():  # wrong as a whole, in gain or offset
        group = Group(
            np.array(loop.gain_and_offset()),
            np.eye(2),
            act_together=True,
            covered_rows=(evidence.residual_rows[loop], evidence.residual.size),
        )
        frequency, amplitude = loop.prepared.frequency, loop.prepared.amplitude
        is_covered = any(
            test.frequency.min() / _SAME <= frequency <= test.frequency.max() * _SAME
            and test.amplitude.min() / _SAME <= amplitude <= test.amplitude.max() * _SAME
            for test in evidence.data_sets
            if test is not loop and test.direction == loop.direction
        )
        ends, name = ((frequency,) * 2, (amplitude,) * 2), f"the loop {loop.name}"
        part = FaultyPart("part", "loop", name, group, loop.direction, *ends, may_be_physics=not is_covered)
        faulty_parts.append(part)
    return faulty_parts


def _level_label(sweep: MeasuredSweep, point: int) -> str:
    """Text that names the level of a point of a sweep, given by the index of the point."""
    if sweep.sweep.stepped == "frequency":
        return f"the {sweep.direction} level {shown_amplitude(sweep.direction, sweep.amplitude[point])}"
    if sweep.sweep.stepped == "amplitude":
        return f"the {sweep.direction} sweep of amplitudes at {sweep.frequency[point]:.4g} Hz"
    return f"run {sweep.repeat[point]} of {sweep.name}, {sweep.direction}"


def _levels(evidence: Evidence, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPart]:
    """Generate suspected faults: each level, if there are several, and each repeat of a level with three or more."""
    for sweep in sweeps:
        levels_of_direction = [np.unique(member.held_value) for member in sweeps if member.direction == sweep.direction]
        levels = np.concatenate(levels_of_direction)
        for level in np.unique(sweep.held_value):
            mask = sweep.held_value == level
            label = add_preload(_level_label(sweep, int(np.argmax(mask))), sweep.sweep.preload, sweep.direction)
            if levels.size > 1:  # in this file or in others
                part = _common_fault(evidence, "level", label, [sweep], [mask])
                yield replace(part, may_be_physics=levels.size > 2 and level in (levels.min(), levels.max()))
            numbers = np.unique(sweep.repeat[mask])
            for number in numbers if numbers.size > 2 else ():
                repeat = mask & (sweep.repeat == number)
                yield _common_fault(evidence, "repeat", f"repeat {number} of {label}", [sweep], [repeat])


def _repeats(evidence: Evidence, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPart]:
    """Generate suspected faults: each repeat, in one sweep, in all sweeps of a direction, or in all sweeps."""
    for _, label, members in _scopes(sweeps):
        if not all(np.unique(sweep.repeat).size > 1 for sweep in members):
            continue
        for number in sorted({int(repeat) for sweep in members for repeat in sweep.repeat}):
            chosen = [sweep.repeat == number for sweep in members]
            if all(mask.any() for mask in chosen):
                yield _common_fault(evidence, "repeat", f"repeat {number} of {label}", members, chosen)


def _frequencies(evidence: Evidence, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPart]:
    """Generate suspected faults: one to three frequencies, in one sweep, all sweeps of a direction, or all sweeps."""
    steps = np.unique(np.concatenate([sweep.frequency for sweep in sweeps])) if sweeps else np.empty(0)
    if steps.size < _FEWEST_FREQUENCIES:
        return
    bands = [part[[0, -1]].tolist() for part in np.array_split(steps, min(steps.size, _MOST_FREQUENCIES))]
    for location, _, members in _scopes(sweeps):
        masks = [[(low <= sweep.frequency) & (sweep.frequency <= high) for sweep in members] for low, high in bands]
        columns = [_shift_columns(evidence, members, chosen) for chosen in masks]
        for width in range(1, _WIDEST + 1):
            for first in range(len(bands) - width + 1):
                window = slice(first, first + width)
                if not all(mask.any() for chosen in masks[window] for mask in chosen):
                    continue
                ends = dict.fromkeys((bands[first][0], bands[first + width - 1][-1]))
                name = f"{' to '.join(f'{end:.4g}' for end in ends)} Hz in {location}, at every amplitude"
                chosen = [np.any(of_sweep, axis=0) for of_sweep in zip(*masks[window], strict=True)]
                unit = np.kron(np.eye(width), np.array([[1.0], [1.0j]]))
                part = _common_fault(
                    evidence, "frequency", name, members, chosen, np.concatenate(columns[window]), unit
                )
                yield replace(part, may_be_physics=len({sweep.direction for sweep in members}) > 1)


def _scopes(sweeps: Sequence[MeasuredSweep]) -> Iterator[tuple[str, str, Sequence[MeasuredSweep]]]:
    """Generate the groups of sweeps that may have a common fault: each sweep, all of a direction, and all sweeps.

    Yields:
        Text on the location, such as a direction; text on the sweeps; and the sweeps.
    """

    def direction_of(sweep: MeasuredSweep) -> str:
        return str(sweep.direction)

    by_direction = [(name, list(group)) for name, group in groupby(sorted(sweeps, key=direction_of), direction_of)]
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
    evidence: Evidence,
    family: str,
    name: str,
    sweeps: Sequence[MeasuredSweep],
    chosen: Sequence[Array],
    columns: Array | None = None,
    unit: Array = _SLOPING,
) -> FaultyPart:
    """Explanation of a gap by errors that some sweep points share: of gain and phase, and of their slopes.

    Args:
        evidence: the fitted model and the tests.
        family: kind of the fault, such as "level" or "repeat".
        name: name of the fault for reports.
        sweeps: sweeps that have the fault.
        chosen: mask of the faulty points of each sweep, (n,) each.
        columns: change of the whitened residuals of `sweeps` per unit of each of c errors, (c, rows); None for gain,
            phase and their slopes.
        unit: complex relative change of the stiffness per unit of each error at p points of the part, (c, p).
    """
    columns = _shift_columns(evidence, sweeps, chosen, sloping=True) if columns is None else columns
    frequency, amplitude = (
        np.concatenate([getattr(sweep, axis)[mask] for sweep, mask in zip(sweeps, chosen, strict=True)])
        for axis in ("frequency", "amplitude")
    )
    ends = (float(frequency.min()), float(frequency.max())), (float(amplitude.min()), float(amplitude.max()))
    group = Group(columns, unit, act_together=True, covered_rows=(_row_span(evidence, sweeps), evidence.residual.size))
    return FaultyPart("part", family, name, group, sweeps[0].direction, *ends)


def _shift_columns(
    evidence: Evidence, sweeps: Sequence[MeasuredSweep], chosen: Sequence[Array], sloping: bool = False
) -> Array:
    """Change of the whitened residuals of sweeps due to a gain error of 100 % and a phase error of 1 rad.

    Args:
        evidence: the fitted model and the tests.
        sweeps: sweeps with the errors.
        chosen: mask of the points with the errors in each sweep, (n,) each.
        sloping: True to add the same errors times a slope along the log of the stepped quantity.

    Returns:
        Changes of the residuals of all rows from the first to the last of `sweeps`, (2, rows), or (4, rows) with
        slopes.
    """
    rows = _row_span(evidence, sweeps)
    columns = np.zeros((2 + 2 * sloping, rows.stop - rows.start))
    for sweep, mask in zip(sweeps, chosen, strict=True):
        log_step = np.log(sweep.step)
        slope = 2.0 * (log_step - log_step.mean()) / max(float(np.ptp(log_step)), 1e-9)
        shapes = [mask.astype(float), *([mask * slope] if sloping else [])]
        sweep_rows = evidence.residual_rows[sweep]
        columns[:, sweep_rows.start - rows.start : sweep_rows.stop - rows.start] = [
            column for shape in shapes for column in sweep.shared_error_columns(shape)
        ]
    return columns


def _row_span(evidence: Evidence, sweeps: Sequence[MeasuredSweep]) -> slice:
    """Slice of the residual vector from the first to the last row of the given sweeps."""
    slices = [evidence.residual_rows[sweep] for sweep in sweeps]
    return slice(min(rows.start for rows in slices), max(rows.stop for rows in slices))
