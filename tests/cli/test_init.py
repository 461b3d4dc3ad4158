"""`init` as typed: a campaign that loads and fits, and an error with the option for what only the user knows."""

import io
import json
import os
import re
import shlex
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shell import CAMPAIGN, GEOMETRY, document, refused, values

from bushfit.campaign.campaign import load_campaign
from bushfit.campaign.toml import toml_value

FILES = ("loop_axial_1.csv", "sweep_axial.csv", "sweep_radial.csv")


@pytest.fixture
def tests(root, tmp_path) -> list[Path]:
    """The tests of the paper's bushing in a folder of their own."""
    shutil.copytree(root / "data/cmp_15961", tmp_path / "lab/my tests")
    return [tmp_path / "lab/my tests" / name for name in FILES]


def test_the_campaign_loads_and_fits_and_its_geometry_is_echoed(typed, tests, tmp_path, table_1):
    sizes = ("--inner-diameter", "20 mm", "--outer-diameter", "3.6 cm", "--length", "34 mm")
    done = typed("init", *tests, *sizes, "--name", 'Bushing "7"', "-o", "lab/campaign")
    assert "rubber from 20 to 36 mm in diameter, 8 mm thick, 34 mm long" in done.text
    assert "loop_axial_1.csv: loop, axial; cycles: 3, treated as steady; frequency: 0.1 Hz, a sine; " in done.text
    assert "sweep_axial.csv: sweep, axial; frequencies: 16, from 5 to 155 Hz; amplitudes: " in done.text
    written = tomllib.loads((tmp_path / "lab/campaign/campaign.toml").read_text(encoding="utf-8"))
    assert [test["file"] for test in written["loops"] + written["sweeps"]] == [f"../my tests/{name}" for name in FILES]
    campaign = load_campaign(tmp_path / "lab/campaign/campaign.toml")
    bushing = campaign.bushing
    assert (bushing.name, bushing.inner_radius, bushing.outer_radius) == ('Bushing "7"', 0.01, 0.018)
    assert [str(sweep.direction) for sweep in campaign.sweeps] == ["axial", "radial"]
    fitted = values(typed("fit", "lab/campaign/campaign.toml", "-o", "fit", "--no-plots", "--json"))
    assert fitted == pytest.approx(table_1, rel=0.02)


def test_where_it_is_written_and_that_the_next_line_can_be_pasted(typed, tests, tmp_path):
    done = typed("init", *tests, *GEOMETRY, "-o", "lab/my.toml", "--json")
    text = (tmp_path / "lab/my.toml").read_text(encoding="utf-8")
    assert json.loads(done.stdout)["campaign"] == text
    assert tomllib.loads(text)["bushing"]["name"] == "my tests"
    assert tomllib.loads(text)["loops"][0]["file"] == "my tests/loop_axial_1.csv"
    assert "next: bushfit run lab/my.toml" in done.text
    assert load_campaign(tmp_path / "lab/my.toml").bushing.shape == "calibrated"
    assert "# [report]" in text
    done = typed("init", *tests, *GEOMETRY)
    (line,) = (line for line in done.text.splitlines() if line.startswith("next: bushfit run "))
    _, *words = shlex.split(line.removeprefix("next: "))
    assert words == ["run", str(Path("results/my tests/campaign.toml"))]
    assert (tmp_path / words[1]).exists()


def change(file: Path, **renamed: str) -> Path:
    """A file with other headers; None drops the column."""
    table = pd.read_csv(file)
    for column in list(table):
        new = renamed.get(column.split()[0], column)
        table = table.drop(columns=column) if new == "" else table.rename(columns={column: new})
    table.to_csv(file, index=False)
    return file


def test_what_only_the_user_knows_is_asked_for_and_written(typed, tests, tmp_path):
    loop = change(tests[0], time="", force="Kanal 3").rename(tests[0].with_name("first.csv"))
    known: list[str] = []
    asked = (
        ("--column", "force=Kanal 3", '--column "force='),
        ("--unit", "force=N", '--unit "force='),
        ("--rate", "24 mm/min", "--rate"),
        ("--direction", "axial", "--direction axial"),
    )
    for option, answer, named in asked:
        refused(typed("init", loop, *GEOMETRY, *known, "-o", "x", status=2), tmp_path / "x", named)
        known += [option, answer]
    typed("init", loop, tests[1], *GEOMETRY, *known, "-o", "x")
    written = tomllib.loads((tmp_path / "x/campaign.toml").read_text(encoding="utf-8"))
    assert written["loops"] == [
        {
            "file": "../lab/my tests/first.csv",
            "direction": "axial",
            "rate": "24 mm/min",
            "columns": {"force": "Kanal 3"},
            "units": {"force": "N"},
        }
    ]
    assert set(written["sweeps"][0]) == {"file", "direction"}
    assert load_campaign(tmp_path / "x/campaign.toml").loops[0].time[-1] > 1.0


@pytest.mark.parametrize(
    ("name", "header", "says", "other"),
    [
        ("sweep_axial.csv", "stiffness [N/mm]", "axial", "radial"),
        ("rad_7.csv", "Axial stiffness [N/mm]", "radial", "axial"),
        ("x.xlsx", "stiffness [N/mm]", "radial", "axial"),
        ("turned.csv", "stiffness [N m/deg]", "torsion", "radial"),
    ],
)
def test_a_direction_that_is_stated_contradicts_no_file(typed, tests, tmp_path, name, header, says, other):
    """A sheet's name goes before the file's, that before headers, units of an angle before all."""
    table, file = pd.read_csv(tests[1]).rename(columns={"stiffness [N/mm]": header}), tmp_path / "bench" / name
    table = table.rename(columns={"amplitude [mm]": "amplitude [deg]"} if says == "torsion" else {})
    file.parent.mkdir()
    (tmp_path / "bench/plain.csv").write_bytes(tests[1].read_bytes())
    if file.suffix == ".xlsx":
        table.to_excel(file, sheet_name="Radial", index=False)
    else:
        table.to_csv(file, index=False)
    for command in (("init", "bench", *GEOMETRY), ("init", file, *GEOMETRY), ("inspect", file, "--no-plots")):
        done = typed(*command, "--direction", other, "-o", "x", status=2)
        refused(done, tmp_path / "x", "leave --direction out")
        assert re.search(rf"{name}, .* says? {says}, but --direction says {other}\n  found: {name}, ", done.stderr)
    typed("init", file, *GEOMETRY, "--direction", says, "-o", "x")
    typed("init", "bench/plain.csv", *GEOMETRY, "--direction", other, "-o", "y")


def test_a_time_that_does_not_go_with_the_rows_is_told_by_every_fit(typed, tests, tmp_path):
    """A sine recorded without time, of which a rate was stated; silence where the time is as the rows lie."""
    loop = pd.read_csv(tests[0])
    loop.drop(columns="time [s]").to_csv(tests[0], index=False)
    for stated, said in (("--rate=0.4 mm/s", 1), ("--frequency=0.1 Hz", 0)):
        waveform = () if said else ("--waveform", "sine")
        started = typed("init", *tests, *GEOMETRY, stated, *waveform, "-o", "campaign", "--force")
        assert started.stderr.count("as for a sine recorded evenly") == said
        for command in ("fit-static", "fit"):
            done = typed(command, "campaign/campaign.toml", "-o", "out", "--no-plots", "--force")
            words = "warning: loop_axial_1: 29 % of the rows lie beyond 0.9 of the amplitude, as for a sine"
            assert done.stderr.count(words) == said
            (written,) = (tmp_path / "out").glob("[sm]*.json")
            assert sum("rate means a triangle" in line for line in document(written)["warnings"]) == said
            written.unlink()


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_any_text_is_written_as_toml(text):
    assert tomllib.loads(f"x = {toml_value(text)}") == {"x": text}


class Person(io.StringIO):
    """Somebody at a terminal, who types these lines and then leaves."""

    def isatty(self) -> bool:
        return True


def answering(monkeypatch: pytest.MonkeyPatch, *lines: str) -> Person:
    person = Person("".join(f"{line}\n" for line in lines))
    monkeypatch.setattr("sys.stdin", person)
    return person


#: Of a loop without time and a sweep without units: wrong answers among the right ones.
ANSWERS = [
    *("My B", "0.1", "0.1 Hz", "sine", "up", "axial", "500 N axial"),
    *("N/mm", "Hz", "N", "mm", "radial", "peak-to-peak"),
    *("20", "20 mm", "18 mm", "34 mm", "20 mm", "36 mm", "34 mm"),
]


@pytest.fixture
def silent(tests) -> list[Path]:
    """A loop and a sweep that say next to nothing of themselves."""
    loop = change(tests[0], time="").rename(tests[0].with_name("first.csv"))
    sweep = tests[1].rename(tests[1].with_name("second.csv"))
    lines = sweep.read_text(encoding="utf-8").split("\n")
    sweep.write_text("\n".join(["f,A,repeat,K,tan delta", *lines[1:]]), encoding="utf-8")
    return [loop, sweep]


def test_at_a_terminal_what_lacks_is_asked_for(typed, silent, tmp_path, monkeypatch):
    person = answering(monkeypatch, *ANSWERS)
    told = typed("init", *silent, "-o", "x").stderr
    assert person.read() == "", "every answer was asked for"
    for wrong in ("a number without a unit", "'up' is not one of", "the unit does not fit"):
        assert told.count(wrong) == 1 + (wrong == "a number without a unit")
    assert "impossible bushing" in told
    assert not re.search("try: .*--", told), "no option is named at a terminal"
    campaign = load_campaign(tmp_path / "x/campaign.toml")
    bushing = campaign.bushing
    assert (bushing.name, bushing.inner_radius, bushing.outer_radius) == ("My B", 0.01, 0.018)
    assert [str(test.direction) for test in (*campaign.loops, *campaign.sweeps)] == ["axial", "radial"]
    assert campaign.path.read_text(encoding="utf-8").count('preload = "500 N axial"') == 2, "asked for once"
    assert campaign.sweeps[0].amplitude.max() == pytest.approx(0.25e-3)
    assert campaign.loops[0].time[-1] == pytest.approx(30.0, rel=0.01)


def test_a_file_that_names_a_direction_is_no_block_in_shear(typed, tests, tmp_path):
    (tmp_path / "mount.csv").write_bytes(tests[1].read_bytes())
    block = ("--area", "900 mm^2", "--thickness", "6 mm", "--elements", "2", "--specimen", "mount")
    typed("init", tests[1], "mount.csv", *GEOMETRY, *block, "-o", "x")
    campaign = load_campaign(tmp_path / "x/campaign.toml")
    assert [str(sweep.direction) for sweep in campaign.sweeps] == ["axial", "mount"]


def sweep(root: Path, file: Path, above: str = "") -> None:
    text = (root / "data/cmp_15961/sweep_axial.csv").read_text(encoding="utf-8")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(above + text, encoding="utf-8")


@pytest.mark.parametrize("name", ["axial_{number}", "{part}_axial", "part {part} axial", "{part}/axial"])
def test_files_of_several_parts_are_campaigns_and_a_manifest(name, typed, root, tmp_path):
    """The number is above the table, in the name of the file, or in that of a folder."""
    parts = [f"P{number:02}" for number in range(1, 11)]
    for number, part in enumerate(parts):
        above = "" if "part" in name else f"Specimen: {part}\n"
        sweep(root, tmp_path / "lab" / f"{name.format(number=number, part=part)}.csv", above)
    assert "next: bushfit batch x/batch.toml" in typed("init", "lab", *GEOMETRY, "-o", "x").stdout
    rows = tomllib.loads((tmp_path / "x/batch.toml").read_text(encoding="utf-8"))["bushings"]
    assert [row["campaign"] for row in rows] == [f"{part}.toml" for part in parts]
    for number, part in enumerate(parts):
        (test,) = load_campaign(tmp_path / f"x/{part}.toml").sweeps
        assert test.source.file.as_posix() == f"../lab/{name.format(number=number, part=part)}.csv"
    typed("init", "lab", *GEOMETRY, "-o", "y", "--specimen-number", "P00")
    assert (tmp_path / "y/campaign.toml").read_text(encoding="utf-8").count("[[sweeps]]") == 10


def test_folders_in_folders_are_searched_and_bad_names_are_left_out(typed, root, tmp_path):
    sweep(root, tmp_path / "lab/monday/sweep_axial.csv")
    sweep(root, tmp_path / "lab/tuesday/deep/sweep_radial.csv")
    (tmp_path / "lab/dangling.csv").symlink_to("nowhere.csv")
    (tmp_path / "lab/axial_\u202e.csv").write_text("x", encoding="utf-8")
    Path(os.fsdecode(os.fsencode(tmp_path / "lab") + b"/axial_\xff.csv")).write_text("x", encoding="utf-8")
    time = np.arange(0.0, 6.0, 0.02)
    road = np.sin(6.0 * time) * np.exp(0.3 * time)  # no two cycles are alike
    rows = np.column_stack([time, road, 800.0 * road])
    np.savetxt(tmp_path / "lab/road_axial.csv", rows, "%.5f", ",", header="t [s],x [mm],F [N]", comments="")
    assert "no part of the record is a loop" in typed("inspect", "lab/road_axial.csv", "--json", status=2).stderr
    for arguments in (("inspect", "lab", "--no-plots"), ("init", "lab", *GEOMETRY, "-o", "x.toml")):
        done = typed(*arguments)
        assert "road_axial.csv: no part of the record is a loop" in done.text
    campaign = load_campaign(tmp_path / "x.toml")
    assert [str(test.direction) for test in campaign.sweeps] == ["axial", "radial"]
    for words in (r"axial_\u202e.csv: its name", r"axial_\udcff.csv: its name", "dangling.csv: a broken link"):
        assert words in done.text


def test_control_characters_of_a_name_are_escaped(typed, root, tmp_path):
    sweep(root, tmp_path / "axial_\u202e\u0085.csv")
    done = typed("inspect", "axial_\u202e\u0085.csv", "--no-plots")
    assert not {"\u202e", "\u0085"} & {*done.stdout, *done.stderr}
    assert tomllib.loads(done.stdout)["sweeps"][0]["file"].endswith("axial_\u202e\u0085.csv")


@pytest.mark.parametrize(("key", "words"), [("specimen_number", "of specimens"), ("preload", "under preloads of")])
def test_tests_of_two_specimens_or_preloads_are_not_fitted_in_silence(bushfit, own, key, words):
    campaign = own / CAMPAIGN
    head, loop, *sweeps = campaign.read_text(encoding="utf-8").split("[[")
    stated = [f'{test.rstrip()}\n{key} = "{value}"\n' for test, value in zip(sweeps, ("0 mm", "5 mm"), strict=True)]
    campaign.write_text("[[".join([head, loop, *stated]), encoding="utf-8")
    done = bushfit("fit", campaign, "-o", own / "x", "--no-plots")
    assert f"the tests are {words} 0 mm (sweep_axial), 5 mm (sweep_radial)" in done.stderr


def test_a_sheet_of_a_workbook(typed, root, tmp_path):
    with pd.ExcelWriter(tmp_path / "tests axial.xlsx") as book:
        for name, file in (("loop", "loop_axial_1"), ("sweep", "sweep_radial")):
            pd.read_csv(root / f"data/arm_bushing/{file}.csv").to_excel(book, sheet_name=name, index=False)
    for sheet, kind in (("loop", "loops"), ("sweep", "sweeps")):
        done = typed("inspect", "tests axial.xlsx", "--sheet", sheet, "--no-plots")
        assert f"sheet {sheet}" in done.stderr
        assert tomllib.loads(done.stdout)[kind][0]["sheet"] == sheet
    typed("init", "tests axial.xlsx", *GEOMETRY, "-o", "x")
    campaign = load_campaign(tmp_path / "x/campaign.toml")
    assert [test.name for test in (*campaign.loops, *campaign.sweeps)] == ["tests axial loop", "tests axial sweep"]
