"""Whatever a command shows is what it writes: lines and points of its figures, cells and figures of its lines, all are
numbers of its tables and documents; and it keeps every file that it read."""

import json
import re
import tomllib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pandas as pd
import pytest
from commandline import Done, call
from matplotlib.axes import Axes
from shell import CAMPAIGN

from bushfit.cli import output
from bushfit.report.results import Formats, contents

MODEL = "model/model.json"
GRID = ("--frequencies", "0.5, 5, 50, 150 Hz", "--amplitudes", "0.1, 0.2, 0.5 mm")
SHAKEN = ("--mass", "3 kg", "--base-acceleration", "1 m/s^2")
COMMANDS: dict[str, tuple[str, ...]] = {
    "fit-static": (CAMPAIGN, "--dynamic", MODEL), "fit-dynamic": (CAMPAIGN, "--static", MODEL),
    "fit": (CAMPAIGN, "--profile"), "predict": (MODEL, "--campaign", CAMPAIGN, *GRID, "--static", "--arms", *SHAKEN),
    "compare": (MODEL, "data/arm_bushing/truth.json"), "diagnose": ("data/practice/case_001/bushing.toml",),
    "respond": (MODEL, "data/road/axial_radial.csv"),
    "reduce": ("data/cmp_15961_raw/stepped_sine_axial.csv",), "plan": (CAMPAIGN, "--hours", "1"),
    "inspect": ("data/cmp_15961/loop_axial_1.csv", "data/cmp_15961/sweep_axial.csv"),
    "export": (MODEL, "--campaign", CAMPAIGN, "--format", "csv"),
}  # fmt: skip
#: SI values in the units in which they are printed.
FACTORS = {
    "": 1.0, "-": 1.0, "%": 1e2, "0.01": 1e2, "mm": 1e3, "N/mm": 1e-3, "MPa": 1e-6, "kPa": 1e-3, "MPa*s^alpha": 1e-6,
    "Hz": 1.0, "kg": 1.0, "N": 1.0, "W": 1.0, "m/N": 1.0, "mm/kN": 1e6, "1/s": 1.0, "kN/m": 1e-3,
}  # fmt: skip
UNITS = "|".join(unit for unit in sorted(FACTORS, key=len, reverse=True) if unit not in ("", "-", "0.01"))
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:e-?\d+)?"
#: Words of axes and of headers that name one quantity.
PLACES = {"axial", "radial", "torsion"}
WORDS = PLACES | {
    *("stiffness", "storage", "loss", "force", "displacement", "residual", "distortion", "transmissibility"),
    *("amplitude", "frequency", "time", "error", "phase"),
}


@dataclass
class Ran:
    """What a command left: what it printed, its result files by kind, and the files that it must not replace."""

    done: Done
    tables: dict[str, pd.DataFrame] = field(default_factory=dict)
    documents: dict[str, Any] = field(default_factory=dict)
    figures: dict[str, Any] = field(default_factory=dict)
    inputs: set[Path] = field(default_factory=set)
    cells: list[tuple[str, str]] = field(default_factory=list)


@pytest.fixture(scope="module")
def folder(work, root) -> Path:
    """The folder of the paper's campaign with all data of the repository."""
    for name in ("configs", "data"):
        for path in (root / name).iterdir():
            if not (work / name / path.name).exists():
                (work / name / path.name).symlink_to(path)
    return work


def run(folder: Path, results: Path, name: str) -> Ran:
    found, (write, table) = Ran(Done(0, "", "")), (output.write_results, output.Output.print_table)

    def keep(to: Path, files: Iterable[Any], formats: Formats, *, overwrite: bool, inputs: Iterable[Path]) -> list[str]:
        files = list(files)
        found.tables, found.documents, found.figures = (contents(files, kind) for kind in ("table", "json", "figure"))
        found.inputs = {path.resolve() for path in inputs}
        return write(to, files, Formats(pictures=False), overwrite=overwrite, inputs=found.inputs)

    def cells(self: Any, title: str, columns: list[str], rows: Iterable[list[str]], **options: Any) -> None:
        rows = [[*row] for row in rows]
        for row in rows:
            own = row[columns.index("unit")] if "unit" in columns else ""
            for column, cell in zip(columns, row, strict=True):
                relative = column == "95 % interval" and any(each.endswith(" %") for each in row)
                found.cells.append((cell, "%" if relative else unit_of(column, title) or own))
        table(self, title, columns, rows, **options)

    with mock.patch.object(output, "write_results", keep), mock.patch.object(output.Output, "print_table", cells):
        found.done = call(folder, name, *COMMANDS[name], "-o", results / "x", "--json")
    assert found.done.returncode < 2, found.done.stderr
    found.documents["printed"] = json.loads(found.done.stdout)
    for file in sorted(found.inputs) if name == "inspect" else ():
        found.tables[file.stem] = pd.read_csv(file)
    return found


def unit_of(column: str, title: str) -> str:
    """Unit in a header, else in the part of a title that has the header, else the only unit of a title."""
    if unit := re.search(r"\[(.+)\]", column):
        return unit[1]
    parts = re.findall(r"([^,:]*)\[(.+?)\]", title)
    named = [unit for words, unit in parts if column and column in words.split()]
    return named[0] if named else parts[0][1] if len(parts) == 1 else ""


def numbers_of(value: Any) -> Iterator[float]:
    """All numbers of a document."""
    if isinstance(value, dict | list | tuple):
        for part in value.values() if isinstance(value, dict) else value:
            yield from numbers_of(part)
    elif isinstance(value, np.ndarray):
        yield from value.ravel().tolist()
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield float(value)


def known(found: Ran) -> dict[str, np.ndarray]:
    """Numbers by their unit: those of documents are in SI."""
    si = np.array([number for document in found.documents.values() for number in numbers_of(document)])
    pool = {unit: [factor * si] for unit, factor in FACTORS.items()}
    for table in found.tables.values():
        for header in table.select_dtypes("number"):
            unit, values = unit_of(str(header), ""), table[header].to_numpy(float)
            for shown in ("-", "%", "0.01") if unit == "-" else (unit,):
                pool.setdefault(shown, []).append(FACTORS.get(shown, 1.0) * values if unit == "-" else values)
    return {unit: np.concatenate(values) for unit, values in pool.items()}


def is_known(text: str, values: np.ndarray) -> bool:
    """Whether a number is one of the values, rounded to its last digit."""
    mantissa, number = text.partition("e")[0], abs(float(text))
    digits = len(mantissa.partition(".")[2]) or len(mantissa.rstrip("0")) - len(mantissa)
    return bool(np.any(np.abs(values - float(text)) <= max(0.51 * 10.0**-digits, 6e-4 * number)))


def misprinted(found: Ran) -> list[tuple[str, str]]:
    """Cells of printed tables with a number that no table and no document has in this unit."""
    pool, wrong = known(found), []
    for cell, unit in found.cells:
        form = re.fullmatch(rf"({NUMBER})(?: to ({NUMBER}))?(?: \(({NUMBER}) to ({NUMBER})\))?( %)?", cell.strip())
        shown = "%" if form and form[5] else unit
        numbers = [text for text in form.groups()[:4] if text] if form else []
        wrong += [(cell, shown) for text in numbers if not is_known(text, pool.get(shown, np.empty(0)))]
    return wrong


def label(axes: Axes, axis: str) -> str:
    """Label of an axis, or of the panel that shares it."""
    shared = getattr(axes, f"get_shared_{axis}_axes")().get_siblings(axes)
    labels = [getattr(each, f"get_{axis}label")() for each in (axes, *shared)]
    return " ".join(next(filter(None, labels), "").split())


def columns_of(table: pd.DataFrame, wanted: str) -> list[str]:
    """Columns of the quantity and unit of an axis; a table of one direction does not name it in its headers."""
    unit, words = unit_of(wanted.replace("/ noise", "[noise]"), ""), WORDS & set(re.findall(r"\w+", wanted))
    numbers = {name: WORDS & set(re.findall(r"\w+", name)) for name in table.select_dtypes("number")}
    fitting = [name for name in numbers if unit_of(name, "") == unit]
    return [name for name in fitting if numbers[name] in (words, words - PLACES)]


def misdrawn(found: Ran) -> tuple[list[str], set[str]]:
    """Lines and points beyond the values of the table with the name of the figure, and axes that no table has."""
    wrong, unknown = list[str](), set[str]()
    for name, figure in found.figures.items():
        tables = [found.tables[name]] if name in found.tables else [*found.tables.values()]
        for axes in figure.axes:
            labels = [label(axes, axis) for axis in "xy"]
            drawn = [line for line in axes.get_lines() if len(line.get_xdata()) > 2]
            columns = [(table, *(columns_of(table, text) for text in labels)) for table in tables]
            table, across, up = next((each for each in columns if all(each[1:])), (pd.DataFrame(), [], []))
            if not across:
                unknown |= {f"{name}: {', '.join(labels)}"} if drawn else set()
                continue
            for column in {"direction", "place"} & {*table}:
                shown = [place for place in set(table[column]) if labels[1].startswith(str(place))]
                table = table[table[column].isin(shown)] if shown else table
            x = np.unique(table[across[0]].dropna())
            if drawn and {"frequency", "amplitude"} & set(labels[0].split()):
                ends = np.concatenate([line.get_xdata() for line in drawn])
                assert axes.get_xscale() == ("log" if ends.max() > 40.0 * ends.min() else "linear"), (name, labels)
            for line in drawn:
                points = np.array(line.get_xydata(), float)
                for at, value in points[np.isfinite(points).all(axis=1)][:: max(len(points) // 100, 1)]:
                    low, high = x[[max(np.searchsorted(x, at) - 1, 0), min(np.searchsorted(x, at) + 1, x.size - 1)]]
                    values = table.loc[table[across[0]].between(low, high), up].to_numpy(float)
                    ends = np.nanmin(values), np.nanmax(values)
                    slack = 0.03 * np.abs(ends).max()
                    if not ends[0] - slack <= value <= ends[1] + slack:
                        wrong.append(f"{name}: {labels[1]} {value:.4g} at {at:.4g}, not {ends}")
                        break
    return wrong, unknown


def misquoted(found: Ran) -> list[str]:
    """Numbers with a unit in printed lines that no table and no document has; warnings tell of what else was seen."""
    pool, wrong = known(found), []
    warnings = {*texts_of([document.get("warnings") for document in found.documents.values()])}
    for line in found.done.stderr.splitlines():
        if line.startswith("warning: ") or any(line.strip() in text for text in warnings):
            continue
        for first, second, unit in re.findall(rf"(?<![\w.])({NUMBER})(?: to ({NUMBER}))? ({UNITS})(?![\w/])", line):
            numbers = [number for number in (first, second) if number and f"{number} {unit}" != "95 %"]
            wrong += [f"{number} {unit}: {line}" for number in numbers if not is_known(number, pool[unit])]
    return wrong


def texts_of(value: Any) -> Iterator[str]:
    """All texts of a document."""
    if isinstance(value, dict | list | tuple):
        for part in value.values() if isinstance(value, dict) else value:
            yield from texts_of(part)
    elif isinstance(value, str):
        yield value


#: Axes whose values no table has, by command; tests/report/plots has them.
DERIVED = {
    "fit-static": "phase after", "fit": "phase after", "compare": "minus A", "diagnose": "phase after",
    "reduce": r"distortion|noise|time \[s\]",
}  # fmt: skip
#: Printed lines with figures that are worked out of tables: misfits, a static secant, noise, the size of a gap.
WORKED_OUT = {
    "predict": "static stiffness|expected error", "compare": "m at ", "diagnose": "x noise: ", "inspect": "noise: ",
}  # fmt: skip


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_shows_what_it_writes_and_keeps_what_it_reads(folder, tmp_path, name):
    found = run(folder, tmp_path, name)
    files = [folder / argument for argument in COMMANDS[name] if (folder / argument).is_file()]
    campaigns = [tomllib.loads(file.read_text(encoding="utf-8")) for file in files if file.suffix == ".toml"]
    tests = [test["file"] for campaign in campaigns for kind in ("loops", "sweeps") for test in campaign[kind]]
    assert {file.resolve() for file in files} <= found.inputs
    assert {Path(test).name for test in tests} <= {file.name for file in found.inputs}
    assert name == "predict" or misprinted(found) == []
    assert [line for line in misquoted(found) if not re.search(WORKED_OUT.get(name, "$^"), line)] == []
    for figure in found.figures.values():
        places = [axes.get_position().bounds for axes in figure.axes]
        assert len({*places}) == len(places), "no panel lies on another"
    wrong, unknown = misdrawn(found)
    assert wrong == []
    assert [axes for axes in unknown if not re.search(DERIVED.get(name, "$^"), axes)] == []
