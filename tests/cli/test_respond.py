"""respond: files that it writes, histories that it corrects or refuses, and how they are stated."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

N = 400
TIME = np.arange(N) / 200.0
MOTION = 0.2 * np.sin(2.0 * np.pi * 5.0 * TIME)


def write(folder: Path, name: str = "road.csv", **columns: np.ndarray) -> str:
    """Write a history; the keys are headers with a blank for `_` and a bracket for `__`."""
    headers = {key.replace("__", " [").replace("_", " ") + ("]" if "__" in key else ""): key for key in columns}
    pd.DataFrame({header: columns[key] for header, key in headers.items()}).to_csv(folder / name, index=False)
    return str(folder / name)


def test_each_direction_has_displacement_force_and_band(bushfit, tmp_path):
    road = write(
        tmp_path, time__s=TIME, axial_displacement__mm=MOTION, torsion__deg=MOTION, radial_travel__um=50 * MOTION
    )
    done = bushfit("respond", "model", road, "-o", tmp_path / "out", "--json")
    assert "resampled" not in done.stderr + done.stdout, "the times are even"
    table = pd.read_csv(tmp_path / "out/response.csv")
    np.testing.assert_allclose(table["time [s]"], TIME, atol=1e-6)
    np.testing.assert_allclose(table["axial displacement [mm]"], MOTION, atol=1e-5)
    np.testing.assert_allclose(table["radial displacement [mm]"], 0.05 * MOTION, atol=1e-6)
    force = table["axial force [N]"]
    assert np.all(table["axial force [N], low"] <= force)
    assert np.all(force <= table["axial force [N], high"])
    assert (tmp_path / "out/response.png").stat().st_size > 10_000
    figures = json.loads(done.stdout)["directions"]
    assert list(figures) == ["axial", "radial", "torsion"]
    assert figures["axial"]["peak_force"] == pytest.approx(force.abs().max(), rel=1e-5)
    assert figures["axial"]["rms_force"] == pytest.approx(np.sqrt(np.mean(force**2)), rel=1e-5)
    assert figures["axial"]["energy_per_second"] == pytest.approx(
        np.trapezoid(force, 1e-3 * MOTION) / (TIME[-1] + 0.005), rel=1e-3
    )
    assert figures["axial"]["share_of_time_above_tested_strain"] == 0.0


def test_one_column_takes_its_direction_from_an_option(bushfit, tmp_path):
    road = write(tmp_path, t__s=TIME, Sy=MOTION)
    stated = ("--column", "displacement=Sy", "--unit", "displacement=mm", "--direction", "axial")
    bushfit("respond", "model", road, *stated, "-o", tmp_path / "a", "--no-plots")
    bushfit("respond", "model", road, "--column", "axial=Sy", "--unit", "axial=mm", "-o", tmp_path / "b", "--no-plots")
    tables = [(tmp_path / name / "response.csv").read_text() for name in "ab"]
    assert tables[0] == tables[1]
    assert tables[0].startswith('time [s],displacement [mm],force [N],"force [N], low"')


@pytest.mark.parametrize(
    ("time", "motion", "options", "warning"),
    [
        (np.delete(TIME, slice(100, 110)), np.delete(MOTION, slice(100, 110)), (), "10 rows are missing"),
        (np.delete(TIME, 100), np.delete(MOTION, 100), (), "1 row is missing"),
        (TIME + 0.002 * np.sin(20.0 * TIME), MOTION, (), "resampled evenly at"),
        (TIME, MOTION + 1000.0, (), "1000 mm, the first value, is subtracted"),
        (TIME, MOTION + 1000.0, ("--steady",), "1000 mm, the mean, is subtracted"),
        (TIME, MOTION + 2.0, (), "the history begins at 2 mm, but the model starts"),
        (TIME, 10.0 * MOTION, (), "but fitted at"),
        (TIME, MOTION, ("--lowpass", "60 Hz"), "low-passed at 60 Hz without delay, which removes"),
    ],
)
def test_corrections_are_stated(bushfit, tmp_path, time, motion, options, warning):
    road = write(tmp_path, time__s=time, axial_displacement__mm=motion)
    done = bushfit("respond", "model", road, *options, "-o", tmp_path / "out", "--no-plots", "-v")
    assert warning in done.stderr
    table = pd.read_csv(tmp_path / "out/response.csv")
    assert len(table) == N
    assert np.ptp(np.diff(table["time [s]"])) < 2e-6
    if abs(motion).max() > 100.0:
        np.testing.assert_allclose(table["displacement [mm]"], MOTION, atol=1e-3)


@pytest.mark.parametrize(
    ("columns", "options", "problem"),
    [
        ({"time__s": TIME[::-1], "axial_displacement__mm": MOTION}, (), "time does not increase"),
        ({"time__s": TIME, "axial_displacement": MOTION}, (), "the axial has no unit"),
        ({"time__s": TIME, "axial_displacement__kg": MOTION}, (), "kg"),
        ({"time__s": TIME, "displacement__mm": MOTION}, (), "the direction of this displacement is not stated"),
        ({"time__s": TIME, "axial_displacement__mm": MOTION}, ("--direction", "radial"), "no column for the disp"),
        ({"time__s": TIME, "axial_displacement__mm": MOTION}, ("--lowpass", "100 Hz"), "does not suit the history"),
        ({"time__s": TIME, "axial_displacement__mm": MOTION}, ("--lowpass", "1e-6 Hz"), "one cycle in the history"),
        ({"time__s": TIME, "axial_displacement__mm": 0.0 * MOTION}, (), "this is not a motion"),
        ({"axial_displacement__mm": MOTION, "radial_displacement__mm": MOTION}, (), "no column for the time"),
        ({"time__s": TIME, "axial_displacement__mm": TIME}, ("--steady",), "a steady state needs whole cycles"),
        ({"time__s": np.append(TIME[:-1], 100.0), "axial_displacement__mm": MOTION}, (), "too uneven"),
    ],
)
def test_what_cannot_be_used_is_one_error(bushfit, tmp_path, columns, options, problem):
    road = write(tmp_path, **columns)
    done = bushfit("respond", "model", road, *options, "-o", tmp_path / "out", status=2)
    assert problem in done.stderr
    assert not (tmp_path / "out").exists()


def test_a_channel_that_never_moves_is_left_out(bushfit, tmp_path):
    still = {"radial_displacement__mm": 0.0 * TIME + 3.0}
    road = write(tmp_path, time__s=TIME, axial_displacement__mm=MOTION, **still)
    done = bushfit("respond", "model", road, "-o", tmp_path / "out", "--no-plots", "-v")
    assert "radial: left out, because the displacement is constant" in done.stderr
    assert list(pd.read_csv(tmp_path / "out/response.csv"))[1] == "displacement [mm]"


def test_a_batch_responds_for_each_part(bushfit, work, tmp_path):
    write(tmp_path, time__s=TIME, axial_displacement__mm=MOTION)
    model, campaign = work / "model/model.json", work / "configs/cmp_15961.toml"
    settings = f"commands = ['respond']\nmodel = '{model}'\n"
    manifest = tmp_path / "batch.toml"
    manifest.write_text(f"{settings}history = 'road.csv'\nlowpass = '40 Hz'\n[[bushings]]\ncampaign = '{campaign}'\n")
    bushfit("batch", manifest, "-o", tmp_path / "batch", "--jobs", 1)
    bushfit("respond", model, tmp_path / "road.csv", "--lowpass", "40 Hz", "-o", tmp_path / "single", "--no-plots")
    written = (tmp_path / "batch/bushings/cmp_15961/response.csv").read_text()
    assert written == (tmp_path / "single/response.csv").read_text()
    row = json.loads((tmp_path / "batch/bushings/cmp_15961/row.json").read_text())
    assert any("low-passed at 40 Hz" in warning for warning in row["warnings"])
    manifest.write_text(f"{settings}[[bushings]]\ncampaign = '{campaign}'\n")
    done = bushfit("batch", manifest, "-o", tmp_path / "none", status=2)
    assert "respond has no displacement history" in done.stderr
