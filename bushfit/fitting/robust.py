"""Robust fits: the loss soft_l1, and outliers left out and listed.

Notes:
    A complex point is one observation: an outlier is one in gain and phase together. The loss acts on each point's own
    error, beside what its block shares, so that an outlier does not pull its block along. That is why the fit is
    reweighted, sqrt-weights into the noise of each point, and the loss not put on whitened residuals one by one.
"""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.assess import Process
from bushfit.fitting.coordinates import Bounds, Solution
from bushfit.fitting.outliers import misfit_scale
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.solve import solve
from bushfit.model.model import Model
from bushfit.model.result import Outlier

#: Distance, in units of noise, around which soft_l1 turns from squares to distances; normal noise loses 4 % there.
_SOFT = 2.0
#: A reweighted fit has settled when it moves by less than this, in standard errors: far below what matters.
_SETTLED = 0.01
#: Rounds of reweighting; chosen: most fits take five, what has not settled by then swings to and fro.
_MOST_ROUNDS = 30
#: Rows of a test that a sentence names, to fit on a line or two.
_MOST_NAMED = 8


@dataclass(frozen=True, eq=False)
class WeightedFit:
    """A fit and the data behind it.

    Args:
        data_sets: the data, outliers without weight where the loss leaves them out.
        minimised: the same with the weights at which the solution is the least sum of squares.
        weighed: the same with the weights that give its covariance.
        outliers: by file and row.
        process: how the model misses the tests, where it does; the weights then hold an independent model error.
    """

    solution: Solution
    data_sets: Sequence[MeasuredTest]
    minimised: Sequence[MeasuredTest]
    weighed: Sequence[MeasuredTest]
    outliers: tuple[Outlier, ...]
    process: Process | None = None


def outliers_at(
    model: Model, data_sets: Sequence[MeasuredTest], outlying: Sequence[Array] | None = None
) -> tuple[Outlier, ...]:
    """Outliers of some data sets by file and row: those whose numbers are given, else those that the model sees.

    Args:
        model: fitted model.
        data_sets: tests.
        outlying: numbers of the outlying points of each test; None to find them with the model.
    """
    numbers = outlying or [data_set.outlying(model) for data_set in data_sets]
    pairs = zip(data_sets, numbers, strict=True)
    return tuple(entry for data_set, points in pairs for entry in data_set.outliers(points, model))


def estimate(
    model: Model,
    data_sets: Sequence[MeasuredTest],
    names: Sequence[str],
    bounds: Bounds | None = None,
    *,
    robust: bool = False,
    solver: Callable[..., Solution] = solve,
) -> WeightedFit:
    """Fit the named parameters by least squares, or robustly: soft_l1, the outliers of sweeps left out.

    soft_l1 minimises the sum of 2 C^2 (sqrt(1 + (z/C)^2) - 1) over the distances z of the points in units of noise.
    The covariance is that of least squares with all weights at (E psi')^2/E psi^2 of normal noise, psi the loss's
    slope. Outliers of loops have no weight from the start, see `drive`.

    Args:
        model: model with the start values.
        data_sets: tests.
        names: parameters to fit.
        bounds: limits inside the parameters' own [SI].
        robust: True for soft_l1.
        solver: function that minimises the sum of squares.

    Returns:
        The fit and the data behind it.
    """
    if not robust:
        solution, unchanged = solver(model, data_sets, names, bounds), tuple(data_sets)
        return WeightedFit(solution, unchanged, unchanged, unchanged, outliers_at(solution.model, unchanged))
    for _ in range(_MOST_ROUNDS):
        outlying = tuple(data_set.outlying(model) for data_set in data_sets)
        retained = tuple(data_set.without(points) for data_set, points in zip(data_sets, outlying, strict=True))
        softened = tuple(_softened(data_set, model) for data_set in retained)
        solution = solver(model, softened, names, bounds)
        before = solution.coordinates.point(model.values)
        change = (solution.coordinates.point(solution.model.values) - before) @ solution.jacobian
        model = solution.model
        if float(change @ change) < _SETTLED**2:
            weighed = tuple(data_set.weighted(np.array(_efficiency(data_set.parts))) for data_set in retained)
            return WeightedFit(solution, retained, softened, weighed, outliers_at(model, retained, outlying))
    raise FitError(
        "the robust fit does not settle",
        found=f"{_MOST_ROUNDS} rounds of reweighting",
        hint="look at the rows that --loss linear warns of, and take them out of the file",
    )


def _softened(data_set: MeasuredTest, model: Model) -> MeasuredTest:
    distance = data_set.distance(model)
    scale = _SOFT * misfit_scale(distance[distance > 0.0] * np.sqrt(data_set.parts), data_set.parts)
    return data_set.weighted(1.0 / np.sqrt(1.0 + (distance / scale) ** 2))


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


def outlier_warnings(outliers: Sequence[Outlier], *, robust: bool) -> list[str]:
    """A sentence on the outliers that the fit follows and one on those left out, the first of each test by row.

    A displacement that is an outlier is never followed, see `drive`.

    Returns:
        At most two sentences.
    """
    excluded = [entry for entry in outliers if robust or entry.column == "displacement"]
    followed = [entry for entry in outliers if not robust and entry.column != "displacement"]
    sentences = [
        (followed, " and the fit includes them: {}; --loss soft_l1 leaves them out"),
        (excluded, ", left out of the fit: {}"),
    ]
    return [
        f"{len(entries)} point{'s lie' if len(entries) > 1 else ' lies'} farther from the model than noise explains"
        f"{words.format(_places(entries))}"
        for entries, words in sentences
        if entries
    ]


def _places(outliers: Sequence[Outlier]) -> str:
    """List files and columns of outliers with the first of their rows."""
    rows: defaultdict[str, list[str]] = defaultdict(list)
    for entry in outliers:
        rows[entry.place].append(str(entry.row))
    return "; ".join(
        f"{place} row{'s' if len(numbers) > 1 else ''} {', '.join(numbers[:_MOST_NAMED])}"
        + (f" and {len(numbers) - _MOST_NAMED} more" if len(numbers) > _MOST_NAMED else "")
        for place, numbers in rows.items()
    )
