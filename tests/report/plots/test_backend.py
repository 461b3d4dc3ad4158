"""Pictures need no window, whatever backend the environment asks matplotlib for."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from tries import some


@pytest.mark.parametrize(
    "backend", some(["module://matplotlib_inline.backend_inline", "no such backend"], {"no such backend"})
)
def test_a_backend_that_is_not_installed_does_not_matter(root: Path, tmp_path: Path, backend: str) -> None:
    """As a notebook sets it for every command that is run from a cell."""
    done = subprocess.run(
        [
            *(sys.executable, "-c", "from bushfit.cli import main; main()"),
            *("fit-static", root / "configs/cmp_15961.toml", "-o", tmp_path / "results"),
        ],
        env={**os.environ, "MPLBACKEND": backend},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "results/loops.png").is_file()
