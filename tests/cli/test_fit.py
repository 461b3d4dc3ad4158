"""fit-static, fit-dynamic, fit and run as typed: files, warnings, parameters that are held, and equals as a set."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import Done, Run, typing
from shell import CAMPAIGN, document, values
from virtual_rig import LOOP, MOUNT, SWEEPS, rig

SWEEP = "data/cmp_15961/sweep_axial.csv"
#: Files that run and diagnose write alike.
ALIKE = ("diagnosis.json", "gap.csv", "candidates.csv")


def test_the_dynamic_fit_takes_the_smallest_amplitude_of_all_sweeps(own):
    """Which is in the second of two files."""
    table = pd.read_csv(own / SWEEP)
    small = table["amplitude [mm]"] < 0.3
    table[~small].to_csv(own / SWEEP, index=False)
    table[small].to_csv(own / "configs/small.csv", index=False)
    with (own / CAMPAIGN).open("a", encoding="utf-8") as campaign:
        campaign.write('\n[[sweeps]]\nfile = "small.csv"\ndirection = "axial"\n')
    typing(own)("fit-dynamic", CAMPAIGN, "-o", "x", "--no-plots")
    fitted = [test for test in document(own / "x/dynamic.json")["fit"]["tests"] if test["fitted"]]
    assert [(test["test"], test["points"]) for test in fitted] == [("small", 48)]


def test_a_bar_in_tension_and_a_coupon_in_shear_of_one_rubber_have_one_fit(typed, tmp_path):
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
        typed("init", f"{symbol}.csv", "-o", f"{symbol}.toml")
        fitted[symbol] = values(typed("fit", f"{symbol}.toml", "-o", symbol, "--no-plots", "--json"))
    assert fitted["E"] == pytest.approx(fitted["G"], rel=1e-3)


def both(bushfit: Run, campaign: str, folder: Path) -> tuple[Done, Done]:
    """The campaign run and diagnosed, and each file that both write the same in both."""
    ran = bushfit("run", campaign, "-o", folder / "run", "--no-plots")
    told = bushfit("diagnose", campaign, "-o", folder / "diagnose", "--no-plots")
    one, other = (document(folder / command / "model.json") for command in ("run", "diagnose"))
    said = [model["campaign"].pop("command") for model in (one, other)]
    assert said == [f"bushfit {command} {Path(campaign).name}" for command in ("run", "diagnose")]
    assert one == other
    for name in ALIKE:
        assert (folder / "run" / name).read_bytes() == (folder / "diagnose" / name).read_bytes()
    return ran, told


def test_run_and_diagnose_write_the_model_that_fit_writes_where_nothing_is_missing(bushfit, work, tmp_path):
    ran, _ = both(bushfit, CAMPAIGN, tmp_path)
    for word in ("static and dynamic fit in turn", "springpot was left out", "held out"):
        assert word not in ran.text
    fitted, diagnosed = document(work / "model/model.json"), document(tmp_path / "diagnose/model.json")
    assert {**fitted, "campaign": None} == {**diagnosed, "campaign": None}
    assert document(tmp_path / "run/diagnosis.json")["usable"]["places"] == fitted["fit"]["usable"]


def test_a_preload_without_influence_is_not_determined(own, tmp_path):
    """The effect is asked for, but the last of three repeats, at another preload, is like those before it."""
    table = pd.read_csv(own / SWEEP)
    table[table["repeat"] == 3].to_csv((own / SWEEP).with_name("loaded.csv"), index=False)
    table[table["repeat"] < 3].to_csv(own / SWEEP, index=False)
    text = (own / CAMPAIGN).read_text(encoding="utf-8").partition("[[loops]]")[0]
    for file, preload in ((SWEEP, "0 N"), (SWEEP.replace("sweep_axial", "loaded"), "500 N")):
        text += f'[[sweeps]]\nfile = "../{file}"\ndirection = "axial"\npreload = "{preload}"\n'
    (own / CAMPAIGN).write_text(f'{text}[fit]\neffects = ["preload"]\n', encoding="utf-8")
    unknown = "the tests do not determine preload (95 % interval of ±100 % or more)"
    for command in ("fit", "diagnose"):
        done = typing(own)(command, CAMPAIGN, "-o", tmp_path / command, "--no-plots")
        assert unknown in done.text.splitlines()[0]
        assert unknown in document(tmp_path / command / "model.json")["warnings"]


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
    typed, tmp_path, directions, hidden, sets
):
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
        typed("plan", "tests/campaign.toml", "--rivals", ",".join(named), "--hours", "1", "-o", "plan")
