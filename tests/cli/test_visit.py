"""`init` on the files of one laboratory visit, all of them at once: they make a campaign that fits.

The files in tests/files/visit hold simulated tests of the paper's bushing in the formats of four programs.
"""

import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from shell import GEOMETRY, values

from bushfit.campaign.campaign import load_campaign
from bushfit.geometry import Specimen
from bushfit.model.model import Model

#: Set points of the sweeps.
FREQUENCIES, AMPLITUDES = range(5, 156, 15), (5e-5, 1e-4, 2e-4, 5e-4)


@pytest.fixture(scope="module")
def visited(tmp_path_factory) -> Path:
    """A folder with the files of the visit, and one of another year that is empty."""
    folder = tmp_path_factory.mktemp("lab") / "visit"
    shutil.copytree(Path(__file__).parents[1] / "files" / "visit", folder)
    (folder / "2023").mkdir()
    return folder


def test_a_visit_makes_a_campaign_that_fits(typed, visited, tmp_path, table_1, monkeypatch):
    """A workbook with an info sheet, four CSVs named by amplitude, a wide table, an MTS export, a German loop."""
    done = typed("init", visited, *GEOMETRY, "-o", "x")
    assert "hidden" not in done.text
    campaign = load_campaign(tmp_path / "x/campaign.toml")
    assert len({sweep.name for sweep in campaign.sweeps}) == len(campaign.sweeps) == 8
    assert sorted(len(sweep.frequency) for sweep in campaign.sweeps) == [11, 11, 11, 11, 44, 44, 44, 44]
    radial = [sweep for sweep in campaign.sweeps if str(sweep.direction) == "radial"]
    assert len(radial) == 3
    for sweep in radial:
        assert np.unique(sweep.amplitude) == pytest.approx(AMPLITUDES)
        assert np.unique(sweep.frequency) == pytest.approx(FREQUENCIES)
    monkeypatch.setattr("commandline.WIDTH", "50")
    done = typed("fit", "x/campaign.toml", "-o", "fit", "--no-plots", "--json")
    assert values(done) == pytest.approx(table_1, rel=0.04)
    assert re.search(r"\nmu\n  value: [\d.]+\n  std error: [\d.]+\n  95 % interval: .* to .*\n  unit: MPa\n", done.text)
    assert "and 1 more test has a smaller misfit" in " ".join(done.text.split())
    shown = done.text.partition("test by test")[2].partition("and 1 more")[0]
    assert ("MTS_radial" in shown, "A0,5mm" in shown) == (True, False), "the largest misfits"
    assert "…" not in done.text, "long names wrap"


def test_all_histories_of_a_direction_have_one_command(typed, root, tmp_path):
    (tmp_path / "lab").mkdir()
    for name in ("loop_axial_1.csv", "raw_a.csv", "raw_b.csv"):
        source = "cmp_15961_raw/stepped_sine_axial.csv" if "raw" in name else "cmp_15961/loop_axial_1.csv"
        (tmp_path / "lab" / name).write_bytes((root / "data" / source).read_bytes())
    (told,) = json.loads(typed("init", "lab", *GEOMETRY, "--direction", "axial", "--json").stdout)["left_out"]
    command = "bushfit reduce lab/raw_a.csv lab/raw_b.csv --direction axial"
    assert told == f"2 raw stepped-sine histories, axial; to convert them to sweep.csv: {command}"


def coupon(model: Model, file: Path, strain: float) -> None:
    """A test of the compound in shear, as the model has it, written as a DMA does: gamma, G' and G''."""
    body = Specimen("DMA", "modulus")
    frequency = np.geomspace(1.0, 100.0, 15)
    modulus = 1e-6 * model.stiffness(body, frequency, np.full(frequency.size, strain))
    rows = [f"{f:.4f},{g.real:.6f},{g.imag:.6f}" for f, g in zip(frequency, modulus, strict=True)]
    file.write_text("\n".join(["Frequency [Hz],G' [MPa],G'' [MPa]", *rows]) + "\n", encoding="utf-8")


def test_coupons_need_no_radii(typed, paper_model, tmp_path, table_1):
    (tmp_path / "dma").mkdir()
    for strain in (0.001, 0.005, 0.02, 0.1):
        coupon(paper_model, tmp_path / f"dma/coupon {100 * strain:g}% 23C.csv", strain)
    typed("init", "dma", "--specimen", "DMA")
    written = tomllib.loads((tmp_path / "results/dma/campaign.toml").read_text(encoding="utf-8"))
    assert "bushing" not in written
    assert written["specimens"] == [{"name": "DMA", "kind": "modulus"}]
    assert {key: written["sweeps"][0][key] for key in ("specimen", "at_amplitude", "temperature")} == {
        "specimen": "DMA", "at_amplitude": "0.1 %", "temperature": "23 degC",
    }  # fmt: skip
    fitted = values(typed("fit", "results/dma/campaign.toml", "-o", "fit", "--no-plots", "--json"))
    assert fitted == pytest.approx(table_1, rel=0.01)


def test_a_block_in_shear_is_a_specimen_with_its_sizes(typed, tmp_path):
    rows = "\n".join(f"{a / 100},{300 - a},0.15" for a in range(5, 100, 5))
    (tmp_path / "mount_10Hz.csv").write_text(f"amplitude [mm],K* [N/mm],tan delta\n{rows}\n", encoding="utf-8")
    sizes = ("--specimen", "mount", "--area", "772 mm^2", "--thickness", "6 mm", "--elements", 2)
    typed("init", "mount_10Hz.csv", *sizes, "-o", "x")
    (body,) = load_campaign(tmp_path / "x/campaign.toml").specimens
    assert (body.area, body.thickness, body.elements) == (7.72e-4, 6e-3, 2)
    assert "needs --area and --thickness" in typed("init", "mount_10Hz.csv", *sizes[:2], "-o", "y", status=2).stderr
    (sweep,) = tomllib.loads(typed("inspect", "mount_10Hz.csv", *sizes, "--no-plots").stdout)["sweeps"]
    assert (sweep["specimen"], sweep["at_frequency"]) == ("mount", "10 Hz")
