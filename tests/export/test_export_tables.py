"""CSV files and the workbook, read back over the whole grid; no name does harm in any format."""

import io

import numpy as np
import openpyxl
import pandas as pd
import pytest
from readers import abaqus_options, bulk_cards, teimorbit

from bushfit.export import abaqus, adams, nastran
from bushfit.export.contract import ExportRequest
from bushfit.geometry import Direction
from bushfit.report import spreadsheets

#: Agreement of the model with the kept computation, and what seven digits of a CSV file leave.
MODEL, SEVEN = 2e-4, 1e-6


def sheets(content: bytes) -> dict[str, pd.DataFrame]:
    """The sheets of a workbook as openpyxl reads them."""
    book = openpyxl.load_workbook(io.BytesIO(content))
    found = {}
    for sheet in book:
        header, *rows = sheet.iter_rows(values_only=True)
        found[sheet.title] = pd.DataFrame(rows, columns=header)
    return found


@pytest.mark.parametrize("kind", ["csv", "xlsx"])
def test_long_and_wide_tables_hold_the_whole_grid(kind, export_request, known):
    if kind == "csv":
        files = spreadsheets.csv(export_request).files
        tables = {name.removesuffix(".csv").replace("_", " "): pd.read_csv(io.BytesIO(files[name])) for name in files}
    else:
        tables = sheets(spreadsheets.xlsx(export_request).files["bushing.xlsx"])
    places = [str(direction) for direction in Direction]
    assert list(tables) == [*(f"{p}{end}" for p in places for end in ("", " wide")), "parameters", "provenance"]
    for place in places:
        rows = known[known["direction"] == place].sort_values(["amplitude", "frequency"])
        length, stiffness, scale = ("deg", "N m/rad", 1.0) if place == "torsion" else ("mm", "N/mm", 1e-3)
        moved = rows["amplitude"].to_numpy() * (np.degrees(1.0) if place == "torsion" else 1e3)
        long, wide = tables[place], tables[f"{place} wide"]
        np.testing.assert_allclose(long["frequency [Hz]"], rows["frequency"], rtol=SEVEN)
        np.testing.assert_allclose(long[f"amplitude [{length}]"], moved, rtol=SEVEN)
        np.testing.assert_allclose(long[f"stiffness [{stiffness}]"], scale * rows["stiffness"], rtol=MODEL)
        for name, unit in (("stiffness", stiffness), ("loss factor", "-")):
            pivot = long.pivot_table(index="frequency [Hz]", columns=f"amplitude [{length}]", values=f"{name} [{unit}]")
            pivot.columns = [f"{name} {level:.10g} {length} [{unit}]" for level in np.unique(moved)]
            pd.testing.assert_frame_equal(wide.set_index("frequency [Hz]")[pivot.columns], pivot)
        assert len(wide.columns) == 1 + 2 * len(pivot.columns)


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
