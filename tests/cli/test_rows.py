"""Files of which a column says which test a row belongs to, as typed."""

import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
from shell import GEOMETRY, refused

from bushfit.campaign.campaign import load_campaign

HEADERS = ("Frequency [Hz]", "Amplitude [mm]", "Stiffness [N/mm]", "Loss factor [-]")
Rows = list[tuple[float, ...]]


@pytest.fixture(scope="module")
def points(root) -> dict[str, Rows]:
    """The first pass of the paper's sweeps by direction: frequency, amplitude, stiffness and loss factor."""
    tables = {way: pd.read_csv(root / f"data/cmp_15961/sweep_{way}.csv") for way in ("axial", "radial")}
    return {
        way: [tuple(map(float, row)) for row in table[table["repeat"] == 1].drop(columns="repeat").to_numpy()]
        for way, table in tables.items()
    }


def export(file: Path, header: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """A table as a laboratory exports it."""
    pd.DataFrame(rows, columns=header).to_csv(file, index=False)


def test_merged_cells_of_a_workbook_name_the_direction_of_their_rows(typed, points, tmp_path):
    book = openpyxl.Workbook()
    for row in (["Report 12"], ["Customer", "A"], [], ("Direction", *HEADERS)):
        book.active.append([*row])
    for direction, rows in points.items():
        for number, row in enumerate(rows):  # empty but for the first
            book.active.append([None if number else direction, *row])
    book.save(tmp_path / "both.xlsx")
    typed("init", "both.xlsx", *GEOMETRY, "-o", "x")
    sweeps = load_campaign(tmp_path / "x/campaign.toml").sweeps
    assert [(str(sweep.direction), sweep.name) for sweep in sweeps] == [
        ("axial", "both axial"),
        ("radial", "both radial"),
    ]
    for sweep in sweeps:
        assert np.abs(sweep.stiffness) == pytest.approx([1e3 * row[2] for row in points[str(sweep.direction)]])


def test_parts_are_a_batch(typed, points, tmp_path):
    factors = {"17": 1.0, "A/1": 1.1, "19": 0.9}
    both = [(way, row) for way in points for row in points[way]]
    rows = [(part, way, *row[:2], row[2] * by, row[3]) for part, by in factors.items() for way, row in both]
    export(tmp_path / "parts.csv", ("Part No.", "Direction", *HEADERS), rows)
    done = typed("init", "parts.csv", *GEOMETRY, "-o", "x", "--name", "B")
    assert "next: bushfit batch x/batch.toml" in done.text
    typed("batch", "x/batch.toml", "-o", "b", "--no-plots", "-q")
    table = pd.read_csv(tmp_path / "b/batch.csv")
    assert list(table["name"]) == [f"B {part}" for part in factors]
    assert [*(table["mu [MPa]"] / table["mu [MPa]"][0])] == pytest.approx(list(factors.values()), rel=1e-3)
    one = typed("init", "parts.csv", *GEOMETRY, "-o", "y", "--specimen-number", "17")
    assert "next: bushfit run" in one.text
    text = (tmp_path / "y/campaign.toml").read_text(encoding="utf-8")
    assert [test["specimen_number"] for test in tomllib.loads(text)["sweeps"]] == ["17", "17"]
    (tmp_path / "y/campaign.toml").write_text(text.replace('specimen_number = "17"', ""), encoding="utf-8")
    asked = typed("fit", "y/campaign.toml", "-o", "f", status=2)
    refused(asked, tmp_path / "f", "tests of several parts", 'specimen_number = "..."')


def test_what_is_not_understood_is_named(typed, points, tmp_path):
    compounds, points_of_one = (("NR45", 1.0), ("NR60", 1.1)), [*enumerate(points["axial"])]
    rows = [
        (*row[:2], row[2] * by, row[3], name, k, "slow" if row[0] < 80.0 else "fast")
        for name, by in compounds
        for k, row in points_of_one
    ]
    export(tmp_path / "axial.csv", (*HEADERS, "Compound", "Pt", "Range"), rows)
    said = '"Compound" (column 5) varies from row to row (NR45, NR60) and is not understood'
    done = typed("init", "axial.csv", *GEOMETRY, "-o", "x")
    assert done.stderr.count("is not understood") == done.stderr.count(said) == 1
    assert said in typed("fit", "x/campaign.toml", "-o", "f", "--no-plots", "-v").stderr
    with (tmp_path / "x/campaign.toml").open("a", encoding="utf-8") as campaign:
        campaign.write('rows = { Compound = "NR60" }\n')
    assert said not in typed("fit", "x/campaign.toml", "-o", "g", "--no-plots").stderr
    (sweep,) = load_campaign(tmp_path / "x/campaign.toml").sweeps
    assert np.abs(sweep.stiffness) == pytest.approx([1.1e3 * row[2] for row in points["axial"]])
