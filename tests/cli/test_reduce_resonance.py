"""`reduce` of resonance tests as typed: the files, the streams, and what has to be stated."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

MEASURED = "data/measured/epdm_70/shaker_1g_573g.csv"
STATED = ("--mass", "0.573 kg", "--mass-added", "14.8 g", "--direction", "axial")


def test_a_measured_test_becomes_a_sweep(typed: Callable, root: Path, tmp_path: Path) -> None:
    done = typed("reduce", root / MEASURED, *STATED, "-o", "x")
    assert done.returncode == 0, done.stderr
    assert done.stdout == ""
    assert {file.name for file in (tmp_path / "x").glob("[!.]*")} == {"sweep.csv", "reduce.png"}
    assert "100 points of 2000 rows; resonance at 230.5 Hz, |T| 8.03" in done.stderr
    table = pd.read_csv(tmp_path / "x/sweep.csv")
    assert list(table)[:5] == [
        "frequency [Hz]", "amplitude [mm]", "stiffness [N/mm]", "loss factor [-]", "relative error [-]",
    ]  # fmt: skip
    assert table["stiffness [N/mm]"].between(1200, 1600).all()
    assert (table["relative error [-]"] < 0.2).all()
    assert table["amplitude [mm]"].max() == pytest.approx(0.0396, rel=0.01)
    assert table["frequency [Hz]"].is_monotonic_increasing


def test_the_test_of_a_specimen(typed: Callable, root: Path, tmp_path: Path) -> None:
    """A mount that is no bushing goes by its name, and needs no direction."""
    stated = (*STATED[:-2], "--specimen", "the mount")
    done = typed("reduce", root / MEASURED, *stated, "-o", "x", "--no-plots", "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["specimen"] == "the mount"
    assert "direction" not in document
    assert 'specimen = "the mount"' in done.stderr


def test_json_and_a_line_a_point(typed: Callable, root: Path, tmp_path: Path) -> None:
    done = typed("reduce", root / MEASURED, *STATED, "-o", "x", "--no-plots", "--json", "-v")
    assert done.returncode == 0
    document = json.loads(done.stdout)
    assert document["mass_kg"] == pytest.approx(0.5878)
    assert document["resonance_Hz"] == pytest.approx(230.465)
    assert document["direction"] == "axial"
    assert list(document["points"]) == list(pd.read_csv(tmp_path / "x/sweep.csv"))
    lines = [line for line in done.stderr.splitlines() if line.split()[1:2] == ["1"]]
    assert len(lines) == 100


def test_other_words_for_the_same_test(typed: Callable, root: Path, tmp_path: Path) -> None:
    """As a transmissibility in a German file, with its base stated, and phases that count the other way."""
    raw = pd.read_csv(root / MEASURED)
    ratio = raw["mass_accel_ms2"] / raw["base_accel_ms2"]
    phase = np.degrees(raw["base_phase_rad"] - raw["mass_phase_rad"])
    table = pd.DataFrame(
        {"Frequenz [Hz]": raw["freq_hz"], "Transmissibilität [-]": ratio, "Phasenwinkel [Grad]": phase}
    )
    table.to_csv(tmp_path / "axial.csv", sep=";", decimal=",", index=False)
    assert typed("reduce", root / MEASURED, *STATED, "-o", "x", "--no-plots").returncode == 0
    done = typed("reduce", "axial.csv", "--mass", "0.5878 kg", "--base-acceleration", "1 g", "-o", "y", "--no-plots")
    assert done.returncode == 0, done.stderr
    assert "count the other way" in done.stderr
    one, other = (pd.read_csv(tmp_path / name / "sweep.csv") for name in ("x", "y"))
    assert np.allclose(one["stiffness [N/mm]"], other["stiffness [N/mm]"], rtol=1e-3)
    assert np.allclose(one["amplitude [mm]"], other["amplitude [mm]"], rtol=0.15)  # the shaker missed 1 g by as much
