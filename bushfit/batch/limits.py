"""Limits: a TOML file of bounds, fixed or relative to the batch, and the verdict on each bushing.

A bushing is as good as the worst of its quantities. What is not known of it fails. A parameter that rests on a bound of
its fit is not settled by the tests: it passes on condition at best.

Notes:
    A value with its 95 % interval meets a limit in one of four ways, in the words of ILAC-G8:09/2019 for statements of
    conformity. Pass: the whole interval is within. Conditional pass: the value is within, but the interval reaches
    over the limit. Conditional fail: the value is outside, but the interval reaches back. Fail: all of it is outside.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import partial
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import ConfigDict, Field, ValidationInfo

from bushfit.batch.document import Record
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import LOSS_FACTOR, OF_FIT, STIFFNESS, At, Point, Quantity, at_point
from bushfit.campaign.quantities import with_sizes
from bushfit.campaign.toml import read_toml
from bushfit.diagnosis import document
from bushfit.effects.contract import Array
from bushfit.errors import CampaignError
from bushfit.reduction.arrays import scatter
from bushfit.units import number, parse_quantity
from bushfit.validation import ParameterValue, Share, converter, table, text


class Verdict(IntEnum):
    """How a value meets its limits, better before worse."""

    PASS = 0
    CONDITIONAL_PASS = 1
    CONDITIONAL_FAIL = 2
    FAIL = 3

    def __str__(self) -> str:
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True, kw_only=True)
class Bounds:
    """Limits of one quantity.

    Args:
        min, max: least and largest allowed value.
        nominal: the middle of the allowed values.
        tolerance: how far a value may lie from nominal, as a share of it.
        sigma: how many robust standard deviations of the batch a value may lie from its median.
        at_least: bushings that the batch must have for sigma to be judged.
    """

    min: ParameterValue | None = None
    max: ParameterValue | None = None
    nominal: ParameterValue | None = None
    tolerance: Share | None = None
    sigma: Annotated[float, Field(gt=0, allow_inf_nan=False)] | None = None
    at_least: Annotated[int, Field(ge=3)] = 10

    def __post_init__(self) -> None:
        given = [value is not None for value in (self.min, self.max, self.nominal, self.sigma)]
        if not any(given) or (self.nominal is None) != (self.tolerance is None):
            expected = "min, max, nominal with tolerance, or sigma"
            raise ValueError(CampaignError("these keys make no limit", expected=expected))
        if self.min is not None and self.max is not None and self.min >= self.max:
            raise ValueError(CampaignError("these limits hold no value", expected="min below max"))

    @property
    def stated(self) -> tuple[float, float]:
        """Lowest and highest allowed value, whatever the batch is like."""
        low, high = -math.inf if self.min is None else self.min, math.inf if self.max is None else self.max
        if self.nominal is not None and self.tolerance is not None:
            half = abs(self.nominal) * self.tolerance
            low, high = max(low, self.nominal - half), min(high, self.nominal + half)
        return low, high

    def resolve(self, values: Array) -> tuple[float, float]:
        """Lowest and highest allowed value; `values` are those of the batch, (n,)."""
        ranges = [self.stated]
        if self.sigma is not None and not self.idle(values):
            middle, spread = scatter(values)
            ranges.append((middle - self.sigma * spread, middle + self.sigma * spread))
        return max(low for low, _ in ranges), min(high for _, high in ranges)

    def idle(self, values: Array) -> str | None:
        """Why `sigma` cannot be held against these values, or None."""
        if self.sigma is not None and values.size < self.at_least:
            return f"{values.size} bushings, and at_least = {self.at_least}: the batch's own scatter is not judged"
        if self.sigma is not None and scatter(values)[1] == 0.0:
            return "more than half of the bushings agree to the digit: the batch's own scatter is not judged"
        return None


def _stiffness(raw: object, info: ValidationInfo) -> object:
    point = info.data.get("at")
    return parse_quantity(raw, point.motion.stiffness_unit) if isinstance(point, Point) else 0.0


def _ratio(raw: object, _: ValidationInfo) -> object:
    return raw if isinstance(raw, int | float) and not isinstance(raw, bool) else parse_quantity(raw, "1")


_LIMIT = Field(ge=0, allow_inf_nan=False)
Ratio = Annotated[float, converter(_ratio, text("a share, or a number") | {"type": ["string", "number"]}), _LIMIT]
Stiffness = Annotated[
    float, converter(_stiffness, text("a number with a unit of N/m, N*m/rad or Pa, by the point")), _LIMIT
]


@dataclass(frozen=True, kw_only=True)
class Located:
    """A table with a point; the last base, so that the point is read first and settles the units.

    Args:
        at: the operating point.
    """

    at: At


@dataclass(frozen=True, kw_only=True)
class StiffnessBounds(Bounds, Located):
    """[[stiffness]]: limits of |K| at a point."""

    min: Stiffness | None = None
    max: Stiffness | None = None
    nominal: Stiffness | None = None


@dataclass(frozen=True, kw_only=True)
class LossFactorBounds(Bounds, Located):
    """[[loss_factor]]: limits of the loss factor at a point."""

    min: Ratio | None = None
    max: Ratio | None = None
    nominal: Ratio | None = None


@dataclass(frozen=True)
class Limits:
    """A whole limits file.

    Args:
        parameters: by name, in the file's units of a campaign's [fit].
        stiffness, loss_factor: at operating points.
        nrmse, reduced_chi_square: largest allowed.
        verdicts: of `diagnose` that are allowed; empty for all.
        guard: whether a conditional pass counts as a miss.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    parameters: Annotated[Mapping[str, Bounds], table(partial(with_sizes, keys=("min", "max", "nominal")))] = field(
        default_factory=dict
    )
    stiffness: tuple[StiffnessBounds, ...] = ()
    loss_factor: tuple[LossFactorBounds, ...] = ()
    nrmse: Annotated[Ratio, Field(lt=1.0)] | None = None
    reduced_chi_square: Ratio | None = None
    verdicts: tuple[document.Verdict, ...] = ()
    guard: Annotated[bool, Field(strict=True)] = False

    def __post_init__(self) -> None:
        for name, count in Counter(name for name, _ in self._at_points).items():
            if count > 1:
                problem = CampaignError(f"{count} tables for one point", found=name, hint="put them in one table")
                raise ValueError(problem)

    @property
    def _at_points(self) -> list[tuple[str, StiffnessBounds | LossFactorBounds]]:
        """Limits at points, by the name of the quantity."""
        both = ((STIFFNESS, self.stiffness), (LOSS_FACTOR, self.loss_factor))
        return [(at_point(bounds.at, what).name, bounds) for what, found in both for bounds in found]

    @property
    def points(self) -> tuple[Point, ...]:
        return tuple(dict.fromkeys(bounds.at for _, bounds in self._at_points))

    @property
    def bounds(self) -> dict[str, Bounds]:
        """By the name of the quantity."""
        most = {quantity.name: getattr(self, key) for key, quantity in OF_FIT.items()}
        of_fit = {name: Bounds(max=limit) for name, limit in most.items() if limit is not None}
        return {**self.parameters, **dict(self._at_points), **of_fit}


def read_limits(path: Path) -> Limits:
    """A limits file.

    Raises:
        CampaignError: keys or values that are not understood, or no limit at all.
    """
    limits = read_toml(path, Limits, what="a limits file")
    if not (limits.bounds or limits.verdicts):
        raise CampaignError("there is no limit in it", file=path, expected='such as [parameters.mu] with max = "2 MPa"')
    return limits


def check_judged(limits: Limits, path: Path, rows: Iterable[Row]) -> None:
    """Refuse limits that no work on these rows could answer.

    Raises:
        CampaignError: `verdicts`, and a row without diagnose or run.
    """
    silent = [row.name for row in rows if not row.settings.diagnosed] if limits.verdicts else []
    if silent:
        more = f" and {len(silent) - 1} more" if len(silent) > 1 else ""
        raise CampaignError(
            "a limit on verdicts needs diagnose",
            file=path,
            place="verdicts",
            found=f"{silent[0]}{more} without it",
            hint='--command diagnose, or commands = ["diagnose"] in the manifest (or run, which diagnoses too)',
        )


@dataclass(frozen=True)
class Judgement:
    """The verdict on a bushing: its worst; what misses a limit and what is only just within, in words by name."""

    verdict: Verdict
    missed: Mapping[str, str]
    edge: Mapping[str, str]


class Judge:
    """Limits held against the values of a whole batch, ready for each bushing.

    Args:
        limits: the file.
        columns: values of each quantity over the batch, (n,), NaN where a bushing has none.
        quantities: how each is written.
    """

    def __init__(self, limits: Limits, columns: Mapping[str, Array], quantities: Mapping[str, Quantity]) -> None:
        self._limits, self._quantities = limits, quantities
        self._missed_from = Verdict.CONDITIONAL_PASS if limits.guard else Verdict.CONDITIONAL_FAIL
        self.allowed: dict[str, tuple[float, float]] = {}
        self.notes: list[str] = []
        for name, bounds in limits.bounds.items():
            values = columns.get(name, np.empty(0))
            values = values[np.isfinite(values)]
            self.allowed[name] = bounds.resolve(values)
            if idle := bounds.idle(values):
                self.notes.append(f"{name}: {idle}")

    def __call__(self, known: Mapping[str, Sequence[float]], record: Record) -> Judgement:
        """On one bushing: value, low and high of the 95 % interval of all that is known of it, and its record."""
        worst, missed, edge = Verdict.PASS, dict[str, str](), dict[str, str]()
        at_bound = record.get("at_bound", {})
        for name in dict.fromkeys((*self.allowed, *at_bound)):
            if (found := known.get(name)) is None:
                worst, missed[name] = Verdict.FAIL, f"{name} is not known: fail"
                continue
            verdict = judge(found, *self.allowed.get(name, (-math.inf, math.inf)))
            if name in at_bound:
                verdict = max(verdict, Verdict.CONDITIONAL_PASS)
            worst = max(worst, verdict)
            if verdict is not Verdict.PASS:
                chosen = missed if verdict >= self._missed_from else edge
                chosen[name] = self._words(name, found, verdict, at_bound.get(name))
        said = record.get("verdict", "is not known")
        if self._limits.verdicts and said not in self._limits.verdicts:
            worst = Verdict.FAIL
            missed["verdict"] = f"verdict {said}, allowed {', '.join(self._limits.verdicts)}"
        return Judgement(worst, missed, edge)

    def _words(self, name: str, found: Sequence[float], verdict: Verdict, bound: str | None) -> str:
        (low, high), (value, least, most) = self.allowed.get(name, (-math.inf, math.inf)), found[:3]
        quantity = self._quantities[name].for_people(value)

        def shown(x: float) -> str:
            return number(x * quantity.factor, 4)

        unit = "" if quantity.unit == "-" else f" {quantity.unit}"
        span = "" if math.isnan(least + most) else f" ({shown(least)} to {shown(most)})"
        ends = [f"{word} {shown(x)}" for word, x in (("min", low), ("max", high)) if math.isfinite(x)]
        said = [" ".join(ends)] * bool(ends) + [f"at the {bound} of its fit"] * bool(bound)
        return f"{name} = {shown(value)}{span}{unit}, {', '.join(said)}: {verdict}"


def judge(figures: Sequence[float], low: float, high: float) -> Verdict:
    """How a value and its 95 % interval, NaN where it is not known, lie to the lowest and highest allowed."""
    value, *ends = figures[:3]
    least, most = (value if math.isnan(end) else end for end in ends)
    if low <= value <= high:
        return Verdict.PASS if low <= least and most <= high else Verdict.CONDITIONAL_PASS
    return Verdict.FAIL if most < low or least > high else Verdict.CONDITIONAL_FAIL
