"""Validation records: simulated, never fitted, compared by run, diagnose and report."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import typing
from shell import BUSHING

SIMULATED = f"""{BUSHING}
[simulate]
seed = 3
repeats = 3
noise = "0.3 %"
force_noise = "0.2 %"
effects.inertia.mass = "0.2 kg"
loops = [{{ direction = "axial", amplitude = "1 mm", frequency = "0.1 Hz" }}]
validation = [
  {{ direction = "axial", motion = "random", frequencies = ["2 Hz", "60 Hz"], amplitudes = ["1 mm", "1 mm"], \
rms = "0.05 mm", duration = "3 s" }},
  {{ direction = "axial", motion = "sines", frequencies = ["2 Hz", "50 Hz"], amplitudes = ["0.2 mm", "0.05 mm"], \
duration = "2 s" }},
  {{ direction = "axial", motion = "road", frequencies = ["1 Hz", "40 Hz"], rms = "0.1 mm", duration = "4 s" }},
]
[[simulate.sweeps]]
direction = "axial"
amplitudes = ["0.1 mm", "0.2 mm", "0.5 mm"]
frequencies = {{ start = "5 Hz", stop = "155 Hz", step = "10 Hz" }}

[simulate.parameters]
mu = "1.09 MPa"
m = "0.2 MPa*s^alpha"
alpha = 0.24
sigma_fmax = "14.6 kPa"
eps_half = 0.013
"""


@pytest.fixture(scope="module")
def campaign(tmp_path_factory) -> Path:
    """A simulated campaign with three validation records and a hidden mass."""
    folder = tmp_path_factory.mktemp("validation")
    (folder / "plan.toml").write_text(SIMULATED)
    typing(folder)("simulate", "plan.toml", "-o", "tests")
    return folder / "tests/campaign.toml"


def test_simulated_motions_have_the_stated_spectra(campaign):
    random, sines, road = (pd.read_csv(campaign.parent / f"record_axial_{number}.csv") for number in (1, 2, 3))
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


def test_a_low_pass_and_corrections_of_a_record_are_stated(campaign, bushfit, tmp_path):
    """Noise of the displacement, its offset of a metre, and missing rows."""
    for file in campaign.parent.glob("*.*"):
        (tmp_path / file.name).write_bytes(file.read_bytes())
    record = tmp_path / "record_axial_1.csv"
    table = pd.read_csv(record)
    noise = 0.0005 * np.random.default_rng(1).standard_normal(len(table))
    table["displacement [mm]"] += 1000.0 + noise - noise[0]
    table.drop(index=range(200, 220)).to_csv(record, index=False)
    plan = tmp_path / "campaign.toml"
    entry = f'file = "{record.name}"\n'
    errors = []
    for name, key in (("plain", ""), ("smooth", 'lowpass = "150 Hz"\n')):
        changed = tmp_path / f"{name}.toml"
        changed.write_text(plan.read_text().replace(entry, entry + key, 1))
        done = bushfit("diagnose", changed, "-o", tmp_path / name, "--no-plots", "--max-effects", 0, "-v")
        assert "record_axial_1: 20 rows are missing" in done.stderr
        assert "1000 mm, the first value, is subtracted" in done.stderr
        assert ("low-passed at 150 Hz without delay, which removes" in done.stderr) == bool(key)
        written = pd.read_csv(tmp_path / name / "validation_record_axial_1.csv")
        assert abs(written["displacement [mm]"]).max() < 1.0
        errors.append(written["force [N]"] - written["measured force [N]"])
    assert errors[0].std() > 1.001 * errors[1].std()
    changed.write_text(plan.read_text().replace(entry, entry + 'lowpass = "1 MHz"\n', 1))
    done = bushfit("diagnose", changed, "-o", tmp_path / "none", status=2)
    assert "record_axial_1.csv" in done.stderr
    assert "the low-pass does not suit the history" in done.stderr


@pytest.mark.parametrize(
    ("old", "new", "problem"),
    [
        ('rms = "0.05 mm", ', "", "these keys do not describe a motion"),
        ('["2 Hz", "60 Hz"]', '["60 Hz", "2 Hz"]', "this is not a frequency band"),
        ('duration = "3 s"', 'duration = "3000 s"', "too long to simulate"),
    ],
)
def test_impossible_records_are_one_error(bushfit, tmp_path, old, new, problem):
    (tmp_path / "plan.toml").write_text(SIMULATED.replace(old, new, 1))
    assert problem in bushfit("simulate", tmp_path / "plan.toml", "-o", tmp_path / "out", status=2).stderr
