"""Tables of a file: columns by their role, in SI, with errors that name line and column."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from texts import LOOP

from bushfit.errors import MeasurementError, NoColumnError, UnitError
from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS
from bushfit.reading.layout import FileFormat
from bushfit.reading.table import Table


def opened(text: str, folder: Path, **stated: object) -> Table:
    file = folder / "loop.csv"
    file.write_text(text)
    return Table.open(file, LOOP_COLUMNS, **stated)  # type: ignore[arg-type]


def test_rows_that_a_library_cannot_read_come_out_the_same(tmp_path: Path) -> None:
    """A comment between the rows makes them be read one by one."""
    header, *rows = LOOP.replace(",", ";").splitlines()
    plain = opened("\n".join([header, *rows]), tmp_path)
    values = plain.read({"force": plain.column("force", "N")}, fewest_rows=1)["force"]
    odd = opened("\n".join([header, *rows[:9], "  # paused", *rows[9:]]), tmp_path)
    assert np.array_equal(odd.read({"force": odd.column("force", "N")}, fewest_rows=1)["force"], values)


def test_a_unit_that_is_not_in_the_file_can_be_stated(tmp_path: Path) -> None:
    text = LOOP.replace("force [N]", "force")
    with pytest.raises(UnitError, match=r'line 1, column "force"[\s\S]*the force has no unit'):
        opened(text, tmp_path).column("force", "N")
    assert opened(text, tmp_path, stated_units={"force": "kN"}).column("force", "N").scale == 1e3


@pytest.mark.parametrize(
    ("header", "index"),
    [
        ("f [Hz],A [mm],K [N/mm],tan d", 2),
        ("f [Hz],A [mm],Stiffness K [N/mm],tan d", 2),
        ("f,A,K,tan d\nHz,mm,N/mm,-", 2),
        ("f [Hz],K [N/mm],A [mm],K* [N/mm],tan d", 3),
        ("f [Hz],A [mm],K,tan d", None),
        ("f [Hz],A [mm],K [degC],tan d", None),
    ],
)
def test_the_symbol_of_a_stiffness_is_one_by_its_unit(header: str, index: int | None, tmp_path: Path) -> None:
    file = tmp_path / "sweep.csv"
    row = ",".join(["1.5"] * (header.partition("\n")[0].count(",") + 1))
    file.write_text("\n".join([header, *[row] * 3]))
    column = Table.open(file, SWEEP_COLUMNS).roles.get("stiffness")
    assert (column and column.index) == index


@pytest.mark.parametrize(
    ("text", "stated", "line", "headers"),
    [
        ("time,force\ntime,displacement,force\n1,2,3\n", {}, 2, ("time", "displacement", "force")),
        ("time,force\nZeit,Kraft\n1,2\n", {"header_line": 1}, 1, ("time", "force")),
        ("time;force,x\n1;2,3\n", {"delimiter": "comma"}, 1, ("time;force", "x")),
        ("x,y\n1,2\n2,3\n3,4\n", {}, 1, ("x", "y")),
    ],
)
def test_the_header_names_most_columns_unless_it_is_stated(
    text: str, stated: dict[str, Any], line: int, headers: tuple[str, ...], tmp_path: Path
) -> None:
    found = opened(text, tmp_path, stated=FileFormat(**stated)).layout
    assert (found.header_line, found.headers) == (line, headers)


def test_a_header_line_that_is_stated_has_to_hold_a_header(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match=r"no header on this line[\s\S]*header_line = 99"):
        opened(LOOP, tmp_path, stated=FileFormat(header_line=99))


def test_a_column_that_is_not_there_suggests_the_nearest_if_any_and_has_an_error_of_its_own(tmp_path: Path) -> None:
    with pytest.raises(NoColumnError, match=r'no column "forse"[\s\S]*did you mean "force \[N\]"'):
        opened(LOOP, tmp_path, columns={"force": "forse"})
    with pytest.raises(NoColumnError, match=r'no column "Q"[\s\S]*name one of this file'):
        opened(LOOP, tmp_path, columns={"force": "Q"})
