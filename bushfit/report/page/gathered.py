"""What is drawn, gathered from the tables of a result: sweeps by level, loops, and where model and tests differ."""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from bushfit.effects.contract import Array
from bushfit.geometry import Direction, Place
from bushfit.model.result import Result
from bushfit.report.artifacts import place_names
from bushfit.report.page.chart import Cells
from bushfit.report.tables import IF_RIGS, spread, words
from bushfit.units import number

if TYPE_CHECKING:
    import pandas as pd

    from bushfit.report.contents import Tables
    from bushfit.report.page.schema import Test

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
    tested = {place for table in tables.values() if "direction" in table for place in table["direction"]}
    named = zip(place_names(every), every, strict=True)
    return {name: place for name, place in named if name in tables or str(place) in tested}


def tests_of(tables: Tables, kind: str) -> pd.DataFrame | None:
    """All points of sweeps, or rows of loops: their own table, else the rows of that kind of the gap's."""
    if (table := tables.get(f"{kind}s")) is not None:
        return table.rename(columns={kind: "test"})
    gap = tables.get("gap")
    return None if gap is None else gap[gap["kind"] == kind]


def columns_of(place: Place) -> tuple[str, str, str]:
    """Headers of amplitude, |K| and the force in the tables of a place."""
    (length, _), (force, _), (stiffness, _) = place.display
    moved, resisting, resisted = words(place)
    return f"{moved} [{length}]", f"{resisted} [{stiffness}]", f"{resisting} [{force}]"


def sweeps_at(place: Place, rows: pd.DataFrame, tests: Sequence[Test], predicted: pd.DataFrame | None, most: int) -> Iterator[Sweeps]:
    """The sweeps of a place by what they step through, of each curve at most so many points."""
    stepped = _stepped(rows, place, tests)
    amplitude, stiffness, _ = columns_of(place)
    for kind in dict.fromkeys(stepped.values()):
        mine = rows[rows["test"].isin([test for test, own in stepped.items() if own == kind])]
        along, held = (amplitude, "frequency [Hz]") if kind == "amplitude" else ("frequency [Hz]", amplitude)
        if kind is None:
            yield _as_it_came(place, mine, along, stiffness, most)
            continue
        headers = [along, stiffness, "loss factor [-]", f"model {stiffness}", "model loss factor [-]"]
        levels = np.unique(mine[held])
        drawn = levels[spread(levels.size, MOST_LEVELS)]
        unit = held.partition("[")[2].rstrip("]")
        curves = []
        for level in drawn:
            there = mine[mine[held] == level].groupby(along, as_index=False)[headers[1:]].mean()
            points = there[headers].to_numpy(dtype=float).T[:, _thin(len(there), most)]
            line = _predicted(predicted, along, held, float(level), stiffness)
            model, band, rigs = (points[[0, 3, 4]], None, None) if line is None else line
            curves.append(Curve(f"{number(float(level), 3)} {unit}", points[:3], model, band, rigs))
        lined = all(curve.band is not None for curve in curves)
        yield Sweeps(place, kind, along, curves, lined, levels.size - drawn.size)


def _as_it_came(place: Place, rows: pd.DataFrame, along: str, stiffness: str, most: int) -> Sweeps:
    """Sweeps in which nothing was held: a curve a test."""
    names = list(dict.fromkeys(rows["test"]))
    drawn = [names[at] for at in spread(len(names), MOST_LEVELS)]
    headers = [along, stiffness, "loss factor [-]", f"model {stiffness}", "model loss factor [-]"]
    curves = []
    for name in drawn:
        there = rows[rows["test"] == name].sort_values(along)[headers].to_numpy(dtype=float).T
        there = there[:, _thin(there.shape[1], most)]
        curves.append(Curve(name, there[:3], there[[0, 3, 4]]))
    return Sweeps(place, None, along, curves, False, len(names) - len(drawn))


def _predicted(
    table: pd.DataFrame | None, along: str, held: str, level: float, stiffness: str
) -> tuple[Array, Array, Array | None] | None:
    """The prediction at a level: x, |K| and loss factor, their band, and both if they are the rig's; None where it has
    none."""
    if table is None or not {along, held} <= set(table):
        return None
    near = table[np.abs(table[held] / level - 1.0) < _SAME_LEVEL].sort_values(along)
    if near.empty:
        return None
    names = (stiffness, "loss factor [-]")
    rigs = [f"{name}, {IF_RIGS}" for name in names]
    band = [f"{name}, {end}" for name in names for end in ("low", "high")]
    values = near[[along, *names]].to_numpy(dtype=float).T, near[band].to_numpy(dtype=float).T
    return *values, near[rigs].to_numpy(dtype=float).T if rigs[0] in near else None


def _stepped(rows: pd.DataFrame, place: Place, tests: Sequence[Test]) -> dict[str, str | None]:
    """What each test steps through; of a result that does not say it, what takes more values."""
    said = {test.test: test.stepped for test in tests}
    amplitude = columns_of(place)[0]

    def told(test: str) -> str | None:
        mine = rows[rows["test"] == test]
        return "amplitude" if mine[amplitude].nunique() > mine["frequency [Hz]"].nunique() else "frequency"

    return {test: said[test] if test in said else told(test) for test in dict.fromkeys(rows["test"])}


def loops_at(place: Place, rows: pd.DataFrame, tests: Sequence[Test], most: int) -> list[LoopCurve]:
    """The loops of a place, at most eight, each with at most so many rows of its last cycle."""
    resisting = columns_of(place)[2]
    moved = f"{place.motion.words[0]} [{place.display.displacement.name}]"
    frequency = {test.test: test.frequency_Hz[0] for test in tests}
    names = list(dict.fromkeys(rows["test"]))
    curves = []
    for name in (names[at] for at in spread(len(names), MOST_LEVELS)):
        mine = rows[rows["test"] == name]
        time = mine["time [s]"].to_numpy(dtype=float)
        period = 1.0 / frequency[name] if frequency.get(name) else np.inf
        last = mine[time >= time[-1] - period * (1.0 + 1e-6)]
        every = max(1, -(-len(last) // most))
        curves.append(LoopCurve(name, last[[moved, resisting, f"model {resisting}"]].to_numpy(dtype=float).T[:, ::every], every))
    return curves


def _thin(count: int, most: int) -> slice:
    """Every so many-th of some rows, at most so many."""
    return slice(None, None, max(1, -(-count // most)))


def cells_at(place: Place, gap: pd.DataFrame, tests: Sequence[Test]) -> Iterator[Cells]:
    """Maps of a place: measured less model in %, of sweeps storage and loss, of loops the force."""
    mine = gap[gap["direction"] == str(place)]
    sweeps, loops = mine[mine["kind"] == "sweep"], mine[mine["kind"] == "loop"]
    if len(sweeps):
        stepped = _stepped(sweeps, place, tests)
        amplitude = columns_of(place)[0]
        for kind in dict.fromkeys(stepped.values()):
            chosen = sweeps[sweeps["test"].isin([test for test, own in stepped.items() if own == kind])]
            along, held = (amplitude, "frequency [Hz]") if kind == "amplitude" else ("frequency [Hz]", amplitude)
            unit = held.partition("[")[2].rstrip("]")
            rows = chosen["test"] if kind is None else chosen[held]
            label = (lambda test: _name(str(test))) if kind is None else (lambda level, unit=unit: f"{number(float(level), 3)} {unit}")
            x = chosen[along].to_numpy(dtype=float)
            ends = number(float(x.min()), 3), along.partition(" [")[0], f"{number(float(x.max()), 3)} {along.partition('[')[2].rstrip(']')}"
            for part in ("storage", "loss"):
                yield _map(part, rows.to_numpy(), x, chosen, part, label, ends)
    if len(loops):
        phase = np.concatenate([_phase(place, loops[loops["test"] == test]) for test in dict.fromkeys(loops["test"])])
        sector = np.floor(phase * _SECTORS)
        yield _map("force", loops["test"].to_numpy(), sector, loops, "force", lambda test: _name(str(test)), ("upper turn", "cycle", "360 deg"))


def _phase(place: Place, rows: pd.DataFrame) -> Array:
    """Phase of the rows of a loop after the upper turn of its motion, in cycles, (n,)."""
    phase = rows["time [s]"].to_numpy(dtype=float) * rows["frequency [Hz]"].to_numpy(dtype=float)
    moved = rows[f"{place.motion.words[0]} [{place.display.displacement.name}]"].to_numpy(dtype=float)
    first = np.mean((moved - moved.mean()) * np.exp(-2j * np.pi * phase))
    return (phase + np.angle(first) / (2.0 * np.pi)) % 1.0


def _map(name: str, rows: Array, along: Array, table: pd.DataFrame, part: str, label: object, ends: tuple[str, str, str]) -> Cells:
    """One map: means over the rows of the table that fall into a cell, before and after."""
    row, labels = _binned(rows, _MOST_ROWS)
    column, columns = _binned(along, _MOST_COLUMNS)
    place = row * columns.size + column
    count = np.bincount(place, minlength=labels.size * columns.size).astype(float)
    sides = []
    for when in ("before", "after"):
        off = -table[f"{part} {when} [%]"].to_numpy(dtype=float)
        with np.errstate(invalid="ignore"):
            mean = np.bincount(place, off, minlength=count.size) / count
        sides.append(mean.reshape(labels.size, columns.size))
    same = bool(np.array_equal(sides[0], sides[1], equal_nan=True))
    return Cells(name, [label(each) for each in labels], ends, sides[:1] if same else sides)


def _binned(values: Array, most: int) -> tuple[Array, Array]:
    """Number of the bin of each value, and a value for each of at most so many bins of neighbours."""
    levels, place = np.unique(values, return_inverse=True)
    bins = np.minimum(np.arange(levels.size) * most // max(levels.size, most), most - 1) if levels.size > most else np.arange(levels.size)
    _, first = np.unique(bins, return_index=True)
    return bins[place], levels[first]


def _name(test: str) -> str:
    return test if len(test) <= _LETTERS else f"{test[: _LETTERS - 6]}…{test[-5:]}"
