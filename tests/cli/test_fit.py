"""fit-static, fit-dynamic and fit as typed: their files, and each taking what the one before wrote."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

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
