"""The results of a batch: the document of `batch.json`, the table, the picture and the JUnit report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bushfit.batch.comparison import FEWEST, capability, find_outliers, smallest_deviation
from bushfit.batch.document import RowFile
from bushfit.batch.limits import Judgement, Limits, describe_poor_fit, judge_part, resolve_limits
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import FIT_QUALITY, STIFFNESS, Quantity, list_quantities, parse_point, point_quantity
from bushfit.batch.row import RowTask
from bushfit.batch.store import ROWS_FOLDER
from bushfit.effects import is_parameter
from bushfit.effects.contract import Array
from bushfit.model.covariance import Z95
from bushfit.prediction.caveats import BEYOND
from bushfit.reduction.arrays import scatter
from bushfit.report.batch_document import BatchFile, PartTable, QuantityTable
from bushfit.report.results import Formats
from bushfit.report.tables import BETWEEN
from bushfit.units import number
from bushfit.validation import to_json_data

if TYPE_CHECKING:
    import pandas as pd

    from bushfit.report.plots.batch import Panel

#: Endings of the columns of a quantity, with the row of `BatchResult.figures` that they show.
_PARAMETER_COLUMNS = {"": 0, ", std error": 3, ", low": 1, ", high": 2}
_POINT_COLUMNS = {"": 0, ", low": 1, ", high": 2}
#: Name of the measured curve among the quantities that are compared.
_CURVE = "measured stiffness"
#: Names listed in a sentence at most.
_NAMES_LISTED = 10


@dataclass(frozen=True)
class BatchPlan:
    """What a batch is to do.

    Args:
        title: of the batch.
        rows: its parts.
        task: the work on each row.
        limits: to judge the parts by; None without.
        junit: file of a JUnit report; None without.
        formats: how the table and the picture of the whole are written.
    """

    title: str
    rows: Sequence[Row]
    task: RowTask
    limits: Limits | None
    junit: Path | None
    formats: Formats


@dataclass(frozen=True, eq=False)
class BatchResult:
    """Results of all rows of a batch; n is their number.

    Args:
        plan: the batch.
        records: of the rows, in the order of the manifest.
        kept: how many were kept from an earlier run.
        seconds: that the run took [s].
        notes: on results of an earlier batch in the folder.
    """

    plan: BatchPlan
    records: Sequence[RowFile]
    kept: int
    seconds: float
    notes: Sequence[str] = ()

    @cached_property
    def figures(self) -> dict[str, Array]:
        """Value, low and high end of the 95 % interval, and standard error by quantity [SI], (4, n); NaN if unknown."""
        figures = dict[str, Array]()
        for index, record in enumerate(self.records):
            for name, estimate in record.quantities.items():
                column = figures.setdefault(name, np.full((4, len(self.records)), np.nan))
                numbers = (estimate.value, estimate.low, estimate.high, estimate.stderr)
                column[:, index] = np.array(numbers, dtype=float)
        return figures

    @cached_property
    def quantities(self) -> dict[str, Quantity]:
        """All quantities of the batch by name."""
        return list_quantities(self.figures, self.plan.task.points)

    @cached_property
    def poor_fits(self) -> list[str]:
        """How far the model of each part misses its tests, in words; empty if it does not."""
        return [describe_poor_fit(record, self.plan.limits) for record in self.records]

    @cached_property
    def allowed(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest allowed value of each quantity with limits [SI]."""
        return self._resolved[0]

    @cached_property
    def _resolved(self) -> tuple[dict[str, tuple[float, float]], list[str]]:
        values = {name: figures[0] for name, figures in self.figures.items()}
        return resolve_limits(self.plan.limits, values) if self.plan.limits else ({}, [])

    @cached_property
    def judgements(self) -> list[Judgement | None]:
        """Result of each part against the limits; None without limits, and for a row that failed."""
        limits = self.plan.limits
        if limits is None:
            return [None] * len(self.records)
        return [
            judge_part(record, limits, self.allowed, self.quantities) if record.status == "done" else None
            for record in self.records
        ]

    @cached_property
    def curves(self) -> dict[str, Array]:
        """Measured |K| at each point of the curve that most parts share, by column, (n,), NaN where not measured.

        Empty if fewer than five parts share one.
        """
        shared = Counter(tuple(record.curve) for record in self.records if record.curve).most_common(1)
        curves = dict[str, Array]()
        for point in shared[0][0] if shared and shared[0][1] >= FEWEST else ():
            column = point_quantity(parse_point(point), STIFFNESS)
            values = np.array([record.curve.get(point, np.nan) for record in self.records])
            curves[f"measured {column.header}"] = column.factor * values
        return curves

    @cached_property
    def curve_deviation(self) -> Array:
        """Deviation of each measured curve from the median, relative, geometric mean over its points, (n,)."""
        values = np.log([*self.curves.values()])
        return np.asarray(np.expm1(np.mean(values - np.nanmedian(values, axis=1, keepdims=True), axis=0)))

    @cached_property
    def compared(self) -> dict[str, tuple[Array, Array]]:
        """Values and standard errors that the parts are compared by, by name, (n,) each.

        Not compared are the quality of a fit, parameters at a bound, and what a poor fit determines.
        """
        poor, compared = np.array([bool(reason) for reason in self.poor_fits]), dict[str, tuple[Array, Array]]()
        for name in (name for name in self.quantities if name in self.figures and name not in _FIT_NAMES):
            value, low, high, stderr = self.figures[name]
            at_bound = np.array([name in record.at_bound for record in self.records])
            errors = np.where(np.isfinite(stderr), stderr, (high - low) / (2.0 * Z95))
            compared[name] = np.where(at_bound | poor, np.nan, value), errors
        if self.curves:
            compared[_CURVE] = self.curve_deviation, np.full(len(self.records), np.nan)
        return {name: pair for name, pair in compared.items() if np.isfinite(pair[0]).sum() >= FEWEST}

    @cached_property
    def outliers(self) -> tuple[dict[str, Array], dict[str, Array]]:
        """Deviations by quantity in standard deviations, and which parts differ, as `find_outliers` returns them."""
        return find_outliers(self.compared)

    @cached_property
    def document(self) -> BatchFile:
        """The results as `batch.json` has them."""
        parts = [self._part(index) for index in range(len(self.records))]
        names = {
            status: [part.name for part in parts if part.result == status]
            for status in ("conditional pass", "not judged", "conditional fail", "fail")
        }
        missed = [part.name for part in parts if part.misses]
        failed = [part.name for part in parts if part.error]
        differ = [part.name for part in parts if part.deviations]
        count = int(max((np.isfinite(values).sum() for values, _ in self.compared.values()), default=0))
        return BatchFile(
            title=self.plan.title,
            rows=len(parts),
            done=len(parts) - len(failed),
            failed=failed,
            limits=Counter(part.result for part in parts if part.result),
            missed=missed,
            conditional=[name for name in names["conditional pass"] if name not in missed],
            not_judged=names["not judged"],
            differ=differ,
            headline=self._headline(len(parts), missed, names["not judged"], failed, differ),
            warnings=self._warnings(),
            detectable=smallest_deviation(count, len(self.compared)),
            quantities={column.header: self._quantity(name, column) for name, column in self._columns.items()},
            curve_points=[*self.curves],
            parts=parts,
        )

    @property
    def summary(self) -> Mapping[str, Any]:
        """The document with the effort of this run, as `--json` prints it."""
        whole = replace(self.document, kept=self.kept, seconds=round(self.seconds, 3))
        return cast("Mapping[str, Any]", to_json_data(whole, BatchFile))

    @property
    def _columns(self) -> dict[str, Quantity]:
        """Quantities that a part has, in the unit of their column, by name."""
        return {name: quantity.tabled for name, quantity in self.quantities.items() if name in self.figures}

    def _quantity(self, name: str, column: Quantity) -> QuantityTable:
        values = self.figures[name][0] * column.factor
        known = values[np.isfinite(values)]
        median, sigma = scatter(known)
        detectable = None
        if name in self.compared:
            usual = values[np.isfinite(self.compared[name][0]) & ~self.outliers[1][name]]
            limit = smallest_deviation(int(np.isfinite(self.compared[name][0]).sum()), len(self.compared))
            detectable = limit and limit * float(usual.std(ddof=1))
        low, high = (end * column.factor for end in self.allowed.get(name, (-np.inf, np.inf)))
        fixed = self.plan.limits.bounds[name].fixed if self.plan.limits and name in self.allowed else (-np.inf, np.inf)
        fixed = fixed if name not in _FIT_NAMES else (-np.inf, np.inf)
        cp, cpk = capability(known, *(end * column.factor for end in fixed))
        ends = (end if np.isfinite(end) else None for end in (low, high))
        least, most = ends
        return QuantityTable(
            parts=known.size, median=median, sigma=sigma, detectable=detectable, min=least, max=most, cp=cp, cpk=cpk
        )

    def _part(self, index: int) -> PartTable:
        row, record, judgement = self.plan.rows[index], self.records[index], self.judgements[index]
        deviations, differs = self.outliers
        beyond = {name: float(deviations[name][index]) for name in differs if differs[name][index]}
        beyond = dict(sorted(beyond.items(), key=lambda item: (not is_parameter(item[0]), -abs(item[1]))))
        values = [self.figures[name][0, index] * column.factor for name, column in self._columns.items()]
        curve = [float(column[index]) for column in self.curves.values()]
        return PartTable(
            name=row.name,
            folder=f"{ROWS_FOLDER}/{row.folder}" if record.status == "done" else "",
            error=" ".join(record.error.split()),
            result=judgement.result if judgement else None,
            misses=judgement.misses if judgement else {},
            doubtful=judgement.doubtful if judgement else {},
            poor_fit=self.poor_fits[index],
            deviations={name: round(z, 2) for name, z in beyond.items()},
            differs="; ".join(f"{name} {self._relative(name, index)}" for name in beyond),
            warnings=record.warnings,
            labels={name: texts[index] for name, texts in self._labels.items()},
            values=[float(value) if np.isfinite(value) else None for value in values],
            curve=curve if curve and np.isfinite(curve).all() else None,
        )

    def _relative(self, name: str, index: int) -> str:
        """Deviation of a part from the median of the batch in per cent."""
        if name == _CURVE:
            return f"{number(100.0 * self.curve_deviation[index], 3, '+')} %"
        values = self.figures[name][0]
        median = float(np.nanmedian(values))
        return f"{number(100.0 * (values[index] / median - 1.0), 3, '+')} %" if median else "above zero"

    @cached_property
    def _labels(self) -> dict[str, list[str]]:
        """Texts of each row in the table, by column."""
        records, labels = self.records, dict[str, list[str]]()
        if any(row.settings.diagnoses for row in self.plan.rows):
            labels["verdict"] = [record.verdict or "" for record in records]
            labels["named effects"] = [", ".join(record.effects) for record in records]
            labels["cannot be told from"] = [", ".join(record.alternatives) for record in records]
        bounds = [record.at_bound.items() for record in records]
        labels["on a bound"] = [", ".join(f"{name} ({end})" for name, end in ends) for ends in bounds]
        labels["campaign name"] = [record.campaign_name for record in records]
        labels["subgroup"] = [row.subgroup or "" for row in self.plan.rows]
        return labels

    def _headline(
        self, count: int, missed: Sequence[str], unjudged: Sequence[str], failed: Sequence[str], differ: Sequence[str]
    ) -> str:
        parts = "1 part" if count == 1 else f"{count} parts"
        if self.plan.limits is None:
            first = f"{count - len(failed)} of {parts} evaluated" if failed else f"{parts} evaluated"
        elif missed:
            first = f"{len(missed)} of {parts} fail{'s' * (len(missed) == 1)}"
        else:
            first = f"{count - len(failed) - len(unjudged)} of {parts} pass"
        clauses = [first]
        clauses += [f"{len(unjudged)} not judged: poor fit"] if unjudged else []
        clauses += [f"{len(failed)} could not be evaluated"] if failed else []
        clauses += [f"{len(differ)} differ{'s' * (len(differ) == 1)} from the others"] if differ else []
        return "; ".join(clauses)

    def _warnings(self) -> list[str]:
        """Warnings of the whole batch, the important ones first."""
        names = [row.name for row in self.plan.rows]
        beyond = [any(BEYOND in line for line in record.warnings) for record in self.records]
        at_bound = dict[str, list[str]]()
        for name, record in zip(names, self.records, strict=True):
            for parameter in record.at_bound:
                at_bound.setdefault(parameter, []).append(name)
        poor = [name for name, reason in zip(names, self.poor_fits, strict=True) if reason]
        warnings = []
        if poor:
            judged = ", and their limits are judged on measured points where there are some" if self.plan.limits else ""
            warnings.append(f"the model misses the tests of {_listed(poor)}: do not use its parameters{judged}")
        warnings += self._resolved[1]
        if at_bound:
            clauses = [f"{parameter} of {_listed(parts)}" for parameter, parts in at_bound.items()]
            warnings.append(f"at a bound of the fit, which the tests do not determine: {'; '.join(clauses)}")
        if any(beyond):
            outside = [name for name, is_beyond in zip(names, beyond, strict=True) if is_beyond]
            warnings.append(
                f"a point is outside the tested range, where no test confirms the model: {_listed(outside)}"
            )
        return [*warnings, *self.notes]

    def table(self) -> pd.DataFrame:
        """A row for each part, in the order of the manifest, with a unit in every header.

        A parameter has the unit of its typical value, so that the headers of two batches agree.
        """
        import pandas as pd

        rows, judgements, parts = self.plan.rows, self.judgements, self.document.parts
        texts: dict[str, Sequence[str]] = {
            "name": [row.name for row in rows],
            "campaign": [row.listed for row in rows],
            "folder": [part.folder for part in parts],
            "status": [record.status for record in self.records],
            "error": [part.error for part in parts],
        }
        if self.plan.limits:
            texts["limits"] = [judged.result if judged else "" for judged in judgements]
            texts["out of limits"] = ["; ".join(judged.misses.values()) if judged else "" for judged in judgements]
            texts["on the edge"] = ["; ".join(judged.doubtful.values()) if judged else "" for judged in judgements]
        last = ("on a bound", "campaign name", "subgroup")
        texts |= {name: column for name, column in self._labels.items() if name not in last}
        numbers, unknown = dict[str, Array](), np.full((4, len(self.records)), np.nan)
        for name, quantity in self.quantities.items():
            endings = _PARAMETER_COLUMNS if is_parameter(name) else {"": 0} if name in _FIT_NAMES else _POINT_COLUMNS
            column = quantity.tabled
            for ending, line in endings.items():
                numbers[column.header + ending] = self.figures.get(name, unknown)[line] * column.factor
        ending_texts = {
            "on a bound": self._labels["on a bound"],
            "warnings": [BETWEEN.join(record.warnings) for record in self.records],
            "campaign name": self._labels["campaign name"],
            "subgroup": self._labels["subgroup"],
            "differs in": [part.differs for part in parts],
            "poor fit": self.poor_fits,
        }
        deviations = {f"robust z of {name} [-]": z for name, z in self.outliers[0].items()}
        curve = {"measured stiffness off the median [%]": 100.0 * self.curve_deviation} if self.curves else {}

        def as_objects(columns: Mapping[str, Sequence[str]]) -> dict[str, pd.Series[str]]:
            return {name: pd.Series(cells, dtype=object) for name, cells in columns.items()}

        return pd.DataFrame(
            {**as_objects(texts), **numbers, **as_objects(ending_texts), **deviations, **curve, **self.curves}
        )

    def panels(self) -> list[Panel]:
        """Panels of the picture: quantities with limits, and those that at least three parts have."""
        from bushfit.report.plots.batch import Panel

        panels = []
        for name, quantity in self.quantities.items():
            figures, allowed = self.figures.get(name, np.full((4, 1), np.nan)), self.allowed.get(name, ())
            known = np.isfinite(figures[0])
            if known.sum() >= (1 if allowed else 3):
                shown = quantity.displayed(float(np.median(figures[0, known])))
                missed = {
                    k for k, judged in enumerate(self.judgements) if judged and name in judged.misses and known[k]
                }
                limits, ends = tuple(limit * shown.factor for limit in allowed), figures[1:3] * shown.factor
                interval = ends if np.isfinite(ends).all(axis=0).any() else None
                panels.append(Panel(shown.header, figures[0] * shown.factor, limits, missed, interval))
        return panels

    def junit(self) -> bytes:
        """JUnit report for continuous integration: an error for a row that failed, a failure for a missed limit."""
        from junitparser import Error, Failure, JUnitXml, TestCase, TestSuite

        suite = TestSuite(self.plan.title)
        for part, record in zip(self.document.parts, self.records, strict=True):
            case = TestCase(_printable(part.name), suite.name, record.seconds)
            reasons = [*part.misses.values(), *(part.doubtful.values() if part.result == "not judged" else ())]
            if record.error or reasons:
                text = _printable(record.error or "\n".join(reasons))
                line = text.partition("\n")[0] if record.error else "; ".join(text.splitlines())
                result = Error(line, "failed") if record.error else Failure(line, "limits")
                result.text = text
                case.result = [result]
            suite.add_testcase(case)
        report = JUnitXml("bushfit batch")
        report.add_testsuite(suite)
        report.update_statistics()  # type: ignore[no-untyped-call]
        return b'<?xml version="1.0" encoding="utf-8"?>\n' + report.tostring()  # type: ignore[no-untyped-call]


_FIT_NAMES = frozenset(quantity.name for quantity in FIT_QUALITY.values())


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMES_LISTED} more" if len(names) > _NAMES_LISTED else ""
    return ", ".join(names[:_NAMES_LISTED]) + more


def _printable(text: str) -> str:
    """The text without control characters, which XML cannot hold."""
    return "".join(letter if letter.isprintable() or letter == "\n" else " " for letter in text)
