"""CSV as bushfit writes it: the reader takes it back, and no spreadsheet runs it."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bushfit.geometry import Direction
from bushfit.reading.csvfile import Rows, defused, loss_factor, raw_loop_table, raw_sweep_table, to_csv
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.sweeps import read_sweep

PHASE = np.linspace(0.0, 12.0, 50)


@pytest.mark.parametrize("direction", list(Direction))
def test_a_loop_is_read_back_in_every_direction(direction: Direction, tmp_path: Path) -> None:
    loop = Loop("loop", direction, PHASE, 1e-3 * np.sin(PHASE), 50.0 * np.sin(PHASE + 0.2))
    (tmp_path / "loop.csv").write_bytes(to_csv(raw_loop_table(loop)))
    back = read_loop(tmp_path / "loop.csv", direction)
    for column in ("time", "displacement", "force"):
        written = getattr(loop, column)
        np.testing.assert_allclose(getattr(back, column), written, rtol=1e-6, atol=1e-9 * np.abs(written).max())


@pytest.mark.parametrize("direction", list(Direction))
def test_a_sweep_is_read_back_in_every_direction(direction: Direction, tmp_path: Path) -> None:
    frequency, repeat = np.tile([5.0, 15.0, 25.0], 2), np.repeat([2, 7], 3)
    sweep = Sweep("s", direction, frequency, np.full(6, 2e-4), 5e5 * np.exp(0.1j) * (1.0 + frequency / 100.0), repeat)
    (tmp_path / "sweep.csv").write_bytes(to_csv(raw_sweep_table(sweep)))
    back = read_sweep(tmp_path / "sweep.csv", direction)
    assert np.array_equal(back.frequency, frequency)
    assert np.array_equal(back.repeat, repeat)
    np.testing.assert_allclose(back.amplitude, sweep.amplitude, rtol=1e-6)
    np.testing.assert_allclose(back.stiffness, sweep.stiffness, rtol=1e-6)


def test_cells_have_seven_digits_and_nothing_stands_for_nothing() -> None:
    table = pd.DataFrame({"x [mm]": [1.0 / 3.0, float("nan")], "=run": ["=1+1", 'a "b", c']})
    assert to_csv(table) == b'x [mm],\'=run\n0.3333333,\'=1+1\n,"a ""b"", c"\n'


def test_rows_as_they_come_are_written_like_a_table() -> None:
    stream = io.StringIO()
    written = Rows(stream, ["name", "+x"])
    written.add(["-a", 1.5])
    written.add([None, float("nan")])
    assert stream.getvalue() == "name,'+x\n'-a,1.5\n,\n"


@pytest.mark.parametrize(("text", "cell"), [("a\r\nb", "a b"), ("@sum", "'@sum"), ("  =1", "'  =1"), ("a=b", "a=b")])
def test_a_text_is_one_line_that_nothing_runs(text: str, cell: str) -> None:
    assert defused(text) == cell


def test_loss_factor_is_loss_over_storage() -> None:
    assert loss_factor(np.array([2.0 + 0.5j, 4.0 - 1.0j])).tolist() == [0.25, -0.25]
