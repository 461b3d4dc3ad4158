"""Layouts: the header is the line that names the columns of a test and has rows like itself below it."""

from __future__ import annotations

import pytest

from bushfit.reading.headers import Vocabulary
from bushfit.reading.layout import Layout, Line, find_layout, is_comment, split
from bushfit.reading.words import LOOP_COLUMNS


def layout_of(text: str, **stated: object) -> Layout:
    lines = [Line(number, line) for number, line in enumerate(text.splitlines(), start=1) if line]
    return find_layout(lines, Vocabulary(LOOP_COLUMNS, {}), **stated)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "before_data", "delimiter", "headers", "units"),
    [
        ("", 1, ",", (), ()),
        ("time;force\n1;2\n", 1, ";", ("time", "force"), ("", "")),
        ("rig 3\n\ntime\tforce\ns\tkN\n1\t2\n", 4, "\t", ("time", "force"), ("s", "kN")),
        ("time,force\n# of rig 3\n[s],(N)\n1,2\n", 3, ",", ("time", "force"), ("s", "N")),
        ("# time,force\n1,2\n", 1, ",", ("time", "force"), ("", "")),
        ("time   axial force [N]\n1   2\n", 1, " ", ("time", "axial force [N]"), ("", "")),
        ("time,force,,\n1,2,,\n", 1, ",", ("time", "force"), ("", "")),
        ("time,force\ntime,displacement,force\n1,2,3\n", 2, ",", ("time", "displacement", "force"), ("", "", "")),
        ("x,y\n1,2\n2,3\n3,4\n", 1, ",", ("x", "y"), ("", "")),
    ],
    ids=["none", "plain", "units", "brackets", "commented", "blanks", "trailing", "best of two", "unknown names"],
)
def test_header_delimiter_and_units_are_found(
    text: str, before_data: int, delimiter: str, headers: tuple[str, ...], units: tuple[str, ...]
) -> None:
    found = layout_of(text)
    assert (found.lines_before_data, found.delimiter) == (before_data, delimiter)
    assert (found.headers, found.units) == (headers, units)


def test_what_is_stated_is_not_sought() -> None:
    text = "time,force\nZeit,Kraft\n1,2\n"
    assert layout_of(text).header_line == 2
    assert layout_of(text, header_line=1).headers == ("time", "force")
    assert layout_of("time;force,x\n1;2,3\n", delimiter=",").headers == ("time;force", "x")


def test_a_line_is_split_into_cells() -> None:
    assert split(" a ; b;", ";") == ["a", "b", ""]
    assert split('"a;b"; "c"', ";") == ["a;b", "c"]
    assert split(("a", 1.5, ""), "") == ["a", "1.5", ""]


def test_a_semicolon_begins_a_comment_unless_it_parts_columns() -> None:
    assert is_comment("; rig 3", ",")
    assert not is_comment(";1;2", ";")
    assert all(is_comment(line, ";") for line in ("# x", " % x", "// x"))
