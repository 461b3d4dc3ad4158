"""What is drawn, gathered from the tables of a result: sweeps by level, loops, and where model and tests differ."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from bushfit.effects.contract import Array
from bushfit.geometry import Direction, Place
from bushfit.model.document import TestTable
from bushfit.model.result import Result
from bushfit.report.artifacts import place_names
from bushfit.report.contents import Tables
from bushfit.report.page.chart import Cells
from bushfit.report.tables import IF_RIGS, columns_of, complete, moved_of, numbers, required, spread
from bushfit.units import split_header, told

#: How near a predicted level lies to the measured one that it stands for, relative.
_SAME_LEVEL = 0.02
#: Most levels, tests or loops that a chart draws: more colours are not told apart.
MOST_LEVELS = 8
#: Most columns and rows of a map of cells: each is then some pixels wide and high.
_MOST_COLUMNS, _MOST_ROWS = 24, 12
#: Parts of a cycle over which what is left of a loop is averaged: 15 deg each.
_SECTORS = 24
#: Letters of a test's name beside a map.
_LETTERS = 13


@dataclass(frozen=True, eq=False)
class Curve:
    """One level of sweeps: |K| and loss factor, measured (mean of the repeats) and of the model, over x.

    Args:
        measured, model: x, |K| and loss factor, (3, n); of the model none where there is no prediction of this level.
        band: low and high of |K|, then of the loss factor, over the x of the model, (4, n), where they are known.
        rigs: |K| and loss factor if an unresolved effect is the rig's, over the x of the model, (2, n), where there is
            one.
    """

    name: str
    measured: Array
    model: Array
    band: Array | None = None
    rigs: Array | None = None


@dataclass(frozen=True, eq=False)
class Sweeps:
    """Sweeps of one place that step through the same; see `Curve`.

    Args:
        stepped: frequency or amplitude; None where nothing was held, and each test is a curve over frequency.
        x_label: of what lies along x.
        predicted: whether the lines are those of the prediction.
        left_out: levels that are not drawn.
    """

    place: Place
    stepped: str | None
    x_label: str
    curves: Sequence[Curve]
    predicted: bool
    left_out: int


@dataclass(frozen=True, eq=False)
class LoopCurve:
    """The last cycle of a loop: displacement, measured and modelled force, (3, n); every so many-th row is drawn."""

    name: str
    rows: Array
    every: int


def places_of(result: Result, tables: Tables) -> dict[str, Place]:
    """Every place of which there are tests or predictions, directions first, by the name of its table."""
    every: list[Place] = [*(Direction if result.model.bushing else ()), *result.specimens]
    tested = {place for table in tables.values() if "direction" in table for place in table["direction"].unique()}
    named = zip(place_names(every), every, strict=True)
    return {name: place for name, place in named if name in tables or str(place) in tested}


def tests_of(tables: Tables, kind: str) -> pd.DataFrame | None:
    """All points of sweeps, or rows of loops: their own table, else the rows of that kind of the gap's."""
    if (table := tables.get(f"{kind}s")) is not None:
        return required(table.rename(columns={kind: "test"}), "test", "direction")
    gap = gap_of(tables)
    if gap is None or not any(str(name).startswith("model ") for name in gap):  # an older version's
        return None
    return gap[gap["kind"] == kind]


def gap_of(tables: Tables) -> pd.DataFrame | None:
    """The table of what is left before and after a diagnosis, where there is one."""
    gap = tables.get("gap")
    return None if gap is None else required(gap, "test", "kind", "direction")


def sweeps_at(
    place: Place, rows: pd.DataFrame, tests: Sequence[TestTable], predicted: pd.DataFrame | None, most: int
) -> Iterator[Sweeps]:
    """The sweeps of a place by what they step through, of each curve at most so many points."""
    stiffness = columns_of(place)[1]
    names = stiffness, "loss factor [-]"
    for stepped, along, held, mine in _by_kind(place, rows, tests):
        headers = [along, *names, *(f"model {name}" for name in names)]
        mine = complete(mine, *headers)
        levels = list(dict.fromkeys(mine[held])) if stepped is None else np.unique(mine[held]).tolist()
        curves = []
        for level in (levels[at] for at in spread(len(levels), MOST_LEVELS)):
            there = mine[mine[held] == level].sort_values(along)
            if stepped:
                there = there.groupby(along, as_index=False)[headers[1:]].mean()
            points = numbers(there, *headers)[:, thin(len(there), most)]
            line = _predicted(predicted, along, held, level, names) if stepped else None
            model, band, rigs = (points[[0, 3, 4]], None, None) if line is None else line
            curves.append(Curve(_level(level, held), points[:3], model, band, rigs))
        lined = all(curve.band is not None for curve in curves)
        yield Sweeps(place, stepped, along, curves, lined, len(levels) - len(curves))


def _by_kind(
    place: Place, rows: pd.DataFrame, tests: Sequence[TestTable]
) -> Iterator[tuple[str | None, str, str, pd.DataFrame]]:
    """Sweeps that step through the same: what it is, the headers of what lies along x and of what is held (the test,
    where nothing is), and the rows."""
    said, amplitude, frequency = {test.test: test.stepped for test in tests}, columns_of(place)[0], "frequency [Hz]"
    rows = complete(rows, frequency, amplitude)
    steps: dict[str | None, list[str]] = {}
    for test in dict.fromkeys(rows["test"]):
        levels = (np.unique(values).size for values in numbers(rows[rows["test"] == test], frequency, amplitude))
        by_count = "frequency" if next(levels) >= next(levels) else "amplitude"
        steps.setdefault(said.get(test, by_count), []).append(test)
    for stepped, names in steps.items():
        along, held = (amplitude, frequency) if stepped == "amplitude" else (frequency, amplitude)
        yield stepped, along, held if stepped else "test", rows[rows["test"].isin(names)]


def _level(level: float | str, held: str) -> str:
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
    near = known[np.abs(known[held] - level) < _SAME_LEVEL * abs(level)].sort_values(along)
    if near.empty:
        return None
    return numbers(near, along, *names), numbers(near, *band), numbers(near, *rigs) if rigs[0] in near else None


def loops_at(place: Place, rows: pd.DataFrame, tests: Sequence[TestTable], most: int) -> list[LoopCurve]:
    """The loops of a place, at most eight, each with at most so many rows of its last cycle."""
    resisting, frequency = columns_of(place)[2], {test.test: test.frequency_Hz[0] for test in tests}
    headers = moved_of(place), resisting, f"model {resisting}"
    rows = complete(rows, "time [s]", *headers)
    names = list(dict.fromkeys(rows["test"]))
    curves = []
    for name in (names[at] for at in spread(len(names), MOST_LEVELS)):
        mine = rows[rows["test"] == name]
        (time,) = numbers(mine, "time [s]")
        period = 1.0 / frequency[name] if frequency.get(name) else np.inf
        last = numbers(mine, *headers)[:, time >= time.max() - period]
        every = max(1, -(-last.shape[1] // most))
        curves.append(LoopCurve(name, last[:, ::every], every))
    return curves


def thin(count: int, most: int) -> slice:
    """Every so many-th of some rows, at most so many."""
    return slice(None, None, max(1, -(-count // most)))


def cells_at(place: Place, gap: pd.DataFrame, tests: Sequence[TestTable]) -> Iterator[Cells]:
    """Maps of a place: measured less model in %, of sweeps storage and loss, of loops the force."""
    mine = gap[gap["direction"] == str(place)]
    for stepped, along, held, rows in _by_kind(place, mine[mine["kind"] == "sweep"], tests):
        (x,), (name, unit) = numbers(rows, along), along.rstrip("]").split(" [")
        ends = told(unit, float(x.min())), name, told(unit, float(x.max()))
        for part in ("storage", "loss"):
            yield _map(part, rows, held if stepped else "test", x, ends)
    loops = complete(mine[mine["kind"] == "loop"], "time [s]", "frequency [Hz]", moved_of(place))
    if len(loops):
        each = (loops[loops["test"] == test] for test in dict.fromkeys(loops["test"]))
        turned = np.concatenate([_phase(place, rows) for rows in each])
        yield _map("force", loops, "test", np.floor(turned * _SECTORS), ("upper turn", "cycle", "360 deg"))


def _phase(place: Place, rows: pd.DataFrame) -> Array:
    """Phase of the rows of a loop after the upper turn of its motion, in cycles, (n,)."""
    time, frequency, moved = numbers(rows, "time [s]", "frequency [Hz]", moved_of(place))
    first = np.mean((moved - moved.mean()) * np.exp(-2j * np.pi * time * frequency))
    return (time * frequency + np.angle(first) / (2.0 * np.pi)) % 1.0


def _map(part: str, table: pd.DataFrame, held: str, along: Array, ends: tuple[str, str, str]) -> Cells:
    """One map: means over the rows of the table that fall into a cell, before and after."""
    (row, levels), (column, columns) = _binned(table[held].to_numpy(), _MOST_ROWS), _binned(along, _MOST_COLUMNS)
    cell, size = row * len(columns) + column, len(levels) * len(columns)
    count = np.bincount(cell, minlength=size)
    sides = []
    for off in numbers(table, *(f"{part} {when} [%]" for when in ("before", "after"))):
        sums = np.bincount(cell, -np.nan_to_num(off), minlength=size)
        sides.append(np.where(count > 0, sums / np.maximum(count, 1), np.nan).reshape(len(levels), -1))
    same = np.array_equal(sides[0], sides[1], equal_nan=True)
    return Cells(part, [_short(_level(level, held)) for level in levels], ends, sides[:1] if same else sides)


def _binned(values: Any, most: int) -> tuple[Array, list[Any]]:
    """Number of the bin of each value, and the first value of each of at most so many bins of neighbours."""
    levels, place = np.unique(values, return_inverse=True)
    bins = np.arange(levels.size) * min(most, levels.size) // levels.size
    return bins[place], levels[np.unique(bins, return_index=True)[1]].tolist()


def _short(test: str) -> str:
    return test if len(test) <= _LETTERS else f"{test[: _LETTERS - 6]}…{test[-5:]}"
