"""Faulty parts of the tests: a frequency, a level, a repeat, or a loop that disagrees with all others."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations.contract import FaultyPlace
from bushfit.diagnosis.linear_model import Group
from bushfit.effects.contract import Array
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep, MeasuredTest, split_by_kind

#: Neighbouring frequencies that one disturbance covers at most: mains hum and its sidebands.
_WIDEST = 3
#: Frequencies that a campaign has at least before one of them can be a suspect.
_FEWEST_FREQUENCIES = 5
#: Suspects of one frequency at most; of more frequencies neighbours count as one. Chosen for time.
_MOST_FREQUENCIES = 100


def places(evidence: Evidence) -> list[FaultyPlace]:
    """List the places whose points may deviate together, in gain and phase; levels and repeats also with a slope.

    The columns do not depend on the model.
    """
    loops, sweeps = split_by_kind(evidence.data_sets)
    found = [*_frequencies(evidence, sweeps), *_levels(evidence, sweeps), *_repeats(evidence, sweeps)]
    return found + ([_loop(evidence, loop) for loop in loops] if len(loops) < len(evidence.data_sets) else [])


def _loop(evidence: Evidence, loop: MeasuredLoop) -> FaultyPlace:
    """A loop that is wrong as a whole, in gain or offset."""
    ends = (loop.drive.frequency,) * 2, (loop.drive.amplitude,) * 2
    group = _group(evidence, [loop], np.array(loop.gain_and_offset()), np.eye(2))
    return FaultyPlace("place", "loop", f"the loop {loop.name}", group, loop.direction, *ends)


def _rows(evidence: Evidence, data_sets: Sequence[MeasuredTest]) -> slice:
    """Slice from the first row of some data sets to their last."""
    places = [evidence.place[data_set] for data_set in data_sets]
    return slice(min(place.start for place in places), max(place.stop for place in places))


def _group(evidence: Evidence, data_sets: Sequence[MeasuredTest], columns: Array, unit: Array) -> Group:
    among = _rows(evidence, data_sets), evidence.residual.size
    return Group(columns, unit, together=True, among=among)


def _changed(columns: int, kind: str) -> Array:
    """Relative change of each point by a unit of gain, of phase and of their slopes, (columns, points)."""
    both = np.array([[1.0], [1.0j]])
    if kind == "frequency":
        return np.asarray(np.kron(np.eye(columns // 2), both))
    ends = np.array([[1.0, 1.0], [1.0, -1.0]])
    return np.asarray(np.kron(ends[: columns // 2], both))


def _place(
    evidence: Evidence, words: str, kind: str, sweeps: Sequence[MeasuredSweep], chosen: Sequence[Array], columns: Array
) -> FaultyPlace:
    """Chosen points of sweeps, (n,) bool each."""
    pairs = list(zip(sweeps, chosen, strict=True))
    frequency, amplitude = (
        np.concatenate([getattr(sweep, axis)[mine] for sweep, mine in pairs]) for axis in ("frequency", "amplitude")
    )
    ends = (float(frequency.min()), float(frequency.max())), (float(amplitude.min()), float(amplitude.max()))
    group = _group(evidence, sweeps, columns, _changed(len(columns), kind))
    return FaultyPlace("place", kind, words, group, sweeps[0].direction, *ends)


def _levels(evidence: Evidence, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPlace]:
    levels = Counter(_direction(sweep) for sweep in sweeps for _ in np.unique(sweep.held))
    ends = {
        name: [end for sweep in sweeps if _direction(sweep) == name for end in (sweep.held.min(), sweep.held.max())]
        for name in levels
    }
    for sweep in sweeps:
        for level in np.unique(sweep.held):
            mask = sweep.held == level
            words = sweep.line_words(int(np.argmax(mask)))
            if levels[_direction(sweep)] > 1:  # in this file or in others
                columns = _shift_columns(evidence, [sweep], [mask], sloping=True)
                place = _place(evidence, words, "level", [sweep], [mask], columns)
                extremes = min(ends[_direction(sweep)]), max(ends[_direction(sweep)])
                yield replace(place, extreme=levels[_direction(sweep)] > 2 and level in extremes)
            numbers = np.unique(sweep.repeat[mask])
            for number in numbers if numbers.size > 2 else ():
                mine = mask & (sweep.repeat == number)
                columns = _shift_columns(evidence, [sweep], [mine])
                yield _place(evidence, f"repeat {number} of {words}", "repeat", [sweep], [mine], columns)


def _repeats(evidence: Evidence, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPlace]:
    """A repeat as a whole, of one direction or of all."""
    for _, label, scope in _scopes(sweeps):
        if not all(np.unique(sweep.repeat).size > 1 for sweep in scope):
            continue
        for number in sorted({int(repeat) for sweep in scope for repeat in sweep.repeat}):
            chosen = [sweep.repeat == number for sweep in scope]
            if all(rows.any() for rows in chosen):
                columns = _shift_columns(evidence, scope, chosen, sloping=True)
                yield _place(evidence, f"repeat {number} of {label}", "repeat", scope, chosen, columns)


def _frequencies(evidence: Evidence, sweeps: Sequence[MeasuredSweep]) -> Iterator[FaultyPlace]:
    """A disturbance at one frequency or a few neighbours, in one direction or in all."""
    steps = np.unique(np.concatenate([sweep.frequency for sweep in sweeps])) if sweeps else np.empty(0)
    if steps.size < _FEWEST_FREQUENCIES:
        return
    bands = [part[[0, -1]] for part in np.array_split(steps, min(steps.size, _MOST_FREQUENCIES))]
    for location, _, scope in _scopes(sweeps):
        touched = [[(low <= sweep.frequency) & (sweep.frequency <= high) for sweep in scope] for low, high in bands]
        columns = [_shift_columns(evidence, scope, chosen) for chosen in touched]
        for width in range(1, _WIDEST + 1):
            for first in range(len(bands) - width + 1):
                window = slice(first, first + width)
                if not all(rows.any() for chosen in touched[window] for rows in chosen):
                    continue
                low, high = float(bands[first][0]), float(bands[first + width - 1][-1])
                span = " to ".join(f"{step:.4g}" for step in dict.fromkeys((low, high)))
                words = f"{span} Hz in {location}, at every amplitude"
                rows = [np.any([chosen[place] for chosen in touched[window]], axis=0) for place in range(len(scope))]
                yield _place(evidence, words, "frequency", scope, rows, np.concatenate(columns[window]))


def _scopes(sweeps: Sequence[MeasuredSweep]) -> Iterator[tuple[str, str, Sequence[MeasuredSweep]]]:
    """Groups of sweeps that may deviate together: one sweep, all sweeps of a direction, and all.

    Yields: the location and the sweeps in words, and the sweeps.
    """
    of_directions = [(name, list(group)) for name, group in groupby(sorted(sweeps, key=_direction), _direction)]
    for name, members in of_directions:
        several = len(members) > 1
        for sweep in members:
            words = f"the {name} sweep {sweep.name}"
            yield words if several else name, words, [sweep]
        if several:
            yield name, f"every {name} sweep", members
    if len(of_directions) > 1:
        yield "all directions", "every sweep", sweeps


def _direction(sweep: MeasuredSweep) -> str:
    return str(sweep.direction)


def _shift_columns(
    evidence: Evidence, sweeps: Sequence[MeasuredSweep], chosen: Sequence[Array], *, sloping: bool = False
) -> Array:
    """Residual columns of a common error of some points of sweeps: gain, phase, and if `sloping` their slopes."""
    among = _rows(evidence, sweeps)
    columns = np.zeros((2 + 2 * sloping, among.stop - among.start))
    for sweep, rows in zip(sweeps, chosen, strict=True):
        log_step = np.log(sweep.step)
        slope = 2.0 * (log_step - log_step.mean()) / max(float(np.ptp(log_step)), 1e-9)
        values = [rows.astype(float), *([rows * slope] if sloping else [])]
        row_slice = evidence.place[sweep]
        columns[:, row_slice.start - among.start : row_slice.stop - among.start] = [
            column for value in values for column in sweep.moved_together(value)
        ]
    return columns
