"""simulate and reduce as typed: a campaign that the fits take, and what a laboratory records made into one."""

import json
import shutil

import pandas as pd
import pytest
from shell import BUSHING, GEOMETRY, document, names, values

from bushfit.geometry import Direction
from bushfit.reading.stated import SweepFile
from bushfit.reading.sweeps import read_sweep

RECORD = "data/cmp_15961_raw/stepped_sine_axial.csv"


def test_simulate_writes_a_campaign_that_run_takes(bushfit, tmp_path):
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


def test_a_raw_record_becomes_a_sweep_that_fits(typed, root, tmp_path, paper_model, table_1):
    done = typed("reduce", root / RECORD, "-o", "x", "--json", "--cycles", "4")
    assert names(tmp_path / "x") == {"sweep.csv", "reduce.png"}
    assert "15 points found" in done.stderr
    assert "10-155 605.5-693.3 0.106-0.141 0.06 0.93" in " ".join(done.stderr.split()), "noise, distortion in per cent"
    document, table = json.loads(done.stdout), pd.read_csv(tmp_path / "x/sweep.csv")
    assert document["direction"] == "axial"
    assert list(table) == list(document["points"])
    assert list(table)[:3] == ["frequency [Hz]", "amplitude [mm]", "amplitude reached [mm]"]
    assert (table["force distortion [-]"] > 0.005).all()
    assert (table["cycles used"] >= 4).all()
    sweep = read_sweep(tmp_path / "x/sweep.csv", Direction.AXIAL, SweepFile(file="sweep.csv"))
    off = sweep.stiffness / paper_model.stiffness(Direction.AXIAL, sweep.frequency, sweep.amplitude_reached) - 1.0
    assert abs(off).max() < 3e-3
    assert len(set(sweep.amplitude)) == 3

    shutil.copy(root / "data/cmp_15961/loop_axial_1.csv", tmp_path / "x")
    shutil.copy(tmp_path / "x/sweep.csv", tmp_path / "unnamed.csv")  # the table states the direction, not the name
    typed("init", "unnamed.csv", "-o", "unnamed.toml", *GEOMETRY)
    assert 'direction = "axial"' in (tmp_path / "unnamed.toml").read_text(encoding="utf-8")
    snippet = "[[sweeps]]" + done.stderr.partition("[[sweeps]]")[2]
    loop = '[[loops]]\nfile = "loop_axial_1.csv"\ndirection = "axial"\n'
    (tmp_path / "x/campaign.toml").write_text(BUSHING + loop + snippet, encoding="utf-8")
    fitted = typed("fit", "x/campaign.toml", "-o", "fit", "--no-plots", "--json")
    for name, entry in json.loads(fitted.stdout)["parameters"].items():
        off = entry["value"] / table_1[name] - 1.0
        assert abs(off) < 0.03
        assert abs(off) * table_1[name] < 3.0 * entry["stderr"]
