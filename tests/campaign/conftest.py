"""A folder with the tables that the campaigns name."""

from __future__ import annotations

from pathlib import Path

import pytest
from campaigns import LOOP, SWEEP


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "loop.csv").write_text(LOOP)
    (tmp_path / "sweep.csv").write_text(SWEEP)
    return tmp_path
