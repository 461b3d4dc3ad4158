"""Every dialect reads to the same numbers, and its errors name line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dialects import DIALECTS, NUMBERS, UNITS, Dialect, expected
from machines import MACHINES

from bushfit import units
from bushfit.errors import MeasurementError
from bushfit.geometry import Direction, Specimen
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Floats, Loop, Sweep
from bushfit.reading.stated import LoopFile, SweepFile
from bushfit.reading.sweeps import read_sweep


def written(dialect: Dialect, folder: Path) -> Path:
    file = folder / f"{dialect.kind}.csv"
    file.write_bytes(dialect.bytes())
    return file


def by_bushfit(file: Path) -> Loop | Sweep:
    if file.stem == "loop":
        return read_loop(file, Direction.AXIAL, LoopFile(file=file.name))
    place = Direction.AXIAL if file.stem == "sweep" else Specimen("DMA", "modulus")
    return read_sweep(file, place, SweepFile(file=file.name))


ALL = {**DIALECTS, **MACHINES}


def in_si(dialect: Dialect) -> list[Floats]:
    """The columns of a dialect as its units have them."""
    columns = []
    for index, (column, unit) in enumerate(zip(expected(dialect.kind), UNITS[dialect.kind], strict=True)):
        own = dialect.unit_of(index)
        if own == "rad/s":
            columns.append(column * (1.0 / (2.0 * np.pi)))
        else:
            si = {"mm": "m", "N/mm": "N/m", "MPa": "Pa", "%": "1", "-": "1"}.get(unit, unit)
            columns.append(column * units.factor(own, si))
    return columns


@pytest.mark.parametrize("name", ALL)
def test_every_dialect_reads_to_the_same_numbers(name: str, tmp_path: Path) -> None:
    dialect = ALL[name]
    read = by_bushfit(written(dialect, tmp_path))
    first, amplitude, third, *loss = in_si(dialect)
    if isinstance(read, Loop):
        assert np.array_equal(read.time, first)
        assert np.array_equal(read.displacement, amplitude)
        assert np.array_equal(read.force, third)
        return
    assert np.array_equal(read.frequency, first)
    assert np.array_equal(read.amplitude, amplitude * (0.5 if dialect.double else 1.0))
    if dialect.kind == "coupon":
        assert np.array_equal(read.stiffness, third + 1j * loss[0])
    else:
        assert np.array_equal(read.stiffness, third / np.hypot(1.0, loss[0]) * (1.0 + 1j * loss[0]))


@pytest.mark.parametrize("name", ALL)
def test_errors_name_line_and_column_in_every_dialect(name: str, tmp_path: Path) -> None:
    """One cell in the middle is no number; the error has its line as an editor counts, its header, and the cell."""
    dialect = ALL[name]
    cells = dialect.row(NUMBERS[dialect.kind][12])
    good = dialect.line(cells)
    cells[dialect.place(1)] = "bad"
    bad = dialect.line(cells)
    text = dialect.text()
    assert text.count(good) == 1
    file = tmp_path / f"{dialect.kind}.csv"
    file.write_bytes(dialect.encoded(text.replace(good, bad)))
    line = text.split(dialect.end).index(good) + 1
    with pytest.raises(MeasurementError) as caught:
        by_bushfit(file)
    message = str(caught.value)
    assert f'line {line}, column "{dialect.headers[1].strip()}' in message, message
    assert 'found: "bad"' in message, message
