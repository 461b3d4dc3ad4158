"""Runs of a sweep: what is stepped in it and what is held, and the levels that amplitudes as reached belong to.

A run is what was recorded in one go: either the frequency is stepped and the amplitude held, or the reverse, or, where
a mass swings on a mount, neither is held. Rigs miss what they are asked for: 0.0987 mm and 0.1004 mm are one level.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.measurement import Floats, Stepped

#: Span of a level in ln X at most; chosen: rigs in order miss a level by less than 4 % either way.
_WIDEST_LEVEL = 0.08
#: Distance in ln X from a level to the next over the span of a level, at least; chosen: below, they may be one.
_LEAST_GAP = 3.0
#: Points of a run at least, on average, for something to count as held.
_FEWEST_POINTS = 2.0


class Runs(NamedTuple):
    """What is stepped in a sweep, and its points as they were meant.

    Args:
        stepped: what changes within a run; None where neither is held.
        amplitude: of the level of each point, (n,).
        repeat: number of the repeat of each point, (n,); of the run where neither is held.
    """

    stepped: Stepped | None
    amplitude: Floats
    repeat: NDArray[np.int64]


def runs_of(frequency: Floats, amplitude: Floats, repeat: NDArray[np.int64] | None) -> Runs:
    """The runs of a sweep, from its points in the order of the file.

    Args:
        frequency: [Hz], (n,).
        amplitude: as the file has it, nominal or as reached, (n,).
        repeat: number of the repeat as the file has it, (n,); None where it has none: then what occurs again at a
            frequency and level is a repeat.
    """
    levels = nominal(amplitude)
    of_frequency, of_level = (np.unique(values).size for values in (frequency, levels))
    counted = repeat if repeat is not None else _occurrence(frequency, levels)
    runs = np.unique(counted).size
    if max(frequency.size / of_frequency, frequency.size / of_level) < _FEWEST_POINTS * runs and frequency.size > runs:
        restarts = np.cumsum(np.append(False, np.diff(frequency) < 0.0)) + 1
        return Runs(None, amplitude, restarts if repeat is None else repeat)
    return Runs("amplitude" if of_level > of_frequency else "frequency", levels, counted)


def nominal(amplitude: Floats) -> Floats:
    """The level of each amplitude, (n,): the median of those that lie together and far from all others.

    Amplitudes that no gaps part into narrow levels of several points keep their own values.
    """
    distinct, place, count = np.unique(amplitude, return_inverse=True, return_counts=True)
    gaps = np.diff(np.log(distinct))
    for gap in np.unique(gaps[gaps <= _WIDEST_LEVEL])[::-1]:
        group = np.append(0, np.cumsum(gaps > gap))
        first, last = np.flatnonzero(np.diff(group, prepend=-1)), np.flatnonzero(np.diff(group, append=group[-1] + 1))
        span = float(np.log(distinct[last] / distinct[first]).max())
        between = float(np.min(gaps, where=gaps > gap, initial=np.inf))
        if span <= _WIDEST_LEVEL and between >= _LEAST_GAP * span and np.median(np.bincount(group)) > 1:
            middle = np.array([np.median(np.repeat(*of)) for of in _parts(distinct, count, first, last)])
            return middle[group][place]
    return amplitude


def _parts(
    values: Floats, count: NDArray[np.int64], first: NDArray[np.intp], last: NDArray[np.intp]
) -> list[tuple[Floats, NDArray[np.int64]]]:
    """Values and counts of each group, from its first to its last place."""
    return [(values[a : b + 1], count[a : b + 1]) for a, b in zip(first, last, strict=True)]


def _occurrence(*keys: Floats) -> NDArray[np.int64]:
    """How often the keys of each row have occurred up to it, from 1, (n,)."""
    import pandas as pd

    return np.asarray(pd.DataFrame(dict(enumerate(keys))).groupby([*range(len(keys))]).cumcount(), dtype=np.int64) + 1
