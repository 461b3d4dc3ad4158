"""Limits: a TOML file of fixed limits and of limits relative to the batch, and the result of each part.

The result of a part is the worst result of its quantities.

Notes:
    A value with its 95 % interval meets a limit in one of four ways, named as in ILAC-G8:09/2019, statements of
    conformity. Pass: the whole interval is within the limits. Conditional pass: the value is within the limits, but not
    the whole interval. Conditional fail: the value is outside, but a part of the interval is within. Fail: the whole
    interval is outside. An unknown quantity fails. A value that the tests do not determine (half of the interval is as
    large as the value) is not judged if the interval contains a limit. A parameter at a bound of its fit is a
    conditional pass at best. If the model misses the tests, the measured points are compared with the
    limits; a limit without a measured point is not judged.
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field

from bushfit.batch.document import Estimate, RowFile
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import FIT_NAMES, FIT_QUALITY, LOSS_FACTOR, STIFFNESS, PartQuantity
from bushfit.campaign.quantities import convert_values
from bushfit.campaign.toml import parse_toml
from bushfit.caveat import Caveat
from bushfit.diagnosis import document
from bushfit.effects.contract import Array
from bushfit.errors import CampaignError
from bushfit.fitting.model_error import BEYOND_NOISE
from bushfit.geometry.point import PointText
from bushfit.reduction.arrays import median_and_scatter
from bushfit.report.batch_document import LimitResult
from bushfit.units import number, parse_quantity
from bushfit.validation import ParameterValue, Share, converter, tables, text, validate_tables

#: Results in the order from good to bad.
RESULTS: Sequence[LimitResult] = ("pass", "conditional pass", "not judged", "conditional fail", "fail")
#: NRMSE above which a fit that misses its tests by more than noise is poor, unless the limits file states another value
#: with `nrmse`. Chosen: half of the usual tolerance of a stiffness in drawings.
POOR_FIT = 0.05


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Limits of one quantity of the parts of a batch.

    Args:
        min, max: smallest and largest allowed value.
        nominal: middle of the allowed range; needs `tolerance`.
        tolerance: largest allowed deviation from `nominal`, relative to `nominal`.
        sigma: largest allowed deviation from the median of the batch, in standard deviations of the batch.
        at_least: minimum number of parts in the batch for `sigma` to be judged.
    """

    min: ParameterValue | None = None
    max: ParameterValue | None = None
    nominal: ParameterValue | None = None
    tolerance: Share | None = None
    sigma: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    at_least: Annotated[int, Field(ge=3)] = 10

    def __post_init__(self) -> None:
        is_empty = {self.min, self.max, self.nominal, self.sigma} == {None}
        if is_empty or (self.nominal is None) != (self.tolerance is None):
            expected = "min, max, nominal with tolerance, or sigma"
            raise ValueError(CampaignError("these keys do not form a limit", expected=expected))
        if self.min is not None and self.max is not None and self.min >= self.max:
            raise ValueError(CampaignError("no value meets these limits", expected="min below max"))

    @property
    def fixed_limits(self) -> tuple[float, float]:
        """Lowest and highest allowed value by min, max, nominal and tolerance; infinite on a side without a limit."""
        low, high = -math.inf if self.min is None else self.min, math.inf if self.max is None else self.max
        if self.nominal is not None and self.tolerance is not None:
            half = abs(self.nominal) * self.tolerance
            low, high = max(low, self.nominal - half), min(high, self.nominal + half)
        return low, high


_LIMIT = Field(ge=0, allow_inf_nan=False)
_RATIO = converter(
    lambda raw, _: raw if isinstance(raw, int | float) and not isinstance(raw, bool) else parse_quantity(raw, "1"),
    text("a share, or a number") | {"type": ["string", "number"]},
)
Ratio = Annotated[float, _RATIO, _LIMIT]
_STIFFNESS = converter(
    lambda raw, info: parse_quantity(raw, point.motion.stiffness_unit) if (point := info.data.get("at")) else 0.0,
    text("a number with a unit of N/m, N*m/rad or Pa, depending on the point"),
)
Stiffness = Annotated[float, _STIFFNESS, _LIMIT]


@dataclass(frozen=True, kw_only=True)
class PointLimits:
    """Base class of tables of limits that apply at one operating point.

    List it as the last base class: pydantic then reads the point before the limits, whose unit depends on the point.

    Args:
        at: operating point, such as "axial 25 Hz 0.1 mm".
    """

    at: PointText


@dataclass(frozen=True, kw_only=True)
class StiffnessBounds(Bounds, PointLimits):
    """Table [[stiffness]] of a limits file: limits of the dynamic stiffness |K| at an operating point."""

    min: Stiffness | None = None
    max: Stiffness | None = None
    nominal: Stiffness | None = None


@dataclass(frozen=True, kw_only=True)
class LossFactorBounds(Bounds, PointLimits):
    """Table [[loss_factor]] of a limits file: limits of the loss factor at an operating point."""

    min: Ratio | None = None
    max: Ratio | None = None
    nominal: Ratio | None = None


@dataclass(frozen=True)
class Limits:
    """Content of a limits file: allowed values of parameters, stiffness, loss factor and quality of the fit.

    Args:
        parameters: limits of parameters by name, with units as in [fit] of a campaign.
        stiffness, loss_factor: limits at operating points.
        nrmse, reduced_chi_square: largest allowed value of this measure of the fit.
        verdicts: allowed verdicts of `diagnose`; empty to allow all.
        guard: if true, a part with a conditional pass misses its limits.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    parameters: Annotated[Mapping[str, Bounds], tables(partial(convert_values, keys=("min", "max", "nominal")))] = (
        field(default_factory=dict)
    )
    stiffness: tuple[StiffnessBounds, ...] = ()
    loss_factor: tuple[LossFactorBounds, ...] = ()
    nrmse: Annotated[Ratio, Field(lt=1.0)] | None = None
    reduced_chi_square: Ratio | None = None
    verdicts: tuple[document.Verdict, ...] = ()
    guard: Annotated[bool, Field(strict=True)] = False

    def __post_init__(self) -> None:
        for name, count in Counter(name for name, _ in self.at_points).items():
            if count > 1:
                problem = CampaignError(f"{count} tables for one point", found=name, hint="put them in one table")
                raise ValueError(problem)

    @property
    def at_points(self) -> list[tuple[str, StiffnessBounds | LossFactorBounds]]:
        """Name of the quantity, such as "stiffness axial 25 Hz 0.1 mm", and limits, of each operating point."""
        tables = (STIFFNESS, self.stiffness), (LOSS_FACTOR, self.loss_factor)
        return [(f"{name} {bounds.at}", bounds) for name, table in tables for bounds in table]

    @property
    def bounds(self) -> dict[str, Bounds]:
        """All limits of the file by the name of the quantity, such as "stiffness axial 25 Hz 0.1 mm"."""
        bounds: dict[str, Bounds] = {**self.parameters, **dict(self.at_points)}
        largest = {quantity.name: getattr(self, key) for key, quantity in FIT_QUALITY.items()}
        return bounds | {name: Bounds(max=limit) for name, limit in largest.items() if limit is not None}


def read_limits(path: Path, rows: Sequence[Row]) -> Limits:
    """Read a limits file.

    Args:
        path: TOML file with the limits.
        rows: rows of the batch that is judged by the limits.

    Returns:
        The limits in SI.

    Raises:
        CampaignError: invalid keys or values, no limit at all, or `verdicts` with a row that does not run diagnose.
    """
    limits = validate_tables(parse_toml(path, "a limits file"), path, Limits)
    if not (limits.bounds or limits.verdicts):
        raise CampaignError("the file has no limit", file=path, expected='such as [parameters.mu] with max = "2 MPa"')
    silent = [row.name for row in rows if not row.settings.diagnoses] if limits.verdicts else []
    if silent:
        found = silent[0] + (f" and {len(silent) - 1} more" if len(silent) > 1 else "") + " without it"
        hint = '--command diagnose, or commands = ["diagnose"] in the manifest (or run, which diagnoses too)'
        raise CampaignError("a limit on verdicts needs diagnose", file=path, place="verdicts", found=found, hint=hint)
    return limits


def resolve_limits(limits: Limits, values: Mapping[str, Array]) -> tuple[dict[str, tuple[float, float]], list[Caveat]]:
    """Compute the allowed range of each quantity; limits relative to the batch (`sigma`) need the values of all parts.

    Args:
        limits: the limits file.
        values: values of the n parts by name of the quantity [SI], (n,), NaN for parts without a value.

    Returns:
        Lowest and highest allowed value by name of the quantity [SI], and warnings on limits that cannot be judged.
    """
    allowed, notes = dict[str, tuple[float, float]](), list[Caveat]()
    for name, bounds in limits.bounds.items():
        allowed[name] = bounds.fixed_limits
        if bounds.sigma is None:
            continue
        sample = values.get(name, np.empty(0))
        sample = sample[np.isfinite(sample)]
        median, deviation = median_and_scatter(sample) if sample.size else (0.0, 0.0)
        if sample.size < bounds.at_least:
            sentence = f"{sample.size} parts, fewer than at_least = {bounds.at_least}: sigma is not judged"
            notes.append(Caveat("sigma_not_judged", sentence).about(name))
        elif deviation == 0.0:
            sentence = "more than half of the parts have exactly the same value: sigma is not judged"
            notes.append(Caveat("sigma_not_judged", sentence).about(name))
        else:
            (low, high), reach = bounds.fixed_limits, bounds.sigma * deviation
            allowed[name] = max(low, median - reach), min(high, median + reach)
    return allowed, notes


def describe_poor_fit(record: RowFile, limits: Limits | None) -> str:
    """Sentence on a poor fit: NRMSE above its limit (default 5 %) and reduced chi-square of 2 or more; else empty."""
    nrmse, chi_square = (record.quantities.get(quantity.name) for quantity in FIT_QUALITY.values())
    largest = POOR_FIT if limits is None or limits.nrmse is None else limits.nrmse
    if not nrmse or nrmse.value <= largest or (chi_square and chi_square.value < BEYOND_NOISE):
        return ""
    return f"the model misses the tests: NRMSE {number(100 * nrmse.value, 3)} %, above {number(100 * largest, 3)} %"


def judge_part(
    record: RowFile, limits: Limits, allowed: Mapping[str, tuple[float, float]], quantities: Mapping[str, PartQuantity]
) -> tuple[LimitResult, dict[str, str], dict[str, str]]:
    """Compare the results of a part with the limits.

    Args:
        record: results of the part.
        limits: the limits file.
        allowed: lowest and highest allowed value by the name of the quantity, from `resolve_limits`.
        quantities: quantities by name, with the units for the sentences.

    Returns:
        The worst result of the part; sentences by quantity on the limits that it misses; and sentences by quantity on
        the limits that it passes conditionally or that were not judged.
    """
    poor, outcomes = describe_poor_fit(record, limits), dict[str, tuple[LimitResult, str]]()
    unlimited = -math.inf, math.inf
    for name in dict.fromkeys((*allowed, *record.at_bound)):
        bound, source = record.at_bound.get(name), ""
        estimate = record.quantities.get(name)
        if estimate and poor and name not in FIT_NAMES:
            estimate, bound, source = record.measured.get(name), None, "measured "
        if estimate:
            result, sentence = judge_quantity(quantities[name], estimate, allowed.get(name, unlimited), bound)
            outcomes[name] = result, source + sentence
        elif source:
            outcomes[name] = "not judged", f"{name} not judged: poor fit"
        else:
            outcomes[name] = "fail", f"{name} is not known"
    if limits.verdicts and record.verdict not in limits.verdicts:
        sentence = f"verdict {record.verdict or 'not known'}, allowed {', '.join(limits.verdicts)}"
        outcomes["verdict"] = "fail", sentence
    tolerated = ("not judged",) if limits.guard else ("not judged", "conditional pass")
    doubtful = {name: sentence for name, (result, sentence) in outcomes.items() if result in tolerated}
    misses = {name: text for name, (result, text) in outcomes.items() if result != "pass" and name not in doubtful}
    worst = max((result for result, _ in outcomes.values()), key=RESULTS.index, default=RESULTS[0])
    return worst, misses, doubtful


def judge_quantity(
    quantity: PartQuantity, estimate: Estimate, allowed: tuple[float, float], bound: str | None
) -> tuple[LimitResult, str]:
    """Compare a value and its 95 % interval, if known, with limits.

    Args:
        quantity: name and unit of the quantity.
        estimate: value and interval of the quantity [SI].
        allowed: lowest and highest allowed value [SI]; either may be infinite.
        bound: bound of the fit, "min" or "max", that the parameter reached; None if it reached neither.

    Returns:
        Result, which is "not judged" if the interval contains a limit and is as wide as twice the value, and a
        conditional pass at best if the parameter reached a bound; and a sentence in the display unit
        of the value, with the nearer limit: "alpha 0.26 (0.25 to 0.27), limit 0.252: conditional fail".
    """
    low, high = allowed
    lower, upper = (estimate.value if end is None else end for end in (estimate.low, estimate.high))
    result: LimitResult = "fail" if upper < low or lower > high else "conditional fail"
    if low <= estimate.value <= high:
        result = "pass" if low <= lower and upper <= high and not bound else "conditional pass"
    displayed = quantity.in_display_unit(estimate.value)
    ends = [number(end * displayed.factor, 4) for end in (estimate.low, estimate.high) if end is not None]
    finite = [limit for limit in allowed if math.isfinite(limit)]
    unit = f" {displayed.unit}" if displayed.unit != "-" else ""
    if result.startswith("conditional") and upper - lower >= 2.0 * abs(estimate.value):
        interval = f"95 % interval {' to '.join(ends)}{unit}"
        return "not judged", f"the tests do not determine {quantity.name} ({interval})"
    sentence = f"{quantity.name} {number(estimate.value * displayed.factor, 4)}{unit}"
    sentence += f" ({' to '.join(ends)})" if len(ends) == 2 else ""
    if finite:
        nearest = min(finite, key=lambda limit: abs(limit - estimate.value))
        sentence += f", limit {number(nearest * displayed.factor, 4)}{unit}"
    sentence += f", the {bound}imum that the fit allows, because the tests do not determine it" if bound else ""
    return result, sentence + (f": {result}" if result.startswith("conditional") else "")
