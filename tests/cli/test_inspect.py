"""`inspect` as typed: told on standard error, the campaign's text on standard output, one error for what is bad."""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from bushfit.campaign.campaign import load_campaign

CLEAN = ("data/arm_bushing/loop_axial_1.csv", "data/arm_bushing/sweep_radial.csv")
RECORD = "data/cmp_15961_raw/stepped_sine_axial.csv"


def test_files_are_told_and_the_campaign_s_text_can_be_pasted(typed: Callable, root: Path, tmp_path: Path) -> None:
    done = typed("inspect", *(root / file for file in (*CLEAN, RECORD)), "-o", "x")
    assert done.returncode == 0, done.stderr
    assert [file.name for file in (tmp_path / "x").glob("[!.]*")] == ["inspect.png"]
    campaign = tomllib.loads(done.stdout)
    assert [(kind, test["direction"]) for kind, (test,) in campaign.items()] == [
        ("loops", "axial"), ("sweeps", "radial"),
    ]  # fmt: skip
    assert "bushfit reduce" in done.stdout
    assert done.stderr.count("nothing odd") == 3
    assert "mean displacement: 0 mm" in done.stderr
    assert not re.search(r": -?[\d.]+e[-+]?\d", done.stderr)
    for words in ("a hysteresis loop, axial", "taken for", "columns parted by comma", "0.1 Hz, a sine", "frequencies"):
        assert words in done.stderr


def test_json_holds_everything(typed: Callable, root: Path) -> None:
    done = typed("inspect", *(root / file for file in CLEAN), "--json", "-q", "--no-plots")
    assert (done.returncode, done.stderr) == (0, "")
    document = json.loads(done.stdout)
    loop, sweep = document["files"]
    assert (loop["kind"], sweep["kind"]) == ("loop", "sweep")
    assert [column["role"] for column in loop["columns"]] == ["time", "displacement", "force"]
    assert loop["odd"] == []
    assert "[[loops]]" in document["campaign"]


def test_a_bad_file_is_one_error_after_the_good_ones(typed: Callable, root: Path, tmp_path: Path) -> None:
    (tmp_path / "bad.csv").write_text("length [mm],colour\n1,2\n2,3\n", encoding="utf-8")
    done = typed("inspect", "bad.csv", root / CLEAN[0], "-o", "x")
    assert done.returncode == 2
    assert done.stderr.index("a hysteresis loop") < done.stderr.index("bushfit: error: bad.csv")
    assert "the columns do not make a test" in done.stderr
    assert "[[loops]]" in done.stdout
    assert not (tmp_path / "x").exists()


def test_bad_files_are_told_in_the_order_given_the_last_as_the_error(
    typed: Callable, root: Path, tmp_path: Path
) -> None:
    for name in ("one", "two", "three"):
        (tmp_path / f"{name}.csv").write_text("length [mm],colour\n1,2\n2,3\n", encoding="utf-8")
    done = typed("inspect", "one.csv", root / CLEAN[0], "two.csv", "three.csv", "-q")
    assert done.returncode == 2
    places = [done.stderr.index(said) for said in ("used: one.csv", "used: two.csv", "bushfit: error: three.csv")]
    assert places == sorted(places)
    assert not (tmp_path / "results").exists()


def test_results_are_not_replaced_unasked(typed: Callable, root: Path) -> None:
    assert typed("inspect", root / CLEAN[0], "-o", "x", "-q").returncode == 0
    assert "results stand there already" in typed("inspect", root / CLEAN[0], "-o", "x").stderr
    assert typed("inspect", root / CLEAN[0], "-o", "x", "-q", "--force").returncode == 0
    assert typed("inspect", root / CLEAN[0], "-o", "x", "--no-plots").returncode == 0


def test_many_files_make_several_pictures(typed: Callable, root: Path, tmp_path: Path) -> None:
    done = typed("inspect", *[root / CLEAN[1]] * 6, "-o", "x", "-q")
    assert done.returncode == 0, done.stderr
    assert {file.name for file in (tmp_path / "x").glob("[!.]*")} == {"inspect.png", "inspect_2.png"}


def test_a_sheet_of_a_workbook(typed: Callable, root: Path, tmp_path: Path) -> None:
    with pd.ExcelWriter(tmp_path / "tests axial.xlsx") as book:
        for name, file in (("loop", CLEAN[0]), ("sweep", CLEAN[1])):
            pd.read_csv(root / file).to_excel(book, sheet_name=name, index=False)
    for sheet, kind in (("loop", "loops"), ("sweep", "sweeps")):
        done = typed("inspect", "tests axial.xlsx", "--sheet", sheet, "--no-plots")
        assert done.returncode == 0, done.stderr
        assert f"sheet {sheet}" in done.stderr
        assert tomllib.loads(done.stdout)[kind][0]["sheet"] == sheet


@pytest.mark.parametrize(
    ("header", "option", "said"),
    [
        ("time [s],displacement [mm],force", "force=N", '--unit "force='),
        ("time [s],displacement [mm],cell 2 [N]", "force=cell 2 [N]", "--column force="),
    ],
)
def test_an_error_names_the_option_that_settles_it(
    typed: Callable, root: Path, tmp_path: Path, header: str, option: str, said: str
) -> None:
    rows = (root / CLEAN[0]).read_text(encoding="utf-8").split("\n", 1)[1]
    (tmp_path / "axial.csv").write_text(f"{header}\n{rows}", encoding="utf-8")
    done = typed("inspect", "axial.csv", "--no-plots")
    assert done.returncode == 2
    assert said in done.stderr
    again = typed("inspect", "axial.csv", "--no-plots", "--unit" if "unit" in said else "--column", option)
    assert again.returncode == 0, again.stderr
    assert option.partition("=")[2] in again.stdout


@pytest.mark.parametrize(
    ("header", "said", "unsaid"),
    [
        ("frequency [Hz],amplitude [mm],K7 [N/mm],loss factor [-]", "--column stiffness=...", "force="),
        ("x [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]", "--at-frequency", "force="),
        ("frequency [Hz],amplitude,stiffness [N/mm],loss factor [-]", '--unit "amplitude=', "--amplitude"),
        ("frequency [Hz],amplitude [mm],stiffness [N/mm],K* [N/mm]", "could be the stiffness", "force"),
    ],
)
def test_a_hint_leads_to_what_a_sweep_lacks(
    typed: Callable, tmp_path: Path, header: str, said: str, unsaid: str
) -> None:
    rows = "\n".join(f"{f},0.1,{600 + f},0.1" for f in range(5, 50, 5))
    (tmp_path / "axial.csv").write_text(f"{header}\n{rows}\n", encoding="utf-8")
    done = typed("inspect", "axial.csv", "--no-plots")
    print(done.stderr)
    assert done.returncode == 2
    assert said in done.stderr
    assert unsaid not in done.stderr.partition("try:")[2]


@pytest.mark.parametrize(
    "header",
    ["f [Hz],F [N],amplitude [mm],Steifigkeit dyn. [N/mm],delta [deg]", "f Hz,F in N,ampl mm,dyn. Steifigkeit,eta"],
)
def test_the_unit_tells_frequency_from_force(typed: Callable, tmp_path: Path, header: str) -> None:
    rows = "\n".join(f"{f},60,0.1,{600 + f},0.2" for f in range(5, 50, 5))
    (tmp_path / "axial.csv").write_text(f"{header}\n{rows}\n", encoding="utf-8")
    done = typed("inspect", "axial.csv", "--no-plots", *(("--unit", "stiffness=N/mm") if "eta" in header else ()))
    assert done.returncode == 0, done.stderr
    assert "from 5 to 45 Hz" in done.stderr


@pytest.mark.parametrize(
    ("header", "options", "said", "unsaid"),
    [
        ("amplitude [mm]", (), "taken zero-to-peak, else --amplitude peak-to-peak", "half of"),
        ("Pegel [mm]", ("--column", "amplitude=Pegel"), "taken zero-to-peak, else --amplitude", "half of"),
        ("Amplitude SS [mm]", (), '0.05 mm zero-to-peak, half of "Amplitude SS [mm]", which counts peak', "taken zero"),
        ("Pegel", ("--column", "amplitude=Pegel", "--unit", "amplitude=mmpp"), 'half of "Pegel"', "taken zero"),
        ("amplitude [mm]", ("--amplitude", "peak-to-peak"), 'half of "amplitude [mm]"', "taken zero"),
        ("amplitude 0-p [mm]", (), "0.1 mm zero-to-peak", "taken zero"),
    ],
)
def test_how_amplitudes_are_counted_is_said(
    typed: Callable, tmp_path: Path, header: str, options: tuple[str, ...], said: str, unsaid: str
) -> None:
    rows = "\n".join(f"{f},0.1,{600 + f},0.1" for f in range(5, 50, 5))
    (tmp_path / "axial.csv").write_text(f"f [Hz],{header},stiffness [N/mm],eta\n{rows}\n", encoding="utf-8")
    done = typed("inspect", "axial.csv", "--no-plots", *options)
    assert done.returncode == 0, done.stderr
    assert said in done.stderr
    assert unsaid not in done.stderr


def test_the_text_holds_in_a_campaign_in_any_folder(typed: Callable, root: Path, tmp_path: Path) -> None:
    (tmp_path / "lab").mkdir()
    (tmp_path / "lab/axial.csv").write_bytes((root / CLEAN[0]).read_bytes())
    done = typed("inspect", "lab/axial.csv", "--no-plots", "-q")
    assert done.stdout.startswith("# files by their full path")
    bushing = '[bushing]\nname = "B"\ninner_radius = "14 mm"\nouter_radius = "20 mm"\nlength = "45 mm"\n'
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere/campaign.toml").write_text(bushing + done.stdout, encoding="utf-8")
    (loop,) = load_campaign(tmp_path / "elsewhere/campaign.toml").loops
    assert loop.time.size == 2001


def two_sweeps(folder: Path, *headers: str) -> list[str]:
    rows = "\n".join(f"{f},0.1,{600 + f},0.1" for f in range(5, 50, 5))
    for number, header in enumerate(headers):
        (folder / f"axial_{number}.csv").write_text(f"f [Hz],{header},stiffness [N/mm],eta\n{rows}\n", encoding="utf-8")
    return [f"axial_{number}.csv" for number in range(len(headers))]


def test_a_column_is_named_where_it_stands(typed: Callable, tmp_path: Path) -> None:
    files = two_sweeps(tmp_path, "Pegel SS [mm]", "amplitude [mm]")
    done = typed("inspect", *files, "--no-plots", "--column", "amplitude=Pegel SS [mm]")
    assert done.returncode == 0, done.stderr
    one, other = tomllib.loads(done.stdout)["sweeps"]
    assert one["columns"] == {"amplitude": "Pegel SS [mm]"}
    assert "columns" not in other
    assert "amplitudes: 0.05 mm" in done.stderr
    assert "amplitudes: 0.1 mm" in done.stderr


@pytest.mark.parametrize(
    ("headers", "said"),
    [
        (
            ("amplitude [mm]", "amplitude [mm]"),
            ('axial_0.csv, line 1: there is no column "Pegel SS"', "the header that"),
        ),
        (("Pegel SS [mm]", "Niveau [mm]"), ("axial_1.csv, line 1", '--column "amplitude=..."', "--at-amplitude")),
    ],
)
def test_a_column_that_no_file_has_is_refused(
    typed: Callable, tmp_path: Path, headers: tuple[str, ...], said: tuple[str, ...]
) -> None:
    size = ("--inner-radius", "10 mm", "--outer-radius", "18 mm", "--length", "34 mm")
    done = typed("init", *two_sweeps(tmp_path, *headers), *size, "--column", "amplitude=Pegel SS", "-o", "x")
    assert done.returncode == 2
    for words in (*said, "try: "):
        assert words in done.stderr
    assert not (tmp_path / "x").exists()
