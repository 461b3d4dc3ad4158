"""Workbooks as bushfit writes them: numbers in full, texts as texts, whatever they look like."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

#: Characters that the name of a sheet must not have.
_UNSAFE_IN_SHEETS = re.compile(r"[\[\]:*?/\\\x00-\x1f]")
#: Characters of the name of a sheet at most.
_LONGEST_SHEET = 31
#: The name of a sheet that Excel keeps for itself.
_RESERVED = "history"
#: Characters of a cell at most.
_LONGEST_TEXT = 32_767
#: When a workbook says it was made: that of its zip archive, so that the same tables are the same bytes.
_MADE = datetime(1980, 1, 1, tzinfo=UTC)
#: Widest column [characters].
_WIDEST = 60


def to_xlsx(tables: Mapping[str, pd.DataFrame]) -> bytes:
    """The bytes of a workbook with a sheet for each table, by its name, headers in bold.

    Every text is written as a text: nothing is run as a formula or taken for a link or a number. Cells without a value,
    and nan, stay empty. Names of sheets are changed where Excel does not take them.
    """
    from xlsxwriter import Workbook

    stream = io.BytesIO()
    book = Workbook(stream, {"in_memory": True})
    book.set_properties({"created": _MADE})
    bold = book.add_format({"bold": True})
    names: set[str] = set()
    for title, table in tables.items():
        sheet = book.add_worksheet(_sheet_name(title, names))
        sheet.freeze_panes(1, 0)
        for place, (header, column) in enumerate(table.items()):
            cells = column.tolist()
            sheet.write_string(0, place, _text(str(header)), bold)
            for row, cell in enumerate(cells, start=1):
                if isinstance(cell, str):
                    sheet.write_string(row, place, _text(cell))
                elif cell is not None and cell - cell == 0:  # neither nan nor infinite, which no cell holds
                    sheet.write_number(row, place, cell)
            widths = (len(cell) for cell in (str(header), *cells) if isinstance(cell, str))
            sheet.set_column(place, place, min(_WIDEST, max(widths) + 1))
    book.close()
    return stream.getvalue()


def _text(text: str) -> str:
    """A text as a cell holds it."""
    return text.encode("utf-8", "replace").decode()[:_LONGEST_TEXT]


def _sheet_name(title: str, taken: set[str]) -> str:
    """A name that Excel takes and no other sheet has, its capitals aside; it joins those that are taken."""
    plain = _UNSAFE_IN_SHEETS.sub("_", _text(title))[:_LONGEST_SHEET].strip(" '") or "table"
    name, count = plain, 1
    while name.lower() in taken or name.lower() == _RESERVED:
        count += 1
        end = f"_{count}"
        name = plain[: _LONGEST_SHEET - len(end)] + end
    taken.add(name.lower())
    return name
