"""CSV files that a spreadsheet opens as tables of numbers and texts, and runs nothing of."""

from __future__ import annotations

import csv
import io

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.reading.csvfile import to_csv

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
