"""How steady a batch is: control charts in the order of test, drift, capability against limits, robust z.

Notes:
    Charts are those of ISO 7870-2, capability is that of ISO 22514-2 for normal scatter. It is written out here because
    scipy.stats, which has some of it, takes as long to load as ten bushings to fit.
"""

import math
from collections import Counter
from collections.abc import Sequence
from typing import Annotated

import numpy as np
from scipy.special import chdtri, ndtr, stdtr
from typing_extensions import Doc, TypedDict

from bushfit.effects.contract import Array
from bushfit.model.covariance import Z95
from bushfit.reduction.arrays import scatter
from bushfit.units import number

#: Values that control limits are made of, and that others are held against, at least; and those from which limits are
#: no longer called provisional. Both chosen, the second as is usual with charts of individuals.
FEWEST, ENOUGH = 5, 25
#: Chance, over all quantities and bushings together, at which a drift or a difference is told.
LEVEL = 0.05
#: Neighbours are taken together to so many blocks at most before their pairs are searched for drift.
_BLOCKS = 200
#: Least index that is usually asked for.
_ASKED = 1.33
#: Of the deviation by the median absolute deviation: degrees of freedom as a share of those of the usual one, and its
#: bias n / (n - 0.8) with few values: Rousseeuw and Croux, JASA 88 (1993) 1273.
EFFICIENCY, _BIAS = 0.37, 0.8
#: Mean and standard deviation of the range of 2 to 10 normal values: d2 and d3 of ISO 7870-2.
_D2 = (1.128, 1.693, 2.059, 2.326, 2.534, 2.704, 2.847, 2.970, 3.078)
_D3 = (0.853, 0.888, 0.880, 0.864, 0.848, 0.833, 0.820, 0.808, 0.797)


class Capability(TypedDict):
    """How well bushings keep within stated limits."""

    index: Annotated[
        str | None,
        Doc('"Cpk" where the chart of 25 bushings or more is steady, else "Ppk"; null without a fixed limit.'),
    ]
    spread: Annotated[
        tuple[float, float, float] | None,
        Doc("Cp or Pp, low and high of its 95 % interval; null with one limit."),
    ]
    nearest: Annotated[
        tuple[float, float, float] | None,
        Doc("Cpk or Ppk likewise (Bissell, Applied Statistics 39 (1990) 331)."),
    ]
    capability: Annotated[str, Doc("the same in words, and what it does not tell.")]


class Process(Capability):
    """What the order of test tells of a quantity, in the unit of its column."""

    size: Annotated[
        int,
        Doc("bushings of a subgroup, whose means and ranges are charted; 1 where individuals and moving ranges are."),
    ]
    points: Annotated[int, Doc("of which the limits are made, without bushings that differ.")]
    control: Annotated[
        tuple[float, float, float] | None,
        Doc("mean, lower and upper control limit; null of fewer than five points, or of such as are all alike."),
    ]
    ranges: Annotated[tuple[float, float] | None, Doc("mean range and its upper control limit; null likewise.")]
    beyond: Annotated[int, Doc("points and ranges beyond these limits.")]
    drift: Annotated[
        tuple[float, float, float, float] | None,
        Doc(
            "change from the first bushing to the last, low and high of its 95 % interval (Theil and Sen), and its "
            "probability by chance (Kendall) times the number of quantities; null likewise."
        ),
    ]


def charted(values: Array, subgroups: Sequence[str]) -> tuple[Array, Array, int]:
    """What a control chart shows of values in the order of test, (n,), and subgroups of each or none.

    Returns:
        Means of the subgroups and their ranges in order, NaN where one has not the usual size, and that size; or the
        values themselves, their moving ranges, and 1.
    """
    sizes = Counter(Counter(subgroups).values())
    size = max(sizes, key=lambda size: (sizes[size], size), default=1)
    if 1 < size <= len(_D2) + 1:
        import pandas as pd

        found = pd.Series(values).groupby(list(subgroups), sort=False)
        points = np.array([found.mean(), found.max() - found.min()])
        return *np.where(found.count() == size, points, np.nan), size
    at, ranges = np.flatnonzero(np.isfinite(values)), np.full(values.size, np.nan)
    ranges[at[1:]] = np.abs(np.diff(values[at]))
    return values, ranges, 1


def process(
    values: Array, errors: Array, apart: Array, stated: tuple[float, float], subgroups: Sequence[str], quantities: int
) -> Process:
    """Control chart, drift and capability of a quantity.

    Args:
        values, errors: and their standard errors in the order of test, NaN where not known, (n,).
        apart: bushings that differ, which make no control limits, (n,) bool.
        stated: lowest and highest allowed value, either may be infinite.
        subgroups: of each value, or none.
        quantities: how many are searched for drift.
    """
    usual, steps, size = charted(np.where(apart, np.nan, values), subgroups)
    count, control, ranges, beyond = int(np.isfinite(usual).sum()), None, None, 0
    if count >= FEWEST and (middle := float(np.nanmean(steps))) > 0.0:
        d2, d3 = _D2[max(size, 2) - 2], _D3[max(size, 2) - 2]
        center, half = float(np.nanmean(usual)), 3.0 * middle / d2 / math.sqrt(size)
        control, ranges = (center, center - half, center + half), (middle, middle * (1.0 + 3.0 * d3 / d2))
        points, steps, _ = charted(values, subgroups)
        beyond = int((np.abs(points - center) > half).sum() + (steps > ranges[1]).sum())
    moved = _drift(values, quantities)
    unsteady = apart.any() or beyond or (moved and moved[3] < LEVEL)
    index = "Cpk" if control and count * size >= ENOUGH and not unsteady else "Ppk"
    able: Capability = {"index": None, "spread": None, "nearest": None, "capability": ""}
    known = values[np.isfinite(values)]
    if known.size > 1 and any(map(math.isfinite, stated)) and np.ptp(known) > 0.0:
        able = _capability(index, known, errors, *stated)
    chart = {"size": size, "points": count, "control": control, "ranges": ranges, "beyond": beyond, "drift": moved}
    return {**chart, **able}  # type: ignore[typeddict-item]


def _drift(values: Array, quantities: int) -> tuple[float, float, float, float] | None:
    """`drift` of a process."""
    at = np.flatnonzero(np.isfinite(values))
    if at.size < FEWEST or np.ptp(values[at]) == 0.0:
        return None
    blocks = np.array_split(at, min(_BLOCKS, at.size))
    x, y = np.array([(block.mean(), np.median(values[block])) for block in blocks]).T
    one, other = np.triu_indices(x.size, 1)
    slopes = np.sort((y[other] - y[one]) / (x[other] - x[one])) * (at[-1] - at[0])
    deviation = math.sqrt(x.size * (x.size - 1) * (2 * x.size + 5) / 18.0)
    p = 2.0 * float(ndtr(-max(abs(float(np.sign(slopes).sum())) - 1.0, 0.0) / deviation))
    ends = np.clip((slopes.size + Z95 * deviation * np.array([-1.0, 1.0])) / 2.0, 0, slopes.size - 1)
    low, high = slopes[math.floor(ends[0])], slopes[math.ceil(ends[1])]
    return float(np.median(slopes)), float(low), float(high), min(1.0, p * quantities)


def _capability(index: str, known: Array, errors: Array, low: float, high: float) -> Capability:
    """Indices of values against their limits."""
    count, mean, sigma = known.size, float(known.mean()), float(known.std(ddof=1))
    nearest, spread, told = min(high - mean, mean - low) / (3.0 * sigma), None, ""
    half = Z95 * math.sqrt(1.0 / (9.0 * count) + nearest**2 / (2.0 * (count - 1)))
    if math.isfinite(width := (high - low) / (6.0 * sigma)):
        least, most = (width * math.sqrt(float(chdtri(count - 1, p)) / (count - 1)) for p in (0.975, 0.025))
        spread, told = (
            (width, least, most),
            f"{index[:2]} = {number(width, 3)} ({number(least, 2)} to {number(most, 2)}), ",
        )
    told += f"{index} = {number(nearest, 3)} ({number(nearest - half, 2)} to {number(nearest + half, 2)}): "
    if nearest - half < _ASKED <= nearest + half:
        needed = math.ceil((5.0 * Z95) ** 2 * (1.0 / (9.0 * max(nearest, 0.1) ** 2) + 0.5)) + 1
        more = f"; about {needed} would tell it to 20 %" if needed > count else ""
        told += f"{count} bushings cannot tell whether it is above {_ASKED}{more}"
    else:
        told += f"{'above' if nearest >= _ASKED else 'below'} {_ASKED}"
    own = errors[np.isfinite(errors)]
    share = min(float(np.median(own)) ** 2 / sigma**2, 1.0) if own.size else 0.0
    told += f"; {100.0 * share:.0f} % of the variance is error of the tests" if share >= 0.1 else ""
    ends = nearest, nearest - half, nearest + half
    return {"index": index, "spread": spread, "nearest": ends, "capability": told}


def robust_z(values: Array, errors: Array) -> tuple[Array, Array]:
    """How far values are off their median in standard deviations, and the two-sided probability of each, (n,).

    The deviation is that of the batch by the median absolute deviation, less the usual error in it, and the value's own
    error. Student's t counts that a deviation of few bushings is itself known badly.

    Args:
        values, errors: and their standard errors, (n,); NaN where not known: an unknown error counts as the usual one.
    """
    there, z, chance = np.isfinite(values), np.full(values.size, np.nan), np.ones(values.size)
    count = int(there.sum())
    middle, sigma = scatter(values[there]) if count >= FEWEST else (math.nan, 0.0)
    if sigma > 0.0:
        square, own = (sigma * count / (count - _BIAS)) ** 2, errors[there] ** 2
        usual = float(np.median(own[np.isfinite(own)])) if np.isfinite(own).any() else 0.0
        variance = max(square - usual, 0.0) + np.where(np.isfinite(own), own, usual)
        variance = np.maximum(variance, 1e-12 * square)  # errors of zero leave something to divide by
        z[there] = (values[there] - middle) / np.sqrt(variance)
        chance[there] = 2.0 * stdtr(EFFICIENCY * (count - 1) * (variance / square) ** 2, -np.abs(z[there]))
    return z, chance
