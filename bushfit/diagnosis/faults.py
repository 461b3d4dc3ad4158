"""Faults of the measurement: what one frequency, level, repeat, loop or row alone shows is no physics.

Each suspect place may deviate freely in gain and phase; what that takes off chi-square competes with the effects.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.score_test import PATTERN_LEFT, ScoreTest
from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import LoopData, SweepData
from bushfit.geometry import Direction

#: A disturbance covers at most this many neighbouring frequencies.
_WIDEST = 3
#: A single point is a suspect beyond this many standard deviations, and where many are, the farthest of each test.
_FAR, _FARTHEST = 4.0, 8


#: Points that deviate together: per sweep data set its place among the residuals and the points touched.
Together = Sequence[tuple[SweepData, slice, Array]]


@dataclass(frozen=True, eq=False)
class Place:
    """Points of the sweeps (or one loop) that a fault would touch.

    Args:
        words: where, for the user: which rows to measure again.
        kind: "frequency", "level", "repeat", "row" or "loop".
        columns: whitened residuals that a unit deviation of each kind makes, (2 k, n).
        direction: of the first test touched.
        frequency: lowest and highest [Hz].
        amplitude: lowest and highest [m or rad].
        looked: how many places of this kind were looked at, where more than are listed.
    """

    words: str
    kind: str
    columns: Sequence[Array]
    direction: Direction
    frequency: tuple[float, float]
    amplitude: tuple[float, float]
    looked: int = 0


@dataclass(frozen=True, eq=False)
class Fault:
    """A place that may be at fault.

    Args:
        place: where.
        columns: free deviations it was given.
        gain: what letting it deviate would take off chi-square.
        price: of those deviations, and of having looked in so many places.
        size: how far it departs, relative to |K| or to half a loop's force range.
    """

    place: Place
    columns: int
    gain: float
    price: float
    size: float

    @property
    def worth(self) -> float:
        return self.gain - self.price


def faults(evidence: Evidence, level: float) -> tuple[list[Fault], float]:
    """Every single place that could be at fault, and the gain that the best of them exceeds by chance with
    probability 1 - level."""
    kinds = (_frequencies, _levels, _repeats, _rows, _loops)
    suspects = [place for kind in kinds for place in kind(evidence)]
    if not suspects:
        return [], np.inf
    columns = {id(column): column for place in suspects for column in place.columns}
    index = {key: number for number, key in enumerate(columns)}
    groups = [np.array([index[id(column)] for column in place.columns]) for place in suspects]
    questions = ScoreTest(evidence, np.array(list(columns.values())), groups, PATTERN_LEFT)
    looked = Counter(place.kind for place in suspects)
    found = [
        Fault(
            place,
            size,
            gain,
            size * evidence.penalty + 2.0 * float(np.log(max(place.looked, looked[place.kind]))),
            float(np.abs(answer).max()),
        )
        for place, size, gain, answer in zip(
            suspects, questions.sizes, questions.gains(), questions.answers(), strict=True
        )
    ]
    return found, questions.largest_by_chance(level)


def _sweeps(evidence: Evidence) -> list[tuple[SweepData, slice]]:
    pairs = zip(evidence.data_sets, evidence.slices, strict=True)
    return [(data_set, place) for data_set, place in pairs if isinstance(data_set, SweepData)]


def _columns(evidence: Evidence, together: Together) -> list[Array]:
    """A gain and a phase column of points that deviate as one, whitened."""
    columns = []
    for unit in (1.0, 1.0j):
        column = np.zeros(evidence.residual.size)
        for data_set, place, chosen in together:
            column[place] = data_set.whiten(unit * chosen.astype(complex))
        columns.append(column)
    return columns


def _frequencies(evidence: Evidence) -> Iterator[Place]:
    """A disturbance at one frequency or a few neighbours, in one direction or in all."""
    sweeps = _sweeps(evidence)
    steps = np.unique(np.concatenate([data_set.frequency for data_set, _ in sweeps])) if sweeps else np.empty(0)
    if steps.size < 5:
        return
    for scope in [[pair] for pair in sweeps] + ([sweeps] if len(sweeps) > 1 else []):
        touched = [[(data_set, place, data_set.frequency == f) for data_set, place in scope] for f in steps]
        columns = [_columns(evidence, together) for together in touched]
        where = scope[0][0].direction if len(scope) == 1 else "all directions"
        for width in range(1, _WIDEST + 1):
            for first in range(steps.size - width + 1):
                window = slice(first, first + width)
                if all(chosen.any() for together in touched[window] for _, _, chosen in together):
                    words = f"{_span(steps[window], 'Hz')} in {where}, at every amplitude"
                    parts = [part for together in touched[window] for part in together]
                    yield _place(words, "frequency", [c for pair in columns[window] for c in pair], parts)


def _levels(evidence: Evidence) -> Iterator[Place]:
    """One amplitude of one sweep, wrong as a whole: its label, its gain."""
    for data_set, place in _sweeps(evidence):
        levels = np.unique(data_set.amplitude)
        if levels.size < 2:
            continue
        for level in levels:
            words = f"the {data_set.direction} level {_amplitude(data_set, level)}"
            together = [(data_set, place, data_set.amplitude == level)]
            yield _place(words, "level", _columns(evidence, together), together)


def _repeats(evidence: Evidence) -> Iterator[Place]:
    """One repeat of one level."""
    for data_set, place in _sweeps(evidence):
        repeat = data_set.sweep.repeat[data_set.order]
        for level in np.unique(data_set.amplitude):
            numbers = np.unique(repeat[data_set.amplitude == level])
            if numbers.size < 3:
                continue
            for number in numbers:
                together = [(data_set, place, (data_set.amplitude == level) & (repeat == number))]
                words = f"repeat {number} of the {data_set.direction} level {_amplitude(data_set, level)}"
                yield _place(words, "repeat", _columns(evidence, together), together)


def _rows(evidence: Evidence) -> Iterator[Place]:
    """Single points of a sweep that lie far out."""
    for data_set, place in _sweeps(evidence):
        residual = evidence.residual[place]
        count = data_set.frequency.size
        distance = np.maximum(np.abs(residual[:count]), np.abs(residual[count:]))
        farthest = np.argsort(-distance, kind="stable")[:_FARTHEST]
        for row in farthest[distance[farthest] > _FAR]:
            together = [(data_set, place, np.arange(count) == row)]
            words = (
                f"the point at {data_set.frequency[row]:.4g} Hz, {_amplitude(data_set, data_set.amplitude[row])}, "
                f"repeat {data_set.sweep.repeat[data_set.order][row]}, {data_set.direction}"
            )
            yield replace(_place(words, "row", _columns(evidence, together), together), looked=count)


def _loops(evidence: Evidence) -> Iterator[Place]:
    """One loop among several, wrong in gain or offset."""
    pairs = [
        (data_set, place)
        for data_set, place in zip(evidence.data_sets, evidence.slices, strict=True)
        if isinstance(data_set, LoopData)
    ]
    for data_set, place in pairs if len(pairs) > 1 else ():
        columns = np.zeros((2, evidence.residual.size))
        scale = np.sqrt(data_set.drive.weight) / data_set.drive.noise
        columns[0, place], columns[1, place] = data_set.drive.force * scale, data_set.drive.half_range * scale
        ends = (data_set.drive.frequency,) * 2, (data_set.drive.amplitude,) * 2
        yield Place(f"the loop {data_set.loop.name}", "loop", list(columns), data_set.direction, *ends)


def _place(words: str, kind: str, columns: Sequence[Array], parts: Together) -> Place:
    frequency = np.concatenate([data_set.frequency[chosen] for data_set, _, chosen in parts])
    amplitude = np.concatenate([data_set.amplitude[chosen] for data_set, _, chosen in parts])
    return Place(
        words,
        kind,
        columns,
        parts[0][0].direction,
        (float(frequency.min()), float(frequency.max())),
        (float(amplitude.min()), float(amplitude.max())),
    )


def _span(values: Array, unit: str) -> str:
    if values.size == 1:
        return f"{values[0]:.4g} {unit}"
    return f"{values[0]:.4g} to {values[-1]:.4g} {unit}"


def _amplitude(data_set: SweepData, level: float) -> str:
    unit, factor = data_set.direction.display.displacement
    return f"{level * factor:.4g} {unit}"
