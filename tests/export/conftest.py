"""FMUs that several tests run, each made once."""

from __future__ import annotations

from pathlib import Path

import pytest
from fmus import Running, order

from bushfit.export.contract import Exported
from bushfit.export.fmu import export
from bushfit.model.model import Model


@pytest.fixture(scope="session")
def exported(paper_model: Model) -> Exported:
    """The paper's bushing in three directions, for all systems."""
    return export(order(paper_model))


@pytest.fixture(scope="session")
def paper(exported: Exported, tmp_path_factory: pytest.TempPathFactory) -> Running:
    """The same, ready to run."""
    folder = tmp_path_factory.mktemp("fmu")
    ((name, content),) = exported.files.items()
    (folder / name).write_bytes(content)
    return Running(folder / name, folder / "open")


@pytest.fixture(scope="session")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder for other FMUs."""
    return tmp_path_factory.mktemp("others")
