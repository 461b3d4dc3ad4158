"""What is built of the repository holds bushfit alone, and no measurements under the licences of others."""

from __future__ import annotations

import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest


def test_measured_rubber_has_a_source_and_a_licence_of_its_own(root: Path) -> None:
    folders = [folder for folder in (root / "data/measured").iterdir() if folder.is_dir()]
    assert folders
    for folder in folders:
        assert "LICENSE" in {file.name for file in folder.iterdir()}
        assert "https://" in (folder / "README.md").read_text(encoding="utf-8")


def test_what_is_built_is_told_to_leave_measured_rubber_out(root: Path) -> None:
    targets = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"]
    assert targets["wheel"]["packages"] == ["bushfit"]
    assert "/data/measured" in targets["sdist"]["exclude"]


def test_wheel_and_source_archive_hold_no_measured_rubber(root: Path, tmp_path: Path) -> None:
    """Built, where the builder is installed."""
    sdist = pytest.importorskip("hatchling.builders.sdist").SdistBuilder(str(root))
    wheel = pytest.importorskip("hatchling.builders.wheel").WheelBuilder(str(root))
    archive = next(sdist.build(directory=str(tmp_path), versions=["standard"]))
    package = next(wheel.build(directory=str(tmp_path), versions=["standard"]))
    with tarfile.open(archive) as opened:
        names = opened.getnames()
    names += zipfile.ZipFile(package).namelist()
    assert any(name.endswith("data/reference/README.md") for name in names)
    assert [name for name in names if "measured" in Path(name).parts] == []
