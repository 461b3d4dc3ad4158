"""run as typed: the whole chain; and with diagnose one model, what the tests leave unknown, what is equal as a set."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import Done
from shell import CAMPAIGN, Run, document, names, typing
from virtual_rig import LOOP, MOUNT, SWEEPS, rig

from bushfit.cli.run import two_step_line
from bushfit.fitting.procedures import TwoStep
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result

#: Files that run and diagnose write alike.
FILES = ("diagnosis.json", "gap.csv", "candidates.csv")
UNKNOWN = "the tests leave mu, m, alpha open (unknown by 100 % or more)"


def test_run_does_the_whole_chain_and_says_what_two_steps_cost(bushfit: Run, tmp_path: Path) -> None:
    done = bushfit("run", CAMPAIGN, "-o", tmp_path / "x", "-v")
    tables = {f"{kind}.{end}" for kind in ("loops", "sweeps", "axial", "radial") for end in ("csv", "png")}
    assert {"static.json", "dynamic.json", "model.json"} | tables <= names(tmp_path / "x")
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
    done = bushfit("run", CAMPAIGN, "-o", tmp_path / "x", "--no-plots")
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

    def fitted(share: float, value: float, **more: object) -> Result:
        covariance = Covariance(("mu",), np.array([[(share * mu) ** 2]]))
        return Result(paper_model.with_values({"mu": value}), ("mu",), covariance, **more)  # type: ignore[arg-type]

    two_step = TwoStep(({},), fitted(error, (1.0 + off) * mu, at_bound=bound))
    assert said in two_step_line(two_step, fitted(0.01, mu))


def test_run_with_an_effect_shows_what_diagnose_shows(root: Path, tmp_path: Path) -> None:
    done = typing(root)("run", "configs/mystery_mount.toml", "-o", tmp_path / "x", "--no-plots")
    for words in ("Mystery mount: named", "sleeve_compliance (", "  held out  ", " x noise: measured r", "next test:"):
        assert done.stderr.count(words) == 1
    assert "model with what was added" in done.stderr
    assert "was not fitted, and the model misses it" not in done.stderr, "of the joint fit, which is not the one to use"
    assert f"{tmp_path / 'x/model.json'}, with sleeve_compliance; joint.json is without" in done.stderr


def both(bushfit: Run, campaign: str, folder: Path) -> tuple[Done, Done]:
    """The campaign run and diagnosed, and each file that both write the same in both."""
    ran = bushfit("run", campaign, "-o", folder / "run", "--no-plots")
    told = bushfit("diagnose", campaign, "-o", folder / "diagnose", "--no-plots")
    one, other = (document(folder / command / "model.json") for command in ("run", "diagnose"))
    said = [model["campaign"].pop("command") for model in (one, other)]
    assert said == [f"bushfit {command} {Path(campaign).name}" for command in ("run", "diagnose")]
    assert one == other
    for name in FILES:
        assert (folder / "run" / name).read_bytes() == (folder / "diagnose" / name).read_bytes()
    return ran, told


def test_run_and_diagnose_write_the_model_that_fit_writes_where_nothing_is_missing(
    bushfit: Run, work: Path, tmp_path: Path
) -> None:
    both(bushfit, CAMPAIGN, tmp_path)
    fitted, diagnosed = document(work / "model/model.json"), document(tmp_path / "diagnose/model.json")
    assert {**fitted, "campaign": None} == {**diagnosed, "campaign": None}
    assert document(tmp_path / "run/diagnosis.json")["usable"]["places"] == fitted["fit"]["usable"]


def test_where_a_model_cannot_be_the_same_the_file_says_which_it_is(bushfit: Run, tmp_path: Path) -> None:
    bushfit("diagnose", CAMPAIGN, "--adopt", "inertia", "-o", tmp_path / "x", "--no-plots")
    model = document(tmp_path / "x/model.json")
    assert "inertia" in model["effects"]
    assert model["campaign"]["command"] == "bushfit diagnose cmp_15961.toml --adopt inertia"


def test_an_effect_that_is_fitted_beside_held_parameters_is_diagnosed_by_both(own: Path, tmp_path: Path) -> None:
    values = {"mu": "1.09 MPa", "m": "0.2 MPa*s^alpha", "alpha": 0.24, "sigma_fmax": "14.6 kPa", "eps_half": 0.013}
    with (own / CAMPAIGN).open("a", encoding="utf-8") as campaign:
        campaign.write('\n[fit]\neffects = ["inertia"]\n')
        for key, value in values.items():
            campaign.write(f"\n[fit.{key}]\nvalue = {json.dumps(value)}\nvary = false\n")
    both(typing(own), CAMPAIGN, tmp_path)


def test_one_loop_alone_is_fitted_and_what_it_leaves_open_is_said_first(own: Path, tmp_path: Path) -> None:
    text = (own / CAMPAIGN).read_text(encoding="utf-8")
    (own / CAMPAIGN).write_text(text[: text.index("[[sweeps]]")], encoding="utf-8")
    ran, told = both(typing(own), CAMPAIGN, tmp_path)
    for done in (ran, told):
        assert done.stderr.startswith(f"CMP 15 961: consistent; {UNKNOWN}\n")
    assert "no sweeps: the two-step procedure is passed over" in ran.stderr
    assert "one loop rate, 0.1 Hz: mu, m and alpha cannot be told from one another" in ran.stderr
    assert "the further test that would help most: a loop at" in ran.stderr
    assert document(tmp_path / "run/model.json")["warnings"][0] == UNKNOWN
    fitted = typing(own)("fit", CAMPAIGN, "-o", tmp_path / "fit", "--no-plots", "--json")
    assert fitted.stderr.startswith(f"CMP 15 961: {UNKNOWN}\n")
    assert json.loads(fitted.stdout)["warnings"][0] == UNKNOWN


@pytest.mark.parametrize(
    ("directions", "hidden", "sets"),
    [
        (("axial", "radial"), "rig_compliance.radial=2e-8", ["sleeve_compliance", "sleeve_compliance.radial"]),
        *(
            pytest.param(*more, marks=pytest.mark.slow)
            for more in (
                (("axial", "radial", "torsion"), "rig_compliance.radial=3e-8", ["sleeve_compliance.radial"]),
                (("axial",), "rig_compliance.compliance=6e-7", ["sleeve_compliance", "sleeve_compliance.axial"]),
            )
        ),
    ],
)
def test_what_gives_way_in_one_direction_or_in_all_is_a_set_where_it_is_equal(
    typed: Run, tmp_path: Path, directions: tuple[str, ...], hidden: str, sets: list[str]
) -> None:
    """Axially the bushing is so soft that a give of the rig passes for mu; torsion, which does not give way, tells."""
    tests = [LOOP.format("axial", "0.5 mm", "0.1 Hz")] if directions == ("axial",) else []
    tests += [SWEEPS[place] for place in directions]
    (tmp_path / "rig.toml").write_text("".join([MOUNT, rig("0.1 %"), *tests]), encoding="utf-8")
    typed("simulate", "rig.toml", "--effect", f"{hidden} m/N", "-o", "tests", "--no-plots")
    found = json.loads(typed("diagnose", "tests/campaign.toml", "-o", "found", "--no-plots", "--json").stdout)
    (leader,) = found["effects"]
    named = [leader["name"], *leader["alternatives"]]  # of equals either may lead
    assert sorted(named) == sorted(sets)
    assert found["verdict"] == ("ambiguous" if leader["alternatives"] else "named")
    added = str(document(tmp_path / "found/model.json")["effects"])
    assert ("sleeve_compliance" in added) == (found["verdict"] == "named")
    if leader["alternatives"]:
        assert re.search(rf"bushfit plan tests/campaign.toml --rivals {','.join(named)} ", found["next_test"])
