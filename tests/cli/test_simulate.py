"""simulate as typed: a campaign that the fits take, the same for the same seed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from commandline import Done

Run = Callable[..., Done]
CAMPAIGN = "configs/cmp_15961.toml"


def test_simulate_writes_a_campaign_that_run_takes(bushfit: Run, tmp_path: Path) -> None:
    at = str(tmp_path / "sim")
    one = bushfit("simulate", "model/model.json", "--seed", "7", "--noise", "0.5 %", "-o", at)
    assert one.returncode == 0, one.stderr
    assert {"campaign.toml", "truth.json", "loop_axial_1.csv", "sweep_axial.csv", "sweep_radial.csv"} == {
        file.name for file in Path(at).iterdir()
    }
    bushfit("simulate", "model/model.json", "--seed", "7", "--noise", "0.5 %", "-o", f"{at}2")
    bushfit("simulate", "model/model.json", "--seed", "8", "--noise", "0.5 %", "-o", f"{at}3")
    same, other = ((Path(at + n) / "sweep_axial.csv").read_text() for n in ("2", "3"))
    assert (Path(at) / "sweep_axial.csv").read_text() == same != other
    fitted = bushfit("fit", f"{at}/campaign.toml", "-o", str(tmp_path / "fit"), "--no-plots", "--json")
    truth = json.loads((Path(at) / "truth.json").read_text())["parameters"]
    for name, entry in json.loads(fitted.stdout)["parameters"].items():
        assert entry["value"] == pytest.approx(truth[name]["value"], rel=0.06)
