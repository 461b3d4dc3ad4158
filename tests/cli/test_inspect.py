"""`inspect` as typed: told on standard error, the campaign's text on standard output, one error for what is bad."""

import tomllib
from pathlib import Path

import pandas as pd
import pytest
from shell import BUSHING, refused

from bushfit.campaign.campaign import load_campaign

CLEAN = ("data/arm_bushing/loop_axial_1.csv", "data/arm_bushing/sweep_radial.csv")
RECORD = "data/cmp_15961_raw/stepped_sine_axial.csv"


def test_bad_files_are_told_in_the_order_given_the_last_as_the_error(typed, root, tmp_path):
    for name in ("one", "two", "three"):
        (tmp_path / f"{name}.csv").write_text("length [mm],colour\n1,2\n2,3\n", encoding="utf-8")
    done = typed("inspect", "one.csv", root / CLEAN[0], "two.csv", "three.csv", "-o", "x", status=2)
    said = ("a hysteresis loop", "used: one.csv", "used: two.csv", "bushfit: error: three.csv")
    places = [done.stderr.index(words) for words in said]
    assert places == sorted(places)
    refused(done, tmp_path / "x", "the columns are not those of a test")
    assert "[[loops]]" in done.stdout


def test_a_sheet_of_a_workbook(typed, root, tmp_path):
    with pd.ExcelWriter(tmp_path / "tests axial.xlsx") as book:
        for name, file in (("loop", CLEAN[0]), ("sweep", CLEAN[1])):
            pd.read_csv(root / file).to_excel(book, sheet_name=name, index=False)
    for sheet, kind in (("loop", "loops"), ("sweep", "sweeps")):
        done = typed("inspect", "tests axial.xlsx", "--sheet", sheet, "--no-plots")
        assert f"sheet {sheet}" in done.stderr
        assert tomllib.loads(done.stdout)[kind][0]["sheet"] == sheet
    sizes = ("--inner-radius", "10 mm", "--outer-radius", "18 mm", "--length", "34 mm")
    typed("init", "tests axial.xlsx", *sizes, "-o", "x")
    campaign = load_campaign(tmp_path / "x/campaign.toml")
    assert [test.name for test in (*campaign.loops, *campaign.sweeps)] == ["tests axial loop", "tests axial sweep"]


def sweeps(folder: Path, *headers: str, cells: str = "0.1,{},0.1") -> list[str]:
    """Files of these headers, each with frequencies and then these cells, stiffness by its place."""
    rows = "\n".join(f"{f},{cells.format(600 + f)}" for f in range(5, 50, 5))
    files = [f"axial_{number}.csv" for number in range(len(headers))]
    for file, header in zip(files, headers, strict=True):
        (folder / file).write_text(f"{header}\n{rows}\n", encoding="utf-8")
    return files


@pytest.mark.parametrize(
    ("header", "said", "unsaid"),
    [
        ("frequency [Hz],amplitude [mm],K7 [N/mm],K8 [N/mm]", '--column "stiffness=K7 [N/mm]"', "force="),
        ("x,amplitude [mm],stiffness [N/mm],loss factor [-]", "--at-frequency", "force="),
        ("frequency [Hz],amplitude,stiffness [N/mm],loss factor [-]", '--unit "amplitude=', "--amplitude"),
        ("frequency [Hz],amplitude [mm],stiffness [N/mm],K* [N/mm]", "could be the stiffness", "force"),
        ("frequency [Hz],amplitude [mm],stiffness [N/mm],D [-]", '--column "damping_ratio=', "force"),
    ],
)
def test_a_hint_leads_to_what_a_sweep_lacks(typed, tmp_path, header, said, unsaid):
    done = typed("inspect", *sweeps(tmp_path, header), "--no-plots", status=2)
    assert said in done.stderr
    assert unsaid not in done.stderr.partition("try:")[2]


WIDE_TABLE = (
    "f [Hz],K* 0.1 mm [N/mm],K* 0.2 mm [N/mm],tan d 0.1 mm,tan d 0.2 mm\n5,600,550,0.1,0.11\n9,610,560,0.1,0.11\n"
)
LONG_TABLE = "f [Hz],K* [N/mm],tan d\n5,600,0.1\n9,610,0.1\n15,620,0.1\n"


@pytest.mark.parametrize(
    ("texts", "options", "message"),
    [
        (
            {"axial_A0.1.csv": LONG_TABLE, "axial_A0.5.csv": LONG_TABLE.replace("0,0", "1,0")},
            ["--at-amplitude", "0.1 mm"],
            "their names state different values",
        ),
        (
            {"bushing.csv": f"Axial\n{WIDE_TABLE}\nRadial\n{WIDE_TABLE}"},
            ["--direction", "axial"],
            "the titles of the tables name several directions",
        ),
    ],
)
def test_an_option_that_the_files_contradict_is_an_error(typed, tmp_path, texts, options, message):
    for name, text in texts.items():
        (tmp_path / name).write_text(text)
    assert message in typed("inspect", *texts, "--no-plots", *options, status=2).stderr


def test_a_column_is_named_where_it_stands_and_the_text_holds_in_any_folder(typed, tmp_path, root):
    files = sweeps(tmp_path, *(f"f [Hz],{level} [mm],stiffness [N/mm],eta" for level in ("Pegel SS", "amplitude")))
    done = typed("inspect", *files, "--no-plots", "--column", "amplitude=Pegel SS [mm]")
    one, other = tomllib.loads(done.stdout)["sweeps"]
    assert one["columns"] == {"amplitude": "Pegel SS [mm]"}
    assert "columns" not in other
    assert "amplitudes: 0.05 mm" in done.stderr
    assert "amplitudes: 0.1 mm" in done.stderr
    first = tmp_path / files[0]
    first.write_text(first.read_text().replace("Pegel SS [mm]", "Pegel SS"))
    done = typed("inspect", *files, "--no-plots", "--column", "amplitude=Pegel SS", "--unit", "amplitude=um")
    one, other = tomllib.loads(done.stdout)["sweeps"]
    assert (one["units"], "units" in other) == ({"amplitude": "um"}, False)
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/axial.csv").write_bytes((root / CLEAN[0]).read_bytes())
    done = typed("inspect", "lab/axial.csv", "--no-plots")
    assert done.stdout.startswith("# files with their full path")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/campaign.toml").write_text(BUSHING + done.stdout, encoding="utf-8")
    (loop,) = load_campaign(tmp_path / "elsewhere/campaign.toml").loops
    assert loop.time.size == 2001
