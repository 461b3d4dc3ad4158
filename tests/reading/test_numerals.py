"""Numbers as tables write them: a decimal point or comma, thousands, and what can be read in two ways."""

from __future__ import annotations

from pathlib import Path

import pytest
from dialects import DIALECTS

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.headers import LOOP_COLUMNS
from bushfit.reading.layout import FileFormat
from bushfit.reading.loops import read_loop
from bushfit.reading.numerals import Numerals
from bushfit.reading.stated import LoopFile
from bushfit.reading.table import Table


@pytest.mark.parametrize(
    ("decimal", "thousands", "text", "number"),
    [
        (".", None, "-1.5e3", -1500.0),
        (".", None, "\u22122.5", -2.5),
        (".", None, "1,5", None),
        (".", None, "1.", 1.0),
        (",", None, ",5", 0.5),
        (",", ".", "1.234.567,8", 1234567.8),
        (",", ".", "1.23,4", None),
        (".", "'", "1\u2019234", 1234.0),
        (",", " ", "1\u202f234,5", 1234.5),
        (".", ",", "0,123", None),
        (".", None, "\u0661", None),
        (".", None, "nan", None),
        (".", None, "1" * 401, None),
    ],
)
def test_a_cell_is_a_number_in_its_way_or_none(
    decimal: str, thousands: str | None, text: str, number: float | None
) -> None:
    assert Numerals(decimal, thousands).value(text) == number


UNCLEAR: dict[str, tuple[str, dict[str, str], float | None]] = {
    "a thousand or a bit more than one": ("1.234;1.234;2.345", {}, None),
    "the same, decimal point stated": ("1.234;1.234;2.345", {"decimal": "."}, 2.345),
    "the same, decimal comma stated": ("1.234;1.234;2.345", {"decimal": ","}, 2345.0),
    "the same, nothing parts thousands": ("1.234;1.234;2.345", {"thousands": "none"}, 2.345),
    "commas": ("1,234;1,234;2,345", {}, None),
    "commas, thousands stated": ("1,234;1,234;2,345", {"thousands": ","}, 2345.0),
    "settled by another column": ("1.234;0.5;2.345", {}, 2.345),
    "settled by four digits": ("1.234;1234.567;2.345", {}, 2.345),
    "settled by both marks": ("1.234,5;1.234;2.345", {}, 2345.0),
    "settled by an exponent": ("1.234;1.234e3;2.345", {}, 2.345),
    "settled by a group too many": ("1.234.567;1.234;2.345", {}, 2345.0),
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_can_be_read_in_two_ways_is_refused(case: str, tmp_path: Path) -> None:
    """Ten rows alike but for their first digit: only the row given can tell what its points and commas mean."""
    cells, stated, force = UNCLEAR[case]
    rows = [f"{n}.001;{n}.002;{n}.003" if "." in cells else f"{n},001;{n},002;{n},003" for n in range(2, 12)]
    file = tmp_path / "loop.csv"
    file.write_text("\n".join(["time [s];displacement [mm];force [N]", cells, *rows]))
    table = Table.open(file, LOOP_COLUMNS, stated=FileFormat(**stated))  # type: ignore[arg-type]
    wanted = {"force": table.column("force", "N")}
    if force is None:
        with pytest.raises(MeasurementError, match=r"two ways[\s\S]*decimal = "):
            table.read(wanted, fewest_rows=1)
    else:
        assert table.read(wanted, fewest_rows=1)["force"][0] == force


def test_numbers_in_two_ways_are_refused(tmp_path: Path) -> None:
    text = DIALECTS["German"].text().replace("62,598", "62.598")
    (tmp_path / "loop.csv").write_text(text)
    with pytest.raises(MeasurementError, match=r"line 4[\s\S]*another way[\s\S]*decimal comma"):
        read_loop(tmp_path / "loop.csv", Direction.AXIAL, LoopFile(file="loop.csv"))
