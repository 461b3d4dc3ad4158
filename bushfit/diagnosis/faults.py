"""Faults of the measurement: what one frequency, one level, one repeat or one row alone shows is no physics.

Each suspect place may deviate freely in gain and phase; what that takes off chi-square competes with the effects.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.diagnosis.calibrate import PATTERN_LEFT, gain, orthonormal
from bushfit.diagnosis.evidence import Evidence
from bushfit.effects.contract import Array
from bushfit.fitting.terms import LoopTerm, SweepTerm
from bushfit.sheets import display_units

#: A disturbance covers at most this many neighbouring frequencies.
_WIDEST = 3


@dataclass(frozen=True, eq=False)
class Place:
    """Points of the sweeps (or one loop) that a fault would touch.

    Args:
        words: where, for the user: which rows to measure again.
        kind: "frequency", "level", "repeat" or "loop".
        columns: whitened residuals that a unit deviation of each kind makes, (2 k, n).
        direction: of the first sweep touched.
        frequency: lowest and highest [Hz].
        amplitude: lowest and highest [m or rad].
    """

    words: str
    kind: str
    columns: Array
    direction: str
    frequency: tuple[float, float]
    amplitude: tuple[float, float]


@dataclass(frozen=True, eq=False)
class Fault:
    """A place, what letting it deviate would take off chi-square, its price in free parameters, and how far it
    departs, relative to |K| or to half a loop's force range."""

    place: Place
    directions: Array
    gain: float
    price: float
    size: float

    @property
    def worth(self) -> float:
        return self.gain - self.price


def places(evidence: Evidence) -> list[Place]:
    """Every single place of the campaign that could be at fault."""
    return [*_frequencies(evidence), *_levels(evidence), *_repeats(evidence), *_loops(evidence)]


def faults(evidence: Evidence, suspects: Sequence[Place]) -> list[Fault]:
    """Every suspect's gain, the worthiest first. The price is that of its parameters and of having looked there."""
    kinds = {place.kind: sum(other.kind == place.kind for other in suspects) for place in suspects}
    found = []
    for place in suspects:
        directions = orthonormal(evidence, place.columns, PATTERN_LEFT)
        price = len(directions) * evidence.penalty + 2.0 * np.log(kinds[place.kind])
        left = evidence.beside(place.columns)
        size = np.abs(np.linalg.lstsq(left.T, evidence.residual, rcond=None)[0]).max() if len(directions) else 0.0
        found.append(Fault(place, directions, gain(directions, evidence.residual), float(price), float(size)))
    return sorted(found, key=lambda fault: -fault.worth)


def _sweeps(evidence: Evidence) -> list[tuple[SweepTerm, slice]]:
    pairs = zip(evidence.terms, evidence.slices, strict=True)
    return [(term, place) for term, place in pairs if isinstance(term, SweepTerm)]


def _columns(evidence: Evidence, touched: Sequence[Sequence[tuple[SweepTerm, slice, Array]]]) -> Array:
    """A gain and a phase column for each set of points that deviates as one, whitened, (2 k, n)."""
    rows = []
    for together in touched:
        for unit in (1.0, 1.0j):
            row = np.zeros(evidence.residual.size)
            for term, place, chosen in together:
                row[place] = term.whiten(unit * chosen.astype(complex))
            rows.append(row)
    return np.array(rows)


def _frequencies(evidence: Evidence) -> Iterator[Place]:
    """A disturbance at one frequency or a few neighbours, in one direction or in all."""
    sweeps = _sweeps(evidence)
    steps = np.unique(np.concatenate([term.frequency for term, _ in sweeps])) if sweeps else np.empty(0)
    if steps.size < 5:
        return
    scopes = [[pair] for pair in sweeps] + ([sweeps] if len(sweeps) > 1 else [])
    for scope in scopes:
        for width in range(1, _WIDEST + 1):
            for first in range(steps.size - width + 1):
                window = steps[first : first + width]
                touched = [[(term, place, term.frequency == f) for term, place in scope] for f in window]
                if not all(chosen.any() for together in touched for _, _, chosen in together):
                    continue
                where = scope[0][0].direction if len(scope) == 1 else "all directions"
                words = f"{_span(window, 'Hz')} in {where}, at every amplitude"
                yield _place(words, "frequency", evidence, touched)


def _levels(evidence: Evidence) -> Iterator[Place]:
    """One amplitude of one sweep, wrong as a whole: its label, its gain."""
    for term, place in _sweeps(evidence):
        levels = np.unique(term.amplitude)
        if levels.size < 2:
            continue
        for level in levels:
            words = f"the {term.direction} level {_amplitude(term, level)}"
            yield _place(words, "level", evidence, [[(term, place, term.amplitude == level)]])


def _repeats(evidence: Evidence) -> Iterator[Place]:
    """One repeat of one level."""
    for term, place in _sweeps(evidence):
        repeat = term.sweep.repeat[term.order]
        for level in np.unique(term.amplitude):
            numbers = np.unique(repeat[term.amplitude == level])
            if numbers.size < 3:
                continue
            for number in numbers:
                chosen = (term.amplitude == level) & (repeat == number)
                words = f"repeat {number} of the {term.direction} level {_amplitude(term, level)}"
                yield _place(words, "repeat", evidence, [[(term, place, chosen)]])


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
        yield Place(f"the loop {term.loop.name}", "loop", columns, str(term.direction), *ends)


def _place(
    words: str, kind: str, evidence: Evidence, touched: Sequence[Sequence[tuple[SweepTerm, slice, Array]]]
) -> Place:
    parts = [part for together in touched for part in together]
    frequency = np.concatenate([term.frequency[chosen] for term, _, chosen in parts])
    amplitude = np.concatenate([term.amplitude[chosen] for term, _, chosen in parts])
    return Place(
        words,
        kind,
        _columns(evidence, touched),
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
