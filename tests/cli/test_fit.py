"""fit-static, fit-dynamic and fit as typed: their files, and each taking what the one before wrote."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from commandline import Done

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
    for word in ("parameter", "std error", "95 % interval", "unit", "NRMSE", "correlation"):
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
