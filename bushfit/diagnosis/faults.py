"""Faults of the measurement: one frequency, level, repeat or loop that disagrees with all the others.

What a single place of the tests shows alone is no physics. Each suspect may deviate freely in gain and phase; what that
takes off chi-square competes with the effects.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.score_test import PATTERN_LEFT, ScoreTest
from bushfit.effects.contract import Array
from bushfit.fitting.data_set import SUSPECT_KINDS, Suspect
from bushfit.fitting.data_sets import SweepData, parted

#: Neighbouring frequencies that one disturbance covers at most: mains hum and its sidebands.
_WIDEST = 3
#: Frequencies that a campaign has at least before one of them can be a suspect.
_FEWEST_FREQUENCIES = 5
#: Suspects of one frequency at most; of more frequencies neighbours count as one, or time and memory grew with the
#: square of the points. Chosen: four times those of a sweep with many.
_MOST_FREQUENCIES = 100


@dataclass(frozen=True, eq=False)
class Fault:
    """A suspect, and what speaks against it.

    Args:
        columns: free deviations it was given.
        gain: what letting it deviate would take off chi-square.
        price: of those deviations, and of having looked in so many places.
        size: how far it departs, relative to |K| or to half a loop's force range.
    """

    suspect: Suspect
    columns: int
    gain: float
    price: float
    size: float

    @property
    def worth(self) -> float:
        return self.gain - self.price


class Faults(NamedTuple):
    """Every single place that could be at fault.

    Args:
        chance: gain that the best of them exceeds by chance, with the probability asked for.
        chance_of_known: the same were the errors of levels known, and not told by a few levels.
    """

    places: Sequence[Fault]
    chance: float
    chance_of_known: float


def faults(evidence: Evidence, level: float) -> Faults:
    """Every single place that could be at fault, and the gain that chance alone stays below with probability level."""
    suspects = [*_frequencies(evidence), *_of_each(evidence)]
    if not suspects:
        return Faults((), np.inf, np.inf)
    columns = {id(column): column for suspect in suspects for column in suspect.columns}
    index = {key: number for number, key in enumerate(columns)}
    groups = [np.array([index[id(column)] for column in suspect.columns]) for suspect in suspects]
    test = ScoreTest(evidence, np.array(list(columns.values())), groups, PATTERN_LEFT)
    looked = Counter(suspect.kind for suspect in suspects)
    places = np.array([looked[suspect.kind] for suspect in suspects])
    prices = (np.array(test.sizes) * evidence.penalty + 2.0 * np.log(places)).tolist()
    largest = [float(np.abs(amount).max()) for amount in test.amounts()]
    found = list(map(Fault, suspects, test.sizes, test.gains(), prices, largest))
    chance = test.largest_by_chance(level)
    few = any(freedoms.level for freedoms, *_ in evidence.rigs)
    return Faults(found, chance, test.largest_by_chance(level, known=True) if few else chance)


def _of_each(evidence: Evidence) -> list[Suspect]:
    """What each data set suspects of itself, by kind; a loop alone cannot be told from what is true."""
    loops, _ = parted(evidence.data_sets)
    suspects = [
        replace(suspect, columns=[evidence.embedded(column, data_set) for column in suspect.columns])
        for data_set in evidence.data_sets
        if [data_set] != loops
        for suspect in data_set.suspects()
    ]
    return sorted(suspects, key=lambda suspect: SUSPECT_KINDS.index(suspect.kind))


def _frequencies(evidence: Evidence) -> Iterator[Suspect]:
    """A disturbance at one frequency or a few neighbours, in one direction or in all."""
    _, sweeps = parted(evidence.data_sets)
    steps = np.unique(np.concatenate([sweep.frequency for sweep in sweeps])) if sweeps else np.empty(0)
    if steps.size < _FEWEST_FREQUENCIES:
        return
    bands = [part[[0, -1]] for part in np.array_split(steps, min(steps.size, _MOST_FREQUENCIES))]
    for scope in [[sweep] for sweep in sweeps] + ([sweeps] if len(sweeps) > 1 else []):
        touched = [[(low <= sweep.frequency) & (sweep.frequency <= high) for sweep in scope] for low, high in bands]
        columns = [_moved_together(evidence, scope, chosen) for chosen in touched]
        where = scope[0].direction if len(scope) == 1 else "all directions"
        for width in range(1, _WIDEST + 1):
            for first in range(len(bands) - width + 1):
                window = slice(first, first + width)
                if not all(rows.any() for chosen in touched[window] for rows in chosen):
                    continue
                pairs = [pair for chosen in touched[window] for pair in zip(scope, chosen, strict=True)]
                reached = np.concatenate([sweep.amplitude[rows] for sweep, rows in pairs])
                low, high = float(bands[first][0]), float(bands[first + width - 1][-1])
                span = " to ".join(f"{step:.4g}" for step in dict.fromkeys((low, high)))
                yield Suspect(
                    f"{span} Hz in {where}, at every amplitude",
                    "frequency",
                    [column for pair in columns[window] for column in pair],
                    scope[0].direction,
                    (low, high),
                    (float(reached.min()), float(reached.max())),
                )


def _moved_together(evidence: Evidence, sweeps: Sequence[SweepData], chosen: Sequence[Array]) -> list[Array]:
    """A gain and a phase column of points of several sweeps that deviate as one, (n,) each."""
    pairs = zip(sweeps, chosen, strict=True)
    each = [[evidence.embedded(column, sweep) for column in sweep.moved_together(rows)] for sweep, rows in pairs]
    return list(np.sum(each, axis=0))
