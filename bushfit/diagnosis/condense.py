"""Shorten tests for a diagnosis: average long sweeps over narrow bands, and select some of very many levels or loops.

A level is the set of all points of a sweep at one constant amplitude, or at one constant frequency.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.caveat import Caveat
from bushfit.effects.contract import Array, RubberConditions
from bushfit.fitting.noise import LevelKey, SweepNoise, sweep_noise
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep, repeats_of, with_gain_errors
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.gaussian_process import spread_nodes
from bushfit.reading.measurement import Sweep

#: Number of points above which a run is long; chosen for time: stepped sines have tens, a swept sine thousands.
_LONG = 400
#: Bands of a long run; chosen: a smooth stiffness changes by less than noise within one.
_BANDS = 100
#: Maximum number of levels of a sweep that are used; chosen for time: each may be at fault.
_MOST_LEVELS = 40
#: Maximum number of rows of all loops together; chosen for memory: hundreds of shapes of effects change each.
_MOST_ROWS = 50_000


class _ShortSweep(NamedTuple):
    """Sweep with fewer points that is diagnosed in place of a long one.

    Args:
        sweep: means over narrow bands, or the selected points.
        conditions: temperature and largest earlier strains at these points; points that are left out count as earlier.
        noise_ratios: variance of the noise of a mean relative to that of a single point, for each averaged level
            (constant amplitude or frequency).
        sentence: sentence on the reduction, for the user.
    """

    sweep: Sweep
    conditions: RubberConditions
    noise_ratios: Mapping[LevelKey, float]
    sentence: str


def shorten_tests(data: PreparedCampaign) -> tuple[PreparedCampaign, tuple[Caveat, ...]]:
    """Reduce long sweeps and many loops of a campaign to fewer points, so that a diagnosis takes less time.

    Long runs of sweeps become means over narrow bands. If a sweep has very many levels, or the loops very many rows, a
    selection is diagnosed. Points without weight are left out. The point-to-point noise of averaged levels is estimated
    again; errors that runs share are unchanged.

    Args:
        data: the campaign.

    Returns:
        The reduced campaign, and a warning on the loops and on each sweep that is changed.
    """
    rig, loops, messages = data.campaign.rig, _select_loops(data.loops), tuple[Caveat, ...]()
    if len(loops) < len(data.loops):
        data, total = replace(data, loops=tuple(with_gain_errors(loops, rig))), len(data.loops)
        sentence = f"the diagnosis uses {len(loops)} of the {total} loops"
        reason = f"because all loops together have more than {_MOST_ROWS} rows"
        messages = (Caveat("fewer_loops", f"{sentence}, {reason}"),)
    shortened = {data_set: short for data_set in data.sweeps if (short := _shorten_sweep(data_set))}
    if not shortened:
        return data, messages
    noises = {
        id(noise): _new_noise(noise, [short for data_set, short in shortened.items() if data_set.noise is noise], rig)
        for noise in (data_set.noise for data_set in data.sweeps)
    }
    sweeps = []
    for data_set in data.sweeps:
        new, short = replace(data_set, noise=noises[id(data_set.noise)]), shortened.get(data_set)
        if short:
            weight = np.full(short.sweep.frequency.size, data_set.test.weight)
            new = replace(new, test=short.sweep, weights=weight, test_conditions=short.conditions)
        sweeps.append(new)
    messages += tuple(Caveat("fewer_points", short.sentence).about(short.sweep.name) for short in shortened.values())
    return replace(data, sweeps=tuple(sweeps)), messages


def _select_loops(loops: Sequence[MeasuredLoop]) -> Sequence[MeasuredLoop]:
    """Select loops up to a total number of rows, but at least one loop of each direction.

    Loops that differ most in direction, amplitude and frequency are selected first, repeats of a loop last.
    """
    sizes, directions = np.array([loop.size for loop in loops]), [str(loop.direction) for loop in loops]
    if sizes.sum() <= _MOST_ROWS:
        return loops
    times_before = np.tril(repeats_of(loops), -1).sum(axis=1)
    distinct = np.flatnonzero(times_before == 0)
    points = np.log([(*loop.frequency, *loop.amplitude) for loop in loops])
    direction_axis = 1e3 * np.unique(directions, return_inverse=True)[1]
    spread = distinct[spread_nodes(np.column_stack((points, direction_axis))[distinct], distinct.size)]
    chosen = list[int]()
    for n in dict.fromkeys([*spread.tolist(), *np.argsort(times_before, kind="stable").tolist()]):
        is_first = directions[n] not in {directions[m] for m in chosen}
        if is_first or sizes[[*chosen, n]].sum() <= _MOST_ROWS:
            chosen.append(n)
    return [loops[n] for n in sorted(chosen)]


def _new_noise(before: SweepNoise, shortened: Sequence[_ShortSweep], rig: RigSettings) -> SweepNoise:
    """Noise of sweeps after some were shortened; the random noise falls with the number of points per mean.

    Args:
        before: noise of the sweeps as measured.
        shortened: the shortened sweeps.
        rig: stated accuracy class of the rig (gain and phase errors).
    """
    if not shortened:
        return before
    estimated, random = sweep_noise([short.sweep for short in shortened], rig), dict(before.random)
    names = {short.sweep.name for short in shortened}
    slopes = {name: slope for name, slope in before.slopes.items() if name not in names}
    for short in shortened:
        for key, ratio in short.noise_ratios.items():
            gain, phase = np.sqrt(ratio) * np.array(before.random[key])
            random[key] = estimated.random[key] if short.sweep.noise is None else (float(gain), float(phase))
    freedom = min(before.random_freedom, estimated.random_freedom)
    return replace(before, random=random, slopes={**slopes, **estimated.slopes}, random_freedom=freedom)


def _shorten_sweep(data_set: MeasuredSweep) -> _ShortSweep | None:
    """Average neighbouring points of long runs, and select some of very many constant amplitudes or frequencies.

    Returns:
        The shortened sweep; None if the sweep is short enough.
    """
    sweep, rows, sentence = data_set.test, data_set.order[data_set.weights > 0.0], ""
    levels = np.unique(sweep.run_level[rows])
    if levels.size > _MOST_LEVELS:
        some = levels[np.linspace(0, levels.size - 1, _MOST_LEVELS).round().astype(int)]
        rows = rows[np.isin(sweep.run_level[rows], some)]
        sentence = f"the diagnosis uses {some.size} of {levels.size} runs at one level or frequency, evenly spread"
    level_of_row, repeat = sweep.run_level[rows], sweep.repeat[rows]
    step = sweep.step[rows] if sweep.stepped else rows  # if neither is constant, in the order of measurement
    band, long = np.arange(rows.size), list[float]()  # one band for each point
    for level in np.unique(level_of_row).tolist():
        mask = level_of_row == level
        if np.unique(repeat[mask], return_counts=True)[1].max() > _LONG:
            edges = np.quantile(step[mask], np.linspace(0.0, 1.0, _BANDS + 1)[1:-1])
            band[mask] = -1 - np.searchsorted(edges, step[mask])
            long.append(level)
    if not long and not sentence:
        return None
    keys = np.stack((level_of_row, repeat.astype(float), band.astype(float)))
    means, conditions, counts = _average_points(data_set, rows, keys)
    if means.frequency.size < rows.size:
        counted = f"{rows.size} points are averaged to {means.frequency.size} narrow bands for the diagnosis"
        sentence = "; ".join(filter(None, (sentence, counted)))
    ratios = {(sweep.name, level): float(np.mean(1.0 / counts[means.run_level == level])) for level in long}
    return _ShortSweep(means, conditions, ratios, sentence)


def _average_points(data_set: MeasuredSweep, rows: Array, keys: Array) -> tuple[Sweep, RubberConditions, Array]:
    """Average the points of a sweep that have equal keys; |K| and the stepped quantity are averaged geometrically.

    Args:
        data_set: the sweep.
        rows: indices of the points to keep, (n,).
        keys: k values for each point, (k, n); points whose values are all equal are averaged.

    Returns:
        Sweep with one point for each of g groups, in the order of measurement; temperature and earlier strains at these
        points; and the number of points in each group, (g,).
    """
    _, first, group, counts = np.unique(keys, axis=1, return_index=True, return_inverse=True, return_counts=True)
    turn = np.argsort(np.bincount(group, rows) / counts, kind="stable")
    group, first, counts = np.argsort(turn)[group], rows[first[turn]], counts[turn]

    def mean(values: Any) -> Any:
        return np.bincount(group, values[rows]) / counts if isinstance(values, np.ndarray) else values

    def geometric_mean(values: Array) -> Array:
        return np.where(counts > 1, np.exp(mean(np.log(values))), values[first])

    sweep = data_set.test
    phase, error, stepped = np.angle(sweep.stiffness), sweep.relative_error, sweep.stepped
    averaged = replace(
        sweep,
        frequency=sweep.frequency[first] if stepped == "amplitude" else geometric_mean(sweep.frequency),
        amplitude=sweep.amplitude[first] if stepped == "frequency" else geometric_mean(sweep.amplitude),
        stiffness=geometric_mean(np.abs(sweep.stiffness)) * np.exp(1j * mean(phase)),
        repeat=sweep.repeat[first],
        reached=None if sweep.reached is None else geometric_mean(sweep.reached),
        relative_error=None if error is None else np.sqrt(mean(np.square(error)) / counts),
        temperature=mean(sweep.temperature),
    )
    return averaged, RubberConditions(*map(mean, vars(data_set.test_conditions).values())), counts
