"""Files as laboratories write them: what is read has the right values, and what is in doubt is asked about."""

from __future__ import annotations

import json
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import openpyxl
import pytest
import scipy.io
from commandline import call
from exports import AMPLITUDE, DISPLACEMENT, EXPORTS, FORCE, FREQUENCY, STIFFNESS, TIME

from bushfit.errors import BushfitError
from bushfit.inspection.gathering import gather
from bushfit.reading.measurement import Loop

SWEEP = {"frequency": FREQUENCY, "amplitude": 1e-3 * AMPLITUDE, "stiffness": 1e3 * STIFFNESS}
LOOP = {"time": TIME, "displacement": 1e-3 * DISPLACEMENT, "force": FORCE}


@pytest.mark.parametrize("name", EXPORTS)
def test_an_export_is_read_right_or_raises_a_question(name: str, tmp_path: Path) -> None:
    export = EXPORTS[name]
    file = tmp_path / export.name
    file.write_bytes(export.content if isinstance(export.content, bytes) else export.content.encode())
    stated: dict[str, Any] = {"direction": "axial", "columns": {}, "units": {}, **export.stated}
    if export.kind is None:
        with pytest.raises(BushfitError) as caught:
            [source.inspect() for source in gather([file], stated)[0]]
        assert [word for word in export.words if word not in str(caught.value)] == []
        return
    for seen in [source.inspect() for source in gather([file], stated)[0]]:
        measured = seen.measured
        assert measured is not None
        assert measured.source is not None
        notes = " | ".join(measured.source.notes)
        assert seen.kind == export.kind
        assert [word for word in export.words if word not in notes] == []
        for column, values in (export.reference or (LOOP if isinstance(measured, Loop) else SWEEP)).items():
            found = getattr(measured, column)
            if column == "time":  # clocks have no zero, and rounded ones are spread to within a step
                np.testing.assert_allclose(found - found[0], values, atol=0.06 if "spread" in notes else 2e-3)
            else:
                np.testing.assert_allclose(found, values, rtol=2e-6, atol=2e-5 * np.abs(values).max())


@pytest.mark.parametrize("channel", ["time", "force"])
def test_complex_numbers_recorded_over_time_are_refused(channel: str, tmp_path: Path) -> None:
    channels = {"time": TIME, "displacement": DISPLACEMENT, "force": FORCE}
    scipy.io.savemat(tmp_path / "loop.mat", {**channels, channel: channels[channel] * (1.0 + 0.1j)})
    with pytest.raises(BushfitError, match=f'loop.mat: the channel "{channel}" holds complex numbers'):
        gather([tmp_path / "loop.mat"], {"direction": "axial"})[0][0].inspect()


def test_parts_side_by_side_and_date_cells_of_a_workbook(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    book.active.append(["P01", None, None, "P02"])
    book.active.merge_cells("A1:C1")
    book.active.append(["Time", "Displacement [mm]", "Force [N]"] * 2)
    for seconds, x, force in zip(TIME.tolist(), DISPLACEMENT.tolist(), FORCE.tolist(), strict=True):
        stamp = datetime(2026, 11, 26, 20) + timedelta(seconds=seconds)
        book.active.append([stamp, x, force, stamp, x, 1.1 * force])
    book.save(tmp_path / "parts.xlsx")
    seen = [source.inspect() for source in gather([tmp_path / "parts.xlsx"], {"direction": "axial"})[0]]
    assert [one.part for one in seen] == ["P01", "P02"]
    for one, factor in zip(seen, (1.0, 1.1), strict=True):
        assert isinstance(one.measured, Loop)
        np.testing.assert_allclose(one.measured.force, factor * FORCE, atol=1e-6)
        np.testing.assert_allclose(one.measured.time, TIME, atol=1e-3)


FITTED = ["phases near 174", "Amplitude RMS [mm]", "damping coefficient alone", "blocks with amplitudes", "F and x"]


@pytest.mark.slow
@pytest.mark.parametrize("name", FITTED)
def test_a_fit_of_an_export_equals_that_of_a_plain_file(name: str, tmp_path: Path) -> None:
    values = []
    for folder, export in (("plain", EXPORTS["damping is a loss factor"]), ("export", EXPORTS[name])):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "sweep.txt").write_text(str(export.content))
        rubber = ("--inner-radius", "10 mm", "--outer-radius", "18 mm", "--length", "34 mm", "--direction", "axial")
        damping = ("--column", "loss_factor=Damping [-]") if folder == "plain" else ()
        inspected = call(tmp_path / folder, "inspect", "sweep.txt", "--direction", "axial", *damping, "--json")
        assert json.loads(inspected.stdout)["files"][0]["kind"] == "sweep"
        assert call(tmp_path / folder, "init", "sweep.txt", *rubber, *damping, "-o", "x").returncode == 0
        done = call(tmp_path / folder, "fit", "x/campaign.toml", "-o", "y", "--no-plots")
        assert done.returncode == 0, done.stderr
        values.append(json.loads((tmp_path / folder / "y/model.json").read_text())["parameters"])
    for parameter, value in values[0].items():
        assert values[1][parameter]["value"] == pytest.approx(value["value"], rel=1e-4)
