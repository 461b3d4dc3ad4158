"""CSV as bushfit writes it: the reader takes it back, and a spreadsheet opens it as a table and runs nothing of it."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.geometry import Direction
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep, loss_factor
from bushfit.reading.rawtable import raw_loop_table, raw_sweep_table
from bushfit.reading.sweeps import read_sweep
from bushfit.reading.tablefile import Rows, defused, to_csv

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


FORMULAS = [
    "=1+1",
    "+cmd",
    "-2+3",
    "@SUM(A1)",
    "\t=1",
    " =1",
    '=HYPERLINK("http://x")',
    "\uff1d1",
    '"=1',
    "%0A=1",
    "|x",
]


def cells(data: bytes) -> list[list[str]]:
    return list(csv.reader(io.StringIO(data.decode(), newline="")))


@pytest.mark.parametrize("text", FORMULAS)
def test_a_text_that_would_run_is_quoted(text: str) -> None:
    header, row = cells(to_csv(pd.DataFrame({text: [1.0], "loop": [text]})))
    assert header == [f"'{text}", "loop"]
    assert row == ["1", f"'{text}"]


def test_a_line_end_starts_no_cell() -> None:
    assert to_csv(pd.DataFrame({"loop": ["\r=1", "a\r\n=1"]})) == b"loop\n' =1\na =1\n"


@pytest.mark.parametrize("text", ["loop_axial_1", "0.1 mm", "a=b", "A-4", "", "'quoted'", "Prüfling 3"])
def test_other_texts_stay(text: str) -> None:
    assert cells(to_csv(pd.DataFrame({"loop": [text], "x": [1]})))[1] == [text, "1"]


@given(st.lists(st.text(), min_size=1))
def test_no_cell_runs(texts: list[str]) -> None:
    rows = cells(to_csv(pd.DataFrame({"text": texts, "n": range(len(texts))})))[1:]
    assert len(rows) == len(texts)
    for row in rows:
        assert not row[0].lstrip().startswith(("=", "+", "-", "@"))


def test_numbers_stay_numbers() -> None:
    table = pd.DataFrame({"a": [-1.5, 2.0], "b": [-3, 4], "c": [None, -0.25], "d": ["x", None]})
    found = pd.read_csv(io.BytesIO(to_csv(table)))
    np.testing.assert_array_equal(found["a"], [-1.5, 2.0])
    np.testing.assert_array_equal(found["b"], [-3, 4])
    np.testing.assert_array_equal(found["c"], [np.nan, -0.25])
