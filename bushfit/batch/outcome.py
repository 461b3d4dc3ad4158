"""What came of a batch: record and numbers of every row, and all that is said, tabled and drawn of the whole."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, product
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bushfit.batch.document import BatchFile, BatchSummary, Control, Counts, Record, Scatter
from bushfit.batch.ledger import ROWS
from bushfit.batch.limits import Judge, Judgement, Limits
from bushfit.batch.manifest import Row
from bushfit.batch.quantities import LOSS_FACTOR, OF_FIT, PARTS, STIFFNESS, Quantity, at_point, parameter_quantities
from bushfit.batch.together import Together
from bushfit.batch.work import Orders
from bushfit.effects.contract import Array
from bushfit.prediction.caveats import BEYOND
from bushfit.reduction.arrays import scatter
from bushfit.report.results import Formats, ResultFile, figure_file, json_file, page_file, table_file
from bushfit.report.tables import BETWEEN

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bushfit.report.plots.batch import Panel


@dataclass(frozen=True)
class Plan:
    """A batch: its title, rows, what all rows share, limits, a JUnit file on request, how the whole is written."""

    title: str
    rows: Sequence[Row]
    orders: Orders
    limits: Limits | None
    junit: Path | None
    formats: Formats


@dataclass(frozen=True, eq=False)
class Outcome:
    """What came of the n rows of a batch.

    Args:
        plan: the batch.
        records: of each row, in order; their numbers are in `figures`.
        figures: of each quantity over the rows, by its name [SI]: value, low and high of its 95 % interval, and
            standard error, (4, n); NaN where a row has none.
        seconds: that the rows took [s].
        earlier: what is said of results of an earlier batch in the folder.
    """

    plan: Plan
    records: Sequence[Record]
    figures: Mapping[str, Array]
    seconds: float
    earlier: Sequence[str] = ()

    @cached_property
    def quantities(self) -> dict[str, Quantity]:
        """All that may be known of a bushing, by name: parameters, quality of the fit, then the points."""
        every = (*parameter_quantities(self.figures), *OF_FIT.values(), *self._at_points)
        return {quantity.name: quantity for quantity in every}

    @property
    def _at_points(self) -> list[Quantity]:
        return [at_point(point, what) for point in self.plan.orders.points for what in (STIFFNESS, LOSS_FACTOR)]

    @cached_property
    def judge(self) -> Judge | None:
        values = {name: figures[0] for name, figures in self.figures.items()}
        return Judge(self.plan.limits, values, self.quantities) if self.plan.limits else None

    @cached_property
    def judgements(self) -> list[Judgement | None]:
        """On each row; None on all without limits, and on a row that failed."""
        found = list[Judgement | None]()
        for number, record in enumerate(self.records):
            judged = None
            if self.judge and record["status"] == "done":
                row = {name: figures[:, number].tolist() for name, figures in self.figures.items()}
                judged = self.judge({name: four for name, four in row.items() if math.isfinite(four[0])}, record)
            found.append(judged)
        return found

    @cached_property
    def status(self) -> Counter[str]:
        """How many rows are done, and how many failed."""
        return Counter(record["status"] for record in self.records)

    @property
    def kept(self) -> int:
        """Rows taken over from an earlier run."""
        return sum(bool(record.get("kept")) for record in self.records)

    @property
    def errors(self) -> list[tuple[str, str]]:
        """The name of each row that failed, and why."""
        pairs = zip(self.plan.rows, self.records, strict=True)
        return [(row.name, record["error"]) for row, record in pairs if record["status"] != "done"]

    @property
    def limits(self) -> Counter[str]:
        """Bushings by verdict."""
        return Counter(str(judged.verdict) for judged in self.judgements if judged)

    @property
    def missed(self) -> list[tuple[str, str]]:
        """The name of each bushing that misses a limit, and what it misses, in words."""
        return [(name, "; ".join(judged.missed.values())) for name, judged in self._judged if judged.missed]

    @property
    def edge(self) -> list[tuple[str, str]]:
        """The name of each bushing that passes on condition, and why."""
        just = [(name, judged.edge) for name, judged in self._judged if judged.edge and not judged.missed]
        return [(name, "; ".join(edge.values())) for name, edge in just]

    @property
    def _judged(self) -> list[tuple[str, Judgement]]:
        pairs = zip(self.plan.rows, self.judgements, strict=True)
        return [(row.name, judged) for row, judged in pairs if judged]

    @cached_property
    def together(self) -> Together:
        """Each bushing against the others."""
        return Together(self.plan.rows, self.records, self.figures, self.quantities, self.plan.limits)

    @cached_property
    def scatter(self) -> dict[Quantity, tuple[float, float]]:
        """Median and robust standard deviation of each quantity, in its unit."""
        found = {}
        for quantity in self.quantities.values():
            if quantity.name in self.figures:
                values = self.figures[quantity.name][0]
                middle, spread = scatter(values[np.isfinite(values)])
                found[quantity] = (middle * quantity.factor, spread * quantity.factor)
        return found

    @property
    def notes(self) -> list[str]:
        """Limits that could not be judged, bushings that are not to be trusted blindly, results of earlier batches."""
        on_bound = [record.get("at_bound", {}) for record in self.records]
        times = Counter(chain.from_iterable(on_bound)).most_common()
        names = ", ".join(f"{name} of {count}" for name, count in times)
        table = self.plan.formats.table("batch")
        said = {
            "a parameter at rest on a bound of its fit, which the tests do not settle: "
            f"{names}; see the column on a bound": sum(map(bool, on_bound)),
            "a point beyond the tests, which no test has checked: see the column warnings": sum(
                any(words.endswith(BEYOND) for words in each.get("warnings", ())) for each in self.records
            ),
            "warnings: see the column warnings": sum(bool(each.get("warnings")) for each in self.records),
        }
        counted = [f"{n} bushing{'s' * (n > 1)} with {words} of {table}" for words, n in said.items() if n]
        return [*(self.judge.notes if self.judge else ()), *self.together.notes, *counted, *self.earlier]

    @property
    def _counts(self) -> Counts:
        """JSON-ready data, whatever of it was done in this run."""
        return {
            "schema": "bushfit/batch/1",
            "rows": len(self.records),
            "done": self.status["done"],
            "failed": [{"name": name, "error": error} for name, error in self.errors],
            "limits": dict(self.limits),
            "missed": [name for name, _ in self.missed],
            "conditional": [name for name, _ in self.edge],
            "warnings": self.notes,
            "differ": self.together.differ,
        }

    @property
    def summary(self) -> BatchSummary:
        """What `--json` prints: what came of the rows in this run."""
        scatter: dict[str, Scatter] = {
            quantity.name: {"median": middle, "sigma": spread, "unit": quantity.unit}
            for quantity, (middle, spread) in self.scatter.items()
        }
        return {**self._counts, "kept": self.kept, "scatter": scatter, "seconds": self.seconds}

    @property
    def document(self) -> BatchFile:
        """The same as a file: of each quantity its column of the table, its scatter and its limits there."""
        quantities: dict[str, Control] = {}
        for quantity, (middle, spread) in self.scatter.items():
            allowed, tabled = self._allowed.get(quantity.name, ()), quantity.tabled
            ends = [end * tabled.factor if math.isfinite(end) else None for end in allowed]
            scale = tabled.factor / quantity.factor
            told = self.together.process[quantity.name]
            sizes = Control(median=middle * scale, sigma=spread * scale, allowed=ends or [None, None], process=told)
            quantities[tabled.header] = sizes
        order, least = self.together.order[1], self.together.least_told
        counts = self._counts
        return {**counts, "title": self.plan.title, "quantities": quantities, "order": order, "least_told": least}

    @property
    def _allowed(self) -> Mapping[str, tuple[float, float]]:
        """The lowest and the highest allowed value of each quantity that has a limit, by its name."""
        return self.judge.allowed if self.judge else {}

    @property
    def files(self) -> list[ResultFile]:
        """All that is written of the whole batch under the name `batch`, and its page."""
        panels = self._panels() if self.plan.formats.pictures else []

        def drawn() -> Figure:
            from bushfit.report.plots.batch import batch_figure

            return batch_figure(panels, self.plan.title, [row.name for row in self.plan.rows])

        files = [json_file("batch", self.document), table_file("batch", self.table)]
        if self.plan.formats.pages:
            from bushfit.report.page.index import page_of

            files.append(page_file("index", page_of(self.plan.orders.output), files))
        return [*files, figure_file("batch", drawn)] if panels else files

    def table(self) -> pd.DataFrame:
        """A row a bushing, in the manifest's order, a unit that people use in every header.

        A parameter has the unit for its usual size, whatever it is in this batch: the headers of two batches agree.
        """
        import pandas as pd

        texts = {name: pd.Series(cells, dtype=object) for name, cells in self._texts().items()}
        after = {name: texts.pop(name) for name in ("on a bound", "warnings")}
        columns = [
            *product((quantity.tabled for quantity in parameter_quantities(self.figures)), PARTS),
            *product(OF_FIT.values(), ("",)),
            *product(self._at_points, ("", ", low", ", high")),
        ]
        none = np.full((len(PARTS), len(self.records)), np.nan)
        numbers = {
            quantity.header + part: self.figures.get(quantity.name, none)[PARTS[part]] * quantity.factor
            for quantity, part in columns
        }
        return pd.DataFrame({**texts, **numbers, **after, **self.together.columns})

    def _texts(self) -> dict[str, list[str]]:
        rows, records, judgements = self.plan.rows, self.records, self.judgements
        done = [record["status"] == "done" for record in records]
        texts: dict[str, list[str]] = {
            "name": [row.name for row in rows],
            "campaign": [row.listed for row in rows],
            "folder": [f"{ROWS}/{row.folder}" if whole else "" for row, whole in zip(rows, done, strict=True)],
            "status": [record["status"] for record in records],
            "error": [" ".join(record.get("error", "").split()) for record in records],
        }
        if self.judge:
            texts["limits"] = [str(judged.verdict) if judged else "" for judged in judgements]
            texts["out of limits"] = ["; ".join(judged.missed.values()) if judged else "" for judged in judgements]
            texts["on the edge"] = ["; ".join(judged.edge.values()) if judged else "" for judged in judgements]
        if any(row.settings.diagnosed for row in rows):
            texts["verdict"] = [record.get("verdict", "") for record in records]
            texts["named effects"] = [", ".join(record.get("effects", ())) for record in records]
            texts["cannot be told from"] = [", ".join(record.get("alternatives", ())) for record in records]
        ends = [record.get("at_bound", {}).items() for record in records]
        texts["on a bound"] = [", ".join(f"{name} ({end})" for name, end in each) for each in ends]
        texts["warnings"] = [BETWEEN.join(record.get("warnings", ())) for record in records]
        return texts

    def _panels(self) -> list[Panel]:
        """What the picture shows: quantities with limits, and those that enough bushings have to show their scatter."""
        from bushfit.report.plots.batch import Panel

        panels = []
        for name, quantity in self.quantities.items():
            allowed, figures = self._allowed.get(name, ()), self.figures.get(name, np.full((len(PARTS), 1), np.nan))
            known = np.isfinite(figures[0])
            if known.sum() >= (1 if allowed else 3):  # fewer show no scatter
                shown = quantity.for_people(float(np.median(figures[0, known])))
                told = enumerate(self.judgements)
                missed = {k for k, judged in told if judged and name in judged.missed and known[k]}
                limits, ends = tuple(limit * shown.factor for limit in allowed), figures[1:3] * shown.factor
                interval = ends if np.isfinite(ends).all(axis=0).any() else None
                panels.append(Panel(shown.header, figures[0] * shown.factor, limits, missed, interval))
        return panels

    def junit(self) -> bytes:
        """A report for continuous integration: an error where a bushing failed, a failure where it misses limits."""
        from junitparser import Error, Failure, JUnitXml, TestCase, TestSuite

        suite = TestSuite(self.plan.title)
        for row, record, judged in zip(self.plan.rows, self.records, self.judgements, strict=True):
            case = TestCase(_printable(row.name), suite.name, record["seconds"])
            failed, missed = record["status"] != "done", judged.missed if judged else {}
            if failed or missed:
                text = _printable(record["error"] if failed else "\n".join(missed.values()))
                line = text.partition("\n")[0] if failed else "; ".join(text.splitlines())
                result = Error(line, "failed") if failed else Failure(line, "limits")
                result.text = text
                case.result = [result]
            suite.add_testcase(case)
        report = JUnitXml("bushfit batch")
        report.add_testsuite(suite)
        report.update_statistics()  # type: ignore[no-untyped-call]
        return b'<?xml version="1.0" encoding="utf-8"?>\n' + report.tostring()  # type: ignore[no-untyped-call]


def _printable(text: str) -> str:
    """Without the control characters that XML cannot hold."""
    return "".join(letter if letter.isprintable() or letter == "\n" else " " for letter in text)
