"""Smooth curves without a name: a Gaussian process over frequency and strain, or harmonics of the loops."""

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import block_diag

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations.contract import Explanation
from bushfit.diagnosis.linear_model import Group
from bushfit.effects.contract import Array
from bushfit.fitting.measured_loop import smooth_waves
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep, group_repeats, split_by_kind
from bushfit.gaussian_process import spread_nodes
from bushfit.reading.measurement import SAME_TEMPERATURE

#: Lengths in ln frequency and ln strain over which a curve changes: smooth, and rough.
_LENGTHS = {"smooth": (1.5, 1.2), "rough": (0.5, 0.5)}
#: Features of a process at most, and the variance of one, relative to the largest, that counts.
_MOST_FEATURES, _LEAST_VARIANCE = 16, 1e-4
#: Points at most that a process is made of.
_MOST_POINTS = 150
#: Phases of a cycle at which harmonics are summed up: six a wave of the fastest.
_PHASES = 32


def unnamed(evidence: Evidence) -> list[Explanation]:
    """List smooth curves as explanations.

    Args:
        evidence: the fitted model and the tests.

    Returns:
        A smooth and a rough Gaussian process for each direction, a rough one for all, and the harmonics of the loops.
    """
    loops, sweeps = split_by_kind(evidence.data_sets)
    found = [(f"{how} {location}", group) for how in _LENGTHS for location, group in _processes(evidence, sweeps, how)]
    if loops:
        groups = group_repeats(loops)
        shapes = block_diag(*[smooth_waves(np.arange(_PHASES) / _PHASES)] * len(groups))
        columns = np.concatenate([harmonics(evidence, group) for group in groups])
        found.append(("loops", Group(columns, shapes, together=True)))
    return [Explanation("unnamed", "unnamed", name, group) for name, group in found]


def harmonics(evidence: Evidence, loops: Sequence[MeasuredLoop]) -> Array:
    """Columns of the harmonics that repeated loops share, (c, n)."""
    columns = np.zeros((len(loops[0].contrasts()), evidence.residual.size))
    for loop in loops:
        columns[:, evidence.place[loop]] = loop.contrasts()
    return columns


def _processes(evidence: Evidence, sweeps: Sequence[MeasuredSweep], how: str) -> Iterator[tuple[str, Group]]:
    """Sweeps of one direction and temperature share a process, however many files they come in."""
    if not sweeps:
        return
    model, lengths = evidence.model, np.array(_LENGTHS[how])
    points = [
        np.log(np.stack((sweep.frequency, sweep.amplitude * model.unit_strain(sweep.direction)), axis=1)) / lengths
        for sweep in sweeps
    ]
    patterns = _features(np.concatenate(points))[:, None] * np.array([[1.0], [1.0j]])
    share = patterns.reshape(-1, patterns.shape[-1])
    columns, of_row, of_point = np.zeros((len(share), evidence.residual.size)), np.full(evidence.residual.size, -1), []
    kinds = [(str(sweep.direction), _degrees(sweep)) for sweep in sweeps]
    ends = np.cumsum([0, *map(len, points)])
    for sweep, kind, first, last in zip(sweeps, kinds, ends[:-1], ends[1:], strict=True):
        columns[:, evidence.place[sweep]] = sweep.whiten(share[:, first:last])
        of_row[evidence.place[sweep]] = kinds.index(kind)
        of_point += [kinds.index(kind)] * (last - first)
    for direction in dict.fromkeys(name for name, _ in kinds):
        kind_numbers = np.array([kinds.index(kind) for kind in dict.fromkeys(kinds) if kind[0] == direction])[
            :, None, None
        ]
        parts = columns * (of_row == kind_numbers), share * (np.array(of_point) == kind_numbers)
        residual_columns, changed = (part.reshape(-1, part.shape[-1]) for part in parts)
        yield direction, Group(residual_columns, changed, together=True)
    if how == "rough" and len({name for name, _ in kinds}) > 1:  # what is smooth in all is the compound's
        yield "all", Group(columns, share, together=True)


def _degrees(sweep: MeasuredSweep) -> int | None:
    """Temperature of a sweep in steps of `SAME_TEMPERATURE`; None if it is not known."""
    kelvin = sweep.sweep.temperature
    return None if kelvin is None else round(float(np.mean(kelvin)) / SAME_TEMPERATURE)


def _features(points: Array) -> Array:
    """Patterns over points whose sum with independent amounts has unit variance and falls off with distance, (c, n)."""
    distinct, place = np.unique(points.round(6), axis=0, return_inverse=True)
    some = distinct[spread_nodes(distinct, _MOST_POINTS)]
    values, vectors = np.linalg.eigh(_kernel(some, some))
    order = np.argsort(-values)[:_MOST_FEATURES]
    order = order[values[order] > _LEAST_VARIANCE * values.max()]
    return (_kernel(distinct, some) @ vectors[:, order] / np.sqrt(values[order])).T[:, place.ravel()]


def _kernel(points: Array, nodes: Array) -> Array:
    return np.exp(-0.5 * np.sum(np.square(points[:, None] - nodes), axis=-1))
