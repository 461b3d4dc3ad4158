"""Long sweeps in means over narrow bands: a diagnosis asks for every point of a campaign thousands of times."""

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


def in_bands(data: Data) -> tuple[Data, tuple[str, ...]]:
    """The same tests with long runs of sweeps in means over narrow bands, and a sentence on each sweep that has some.

    The noise is that of the means, estimated anew. Rows without weight are left out.
    """
    means = [_means(data_set) for data_set in data.sweeps]
    if not any(data_set.sweep is not mean for data_set, mean in zip(data.sweeps, means, strict=True)):
        return data, ()
    campaign = data.campaign
    made = tuple(sweep_data(means, campaign.fit.residuals, campaign.rig))
    said = tuple(
        f"{mean.name}: {data_set.frequency.size} points are diagnosed as {mean.frequency.size} means over narrow bands"
        for data_set, mean in zip(data.sweeps, means, strict=True)
        if data_set.sweep is not mean
    )
    return replace(data, sweeps=made).in_session(), said


def _means(data_set: SweepData) -> Sweep:
    """A sweep with its long runs in means over bands that all runs of a line share; as it is where it has none."""
    sweep, rows = data_set.sweep, data_set.order[data_set.weights > 0.0]
    held, step, repeat = sweep.held[rows], sweep.step[rows], sweep.repeat[rows]
    band = np.arange(rows.size)  # each of its own
    for line in np.unique(held):
        mine = held == line
        if np.unique(repeat[mine], return_counts=True)[1].max() > _LONG:
            edges = np.quantile(step[mine], np.linspace(0.0, 1.0, _BANDS + 1)[1:-1])
            band[mine] = -1 - np.searchsorted(edges, step[mine])
    if np.all(band >= 0):
        return sweep
    keys = np.stack((held, repeat.astype(float), band.astype(float)))
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
