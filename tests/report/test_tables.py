"""Tables of results: units in every header, one row a point, and numbers that are those of the model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.campaign import load_campaign
from bushfit.fitting.data import Data
from bushfit.model.model import Model
from bushfit.report.tables import gap_table, loops_table, sweeps_table


@pytest.fixture(scope="module")
def data(root: Path) -> Data:
    return Data.of(load_campaign(root / "configs/cmp_15961.toml"))


def test_loops_row_by_row(data: Data, paper_model: Model) -> None:
    table = loops_table(paper_model, data.loops)
    loop = data.loops[0].test
    assert len(table) == loop.time.size
    assert set(table["loop"]) == {loop.name}
    np.testing.assert_allclose(table["force [N]"], loop.force, rtol=1e-12)
    np.testing.assert_allclose(table["displacement [mm]"], 1e3 * loop.displacement, atol=2e-3)
    off = (table["model force [N]"] - table["force [N]"]) / data.loops[0].drive.noise
    np.testing.assert_allclose(table["residual [noise]"], off, rtol=1e-9, atol=1e-9)
    assert np.std(table["residual [noise]"]) == pytest.approx(1.0, abs=0.1)


def test_sweeps_sorted_by_amplitude_repeat_and_frequency(data: Data, paper_model: Model) -> None:
    table = sweeps_table(paper_model, data.sweeps)
    assert len(table) == sum(data_set.sweep.frequency.size for data_set in data.sweeps)
    assert list(dict.fromkeys(table["direction"])) == ["axial", "radial"]
    axial = table[table["direction"] == "axial"].reset_index(drop=True)
    order = ["amplitude [mm]", "repeat", "frequency [Hz]"]
    assert axial.equals(axial.sort_values(order, ignore_index=True))
    stiffness = paper_model.stiffness(
        "axial", axial["frequency [Hz]"].to_numpy(), axial["amplitude [mm]"].to_numpy() / 1e3
    )
    np.testing.assert_allclose(axial["model stiffness [N/mm]"], np.abs(stiffness) / 1e3, rtol=1e-12)
    np.testing.assert_allclose(axial["model loss factor [-]"], stiffness.imag / stiffness.real, rtol=1e-9)


def test_a_gap_has_every_residual_before_and_after(data: Data, paper_model: Model) -> None:
    data_sets = data.chosen(None)
    softer = paper_model.with_values({"mu": 0.98 * paper_model.values["mu"]})
    table = gap_table(softer, paper_model, data_sets)
    for when, model in (("before", softer), ("after", paper_model)):
        columns = [f"{part} {when} [noise]" for part in ("force", "storage", "loss")]
        values = table[columns].to_numpy()
        chi_square = sum(float(np.sum(data_set.misfit(model) ** 2)) for data_set in data_sets)
        assert np.nansum(values**2) == pytest.approx(chi_square, rel=1e-9)
    assert list(dict.fromkeys(table["kind"])) == ["loop", "sweep"]
