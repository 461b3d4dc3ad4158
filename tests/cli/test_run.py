"""run as typed: the whole chain, and what a campaign of one loop leaves open."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import Done, call

from bushfit.cli.run import two_step_line
from bushfit.fitting.procedures import TwoStep
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result

Run = Callable[..., Done]
CAMPAIGN = "configs/cmp_15961.toml"


def test_run_does_the_whole_chain_and_says_what_two_steps_cost(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("run", CAMPAIGN, "-o", str(tmp_path / "x"), "-v")
    assert done.returncode == 0, done.stderr
    named = {file.name for file in (tmp_path / "x").glob("[!.]*")}
    tables = {f"{kind}.{end}" for kind in ("loops", "sweeps", "axial", "radial") for end in ("csv", "png")}
    assert {"static.json", "dynamic.json", "model.json"} | tables <= named
    assert "pass by pass" in done.stderr
    assert "what the two-step procedure costs" in done.stderr
    assert f"the model to use: {tmp_path / 'x/model.json'}, the joint fit" in done.stderr
    assert "springpot was left out" in done.stderr
    radial = pd.read_csv(tmp_path / "x" / "radial.csv")
    assert list(radial.columns[:2]) == ["frequency [Hz]", "amplitude [mm]"]
    assert len(radial) == 48
    ordered = radial.sort_values(["amplitude [mm]", "frequency [Hz]"], ignore_index=True)
    pd.testing.assert_frame_equal(radial, ordered)


def test_run_shows_the_result_first_and_the_steps_in_a_line(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("run", CAMPAIGN, "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    words = (
        *("CMP 15 961: consistent", "joint fit", "mu ", "NRMSE", "correlation: ", "tested range"),
        *("frequencies: 0.1 to 155 Hz", "strains: 0.62 to 6.2 %, which is axial 0.1 to 1 mm, radial "),
        *("directions: axial", "axial, corners", "radial, corners", "extrapolated beyond"),
        "two-step procedure (the paper's): 10 passes, agrees with the joint fit within 1 standard error",
        *("times less certain than there (static.json, dynamic.json; -v shows it)", "wrote static.json"),
        "the model to use: ",
    )
    places = [done.stderr.index(word) for word in words]
    assert places == sorted(places)
    for word in ("pass by pass", "what the two-step procedure costs", "springpot was left out", "held out"):
        assert word not in done.stderr


@pytest.mark.parametrize(
    ("error", "off", "bound", "said"),
    [
        (0.3, 0.0, {}, "agrees with the joint fit within 1 standard error, mu 30 times less certain than there ("),
        (1e8, 0.0, {}, "agrees with the joint fit within 1 standard error, mu not determined at all ("),
        (0.01, 0.98, {}, "does not agree with the joint fit: mu is farthest off ("),
        (1e8, 0.5, {"mu": "min"}, "1 pass, came to rest on a bound: mu ("),
    ],
)
def test_the_line_on_two_steps_counts_no_meaningless_errors(
    paper_model: Model, error: float, off: float, bound: dict[str, str], said: str
) -> None:
    mu = 1e6

    def fitted(share: float, values: dict[str, float], **more: object) -> Result:
        covariance = Covariance(("mu",), np.array([[(share * mu) ** 2]]))
        return Result(paper_model.with_values(values), ("mu",), covariance, **more)  # type: ignore[arg-type]

    two_step = TwoStep(({},), fitted(error, {"mu": (1.0 + off) * mu}, at_bound=bound))
    assert said in two_step_line(two_step, fitted(0.01, {"mu": mu}))


def test_run_with_an_effect_shows_what_diagnose_shows(root: Path, tmp_path: Path) -> None:
    done = call(root, "run", "configs/mystery_mount.toml", "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    for words in ("Mystery mount: named", "sleeve_compliance (", "  held out  ", " x noise: measured r", "next test:"):
        assert done.stderr.count(words) == 1
    assert "model with what was added" in done.stderr
    assert "was not fitted, and the model misses it" not in done.stderr, "of the joint fit, which is not the one to use"
    assert f"{tmp_path / 'x/model.json'}, with sleeve_compliance; joint.json is without" in done.stderr


def test_one_loop_alone_is_fitted_and_what_it_leaves_open_is_named(work: Path, tmp_path: Path) -> None:
    text = (work / CAMPAIGN).read_text()
    (work / "configs/loop.toml").write_text(text[: text.index("[[sweeps]]")])
    done = call(work, "run", "configs/loop.toml", "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    assert "no sweeps: the two-step procedure is passed over" in done.stderr
    assert "one loop rate, 0.1 Hz: mu, m and alpha cannot be told from one another" in done.stderr
    assert "the further test that would help most: a loop at" in done.stderr
