"""Measured points beside the model, grouped from the tables of results for drawing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple, cast

import numpy as np
import pandas as pd

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.result import Result
from bushfit.reading.measurement import SAME_TEMPERATURE
from bushfit.report.tables import columns_of, moved_of, spread
from bushfit.units import format_range, number

#: Quantity along the x axis of a sweep.
Axis = Literal["frequency", "amplitude"]
#: Width of a sector of a loop's cycle over which residuals are averaged [deg].
SECTOR = 10.0
#: Most curves of a group, and most loops of a place, that are drawn.
MOST_CURVES, MOST_LOOPS = 24, 8
#: Bins of time in which a long record is drawn: more than a figure has pixels.
TIME_BINS = 1500


class Curve(NamedTuple):
    """Points of sweeps that share what they hold.

    Args:
        name: held amplitude or frequency with its unit, or the name of the test where nothing is held.
        level: held value in the units of the table; nan where nothing is held.
        rows: of the table, sorted by what is stepped.
    """

    name: str
    level: float
    rows: pd.DataFrame


class SweepGroup(NamedTuple):
    """Sweeps of one place that step through the same quantity.

    Args:
        axis: quantity along x.
        palette: colour scale of the curves, named after what distinguishes them: "amplitude", "frequency",
            "temperature" or "loop".
        curves: one per level, rising.
    """

    place: Place
    axis: Axis
    palette: str
    curves: Sequence[Curve]

    @property
    def x_header(self) -> str:
        """Header of the column along x."""
        return _header(self.place, self.axis)

    def thinned(self) -> SweepGroup:
        """At most 24 of the curves, evenly from the first to the last."""
        return self._replace(curves=[self.curves[index] for index in spread(len(self.curves), MOST_CURVES)])

    @property
    def shares_levels(self) -> bool:
        """True if the curves differ by their level alone: no temperatures, parts or free sweeps."""
        return self.palette in ("amplitude", "frequency")


def sweep_groups(table: pd.DataFrame, result: Result) -> list[SweepGroup]:
    """Sweeps of a table grouped by place and by what they step through.

    Args:
        table: as `tables.sweeps_table` or the sweeps of `tables.gap_table` make it.
        result: model whose specimens give places by their names.

    Returns:
        Groups in the order of the table.
    """
    rows = table.rename(columns={"sweep": "test"})
    groups = []
    for name, of_place in rows.groupby("direction", sort=False):
        place = result.place(str(name))
        for stepped, of_kind in of_place.groupby("stepped", sort=False):
            axis: Axis = "amplitude" if stepped == "amplitude" else "frequency"
            groups.append(_group(place, axis, of_kind, free=stepped == "neither"))
    return groups


def _group(place: Place, axis: Axis, rows: pd.DataFrame, *, free: bool) -> SweepGroup:
    fixed: Axis = "amplitude" if axis == "frequency" else "frequency"
    header = "test" if free else _header(place, fixed)
    unit = "Hz" if fixed == "frequency" else place.display.displacement.name
    keys, palette = [rows[header]], "loop" if free else str(fixed)
    if not free and "part" in rows and len(set(rows["part"].fillna(""))) > 1:
        keys, palette = ["part " + rows["part"].fillna("not stated"), *keys], "loop"
    if not free and "temperature [degC]" in rows:
        temperature = rows.groupby("test")["temperature [degC]"].transform("mean")
        if temperature.max() - temperature.min() > SAME_TEMPERATURE:
            keys, palette = [temperature.round(1), *keys], "temperature"
    curves = []
    for values, of_level in rows.groupby([key.to_numpy() for key in keys], sort=not free, dropna=False):
        *conditions, level = cast("tuple[str | float, ...]", values)
        words = [value if isinstance(value, str) else f"{number(value, 3)} °C" for value in conditions]
        words.append(level if isinstance(level, str) else format_range(unit, level))
        value = np.nan if isinstance(level, str) else level
        curves.append(Curve(", ".join(words), value, of_level.sort_values(_header(place, axis), kind="stable")))
    return SweepGroup(place, axis, palette, curves)


def _header(place: Place, axis: Axis) -> str:
    return "frequency [Hz]" if axis == "frequency" else columns_of(place)[0]


def means(rows: pd.DataFrame, x_header: str, *headers: str) -> tuple[Array, ...]:
    """Distinct values of a column, (k,), and the means over its repeats of other columns, (k,) each.

    Args:
        rows: rows of a table.
        x_header: column whose distinct values group the rows.
        headers: columns to average.

    Returns:
        Distinct values, (k,), and the means of each column, (k,) each.
    """
    averages = rows.groupby(x_header)[list(headers)].mean()
    return averages.index.to_numpy(dtype=float), *averages.to_numpy(dtype=float).T


def loops_of(table: pd.DataFrame, result: Result) -> Iterator[tuple[Place, dict[str, pd.DataFrame]]]:
    """Loops by name of each place, at most eight, evenly from the first to the last.

    Args:
        table: as `tables.loops_table` or the loops of `tables.gap_table` make it.
        result: model whose specimens give places by their names.
    """
    rows = table.rename(columns={"loop": "test"})
    for name, of_place in rows.groupby("direction", sort=False):
        loops = [(str(test), loop) for test, loop in of_place.groupby("test", sort=False)]
        yield result.place(str(name)), dict(loops[index] for index in spread(len(loops), MOST_LOOPS))


def phase_after_turn(loop: pd.DataFrame, place: Place) -> Array:
    """Phase of each row of a loop after the upper turn of the motion [deg], (n,)."""
    turns = (loop["time [s]"] * loop["frequency [Hz]"]).to_numpy()
    motion = loop[moved_of(place)].to_numpy()
    first_harmonic = np.mean((motion - motion.mean()) * np.exp(-2j * np.pi * turns))
    return 360.0 * ((turns + np.angle(first_harmonic) / (2.0 * np.pi)) % 1.0)


def sector_means(phase: Array, values: Array) -> tuple[Array, Array]:
    """Middle of each sector of the cycle that holds rows [deg], (k,), and the mean of the values in it, (k,)."""
    sectors, place = np.unique(np.floor(phase / SECTOR) % round(360.0 / SECTOR), return_inverse=True)
    return (sectors + 0.5) * SECTOR, np.bincount(place, values) / np.bincount(place)


def ranges(time: Array, values: Array) -> tuple[Array, Array, Array]:
    """Start of each bin of time that holds rows, and the smallest and the largest value in it, (k,) each."""
    first = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], TIME_BINS + 1)[:-1]))
    return time[first], np.minimum.reduceat(values, first), np.maximum.reduceat(values, first)
