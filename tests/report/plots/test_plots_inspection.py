"""Figures of files looked at: whole, with their units, and with what is not as it was recorded."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from rawfigures import colliding, labels, outside

from bushfit.inspection.opening import inspect
from bushfit.inspection.record import Inspected
from bushfit.report.plots.inspection import inspection_figure
from bushfit.report.plots.style import to_image


@pytest.fixture(scope="module")
def seen(root: object) -> list[Inspected]:
    names = (
        *("cmp_15961/loop_axial_1.csv", "cmp_15961/sweep_radial.csv"),
        *("cmp_15961_raw/stepped_sine_axial.csv", "arm_bushing/loop_axial_2.csv"),
    )
    return [inspect(root / "data" / name, {}) for name in names]


def test_inspection(seen: list[Inspected]) -> None:
    figure = inspection_figure(seen)
    assert outside(figure) == []
    assert colliding(figure) == []
    assert {"time [s]", "displacement [mm]", "force [N]", "frequency [Hz]", "|K| [N/mm]", "loss factor [-]"} <= labels(
        figure
    )
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]
    assert sorted(titles) == sorted(f"{one.file.name}: {one.kind}, {one.direction}" for one in seen)
    assert len({to_image(inspection_figure(seen)) for _ in range(2)}) == 1


def test_one_file_alone_is_whole(seen: list[Inspected]) -> None:
    for one in seen:
        assert outside(inspection_figure([one])) == []


def test_what_is_not_as_it_was_recorded_is_said(root: Path, tmp_path: Path) -> None:
    table = pd.read_csv(root / "data/cmp_15961/loop_axial_1.csv")
    turned, timeless = tmp_path / "turned_axial.csv", tmp_path / "timeless_axial.csv"
    table.assign(**{"force [N]": -table["force [N]"]}).to_csv(turned, index=False)
    table.drop(columns="time [s]").to_csv(timeless, index=False)
    figure = inspection_figure([inspect(turned, {}), inspect(timeless, {"frequency": "0.1 Hz", "waveform": "sine"})])
    titles = [axes.get_title(loc="left") for axes in figure.axes if axes.get_title(loc="left")]
    assert titles == ["turned_axial.csv: loop, axial, force turned, 1 odd", "timeless_axial.csv: loop, axial"]
    assert {"time [s]", "time rebuilt [s]"} <= labels(figure)
    assert outside(figure) == []
