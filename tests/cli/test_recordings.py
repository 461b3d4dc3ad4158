"""Recordings of instruments: MATLAB, TDMS, UFF, MDF, Parquet and Arrow files give what the same rows give as CSV.

The files in tests/files/recordings hold the simulated tests of data/cmp_15961, written by the libraries of the formats.
"""

import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from commandline import typing
from paper import BUSHING
from scipy.io import savemat
from shell import GEOMETRY, document, refused, values

FILES = Path(__file__).parents[1] / "files" / "recordings"
#: The endings of the loop, the axial and the radial sweep of a campaign, so that each format has both kinds of test.
MIXED = [("tdms", "mat", "mf4"), ("uff", "parquet", "v73.mat"), ("mat", "tdms", "feather"), ("v73.mat", "mf4", "tdms")]
LOOP = pd.read_csv(Path(__file__).parents[2] / "data/cmp_15961/loop_axial_1.csv")


@pytest.mark.parametrize("endings", MIXED, ids="-".join)
def test_a_fit_of_recordings_is_the_fit_of_their_csv(own, work, endings):
    campaign = (own / "configs/cmp_15961.toml").read_text(encoding="utf-8")
    for name, ending in zip(("loop_axial_1", "sweep_axial", "sweep_radial"), endings, strict=True):
        shutil.copy(FILES / f"{name}.{ending}", own / "data/cmp_15961")
        campaign = campaign.replace(f"{name}.csv", f"{name}.{ending}")
    (own / "configs/recorded.toml").write_text(campaign, encoding="utf-8")
    fitted = values(typing(own)("fit", "configs/recorded.toml", "-o", "x", "--no-plots", "--json"))
    of_csv = document(work / "model/model.json")["parameters"]
    assert fitted == pytest.approx({name: entry["value"] for name, entry in of_csv.items()}, rel=1e-9)


@pytest.mark.parametrize("units", ["newton_per_mm", "kilonewton_per_m", "units_of_dataset_164", "at_nodes"])
def test_frequency_responses_of_uff_are_sweeps(own, units):
    """Of force over displacement, one at each amplitude, units in labels or of dataset 164, or at nodes."""
    for amplitude, rows in pd.read_csv(own / "data/cmp_15961/sweep_axial.csv").groupby("amplitude [mm]"):
        first = rows[rows["repeat"] == 1].drop(columns=["repeat", "amplitude [mm]"])
        first.to_csv(own / f"axial {amplitude} mm.csv", index=False)
    run, fitted = typing(own), []
    for name, files in (("uff", [FILES / f"frf_{units}.uff"]), ("csv", sorted(own.glob("*.csv")))):
        run("init", *files, *GEOMETRY, "-o", name)
        fitted.append(values(run("fit", f"{name}/campaign.toml", "-o", f"{name}/x", "--no-plots", "--json")))
    assert fitted[0] == pytest.approx(fitted[1], rel=1e-3 if units == "at_nodes" else 1e-6), "dataset 55: six digits"


#: Files that cannot be used, and what their error says.
SPOILED: dict[str, tuple[str, ...]] = {
    "two_rates.mf4": ("no group holds such a table", '"at 100 Hz", "at 20 Hz"', "resample"),
    "force_without_unit.tdms": ('group "Run 1", column "force": the force has no unit', 'units = { force = "N" }'),
    "force_in_mm.parquet": ('column "force": the unit does not fit', '"mm"'),
    "gap_in_row_17.feather": ('row 17, column "displacement"', "not a finite number"),
    "scalars.mat": ("holds no channels", "table2struct"),
    "modes.unv": ("dataset 58",),
    "bomb.mat": ("cannot be read", "the file unpacks to 1099511627776 values"),
    "empty.mf4": ("the file is empty",),
    **{
        f"cut: {name}": ("file cannot be read", "incomplete")
        for name in (
            *(f"loop_axial_1.{ending}" for ending in ("mat", "v73.mat", "tdms", "uff")),
            *("sweep_axial.mf4", "sweep_axial.parquet", "sweep_radial.feather"),
        )
    },
}


@pytest.mark.parametrize("case", SPOILED)
def test_what_cannot_be_read_is_one_clear_error(typed, tmp_path, case):
    name = case.removeprefix("cut: ")
    content = (FILES / name).read_bytes() if (FILES / name).exists() else b""
    (tmp_path / name).write_bytes(content[: len(content) * 3 // 5] if case.startswith("cut") else content)
    (tmp_path / "c.toml").write_text(f'{BUSHING}\n[[loops]]\nfile = "{name}"\ndirection = "axial"\n')
    for line in (("run", "c.toml"), ("inspect", name), ("init", name, "--direction", "axial", *GEOMETRY)):
        done = typed(*line, "-o", "x", status=2)
        refused(done, tmp_path / "x", *SPOILED[case])
        assert done.stderr.startswith("bushfit: error: ")


@pytest.mark.parametrize(
    ("name", "package"),
    [
        ("loop_axial_1.tdms", "nptdms"), ("sweep_axial.mf4", "asammdf"), ("loop_axial_1.uff", "pyuff"),
        ("loop_axial_1.v73.mat", "h5py"), ("sweep_axial.parquet", "pyarrow"),
    ],
)  # fmt: skip
def test_a_missing_library_is_named(typed, tmp_path, name, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    done = typed("inspect", FILES / name, "-o", "x", status=2)
    refused(done, tmp_path / "x", f"no package {package}", 'pip install "bushfit[instruments]"')


def test_what_a_file_does_not_tell_is_stated_as_of_csv(typed, tmp_path):
    """A matrix has neither names nor units; one group of two is chosen as a sheet is."""
    slow = {"oil": np.arange(40.0)}
    savemat(tmp_path / "axial.mat", {"log": LOOP.to_numpy(), "oil": slow})
    columns = {"time": "log(:,1)", "displacement": "log(:,2)", "force": "log(:,3)"}
    stated = [f"--column={role}={name}" for role, name in columns.items()]
    stated += ["--unit=time=s", "--unit=displacement=mm", "--unit=force=N"]
    done = typed("init", "axial.mat", *stated, *GEOMETRY, "-o", "x")
    assert "left out: axial.mat, group oil: " in done.text
    assert 'sheet = "top level"' in (tmp_path / "x/campaign.toml").read_text(encoding="utf-8")
    assert "mu" in values(typed("fit-static", "x/campaign.toml", "-o", "y", "--no-plots", "--json"))
    (tmp_path / "axial.mat").rename(tmp_path / "test.mat")
    assert (
        'test.mat, group "top level": the direction of this test is not stated'
        in typed("init", "test.mat", *stated, *GEOMETRY, status=2).stderr
    )
