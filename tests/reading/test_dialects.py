"""Every dialect reads to the same numbers, and its errors name line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dialects import DIALECTS, HEADERS, NUMBERS, Dialect, expected

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.sweeps import read_sweep


def written(dialect: Dialect, folder: Path) -> Path:
    file = folder / f"{dialect.kind}.csv"
    file.write_bytes(dialect.bytes())
    return file


def by_bushfit(file: Path) -> Loop | Sweep:
    return read_loop(file, Direction.AXIAL) if file.stem == "loop" else read_sweep(file, Direction.AXIAL)


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


@pytest.mark.parametrize("name", DIALECTS)
def test_errors_name_line_and_column_in_every_dialect(name: str, tmp_path: Path) -> None:
    """One cell in the middle is no number; the error has its line as an editor counts, its header, and the cell."""
    dialect = DIALECTS[name]
    row = NUMBERS[dialect.kind][12]
    cells = [dialect.number(row[i]) for i in dialect.columns] + ["ok"] * bool(dialect.extra)
    good = dialect.line(cells)
    cells[list(dialect.columns).index(1)] = "bad"
    bad = dialect.line(cells)
    text = dialect.text()
    assert text.count(good) == 1
    file = tmp_path / f"{dialect.kind}.csv"
    file.write_bytes(dialect.encoded(text.replace(good, bad)))
    line = text.split(dialect.end).index(good) + 1
    header = HEADERS[dialect.language][dialect.kind].split(", ")[1]
    with pytest.raises(MeasurementError) as caught:
        by_bushfit(file)
    message = str(caught.value)
    assert f'line {line}, column "{header}' in message, message
    assert 'found: "bad"' in message, message
