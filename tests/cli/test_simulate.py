"""simulate and reduce as typed: a campaign that the fits take, and what a laboratory records made into one."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from paper import BUSHING, PARAMETERS
from shell import GEOMETRY

from bushfit.geometry import Direction
from bushfit.reading.stated import SweepFile
from bushfit.reading.sweeps import read_sweep

RECORD = "data/cmp_15961_raw/stepped_sine_axial.csv"
MOTIONS = f"""{BUSHING}{PARAMETERS}
[simulate]
seed = 3
[[simulate.validation]]
direction = "axial"
motion = "random"
frequencies = ["2 Hz", "60 Hz"]
amplitudes = ["1 mm", "1 mm"]
rms = "0.05 mm"
duration = "3 s"
[[simulate.validation]]
direction = "axial"
motion = "sines"
frequencies = ["2 Hz", "50 Hz"]
amplitudes = ["0.2 mm", "0.05 mm"]
duration = "2 s"
[[simulate.validation]]
direction = "axial"
motion = "road"
frequencies = ["1 Hz", "40 Hz"]
rms = "0.1 mm"
duration = "4 s"
"""


def test_a_raw_record_becomes_a_sweep_that_fits(typed, root, tmp_path, paper_model, table_1):
    done = typed("reduce", root / RECORD, "-o", "x", "--json", "--cycles", "4")
    assert (pd.read_csv(tmp_path / "x/sweep.csv")["cycles used"] >= 4).all()
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


def test_simulated_motions_have_the_stated_spectra(typed, tmp_path):
    (tmp_path / "plan.toml").write_text(MOTIONS)
    typed("simulate", "plan.toml", "-o", "tests")
    random, sines, road = (pd.read_csv(tmp_path / f"tests/record_axial_{number}.csv") for number in (1, 2, 3))
    for table, rms, duration in ((random, 0.05, 3.0), (road, 0.1, 4.0)):
        assert table["displacement [mm]"].std() == pytest.approx(rms, rel=0.05)
        assert table["time [s]"].iloc[-1] == pytest.approx(duration, rel=0.01)
        assert table["displacement [mm]"].iloc[0] == 0.0
    settled = sines[sines["time [s]"] >= 1.0]
    step = sines["time [s]"][1]
    size = 2.0 * np.abs(np.fft.rfft(settled["displacement [mm]"][: round(1.0 / step)])) * step
    assert size[[2, 50]] == pytest.approx([0.2, 0.05], rel=0.01)
    for table, ratio in ((random, 1.0), (road, 3.0)):  # of the spectra from 5 to 10 and from 15 to 30 Hz
        spectrum = np.abs(np.fft.rfft(table["displacement [mm]"])) ** 2
        frequency = np.fft.rfftfreq(len(table), table["time [s]"][1])
        low, high = (spectrum[(frequency > end) & (frequency < 2.0 * end)].mean() for end in (5.0, 15.0))
        assert np.sqrt(low / high) == pytest.approx(ratio, rel=0.25)
