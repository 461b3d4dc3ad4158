"""Robust fits: the loss soft_l1, and wild points left out and listed.

A complex point counts as one: a wild one is wild in gain and phase together. The loss acts on each point's own error,
beside what its block shares, so a wild point does not pull its block along; that is why it is found by reweighting,
sqrt-weights into the noise of each point, and not by a loss on whitened residuals one by one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from scipy.special import chdtri

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.data_sets import DataSet, LoopData, SweepData
from bushfit.fitting.outliers import WINDOW, from_neighbours, limit
from bushfit.fitting.solve import Bounds, Solution, solve
from bushfit.model.model import Model
from bushfit.model.result import Outlier

#: Distance, in units of noise, around which soft_l1 turns from squares to distances.
_SOFT = 2.0
#: Points of a block that are neighbours.
_WINDOW = 5
#: A reweighted fit has settled when it moves by less than this, in standard errors.
_SETTLED, _MOST_ROUNDS = 0.01, 30
#: Rows of a test that a sentence names.
_SHOWN = 8


@dataclass(frozen=True, eq=False)
class Estimate:
    """A fit and the data behind it.

    Args:
        solution: where it ended.
        data_sets: the data, outliers without weight where the loss leaves them out.
        minimised: the same with the weights at which the solution is the least sum of squares.
        weighed: the same with the weights that give its covariance.
        wild: rows of each data set that are wild, in the order of its data.
    """

    solution: Solution
    data_sets: tuple[DataSet, ...]
    minimised: tuple[DataSet, ...]
    weighed: tuple[DataSet, ...]
    wild: tuple[Array, ...]

    @property
    def outliers(self) -> tuple[Outlier, ...]:
        """The wild points by file and row."""
        model, data_sets = self.solution.model, self.data_sets
        return tuple(
            entry
            for data_set, rows in zip(data_sets, self.wild, strict=True)
            for entry in _listed(data_set, rows, model)
        )


def outliers_at(model: Model, data_sets: Sequence[DataSet]) -> tuple[Outlier, ...]:
    """The wild points of some data sets as a model sees them, by file and row."""
    return tuple(entry for data_set in data_sets for entry in _listed(data_set, wild_points(data_set, model), model))


def estimate(
    model: Model,
    data_sets: Sequence[DataSet],
    names: Sequence[str],
    bounds: Bounds | None = None,
    *,
    robust: bool = False,
) -> Estimate:
    """Fit the named parameters by least squares, or robustly: soft_l1, the wild points of sweeps left out.

    soft_l1 minimises the sum of 2 C^2 (sqrt(1 + (z/C)^2) - 1) over the distances z of the points in units of noise.
    The covariance is that of least squares with all weights at (E psi')^2/E psi^2 of normal noise, psi the loss's
    slope. Wild rows of loops have no weight from the start, see `drive`.
    """
    if not robust:
        solution = solve(model, data_sets, names, bounds)
        wild = tuple(wild_points(data_set, solution.model) for data_set in data_sets)
        return Estimate(solution, tuple(data_sets), tuple(data_sets), tuple(data_sets), wild)
    for _ in range(_MOST_ROUNDS):
        wild = tuple(wild_points(data_set, model) for data_set in data_sets)
        kept = tuple(_without(data_set, rows) for data_set, rows in zip(data_sets, wild, strict=True))
        softened = tuple(_softened(data_set, model) for data_set in kept)
        solution = solve(model, softened, names, bounds)
        before = solution.coordinates.point(model.values)
        moved = (solution.coordinates.point(solution.model.values) - before) @ solution.jacobian
        model = solution.model
        if float(moved @ moved) < _SETTLED**2:
            weighed = tuple(
                data_set.weighted(np.full(_points(data_set), _efficiency(_parts(data_set)))) for data_set in kept
            )
            return Estimate(solution, kept, softened, weighed, wild)
    raise FitError(
        "the robust fit does not settle",
        found=f"{_MOST_ROUNDS} rounds of reweighting",
        hint="look at the rows that --loss linear warns of, and take them out of the file",
    )


def wild_points(data_set: DataSet, model: Model) -> Array:
    """Points that lie farther off the model than noise reaches, and as far off their neighbours, (n,).

    Where the same point was repeated, it must stand out from its repeats as well: what all of them do is no fault of
    one row. Where two repeats or more agree against it that is enough, so that wild neighbours do not hide each other.
    """
    if isinstance(data_set, LoopData):
        return data_set.drive.wild["force"].rows
    deviation = data_set.deviation(model)
    distance = data_set.apart(deviation)
    reach = limit(deviation.size, 2, data_set.noise.scatter_freedom or np.inf) * _misfit(distance, 2)
    far = distance > reach
    if not far.any():
        return np.flatnonzero(far)
    local = _from_neighbours(data_set, deviation, _WINDOW)
    repeats, beside = _from_repeats(data_set, local)
    alone = np.minimum(
        data_set.apart(local, shared=False), np.where(repeats > 0, data_set.apart(beside, shared=False), np.inf)
    )
    against = _from_neighbours(data_set, _from_repeats(data_set, deviation)[1], WINDOW)
    agreed = data_set.apart(against, shared=False) / np.sqrt(1.0 + np.pi / 2.0 / np.maximum(repeats, 1))
    return np.flatnonzero(far & (np.where(repeats > 1, agreed, alone) > reach))


def _from_neighbours(data_set: SweepData, values: Array, window: int) -> Array:
    """Distance of each point from the median of those around it in its block, complex (n,)."""
    local = np.zeros_like(values)
    for first, last in pairwise([*data_set.block_starts.tolist(), values.size]):
        rows = np.arange(last - first)
        real, imag = (from_neighbours(part[first:last], rows, window) for part in (values.real, values.imag))
        local[first:last] = real + 1j * imag
    return local


def _from_repeats(data_set: SweepData, values: Array) -> tuple[Array, Array]:
    """How many other repeats each point has, (n,), and its distance from their median, 0 without any, complex (n,)."""
    repeats, distance = np.zeros(values.size, dtype=int), np.zeros_like(values)
    points = np.stack((data_set.frequency, data_set.amplitude))
    _, place = np.unique(points, axis=1, return_inverse=True)
    for row, same in enumerate(place == place[:, None]):
        same[row] = False
        repeats[row] = np.count_nonzero(same)
        if repeats[row]:
            distance[row] = values[row] - np.median(values[same].real) - 1j * np.median(values[same].imag)
    return repeats, distance


def _without(data_set: DataSet, rows: Array) -> DataSet:
    """A sweep without some of its points."""
    if isinstance(data_set, LoopData) or not rows.size:
        return data_set
    weight = np.ones(data_set.frequency.size)
    weight[rows] = 0.0
    return data_set.weighted(weight)


def _softened(data_set: DataSet, model: Model) -> DataSet:
    distance = data_set.distance(model)
    scale = _SOFT * _misfit(distance[distance > 0.0] * np.sqrt(_parts(data_set)), _parts(data_set))
    return data_set.weighted(1.0 / np.sqrt(1.0 + (distance / scale) ** 2))


def _parts(data_set: DataSet) -> int:
    """Numbers that make up a point."""
    return 1 if isinstance(data_set, LoopData) else 2


def _points(data_set: DataSet) -> int:
    return data_set.size // _parts(data_set)


def _misfit(distance: Array, parts: int) -> float:
    """How far the bulk of all points lies off, over what noise alone makes; at least 1."""
    if not distance.size:
        return 1.0
    return max(1.0, float(np.median(distance) / np.sqrt(chdtri(parts, 0.5))))


@lru_cache(maxsize=4)
def _efficiency(parts: int) -> float:
    """(E psi')^2/E psi^2 of soft_l1 under normal noise of so many parts a point."""
    z = np.linspace(0.0, 12.0, 4001)[1:]
    density = z ** (parts - 1) * np.exp(-(z**2) / 2.0)
    density /= density.sum()
    ratio = z**2 / (parts * _SOFT**2)
    weight = 1.0 / np.sqrt(1.0 + ratio)
    slope = density @ (weight - ratio / parts * weight**3)
    return float(slope**2 * parts / (density @ (weight * z) ** 2))


def _listed(data_set: DataSet, rows: Array, model: Model) -> Iterator[Outlier]:
    file = str(data_set.source.file) if data_set.source else None
    if isinstance(data_set, LoopData):
        for column, (wild, off) in data_set.drive.wild.items():
            for row, distance in zip(wild.tolist(), off.tolist(), strict=True):
                yield Outlier(data_set.name, file, row + data_set.drive.first_row + 1, column, distance)
    elif rows.size:
        distance = data_set.apart(data_set.deviation(model)) / np.sqrt(2.0)
        for row, off in sorted(zip((data_set.rows[rows] + 1).tolist(), distance[rows].tolist(), strict=True)):
            yield Outlier(data_set.name, file, row, "stiffness", off)


def told(outliers: Sequence[Outlier], *, robust: bool) -> list[str]:
    """A sentence on the outliers that the fit follows and one on those left out, the first of each test by row.

    A wild displacement is never followed, see `drive`.
    """
    left = [entry for entry in outliers if robust or entry.column == "displacement"]
    followed = [entry for entry in outliers if not robust and entry.column != "displacement"]
    lines = []
    if followed:
        places = _places(followed)
        lines.append(f"{_count(followed)} and the fit follows them: {places}; --loss soft_l1 leaves them out")
    if left:
        lines.append(f"{_count(left)}, left out of the fit: {_places(left)}")
    return lines


def _count(outliers: Sequence[Outlier]) -> str:
    return f"{len(outliers)} point{'s lie' if len(outliers) > 1 else ' lies'} farther off than noise explains"


def _places(outliers: Sequence[Outlier]) -> str:
    rows: Mapping[str, list[int]] = {entry.place: [] for entry in outliers}
    for entry in outliers:
        rows[entry.place].append(entry.row)
    return "; ".join(f"{place} {_first(numbers)}" for place, numbers in rows.items())


def _first(rows: Sequence[int]) -> str:
    shown = ", ".join(str(row) for row in rows[:_SHOWN])
    more = f" and {len(rows) - _SHOWN} more" if len(rows) > _SHOWN else ""
    return f"row{'s' if len(rows) > 1 else ''} {shown}{more}"
