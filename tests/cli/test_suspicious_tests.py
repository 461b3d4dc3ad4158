"""Copies of data, which count once, and units that are wrong by a power of 1000: the test to mend is named."""

from pathlib import Path

import pandas as pd
import pytest
from shell import CAMPAIGN

from bushfit.model.file import load_result

LOOP = "data/cmp_15961/loop_axial_1.csv"
SWEEP = "data/cmp_15961/sweep_axial.csv"


@pytest.fixture
def once(bushfit, own) -> Path:
    """A campaign in which repeat 1 of the axial sweep is the only one."""
    sweep = pd.read_csv(own / SWEEP)
    sweep[sweep["repeat"] == 1].to_csv(own / SWEEP, index=False)
    return own / CAMPAIGN


@pytest.mark.parametrize("command", ["fit", "diagnose"])
def test_copies_count_once(bushfit, own, once, command):
    bushfit(command, once, "-o", own / "once", "--no-plots")
    sweep, text = pd.read_csv(own / SWEEP), once.read_text(encoding="utf-8")
    repeats = [sweep.assign(repeat=number) for number in (1, 2, 3)]
    pd.concat(repeats).to_csv(own / SWEEP, index=False)
    (own / LOOP).with_name("again.csv").write_bytes((own / LOOP).read_bytes())
    (own / LOOP).with_name("linked.csv").symlink_to(own / LOOP)
    for name in ("again", "linked"):
        text += f'\n[[loops]]\nfile = "../data/cmp_15961/{name}.csv"\ndirection = "axial"\n'
    part = sweep[sweep["amplitude [mm]"] == sweep["amplitude [mm]"].min()]
    part.to_csv((own / SWEEP).with_name("level.csv"), index=False)
    text += '\n[[sweeps]]\nfile = "../data/cmp_15961/level.csv"\ndirection = "axial"\n'
    once.write_text(text, encoding="utf-8")
    done = bushfit(command, once, "-o", own / "copied", "--no-plots")
    assert "loop_axial_1: again.csv and linked.csv with the same data: used once" in done.stderr
    assert f"{2 * len(sweep)} points of repeats 2 and 3 are exact copies of an earlier repeat" in done.stderr
    looked = bushfit("inspect", own / LOOP, (own / LOOP).with_name("again.csv"), "--no-plots", "-o", own / "i").stderr
    assert looked.count("the same data are in") == 2
    (own / SWEEP).with_name("axial_again.csv").write_bytes((own / SWEEP).read_bytes())
    looked = bushfit("inspect", own / SWEEP, (own / SWEEP).with_name("axial_again.csv"), "--no-plots", "-o", own / "s")
    assert looked.text.count("the same data are in") == 2
    single, copied = (load_result(own / folder / "model.json") for folder in ("once", "copied"))
    assert vars(copied.model)["values"] == vars(single.model)["values"]
    assert copied.covariance.stderr("m") == single.covariance.stderr("m")
