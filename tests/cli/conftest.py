"""The campaign of the paper and its joint fit in a folder, and commands typed there or in an empty one."""

import shutil
from pathlib import Path

import pytest
from commandline import Run, typing
from shell import CAMPAIGN


@pytest.fixture(scope="session")
def work(root, tmp_path_factory) -> Path:
    """A folder with a copy of the campaign and, under `model`, its joint fit."""
    folder = tmp_path_factory.mktemp("work")
    shutil.copytree(root / "data/cmp_15961", folder / "data/cmp_15961")
    (folder / "configs").mkdir()
    shutil.copy(root / CAMPAIGN, folder / "configs")
    typing(folder)("fit", CAMPAIGN, "-o", "model", "--no-plots")
    return folder


@pytest.fixture
def own(work, tmp_path) -> Path:
    """A folder with a copy of the campaign, to be changed."""
    for name in ("data", "configs"):
        shutil.copytree(work / name, tmp_path / name)
    return tmp_path


@pytest.fixture
def bushfit(work) -> Run:
    """Commands in the folder of the paper's campaign."""
    return typing(work)
