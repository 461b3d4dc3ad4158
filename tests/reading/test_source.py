"""Sources: the filled lines of a text or the rows of a sheet, and columns that a library reads in one go."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pytest

from bushfit.reading.layout import Layout
from bushfit.reading.numerals import Numerals
from bushfit.reading.source import RowSource, Sheet, Text, rows

FILE = Path("x.csv")
SEMICOLONS = Layout(";", ("time", "force"), 1, ("", ""), None)


def text(content: str) -> Text:
    return Text(content.encode(), "utf-8")


SOURCES = [
    text("a;b\n\n;;\n1;2\r\n3;4"),
    Sheet("rig 3", [["a", "b"], [], ["", ""], ["1", "2"], ["3", "4"]]),
]


@pytest.mark.parametrize("source", SOURCES, ids=["text", "sheet"])
def test_filled_lines_have_the_number_that_an_editor_shows(source: RowSource) -> None:
    assert [line.number for line in source.head()] == [1, 4, 5]
    assert [line.number for line in source.lines(4)] == [5]


@pytest.mark.parametrize("source", SOURCES, ids=["text", "sheet"])
def test_rows_of_data_are_cells_below_the_header(source: RowSource) -> None:
    assert list(rows(source, SEMICOLONS)) == [(4, ["1", "2"]), (5, ["3", "4"])]


def test_comments_are_no_rows_and_an_error_has_its_line() -> None:
    assert [number for number, _ in rows(text("a;b\n# x\n1;2\n"), SEMICOLONS)] == [3]
    with pytest.raises(csv.Error, match=r"field limit.*, line 3"):
        list(rows(text(f'a;b\n1;2\n"{"9" * 200_000}";2\n'), SEMICOLONS))


@pytest.mark.parametrize(
    ("content", "numerals"), [("a;b\n1;2.5\n-3;4e1\n", Numerals()), ("a;b\n1;2,5\n-3;4e1\n", Numerals(","))]
)
def test_tidy_columns_come_scaled(content: str, numerals: Numerals) -> None:
    columns = text(content).columns(SEMICOLONS, 2, {0: 1.0, 1: 1e-3}, numerals)
    assert columns is not None
    assert columns[0].tolist() == [1.0, -3.0]
    np.testing.assert_allclose(columns[1], [2.5e-3, 40e-3], rtol=1e-15)


@pytest.mark.parametrize("row", ["x;1", "1;2;3", "1;1e200", "nan;1", '"1;2\n3;4";5'])
def test_untidy_rows_are_left_to_the_reader_row_by_row(row: str) -> None:
    assert text(f"a;b\n1;2\n{row}\n").columns(SEMICOLONS, 2, {0: 1.0, 1: 1.0}, Numerals()) is None


def test_signs_that_may_part_thousands_are_looked_for_below_the_header_only() -> None:
    header = "time, s;force's\n"
    plain = text(header + "1.5;2.5\n")
    assert not plain.may_have_comma(SEMICOLONS)
    assert not plain.may_group(SEMICOLONS, ".")
    for number in ("1,234.5", "1'234.5", "1 234.5", "1\u202f234.5"):
        assert text(f"{header}{number};2.5\n").may_group(SEMICOLONS, ".")
    assert text(header + "1,5;2.345,5\n").may_group(SEMICOLONS, ",")
