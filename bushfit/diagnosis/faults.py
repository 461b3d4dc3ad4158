"""Faults of the measurement: what one frequency, level, repeat, loop or row alone shows is no physics.

Each suspect place may deviate freely in gain and phase; what that takes off chi-square competes with the effects.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.diagnosis.calibrate import PATTERN_LEFT, Questions
from bushfit.diagnosis.evidence import Evidence
from bushfit.effects.contract import Array
from bushfit.fitting.terms import LoopTerm, SweepTerm
from bushfit.sheets import display_units

#: A disturbance covers at most this many neighbouring frequencies.
_WIDEST = 3
#: A single point is a suspect beyond this many standard deviations, and where many are, the farthest of each test.
_FAR, _FARTHEST = 4.0, 8


#: Points that deviate together: per sweep term its place among the residuals and the points touched.
Together = Sequence[tuple[SweepTerm, slice, Array]]


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
    direction: str
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
    questions = Questions(evidence, np.array(list(columns.values())), groups, PATTERN_LEFT)
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


def _sweeps(evidence: Evidence) -> list[tuple[SweepTerm, slice]]:
    pairs = zip(evidence.terms, evidence.slices, strict=True)
    return [(term, place) for term, place in pairs if isinstance(term, SweepTerm)]


def _columns(evidence: Evidence, together: Together) -> list[Array]:
    """A gain and a phase column of points that deviate as one, whitened."""
    columns = []
    for unit in (1.0, 1.0j):
        column = np.zeros(evidence.residual.size)
        for term, place, chosen in together:
            column[place] = term.whiten(unit * chosen.astype(complex))
        columns.append(column)
    return columns


def _frequencies(evidence: Evidence) -> Iterator[Place]:
    """A disturbance at one frequency or a few neighbours, in one direction or in all."""
    sweeps = _sweeps(evidence)
    steps = np.unique(np.concatenate([term.frequency for term, _ in sweeps])) if sweeps else np.empty(0)
    if steps.size < 5:
        return
    for scope in [[pair] for pair in sweeps] + ([sweeps] if len(sweeps) > 1 else []):
        touched = [[(term, place, term.frequency == f) for term, place in scope] for f in steps]
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
    for term, place in _sweeps(evidence):
        levels = np.unique(term.amplitude)
        if levels.size < 2:
            continue
        for level in levels:
            words = f"the {term.direction} level {_amplitude(term, level)}"
            together = [(term, place, term.amplitude == level)]
            yield _place(words, "level", _columns(evidence, together), together)


def _repeats(evidence: Evidence) -> Iterator[Place]:
    """One repeat of one level."""
    for term, place in _sweeps(evidence):
        repeat = term.sweep.repeat[term.order]
        for level in np.unique(term.amplitude):
            numbers = np.unique(repeat[term.amplitude == level])
            if numbers.size < 3:
                continue
            for number in numbers:
                together = [(term, place, (term.amplitude == level) & (repeat == number))]
                words = f"repeat {number} of the {term.direction} level {_amplitude(term, level)}"
                yield _place(words, "repeat", _columns(evidence, together), together)


def _rows(evidence: Evidence) -> Iterator[Place]:
    """Single points of a sweep that lie far out."""
    for term, place in _sweeps(evidence):
        residual = evidence.residual[place]
        count = term.frequency.size
        distance = np.maximum(np.abs(residual[:count]), np.abs(residual[count:]))
        farthest = np.argsort(-distance, kind="stable")[:_FARTHEST]
        for row in farthest[distance[farthest] > _FAR]:
            together = [(term, place, np.arange(count) == row)]
            words = (
                f"the point at {term.frequency[row]:.4g} Hz, {_amplitude(term, term.amplitude[row])}, "
                f"repeat {term.sweep.repeat[term.order][row]}, {term.direction}"
            )
            yield replace(_place(words, "row", _columns(evidence, together), together), looked=count)


def _loops(evidence: Evidence) -> Iterator[Place]:
    """One loop among several, wrong in gain or offset."""
    pairs = [
        (term, place) for term, place in zip(evidence.terms, evidence.slices, strict=True) if isinstance(term, LoopTerm)
    ]
    for term, place in pairs if len(pairs) > 1 else ():
        columns = np.zeros((2, evidence.residual.size))
        scale = np.sqrt(term.drive.weight) / term.drive.noise
        columns[0, place], columns[1, place] = term.drive.force * scale, term.drive.half_range * scale
        ends = (term.drive.frequency,) * 2, (term.drive.amplitude,) * 2
        yield Place(f"the loop {term.loop.name}", "loop", list(columns), str(term.direction), *ends)


def _place(words: str, kind: str, columns: Sequence[Array], parts: Together) -> Place:
    frequency = np.concatenate([term.frequency[chosen] for term, _, chosen in parts])
    amplitude = np.concatenate([term.amplitude[chosen] for term, _, chosen in parts])
    return Place(
        words,
        kind,
        columns,
        str(parts[0][0].direction),
        (float(frequency.min()), float(frequency.max())),
        (float(amplitude.min()), float(amplitude.max())),
    )


def _span(values: Array, unit: str) -> str:
    if values.size == 1:
        return f"{values[0]:.4g} {unit}"
    return f"{values[0]:.4g} to {values[-1]:.4g} {unit}"


def _amplitude(term: SweepTerm, level: float) -> str:
    unit, factor = display_units(term.direction)["length"]
    return f"{level * factor:.4g} {unit}"
