"""Every dialect reads to the same numbers, and what other sniffers make of the same files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dialects import DIALECTS, NUMBERS, Dialect, Kind

from bushfit.geometry import Direction
from bushfit.measurement import Floats
from bushfit.reading import read_loop, read_sweep


def expected(kind: Kind) -> list[Floats]:
    return [np.array([float(cell) for cell in column]) for column in zip(*NUMBERS[kind], strict=True)]


def written(dialect: Dialect, folder: Path) -> Path:
    file = folder / f"{dialect.kind}.csv"
    file.write_bytes(dialect.bytes())
    return file


@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_reads_to_the_same_numbers(name: str, tmp_path: Path) -> None:
    dialect = DIALECTS[name]
    file = written(dialect, tmp_path)
    if dialect.kind == "loop":
        time, displacement, force = expected("loop")
        loop = read_loop(file, Direction.AXIAL)
        assert np.array_equal(loop.time, time)
        assert np.array_equal(loop.displacement, displacement * 1e-3)
        assert np.array_equal(loop.force, force)
    else:
        frequency, amplitude, stiffness, loss_factor = expected("sweep")
        sweep = read_sweep(file, Direction.AXIAL)
        assert np.array_equal(sweep.frequency, frequency)
        assert np.array_equal(sweep.amplitude, amplitude * 1e-3)
        exact = stiffness * 1e3 / np.hypot(1.0, loss_factor) * (1.0 + 1j * loss_factor)
        assert np.array_equal(sweep.stiffness, exact)
