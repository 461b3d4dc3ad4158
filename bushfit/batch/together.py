"""The bushings of a batch against each other: the order of test and what it tells, curves, who differs by what."""

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import stdtrit

from bushfit.batch.document import Differing, Record
from bushfit.batch.limits import Limits
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import OF_FIT, STIFFNESS, Quantity, at_point, parse_point
from bushfit.effects import is_parameter
from bushfit.effects.contract import Array
from bushfit.model.covariance import Z95
from bushfit.prediction.comparison import holm
from bushfit.report.process import EFFICIENCY, FEWEST, LEVEL, Process, process, robust_z
from bushfit.units import number

#: Dates that can be sorted.
_DATE = re.compile(r"\d{4}-\d\d-\d\d([T ]\d\d:\d\d.*)?")


@dataclass(frozen=True, eq=False)
class Together:
    """The n rows of a batch, each against the others.

    Args:
        rows, records: of each, in the manifest's order.
        figures: of each quantity, as those of `Outcome`.
        quantities: how each is written, by its name.
        limits: that are stated.
    """

    rows: Sequence[Row]
    records: Sequence[Record]
    figures: Mapping[str, Array]
    quantities: Mapping[str, Quantity]
    limits: Limits | None

    @cached_property
    def order(self) -> tuple[Array, str]:
        """Numbers of the rows in the order of test, (n,), and what it is taken from: dates that all tests state so that
        they can be sorted, else the manifest."""
        dates = [record.get("date") or "" for record in self.records]
        done = [date for date, record in zip(dates, self.records, strict=True) if record["status"] == "done"]
        if done and all(map(_DATE.fullmatch, done)):
            return np.argsort(dates, kind="stable"), "by the dates of the tests"
        return np.arange(len(dates)), "as the manifest lists them"

    @cached_property
    def process(self) -> dict[str, Process]:
        """Control chart, drift and capability of each quantity, in the unit of its column; none of a fit's quality."""
        bounds, (order, _) = self.limits.bounds if self.limits else {}, self.order
        named, found = [self.rows[at].subgroup or "" for at in order], {}
        for name, figures in self.figures.items():
            factor, open_ = self.quantities[name].tabled.factor, (-np.inf, np.inf)
            values, errors = (each[order] * factor for each in (figures[0], _errors(figures)))
            apart = np.isin(order, [each["row"] - 1 for each in self.differ if name in each["by"]])
            low, high = bounds[name].stated if name in bounds and name not in _OF_FIT else open_
            groups, limits = named if all(named) else [], (low * factor, high * factor)
            found[name] = process(values, errors, apart, limits, groups, len(self.figures))
        return found

    @cached_property
    def curve(self) -> dict[str, Array]:
        """|K| as measured at each step of the sweep that most bushings share, by header, (n,), NaN where it was not
        tested; none where fewer than five were tested alike."""
        curves = [record.get("curve") or {} for record in self.records]
        common = Counter(map(tuple, filter(None, curves))).most_common(1)
        found = {}
        for name in common[0][0] if common and common[0][1] >= FEWEST else ():
            written = at_point(parse_point(name), STIFFNESS)
            values = np.array([curve.get(name, np.nan) for curve in curves])
            found[f"measured {written.header}"] = written.factor * values
        return found

    @cached_property
    def off(self) -> Array:
        """How far each curve is off the median as a whole, relative, (n,): geometric mean over its points."""
        values = np.log([*self.curve.values()])
        return np.expm1(np.mean(values - np.nanmedian(values, axis=1, keepdims=True), axis=0))

    @cached_property
    def compared(self) -> dict[str, tuple[Array, Array]]:
        """Robust z of each quantity but those of the fit, and its probability, (n,) each, by name.

        Of a parameter at rest on a bound, which its tests leave open, nothing is told.
        """
        found = {}
        for name in (name for name in self.quantities if name in self.figures and name not in _OF_FIT):
            open_ = [name in record.get("at_bound", {}) for record in self.records]
            figures = self.figures[name]
            found[name] = robust_z(np.where(open_, np.nan, figures[0]), _errors(figures))
        if self.curve:
            found["measured stiffness"] = robust_z(self.off, np.full(len(self.rows), np.nan))
        return {name: both for name, both in found.items() if np.isfinite(both[0]).any()}

    @cached_property
    def differ(self) -> list[Differing]:
        """Bushings that differ by more than chance, in the order of the table."""
        names, found = list(self.compared), list[Differing]()
        z, p = np.array([*self.compared.values()]).reshape(-1, 2, len(self.rows)).swapaxes(0, 1)
        p[np.isfinite(z)] = holm(p[np.isfinite(z)].tolist())
        for at in np.flatnonzero((p < LEVEL).any(axis=0)).tolist():
            sure = {name: round(float(z[k, at]), 2) for k, name in enumerate(names) if p[k, at] < LEVEL}
            by = dict(sorted(sure.items(), key=lambda each: (not is_parameter(each[0]), -abs(each[1]))))
            words = "; ".join(f"{name} {number(size, 2, '+')} std dev" for name, size in by.items())
            found.append({"name": self.rows[at].name, "row": at + 1, "by": by, "p": p[:, at].min(), "words": words})
        return found

    @property
    def least_told(self) -> float | None:
        """Standard deviations from which on a bushing is told to differ; None where none can be."""
        counts = [int(np.isfinite(z).sum()) for z, _ in self.compared.values()]
        chance = 1.0 - LEVEL / (2.0 * max(sum(counts), 1))
        return float(stdtrit(EFFICIENCY * (max(counts) - 1), chance)) if counts else None

    @property
    def notes(self) -> list[str]:
        """Drift, and subgroups that are not charted."""
        listed, count = sum(bool(row.subgroup) for row in self.rows), len(self.rows)
        some = f"subgroup is stated of {listed} of {count} bushings: individuals are charted"
        said = [some] if 0 < listed < count else []
        for name, each in self.process.items():
            if (drift := each["drift"]) and drift[3] < LEVEL:
                change, low, high = (number(size, 3, "+") for size in drift[:3])
                words = f"{change} {self.quantities[name].tabled.unit} ({low} to {high})"
                said.append(f"{name} drifts from the first bushing to the last, {self.order[1]}: {words}")
        return said

    @property
    def columns(self) -> dict[str, Array]:
        """The columns that end the table: words, order of test, robust z, and the curve as measured, (n,) each."""
        words, place = np.full(len(self.rows), "", dtype=object), np.empty(len(self.rows))
        words[[each["row"] - 1 for each in self.differ]] = [each["words"] for each in self.differ]
        place[self.order[0]] = np.arange(1.0, len(self.rows) + 1.0)
        return {
            "campaign name": np.array([record.get("campaign_name", "") for record in self.records], dtype=object),
            "subgroup": np.array([row.subgroup or "" for row in self.rows], dtype=object),
            "differs in": words,
            "order of test [-]": place,
            **{f"robust z of {name} [-]": z for name, (z, _) in self.compared.items()},
            **({"measured stiffness off the median [%]": 100.0 * self.off} if self.curve else {}),
            **self.curve,
        }


#: Names of the quantities that tell of a fit, not of a bushing.
_OF_FIT = {quantity.name for quantity in OF_FIT.values()}


def _errors(figures: Array) -> Array:
    """Standard errors of a quantity, from its 95 % interval where they are not told, (n,)."""
    return np.where(np.isfinite(figures[3]), figures[3], (figures[2] - figures[1]) / (2.0 * Z95))
