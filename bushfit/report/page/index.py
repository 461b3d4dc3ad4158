"""The page of a batch, `index.html`: parts that fail or differ, what the batch can show, and a table of all parts."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.model.file import read_document, require_schema
from bushfit.report.batch_document import BATCH_SCHEMA, BatchFile, PartTable
from bushfit.report.page import filled, rendered
from bushfit.report.page.svg import Picture, picture
from bushfit.report.plots import batch as plots
from bushfit.report.results import Documents, ResultFile, Tables, json_file
from bushfit.report.tables import spread
from bushfit.units import number, split_header
from bushfit.validation import validate_tables

#: Cells of the table of parts at most, of which a curve counts three: with these the page stays below 500 kB.
_MOST_CELLS = 4000
#: Parts that a list names at most.
_MOST_NAMED = 20
#: Size of the small picture of a curve [pixels], and the least height of its scale to either side, relative.
_WIDTH, _HEIGHT, _LEAST_SCALE = 110.0, 26.0, 0.005
_DIFFERENT, _USUAL = "#b4500c", "#1f4e9c"
#: Order of the rows: parts that need attention first.
_ORDER = ("error", "fail", "conditional fail", "not judged", "differs", "conditional pass")
#: Columns of texts that the table of parts shows where they differ from part to part.
_LABELS = ("campaign name", "subgroup", "verdict", "named effects", "on a bound")
_TONES = {"pass": "good", "conditional pass": "fair", "not judged": "fair", "conditional fail": "bad", "fail": "bad"}


def is_batch(folder: Path) -> bool:
    """True if a folder holds the results of a batch."""
    return (folder / "batch.json").exists()


def read_batch(folder: Path) -> list[ResultFile]:
    """Read the document of a batch.

    Raises:
        ModelError: the document is missing, or not as bushfit writes it.
    """
    file = folder / "batch.json"
    document = read_document(file)
    require_schema(document, file, "a batch", BATCH_SCHEMA, hint="run the batch again with --resume")
    validate_tables(document, file, BatchFile, kind=ModelError)
    return [json_file("batch", document)]


def page_of(folder: Path, base: str = "") -> Callable[[Documents, Tables], str]:
    """Function that makes the page of a batch; links to reports in the folder begin with `base`."""
    reports = folder.glob("bushings/*/report.html")
    reported = frozenset(f"{report.parent.parent.name}/{report.parent.name}" for report in reports)
    return partial(index_page, reported=reported, base=base)


def index_page(documents: Documents, _: Tables, *, reported: Collection[str] = (), base: str = "") -> str:
    """The page of a batch as HTML.

    Args:
        documents: `batch`, the content of batch.json.
        reported: folders of the parts that have a report.
        base: start of the links.

    Returns:
        The page as HTML.
    """
    batch = validate_tables(documents["batch"], None, BatchFile, kind=ModelError)
    curves = _Curves.from_batch(batch)
    status = [_status(part) for part in batch.parts]
    ordered = sorted(
        range(len(status)), key=lambda index: _ORDER.index(status[index]) if status[index] else len(_ORDER)
    )
    important = sum(map(bool, status))
    labels = [name for name in _LABELS if len({part.labels.get(name, "") for part in batch.parts}) > 1]
    heads = (["result"] if batch.limits else []) + labels
    row_limit = max(1, _MOST_CELLS // (len(heads) + len(batch.quantities) + (4 if curves else 1)))
    first, ordinary = ordered[: min(important, row_limit)], ordered[important:]
    chosen = first + [ordinary[index] for index in spread(len(ordinary), max(0, row_limit - len(first)))]
    warnings = list(dict.fromkeys(line for index in chosen for line in batch.parts[index].warnings))

    def link(part: PartTable) -> str:
        target = "/report.html" if part.folder in reported else "/"
        return base + quote(part.folder) + target if part.folder else ""

    def attention(*wanted: str) -> list[tuple[PartTable, str]]:
        listed = [part for part, state in zip(batch.parts, status, strict=True) if state in wanted]
        return [(part, link(part)) for part in listed[:_MOST_NAMED]]

    def remarks(part: PartTable) -> str:
        numbers = [str(warnings.index(line) + 1) for line in part.warnings]
        doubtful = [] if part.poor_fit else part.doubtful.values()
        texts = [part.error, part.poor_fit and "poor fit", part.differs and f"differs: {part.differs}", *doubtful]
        return "; ".join(filter(None, [*texts, f"warnings {', '.join(numbers)}" if numbers else ""]))

    context: dict[str, Any] = {
        "batch": batch,
        "bad": bool(batch.missed or batch.failed),
        "fails": attention("fail", "conditional fail"),
        "unjudged": attention("not judged"),
        "errors": attention("error"),
        "differing": attention("differs"),
        "most_named": _MOST_NAMED,
        "parts_compared": max((table.parts for table in batch.quantities.values()), default=0),
        "quantities": [(name, table, *_unit(name)) for name, table in batch.quantities.items()],
        "curves": curves,
        "curves_picture": curves.picture(batch) if curves else None,
        "heads": heads,
        "columns": [*(["measured stiffness, deviation [%]"] if curves else []), *batch.quantities],
        "rows": [
            {
                "part": (part := batch.parts[index]),
                "link": link(part),
                "texts": ([part.result or ""] if batch.limits else []) + [part.labels.get(name, "") for name in labels],
                "curve": curves.sparkline(index, differs=bool(part.deviations)) if curves else "",
                "deviation": curves.deviation(index) if curves else "",
                "cells": list(_cells(batch, part)),
                "remarks": remarks(part),
            }
            for index in chosen
        ],
        "warnings": warnings,
        "shown": (len(first), important, len(chosen) - len(first)),
        "tones": _TONES,
    }
    return rendered("index.html", context)


def _status(part: PartTable) -> str:
    """Why a part needs attention, one of `_ORDER`; empty if it does not."""
    result = "" if part.result in ("pass", None) else str(part.result)
    if part.deviations and result in ("", "conditional pass"):
        return "differs"
    return "error" if part.error else result


def _unit(header: str) -> tuple[str, str]:
    name, unit = split_header(header)
    return name, "" if unit in (None, "-") else f" {unit}"


def _cells(batch: BatchFile, part: PartTable) -> Iterator[tuple[str, str]]:
    """Values of a part, and the tone of those that miss a limit or differ."""
    for header, value in zip(batch.quantities, part.values, strict=True):
        name = split_header(header)[0]
        tone = "bad" if name in part.misses else "fair" if name in part.deviations else ""
        yield "" if value is None else number(value, 4), tone


@dataclass(frozen=True, eq=False)
class _Curves:
    """Measured stiffness curves of the parts.

    Args:
        headers: columns of the points, (k,).
        values: |K| in the unit of the headers, (n, k), NaN for parts without a curve.
        usual: parts that do not differ, (n,) bool.
    """

    headers: Sequence[str]
    values: Array
    usual: Array

    @classmethod
    def from_batch(cls, batch: BatchFile) -> "_Curves | None":
        """Curves of a batch; None if it has none."""
        if not batch.curve_points:
            return None
        unknown = [np.nan] * len(batch.curve_points)
        values = np.array([unknown if part.curve is None else part.curve for part in batch.parts], dtype=float)
        usual = np.array([not part.deviations and part.curve is not None for part in batch.parts])
        return cls(batch.curve_points, values, usual) if usual.any() else None

    @property
    def relative(self) -> Array:
        """Deviation of each curve from the median of the batch, relative, (n, k)."""
        return np.asarray(self.values / np.nanmedian(self.values, axis=0) - 1.0)

    @property
    def scale(self) -> float:
        """Half the height of a small picture, relative: 1.5 times the largest deviation of a usual part."""
        return max(_LEAST_SCALE, 1.5 * float(np.abs(self.relative[self.usual]).max()))

    def deviation(self, index: int) -> str:
        """Mean deviation of a curve from the median in per cent, as text."""
        mean = 100.0 * float(np.expm1(np.log1p(self.relative[index]).mean()))
        return number(mean, 2, "+") if np.isfinite(mean) else ""

    def picture(self, batch: BatchFile) -> Picture:
        """Median, range of the parts that do not differ, and the curves of those that do."""
        pairs = zip(batch.parts, self.values, strict=True)
        singles = {part.name: curve for part, curve in pairs if part.deviations and part.curve}
        return picture(plots.curves_figure(self.headers, self.values[self.usual], singles), "curves")

    def sparkline(self, index: int, *, differs: bool) -> Markup:
        """Deviation of a curve from the median over the points, with the range of the parts that do not differ."""
        relative = self.relative
        line, low, high = relative[index], relative[self.usual].min(axis=0), relative[self.usual].max(axis=0)
        if not np.isfinite(line).all():
            return Markup()
        x = np.linspace(1.0, _WIDTH - 1.0, line.size)

        def path(x: Array, relative: Array) -> str:
            y = (0.5 - 0.46 * np.clip(relative / self.scale, -1.0, 1.0)) * _HEIGHT
            return "M" + "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))

        ends = (number(100.0 * float(end), 2, "+") for end in (line.min(), line.max()))
        band = path(np.concatenate([x, x[::-1]]), np.concatenate([low, high[::-1]]))
        drawn = {"band": band, "line": path(x, line), "color": _DIFFERENT if differs else _USUAL}
        alt = f"{' to '.join(ends)} % off the median"
        return Markup(filled("spark.html", {"alt": alt, "width": _WIDTH, "height": _HEIGHT, **drawn}))
