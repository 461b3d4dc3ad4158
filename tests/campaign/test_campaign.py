"""Campaigns: the tests that a file names, read with what it says of them."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaigns import BUSHING, LOOP, TESTS, campaign_from

from bushfit.campaign.campaign import load_campaign
from bushfit.geometry import Bushing, Direction


def test_a_plain_campaign(folder: Path) -> None:
    campaign = campaign_from(BUSHING + TESTS, folder)
    assert campaign.name == "CMP 15 961"
    assert campaign.bushing == Bushing("CMP 15 961", 0.010, 0.018, 0.034)
    assert [(loop.name, loop.direction) for loop in campaign.loops] == [("loop", Direction.AXIAL)]
    assert [(sweep.name, sweep.direction) for sweep in campaign.sweeps] == [("sweep", Direction.RADIAL)]
    assert campaign.loops[0].source is not None
    assert campaign.loops[0].source.file == Path("loop.csv")
    assert campaign.fit.parameters == {}
    assert campaign.predict.frequencies is None
    assert campaign.simulate is None


def test_what_a_campaign_says_of_its_files(folder: Path) -> None:
    (folder / "loop.csv").write_text(LOOP.replace("force [N]", "Kraft").replace("time [s]", "x [s]"))
    options = """
name = "of files"
bushing = { name = "b", inner_radius = "1 cm", outer_radius = "18 mm", length = "34 mm" }
[[loops]]
file = "loop.csv"
direction = "axial"
columns = { force = "Kraft" }
units = { force = "kN" }
noise = "0.5 %"
frequency = "0.1 Hz"
waveform = "sine"
[[sweeps]]
file = "sweep.csv"
direction = "axial"
amplitude = "peak-to-peak"
noise = "1 %"
"""
    campaign = campaign_from(options, folder)
    assert campaign.name == "of files"
    assert campaign.loops[0].noise == 0.005
    assert campaign.loops[0].force.max() == pytest.approx(1000.0, rel=1e-2)
    assert campaign.sweeps[0].amplitude[0] == pytest.approx(0.05e-3)


def test_names_of_tests_differ(folder: Path) -> None:
    (folder / "more").mkdir()
    (folder / "more/loop.csv").write_text(LOOP)
    campaign = campaign_from(BUSHING + TESTS + '[[loops]]\nfile = "more/loop.csv"\ndirection = "axial"\n', folder)
    assert [loop.name for loop in campaign.loops] == ["loop.csv", "more/loop.csv"]


def test_the_campaign_of_the_paper(root: Path) -> None:
    campaign = load_campaign(root / "configs/cmp_15961.toml")
    axial = campaign.sweeps[0]
    assert axial.stiffness[0].real == pytest.approx(591_445, rel=1e-5)
    assert set(axial.repeat) == {1, 2, 3}
