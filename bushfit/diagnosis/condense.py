"""Long sweeps in means over narrow bands, and of very many levels some: a diagnosis asks for every point of a campaign
thousands of times, and for every level as often."""

from dataclasses import replace

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.data import Data
from bushfit.fitting.data_sets import SweepData, sweep_data
from bushfit.reading.measurement import Sweep

#: Points of a run from which it counts as long; chosen for time: stepped sines have tens, a swept sine thousands.
_LONG = 400
#: Bands of a long run; chosen: a smooth stiffness changes by less than noise within one.
_BANDS = 200
#: Lines of a sweep, levels mostly, that are looked at; chosen for time: each is searched without.
_MOST_LINES = 40


def condensed(data: Data) -> tuple[Data, tuple[str, ...]]:
    """The same tests with long runs of sweeps in means over narrow bands, of very many lines some, evenly spread; and a
    sentence on each sweep that this changes.

    The noise is that of the means, estimated anew. Rows without weight are in no mean.
    """
    told = [_told(data_set) for data_set in data.sweeps]
    said = tuple(f"{data_set.name}: {words}" for data_set, (_, words) in zip(data.sweeps, told, strict=True) if words)
    if not said:
        return data, ()
    campaign = data.campaign
    made = sweep_data([sweep for sweep, _ in told], campaign.fit.residuals, campaign.rig)
    sweeps = tuple(
        new if words else new.without(np.flatnonzero(old.weights == 0.0))
        for new, old, (_, words) in zip(made, data.sweeps, told, strict=True)
    )
    return replace(data, sweeps=sweeps).in_session(), said


def _told(data_set: SweepData) -> tuple[Sweep, str]:
    """What of a sweep is diagnosed, and in words how; "" where it is the sweep as it is."""
    sweep, rows, words = data_set.sweep, data_set.order[data_set.weights > 0.0], ""
    lines = np.unique(sweep.held)
    if rows.size and lines.size > _MOST_LINES:
        some = lines[np.linspace(0, lines.size - 1, _MOST_LINES).round().astype(int)]
        rows = rows[np.isin(sweep.held[rows], some)]
        words = f"{some.size} of its {lines.size} runs at one level, or frequency, are diagnosed, evenly spread"
    held, step, repeat = sweep.held[rows], sweep.step[rows], sweep.repeat[rows]
    band = np.arange(rows.size)  # each of its own
    for line in np.unique(held):
        mine = held == line
        if np.unique(repeat[mine], return_counts=True)[1].max() > _LONG:
            edges = np.quantile(step[mine], np.linspace(0.0, 1.0, _BANDS + 1)[1:-1])
            band[mine] = -1 - np.searchsorted(edges, step[mine])
    if np.all(band >= 0) and not words:
        return sweep, ""
    means = _means(sweep, rows, np.stack((held, repeat.astype(float), band.astype(float))))
    if means.frequency.size < rows.size:
        counted = f"{rows.size} points are diagnosed as {means.frequency.size} means over narrow bands"
        words = "; ".join(filter(None, (words, counted)))
    return means, words


def _means(sweep: Sweep, rows: Array, keys: Array) -> Sweep:
    """The means of some rows of a sweep, of one each of all rows with the same key, (keys, rows)."""
    _, first, place, counts = np.unique(keys, axis=1, return_index=True, return_inverse=True, return_counts=True)
    turn = np.argsort(np.bincount(place, rows) / counts)  # as they were measured

    def mean(values: Array) -> Array:
        return (np.bincount(place, values[rows]) / counts)[turn]

    logs, lead = np.log(sweep.stiffness), rows[first[turn]]
    error = None if sweep.relative_error is None else np.sqrt(mean(np.square(sweep.relative_error)) / counts[turn])
    return replace(
        sweep,
        frequency=sweep.frequency[lead] if sweep.stepped == "amplitude" else mean(sweep.frequency),
        amplitude=sweep.amplitude[lead] if sweep.stepped == "frequency" else mean(sweep.amplitude),
        stiffness=np.exp(mean(logs.real) + 1j * mean(logs.imag)),
        repeat=sweep.repeat[lead],
        noise=None if sweep.noise is None else sweep.noise * float(np.sqrt(np.mean(1.0 / counts))),
        reached=None if sweep.reached is None else mean(sweep.reached),
        relative_error=error,
        temperature=mean(sweep.temperature) if isinstance(sweep.temperature, np.ndarray) else sweep.temperature,
    )
