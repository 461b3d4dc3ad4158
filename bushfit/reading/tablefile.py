"""Tables as files, in the form that their reader wants: CSV, CSV with decimal commas, or a workbook.

A CSV file has seven digits, UTF-8, and no text that a spreadsheet would run as a formula. It has commas and decimal
points; or semicolons and decimal commas, as Excel expects where numbers are written so, after the byte order mark by
which Excel knows UTF-8. A workbook has numbers in full, and texts as texts, whatever they look like.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, Any, Literal

from bushfit.errors import OutputError, printable

if TYPE_CHECKING:
    import pandas as pd
    from xlsxwriter import Workbook

#: Commas and decimal points; semicolons and decimal commas; a workbook.
Form = Literal["csv", "decimal-comma", "xlsx"]
#: The start of a text that a spreadsheet takes for a formula, in ASCII or full width, even after blanks.
_FORMULA = re.compile("[\\s\"']*[=+\\-@\uff1d\uff0b\uff0d\uff20|%]|\\t")
#: What parts the lines of a text.
_LINE_ENDS = re.compile("[\\r\\n]+")
#: Characters that the name of a sheet must not have: Excel's, and those that XML has none of.
_UNSAFE_IN_SHEETS = re.compile(r"[\[\]:*?/\\\x00-\x1f\ufffe\uffff]")
#: Characters of the name of a sheet at most, of which rare ones count twice: units of UTF-16.
_LONGEST_SHEET = 31
#: Characters of a cell at most.
_LONGEST_TEXT = 32_767
#: When a workbook says it was made: that of its zip archive, so that the same tables are the same bytes.
_MADE = datetime(1980, 1, 1, tzinfo=UTC)
#: Rows whose texts are made column by column, and held, at a time.
_ROWS_AT_ONCE = 10_000
#: Widest column [characters].
_WIDEST = 60
#: Characters that some operating system does not allow in a name, and halves of surrogate pairs.
_UNSAFE_IN_FOLDERS = re.compile(r'[\x00-\x1f\x7f\ud800-\udfff/\\:*?"<>|]+')
#: Names that Windows keeps for devices, with any ending.
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def ending(form: Form) -> str:
    """The ending of such a file."""
    return "xlsx" if form == "xlsx" else "csv"


def to_bytes(name: str, table: pd.DataFrame, form: Form) -> bytes:
    """The bytes of a table's file; a workbook has one sheet, of that name.

    Raises:
        OutputError: a table that is too large for a sheet.
    """
    return to_xlsx({name: table}) if form == "xlsx" else to_csv(table, decimal_comma=form == "decimal-comma")


def to_csv(table: pd.DataFrame, *, decimal_comma: bool = False) -> bytes:
    """The bytes of a table's file; None and nan become empty cells, and a decimal comma goes with the byte order mark
    by which Excel knows UTF-8."""
    text, point, delimiter, encoding = io.StringIO(), ".", ",", "utf-8"
    if decimal_comma:
        point, delimiter, encoding = ",", ";", "utf-8-sig"
    writer = csv.writer(text, delimiter=delimiter, lineterminator="\n")
    writer.writerow([defused(str(header)) for header in table.columns])
    for start in range(0, len(table), _ROWS_AT_ONCE):
        part = table.iloc[start : start + _ROWS_AT_ONCE]
        writer.writerows(zip(*(_texts(column, point) for _, column in part.items()), strict=True))
    return text.getvalue().encode(encoding, "replace")


def _texts(column: pd.Series[Any], point: str) -> list[str]:
    """The cells of a column, (n,)."""
    if column.dtype.kind == "f":  # at once: most cells are numbers, and most of the time goes into their texts
        texts = ["" if value != value else f"{value:.7g}" for value in column.tolist()]
        return texts if point == "." else [text.replace(".", point) for text in texts]
    if column.dtype == "str":
        return for_each_distinct(column, lambda value: _cell(value, point))
    return [_cell(value, point) for value in column.tolist()]


def for_each_distinct(column: pd.Series[Any], text_of: Callable[[object], str]) -> list[str]:
    """The text of each value of a column, (n,), made once for those that are alike."""
    place, distinct = column.factorize(use_na_sentinel=False)
    texts = [text_of(value) for value in distinct]
    return [texts[at] for at in place.tolist()]


def _cell(value: object, point: str) -> str:
    if isinstance(value, float):
        return "" if value != value else f"{value:.7g}".replace(".", point)
    if isinstance(value, str):
        return defused(value)
    return "" if value is None else str(value)


@lru_cache(maxsize=4096)
def defused(text: str) -> str:
    """A text in one line, after an apostrophe where a spreadsheet would run it as a formula."""
    line = in_a_line(text)
    return f"'{line}" if _FORMULA.match(line) else line


@lru_cache(maxsize=4096)
def in_a_line(text: str) -> str:
    """A text as a cell has it: in one line, control characters as escapes."""
    return "\t".join(map(printable, " ".join(_LINE_ENDS.split(text)).split("\t")))


def undefused(text: str) -> str:
    """The text that was written so, but for the ends of its lines."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text[1:]) else text


def _write(book: Workbook, name: str, table: pd.DataFrame) -> None:
    """Write a table to a sheet, below headers in bold that stay in sight, its columns as wide as their texts.

    Every text is written as a text: nothing is run as a formula or taken for a link or a number. Cells without a value,
    and nan, stay empty.

    Raises:
        OutputError: more rows or columns than a sheet has.
    """
    sheet, bold = book.add_worksheet(name), book.add_format({"bold": True})
    sheet.freeze_panes(1, 0)
    rows = zip(*(column.tolist() for _, column in table.items()), strict=True)  # Python's own numbers
    for row, cells in enumerate(chain([tuple(map(str, table.columns))], rows)):
        for place, cell in enumerate(cells):
            if isinstance(cell, str):
                status = sheet.write_string(row, place, _text(cell), None if row else bold)
            elif cell is not None and math.isfinite(cell):
                status = sheet.write_number(row, place, cell)
            else:
                continue
            if status < 0:  # beyond the last row or column of a sheet
                raise OutputError(
                    "a table is too large for a sheet",
                    place=name,
                    expected="at most 1,048,576 rows and 16,384 columns",
                    hint="--table-format csv has no such limit",
                )
    for place, (header, column) in enumerate(table.items()):
        longest = max(len(text) for text in (str(header), *column.tolist()) if isinstance(text, str))
        sheet.set_column(place, place, min(_WIDEST, longest + 1))


def to_xlsx(tables: Mapping[str, pd.DataFrame]) -> bytes:
    """The bytes of a workbook with a sheet for each table, by its name, which is changed where Excel does not take it.

    Raises:
        OutputError: a table that is too large for a sheet.
    """
    from xlsxwriter import Workbook

    stream, names = io.BytesIO(), set[str]()
    with Workbook(stream, {"in_memory": True}) as book:
        book.set_properties({"created": _MADE})
        for title, table in tables.items():
            _write(book, _sheet_name(title, names), table)
    return stream.getvalue()


def _text(text: str) -> str:
    """A text as a cell holds it."""
    return printable(text, lines=True)[:_LONGEST_TEXT]


def _cut(text: str, most: int) -> str:
    """As many first characters of a text as have so many units of UTF-16 at most."""
    return text.encode("utf-16-le")[: 2 * most].decode("utf-16-le", "ignore")


def _sheet_name(title: str, taken: set[str]) -> str:
    """A name that Excel takes and no other sheet has, its capitals aside; it joins those that are taken."""
    plain = _cut(_UNSAFE_IN_SHEETS.sub("_", _text(title)), _LONGEST_SHEET).strip(" '") or "table"
    name, count = plain, 1
    while name.lower() in {*taken, "history"}:  # which Excel keeps for itself
        count += 1
        end = f"_{count}"
        name = _cut(plain, _LONGEST_SHEET - len(end)) + end
    taken.add(name.lower())
    return name


def folder_name(name: str) -> str:
    """A text as the name of one folder; it is never empty, and never leads out of the folder that it is put in.

    It has 60 characters at most: with the folders above it, a path stays below the 260 that Windows takes.
    """
    safe = _UNSAFE_IN_FOLDERS.sub("_", name)[:60].strip(" .") or "campaign"
    return f"_{safe}" if _DEVICES.fullmatch(safe) else safe
