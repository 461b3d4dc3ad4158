"""No name does harm in any format of export."""

import io

import openpyxl
import pytest
from readers import abaqus_options, bulk_cards, teimorbit

from bushfit.export import abaqus, adams, nastran
from bushfit.export.contract import ExportRequest
from bushfit.report import spreadsheets

#: Names that break out of what is not escaped: line ends, comment marks, cards, keywords, formulas, markup.
NASTY = ["a\nPBUSH          1       K     1.0\n$", "a\r\n*STEP\n** ", "a\u2028[DAMPING]\x85FX_DAMPING = 1"]
NASTY += ["=1+1", "套管"]


@pytest.mark.parametrize("name", NASTY)
def test_decks_and_workbook_hold_the_same_under_any_name(name, named):
    def content(export_request: ExportRequest) -> tuple[object, ...]:
        texts = {
            file: text.decode("ascii")
            for export in (nastran.export, abaqus.export, adams.export)
            for file, text in export(export_request).files.items()
        }
        blocks = teimorbit(texts["bushing_ride.bus"]).items()
        options = [(keyword, values) for keyword, values, _ in abaqus_options(texts["bushing.inp"])]
        return bulk_cards(texts["bushing.bdf"]), options, [(block, pairs) for block, (pairs, _, _) in blocks]

    assert content(named(name)) == content(named("plain"))
    book = openpyxl.load_workbook(io.BytesIO(spreadsheets.xlsx(named(name)).files["bushing.xlsx"]))
    assert {cell.data_type for sheet in book for row in sheet.iter_rows() for cell in row} <= {"s", "n"}, "no formula"
