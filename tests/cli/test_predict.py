"""predict as typed: grids, measurements laid over, and each warning once."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from shell import CAMPAIGN, Run, names

ARM = "data/arm_bushing/truth.json"


def test_predict_lays_measurements_over_and_takes_grids(bushfit: Run, tmp_path: Path) -> None:
    grid = ("--frequencies", "10:30:10 Hz", "--amplitudes", "0.1, 0.3 mm")
    done = bushfit("predict", "model/model.json", "--campaign", CAMPAIGN, "-o", tmp_path / "x", *grid)
    assert names(tmp_path / "x") == {"axial.csv", "axial.png", "radial.csv", "radial.png", "measured.csv"}
    measured = pd.read_csv(tmp_path / "x" / "measured.csv")
    assert set(measured["sweep"]) == {"sweep_axial", "sweep_radial"}
    assert dict(zip(measured["direction"], measured["fitted"], strict=True)) == {"axial": "yes", "radial": "no"}
    assert measured["model over measured [-]"].between(0.95, 1.05).all()
    assert "radial: usable within" in done.stderr
    table = pd.read_csv(tmp_path / "x" / "axial.csv")
    assert table["frequency [Hz]"].tolist() == [10, 20, 30] * 2
    assert table["amplitude [mm]"].tolist() == [0.1] * 3 + [0.3] * 3


def test_predict_says_each_warning_once_and_in_its_document(bushfit: Run, root: Path, tmp_path: Path) -> None:
    truth = root / "data/mystery_mount/open_last/truth.json"
    for model, said in ((truth, "left out of the prediction"), ("model/model.json", "radial: not fitted")):
        done = bushfit("predict", model, "-o", tmp_path / "x", "--no-plots", "--force", "--json")
        told = [line for line in done.stderr.splitlines() if line.startswith("warning: ")]
        assert len(set(told)) == len(told) > 0
        warnings = json.loads(done.stdout)["warnings"]
        assert [f"warning: {line}" for line in warnings] == told
        assert any(line.startswith(said) for line in warnings)


def test_predict_shows_at_most_eight_amplitudes_a_direction(bushfit: Run, tmp_path: Path) -> None:
    amplitudes = ", ".join(f"{0.02 * n:.2f}" for n in range(1, 31)) + " mm"
    options = ("--direction", "axial", "--amplitudes", amplitudes, "--no-plots", "-o", tmp_path / "x")
    done = bushfit("predict", "model/model.json", *options)
    lines = [line.split() for line in done.stderr.splitlines() if line.split()[:1] == ["155"]]
    shown = [words[1] for words in lines]
    value, low, high = (float(lines[0][place].strip("()")) for place in (2, 3, 5))
    first = pd.read_csv(tmp_path / "x/axial.csv").query("`frequency [Hz]` == 155").iloc[0]
    wanted = [first[f"stiffness [N/mm]{end}"] for end in ("", ", low", ", high")]
    assert (value, low, high) == pytest.approx(wanted, abs=0.051)
    assert len(shown) == 8
    assert (shown[0], shown[-1]) == ("0.02", "0.6")
    assert len(pd.read_csv(tmp_path / "x/axial.csv")["amplitude [mm]"].unique()) == 30


@pytest.mark.parametrize(
    ("temperature", "said"), [("40 degC", "the model knows no temperature"), ("warm", "--temperature")]
)
def test_predict_at_a_temperature_needs_a_model_that_knows_one(
    bushfit: Run, tmp_path: Path, temperature: str, said: str
) -> None:
    at = ("--no-plots", "-o", tmp_path / "x", "--temperature", temperature)
    assert said in bushfit("predict", "model/model.json", *at, status=2).stderr


def test_predict_writes_maxwell_arms_where_asked(bushfit: Run, root: Path, tmp_path: Path) -> None:
    folder = tmp_path / "x"
    done = bushfit("predict", root / ARM, "--arms", "0.5 %", "-o", folder, "--json")
    (part,) = json.loads(done.stdout)["arms"]
    assert part["in_place_of"] == "springpot"
    assert part["largest_relative_error"] <= 0.005
    assert f"{len(part['relaxation_time_s'])} Maxwell arms in place of the springpot: off by at most" in done.stderr
    table = pd.read_csv(folder / "arms.csv")
    assert table["in place of"].tolist() == ["elastic"] + ["springpot"] * len(part["relaxation_time_s"])
    assert table["relaxation time [s]"].tolist()[1:] == pytest.approx(part["relaxation_time_s"], rel=1e-6)
    ratio = table["radial stiffness [N/mm]"] / table["shear modulus [MPa]"]
    assert ratio.max() / ratio.min() - 1.0 < 1e-5
    assert (folder / "arms.png").read_bytes().startswith(b"\x89PNG")


def test_predict_takes_one_per_cent_for_arms_where_no_error_is_given(bushfit: Run, root: Path, tmp_path: Path) -> None:
    done = bushfit("predict", root / ARM, "-o", tmp_path / "x", "--json", "--no-plots", "--arms")
    assert 0.001 < json.loads(done.stdout)["arms"][0]["largest_relative_error"] <= 0.01
