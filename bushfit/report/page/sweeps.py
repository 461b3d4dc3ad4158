"""Pictures of sweeps, measured and modelled: over frequency, over amplitude (the Payne curve), and Cole-Cole."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from markupsafe import Markup

from bushfit.effects.contract import Array
from bushfit.effects.temperature import REFERENCE
from bushfit.geometry import Place
from bushfit.model.document import TestTable
from bushfit.prediction.stiffness import predict
from bushfit.reading.measurement import SAME_TEMPERATURE
from bushfit.reading.runs import nominal
from bushfit.report.page.chart import DASHES, MOST_LEVELS, MOST_PLACES, Panel, Series, chart, colors, every_nth, span_of
from bushfit.report.page.readback import ReportData
from bushfit.report.tables import IF_RIGS, columns_of, complete, numbers, prediction_table, spread
from bushfit.units import CELSIUS, SIZES, format_range, number, split_header

#: Points of all sweeps of a page, with which it stays below 500 kB; but no curve has fewer than `_FEWEST`.
_MOST_POINTS, _FEWEST = 3200, 24
#: Amplitudes that were stepped over more than this ratio lie on a logarithmic axis; and frequencies over this one.
_LOG_AMPLITUDES, LOG_FREQUENCIES = 3.0, 40.0
#: Frequencies of a Payne curve where the tests stepped through others than amplitudes, the points of its lines, and the
#: ratio of its amplitudes at least.
_PAYNE, _FINE, _SPAN = 3, 25, 1.05


class Level(NamedTuple):
    """A held value, or the name of a test where nothing was held, by its name in a legend, and its rows."""

    name: str
    value: float | str
    rows: pd.DataFrame


@dataclass(frozen=True, eq=False)
class _Curve:
    """One level of sweeps, measured (mean of the repeats) and of the model, over x: |K|, loss factor, K' and K''.

    Args:
        measured, model: x and the four, (5, n); the model at the measured points where no prediction is known.
        band: low and high of each of the four in turn, over the x of the model, (8, n), of a prediction.
        rigs: the four if an unresolved effect is the rig's, over the x of the model, (4, n), or none.
        thinned: most points that are drawn, where there are more; else 0.
    """

    name: str
    measured: Array
    model: Array
    band: Array | None = None
    rigs: Array | None = None
    thinned: int = 0

    def series(self, row: int, color: str, dashes: str) -> Iterator[Series]:
        """What a chart of one of the four, in row 1 to 4, shows of it."""
        x, values = self.model[0], self.model[row]
        if self.rigs is not None:
            yield Series("", "#777777", "3 3", line=(x, self.rigs[row - 1]))
        band = None if self.band is None else (x, self.band[2 * row - 2], self.band[2 * row - 1])
        points = self.measured[0], self.measured[row]
        yield Series(self.name, color, "" if band is None else dashes, (x, values), band, points)


@dataclass(frozen=True, eq=False)
class Sweeps:
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

    def charts(self, *rows: int) -> Iterator[Markup]:
        """|K| (row 1), loss factor (2), K' (3) and K'' (4) over what is stepped through."""
        x = np.concatenate([curve.measured[0] for curve in self.curves])
        log = bool(x.max() > (_LOG_AMPLITUDES if self.stepped == "amplitude" else LOG_FREQUENCIES) * x.min() > 0.0)
        for row in rows:
            label = _four(self.place)[row - 1]
            series = [each for curve, *look in self._looks() for each in curve.series(row, *look)]
            over = split_header(self.along)[0]
            title = f"{self.place}: {split_header(label)[0]}" + f" over {over}" * (self.stepped == "amplitude")
            words = self._in_words(row, label, over)
            yield chart(title, (self.along, label), series, words, log=log, angles=row == 2)

    def cole_cole(self) -> Markup:
        """K'' over K', a curve a level."""
        labels = _four(self.place)[2], _four(self.place)[3]
        series = [
            Series(
                each.name, color, dashes, (each.model[3], each.model[4]), points=(each.measured[3], each.measured[4])
            )
            for each, color, dashes in self._looks()
        ]
        words = self._in_words(4, labels[1], split_header(labels[0])[0])
        return chart(f"{self.place}: Cole-Cole", labels, series, words)

    def _looks(self) -> Iterator[tuple[_Curve, str, str]]:
        """Each curve with its colour and dashes."""
        return zip(self.curves, colors(len(self.curves)), DASHES, strict=False)

    def _in_words(self, row: int, label: str, over: str) -> str:
        what, unit = split_header(label)
        parts = [f"{what} over {over}, {self.place}, measured and model"]
        for curve in self.curves:
            spans = (f"{span_of(values[row])} {unit}".removesuffix(" -") for values in (curve.measured, curve.model))
            parts.append("{}: measured {}, model {}".format(curve.name, *spans))
        return "; ".join(parts)


def _four(place: Place) -> tuple[str, str, str, str]:
    """Headers of |K|, loss factor, K' and K'' in the tables of a place."""
    stiffness = columns_of(place)[1]
    return stiffness, "loss factor [-]", f"storage {stiffness}", f"loss {stiffness}"


def _headers(place: Place, along: str) -> list[str]:
    """Headers of x, then of |K| and loss factor as measured, then of the model's, in tables of sweeps."""
    both = _four(place)[:2]
    return [along, *both, *(f"model {name}" for name in both)]


def sweeps_of(found: ReportData) -> list[Sweeps]:
    """The sweeps of every place of a page by what they step through, with their curves.

    One line of a prediction at one temperature would be that of no test where these lie apart in it: a model that knows
    temperatures is drawn as it has each test.
    """
    most = max(_FEWEST, _MOST_POINTS // (MOST_LEVELS * min(len(found.places), MOST_PLACES) or 1))
    every = list[Sweeps]()
    for name, place, rows in [*found.measured("sweep")][:MOST_PLACES]:
        for stepped, along, held, mine in by_stepped(place, rows, found.tests):
            mine = complete(mine, *_headers(place, along))
            elsewhere = found.result.model.knows_temperature and _apart(_temperatures(found, mine))
            predicted = None if stepped is None or elsewhere else found.tables.get(name)
            levels = levels_of(found, mine, held)
            chosen = [levels[at] for at in spread(len(levels), MOST_LEVELS)]
            curves = [_curve(place, along, held, level, predicted, most) for level in chosen]
            every.append(Sweeps(place, stepped, along, curves, len(levels) - len(curves)))
    return [sweeps for sweeps in every if sweeps.curves]


def frequency_panels(every: Sequence[Sweeps]) -> list[Panel]:
    """|K|, loss factor, K' and K'' over frequency."""
    mine = [sweeps for sweeps in every if sweeps.stepped != "amplitude"]
    return [Panel(str(sweeps.place), [*sweeps.charts(1, 2, 3, 4)], _notes(sweeps)) for sweeps in mine]


def cole_cole_panels(every: Sequence[Sweeps]) -> list[Panel]:
    """K'' over K'."""
    notes = ["A curve for each level. Lines: as above, without bands. Points: measured, mean of the repeats."]
    return [Panel(str(sweeps.place), [sweeps.cole_cole()], notes) for sweeps in every]


def amplitude_panels(found: ReportData) -> list[Panel]:
    """The Payne curves: |K| and loss factor over amplitude at some frequencies, measured and predicted."""
    panels = list[Panel]()
    for _, place, rows in [*found.measured("sweep")][:MOST_PLACES]:
        if (sweeps := _payne(found, place, rows)) is not None:
            notes = _notes(sweeps)
            if found.result.model.knows_temperature:
                notes.append(f"Prediction and tests at {REFERENCE - CELSIUS:g} °C.")
            panels.append(Panel(str(place), [*sweeps.charts(1, 2)], notes))
    return panels


def _payne(found: ReportData, place: Place, rows: pd.DataFrame) -> Sweeps | None:
    """The sweeps of a place over amplitude, at frequencies at which several amplitudes were measured; None without."""
    along, held = columns_of(place)[0], "frequency [Hz]"
    kinds = [(stepped, mine) for stepped, *_, mine in by_stepped(place, rows, found.tests) if stepped]
    if not kinds:
        return None
    mine = complete(pd.concat([mine for _, mine in kinds]), *_headers(place, along))
    if found.result.model.knows_temperature:
        mine = mine[~((_temperatures(found, mine) + CELSIUS - REFERENCE).abs() > SAME_TEMPERATURE)]
    amplitude, frequency = numbers(mine, along, held)
    factor = place.display.displacement.factor
    possible = (frequency > SIZES[0]) & (frequency < SIZES[1]) & (amplitude > SIZES[0]) & (amplitude < SIZES[1])
    mine = mine[possible].assign(**{held: nominal(frequency[possible])})
    reached = mine.groupby(held)[along].agg(["min", "max"])
    levels = reached.index[reached["max"] > _SPAN * reached["min"]].to_numpy(dtype=float)
    most = MOST_LEVELS if any(stepped == "amplitude" for stepped, _ in kinds) else _PAYNE
    chosen = levels[spread(levels.size, most)]
    if not chosen.size:
        return None
    ends = mine.loc[mine[held].isin(chosen), along]
    fine = np.geomspace(ends.min(), ends.max(), _FINE) / factor
    predicted = prediction_table(predict(found.result, place, chosen, fine))
    every = levels_of(found, mine[mine[held].isin(chosen)], held)
    shown = [every[at] for at in spread(len(every), MOST_LEVELS)]
    curves = [_curve(place, along, held, level, predicted, _MOST_POINTS // MOST_LEVELS) for level in shown]
    return Sweeps(place, "amplitude", along, curves, levels.size - chosen.size if most == MOST_LEVELS else 0)


def _notes(sweeps: Sweeps) -> list[str]:
    """What a reader has to know of the pictures of some sweeps."""
    predicted = "Lines with 95 % bands: prediction, without effects of the rig."
    lines = predicted if sweeps.predicted else "Lines without bands: the model at the measured points."
    notes = [lines, "Points: measured, mean of the repeats."]
    if any(curve.rigs is not None for curve in sweeps.curves):
        notes.append("Broken grey lines: the same if what was added is the rig's; the bands span both.")
    if sweeps.left_out:
        notes.append(f"{sweeps.left_out} further levels are left out of the picture; the tables have all.")
    if most := max((curve.thinned for curve in sweeps.curves), default=0):
        notes.append(f"Of each curve at most {most} points, every n-th, are drawn.")
    return notes


def levels_of(found: ReportData, rows: pd.DataFrame, held: str) -> list[Level]:
    """The levels of some sweeps, or each test where nothing was held; of tests that lie apart in temperature, or were
    made on several parts, those of each by its own name."""
    keys = [rows[held]]
    if held != "test":
        stated = {test.test: test.conditions.get("specimen_number") for test in found.tests}
        parts = rows["test"].map({test: f"part {part or 'not stated'}" for test, part in stated.items()})
        degrees = _temperatures(found, rows)
        keys = [*([degrees] if _apart(degrees) else []), *([parts] if len(set(parts)) > 1 else []), rows[held]]
    groups: Any = rows.groupby([key.to_numpy() for key in keys], sort=held != "test", dropna=False)
    levels = list[Level]()
    for (*own, level), there in groups:
        words = (each if isinstance(each, str) else f"{number(each, 3)} °C" for each in own)
        name = level if isinstance(level, str) else format_range(split_header(held)[1] or "", level)
        levels.append(Level(", ".join([*words, name]), level, there))
    return levels


def _temperatures(found: ReportData, rows: pd.DataFrame) -> pd.Series[float]:
    """The temperature at which each row was measured [degC], nan where it is not stated, (n,)."""
    stated = ((test.test, test.conditions.get("temperature_degC")) for test in found.tests)
    return rows["test"].map({test: at for test, at in stated if isinstance(at, float)}).astype(float)


def _apart(degrees: pd.Series[float]) -> bool:
    """Whether temperatures are not one."""
    return bool(degrees.max() - degrees.min() > SAME_TEMPERATURE)


def _curve(place: Place, along: str, held: str, level: Level, predicted: pd.DataFrame | None, most: int) -> _Curve:
    """The curve of a level, at most so many points, and the prediction where it has the level."""
    headers = _headers(place, along)
    there = level.rows.sort_values(along)
    if held != "test":
        there = there.groupby(along, as_index=False)[headers[1:]].mean()
    points = numbers(there, *headers)[:, every_nth(len(there), most)]
    names, line, band, rigs = _four(place), _parted(points[[0, 3, 4]]), None, None
    if predicted is not None and not isinstance(level.value, str):
        other = [f"{name}, {IF_RIGS}" for name in names]
        ends = [f"{name}, {end}" for name in names for end in ("low", "high")]
        known = complete(predicted, along, held, *names, *ends)
        near = known[np.abs(known[held] - level.value) < 0.02 * abs(level.value)].sort_values(along)
        if not near.empty:
            line, band = numbers(near, along, *names), numbers(near, *ends)
            rigs = numbers(near, *other) if other[0] in near else None
    return _Curve(level.name, _parted(points[:3]), line, band, rigs, most if len(there) > most else 0)


def _parted(points: Array) -> Array:
    """x, |K| and loss factor with K' and K'' behind, (3, n) -> (5, n)."""
    storage = points[1] / np.sqrt(1.0 + np.square(points[2]))
    return np.vstack([points, storage, points[2] * storage])


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
