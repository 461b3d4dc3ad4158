"""Layouts: the header is the line that names the columns of a test and has rows like itself below it."""

from __future__ import annotations

import csv

import pytest

from bushfit.reading.headers import Vocabulary
from bushfit.reading.layout import Layout, Line, find_layout, fits, is_comment, split
from bushfit.reading.words import LOOP_COLUMNS

LOOPS = Vocabulary(LOOP_COLUMNS, {})


def layout_of(text: str, **stated: object) -> Layout:
    lines = [Line(number, line) for number, line in enumerate(text.splitlines(), start=1) if line]
    return find_layout(lines, LOOPS, **stated)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "header_line", "delimiter", "headers", "units"),
    [
        ("time;force\n1;2\n", 1, ";", ("time", "force"), ("", "")),
        ("rig 3\n\ntime\tforce\ns\tkN\n1\t2\n", 3, "\t", ("time", "force"), ("s", "kN")),
        ("time,force\n[s],(N)\n1,2\n", 1, ",", ("time", "force"), ("s", "N")),
        ("# time,force\n1,2\n", 1, ",", ("time", "force"), ("", "")),
        ("time   axial force [N]\n1   2\n", 1, " ", ("time", "axial force [N]"), ("", "")),
        ("time,force,,\n1,2,,\n", 1, ",", ("time", "force"), ("", "")),
        ("time,force\ntime,displacement,force\n1,2,3\n", 2, ",", ("time", "displacement", "force"), ("", "", "")),
        ("x,y\n1,2\n2,3\n3,4\n", 1, ",", ("x", "y"), ("", "")),
    ],
    ids=["plain", "units row", "bracketed units", "commented", "blanks", "trailing", "best of two", "unknown names"],
)
def test_header_delimiter_and_units_are_found(
    text: str, header_line: int, delimiter: str, headers: tuple[str, ...], units: tuple[str, ...]
) -> None:
    found = layout_of(text)
    assert (found.header_line, found.delimiter, found.headers, found.units) == (header_line, delimiter, headers, units)


def test_data_begin_after_the_units_row() -> None:
    assert layout_of("time,force\n1,2\n").lines_before_data == 1
    assert layout_of("time,force\n# of rig 3\ns,N\n1,2\n").lines_before_data == 3


def test_what_is_stated_is_not_sought() -> None:
    text = "time,force\nZeit,Kraft\n1,2\n"
    assert layout_of(text).header_line == 2
    assert layout_of(text, header_line=1).headers == ("time", "force")
    assert layout_of("time;force,x\n1;2,3\n", delimiter=",").headers == ("time;force", "x")


def test_without_lines_there_is_no_column() -> None:
    assert layout_of("").headers == ()


@pytest.mark.parametrize(
    ("content", "delimiter", "cells"),
    [
        (" a ; b;", ";", ["a", "b", ""]),
        ('"a;b"; "c"', ";", ["a;b", "c"]),
        ("a  b\tc", " ", ["a", "b", "c"]),
        (("a", 1.5, ""), "", ["a", "1.5", ""]),
    ],
)
def test_a_line_is_split_into_cells(content: str | tuple[str | float, ...], delimiter: str, cells: list[str]) -> None:
    assert split(content, delimiter) == cells


def test_a_line_beyond_all_measure_is_an_error() -> None:
    with pytest.raises(csv.Error, match="a line of 1048577 characters"):
        split("1" * ((1 << 20) + 1), ",")


def test_a_semicolon_begins_a_comment_unless_it_parts_columns() -> None:
    assert is_comment("; rig 3", ",")
    assert not is_comment(";1;2", ";")
    assert all(is_comment(line, ";") for line in ("# x", " % x", "// x"))


def test_empty_cells_may_follow_a_row() -> None:
    assert fits(["1", "2", "", ""], 2)
    assert not fits(["1", "2", "x"], 2)
    assert not fits(["1"], 2)
