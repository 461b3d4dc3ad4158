"""Measured points from the tables of results, grouped into the panels and curves of figures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple, cast

import numpy as np
import pandas as pd
from matplotlib.axes import Axes

from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.result import Result
from bushfit.prediction.stiffness import Prediction
from bushfit.reading.measurement import SAME_TEMPERATURE
from bushfit.reading.preload import SAME_PRELOAD
from bushfit.reduction.harmonics import cycle_harmonics
from bushfit.report.plots.style import Style
from bushfit.report.tables import displacement_header, response_headers, spread_indices
from bushfit.units import CELSIUS, format_range, number

#: Quantity along the x axis of a sweep.
Axis = Literal["frequency", "amplitude"]
#: Width of a sector of a loop's cycle over which residuals are averaged [deg].
SECTOR = 10.0
#: Largest numbers of curves of a group, and of loops of a direction or specimen, that are drawn.
MOST_CURVES, MOST_LOOPS = 24, 8


class Curve(NamedTuple):
    """Points of sweeps at one fixed amplitude (or frequency): one curve of a figure.

    Args:
        name: legend label, the fixed amplitude or frequency with its unit, or the name of the test if neither is fixed.
        level: fixed amplitude or frequency in the unit of the table; NaN if neither is fixed.
        rows: rows of the table, sorted by the stepped quantity.
    """

    name: str
    level: float
    rows: pd.DataFrame


class SweepGroup(NamedTuple):
    """Sweeps of one direction or specimen that step through the same quantity: one panel of a figure.

    Args:
        place: direction or specimen.
        axis: stepped quantity, drawn along x.
        x_header: header of the table column of this quantity.
        palette: colour scale, named after the quantity that distinguishes the curves: "amplitude", "frequency",
            "temperature" or, for parts and free sweeps, "loop".
        curves: a curve per fixed amplitude (or frequency), ascending.
    """

    place: Place
    axis: Axis
    x_header: str
    palette: str
    curves: Sequence[Curve]

    def thinned(self) -> SweepGroup:
        """Copy of the group with at most 24 of its curves, evenly chosen from the first to the last."""
        return self._replace(curves=[self.curves[index] for index in spread_indices(len(self.curves), MOST_CURVES)])


def header_of(place: Place, axis: Axis) -> str:
    """Header of the frequency or amplitude column (`axis`) in tables of a direction or specimen: "amplitude [mm]"."""
    return "frequency [Hz]" if axis == "frequency" else response_headers(place)[0]


def sweep_groups(table: pd.DataFrame, result: Result) -> list[SweepGroup]:
    """Group the sweeps of a table by direction or specimen and by stepped quantity, for the panels of a figure.

    Args:
        table: measured and modelled sweeps, a row per point, with the columns of sweeps.csv or gap.csv.
        result: model, which gives the specimens by their names.

    Returns:
        Groups in the order of the table. The curves of a group differ in the fixed amplitude or frequency, and in part,
        temperature or preload if tests differ in these.
    """
    groups, order = [], [*dict.fromkeys(table["direction"])]
    for (name, stepped), rows in table.rename(columns={"sweep": "test"}).groupby(["direction", "stepped"], sort=False):
        place, free = result.place(str(name)), stepped == "neither"
        axis, fixed = cast("tuple[Axis, Axis]", ("frequency", "amplitude")[:: -1 if stepped == "amplitude" else 1])
        unit = "Hz" if fixed == "frequency" else place.display.displacement.name
        units, levels = list[str](), [rows["test" if free else header_of(place, fixed)]]
        palette = "loop" if free else str(fixed)
        if not free and "part" in rows and len(set(rows["part"].fillna(""))) > 1:
            levels, palette, units = ["part " + rows["part"].fillna("not stated"), *levels], "loop", ["", *units]
        if not free and "temperature [degC]" in rows:
            temperature = rows.groupby("test")["temperature [degC]"].transform("mean")
            if temperature.max() - temperature.min() > SAME_TEMPERATURE:
                levels, palette, units = [temperature.round(1), *levels], "temperature", ["°C", *units]
        for header in map(str, () if free else rows):
            if header.startswith("preload [") and rows[header].min() < rows[header].max():
                levels, palette, units = [rows[header], *levels], "loop", [f"{header[9:-1]} preload", *units]
        curves = []
        by_level = rows.groupby([level.to_numpy() for level in levels], sort=not free, dropna=False)
        for values, of_level in by_level:
            *conditions, level = cast("tuple[str | float, ...]", values)
            texts = [
                value if isinstance(value, str) else f"{number(value, 3)} {condition_unit}"
                for value, condition_unit in zip(conditions, units, strict=True)
            ]
            texts.append(level if isinstance(level, str) else format_range(unit, level))
            sorted_rows = of_level.sort_values(header_of(place, axis), kind="stable")
            curves.append(Curve(", ".join(texts), np.nan if isinstance(level, str) else level, sorted_rows))
        groups.append(SweepGroup(place, axis, header_of(place, axis), palette, curves))
    return sorted(groups, key=lambda group: order.index(str(group.place)))


def table_stiffness(rows: pd.DataFrame, place: Place, before: str = "") -> Array:
    """Complex stiffness [N/m, N m/rad or Pa], measured or modelled, in n rows of a table of sweeps, (n,).

    Args:
        rows: rows of one direction or specimen.
        place: the direction or specimen.
        before: prefix of the headers, "model " for the modelled stiffness.
    """
    loss = rows[f"{before}loss factor [-]"].to_numpy()
    magnitude = rows[before + response_headers(place)[1]].to_numpy() / place.display.stiffness.factor
    return np.asarray(magnitude * np.exp(1j * np.arctan(loss)))


def rows_at_conditions(table: pd.DataFrame, prediction: Prediction) -> pd.DataFrame:
    """Select the measured sweep points to draw with a prediction: of the same direction, preload and temperature.

    Args:
        table: measured sweeps, a row per point, with the columns of sweeps.csv; it may lack preload and temperature.
        prediction: the prediction; its temperature is ignored if the model does not depend on it.

    Returns:
        The selected rows, with the name of the sweep in the column "test".
    """
    rows = table[table["direction"] == str(prediction.direction)].rename(columns={"sweep": "test"})
    preload, kelvin = prediction.conditions.preload, prediction.conditions.temperature
    value, unit = preload.in_display_unit(prediction.direction) if preload else (0.0, "")
    if (header := f"preload [{unit}]") in rows:
        rows = rows[~((rows[header] - value).abs() > SAME_PRELOAD * max(abs(value), rows[header].abs().max()))]
    if "temperature [degC]" in rows and kelvin is not None:
        degrees = rows.groupby("test")["temperature [degC]"].transform("mean")
        rows = rows[~((degrees - (kelvin - CELSIUS)).abs() > SAME_TEMPERATURE)]
    return rows


def loops_by_direction(table: pd.DataFrame, result: Result) -> Iterator[tuple[Place, dict[str, pd.DataFrame]]]:
    """Split a table into the loops of each direction or specimen, for the panels of a figure.

    Args:
        table: measured and modelled loops, a row per sample, with the columns of loops.csv or gap.csv.
        result: model, which gives the specimens by their names.

    Yields:
        Direction or specimen, and the rows of at most eight of its loops by the name of the test.
    """
    for name, of_place in table.rename(columns={"loop": "test"}).groupby("direction", sort=False):
        loops = [(str(test), loop) for test, loop in of_place.groupby("test", sort=False)]
        yield result.place(str(name)), dict(loops[index] for index in spread_indices(len(loops), MOST_LOOPS))


def draw_sector_means(axes: Axes, loop: pd.DataFrame, place: Place, header: str, look: Style) -> None:
    """Draw the means of a column of a loop over sectors of 10 degrees of the cycle, from 0 to 360 degrees.

    Args:
        axes: panel.
        loop: rows of one loop.
        place: direction or specimen of the loop.
        header: header of the column to average.
        look: colour and line style.
    """
    sectors = np.floor(phase_after_turn(loop, place) / SECTOR) % round(360.0 / SECTOR)
    means = loop[header].groupby(sectors).mean()
    axes.plot((means.index + 0.5) * SECTOR, means, color=look.color, ls=look.dashes, lw=1.4)
    axes.set(xlim=(0.0, 360.0), xticks=range(0, 360, 90))


def phase_after_turn(loop: pd.DataFrame, place: Place) -> Array:
    """Phase of each row of a loop [deg], (n,), from 0 at the peak of the motion up to 360."""
    cycles = (loop["time [s]"] * loop["frequency [Hz]"]).to_numpy()
    _, fundamental, _ = cycle_harmonics(cycles, loop[[displacement_header(place)]].to_numpy(), order=1)
    return np.asarray(360.0 * ((cycles + np.angle(fundamental[0]) / (2.0 * np.pi)) % 1.0))
