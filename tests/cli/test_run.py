"""run as typed: the whole chain, and what a campaign of one loop leaves open."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pandas as pd
from commandline import Done, call

Run = Callable[..., Done]
CAMPAIGN = "configs/cmp_15961.toml"


def test_run_does_the_whole_chain_and_says_what_two_steps_cost(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("run", CAMPAIGN, "-o", str(tmp_path / "x"), "-v")
    assert done.returncode == 0, done.stderr
    named = {file.name for file in (tmp_path / "x").iterdir()}
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


def test_run_with_an_effect_shows_what_diagnose_shows(root: Path, tmp_path: Path) -> None:
    done = call(root, "run", "configs/mystery_mount.toml", "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    for words in ("Mystery mount: named", "rig_compliance (instrument)", "held out", "7.7 x noise:", "next test:"):
        assert done.stderr.count(words) == 1
    assert "model with what was added" in done.stderr
    assert "was not fitted, and the model misses it" not in done.stderr, "of the joint fit, which is not the one to use"
    assert f"{tmp_path / 'x/model.json'}, with rig_compliance; joint.json is without" in done.stderr


def test_one_loop_alone_is_fitted_and_what_it_leaves_open_is_named(work: Path, tmp_path: Path) -> None:
    text = (work / CAMPAIGN).read_text()
    (work / "configs/loop.toml").write_text(text[: text.index("[[sweeps]]")])
    done = call(work, "run", "configs/loop.toml", "-o", str(tmp_path / "x"), "--no-plots")
    assert done.returncode == 0, done.stderr
    assert "no sweeps: the two-step procedure is passed over" in done.stderr
    assert "one loop rate, 0.1 Hz: mu, m and alpha cannot be told from one another" in done.stderr
    assert "the further test that would help most: a loop at" in done.stderr
