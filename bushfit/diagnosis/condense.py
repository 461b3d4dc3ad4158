"""Means over narrow bands of long sweeps, and a selection of very many levels or loops, to limit computing time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.effects.contract import Array, RubberConditions
from bushfit.fitting.noise import LineKey, SweepNoise, sweep_noise
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep, repeats_of, with_gain_errors
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.reading.measurement import Sweep

#: Number of points above which a run is long; chosen for time: stepped sines have tens, a swept sine thousands.
_LONG = 400
#: Bands of a long run; chosen: a smooth stiffness changes by less than noise within one.
_BANDS = 100
#: Maximum number of lines (mostly amplitude levels) of a sweep that are used; chosen for time: each is a suspect.
_MOST_LINES = 40
#: Maximum number of rows of all loops together; chosen for memory: hundreds of shapes of effects change each.
_MOST_ROWS = 50_000


class _Means(NamedTuple):
    """Sweep with fewer points that is diagnosed in place of a long one, and a sentence on its reduction.

    Args:
        sweep: means over narrow bands, or the selected points.
        conditions: temperature and earlier strains at these points, which include those of rows that are left out.
        shares: variance of the noise of a mean relative to that of one row, averaged over each line reduced to means.
        words: sentence on how the sweep was reduced.
    """

    sweep: Sweep
    conditions: RubberConditions
    shares: Mapping[LineKey, float]
    words: str


def condensed(data: PreparedCampaign) -> tuple[PreparedCampaign, tuple[str, ...]]:
    """Reduce long sweeps and many loops of a campaign to fewer points, so that a diagnosis takes less time.

    Long runs of sweeps become means over narrow bands. If a sweep has very many lines, or the loops very many rows, a
    selection is diagnosed. Rows without weight are left out. The point-to-point noise of a line that is reduced to
    means is estimated again; errors that runs share are unchanged.

    Args:
        data: the campaign.

    Returns:
        The reduced campaign, and one sentence for each sweep that is changed and one for the loops.
    """
    rig, loops, messages = data.campaign.rig, _select_loops(data.loops), tuple[str, ...]()
    if len(loops) < len(data.loops):
        data, total = replace(data, loops=tuple(with_gain_errors(loops, rig))), len(data.loops)
        messages = (
            f"{len(loops)} of the {total} loops are used in the diagnosis: together they have more than "
            f"{_MOST_ROWS} rows",
        )
    means_by_sweep = {data_set: means for data_set in data.sweeps if (means := _condensed_sweep(data_set))}
    if not means_by_sweep:
        return data, messages
    noises = {
        id(noise): _noise(noise, [means for data_set, means in means_by_sweep.items() if data_set.noise is noise], rig)
        for noise in (data_set.noise for data_set in data.sweeps)
    }
    sweeps = []
    for data_set in data.sweeps:
        noise, means = noises[id(data_set.noise)], means_by_sweep.get(data_set)
        if means:
            weight = np.full(means.sweep.frequency.size, data_set.sweep.weight)
            sweeps.append(
                replace(data_set, sweep=means.sweep, noise=noise, weight=weight, test_conditions=means.conditions)
            )
        else:
            sweeps.append(replace(data_set, noise=noise))
    messages += tuple(f"{means.sweep.name}: {means.words}" for means in means_by_sweep.values())
    return replace(data, sweeps=tuple(sweeps)), messages


def _select_loops(loops: Sequence[MeasuredLoop]) -> Sequence[MeasuredLoop]:
    """Select loops with at most `_MOST_ROWS` rows in total, and at least one loop of each direction.

    Different loops are selected before repeats. If they are too many, the selection is evenly spread over direction,
    amplitude and frequency.
    """
    sizes = np.array([loop.size for loop in loops])
    if sizes.sum() <= _MOST_ROWS:
        return loops
    keys = [(str(loop.direction), loop.prepared.amplitude, loop.prepared.frequency) for loop in loops]
    times_before = np.tril(repeats_of(loops), -1).sum(axis=1)
    once = sorted(np.flatnonzero(times_before == 0).tolist(), key=keys.__getitem__)
    again = [n for n in np.argsort(times_before, kind="stable").tolist() if times_before[n]]
    of_each = {next(n for n in once if keys[n][0] == direction) for direction, *_ in keys}

    def fit(chosen: set[int]) -> bool:
        return bool(sizes[list(chosen)].sum() <= _MOST_ROWS)

    steps = (np.linspace(0, len(once) - 1, count).round().astype(int) for count in range(len(once), 0, -1))
    chosen = next(filter(fit, (of_each | {once[n] for n in step} for step in steps)), of_each)
    for n in again if len(chosen) == len(once) else ():
        if fit(chosen | {n}):
            chosen = chosen | {n}
    return [loops[n] for n in sorted(chosen)]


def _noise(before: SweepNoise, condensations: Sequence[_Means], rig: RigSettings) -> SweepNoise:
    """Noise of the sweeps of a rig after some were reduced to means; a stated noise falls with the rows per mean.

    Args:
        before: noise of the sweeps as measured.
        condensations: sweeps that were reduced.
        rig: stated accuracy class of the rig (gain and phase errors).
    """
    if not condensations:
        return before
    anew, random = sweep_noise([means.sweep for means in condensations], rig), dict(before.random)
    slopes = {
        name: slope
        for name, slope in before.slopes.items()
        if name not in {means.sweep.name for means in condensations}
    }
    for means in condensations:
        for key, share in means.shares.items():
            gain, phase = np.sqrt(share) * np.array(before.random[key])
            random[key] = anew.random[key] if means.sweep.noise is None else (float(gain), float(phase))
    freedom = min(before.scatter_freedom, anew.scatter_freedom)
    return replace(before, random=random, slopes={**slopes, **anew.slopes}, scatter_freedom=freedom)


def _condensed_sweep(data_set: MeasuredSweep) -> _Means | None:
    """Average neighbouring points of a sweep with long runs, and select some of very many held values.

    None if the whole sweep is diagnosed.
    """
    sweep, rows, words = data_set.sweep, data_set.order[data_set.weights > 0.0], ""
    lines = np.unique(sweep.held_value[rows])
    if lines.size > _MOST_LINES:
        some = lines[np.linspace(0, lines.size - 1, _MOST_LINES).round().astype(int)]
        rows = rows[np.isin(sweep.held_value[rows], some)]
        words = (
            f"{some.size} of its {lines.size} runs at one level, or frequency, are used in the diagnosis, evenly spread"
        )
    levels, repeat = sweep.held_value[rows], sweep.repeat[rows]
    step = sweep.step[rows] if sweep.stepped else rows  # where neither is held, in the turn they were measured
    band, long = np.arange(rows.size), list[float]()  # each of its own
    for line in np.unique(levels).tolist():
        mine = levels == line
        if np.unique(repeat[mine], return_counts=True)[1].max() > _LONG:
            edges = np.quantile(step[mine], np.linspace(0.0, 1.0, _BANDS + 1)[1:-1])
            band[mine] = -1 - np.searchsorted(edges, step[mine])
            long.append(line)
    if not long and not words:
        return None
    groups = _Groups.from_keys(rows, np.stack((levels, repeat.astype(float), band.astype(float))))
    means = groups.sweep(sweep)
    if means.frequency.size < rows.size:
        counted = f"{rows.size} points are averaged to {means.frequency.size} narrow bands for the diagnosis"
        words = "; ".join(filter(None, (words, counted)))
    shares = {(sweep.name, line): float(np.mean(1.0 / groups.counts[means.held_value == line])) for line in long}
    conditions = RubberConditions(*map(groups.mean, vars(data_set.test_conditions).values()))
    return _Means(means, conditions, shares, words)


@dataclass(frozen=True, eq=False)
class _Groups:
    """Groups of sweep rows that are averaged together; groups are in the order of measurement.

    Args:
        rows: indices of the n grouped rows in the sweep, (n,).
        group: index of the group that each of these rows belongs to, (n,).
        first: index in the sweep of the first row of each group, (g,).
        counts: number of rows in each group, (g,).
    """

    rows: Array
    group: Array
    first: Array
    counts: Array

    @classmethod
    def from_keys(cls, rows: Array, keys: Array) -> "_Groups":
        """Build the groups of sweep rows, (n,), whose columns of `keys`, (k, n), are equal."""
        _, first, group, counts = np.unique(keys, axis=1, return_index=True, return_inverse=True, return_counts=True)
        turn = np.argsort(np.bincount(group, rows) / counts, kind="stable")
        return cls(rows, np.argsort(turn)[group], rows[first[turn]], counts[turn])

    def mean(self, values: Any) -> Any:
        """Mean of values by sweep row over each group, (g,); a value that is no array is returned unchanged."""
        return self._mean(values) if isinstance(values, np.ndarray) else values

    def _mean(self, values: Array) -> Array:
        return np.bincount(self.group, values[self.rows]) / self.counts

    def _geometric_mean(self, values: Array) -> Array:
        """Geometric mean of values by sweep row over each group, (g,); the value itself for groups of one row."""
        return np.where(self.counts > 1, np.exp(self._mean(np.log(values))), values[self.first])

    def sweep(self, sweep: Sweep) -> Sweep:
        """Sweep with one mean point per group; the stepped axis and |K| are averaged geometrically."""
        phase, error = np.angle(sweep.stiffness), sweep.relative_error
        return replace(
            sweep,
            frequency=sweep.frequency[self.first]
            if sweep.stepped == "amplitude"
            else self._geometric_mean(sweep.frequency),
            amplitude=sweep.amplitude[self.first]
            if sweep.stepped == "frequency"
            else self._geometric_mean(sweep.amplitude),
            stiffness=self._geometric_mean(np.abs(sweep.stiffness)) * np.exp(1j * self._mean(phase)),
            repeat=sweep.repeat[self.first],
            reached=None if sweep.reached is None else self._geometric_mean(sweep.reached),
            relative_error=None if error is None else np.sqrt(self._mean(np.square(error)) / self.counts),
            temperature=self.mean(sweep.temperature),
        )
