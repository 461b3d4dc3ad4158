"""No name does harm in any format: it stays in its comment or cell, and every value is read back as without it."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import openpyxl
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from readers import abaqus_options, bulk_cards, by_abaqus, by_pynastran, teimorbit

from bushfit.export import abaqus, adams, nastran
from bushfit.export.contract import Order
from bushfit.reading.tablefile import to_xlsx
from bushfit.report import spreadsheets

#: Names that break out of what is not escaped: line ends, comment marks, cards, keywords, formulas, markup, quotes.
#: Halves of characters are in no name: files with them are refused, and pandas beside pyarrow holds no such text.
NASTY = [
    "a\nPBUSH          1       K     1.0\n$",
    "a\r\n*STEP\n** ",
    "a\u2028[DAMPING]\x85FX_DAMPING = 1",
    "=cmd|' /C calc'!A0",
    "+1+1",
    "@SUM(A1)",
    "<b>&\"'</b>",
    "pyNastran: version=nx " * 9,
    "$ pyNastran: punch=False",
    "http://x.y/" + "z" * 300,
    "\x00 \x1b[2J",
    "Büchse 套管",
    "   ",
]


def nasty(function: Callable) -> Callable:
    for name in NASTY:
        function = example(name=name)(function)
    return given(name=st.text(min_size=1, max_size=60))(function)


@pytest.fixture(scope="module")
def plain(named: Callable[[str], Order], tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    """What readers find where the name is harmless."""
    return found(named("plain"), tmp_path_factory.mktemp("plain"))


def found(order: Order, folder: Path) -> dict[str, object]:
    texts = {
        name: content.decode("ascii")
        for export in (nastran.export, abaqus.export, adams.export)
        for name, content in export(order).files.items()
    }
    for text in texts.values():
        assert not set(text) - {chr(code) for code in range(0x20, 0x7F)} - {"\n"}
        assert max(map(len, text.splitlines())) <= 80 or "CONNECTOR" in text
    (folder / "bushing.bdf").write_text(texts["bushing.bdf"], encoding="ascii")
    return {
        "cards": bulk_cards(texts["bushing.bdf"]),
        "nastran": {key: k.tolist() for key, (_, k) in by_pynastran(folder / "bushing.bdf").items()},
        "options": [(keyword, values) for keyword, values, _ in abaqus_options(texts["bushing.inp"])],
        "abaqus": {key: k.tolist() for key, (_, k) in by_abaqus(texts["bushing.inp"]).items()},
        "adams": {
            block: (pairs, *map(list, rest)) for block, (pairs, *rest) in listed(texts["bushing_ride.bus"]).items()
        },
    }


def listed(text: str) -> dict:
    return {block: (pairs, names, table.tolist()) for block, (pairs, names, table) in teimorbit(text).items()}


@nasty
def test_decks_hold_the_same_under_any_name(
    name: str, named: Callable[[str], Order], plain: dict[str, object], tmp_path: Path
) -> None:
    assert found(named(name), tmp_path) == plain


@nasty
def test_a_workbook_runs_nothing(name: str, named: Callable[[str], Order]) -> None:
    """Read by openpyxl, which tells a formula ("f") from a text ("s"); numbers are whole."""
    order = named(name)
    book = openpyxl.load_workbook(io.BytesIO(spreadsheets.xlsx(order).files["bushing.xlsx"]))
    cells = [cell for sheet in book for row in sheet.iter_rows() for cell in row]
    assert {cell.data_type for cell in cells} <= {"s", "n"}
    assert not any(cell.hyperlink for cell in cells)
    if name.isprintable() and name.strip() == name:
        assert name in {cell.value for cell in book["provenance"]["B"]}


@nasty
def test_csv_files_begin_no_formula(name: str, named: Callable[[str], Order]) -> None:
    for content in spreadsheets.csv(named(name)).files.values():
        for line in content.decode().splitlines():
            assert not line.lstrip(' "').startswith(("=", "+", "@", "|"))
            assert not any(cell.startswith(("=", "+", "@")) for cell in line.split(","))


@nasty
def test_sheets_have_names_that_excel_takes(name: str) -> None:
    """At most 31 characters, none of []:*?/\\, no apostrophe at an end, not History, and each once, capitals aside."""
    import pandas as pd

    table = pd.DataFrame({name: [1.5, np.nan, np.inf], "text": [name, None, ""]})
    book = openpyxl.load_workbook(
        io.BytesIO(to_xlsx({name: table, f"{name} ": table, name.upper() + "'": table, "History": table}))
    )
    assert len({title.lower() for title in book.sheetnames}) == 4
    for title in book.sheetnames:
        assert 0 < len(title) <= 31
        assert not set(title) & set("[]:*?/\\")
        assert title.strip("'") == title
        assert title.lower() != "history"
    first = book.worksheets[0]
    assert [cell.value for cell in first["A"]][1:] == [1.5, None, None]
