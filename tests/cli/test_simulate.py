"""simulate as typed: a campaign that the fits take, the same for the same seed."""

from __future__ import annotations

import json
import shlex
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commandline import Done, call

from bushfit.campaign.campaign import load_campaign
from bushfit.model.file import from_document

Run = Callable[..., Done]
CAMPAIGN = "configs/cmp_15961.toml"


def test_simulate_writes_a_campaign_that_run_takes(bushfit: Run, tmp_path: Path) -> None:
    at = str(tmp_path / "sim")
    one = bushfit("simulate", "model/model.json", "--seed", "7", "--noise", "0.5 %", "-o", at)
    assert one.returncode == 0, one.stderr
    assert {"campaign.toml", "truth.json", "loop_axial_1.csv", "sweep_axial.csv", "sweep_radial.csv"} == {
        file.name for file in Path(at).glob("[!.]*")
    }
    bushfit("simulate", "model/model.json", "--seed", "7", "--noise", "0.5 %", "-o", f"{at}2")
    bushfit("simulate", "model/model.json", "--seed", "8", "--noise", "0.5 %", "-o", f"{at}3")
    same, other = ((Path(at + n) / "sweep_axial.csv").read_text() for n in ("2", "3"))
    assert (Path(at) / "sweep_axial.csv").read_text() == same != other
    fitted = bushfit("fit", f"{at}/campaign.toml", "-o", str(tmp_path / "fit"), "--no-plots", "--json")
    truth = json.loads((Path(at) / "truth.json").read_text())["parameters"]
    for name, entry in json.loads(fitted.stdout)["parameters"].items():
        assert entry["value"] == pytest.approx(truth[name]["value"], rel=0.06)


SPECIMENS = """
[[specimens]]
name = "DMA"
kind = "modulus"

[[specimens]]
name = "mount"
kind = "shear"
area = "772 mm^2"
thickness = "6 mm"
elements = 2

[simulate]
seed = 3
repeats = 2
noise = "0.5 %"
gain_error = "0.2 %"

[simulate.parameters]
mu = "1.09 MPa"
m = "0.2 MPa*s^alpha"
alpha = 0.24
sigma_fmax = "14.6 kPa"
eps_half = 0.013

[simulate.effects.stiffness_factor]
mount = 1.1

[[simulate.sweeps]]
specimen = "DMA"
amplitudes = ["0.1 %", "0.2 %", "0.5 %", "1 %", "2 %", "5 %", "10 %"]
frequencies = ["1 Hz", "10 Hz", "100 Hz"]
stepped = "amplitude"
reached = "2 %"

[[simulate.resonances]]
specimen = "mount"
mass = "250 g"
base_acceleration = "0.1 g"
frequencies = { start = "60 Hz", stop = "600 Hz", step = "10 Hz" }
"""


def test_simulated_specimens_are_reduced_and_fitted_as_the_campaign_says(typed: Run, tmp_path: Path) -> None:
    (tmp_path / "plan.toml").write_text(SPECIMENS)
    assert typed("simulate", "plan.toml", "-o", "sim", "--json").returncode == 0
    truth = json.loads((tmp_path / "sim/truth.json").read_text())
    assert [truth["schema"], truth["bushing"], truth["specimens"][1]["name"]] == ["bushfit/model/2", None, "mount"]
    assert (
        (tmp_path / "sim/sweep_DMA.csv")
        .read_text()
        .startswith("frequency [Hz],strain amplitude [%],repeat,modulus [MPa],")
    )
    lines = (tmp_path / "sim/campaign.toml").read_text().splitlines()
    commands = [shlex.split(line)[2:] for line in lines if line.startswith("# bushfit reduce")]
    assert len(commands) == 2
    for command in commands:
        reduced = call(tmp_path / "sim", *command, "--no-plots")
        assert reduced.returncode == 0, reduced.stderr
    start = next(place for place, line in enumerate(lines) if line.startswith("# A sweep comes"))
    named = "\n".join(line for line in lines[start:] if not line.startswith(("# A sweep", "# bushfit")))
    (tmp_path / "sim/all.toml").write_text("\n".join(lines[:start]) + "\n" + named.replace("# ", ""))
    campaign = load_campaign(tmp_path / "sim/all.toml")
    model = from_document(truth).model
    for sweep in campaign.sweeps:
        expected = model.stiffness(sweep.direction, sweep.frequency, sweep.amplitude)
        assert np.median(np.abs(sweep.stiffness / expected - 1.0)) < 0.02
    fitted = typed("fit", "sim/campaign.toml", "--no-plots", "--json", "-o", "fit")
    assert fitted.returncode == 0, fitted.stderr
    found = json.loads(fitted.stdout)["parameters"]
    assert {name: found[name]["value"] / truth["parameters"][name]["value"] for name in found} == {
        name: pytest.approx(1.0, abs=0.2) for name in found
    }


def test_a_stiffness_factor_can_be_hidden_in_any_place(bushfit: Run, tmp_path: Path) -> None:
    at = str(tmp_path / "sim")
    done = bushfit("simulate", "model/model.json", "--effect", "stiffness_factor.radial=1.1", "-o", at)
    assert done.returncode == 0, done.stderr
    truth = json.loads((Path(at) / "truth.json").read_text())["parameters"]
    assert truth["stiffness_factor.radial"]["value"] == 1.1
