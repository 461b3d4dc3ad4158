"""Campaigns to work through in batches."""

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def shop(root, tmp_path) -> Path:
    """Five bushings, each in a folder of its own under `bushings`."""
    for number in range(5):
        shutil.copytree(root / f"data/practice/case_{number:03}", tmp_path / f"bushings/b{number}")
    return tmp_path
