"""Recordings of instruments: MATLAB, TDMS, UFF, MDF, Parquet and Arrow files give what the same rows give as CSV."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pandas as pd
import pytest
import pyuff
import recordings
from asammdf import MDF, Signal
from commandline import typing
from scipy.io import savemat
from shell import BUSHING, GEOMETRY, document, refused, values

#: The endings of the loop, the axial and the radial sweep of a campaign, so that each format has both kinds of test.
MIXED = [("tdms", "mat", "mf4"), ("uff", "parquet", "v73.mat"), ("mat", "tdms", "feather"), ("v73.mat", "mf4", "tdms")]
#: Units of dataset 164 as a program with millimetres writes them.
MILLIMETRES = {
    "type": 164, "units_code": 10, "units_description": "mm N", "temp_mode": 1,
    "length": 1000.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15,
}  # fmt: skip
LOOP = pd.read_csv(Path(__file__).parents[2] / "data/cmp_15961/loop_axial_1.csv")


@pytest.mark.parametrize("endings", MIXED, ids="-".join)
def test_a_fit_of_recordings_is_the_fit_of_their_csv(own, work, endings):
    """Of simulated tests of the paper's bushing, with noise."""
    campaign = (own / "configs/cmp_15961.toml").read_text(encoding="utf-8")
    for name, ending in zip(("loop_axial_1", "sweep_axial", "sweep_radial"), endings, strict=True):
        file = own / f"data/cmp_15961/{name}.csv"
        recordings.WRITERS[ending](pd.read_csv(file), file.with_suffix(f".{ending}"))
        campaign = campaign.replace(f"{name}.csv", f"{name}.{ending}")
    (own / "configs/recorded.toml").write_text(campaign, encoding="utf-8")
    fitted = values(typing(own)("fit", "configs/recorded.toml", "-o", "x", "--no-plots", "--json"))
    of_csv = document(work / "model/model.json")["parameters"]
    assert fitted == pytest.approx({name: entry["value"] for name, entry in of_csv.items()}, rel=1e-9)


@pytest.mark.parametrize(("force", "length"), [("N", "mm"), ("kN", "m"), ("NONE", "NONE"), ("nodes", "")])
def test_frequency_responses_of_uff_are_sweeps(own, force, length):
    """Of force over displacement, one at each amplitude, units in labels or of dataset 164, or at nodes."""
    sets: list[dict[str, Any]] = [MILLIMETRES]
    for amplitude, rows in pd.read_csv(own / "data/cmp_15961/sweep_axial.csv").groupby("amplitude [mm]"):
        first = rows[rows["repeat"] == 1].drop(columns=["repeat", "amplitude [mm]"])
        frequency, magnitude, loss = first.to_numpy(dtype=float).T
        first.to_csv(own / f"axial {amplitude} mm.csv", index=False)
        units, title = {"upper": ("force", force), "lower": ("displacement", length)}, f"axial {amplitude} mm"
        response = magnitude * np.exp(1j * np.arctan(loss))
        if force == "nodes":
            sets += recordings.at_nodes(response, frequency, title, "force", "displacement")
        else:
            sets.append(recordings.function(response, frequency, ("frequency", "Hz"), **units, id1=title))
    pyuff.UFF(str(own / "frf.uff")).write_sets(sets, mode="overwrite")
    one = own / "one.uff"  # a file of one group says by its title what one of several does
    pyuff.UFF(str(one)).write_sets([each for each in sets if each.get("id1") in (None, "axial 0.1 mm")], "overwrite")
    run, fitted = typing(own), []
    assert "from the name: amplitude 0.1 mm" in run("inspect", one, "-o", "one", "--no-plots").stderr
    for name, files in (("uff", ["frf.uff"]), ("csv", sorted(own.glob("*.csv")))):
        run("init", *files, *GEOMETRY, "-o", name)
        fitted.append(values(run("fit", f"{name}/campaign.toml", "-o", f"{name}/x", "--no-plots", "--json")))
    assert fitted[0] == pytest.approx(fitted[1], rel=1e-3 if force == "nodes" else 1e-6), "dataset 55 has six digits"


def of_two_rates(file: Path) -> None:
    with MDF(version="4.10") as book:
        for step, name, unit in ((1, "displacement", "mm"), (5, "force", "N")):
            signal = Signal(
                LOOP[f"{name} [{unit}]"][::step].to_numpy(), LOOP["time [s]"][::step].to_numpy(), unit, name
            )
            book.append([signal], acq_name=f"at {100 // step} Hz")
        book.save(file)


def cut(ending: str) -> Callable[[Path], None]:
    def write(file: Path) -> None:
        recordings.WRITERS[ending](LOOP, file)
        file.write_bytes(file.read_bytes()[: file.stat().st_size * 3 // 5])

    return write


def bomb(file: Path) -> None:
    """Some kilobytes of HDF5 that would fill every memory."""
    recordings.mat73(LOOP, file)
    with h5py.File(file, "a") as book:
        book.create_dataset("run1/x", (1, 1 << 40), "f8", chunks=(1, 1 << 20))


#: Files that cannot be used, and what their error says.
SPOILED: list[tuple[str, Callable[[Path], object], tuple[str, ...]]] = [
    ("rates.mf4", of_two_rates, ("no group holds such a table", '"at 100 Hz", "at 20 Hz"', "resample")),
    ("unit.tdms", lambda file: recordings.tdms(LOOP.rename(columns={"force [N]": "force"}), file),
     ('group "Run 1", column "force": the force has no unit', 'units = { force = "N" }')),
    ("wrong.parquet", lambda file: recordings.parquet(LOOP.rename(columns={"force [N]": "force [mm]"}), file),
     ('column "force": the unit does not fit', '"mm"')),
    ("gap.feather", lambda file: recordings.feather(LOOP.where(LOOP.index.to_series() != 16), file),
     ('row 17, column "displacement"', "not a finite number")),
    ("text.mat", lambda file: LOOP.to_csv(file), ("this is not a MATLAB file", "a MATLAB file, according to")),
    ("text.uff", lambda file: LOOP.to_csv(file), ("this is not a UFF file",)),
    ("empty.mf4", lambda file: file.write_bytes(b""), ("the file is empty",)),
    ("scalars.mat", lambda file: savemat(file, {"a": 1.0, "b": "text"}), ("holds no channels", "table2struct")),
    ("modes.unv", lambda file: pyuff.UFF(str(file)).write_sets([MILLIMETRES], "overwrite"), ("dataset 58",)),
    ("bomb.mat", bomb, ("cannot be read", "the file unpacks to 1099511627776 values")),
    *((f"cut.{ending}", cut(ending), ("file cannot be read", "incomplete")) for ending in recordings.WRITERS),
]  # fmt: skip


@pytest.mark.parametrize(("name", "write", "words"), SPOILED, ids=[name for name, *_ in SPOILED])
def test_what_cannot_be_read_is_one_clear_error(typed, tmp_path, name, write, words):
    write(tmp_path / name)
    (tmp_path / "c.toml").write_text(f'{BUSHING}\n[[loops]]\nfile = "{name}"\ndirection = "axial"\n')
    for line in (("run", "c.toml"), ("inspect", name), ("init", name, "--direction", "axial", *GEOMETRY)):
        done = typed(*line, "-o", "x", status=2)
        refused(done, tmp_path / "x", *words)
        assert done.stderr.startswith("bushfit: error: ")


@pytest.mark.parametrize(
    ("ending", "package"),
    [("tdms", "nptdms"), ("mf4", "asammdf"), ("uff", "pyuff"), ("v73.mat", "h5py"), ("parquet", "pyarrow")],
)
def test_a_missing_library_is_named(typed, tmp_path, ending, package, monkeypatch):
    recordings.WRITERS[ending](LOOP, tmp_path / f"loop.{ending}")
    monkeypatch.setitem(sys.modules, package, None)
    done = typed("inspect", f"loop.{ending}", "-o", "x", status=2)
    refused(done, tmp_path / "x", f"no package {package}", 'pip install "bushfit[instruments]"')


def test_what_a_file_does_not_tell_is_stated_as_of_csv(typed, tmp_path):
    """A matrix has neither names nor units; one group of two is chosen as a sheet is."""
    slow = {"oil": np.arange(40.0)}
    savemat(tmp_path / "axial.mat", {"log": LOOP.to_numpy(), "oil": slow})
    columns = {"time": "log(:,1)", "displacement": "log(:,2)", "force": "log(:,3)"}
    stated = [f"--column={role}={name}" for role, name in columns.items()]
    stated += ["--unit=time=s", "--unit=displacement=mm", "--unit=force=N"]
    done = typed("init", "axial.mat", *stated, *GEOMETRY, "-o", "x")
    assert "left out: axial.mat, group oil: " in done.stderr
    assert 'sheet = "top level"' in (tmp_path / "x/campaign.toml").read_text(encoding="utf-8")
    assert "mu" in values(typed("fit-static", "x/campaign.toml", "-o", "y", "--no-plots", "--json"))
    (tmp_path / "axial.mat").rename(tmp_path / "test.mat")
    assert (
        'test.mat, group "top level": the direction of this test is not stated'
        in typed("init", "test.mat", *stated, *GEOMETRY, status=2).stderr
    )
