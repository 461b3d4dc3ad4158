"""fit-static, fit-dynamic and fit as typed: their files, and each taking what the one before wrote."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import Done, call

Run = Callable[..., Done]
CAMPAIGN = "configs/cmp_15961.toml"


CAMPAIGN_FILES = {
    "fit-static": {"static.json", "loops.csv", "loops.png"},
    "fit-dynamic": {"dynamic.json", "sweeps.csv", "sweeps.png"},
    "fit": {"model.json", "loops.csv", "loops.png", "sweeps.csv", "sweeps.png"},
}


@pytest.mark.parametrize("command", CAMPAIGN_FILES)
def test_fits_write_the_files_of_the_interface(bushfit: Run, tmp_path: Path, command: str) -> None:
    done = bushfit(command, CAMPAIGN, "-o", str(tmp_path / "x"))
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert {file.name for file in (tmp_path / "x").glob("[!.]*")} == CAMPAIGN_FILES[command]
    for word in ("parameter", "std error", "95 % interval", "unit", "NRMSE"):
        assert word in done.stderr


def test_the_paper_s_order_by_hand(bushfit: Run, tmp_path: Path) -> None:
    """fit-static, fit-dynamic --static, predict: each takes what the one before wrote."""
    s, d, p = (str(tmp_path / name) for name in "sdp")
    assert bushfit("fit-static", CAMPAIGN, "-o", s, "--no-plots").returncode == 0
    assert bushfit("fit-dynamic", CAMPAIGN, "--static", f"{s}/static.json", "-o", d, "--no-plots").returncode == 0
    done = bushfit("predict", f"{d}/dynamic.json", "-o", p, "--no-plots", "--direction", "torsion")
    assert done.returncode == 0, done.stderr
    assert [file.name for file in Path(p).glob("[!.]*")] == ["torsion.csv"]
    again = bushfit("fit-static", CAMPAIGN, "--dynamic", f"{d}/dynamic.json", "-o", str(tmp_path / "s2"), "--no-plots")
    assert "left out" not in again.stderr


@pytest.fixture
def own(work: Path, tmp_path: Path) -> Path:
    """A folder with a copy of the campaign, to be changed."""
    for name in ("data", "configs"):
        shutil.copytree(work / name, tmp_path / name)
    return tmp_path


REPEATS_OFF = "repeats differ as a whole by an error of"
ROWS_APART = "points that repeat each other lie up to"


def second_off(own: Path, off: float, tilted: bool = False) -> None:
    """The second of two repeats is off, at all frequencies or more and more along them."""
    file = own / "data/cmp_15961/sweep_axial.csv"
    table = pd.read_csv(file).query("repeat <= 2")
    share = np.log(table["frequency [Hz]"] / 5.0) / np.log(31.0) if tilted else 1.0
    table["stiffness [N/mm]"] *= 1.0 + off * share * (table["repeat"] == 2)
    table.to_csv(file, index=False)


@pytest.mark.parametrize(
    ("off", "tilted", "told"),
    [
        (0.0, False, []),
        (0.05, False, [REPEATS_OFF]),
        (0.13, False, [ROWS_APART, REPEATS_OFF]),
        (0.13, True, [ROWS_APART, REPEATS_OFF]),
    ],
)
@pytest.mark.parametrize("command", ["fit", "diagnose"])
def test_repeats_that_disagree_do_not_excuse_themselves(
    own: Path, command: str, off: float, tilted: bool, told: list[str]
) -> None:
    second_off(own, off, tilted)
    done = call(own, command, CAMPAIGN, "-o", "out", "--no-plots")
    assert done.returncode == 0, done.stderr
    warnings = [line for line in done.stderr.splitlines() if line.startswith("warning:")]
    assert [words for words in (ROWS_APART, REPEATS_OFF) if any(words in line for line in warnings)] == told
    if ROWS_APART in told:
        assert "sweep_axial.csv" in warnings[0]
        assert re.search(r"rows \d+ and \d+", warnings[0])
        assert done.stderr.startswith("warning:")  # before anything is fitted
    if command == "diagnose":
        assert ("consistent" in done.stderr) is not bool(told)


@pytest.mark.parametrize(
    "words",
    [
        ("predict", "{work}/model/model.json", "--campaign", CAMPAIGN),
        ("plan", CAMPAIGN),
        ("compare", CAMPAIGN, CAMPAIGN),
        ("compare", CAMPAIGN, "--families", "intrinsic_time"),
        ("inspect", "data/cmp_15961/sweep_axial.csv"),
    ],
    ids=["predict", "plan", "compare", "families", "inspect"],
)
def test_rows_that_lie_far_apart_are_told_wherever_tests_are_read(
    own: Path, work: Path, words: tuple[str, ...]
) -> None:
    second_off(own, 0.13)
    done = call(own, *(word.format(work=work) for word in words), "-o", "out", "--no-plots", "--json")
    assert done.returncode == 0, done.stderr
    for told in (done.stderr, done.stdout):
        assert ROWS_APART in " ".join(told.split())
        assert re.search(r"sweep_axial.csv: .*, rows \d+ and \d+", " ".join(told.split()))


@pytest.mark.parametrize(
    ("kind", "file", "column"),
    [("loops", "loop_axial_1", "force [N]"), ("sweeps", "sweep_axial", "stiffness [N/mm]")],
)
def test_a_test_that_repeats_another_and_lies_far_off_is_told(own: Path, kind: str, file: str, column: str) -> None:
    table = pd.read_csv(own / f"data/cmp_15961/{file}.csv")
    table[column] *= 1.15
    table.to_csv(own / "data/cmp_15961/again.csv", index=False)
    with (own / CAMPAIGN).open("a", encoding="utf-8") as campaign:
        campaign.write(f'\n[[{kind}]]\nfile = "../data/cmp_15961/again.csv"\ndirection = "axial"\n')
    for words in (
        ("fit", CAMPAIGN),
        ("inspect", f"data/cmp_15961/{file}.csv", "data/cmp_15961/again.csv", "--direction", "axial"),
    ):
        done = call(own, *words, "-o", words[0], "--no-plots")
        told = " ".join(done.stderr.split())
        assert re.search(rf"again(\.csv)?: it repeats {file}, and their stiffness lies 1\d % apart", told), told


def test_the_gain_error_of_loops_is_said(own: Path) -> None:
    errors, plain = {}, (own / CAMPAIGN).read_text(encoding="utf-8")
    for stated in ("", "0.5 %", "0 %"):
        campaign = plain + f'\n[rig]\ngain_error = "{stated}"\n' * bool(stated)
        (own / CAMPAIGN).write_text(campaign, encoding="utf-8")
        done = call(own, "fit", CAMPAIGN, "-o", "out", "--no-plots", "--force")
        assert ("gain of a loop within 0.5 %" in done.stderr) is (stated != "0 %")
        fit = json.loads((own / "out/model.json").read_text(encoding="utf-8"))
        errors[stated] = fit["fit"]["loop_gain_error"]
    assert errors == {"": 0.005, "0.5 %": 0.005, "0 %": 0.0}


def test_a_bar_in_tension_and_a_coupon_in_shear_of_one_rubber_have_one_fit(typed: Run, tmp_path: Path) -> None:
    """By hand: a bar has three times the modulus, and the same energy at a strain sqrt(3) times smaller."""
    frequency, strain = (axis.ravel() for axis in np.meshgrid([5, 10, 20, 40, 80], [0.2, 0.7, 2.0, 6.0]))
    modulus = 1.0 + 0.1 * frequency**0.24 + 0.6 / (1.0 + strain / 1.5)
    loss = 0.05 + 0.007 * np.log(frequency) + 0.15 * strain / (1.5 + strain) ** 2
    fitted = {}
    for symbol, factor, stretched in (("E", 3.0, np.sqrt(3.0)), ("G", 1.0, 1.0)):
        columns = (frequency, strain / stretched, factor * modulus, loss)
        rows = "\n".join(",".join(f"{cell:.7g}" for cell in row) for row in zip(*columns, strict=True))
        header = f"Frequency [Hz],Strain [%],Storage Modulus {symbol}' [MPa],tan delta [-]"
        (tmp_path / f"{symbol}.csv").write_text(f"{header}\n{rows}\n", encoding="utf-8")
        assert typed("init", f"{symbol}.csv", "-o", f"{symbol}.toml").returncode == 0
        done = typed("fit", f"{symbol}.toml", "-o", symbol, "--no-plots", "--json")
        assert done.returncode == 0, done.stderr
        fitted[symbol] = {name: each["value"] for name, each in json.loads(done.stdout)["parameters"].items()}
    assert fitted["E"] == pytest.approx(fitted["G"], rel=1e-3)
