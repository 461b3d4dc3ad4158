"""The campaign of the paper and its joint fit in a folder, and commands typed there."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from commandline import Done, call

Run = Callable[..., Done]


@pytest.fixture(scope="session")
def work(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a copy of the campaign and, under `model`, its joint fit."""
    folder = tmp_path_factory.mktemp("work")
    shutil.copytree(root / "data/cmp_15961", folder / "data/cmp_15961")
    (folder / "configs").mkdir()
    shutil.copy(root / "configs/cmp_15961.toml", folder / "configs")
    done = call(folder, "fit", "configs/cmp_15961.toml", "-o", "model", "--no-plots")
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def bushfit(work: Path) -> Run:
    return lambda *arguments: call(work, *arguments)
