"""Results of a batch: the document of `batch.json`, the table and the picture."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bushfit.batch.comparison import FEWEST, capability, find_outliers, reference_parts, smallest_deviation
from bushfit.batch.document import Estimate, RowFile
from bushfit.batch.limits import Limits, describe_poor_fit, judge_part, resolve_limits
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import (
    FIT_NAMES,
    FIT_QUALITY,
    STIFFNESS,
    PartQuantity,
    list_quantities,
    point_quantity,
)
from bushfit.batch.row import RowTask
from bushfit.batch.store import ROWS_FOLDER
from bushfit.caveat import Caveat, to_entries
from bushfit.effects import is_parameter
from bushfit.effects.contract import Array
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.fitting.model_error import BEYOND_NOISE
from bushfit.geometry.point import parse_point
from bushfit.model.covariance import Z95
from bushfit.reduction.arrays import median_and_scatter
from bushfit.report.batch_document import BatchFile, PartTable, QuantityTable
from bushfit.report.results import Formats
from bushfit.units import format_range, number
from bushfit.validation import to_json_data

if TYPE_CHECKING:
    import pandas as pd

#: Suffixes of the column headers of a quantity, and the row of `BatchResult.estimates` in each column.
_PARAMETER_COLUMNS = {"": 0, ", std error": 3, ", low": 1, ", high": 2}
_POINT_COLUMNS = {"": 0, ", low": 1, ", high": 2}
#: Name of the measured curve among the compared quantities.
_CURVE = "measured stiffness"
#: Kinds of warnings on a misfit whose cause a diagnosis may find, and on points outside the tested range.
_MISFITS = {"misfit", "model_error", "unfitted_test_missed"}
_EXTRAPOLATIONS = {"extrapolated_frequency", "extrapolated_strain", "extrapolated_rate", "extrapolated_stroke"}
#: Number of equal digits of all parameters and measures of two fits that shows the same data; two parts never agree.
_SAME_DIGITS = 5
#: Maximum number of names in a sentence.
_NAMES_LISTED = 10


@dataclass(frozen=True)
class BatchPlan:
    """Settings of a batch.

    Args:
        title: title of the batch.
        rows: rows of the batch, one for each part.
        task: function that evaluates a row.
        limits: limits for the parts; None without a limits file.
        junit: path of the JUnit report; None without a report.
        formats: formats of the files of the whole batch.
    """

    title: str
    rows: Sequence[Row]
    task: RowTask
    limits: Limits | None
    junit: Path | None
    formats: Formats


class BatchResult:
    """Results of all n rows of a batch: estimates, and the comparison of the parts with limits and with each other.

    Args:
        plan: settings of the batch.
        records: records of the rows, in the order of the manifest.
        kept_count: number of rows kept from an earlier run.
        seconds: duration of the run [s].
        notes: warnings on results of an earlier batch in the folder.

    Attributes:
        estimates: value, low and high end of the 95 % interval, and standard error of each quantity of the parts [SI]
            by its name, (4, n); numbers that are not known are NaN.
        quantities: parameters, measures of the fit, and stiffness and loss factor at the stated points, by name.
        allowed: lowest and highest allowed value of each quantity with limits [SI].
        is_poor: True for each part with a poor fit (NRMSE above its limit, reduced chi-square of 2 or more), (n,).
        curves: columns of measured |K| for the batch table, by header: a value per part, (n,), NaN if not measured.
            There is a column for each point of the measured stiffness curve that most parts have in common.
        lacks_sweep: True for each evaluated part without a sweep if the other parts have one: its fit is not
            comparable, (n,).
        curve_deviation: relative deviation of |K| of each part from the median of the parts, averaged over the curve,
            (n,).
        compared_values: values and standard errors for the comparison of the parts, by name of the quantity, (n,) each.
            Measures of the fit are left out. Values of poor fits, of parts that lack a sweep, and parameters at a bound
            are NaN, and so are parameters of a model with an unnamed correction, because they contain a part of the
            gap.
        deviations: deviation of each part from the others in standard deviations, by quantity, (n,).
        outliers: mask of the parts that deviate beyond chance, by quantity, (n,).
    """

    def __init__(
        self, plan: BatchPlan, records: Sequence[RowFile], kept_count: int, seconds: float, notes: Sequence[Caveat]
    ) -> None:
        self.plan, self.records, self.kept_count, self.seconds = plan, records, kept_count, seconds
        unknown, numbers = Estimate(np.nan), attrgetter("value", "low", "high", "stderr")
        self.estimates = {
            name: np.array([numbers(record.quantities.get(name, unknown)) for record in records], dtype=float).T
            for name in dict.fromkeys(name for record in records for name in record.quantities)
        }
        self.quantities = list_quantities(self.estimates, plan.task.points)
        values = {name: rows[0] for name, rows in self.estimates.items()}
        self.allowed, limit_notes = resolve_limits(plan.limits, values) if plan.limits else ({}, [])
        self._notes = [*limit_notes, *notes]
        self.is_poor = np.array([bool(describe_poor_fit(record, plan.limits)) for record in records])
        shared, self.curves = Counter(tuple(record.curve) for record in records if record.curve), dict[str, Array]()
        points, sharing = max(shared.items(), key=lambda item: item[1], default=((), 0))
        for point in points if sharing >= FEWEST else ():
            quantity = point_quantity(parse_point(point), STIFFNESS)
            measured = np.array([record.curve.get(point, np.nan) for record in records])
            self.curves[f"measured {quantity.header}"] = quantity.factor * measured
        lacking = [bool(self.curves) and record.status == "done" and not record.curve for record in records]
        self.lacks_sweep, self.curve_deviation = np.array(lacking), np.full(len(records), np.nan)
        if self.curves:
            logarithms = np.log([*self.curves.values()])
            self.curve_deviation = np.expm1((logarithms - np.nanmedian(logarithms, 1, keepdims=True)).mean(axis=0))
        compared = dict[str, tuple[Array, Array]]()
        for name in (name for name in self.quantities if name in self.estimates and name not in FIT_NAMES):
            value, low, high, stderr = self.estimates[name]
            is_unknown = (self.is_poor | self.lacks_sweep) | [
                name in record.at_bound or (is_parameter(name) and UNNAMED in record.effects) for record in records
            ]
            errors = np.where(np.isfinite(stderr), stderr, (high - low) / (2.0 * Z95))
            compared[name] = np.where(is_unknown, np.nan, value), errors
        compared[_CURVE] = self.curve_deviation, np.full(len(records), np.nan)
        self.compared_values = {name: pair for name, pair in compared.items() if np.isfinite(pair[0]).sum() >= FEWEST}
        self.deviations, self.outliers = find_outliers(self.compared_values)

    @cached_property
    def document(self) -> BatchFile:
        """Content of `batch.json`, the JSON file of the whole batch."""
        columns = {name: quantity.in_table_unit for name, quantity in self.quantities.items() if name in self.estimates}
        parts = [self.part_table(index, columns) for index in range(len(self.records))]
        counts = {name: int(np.isfinite(values).sum()) for name, (values, _) in self.compared_values.items()}
        count = max((counts[name] for name in counts if name != _CURVE), default=counts.get(_CURVE, 0))
        failed = [part.name for part in parts if part.error]
        missed = [part.name for part in parts if part.misses]
        not_judged = [part.name for part in parts if part.result == "not judged"]
        differ = [part.name for part in parts if part.deviations]
        total = f"{len(parts)} part{'s' * (len(parts) != 1)}"
        if self.plan.limits is None:
            headline = f"{len(parts) - len(failed)} of {total} evaluated" if failed else f"{total} evaluated"
        elif missed:
            headline = f"{len(missed)} of {total} fail{'s' * (len(missed) == 1)}"
        else:
            headline = f"{len(parts) - len(failed) - len(not_judged)} of {total} pass"
        headline += f"; {len(not_judged)} not judged" if not_judged else ""
        headline += f"; {len(failed)} could not be evaluated" if failed else ""
        headline += f"; {len(differ)} differ{'s' * (len(differ) == 1)} from the others" if differ else ""
        return BatchFile(
            title=self.plan.title,
            rows=len(parts),
            done=len(parts) - len(failed),
            limits=Counter(part.result for part in parts if part.result),
            failed=failed,
            missed=missed,
            conditional=[part.name for part in parts if part.result == "conditional pass" and not part.misses],
            not_judged=not_judged,
            differ=differ,
            headline=headline,
            **to_entries(self.warnings(parts)),
            detectable=smallest_deviation(count, len(self.compared_values)),
            quantities={column.header: self.quantity_table(column) for column in columns.values()},
            curve_points=[*self.curves],
            parts=parts,
        )

    @property
    def summary(self) -> Mapping[str, Any]:
        """Content of `batch.json` with the computing time and the number of kept rows, as `--json` prints it."""
        whole = replace(self.document, kept=self.kept_count, seconds=round(self.seconds, 3))
        return cast("Mapping[str, Any]", to_json_data(whole, BatchFile))

    def quantity_table(self, column: PartQuantity) -> QuantityTable:
        """Summarize one quantity over all parts: median, scatter, limits of the limits file, and process capability.

        Args:
            column: name of the quantity, with the unit of its column in the batch table.

        Returns:
            Entry of the quantity in `batch.json`, in the unit of the column.
        """
        name, values = column.name, self.estimates[column.name][0] * column.factor
        is_known = np.isfinite(values)
        is_usable = is_known & ~(self.is_poor | self.lacks_sweep) if name not in FIT_NAMES else is_known
        known_values, detectable = values[is_usable if is_usable.any() else is_known], None
        if name in self.compared_values:
            compared = self.compared_values[name][0]
            limit = smallest_deviation(int(np.isfinite(compared).sum()), len(self.compared_values))
            reference = reference_parts(compared, name, self.outliers)
            detectable = limit and limit * float(values[reference].std(ddof=1))
        bounds = self.plan.limits.bounds.get(name) if self.plan.limits and name not in FIT_NAMES else None
        low, high = self.allowed.get(name, (-np.inf, np.inf))
        fixed = bounds.fixed_limits if bounds else (-np.inf, np.inf)
        median, sigma = median_and_scatter(known_values)
        cp, cpk = capability(known_values, *(end * column.factor for end in fixed))
        minimum, maximum = (end * column.factor if np.isfinite(end) else None for end in (low, high))
        return QuantityTable(known_values.size, median, sigma, detectable, minimum, maximum, cp, cpk)

    def part_table(self, index: int, columns: Mapping[str, PartQuantity]) -> PartTable:
        """Summarize one part of the batch: result by the limits, deviations from the other parts, and values.

        Args:
            index: index of the part in the batch, from 0.
            columns: quantities by name, with the units of their table columns.

        Returns:
            Entry of the part in `batch.json`.
        """
        row, record, limits = self.plan.rows[index], self.records[index], self.plan.limits
        result, misses, doubtful = None, dict[str, str](), dict[str, str]()
        if limits and record.status == "done":
            result, misses, doubtful = judge_part(record, limits, self.allowed, self.quantities)
        outlying = {name: float(z[index]) for name, z in self.deviations.items() if self.outliers[name][index]}
        outlying = dict(sorted(outlying.items(), key=lambda item: (not is_parameter(item[0]), -abs(item[1]))))
        relative = {_CURVE: self.curve_deviation[index]}
        for name in outlying.keys() - {_CURVE}:
            relative[name] = self.estimates[name][0, index] / np.nanmedian(self.estimates[name][0]) - 1.0
        labels = dict[str, str]()
        if any(row.settings.diagnoses for row in self.plan.rows):
            labels["verdict"] = record.verdict or ""
            labels["probable effects"] = ", ".join(record.effects)
            labels["alternatives"] = ", ".join(record.alternatives)
        labels["at bound"] = ", ".join(f"{name} ({end})" for name, end in record.at_bound.items())
        labels |= {"campaign name": record.campaign_name, "subgroup": row.subgroup or ""}
        values = [self.estimates[name][0, index] * column.factor for name, column in columns.items()]
        curve = [float(column[index]) for column in self.curves.values()]
        return PartTable(
            name=row.name,
            folder=f"{ROWS_FOLDER}/{row.folder}" if record.status == "done" else "",
            error="; ".join(line.strip() for line in record.error.splitlines()),
            result=result,
            misses=misses,
            doubtful=doubtful,
            poor_fit=describe_poor_fit(record, limits),
            deviations={name: round(z, 2) for name, z in outlying.items()},
            differs="; ".join(f"{name} {number(round(100.0 * relative[name], 2), 3, '+')} %" for name in outlying),
            warnings=record.warnings,
            warning_kinds=record.warning_kinds,
            labels=labels,
            values=[float(value) if np.isfinite(value) else None for value in values],
            curve=curve if curve and np.isfinite(curve).all() else None,
        )

    def warnings(self, parts: Sequence[PartTable]) -> list[Caveat]:
        """Warnings of the whole batch, the important ones first.

        Args:
            parts: entries of `batch.json`.

        Returns:
            Warnings that name the parts.
        """

        def listed(names: Sequence[str]) -> str:
            """Join up to ten names, and state how many more there are; of all parts, only their number."""
            if len(names) == len(parts) > 1:
                return f"all {len(parts)} parts"
            more = f" and {len(names) - _NAMES_LISTED} more" if len(names) > _NAMES_LISTED else ""
            return ", ".join(names[:_NAMES_LISTED]) + more

        at_bound, warnings = dict[str, list[str]](), list[Caveat]()
        for part, record in zip(parts, self.records, strict=True):
            for parameter in record.at_bound:
                at_bound.setdefault(parameter, []).append(part.name)
        if poor := [part.name for part in parts if part.poor_fit]:
            judged = "; their limits are judged on measured points, if such points exist" if self.plan.limits else ""
            sentence = f"the model misses the tests of {listed(poor)}: do not use their parameters{judged}"
            warnings.append(Caveat("part_misses_tests", sentence))
        missing = [
            part.name
            for part, record in zip(parts, self.records, strict=True)
            if not (part.poor_fit or record.verdict or _MISFITS.isdisjoint(part.warning_kinds))
        ]
        too_narrow = [part.name for part in parts if "misfit" in part.warning_kinds]
        included = f"the intervals include this deviation{f', except those of {listed(too_narrow)}' * bool(too_narrow)}"
        chi_square = self.estimates.get(FIT_QUALITY["reduced_chi_square"].name, np.full((1, 1), np.nan))[0]
        if len(parts) > 1 and np.all(chi_square >= BEYOND_NOISE):
            ends = format_range("", chi_square.min(), chi_square.max()).strip()
            ends += f", largest for {parts[int(chi_square.argmax())].name}"
            sentence = f"the model misses the tests of all {len(parts)} parts (reduced chi-square {ends}); {included}"
            warnings.append(Caveat("part_misfit", f"{sentence}: to find a common cause, diagnose one part"))
        elif missing:
            sentence = f"the tests of {listed(missing)} deviate from the model by more than noise explains; {included}"
            warnings.append(Caveat("part_misfit", f"{sentence}: bushfit batch --command diagnose looks for the cause"))
        fits = [rows[0] for name, rows in self.estimates.items() if name in FIT_NAMES or is_parameter(name)]
        equal_parts = defaultdict[tuple[str, ...], list[str]](list)
        for part, record, values in zip(parts, self.records, np.reshape(fits, (-1, len(parts))).T, strict=True):
            if record.status == "done":
                equal_parts[tuple(number(value, _SAME_DIGITS) for value in values)].append(part.name)
        for names in (names for names in equal_parts.values() if len(names) > 1):
            warnings.append(Caveat("same_parts", f"the tests of {listed(names)} have the same data: check their files"))
        if lacking := [part.name for part in parts if self.curves and part.folder and not part.curve]:
            sentence = "a sweep is missing, or has other frequencies or amplitudes"
            sentence = f"measured stiffness is not compared with the other parts, because {sentence}: {listed(lacking)}"
            warnings.append(Caveat("part_without_sweep", sentence))
        warnings += self._notes
        if at_bound:
            clauses = [f"{parameter} of {listed(names)}" for parameter, names in at_bound.items()]
            sentence = f"the tests do not determine {'; '.join(clauses)}: the fit ends at a bound"
            warnings.append(Caveat("part_at_bound", sentence))
        if outside := [part.name for part in parts if not _EXTRAPOLATIONS.isdisjoint(part.warning_kinds)]:
            sentence = "a point is outside the tested range, where no test confirms the model"
            warnings.append(Caveat("part_extrapolated", f"{sentence}: {listed(outside)}"))
        return warnings

    def table(self) -> pd.DataFrame:
        """Table of the batch: one row for each part, in the order of the manifest.

        A parameter has the display unit of its typical value, so that the headers of two batches agree.

        Returns:
            Table with columns of texts, quantities, remarks, deviations and the measured curve; headers contain units.
        """
        import pandas as pd

        records, parts, unknown = self.records, self.document.parts, np.full((4, len(self.records)), np.nan)
        columns: dict[str, Any] = {
            "name": [part.name for part in parts],
            "campaign": [row.listed for row in self.plan.rows],
            "folder": [part.folder for part in parts],
            "status": [record.status for record in records],
            "error": [part.error for part in parts],
        }
        if self.plan.limits:
            columns["limits"] = [part.result or "" for part in parts]
            columns["missed limits"] = ["; ".join(part.misses.values()) for part in parts]
            columns["undecided limits"] = ["; ".join(part.doubtful.values()) for part in parts]
        labels = {name: [part.labels[name] for part in parts] for name in parts[0].labels}
        bounds, *last = (labels.pop(name) for name in ("at bound", "campaign name", "subgroup"))
        columns |= labels
        for name, quantity in self.quantities.items():
            endings = _PARAMETER_COLUMNS if is_parameter(name) else {"": 0} if name in FIT_NAMES else _POINT_COLUMNS
            for ending, line in endings.items():
                figures = self.estimates.get(name, unknown)[line]
                columns[quantity.in_table_unit.header + ending] = figures * quantity.in_table_unit.factor
        columns["at bound"] = bounds
        columns["warnings"] = [" | ".join(record.warnings) for record in records]
        columns["campaign name"], columns["subgroup"] = last
        columns["differs in"] = [part.differs for part in parts]
        columns["poor fit"] = [part.poor_fit for part in parts]
        columns |= {f"robust z of {name} [-]": z for name, z in self.deviations.items()}
        columns |= {"measured stiffness above the median [%]": 100.0 * self.curve_deviation} if self.curves else {}
        return pd.DataFrame(columns | self.curves)
