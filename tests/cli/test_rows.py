"""Files of which a column says which test a row belongs to, as typed, and exports with blanks and empty cells."""

import json
import re
import tomllib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
from shell import BUSHING, GEOMETRY, refused

from bushfit.campaign.campaign import load_campaign

HEADERS = ("Frequency [Hz]", "Amplitude [mm]", "Stiffness [N/mm]", "Loss factor [-]")
#: Header of the column, its words for axial and radial, and the delimiter; beside semicolons decimals have a comma.
DIRECTIONS = {
    "English": ("Direction", "Axial", "Radial", ","), "short": ("Dir.", "ax", "rad", "\t"),
    "German": ("Prüfrichtung", "axial", "radial", ";"), "French": ("Direction", "axiale", "radiale", ";"),
    "Italian": ("Direzione", "assiale", "radiale", ";"), "Spanish": ("Dirección", "axial", "radial", ";"),
}  # fmt: skip
Rows = list[tuple[float, ...]]


@pytest.fixture(scope="module")
def points(root) -> dict[str, Rows]:
    """The first pass of the paper's sweeps by direction: frequency, amplitude, stiffness and loss factor."""
    tables = {way: pd.read_csv(root / f"data/cmp_15961/sweep_{way}.csv") for way in ("axial", "radial")}
    return {
        way: [tuple(map(float, row)) for row in table[table["repeat"] == 1].drop(columns="repeat").to_numpy()]
        for way, table in tables.items()
    }


def export(file: Path, header: Sequence[str], rows: Sequence[Sequence[object]], delimiter: str = ",") -> None:
    """A table as a laboratory exports it, as text or as a workbook with title lines."""
    if file.suffix == ".xlsx":
        book = openpyxl.Workbook()
        for row in (["Report 12"], ["Customer", "A"], [], header, *rows):
            book.active.append([*row])
        book.save(file)
    else:
        decimal = "," if delimiter == ";" else "."
        lines = [delimiter.join(str(cell).replace(".", decimal) for cell in row) for row in rows]
        file.write_text("\n".join([delimiter.join(header), *lines]) + "\n", encoding="utf-8")


@pytest.mark.parametrize(("language", "ending"), [*((language, "csv") for language in DIRECTIONS), ("English", "xlsx")])
def test_directions_are_tests_of_their_own(typed, points, tmp_path, language, ending):
    head, axial, radial, delimiter = DIRECTIONS[language]
    # in a workbook the cells of one direction are merged, and empty but for the first
    word = {
        way: [name, *[None if ending == "xlsx" else name] * 47] for way, name in (("axial", axial), ("radial", radial))
    }
    rows = [(w, *row) for way in points for w, row in zip(word[way], points[way], strict=True)]
    export(tmp_path / f"both.{ending}", (head, *HEADERS), rows, delimiter)
    typed("init", f"both.{ending}", *GEOMETRY, "-o", "x")
    sweeps = load_campaign(tmp_path / "x/campaign.toml").sweeps
    named = [(str(sweep.direction), sweep.name) for sweep in sweeps]
    assert named == [("axial", "both axial"), ("radial", "both radial")]
    for sweep in sweeps:
        assert np.abs(sweep.stiffness) == pytest.approx([1e3 * row[2] for row in points[str(sweep.direction)]])
    told = typed("inspect", f"both.{ending}", "-o", "z", "--no-plots").stderr
    assert all(f"both.{ending}, direction {way}: a sweep" in told for way in points)
    one = typed("init", f"both.{ending}", *GEOMETRY, "-o", "y", "--direction", "axial")
    assert "rows of radial are not used: other values were stated" in one.text
    assert [str(sweep.direction) for sweep in load_campaign(tmp_path / "y/campaign.toml").sweeps] == ["axial"]


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


@pytest.mark.parametrize(
    ("header", "levels", "stated", "plural"),
    [
        ("T [°C]", (-30, 23, 80), [f'temperature = "{level}.0 degC"' for level in (-30, 23, 80)], "temperatures"),
        ("Vorlast [N]", (0, 500, 1000), [f'preload = "{level} N"' for level in (0, 500, 1000)], "preloads"),
        ("Temperature", ("23 °C", "80 °C"), ['temperature = "23.0 degC"', 'temperature = "80.0 degC"'], "temperatures"),
        ("Static deflection (mm)", (1, 2, 4), [f'preload = "{level} mm"' for level in (1, 2, 4)], "preloads"),
    ],
)
def test_temperatures_and_preloads_are_tests_of_their_own(typed, points, tmp_path, header, levels, stated, plural):
    rows = [
        (level, *row[:2], row[2] * (1 + k / 10), row[3]) for k, level in enumerate(levels) for row in points["axial"]
    ]
    export(tmp_path / "axial.csv", (header, *HEADERS), rows)
    done = typed("init", "axial.csv", *GEOMETRY, "-o", "x")
    assert re.findall("axial.csv, (.*): sweep", done.text) == [re.sub(' = "|"', " ", key).strip() for key in stated]
    text = (tmp_path / "x/campaign.toml").read_text(encoding="utf-8")
    assert [line for line in text.splitlines() if line in stated] == stated
    sweeps = load_campaign(tmp_path / "x/campaign.toml").sweeps
    first = 1e3 * np.array([row[2] for row in points["axial"]])
    for k, sweep in enumerate(sweeps):
        assert np.abs(sweep.stiffness) == pytest.approx(first * (1 + k / 10))
    assert len({sweep.name for sweep in sweeps}) == len(levels)
    (tmp_path / "c.toml").write_text(
        f'{BUSHING}[[sweeps]]\nfile = "axial.csv"\ndirection = "axial"\n', encoding="utf-8"
    )
    refused(typed("fit", "c.toml", "-o", "y", status=2), tmp_path / "y", f"tests at several {plural}", stated[0])


@pytest.mark.parametrize("stated", ["Temperature: 23 degC/60 degC", "Preload: 0 N/500 N", "Direction: axial/radial"])
def test_a_line_above_blocks_applies_until_another_of_its_kind(typed, points, tmp_path, stated):
    key, values = stated.split(": ")
    lines = []
    for value, factor in zip(values.split("/"), (1.0, 1.2), strict=True):
        lines.append(f"{key}: {value}")
        for amplitude in (0.1, 0.5):
            rows = [row for row in points["axial"] if row[1] == amplitude]
            lines += [f"Amplitude: {amplitude} mm", "Frequency [Hz];K* [N/mm];tan delta [-]"]
            lines += [f"{row[0]};{factor * row[2]};{row[3]}" for row in rows]
    (tmp_path / "blocks.csv").write_text("\n".join(lines), encoding="utf-8")
    typed("init", "blocks.csv", *GEOMETRY, "-o", "x", *([] if key == "Direction" else ["--direction", "axial"]))
    sweeps = load_campaign(tmp_path / "x/campaign.toml").sweeps
    first = 1e3 * np.array([row[2] for row in points["axial"] if row[1] in (0.1, 0.5)])
    conditions = [
        f"{sweep.direction} {np.mean(0.0 if sweep.temperature is None else sweep.temperature)} {sweep.preload}"
        for sweep in sweeps
    ]
    assert len(set(conditions)) == len(sweeps) == 2
    for sweep, factor in zip(sweeps, (1.0, 1.2), strict=True):
        assert sorted(np.abs(sweep.stiffness)) == pytest.approx(sorted(first * factor))


@pytest.mark.parametrize(
    ("above", "option", "expected"),
    [
        ("Machine: 5", (), "axial"),
        ("Direction: radial", (), "radial"),
        ("Test: radial stiffness", (), None),
        ("Test: radial stiffness", ("--direction", "radial"), "radial"),
    ],
)
def test_channels_named_axial_are_those_of_the_machine(typed, tmp_path, above, option, expected):
    time = np.linspace(0.0, 6.0, 600, endpoint=False)
    rows = [f"{t:.3f},{np.sin(np.pi * t):.5f},{500.0 * np.sin(np.pi * t + 0.1):.3f}" for t in time]
    lines = [above, "Time (s),Axial Displacement (mm),Axial Force (N)", *rows]
    (tmp_path / "loop.csv").write_text("\n".join(lines), encoding="utf-8")
    document = json.loads(typed("inspect", "loop.csv", *option, "--json", "--no-plots").stdout)
    assert (f'direction = "{expected}"' in document["campaign"]) == (expected is not None)
    assert ('direction = "..."' in document["campaign"]) == (expected is None)


def test_loops_of_one_file_at_two_preloads_are_a_campaign(typed, tmp_path):
    time = np.linspace(0.0, 6.0, 600, endpoint=False)
    lines = []
    for preload in (0.0, 500.0):
        motion, force = np.sin(np.pi * time), 500.0 * np.sin(np.pi * time + 0.1) + preload
        lines += [f"Preload: {preload:g} N", "Time [s];Displacement [mm];Force [N]"]
        lines += [f"{t:.3f};{x:.5f};{f:.3f}" for t, x, f in zip(time, motion, force, strict=True)]
    (tmp_path / "axial.csv").write_text("\n".join(lines), encoding="utf-8")
    typed("init", "axial.csv", *GEOMETRY, "-o", "x")
    means = [np.mean(loop.force) for loop in load_campaign(tmp_path / "x/campaign.toml").loops]
    assert means == pytest.approx([0.0, 500.0], abs=1.0)


@pytest.mark.parametrize(
    ("ending", "delimiter", "header"), [("csv", ",", "Run"), ("csv", ";", "Rep."), ("xlsx", "", "Versuch Nr.")]
)
def test_runs_are_repeats(typed, points, tmp_path, ending, delimiter, header):
    """A row that begins with #1 is no comment where all do."""
    rows = [(f"#{run}", *row[:2], row[2] * (1.0 + run / 1e3), row[3]) for run in (1, 2, 3) for row in points["axial"]]
    export(tmp_path / f"axial.{ending}", (header, *HEADERS), rows, delimiter)
    (seen,) = json.loads(typed("inspect", f"axial.{ending}", "-o", "x", "--json", "--no-plots").stdout)["files"]
    assert seen["facts"]["repeats"] == "3"
    assert not [sentence for sentence in seen["odd"] if "not understood" in sentence]


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


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ('direction = "torsion"', ["no row belongs to this test", 'axial, radial in column "Direction"', "torsion"]),
        ('direction = "axial"\nrows = { Dir = "axial" }', ['there is no column "Dir"', "Direction, Frequency [Hz]"]),
        ('direction = "axial"\nrows = { Direction = "up" }', ["no row belongs to this test", "up"]),
        ('direction = "axial"\n[[sweeps]]\nfile = "both.csv"\ndirection = "axial"', ["a file is listed twice"]),
    ],
)
def test_a_campaign_that_contradicts_a_column(typed, points, tmp_path, entries, said):
    export(tmp_path / "both.csv", ("Direction", *HEADERS), [(way, *row) for way in points for row in points[way]])
    (tmp_path / "c.toml").write_text(f'{BUSHING}[[sweeps]]\nfile = "both.csv"\n{entries}\n', encoding="utf-8")
    refused(typed("fit", "c.toml", "-o", "x", status=2), tmp_path / "x", *said)
