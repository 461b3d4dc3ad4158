"""The results of a batch: the document of `batch.json`, the table and the picture."""

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
from bushfit.batch.quantities import FIT_NAMES, STIFFNESS, PartQuantity, list_quantities, parse_point, point_quantity
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

#: Endings of the columns of a quantity, with the row of `BatchResult.figures` that they show.
_PARAMETER_COLUMNS = {"": 0, ", std error": 3, ", low": 1, ", high": 2}
_POINT_COLUMNS = {"": 0, ", low": 1, ", high": 2}
#: Name of the measured curve among the quantities that are compared.
_CURVE = "measured stiffness"
#: Names listed in a sentence at most.
_NAMES_LISTED = 10


@dataclass(frozen=True)
class BatchPlan:
    """Settings of a batch.

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
        kept_count: number of rows kept from an earlier run.
        seconds: that the run took [s].
        figures: value, low and high end of the 95 % interval, and standard error by quantity [SI], (4, n); NaN if
            unknown.
        quantities: all quantities of the batch by name.
        allowed: lowest and highest allowed value of each quantity with limits [SI].
        judgements: result of each part against the limits; None without limits, and for a row that failed.
        poor_fits: how far the model of each part misses its tests, in words; empty if it does not.
        curves: measured |K| at each point of the curve that most parts share, by column, (n,), NaN where not measured.
        curve_deviation: of each measured curve from the median, relative, geometric mean over its points, (n,).
        compared: values and standard errors that the parts are compared by, by name, (n,) each.
        deviations: of each part from the others, in their standard deviations, by name, (n,).
        outliers: whether each part differs from the others beyond chance, by name, (n,).
        notes: on limits that were not judged and on results of an earlier batch.
    """

    plan: BatchPlan
    records: Sequence[RowFile]
    kept_count: int
    seconds: float
    figures: Mapping[str, Array]
    quantities: Mapping[str, PartQuantity]
    allowed: Mapping[str, tuple[float, float]]
    judgements: Sequence[Judgement | None]
    poor_fits: Sequence[str]
    curves: Mapping[str, Array]
    curve_deviation: Array
    compared: Mapping[str, tuple[Array, Array]]
    deviations: Mapping[str, Array]
    outliers: Mapping[str, Array]
    notes: Sequence[str]

    @classmethod
    def from_records(
        cls, plan: BatchPlan, records: Sequence[RowFile], kept_count: int, seconds: float, notes: Sequence[str]
    ) -> BatchResult:
        """Judge the parts by the limits and compare them with each other.

        Args:
            plan: the batch.
            records: of the rows, in the order of the manifest.
            kept_count: number of rows kept from an earlier run.
            seconds: that the run took [s].
            notes: on results of an earlier batch in the folder.

        Returns:
            The results, with each part's judgement and its deviation from the other parts.
        """
        figures, limits = dict[str, Array](), plan.limits
        for index, record in enumerate(records):
            for name, estimate in record.quantities.items():
                column = figures.setdefault(name, np.full((4, len(records)), np.nan))
                numbers = (estimate.value, estimate.low, estimate.high, estimate.stderr)
                column[:, index] = np.array(numbers, dtype=float)
        quantities = list_quantities(figures, plan.task.points)
        values = {name: column[0] for name, column in figures.items()}
        allowed, idle = resolve_limits(limits, values) if limits else ({}, [])
        judgements = [
            judge_part(record, limits, allowed, quantities) if limits and record.status == "done" else None
            for record in records
        ]
        poor_fits = [describe_poor_fit(record, limits) for record in records]
        curves, shared = dict[str, Array](), Counter(tuple(record.curve) for record in records if record.curve)
        points, sharing = max(shared.items(), key=lambda item: item[1], default=((), 0))
        for point in points if sharing >= FEWEST else ():  # measured |K| at the points that most parts have
            header = point_quantity(parse_point(point), STIFFNESS)
            measured = np.array([record.curve.get(point, np.nan) for record in records])
            curves[f"measured {header.header}"] = header.factor * measured
        logarithms = np.log([*curves.values()])
        deviation = logarithms - np.nanmedian(logarithms, axis=1, keepdims=True) if curves else np.empty((0, 0))
        curve_deviation = np.expm1(deviation.mean(axis=0)) if curves else np.full(len(records), np.nan)
        # not compared are the quality of a fit, parameters at a bound, and what a poor fit determines
        compared, poor = dict[str, tuple[Array, Array]](), np.array([bool(reason) for reason in poor_fits])
        for name in (name for name in quantities if name in figures and name not in FIT_NAMES):
            value, low, high, stderr = figures[name]
            at_bound = np.array([name in record.at_bound for record in records])
            errors = np.where(np.isfinite(stderr), stderr, (high - low) / (2.0 * Z95))
            compared[name] = np.where(at_bound | poor, np.nan, value), errors
        compared[_CURVE] = curve_deviation, np.full(len(records), np.nan)
        compared = {name: pair for name, pair in compared.items() if np.isfinite(pair[0]).sum() >= FEWEST}
        return cls(
            plan, records, kept_count, seconds, figures, quantities, allowed, judgements, poor_fits, curves,
            curve_deviation, compared, *find_outliers(compared), [*idle, *notes],
        )  # fmt: skip

    @cached_property
    def document(self) -> BatchFile:
        """The results as `batch.json` has them."""
        columns = {name: quantity.tabled for name, quantity in self.quantities.items() if name in self.figures}
        labels = self.labels
        parts = [self.part_table(index, columns, labels) for index in range(len(self.records))]
        count = int(max((np.isfinite(values).sum() for values, _ in self.compared.values()), default=0))
        names = {
            "failed": [part.name for part in parts if part.error],
            "missed": [part.name for part in parts if part.misses],
            "conditional": [part.name for part in parts if part.result == "conditional pass" and not part.misses],
            "not judged": [part.name for part in parts if part.result == "not judged"],
            "differ": [part.name for part in parts if part.deviations],
        }
        return BatchFile(
            title=self.plan.title,
            rows=len(parts),
            done=len(parts) - len(names["failed"]),
            limits=Counter(part.result for part in parts if part.result),
            failed=names["failed"],
            missed=names["missed"],
            conditional=names["conditional"],
            not_judged=names["not judged"],
            differ=names["differ"],
            headline=self.headline(names),
            warnings=self.warnings(),
            detectable=smallest_deviation(count, len(self.compared)),
            quantities={column.header: self.quantity_table(name, column) for name, column in columns.items()},
            curve_points=[*self.curves],
            parts=parts,
        )

    @property
    def summary(self) -> Mapping[str, Any]:
        """The document with the effort of this run, as `--json` prints it."""
        whole = replace(self.document, kept=self.kept_count, seconds=round(self.seconds, 3))
        return cast("Mapping[str, Any]", to_json_data(whole, BatchFile))

    def quantity_table(self, name: str, column: PartQuantity) -> QuantityTable:
        """Compute the scatter, limits and capability of one quantity over the parts.

        Args:
            name: of the quantity.
            column: the quantity in the unit of its column.

        Returns:
            Entry of `batch.json`, in the unit of the column.
        """
        values = self.figures[name][0] * column.factor
        finite_values = values[np.isfinite(values)]
        median, sigma = scatter(finite_values)
        detectable = None
        if name in self.compared:
            usual = values[np.isfinite(self.compared[name][0]) & ~self.outliers[name]]
            limit = smallest_deviation(int(np.isfinite(self.compared[name][0]).sum()), len(self.compared))
            detectable = limit and limit * float(usual.std(ddof=1))
        low, high = (end * column.factor for end in self.allowed.get(name, (-np.inf, np.inf)))
        fixed = self.plan.limits.bounds[name].fixed if self.plan.limits and name in self.allowed else (-np.inf, np.inf)
        fixed = fixed if name not in FIT_NAMES else (-np.inf, np.inf)
        cp, cpk = capability(finite_values, *(end * column.factor for end in fixed))
        minimum, maximum = (end if np.isfinite(end) else None for end in (low, high))
        return QuantityTable(
            parts=finite_values.size,
            median=median,
            sigma=sigma,
            detectable=detectable,
            min=minimum,
            max=maximum,
            cp=cp,
            cpk=cpk,
        )

    def part_table(
        self, index: int, columns: Mapping[str, PartQuantity], labels: Mapping[str, Sequence[str]]
    ) -> PartTable:
        """Make the entry of one part in `batch.json`.

        Args:
            index: number of the part.
            columns: quantities by name, in the units of their columns.
            labels: texts of all parts, by column.

        Returns:
            Result, deviations from the other parts, and values.
        """
        row, record, judgement = self.plan.rows[index], self.records[index], self.judgements[index] or Judgement(None)
        outlying = {
            name: float(self.deviations[name][index]) for name, differs in self.outliers.items() if differs[index]
        }
        outlying = dict(sorted(outlying.items(), key=lambda item: (not is_parameter(item[0]), -abs(item[1]))))
        relative = {_CURVE: self.curve_deviation[index]}
        for name in outlying.keys() - {_CURVE}:
            relative[name] = self.figures[name][0, index] / np.nanmedian(self.figures[name][0]) - 1.0
        values = [self.figures[name][0, index] * column.factor for name, column in columns.items()]
        curve = [float(column[index]) for column in self.curves.values()]
        return PartTable(
            name=row.name,
            folder=f"{ROWS_FOLDER}/{row.folder}" if record.status == "done" else "",
            error=" ".join(record.error.split()),
            result=judgement.result,
            misses=judgement.misses,
            doubtful=judgement.doubtful,
            poor_fit=self.poor_fits[index],
            deviations={name: round(z, 2) for name, z in outlying.items()},
            differs="; ".join(f"{name} {number(100.0 * relative[name], 3, '+')} %" for name in outlying),
            warnings=record.warnings,
            labels={name: texts[index] for name, texts in labels.items()},
            values=[float(value) if np.isfinite(value) else None for value in values],
            curve=curve if curve and np.isfinite(curve).all() else None,
        )

    @property
    def labels(self) -> dict[str, list[str]]:
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

    def headline(self, names: Mapping[str, Sequence[str]]) -> str:
        """Write the sentence on the number of parts that pass, fail or differ.

        Args:
            names: of the parts that failed, missed a limit, were not judged or differ, by kind.

        Returns:
            Such as "2 of 40 parts fail; 1 differs from the others".
        """
        count, missed, failed = len(self.records), len(names["missed"]), len(names["failed"])
        parts = "1 part" if count == 1 else f"{count} parts"
        if self.plan.limits is None:
            clauses = [f"{count - failed} of {parts} evaluated" if failed else f"{parts} evaluated"]
        elif missed:
            clauses = [f"{missed} of {parts} fail{'s' * (missed == 1)}"]
        else:
            clauses = [f"{count - failed - len(names['not judged'])} of {parts} pass"]
        counted = {
            "not judged: poor fit": len(names["not judged"]),
            "could not be evaluated": failed,
            "differ from the others": len(names["differ"]),
        }
        clauses += [f"{number} {words}" for words, number in counted.items() if number]
        return "; ".join(clauses).replace("1 differ from", "1 differs from")

    def warnings(self) -> list[str]:
        """Warnings of the whole batch, the important ones first.

        Returns:
            Sentences that name the parts.
        """
        names = [row.name for row in self.plan.rows]
        outside = [any(BEYOND in line for line in record.warnings) for record in self.records]
        at_bound = dict[str, list[str]]()
        for name, record in zip(names, self.records, strict=True):
            for parameter in record.at_bound:
                at_bound.setdefault(parameter, []).append(name)
        poor = [name for name, reason in zip(names, self.poor_fits, strict=True) if reason]
        warnings = []
        if poor:
            judged = "; their limits are judged on measured points, if such points exist" if self.plan.limits else ""
            warnings.append(f"the model misses the tests of {_listed(poor)}: do not use their parameters{judged}")
        warnings += self.notes
        if at_bound:
            clauses = [f"{parameter} of {_listed(parts)}" for parameter, parts in at_bound.items()]
            warnings.append(f"at a bound of the fit, because the tests do not determine them: {'; '.join(clauses)}")
        if any(outside):
            parts = [name for name, is_outside in zip(names, outside, strict=True) if is_outside]
            warnings.append(f"a point is outside the tested range, where no test confirms the model: {_listed(parts)}")
        return warnings

    def table(self) -> pd.DataFrame:
        """A row for each part, in the order of the manifest, with a unit in every header.

        A parameter has the unit of its typical value, so that the headers of two batches agree.

        Returns:
            Table with columns of texts, quantities, remarks, deviations and the measured curve.
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
            texts["limits"] = [(judged and judged.result) or "" for judged in judgements]
            texts["out of limits"] = ["; ".join(judged.misses.values()) if judged else "" for judged in judgements]
            texts["on the edge"] = ["; ".join(judged.doubtful.values()) if judged else "" for judged in judgements]
        last = ("on a bound", "campaign name", "subgroup")
        texts |= {name: column for name, column in self.labels.items() if name not in last}
        numbers, unknown = dict[str, Array](), np.full((4, len(self.records)), np.nan)
        for name, quantity in self.quantities.items():
            endings = _PARAMETER_COLUMNS if is_parameter(name) else {"": 0} if name in FIT_NAMES else _POINT_COLUMNS
            column = quantity.tabled
            for ending, line in endings.items():
                numbers[column.header + ending] = self.figures.get(name, unknown)[line] * column.factor
        ending_texts = {
            "on a bound": self.labels["on a bound"],
            "warnings": [BETWEEN.join(record.warnings) for record in self.records],
            "campaign name": self.labels["campaign name"],
            "subgroup": self.labels["subgroup"],
            "differs in": [part.differs for part in parts],
            "poor fit": self.poor_fits,
        }
        deviations = {f"robust z of {name} [-]": z for name, z in self.deviations.items()}
        curve = {"measured stiffness off the median [%]": 100.0 * self.curve_deviation} if self.curves else {}

        def as_objects(columns: Mapping[str, Sequence[str]]) -> dict[str, pd.Series[str]]:
            return {name: pd.Series(cells, dtype=object) for name, cells in columns.items()}

        return pd.DataFrame(
            {**as_objects(texts), **numbers, **as_objects(ending_texts), **deviations, **curve, **self.curves}
        )


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMES_LISTED} more" if len(names) > _NAMES_LISTED else ""
    return ", ".join(names[:_NAMES_LISTED]) + more
