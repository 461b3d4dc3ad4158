"""The results of two campaigns, of comparisons, of a batch, and their pages."""

from collections.abc import Callable
from pathlib import Path

import pytest
from commandline import typing


@pytest.fixture(scope="session")
def results(campaign_run) -> Callable[[str], Path]:
    """The folder of `bushfit run` of a campaign by its name."""
    return lambda name: campaign_run(name)[0]


@pytest.fixture(scope="session")
def measured(root, tmp_path_factory) -> Path:
    """Measured rubber: the compound fitted to its coupons and predicted for the mount, as the README does it."""
    folder = tmp_path_factory.mktemp("measured") / "mount"
    fit = ("fit", "configs/epdm_70.toml", "--direction", "DMA", "--direction", "DMA 2", "-o", folder)
    predict = ("predict", folder / "model.json", "--campaign", "configs/epdm_70.toml", "-o", folder)
    for command in (fit, predict, ("report", folder)):
        typing(root)(*command, "--no-plots", "-q")
    return folder


@pytest.fixture(scope="session")
def compared(root, results, tmp_path_factory) -> Path:
    """A folder with two comparisons: `two` bushings in both directions, and model `families` on one campaign."""
    home = tmp_path_factory.mktemp("compared")
    two = (results("cmp_15961"), results("mystery_mount"), "--direction", "axial", "--direction", "radial")
    for name, what in (("two", two), ("families", ("configs/cmp_15961.toml", "--families", "sliders,kraus"))):
        typing(root)("compare", *what, "-o", home / name, "--no-plots", "-q")
    return home


@pytest.fixture(scope="session")
def batch(root, tmp_path_factory) -> Path:
    """A batch of four bushings, one of which misses a limit, another of which has no tests, diagnosed and reported."""
    home = tmp_path_factory.mktemp("batch")
    rows = [
        f'[[bushings]]\ncampaign = "{root / "data/practice" / f"case_00{n}" / "bushing.toml"}"\nname = "c{n}"\n'
        for n in range(3)
    ]
    (home / "empty.toml").write_text(
        '[bushing]\nname = "e"\ninner_radius = "1 mm"\nouter_radius = "2 mm"\nlength = "3 mm"\n'
    )
    rows.append('[[bushings]]\ncampaign = "empty.toml"\nname = "=1+1 <b>"\n')
    (home / "m.toml").write_text('commands = ["diagnose"]\nat = ["axial 25 Hz 0.1 mm"]\n' + "".join(rows))
    (home / "limits.toml").write_text('[parameters.mu]\nmin = "1.2 MPa"\n')
    typing(home)("batch", "m.toml", "--limits", "limits.toml", "-o", "out", "--reports", "--jobs", "1", "-q", status=1)
    return home / "out"
