"""Runs of a sweep: the stepped quantity, and the levels of amplitudes.

In a run, either the frequency is stepped at a constant amplitude, or the amplitude at a constant frequency. If a mass
swings on a mount, neither is constant. Rigs do not reach amplitudes exactly: 0.0987 mm and 0.1004 mm are one level.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.measurement import Floats, Stepped

#: Largest range of ln amplitude within one level; chosen: a sound rig misses a level by less than 4 % either way.
_WIDEST_LEVEL = 0.08
#: Smallest ratio of the gap between two levels to the range within a level, both in ln amplitude; chosen: with a
#: smaller gap, the two may be one level.
_LEAST_GAP = 3.0
#: Largest range of ln amplitude in a run at nominally constant amplitude; chosen: a weak rig falls short by a third,
#: and the amplitude of a mass on a mount varies more.
_WIDEST_PASS = 0.4
#: Smallest share of rows with the frequency or level of the row before from which either is constant in a run.
_LEAST_CONSTANT = 0.1
#: Smallest such share from which the rows are in the order in which they were recorded.
_IN_ORDER = 0.4
#: Fewest distinct values of the stepped quantity if the order of rows decides; chosen: tables of three amplitudes are
#: often sorted.
_FEWEST_STEPS = 4
#: Smallest number of levels that are identified by their rank.
_FEWEST_LEVELS = 3


class Runs(NamedTuple):
    """Stepped quantity, nominal amplitudes and repeats of a sweep.

    Args:
        stepped: quantity that changes in a run; None if neither frequency nor amplitude is constant in a run.
        amplitude: nominal amplitude of each point, (n,), in the unit of the measured amplitudes.
        repeat: number of the repeat to which each point belongs, (n,).
    """

    stepped: Stepped | None
    amplitude: Floats
    repeat: NDArray[np.int64]


def runs_of(
    frequency: Floats, amplitude: Floats, repeat: NDArray[np.int64] | None, stepped: Stepped | None = None
) -> Runs:
    """Find the stepped quantity, the nominal amplitudes and the repeats of a sweep.

    Args:
        frequency: frequency [Hz] in the order of the file, (n,).
        amplitude: nominal or reached amplitude, zero-to-peak [m or rad, or strain], (n,).
        repeat: number of the repeat, (n,); None if the file does not state it, so that points at equal frequency and
            level are numbered as repeats.
        stepped: stepped quantity if the user states it; None to detect it.

    Returns:
        Stepped quantity, and the nominal amplitude and repeat number of each point.

    Notes:
        The quantity that changes less often from row to row is constant in a run. If the rows are not in the order of
        recording, or runs would have few points, as in a sorted table, the quantity with more values is stepped.
    """
    levels = nominal_amplitudes(amplitude)
    if (levels == amplitude).all() and repeat is None:
        levels = _levels_by_rank(amplitude, _group_numbers(frequency), fewest_points=2)
    if (levels == amplitude).all():
        falls = np.append(False, (np.diff(amplitude) < 0.0) | (np.diff(frequency) != 0.0))
        run = np.cumsum(falls) if repeat is None else _group_numbers(frequency, repeat)
        levels = _levels_by_rank(amplitude, run, fewest_points=1)
    repeats_frequency, repeats_level = (float(np.mean(np.diff(values) == 0.0)) for values in (frequency, levels))
    if max(repeats_frequency, repeats_level) < _LEAST_CONSTANT:
        steps = np.diff(frequency)
        turns = steps * np.median(steps) < 0.0
        if repeat is not None:
            turns |= np.diff(repeat) != 0
        passes = np.cumsum(np.append(False, turns))
        if _group_spans(np.log(amplitude), passes).max() >= _WIDEST_PASS:
            return Runs(None, amplitude, passes + 1 if repeat is None else repeat)
        levels = nominal_amplitudes(_group_medians(amplitude, passes))  # one level in each pass over the frequencies
        repeats_frequency, repeats_level = 0.0, 1.0
    frequency_count, level_count = (np.unique(values).size for values in (frequency, levels))
    if repeat is None:
        import pandas as pd

        points = pd.DataFrame({"frequency": frequency, "level": levels}).groupby(["frequency", "level"])
        repeat = np.asarray(points.cumcount(), dtype=np.int64) + 1
    if stepped is None:
        by_order: Stepped = "amplitude" if repeats_frequency > repeats_level else "frequency"
        by_count: Stepped = "amplitude" if level_count > frequency_count else "frequency"
        in_order = max(repeats_frequency, repeats_level) >= _IN_ORDER
        steps_in_order = level_count if by_order == "amplitude" else frequency_count
        stepped = by_order if in_order and steps_in_order >= _FEWEST_STEPS else by_count
    return Runs(stepped, levels, repeat)


def nominal_amplitudes(amplitude: Floats) -> Floats:
    """Replace each reached amplitude, (n,), by its nominal level: the median of a narrow group of amplitudes.

    Returns:
        Levels in the unit of the amplitudes, (n,); the amplitudes themselves if wide gaps do not separate them into
        narrow groups of several points.
    """
    distinct, index = np.unique(amplitude, return_inverse=True)
    logs = np.log(distinct)
    gaps = np.diff(logs)
    widths = np.unique(gaps)
    next_widths = np.append(widths[1:], np.inf)
    separates = (widths <= _WIDEST_LEVEL) & (next_widths >= _LEAST_GAP * widths)  # a level spans its widest gap or more
    for gap, next_gap in zip(widths[separates][::-1], next_widths[separates][::-1], strict=True):
        group = np.append(0, np.cumsum(gaps > gap))
        span = float(_group_spans(logs, group).max())
        if span <= _WIDEST_LEVEL and next_gap >= _LEAST_GAP * span and np.median(np.bincount(group)) > 1:
            return _group_medians(amplitude, group[index])
    return amplitude


def _levels_by_rank(amplitude: Floats, group: NDArray[np.intp], *, fewest_points: int) -> Floats:
    """Nominal amplitude of each point: the median over all groups of the levels of equal rank in their group.

    Args:
        amplitude: reached amplitude of each point, (n,).
        group: number of the group of each point, (n,): points at one frequency, or a run over the amplitudes.
        fewest_points: smallest number of points at a level of a group; with 1, each amplitude is a level.

    Returns:
        Nominal amplitudes, (n,). The reached amplitudes if there is one group, if groups differ in their number of
        levels or points per level, or if levels overlap.
    """
    rank, shapes, groups = np.empty(amplitude.size, dtype=np.intp), set(), group_rows(group)
    for rows in groups:
        levels = nominal_amplitudes(amplitude[rows]) if fewest_points > 1 else amplitude[rows]
        levels, rank[rows], counts = np.unique(levels, return_inverse=True, return_counts=True)
        shapes.add((levels.size, counts.min(), counts.max()))
    (level_count, fewest, most), *others = shapes
    if others or len(groups) < 2 or level_count < _FEWEST_LEVELS or not fewest_points <= fewest == most:
        return amplitude
    by_level = np.sort(amplitude[np.argsort(rank)].reshape(level_count, -1), axis=1)
    return _group_medians(amplitude, rank) if (by_level[:-1, -1] < by_level[1:, 0]).all() else amplitude


def group_rows(*keys: Floats | NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Row indices of each group of rows that agree in all keys, such as frequency and amplitude, (n,) each."""
    group = _group_numbers(*keys)
    return np.split(np.argsort(group, kind="stable"), np.cumsum(np.bincount(group))[:-1])


def _group_spans(values: Floats, group: NDArray[np.intp]) -> Floats:
    """Largest minus smallest value in each group, (groups,); `group` is the group number of each value, (n,)."""
    ordered, ends = values[np.lexsort((values, group))], np.cumsum(np.bincount(group))
    return ordered[ends - 1] - ordered[np.append(0, ends[:-1])]


def _group_medians(values: Floats, group: NDArray[np.intp]) -> Floats:
    """Replace each value by the median of its group, (n,); `group` is the group number of each value, (n,)."""
    import pandas as pd

    return np.asarray(pd.Series(values).groupby(group).transform("median"))


def _group_numbers(*keys: Floats | NDArray[np.intp]) -> NDArray[np.intp]:
    """Group number of each row, from 0, (n,); rows that agree in all keys, (n,) each, are one group."""
    return np.unique(np.stack(keys), axis=1, return_inverse=True)[1].ravel()
