"""Pictures of sweeps: stiffness and loss factor of each place, measured, and as the model has them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.document import TestTable
from bushfit.report.page.chart import DASHES, MOST_LEVELS, MOST_PLACES, Panel, Series, chart, colors, every_nth, span_of
from bushfit.report.page.readback import ReportData
from bushfit.report.tables import IF_RIGS, columns_of, complete, numbers, spread
from bushfit.units import split_header, told

#: Points of all sweeps of a page, with which it stays below 500 kB; but no curve has fewer than `_FEWEST`.
_MOST_POINTS, _FEWEST = 3200, 24
#: Amplitudes that were stepped over more than this ratio lie on a logarithmic axis; and frequencies over this one.
_LOG_AMPLITUDES, LOG_FREQUENCIES = 3.0, 40.0


@dataclass(frozen=True, eq=False)
class _Curve:
    """One level of sweeps: |K| and loss factor, measured (mean of the repeats) and of the model, over x.

    Args:
        measured, model: x, |K| and loss factor, (3, n); the model at the measured points where no prediction is known.
        band: low and high of |K|, then of the loss factor, over the x of the model, (4, n), of a prediction.
        rigs: |K| and loss factor if an unresolved effect is the rig's, over the x of the model, (2, n), or none.
    """

    name: str
    measured: Array
    model: Array
    band: Array | None = None
    rigs: Array | None = None

    def series(self, row: int, color: str, dashes: str) -> Iterator[Series]:
        """What a chart of |K| (row 1) or loss factor (row 2) shows of it."""
        x, values = self.model[0], self.model[row]
        if self.rigs is not None:
            yield Series("", "#777777", "3 3", line=(x, self.rigs[row - 1]))
        band = None if self.band is None else (x, self.band[2 * row - 2], self.band[2 * row - 1])
        points = self.measured[0], self.measured[row]
        yield Series(self.name, color, "" if band is None else dashes, (x, values), band, points)


@dataclass(frozen=True, eq=False)
class _Sweeps:
    """Sweeps of one place that step through the same: a curve a level.

    Args:
        stepped: frequency or amplitude; None where nothing was held, and each test is a curve over frequency.
        along: header of what lies along x.
        left_out: levels that are not drawn.
    """

    place: Place
    stepped: str | None
    along: str
    curves: Sequence[_Curve]
    left_out: int

    @property
    def predicted(self) -> bool:
        """Whether the lines are those of the prediction."""
        return all(curve.band is not None for curve in self.curves)

    def charts(self) -> Iterator[Markup]:
        """|K| and loss factor over what is stepped through."""
        x = np.concatenate([curve.measured[0] for curve in self.curves])
        log = bool(x.max() > (_LOG_AMPLITUDES if self.stepped == "amplitude" else LOG_FREQUENCIES) * x.min() > 0.0)
        for row, label in enumerate((columns_of(self.place)[1], "loss factor [-]"), start=1):
            looks = zip(self.curves, colors(len(self.curves)), DASHES, strict=False)
            series = [each for curve, *look in looks for each in curve.series(row, *look)]
            title = f"{self.place}: {split_header(label)[0]}"
            yield chart(title, (self.along, label), series, self._in_words(row, label), log=log)

    def _in_words(self, row: int, label: str) -> str:
        what, unit = split_header(label)
        parts = [f"{what} over {split_header(self.along)[0]}, {self.place}, measured and model"]
        for curve in self.curves:
            spans = (f"{span_of(values[row])} {unit}".removesuffix(" -") for values in (curve.measured, curve.model))
            parts.append("{}: measured {}, model {}".format(curve.name, *spans))
        return "; ".join(parts)


def sweep_panels(found: ReportData) -> list[Panel]:
    """Stiffness and loss factor of each place, measured and predicted."""
    panels = list[Panel]()
    most = max(_FEWEST, _MOST_POINTS // (MOST_LEVELS * min(len(found.places), MOST_PLACES) or 1))
    for name, place, rows in found.measured("sweep"):
        kinds = [
            sweeps for sweeps in _sweeps_at(place, rows, found.tests, found.tables.get(name), most) if sweeps.curves
        ]
        if kinds:
            pictures = [picture for sweeps in kinds for picture in sweeps.charts()]
            panels.append(Panel(str(place), pictures, _notes(kinds, most)))
    return panels[:MOST_PLACES]


def _notes(kinds: Sequence[_Sweeps], most: int) -> list[str]:
    """What a reader has to know of the pictures of a place."""
    curves = [curve for sweeps in kinds for curve in sweeps.curves]
    notes = []
    if any(sweeps.predicted for sweeps in kinds):
        notes.append("Lines with 95 % bands: prediction, without effects of the rig.")
    if not all(sweeps.predicted for sweeps in kinds):
        notes.append("Lines without bands: the model at the measured points.")
    notes.append("Points: measured, mean of the repeats.")
    if any(curve.rigs is not None for curve in curves):
        notes.append("Broken grey lines: the same if what was added is the rig's; the bands span both.")
    if left := sum(sweeps.left_out for sweeps in kinds):
        notes.append(f"{left} further levels are left out of the picture; the tables have all.")
    if any(curve.measured.shape[1] >= most for curve in curves):
        notes.append(f"Of each curve at most {most} points, every n-th, are drawn.")
    return notes


def _sweeps_at(
    place: Place, rows: pd.DataFrame, tests: Sequence[TestTable], predicted: pd.DataFrame | None, most: int
) -> Iterator[_Sweeps]:
    """The sweeps of a place by what they step through, of each curve at most so many points."""
    names = columns_of(place)[1], "loss factor [-]"
    for stepped, along, held, mine in by_stepped(place, rows, tests):
        headers = [along, *names, *(f"model {name}" for name in names)]
        mine = complete(mine, *headers)
        levels = list(dict.fromkeys(mine[held])) if stepped is None else np.unique(mine[held]).tolist()
        curves = []
        for level in (levels[at] for at in spread(len(levels), MOST_LEVELS)):
            there = mine[mine[held] == level].sort_values(along)
            if stepped:
                there = there.groupby(along, as_index=False)[headers[1:]].mean()
            points = numbers(there, *headers)[:, every_nth(len(there), most)]
            line = _predicted(predicted, along, held, level, names) if stepped else None
            curves.append(_Curve(level_name(level, held), points[:3], *(line or (points[[0, 3, 4]],))))
        yield _Sweeps(place, stepped, along, curves, len(levels) - len(curves))


def by_stepped(
    place: Place, rows: pd.DataFrame, tests: Sequence[TestTable]
) -> Iterator[tuple[str | None, str, str, pd.DataFrame]]:
    """Sweeps that step through the same: what it is, the headers of what lies along x and of what is held (the test,
    where nothing is), and the rows."""
    stated, amplitude, frequency = {test.test: test.stepped for test in tests}, columns_of(place)[0], "frequency [Hz]"
    rows = complete(rows, frequency, amplitude)
    kinds: dict[str | None, list[str]] = {}
    for test in dict.fromkeys(rows["test"]):
        frequencies, amplitudes = (np.unique(x).size for x in numbers(rows[rows["test"] == test], frequency, amplitude))
        by_count = "frequency" if frequencies >= amplitudes else "amplitude"
        kinds.setdefault(stated.get(test, by_count), []).append(test)
    for stepped, names in kinds.items():
        along, held = (amplitude, frequency) if stepped == "amplitude" else (frequency, amplitude)
        yield stepped, along, held if stepped else "test", rows[rows["test"].isin(names)]


def level_name(level: float | str, held: str) -> str:
    """A held value as people read it, with the unit of its header; the name of a test as it is."""
    return level if isinstance(level, str) else told(split_header(held)[1] or "", level)


def _predicted(
    table: pd.DataFrame | None, along: str, held: str, level: float, names: tuple[str, str]
) -> tuple[Array, Array, Array | None] | None:
    """The prediction at a level: x, |K| and loss factor; their band; and both if they are the rig's; None where there
    is no such prediction."""
    if table is None:
        return None
    rigs = [f"{name}, {IF_RIGS}" for name in names]
    band = [f"{name}, {end}" for name in names for end in ("low", "high")]
    known = complete(table, along, held, *names, *band)
    near = known[np.abs(known[held] - level) < 0.02 * abs(level)].sort_values(along)
    if near.empty:
        return None
    return numbers(near, along, *names), numbers(near, *band), numbers(near, *rigs) if rigs[0] in near else None
