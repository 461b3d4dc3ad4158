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
#: Span of the amplitudes of a pass over the frequencies in ln X, up to which it counts as held; chosen: a weak rig
#: falls short by a third, and a mass on a mount moves through more.
_WIDEST_PASS = 0.4
#: Share of the rows, at least, with the frequency or the level of the row before, where one of them is held.
_LEAST_HELD = 0.1
#: The same share from which on the rows stand in the order in which they were recorded.
_IN_ORDER = 0.4
#: Fewest values of what the order of rows tells to be stepped; chosen: tables of three amplitudes are often sorted.
_FEWEST_STEPS = 4
#: Points of a run at least for its levels to be told by their place in it.
_FEWEST_POINTS = 3


class Runs(NamedTuple):
    """What is stepped in a sweep, None where neither is held, and level and number of repeat (or run) of its points."""

    stepped: Stepped | None
    amplitude: Floats
    repeat: NDArray[np.int64]


def runs_of(
    frequency: Floats, amplitude: Floats, repeat: NDArray[np.int64] | None, stepped: Stepped | None = None
) -> Runs:
    """The runs of a sweep, from its points in the order of the file: what its rows keep from one to the next is held.

    Where rows stand in no order, or runs would be of a few points alone, as in a table that was sorted, the count
    tells: what takes more values is stepped.

    Args:
        frequency: [Hz], (n,).
        amplitude: as the file has it, nominal or as reached, (n,).
        repeat: number of the repeat as the file has it, (n,); None where it has none: then what occurs again at a
            frequency and level is a repeat.
        stepped: what is stepped, where it is stated.
    """
    levels = nominal(amplitude)
    if (levels == amplitude).all() and repeat is None:
        levels = _by_frequency(frequency, amplitude)
    if (levels == amplitude).all():
        levels = _by_rank(frequency, amplitude, repeat)
    kept_frequency, kept_level = (float(np.mean(np.diff(values) == 0.0)) for values in (frequency, levels))
    if max(kept_frequency, kept_level) < _LEAST_HELD:
        steps = np.diff(frequency)
        turns = steps * np.median(steps) < 0.0
        if repeat is not None:
            turns |= np.diff(repeat) != 0
        passes = np.cumsum(np.append(False, turns))
        if _group_spans(np.log(amplitude), passes).max() >= _WIDEST_PASS:
            return Runs(None, amplitude, passes + 1 if repeat is None else repeat)
        levels = nominal(_group_medians(amplitude, passes))  # every pass over the frequencies nearly keeps to one
        kept_frequency, kept_level = 0.0, 1.0
    of_frequency, of_level = (np.unique(values).size for values in (frequency, levels))
    if repeat is None:
        import pandas as pd

        points = pd.DataFrame({"frequency": frequency, "level": levels}).groupby(["frequency", "level"])
        repeat = np.asarray(points.cumcount(), dtype=np.int64) + 1
    if stepped is None:
        by_order: Stepped = "amplitude" if kept_frequency > kept_level else "frequency"
        in_order = max(kept_frequency, kept_level) >= _IN_ORDER
        order_tells = in_order and (of_level if by_order == "amplitude" else of_frequency) >= _FEWEST_STEPS
        stepped = by_order if order_tells else "amplitude" if of_level > of_frequency else "frequency"
    return Runs(stepped, levels, repeat)


def nominal(amplitude: Floats) -> Floats:
    """The level of each amplitude, (n,): the median of those that lie together and far from all others.

    Amplitudes that no gaps part into narrow levels of several points keep their own values.
    """
    distinct, place = np.unique(amplitude, return_inverse=True)
    logs = np.log(distinct)
    gaps = np.diff(logs)
    within = np.unique(gaps)
    between = np.append(within[1:], np.inf)
    parting = (within <= _WIDEST_LEVEL) & (between >= _LEAST_GAP * within)  # a level spans its widest gap or more
    for gap, next_gap in zip(within[parting][::-1], between[parting][::-1], strict=True):
        group = np.append(0, np.cumsum(gaps > gap))
        span = float(_group_spans(logs, group).max())
        if span <= _WIDEST_LEVEL and next_gap >= _LEAST_GAP * span and np.median(np.bincount(group)) > 1:
            return _group_medians(amplitude, group[place])
    return amplitude


def _by_frequency(frequency: Floats, amplitude: Floats) -> Floats:
    """The level of each amplitude, (n,), where every frequency has as many levels, each of as many points.

    Their order in the file does not count. Amplitudes keep their own values where a level reaches into the next.
    """
    rank = np.empty(amplitude.size, dtype=np.intp)
    shapes = set()
    for rows in rows_alike(frequency):
        levels, rank[rows], counts = np.unique(nominal(amplitude[rows]), return_inverse=True, return_counts=True)
        shapes.add((levels.size, counts.min(), counts.max()))
        if len(shapes) > 1 or counts.min() != counts.max() or counts.max() < 2 or levels.size < _FEWEST_POINTS:
            return amplitude
    return _medians_if_separate(amplitude, rank)


def _by_rank(frequency: Floats, amplitude: Floats, repeat: NDArray[np.int64] | None) -> Floats:
    """The level of each amplitude by its place in its run, (n,), where all runs at all frequencies have as many.

    Amplitudes keep their own values where there is one run alone, or where a level reaches into the next.
    """
    falls = np.append(False, (np.diff(amplitude) < 0.0) | (np.diff(frequency) != 0.0))
    run = np.cumsum(falls) if repeat is None else _group_numbers(frequency, repeat)
    counts = np.bincount(run)
    if counts.size < 2 or np.ptp(counts[counts > 0]) > 0 or counts.max() < _FEWEST_POINTS:
        return amplitude
    order = np.lexsort((amplitude, run))
    rank = np.empty(order.size, dtype=np.intp)
    rank[order] = np.tile(np.arange(counts.max()), order.size // counts.max())
    return _medians_if_separate(amplitude, rank)


def _medians_if_separate(amplitude: Floats, rank: NDArray[np.intp]) -> Floats:
    """The median of the points of each rank, (n,), all of as many; no change where one reaches into the next."""
    levels = np.sort(amplitude[np.argsort(rank)].reshape(rank.max() + 1, -1), axis=1)
    return _group_medians(amplitude, rank) if (levels[:-1, -1] < levels[1:, 0]).all() else amplitude


def rows_alike(*keys: Floats) -> list[NDArray[np.intp]]:
    """The rows of each group that shares all keys, in order; each key (n,)."""
    group = _group_numbers(*keys)
    return np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group))[:-1])


def _group_spans(values: Floats, group: NDArray[np.intp]) -> Floats:
    """From the least to the largest value of each group, (groups,)."""
    ordered, ends = values[np.lexsort((values, group))], np.cumsum(np.bincount(group))
    return ordered[ends - 1] - ordered[np.append(0, ends[:-1])]


def _group_medians(values: Floats, group: NDArray[np.intp]) -> Floats:
    """The median of the group of each value, (n,)."""
    ordered, counts = values[np.lexsort((values, group))], np.bincount(group)
    starts = np.cumsum(counts) - counts
    medians = (ordered[starts + (counts - 1) // 2] + ordered[starts + counts // 2]) / 2.0
    return medians[group]


def _group_numbers(*keys: Floats | NDArray[np.int64]) -> NDArray[np.intp]:
    """A number from 0 for each combination of keys, (n,)."""
    return np.unique(np.stack(keys), axis=1, return_inverse=True)[1].ravel()
