"""Campaigns that hold all parameters or leave one nothing, and test files given for a campaign."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from commandline import Done

from bushfit.model.file import load_result

Run = Callable[..., Done]
CAMPAIGN = "configs/cmp_15961.toml"


@pytest.mark.parametrize("ending", ["csv", "txt", "tsv", "dat", "asc", "xls", "xlsx", "xlsm", "xlsb", "ods", "XLSX"])
@pytest.mark.parametrize("command", ["run", "fit-static"])
def test_a_test_file_is_no_campaign(typed: Run, tmp_path: Path, command: str, ending: str) -> None:
    (tmp_path / f"x.{ending}").write_bytes(b"PK\x03\x04")
    done = typed(command, f"x.{ending}")
    assert done.returncode == 2
    assert f"x.{ending}: a campaign is needed" in done.stderr
    assert f"try: bushfit init x.{ending} " in done.stderr
    assert typed(command, f"lost.{ending}").stderr.count("there is no such file") == 1


def test_a_model_is_no_campaign(bushfit: Run) -> None:
    done = bushfit("run", "model/model.json")
    assert done.returncode == 2
    assert "model.json: a campaign is needed" in done.stderr
    assert "bushfit predict model/model.json" in done.stderr


def held(work: Path, name: str, mu: str = "1.09 MPa") -> str:
    """A campaign that holds all five parameters."""
    values = {"mu": mu, "m": "0.2 MPa*s^alpha", "alpha": 0.24, "sigma_fmax": "14.6 kPa", "eps_half": 0.013}
    tables = "".join(f"\n[fit.{key}]\nvalue = {json.dumps(value)}\nvary = false\n" for key, value in values.items())
    (work / "configs" / name).write_text((work / CAMPAIGN).read_text() + tables)
    return f"configs/{name}"


@pytest.mark.parametrize("loss", ["linear", "soft_l1"])
@pytest.mark.parametrize("command", ["fit-static", "fit-dynamic", "fit", "run"])
def test_five_held_parameters_are_checked_against_the_tests(
    bushfit: Run, work: Path, tmp_path: Path, command: str, loss: str
) -> None:
    campaign = held(work, "held.toml")
    done = bushfit(command, campaign, "-o", str(tmp_path / "x"), "--no-plots", "--loss", loss)
    assert done.returncode == 0, done.stderr
    assert "nothing was fitted here, every parameter is held; the values given meet the tests" in done.stderr
    document = json.loads(next((tmp_path / "x").glob("[sdm]*.json")).read_text())
    assert {entry["vary"] for entry in document["parameters"].values()} == {False}
    assert document["parameters"]["mu"]["value"] == 1.09e6
    assert document["fit"]["nrmse"] < 0.01


def test_held_parameters_that_miss_the_tests_are_said_to(bushfit: Run, work: Path, tmp_path: Path) -> None:
    campaign = held(work, "off.toml", mu="1.3 MPa")
    done = bushfit("fit", campaign, "-o", str(tmp_path / "x"), "--no-plots", "--max-nrmse", "0.02")
    assert done.returncode == 1, done.stderr
    assert "the values given miss the tests by" in done.stderr
    refused = bushfit("diagnose", campaign, "-o", str(tmp_path / "y"), "--no-plots")
    assert refused.returncode == 2
    assert "every parameter is held" in refused.stderr


def test_a_parameter_on_a_bound_shows_no_interval(bushfit: Run, work: Path, tmp_path: Path) -> None:
    """Sweeps whose stiffness falls with frequency leave the springpot nothing to do."""
    sweep = pd.read_csv(work / "data/cmp_15961/sweep_axial.csv")
    sweep["stiffness [N/mm]"] *= (sweep["frequency [Hz]"] / 5.0) ** -0.15
    sweep.to_csv(work / "data/cmp_15961/falling.csv", index=False)
    campaign = (work / CAMPAIGN).read_text().replace("sweep_axial", "falling")
    (work / "configs/falling.toml").write_text(campaign + '\n[rig]\ngain_error = "0 %"\n')
    done = bushfit("fit", "configs/falling.toml", "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    result = load_result(tmp_path / "x" / "model.json")
    assert result.at_bound["m"] == "min"
    for name, end in result.at_bound.items():
        (row,) = [line for line in done.stderr.splitlines() if line.split()[:1] == [name]]
        assert row.split()[:3] == [name, "(at", f"{end})"]
        assert " to " not in row
