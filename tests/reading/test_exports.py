"""Files as laboratories write them, through the command line: read with the right values, or asked about."""

import gzip
import json
import tomllib
from collections.abc import Iterator, Mapping
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import pytest
import references
import scipy.io
from commandline import typing

from bushfit.campaign.campaign import load_campaign
from bushfit.reading.measurement import Loop, Sweep

FILES = Path(__file__).parents[1] / "files" / "exports"
CASES = tomllib.loads((FILES / "cases.toml").read_text(encoding="utf-8"))
BUSHING = '[bushing]\nname = "B"\ninner_radius = "10 mm"\nouter_radius = "18 mm"\nlength = "34 mm"\n\n'


def options(stated: Mapping[str, Any]) -> Iterator[str]:
    """Options of the command line for keys of a campaign."""
    for key, value in stated.items():
        if isinstance(value, dict):
            yield from (f"--{key[:-1]}={role}={text}" for role, text in value.items())
        else:
            yield f"--{key.replace('_', '-')}={value}"


def inspected(folder: Path, file: str, **stated: Any) -> tuple[dict[str, Any], list[Loop | Sweep]]:
    """What `inspect --json` prints of a file, and the tests of the campaign in it, as `fit` reads them."""
    done = typing(folder)("inspect", file, *options({"direction": "axial", **stated}), "--json", "--no-plots")
    document: dict[str, Any] = json.loads(done.stdout)
    (folder / "campaign.toml").write_text(BUSHING + document["campaign"], encoding="utf-8")
    campaign = load_campaign(folder / "campaign.toml")
    return document, [*campaign.loops, *campaign.sweeps]


def check(measured: Loop | Sweep, reference: Mapping[str, np.ndarray], tolerance: float = 2e-3) -> None:
    """Compare the columns of a test; points of a sweep in any order."""
    found = {name: getattr(measured, name) for name in reference}
    if "amplitude" in reference and isinstance(measured, Sweep):
        orders = [np.lexsort((columns["frequency"], columns["amplitude"].round(9))) for columns in (found, reference)]
        found, reference = (
            {name: values[order] for name, values in columns.items()}
            for columns, order in zip((found, reference), orders, strict=True)
        )
    for name, values in reference.items():
        if name == "time":  # clocks have no zero, and rounded ones are spread to within a step
            np.testing.assert_allclose(found[name] - found[name][0], values, atol=tolerance)
        else:
            np.testing.assert_allclose(found[name], values, rtol=2e-6, atol=2e-5 * np.abs(values).max())


def expected(name: str) -> dict[str, np.ndarray]:
    """True columns of a test in SI units, with its complex stiffness."""
    columns = {key: column.to_numpy() for key, column in pd.read_csv(FILES / "expected" / f"{name}.csv").items()}
    if "storage" in columns:
        columns["stiffness"] = columns.pop("storage") + 1j * columns.pop("loss")
    return columns


#: Three cycles of 1 mm at 0.1 Hz, in seconds, millimetres and newtons.
LOOP = expected("loop")
TIME, DISPLACEMENT, FORCE = LOOP["time"], 1e3 * LOOP["displacement"], LOOP["force"]


def read_case(case: Mapping[str, Any], folder: Path) -> list[str]:
    """Check what an export is read as, or the question that it raises. Returns: lines for the reference."""
    content, name = (FILES / case["file"]).read_bytes(), case.get("name", "export.txt")
    if "head" in case:
        content = "\n".join(case["head"]).encode() + content[content.index(b"\n") :]
    folder.mkdir()
    (folder / name).write_bytes(content)
    says, stated = case.get("says", ()), case.get("stated", {})
    if case["kind"] == "question":
        done = typing(folder)("inspect", name, *options({"direction": "axial", **stated}), "--json", status=2)
        assert [words for words in says if words not in done.stderr] == []
        assert [path.name for path in folder.iterdir()] == [name]
        return references.text_lines(done.stderr)
    document, tests = inspected(folder, name, **stated)
    notes = " | ".join(text for seen in document["files"] for text in (*seen["odd"], *seen["facts"].values()))
    assert [words for words in says if words not in notes] == []
    assert {seen["kind"] for seen in document["files"]} == {*case["kind"].split(" and ")}
    assert tests
    for test in tests:
        check(test, expected(case.get("expected", type(test).__name__.lower())), 0.06 if "spread" in notes else 2e-3)
    return [line for seen in document["files"] for line in references.document_lines("", seen)]


@pytest.mark.parametrize("initial", sorted({name[0].lower() for name in CASES}))
def test_an_export_is_read_right_or_raises_a_question(initial, tmp_path, file_regression):
    """Cases whose name begins with one letter."""
    cases = [name for name in CASES if name[0].lower() == initial]
    lines = [line for n, name in enumerate(cases) for line in (name, *read_case(CASES[name], tmp_path / str(n)))]
    file_regression.check("\n".join(lines) + "\n", basename=initial, encoding="utf-8", check_fn=references.check)


def test_rows_without_a_remark_are_selected_as_inspect_prints(tmp_path):
    (tmp_path / "axial.csv").write_bytes((FILES / "a_remark_on_bad_rows.txt").read_bytes())
    (sweep,) = inspected(tmp_path, "axial.csv")[1]
    campaign = tmp_path / "campaign.toml"  # the name of the file states the direction
    campaign.write_text(campaign.read_text().replace('direction = "axial"\n', "") + 'rows = { "Remark" = "" }\n')
    assert (sweep.frequency.size, load_campaign(campaign).sweeps[0].frequency.size) == (12, 10)
    check(load_campaign(campaign).sweeps[0], expected("sweep"))


def loop_book(header: str = "force [N]", factor: float = 1.0) -> openpyxl.Workbook:
    """The loop in a workbook, its force under a header and times a factor."""
    book = openpyxl.Workbook()
    columns = (TIME.tolist(), DISPLACEMENT, factor * FORCE)
    for row in ["time [s]", "displacement [mm]", header], *zip(*columns, strict=True):
        book.active.append(row)
    return book


@pytest.mark.parametrize("sheets", [True, False])
def test_forces_in_names_that_differ_are_preloads(sheets, tmp_path):
    """One file or sheet alone may state anything by a force in its name."""
    rows = [line.split("\t") for line in (FILES / "plain_sweep.txt").read_text().splitlines()]
    book, names = openpyxl.Workbook(), ["axial 1000 N", "axial 2,5 kN"]
    for name in names:
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append([float(cell) if cell[0].isdigit() else cell for cell in row])
        (tmp_path / f"{name}.txt").write_bytes((FILES / "plain_sweep.txt").read_bytes())
    del book["Sheet"]
    book.save(tmp_path / "sheets.xlsx")
    files = ["sheets.xlsx"] if sheets else [f"{name}.txt" for name in names]
    document = json.loads(typing(tmp_path)("inspect", *files, "--json", "--no-plots").stdout)
    assert [seen["facts"].get("from the name") for seen in document["files"]] == ["preload 1000 N", "preload 2.5 kN"]
    document = json.loads(typing(tmp_path)("inspect", f"{names[0]}.txt", "--json", "--no-plots", "--force").stdout)
    assert "from the name" not in document["files"][0]["facts"]


@pytest.mark.parametrize(
    ("name", "is_odd"), [("axial_20Hz.csv", False), ("axial_0.1Hz.csv", False), ("axial_5Hz.csv", True)]
)
def test_a_name_may_state_the_sampling_rate(name, is_odd, tmp_path):
    (tmp_path / name).write_bytes((FILES / "plain_loop.txt").read_bytes())
    document, _ = inspected(tmp_path, name)
    assert any("the name states" in sentence for sentence in document["files"][0]["odd"]) == is_odd


@pytest.mark.parametrize("channel", ["time", "force"])
def test_complex_numbers_recorded_over_time_are_refused(channel, tmp_path):
    channels = {"time": TIME, "displacement": DISPLACEMENT, "force": FORCE}
    scipy.io.savemat(tmp_path / "loop.mat", {**channels, channel: channels[channel] * (1.0 + 0.1j)})
    done = typing(tmp_path)("inspect", "loop.mat", "--direction", "axial", status=2)
    assert f'loop.mat: the channel "{channel}" holds complex numbers' in done.stderr


@pytest.mark.parametrize("name", ["loop.csv.gz", "loop.h5", "catman.mat"])
def test_packed_tables_and_channels_with_their_units(name, tmp_path):
    channels = {"Zeit": (TIME, "s"), "Weg": (DISPLACEMENT, "mm"), "Kraft": (FORCE, "N")}
    if name == "loop.csv.gz":
        (tmp_path / name).write_bytes(gzip.compress((FILES / "plain_loop.txt").read_bytes()))
    elif name == "loop.h5":
        h5py = pytest.importorskip("h5py")
        with h5py.File(tmp_path / name, "w") as file:
            for channel, (values, unit) in channels.items():
                file.create_dataset(channel, data=values).attrs["unit"] = unit
    else:
        content: dict[str, Any] = {}
        for number, (channel, (values, unit)) in enumerate(channels.items(), start=1):
            content |= {f"Channel_{number}_Header": {"SignalName": channel, "Unit": unit}}
            content |= {f"Channel_{number}_Data": values}
        scipy.io.savemat(tmp_path / name, content)
    _, (test,) = inspected(tmp_path, name)
    check(test, LOOP)


def test_an_angle_that_begins_again_at_360_degrees(tmp_path):
    angle = 5.0 * DISPLACEMENT % 360.0
    table = pd.DataFrame({"Time [s]": TIME, "Angle [deg]": angle, "Torque [Nm]": FORCE})
    table.to_csv(tmp_path / "loop.csv", index=False, float_format="%.9g")
    document, (test,) = inspected(tmp_path, "loop.csv", direction="torsion")
    assert any("jumps by whole turns" in sentence for sentence in document["files"][0]["odd"])
    check(test, {"time": TIME, "displacement": np.radians(5.0 * DISPLACEMENT), "force": FORCE})


def test_parts_side_by_side_and_date_cells_of_a_workbook(tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["P01", None, None, "P02"])
    book.active.merge_cells("A1:C1")
    book.active.append(["Time", "Displacement [mm]", "Force [N]"] * 2)
    for seconds, x, force in zip(TIME.tolist(), DISPLACEMENT.tolist(), FORCE.tolist(), strict=True):
        stamp = datetime(2026, 11, 26, 20) + timedelta(seconds=seconds)
        book.active.append([stamp, x, force, stamp, x, 1.1 * force])
    book.save(tmp_path / "parts.xlsx")
    document, tests = inspected(tmp_path, "parts.xlsx")
    assert len(document["files"]) == len(tests) == 2
    for test, factor in zip(tests, (1.0, 1.1), strict=True):
        check(test, {**LOOP, "force": factor * FORCE})


@pytest.mark.parametrize(
    ("header", "form", "factor", "words"),
    [
        ("force [kN]", "#,##0.000,", 1.0, ["2 cells are shown divided by 1000"]),
        ("force", '0.0" kN";-0.0" kN"', 1e-3, []),
        ("force [N]", '#,##0.0,"k"', 1.0, []),
    ],
)
def test_numbers_of_a_workbook_are_read_as_it_shows_them(header, form, factor, words, tmp_path):
    book = loop_book(header, factor)
    for row in (2, 3) if words else range(2, TIME.size + 2):
        book.active.cell(row, 3).number_format = form
    if words:
        for row in range(4, TIME.size + 2):
            book.active.cell(row, 3).value /= 1e3
    book.save(tmp_path / "loop.xlsx")
    document, (test,) = inspected(tmp_path, "loop.xlsx")
    assert [word for word in words if word not in " | ".join(document["files"][0]["odd"])] == []
    check(test, LOOP)


def test_the_direction_on_another_sheet_of_a_workbook(tmp_path):
    book = loop_book()
    for row in (["Direction", "radial"], ["Temperature", "30 degC"]):
        (book["Info"] if "Info" in book else book.create_sheet("Info")).append(row)
    book.save(tmp_path / "loop.xlsx")
    done = typing(tmp_path)("inspect", "loop.xlsx", "--json", "--no-plots")
    assert 'direction = "radial"\nsheet = "Sheet"\ntemperature = "30 degC"' in json.loads(done.stdout)["campaign"]


def test_hidden_rows_of_a_workbook_are_read_and_reported(tmp_path):
    book = loop_book()
    for row in (2, 3):
        book.active.row_dimensions[row].hidden = True
    book.save(tmp_path / "loop.xlsx")
    document, (test,) = inspected(tmp_path, "loop.xlsx")
    assert "2 rows from row 2 on are hidden in the workbook, but are read" in document["files"][0]["odd"]
    check(test, LOOP)


def test_a_second_channel_of_a_long_record_is_asked_about(tmp_path):
    """It stands still for more rows than are looked at first, in a file that is read in several pieces."""
    motion = np.concatenate([np.zeros(2_000), np.tile(DISPLACEMENT, 250)])
    rows = np.column_stack([0.05 * np.arange(motion.size), motion, 1.2 * motion, 1000.0 * motion])
    headers = "time [s],displacement [mm],LVDT [mm],force [N]"
    np.savetxt(tmp_path / "loop.csv", rows, "%.6f", ",", header=headers, comments="")
    assert (tmp_path / "loop.csv").stat().st_size > 1 << 22
    done = typing(tmp_path)("inspect", "loop.csv", "--direction", "axial", "--json", status=2)
    assert "more than one column could be the displacement" in done.stderr


def label(unit: str) -> dict[str, object]:
    return {"quantity": {"label": unit}}


@pytest.mark.parametrize(
    "variables",
    [
        {"A": {"data": np.stack([TIME, DISPLACEMENT, FORCE], 1), "colheaders": ["t [s]", "Disp [mm]", "Force [N]"]}},
        {"fs": 20.0, "disp_mm": DISPLACEMENT, "force_N": FORCE},
        {
            f"Signal_{name}": {
                "x_values": {"start_value": 0.0, "increment": 0.05, "number_of_values": 600.0, **label("s")},
                "y_values": {"values": values, **label(unit)},
                "function_record": {"name": name},
            }
            for name, values, unit in (("Point_1", DISPLACEMENT, "mm"), ("Point_2", FORCE, "N"))
        },
    ],
    ids=["importdata", "scalar rate", "Testlab"],
)
def test_loops_in_structs_of_matlab(variables, tmp_path):
    scipy.io.savemat(tmp_path / "loop.mat", variables)
    (test,) = inspected(tmp_path, "loop.mat")[1]
    check(test, LOOP)


@pytest.mark.parametrize("in_matrix", [True, False])
def test_levels_of_a_sweep_in_matlab(in_matrix, tmp_path):
    """An amplitude for each column of a complex matrix, or one beside the vectors of each struct."""
    frequency, stiffness = (
        np.array([5.0, 10.0, 20.0]),
        np.array([[1e6, 9e5], [1.1e6, 1e6], [1.2e6, 1.1e6]]) * (1 + 0.1j),
    )
    level = {"freq_Hz": frequency, "ampl_mm": np.array([0.1, 0.3]), "K_N_m": stiffness}
    structs = [
        {"freq_Hz": frequency, "K_N_m": np.abs(k), "phase_rad": np.angle(k), "ampl_mm": x}
        for k, x in zip(stiffness.T, (0.1, 0.3), strict=True)
    ]
    scipy.io.savemat(tmp_path / "sweep.mat", level if in_matrix else {"test": structs})
    for test, k, x in zip(inspected(tmp_path, "sweep.mat")[1], stiffness.T, (1e-4, 3e-4), strict=True):
        check(test, {"frequency": frequency, "amplitude": np.full(3, x), "stiffness": k})
