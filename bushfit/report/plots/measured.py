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
        place: direction or specimen.
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
        return header_of(self.place, self.axis)

    @property
    def shares_levels(self) -> bool:
        """True if the curves differ by their level alone: no temperatures, parts or free sweeps."""
        return self.palette in ("amplitude", "frequency")

    def thinned(self) -> SweepGroup:
        """At most 24 of the curves, evenly from the first to the last."""
        return self._replace(curves=[self.curves[index] for index in spread(len(self.curves), MOST_CURVES)])


def header_of(place: Place, axis: Axis) -> str:
    """Header of the column of frequencies, or of amplitudes at a place."""
    return "frequency [Hz]" if axis == "frequency" else columns_of(place)[0]


def sweep_groups(table: pd.DataFrame, result: Result) -> list[SweepGroup]:
    """Sweeps of a table grouped by place and by what they step through.

    Args:
        table: as `tables.sweeps_table` or the sweeps of `tables.gap_table` make it.
        result: model whose specimens give places by their names.

    Returns:
        Groups in the order of the table. Curves are distinguished by their level, and by part and temperature where
        these differ.
    """
    groups, order = [], [*dict.fromkeys(table["direction"])]
    for (name, stepped), rows in table.rename(columns={"sweep": "test"}).groupby(["direction", "stepped"], sort=False):
        place, free = result.place(str(name)), stepped == "neither"
        axis, fixed = cast("tuple[Axis, Axis]", ("frequency", "amplitude")[:: -1 if stepped == "amplitude" else 1])
        unit = "Hz" if fixed == "frequency" else place.display.displacement.name
        levels, palette = [rows["test" if free else header_of(place, fixed)]], "loop" if free else str(fixed)
        if not free and "part" in rows and len(set(rows["part"].fillna(""))) > 1:
            levels, palette = ["part " + rows["part"].fillna("not stated"), *levels], "loop"
        if not free and "temperature [degC]" in rows:
            temperature = rows.groupby("test")["temperature [degC]"].transform("mean")
            if temperature.max() - temperature.min() > SAME_TEMPERATURE:
                levels, palette = [temperature.round(1), *levels], "temperature"
        curves = []
        by_level = rows.groupby([level.to_numpy() for level in levels], sort=not free, dropna=False)
        for values, of_level in by_level:
            *conditions, level = cast("tuple[str | float, ...]", values)
            texts = [value if isinstance(value, str) else f"{number(value, 3)} °C" for value in conditions]
            texts.append(level if isinstance(level, str) else format_range(unit, level))
            sorted_rows = of_level.sort_values(header_of(place, axis), kind="stable")
            curves.append(Curve(", ".join(texts), np.nan if isinstance(level, str) else level, sorted_rows))
        groups.append(SweepGroup(place, axis, palette, curves))
    return sorted(groups, key=lambda group: order.index(str(group.place)))


def means(rows: pd.DataFrame, x_header: str, *headers: str) -> tuple[Array, ...]:
    """Distinct values of a column, (k,), and the means over its repeats of other columns, (k,) each.

    Args:
        rows: rows of a table.
        x_header: column whose distinct values group the rows.
        headers: columns to average.
    """
    averages = rows.groupby(x_header)[list(headers)].mean()
    return averages.index.to_numpy(dtype=float), *averages.to_numpy(dtype=float).T


def loops_of(table: pd.DataFrame, result: Result) -> Iterator[tuple[Place, dict[str, pd.DataFrame]]]:
    """Loops by name of each place, at most eight, evenly from the first to the last.

    Args:
        table: as `tables.loops_table` or the loops of `tables.gap_table` make it.
        result: model whose specimens give places by their names.
    """
    for name, of_place in table.rename(columns={"loop": "test"}).groupby("direction", sort=False):
        loops = [(str(test), loop) for test, loop in of_place.groupby("test", sort=False)]
        yield result.place(str(name)), dict(loops[index] for index in spread(len(loops), MOST_LOOPS))


def sector_means(loop: pd.DataFrame, place: Place, header: str) -> tuple[Array, Array]:
    """Means of a column of a loop over sectors of the cycle.

    Args:
        loop: rows of one loop.
        place: direction or specimen of the loop.
        header: column to average.

    Returns:
        Middle of each sector that holds rows, as a phase after the upper turn [deg], and the mean in it, (k,) each.
    """
    sectors, index = np.unique(
        np.floor(phase_after_turn(loop, place) / SECTOR) % round(360.0 / SECTOR), return_inverse=True
    )
    return (sectors + 0.5) * SECTOR, np.bincount(index, loop[header]) / np.bincount(index)


def phase_after_turn(loop: pd.DataFrame, place: Place) -> Array:
    """Phase of each row of a loop after the upper turn of the motion [deg], (n,)."""
    turns = (loop["time [s]"] * loop["frequency [Hz]"]).to_numpy()
    motion = loop[moved_of(place)].to_numpy()
    first_harmonic = np.mean((motion - motion.mean()) * np.exp(-2j * np.pi * turns))
    return np.asarray(360.0 * ((turns + np.angle(first_harmonic) / (2.0 * np.pi)) % 1.0))
