"""What is built of the repository holds bushfit alone, whole, and works wherever it is put."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest


@pytest.fixture(scope="module")
def wheel(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, built where the builder is installed."""
    builder = pytest.importorskip("hatchling.builders.wheel").WheelBuilder(str(root))
    return Path(next(builder.build(directory=str(tmp_path_factory.mktemp("wheel")), versions=["standard"])))


def test_measured_rubber_has_a_licence_of_its_own_and_is_left_out_of_what_is_built(root: Path) -> None:
    folders = [folder for folder in (root / "data/measured").iterdir() if folder.is_dir()]
    assert folders
    for folder in folders:
        assert "LICENSE" in {file.name for file in folder.iterdir()}
        assert "https://" in (folder / "README.md").read_text(encoding="utf-8")
    targets = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]["targets"]
    assert targets["wheel"]["packages"] == ["bushfit"]
    assert "/data/measured" in targets["sdist"]["exclude"]


def test_wheel_and_source_archive_hold_no_measured_rubber(root: Path, wheel: Path, tmp_path: Path) -> None:
    sdist = pytest.importorskip("hatchling.builders.sdist").SdistBuilder(str(root))
    archive = next(sdist.build(directory=str(tmp_path), versions=["standard"]))
    with tarfile.open(archive) as opened:
        names = opened.getnames()
    names += zipfile.ZipFile(wheel).namelist()
    assert any(name.endswith("data/reference/README.md") for name in names)
    assert [name for name in names if "measured" in Path(name).parts] == []


def test_the_wheel_is_for_every_machine_and_holds_every_file_of_the_package(root: Path, wheel: Path) -> None:
    """Words and units, the marker that it carries types, pages, sources in other languages."""
    assert wheel.name.endswith("-py3-none-any.whl")
    package = root / "bushfit"
    files = {file.relative_to(root).as_posix() for file in package.rglob("*") if file.is_file()}
    files = {file for file in files if "__pycache__" not in file}
    assert {"bushfit/py.typed", "bushfit/units.txt", "bushfit/manual/python.md"} <= files
    assert {"bushfit/reading/words.toml", "bushfit/effects/library.toml"} <= files
    held = {name for name in zipfile.ZipFile(wheel).namelist() if ".dist-info/" not in name}
    assert held == files


@pytest.mark.slow
def test_the_wheel_works_elsewhere(root: Path, wheel: Path, tmp_path: Path) -> None:
    """Unpacked into another folder, with nothing of the repository but a campaign."""
    zipfile.ZipFile(wheel).extractall(tmp_path / "site")
    for name in ("configs", "data/cmp_15961"):
        shutil.copytree(root / name, tmp_path / "work" / name)
    code = "import bushfit, sys\nfrom bushfit.cli import main\nprint(bushfit.__file__, file=sys.stderr)\nmain()"
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, "run", "configs/cmp_15961.toml", "-o", "results", "--json"],
        cwd=tmp_path / "work",
        env={**os.environ, "PYTHONPATH": str(tmp_path / "site")},
        capture_output=True,
        text=True,
        check=False,
        encoding="utf-8",
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.startswith(str(tmp_path / "site"))
    assert json.loads(done.stdout)["diagnosis"]["verdict"] == "consistent"
    assert (tmp_path / "work/results/axial.png").exists()


def test_every_python_that_is_promised_is_named(root: Path) -> None:
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    named = [entry.rpartition(" ")[2] for entry in project["classifiers"] if "Python :: 3." in entry]
    assert named == ["3.11", "3.12", "3.13"]
    assert project["requires-python"] == f">={named[0]}"
    assert f"{sys.version_info.major}.{sys.version_info.minor}" in named
