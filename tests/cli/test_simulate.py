"""simulate as typed: a campaign that the fits take, the same for the same seed."""

from __future__ import annotations

import shlex
from pathlib import Path

import numpy as np
import pytest
from shell import Run, document, names, typing, values

from bushfit.campaign.campaign import load_campaign
from bushfit.model.file import from_document


def test_simulate_writes_a_campaign_that_run_takes(bushfit: Run, tmp_path: Path) -> None:
    for folder, seed in (("one", 7), ("same", 7), ("other", 8)):
        bushfit("simulate", "model/model.json", "--seed", seed, "--noise", "0.5 %", "-o", tmp_path / folder)
    one, same, other = ((tmp_path / name / "sweep_axial.csv").read_text() for name in ("one", "same", "other"))
    assert one == same != other
    files = {"campaign.toml", "truth.json", "loop_axial_1.csv", "sweep_axial.csv", "sweep_radial.csv"}
    assert names(tmp_path / "one") == files
    fitted = values(bushfit("fit", tmp_path / "one/campaign.toml", "-o", tmp_path / "fit", "--no-plots", "--json"))
    truth = document(tmp_path / "one/truth.json")["parameters"]
    assert fitted == pytest.approx({name: truth[name]["value"] for name in fitted}, rel=0.06)
    bushfit("simulate", "model/model.json", "--effect", "stiffness_factor.radial=1.1", "-o", tmp_path / "sim")
    assert document(tmp_path / "sim/truth.json")["parameters"]["stiffness_factor.radial"]["value"] == 1.1


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
    typed("simulate", "plan.toml", "-o", "sim")
    truth = document(tmp_path / "sim/truth.json")
    assert [truth["schema"], truth["bushing"], truth["specimens"][1]["name"]] == ["bushfit/model/2", None, "mount"]
    header = "frequency [Hz],strain amplitude [%],repeat,modulus [MPa],"
    assert (tmp_path / "sim/sweep_DMA.csv").read_text().startswith(header)
    lines = (tmp_path / "sim/campaign.toml").read_text().splitlines()
    commands = [shlex.split(line)[2:] for line in lines if line.startswith("# bushfit reduce")]
    assert len(commands) == 2
    for command in commands:
        typing(tmp_path / "sim")(*command, "--no-plots")
        start = next(place for place, line in enumerate(lines) if line.startswith("# A sweep comes"))
    named = "\n".join(line for line in lines[start:] if not line.startswith(("# A sweep", "# bushfit")))
    (tmp_path / "sim/all.toml").write_text("\n".join(lines[:start]) + "\n" + named.replace("# ", ""))
    campaign = load_campaign(tmp_path / "sim/all.toml")
    model = from_document(truth).model
    for sweep in campaign.sweeps:
        expected = model.stiffness(sweep.direction, sweep.frequency, sweep.amplitude)
        assert np.median(np.abs(sweep.stiffness / expected - 1.0)) < 0.02
    found = values(typed("fit", "sim/campaign.toml", "--no-plots", "--json", "-o", "fit"))
    assert found == pytest.approx({name: truth["parameters"][name]["value"] for name in found}, rel=0.2)
