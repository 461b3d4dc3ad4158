"""Workbooks, and tables in every form: what is meant, what fills the memory, and what a spreadsheet does not run."""

from collections.abc import Callable
from datetime import datetime
from decimal import Decimal
from pathlib import Path
from typing import Any, get_args

import bombs
import numpy as np
import openpyxl
import pandas as pd
import pytest
import xlwt
from odf.opendocument import OpenDocumentSpreadsheet
from odf.table import Table, TableCell, TableRow
from odf.text import P
from texts import refused

from bushfit.errors import MeasurementError, OutputError
from bushfit.geometry import Direction
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.stated import LoopFile, SweepFile
from bushfit.reading.sweeps import read_sweep
from bushfit.reading.tablefile import Form, ending, escape_formula, to_bytes, to_csv
from bushfit.simulation.files import raw_loop_table, raw_sweep_table

Sheets = dict[str, list[list[object]]]
CYCLES = np.linspace(0.0, 4.0 * np.pi, 60)
NUMBERS = {
    "loop": [
        [Decimal(f"{20.0 + 100.0 * p:.3f}"), Decimal(f"{2 * np.sin(p):.4f}"), Decimal(f"{12000 * np.sin(p + 0.1):.2f}")]
        for p in CYCLES
    ],
    "sweep": [[Decimal(f), Decimal("0.1"), Decimal(2345 + 7 * f), Decimal("0.12")] for f in (5, 15, 25, 35)],
}
HEADERS: dict[str, list[object]] = {
    "loop": ["Zeit [s]", "Weg [mm]", "Kraft [N]"],
    "sweep": ["Frequenz [Hz]", "Amplitude [mm]", "Dynamische Steifigkeit [N/mm]", "Verlustfaktor [-]"],
}
FORCE = np.array([float(row[2]) for row in NUMBERS["loop"]])
PREAMBLE: list[list[object]] = [["Maschine", "EL-7"], ["Datum", "01.02.2026"], ["Version", 1.234], []]
FORMS: tuple[Form, ...] = get_args(Form)
PHASE = np.linspace(0.0, 12.0, 50)
TABLE = pd.DataFrame(
    {"x [mm], low": [1.0 / 3.0, np.nan, -1e-12], "n": [1, 2, 3], "=text": ["=1+1", "a; b, c", "Prüfling"]}
)
RUN = ["=1+1", "+cmd", "-2+3", "@SUM(A1)", "\t=1", "  =1", '=HYPERLINK("http://x")', "\uff1d1", '"=1', "%0A=1", "|x"]
STAY = ["loop_axial_1", "0.1 mm", "a=b", "A-4", "", "'quoted'", "Prüfling 3"]


def table(kind: str, number: Callable[[Any], object] = float) -> list[list[object]]:
    return [HEADERS[kind], *([number(cell) for cell in row] for row in NUMBERS[kind])]


def with_comma(number: object) -> str:
    return f"{number:,}".translate(str.maketrans(",.", ".,"))


def workbook(sheets: Sheets, folder: Path) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(folder / "test.xlsx")
    return folder / "test.xlsx"


def forces(file: Path, **stated: Any) -> Any:
    return read_loop(file, Direction.AXIAL, LoopFile(file=file.name, **stated)).force


SHEETS: dict[str, Sheets] = {
    "one sheet": {"Loop": table("loop")},
    "preamble": {"Loop": [*PREAMBLE, *table("loop")]},
    "units row": {"Loop": [["Zeit", "Weg", "Kraft"], ["s", "mm", "N"], *table("loop")[1:]]},
    "beside a sweep": {"Sweep": table("sweep"), "Loop": table("loop"), "Notes": [["nothing", "here"]]},
    "texts with decimal commas": {"Loop": table("loop", number=with_comma)},
    "texts with decimal points": {"Loop": table("loop", number=str)},
    "numbers beside texts": {
        "Loop": [table("loop")[0], *([float(t), float(x), with_comma(f)] for t, x, f in NUMBERS["loop"])]
    },
    "empty rows and remarks": {"Loop": [[], *table("loop")[:9], [], [None, None, None], *table("loop")[9:]]},
}


@pytest.mark.parametrize("case", SHEETS)
def test_sheets_read_to_the_same_numbers(case, tmp_path):
    assert np.array_equal(forces(workbook(SHEETS[case], tmp_path)), FORCE)


def xls(rows: list[list[object]], file: Path) -> None:
    """By a library of the format, with a date, a format of numbers, and the title merged over the columns."""
    book = xlwt.Workbook()
    sheet = book.add_sheet("Loop")
    sheet.write_merge(0, 0, 0, 2, "Axial")
    sheet.write(1, 1, datetime(2026, 2, 1), xlwt.easyxf(num_format_str="DD.MM.YYYY"))
    for number, row in enumerate(rows, start=2):
        for column, cell in enumerate(row):
            sheet.write(number, column, cell, xlwt.easyxf(num_format_str="0.0"))
    book.save(str(file))


def ods(rows: list[list[object]], file: Path) -> None:
    """With formulas that have their values."""
    book, sheet = OpenDocumentSpreadsheet(), Table(name="Loop")
    for row in rows:
        line = TableRow()
        for cell in row:
            number = {} if isinstance(cell, str) else {"valuetype": "float", "value": cell, "formula": f"of:={cell}"}
            own = TableCell(**(number or {"valuetype": "string"}))
            own.addElement(P(text=str(cell)))
            line.addElement(own)
        sheet.addElement(line)
    book.spreadsheet.addElement(sheet)
    book.save(str(file))


@pytest.mark.parametrize("write", [xls, ods])
def test_workbooks_of_other_formats_read_to_the_same_numbers(write, tmp_path):
    write(table("loop"), tmp_path / f"test.{write.__name__}")
    assert np.array_equal(forces(tmp_path / f"test.{write.__name__}"), FORCE)


LOOP = table("loop")
#: Sheets, the sheet that is stated, and what the error says.
SPOILED: list[tuple[Sheets, str | None, list[str]]] = [
    ({"A": LOOP, "B": LOOP}, None, ["more than one sheet", '"A", "B"', "sheet ="]),
    ({"A": [["x"]], "B": [["y"]]}, None, ["no sheet", '"A", "B"']),
    ({"Loop": LOOP}, "Lop", ["no such sheet", 'did you mean "Loop"']),
    ({"Loop": []}, None, ['sheet "Loop"', "only one column"]),
    ({"Loop": [*LOOP[:9], *[["a", 1.0, 2.0]] * 9, *LOOP[9:]]}, None, ['row 10, column "Zeit [s]"', '"a", and 8 more']),
    ({"Loop": [LOOP[0], *([t, x, "1.234"] for t, x, _ in LOOP[1:])]}, None, ["two ways", '"1.234"', "decimal ="]),
]


@pytest.mark.parametrize(("sheets", "sheet", "words"), SPOILED, ids=[words[0] for *_, words in SPOILED])
def test_spoiled_workbooks_have_one_clear_error(sheets, sheet, words, tmp_path):
    with refused("test.xlsx", *words):
        forces(workbook(sheets, tmp_path), sheet=sheet)


@pytest.mark.parametrize("cells", [lambda row: f"=1*{row}", lambda row: float(row)], ids=["all", "one column"])
def test_formulas_whose_values_were_not_saved_are_said(cells, tmp_path):
    """As programs write them that do not compute, openpyxl among them."""
    rows = [table("loop")[0], *([f"=2*{t}", cells(x), cells(force)] for t, x, force in NUMBERS["loop"])]
    with pytest.raises(MeasurementError, match="formulas whose values were not saved") as caught:
        forces(workbook({"Loop": rows}, tmp_path))
    assert "open it in a spreadsheet program and save it again" in str(caught.value)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("direction", list(Direction))
def test_tests_are_read_back(form, direction, tmp_path):
    loop = Loop("loop", direction, PHASE, 1e-3 * np.sin(PHASE), 50.0 * np.sin(PHASE + 0.2))
    frequency, repeat = np.tile([5.0, 15.0, 25.0], 2), np.repeat([2, 7], 3)
    sweep = Sweep("s", direction, frequency, np.full(6, 2e-4), 5e5 * np.exp(0.1j) * (1.0 + frequency / 100.0), repeat)
    files = [tmp_path / f"{name}.{ending(form)}" for name in ("loop", "sweep")]
    for file, table in zip(files, (raw_loop_table(loop), raw_sweep_table(sweep)), strict=True):
        file.write_bytes(to_bytes(file.stem, table, form))
    found = read_loop(files[0], direction, LoopFile(file=""))
    swept = read_sweep(files[1], direction, SweepFile(file=""))
    for column in ("time", "displacement", "force"):
        written = getattr(loop, column)
        np.testing.assert_allclose(getattr(found, column), written, rtol=1e-6, atol=1e-9 * np.abs(written).max())
    assert np.array_equal(swept.frequency, frequency)
    assert np.array_equal(swept.repeat, repeat)
    np.testing.assert_allclose(swept.amplitude, sweep.amplitude, rtol=1e-6)
    np.testing.assert_allclose(swept.stiffness, sweep.stiffness, rtol=1e-6)


def test_cells_of_a_text_have_seven_digits_and_run_nothing():
    table = pd.DataFrame({"x [mm]": [1.0 / 3.0, np.nan], "n": [-3, 4], "=run": ["\r=1+1", 'a "b", c']})
    table["v"] = pd.Series([None, 2.5], dtype=object)
    assert to_csv(table) == b'x [mm],n,\'=run,v\n0.3333333,-3,\' =1+1,\n,4,"a ""b"", c",2.5\n'
    commas = to_bytes("t", TABLE, "decimal-comma")
    assert commas.startswith(b"\xef\xbb\xbfx [mm], low;n;'=text\n0,3333333;1;'=1+1\n;2;\"a; b, c\"\n-1e-12;3;Pr")
    assert [escape_formula(text) for text in RUN] == [f"'{text}" for text in RUN]
    assert [escape_formula(text) for text in STAY] == STAY
    assert (escape_formula("a\r\nb"), escape_formula("a\r\n=1")) == ("a b", "a =1")


def test_what_a_sheet_does_not_hold_is_refused_and_cells_of_all_sheets_count(tmp_path, monkeypatch):
    wide = pd.DataFrame(np.ones((1, 16_385)), columns=[f"c{n}" for n in range(16_385)])
    assert to_bytes("t", wide, "csv")
    with pytest.raises(OutputError, match="too large for a sheet"):
        to_bytes("t", wide, "xlsx")
    assert to_bytes("t", wide, "csv")
    file = workbook({"A": table("loop"), "B": table("loop")}, tmp_path)
    monkeypatch.setattr("bushfit.reading.workbook._MOST_CELLS", 300)
    with pytest.raises(MeasurementError, match='more, with sheet "B"'):
        forces(file)
    # a forgotten cell at the end of a sheet, as Excel writes it
    dimension = '</sheetData><dimension ref="A1:XFD1048576"/><sheetData>'
    (tmp_path / "test.xlsx").write_bytes(bombs.workbook([dimension + bombs.far_apart()]))
    with pytest.raises(MeasurementError, match="1048576 rows of 16384 columns"):
        forces(tmp_path / "test.xlsx")
