"""Tables as files: CSV, CSV with decimal commas, or a workbook.

A CSV file has seven digits, UTF-8, and no text that a spreadsheet would run as a formula. It has commas and decimal
points, or semicolons, decimal commas and a byte order mark for Excel in countries with decimal commas. A workbook has
numbers in full precision, and texts as texts.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from functools import lru_cache
from itertools import chain
from typing import TYPE_CHECKING, Any, Literal

from bushfit.errors import OutputError, printable

if TYPE_CHECKING:
    import pandas as pd
    from xlsxwriter import Workbook

#: Form of a file: commas and decimal points, semicolons and decimal commas, or a workbook.
Form = Literal["csv", "decimal-comma", "xlsx"]
#: Start of a text that a spreadsheet interprets as a formula, in ASCII or full width, even after blanks.
_FORMULA = re.compile("[\\s\"']*[=+\\-@\uff1d\uff0b\uff0d\uff20|%]|\\t")
#: Separator of the lines of a text.
_LINE_ENDS = re.compile("[\\r\\n]+")
#: Characters that Excel or XML does not allow in the name of a sheet.
_UNSAFE_IN_SHEETS = re.compile(r"[\[\]:*?/\\\x00-\x1f\ufffe\uffff]")
#: Largest length of the name of a sheet [UTF-16 units].
_LONGEST_SHEET = 31
#: Largest number of characters of a text in a cell.
_LONGEST_TEXT = 32_767
#: Date of creation in a workbook: that of its zip archive, so that equal tables give equal bytes.
_CREATED = datetime(1980, 1, 1, tzinfo=UTC)
#: Rows that are converted to texts at a time.
_ROWS_AT_ONCE = 10_000
#: Widest column [characters].
_WIDEST = 60
#: Characters that an operating system does not allow in file names, and halves of surrogate pairs.
_UNSAFE_IN_FOLDERS = re.compile(r'[\x00-\x1f\x7f\ud800-\udfff/\\:*?"<>|]+')
#: Names that Windows reserves for devices, with any ending.
_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def ending(form: Form) -> str:
    """Return the file name ending of a form of tables, without the dot."""
    return "xlsx" if form == "xlsx" else "csv"


def to_bytes(name: str, table: pd.DataFrame, form: Form) -> bytes:
    """Return a table as the bytes of a file.

    Args:
        name: name of the sheet, if the file is a workbook.
        table: table to convert.
        form: "csv", "decimal-comma" or "xlsx".

    Raises:
        OutputError: the table is too large for a sheet.
    """
    return to_xlsx({name: table}) if form == "xlsx" else to_csv(table, decimal_comma=form == "decimal-comma")


def to_csv(table: pd.DataFrame, *, decimal_comma: bool = False) -> bytes:
    """Encode a table as a CSV file, in which None and NaN are empty cells.

    Args:
        table: table to encode.
        decimal_comma: True for semicolons, decimal commas and a byte order mark.

    Returns:
        Bytes of the file.
    """
    point, delimiter, encoding = (",", ";", "utf-8-sig") if decimal_comma else (".", ",", "utf-8")
    text = io.TextIOWrapper(io.BytesIO(), encoding, "replace", newline="")
    writer = csv.writer(text, delimiter=delimiter, lineterminator="\n")
    writer.writerow([escape_formula(str(header)) for header in table.columns])
    for start in range(0, len(table), _ROWS_AT_ONCE):
        part = table.iloc[start : start + _ROWS_AT_ONCE]
        writer.writerows(zip(*(_texts(column, point) for _, column in part.items()), strict=True))
    return text.detach().getvalue()


def _texts(column: pd.Series[Any], point: str) -> list[str]:
    """Texts of the cells of a column, (n,), with seven digits and the decimal mark `point`; "" for None and NaN."""
    if column.dtype.kind == "f":  # at once: most cells are numbers, and most of the time goes into their texts
        texts = ["" if value != value else f"{value:z.7g}" for value in column.tolist()]
        return texts if point == "." else [text.replace(".", point) for text in texts]

    def number_text(value: object) -> str:
        """Text of a cell that is not a text."""
        if value is None or value != value:
            return ""
        return f"{value:z.7g}".replace(".", point) if isinstance(value, float) else str(value)

    return [escape_formula(value) if isinstance(value, str) else number_text(value) for value in column.tolist()]


@lru_cache(maxsize=4096)
def escape_formula(text: str) -> str:
    """Return a text for one cell of a CSV file, with an apostrophe if a spreadsheet would run it as a formula.

    Line ends become blanks; other control characters, but tabs, become escape sequences.
    """
    line = "\t".join(map(printable, " ".join(_LINE_ENDS.split(text)).split("\t")))
    return f"'{line}" if _FORMULA.match(line) else line


def unescape_formula(text: str) -> str:
    """Restore a text from the result of `escape_formula`; line ends and control characters remain escaped."""
    return text[1:] if text.startswith("'") and _FORMULA.match(text[1:]) else text


def _write(book: Workbook, name: str, table: pd.DataFrame) -> None:
    """Add a sheet with a table to a workbook, below bold headers in a frozen row, with columns as wide as their texts.

    Texts are neither formulas nor links nor numbers. None and NaN are empty cells.

    Raises:
        OutputError: more rows or columns than a sheet has.
    """
    sheet, bold = book.add_worksheet(name), book.add_format({"bold": True})
    sheet.freeze_panes(1, 0)
    rows = zip(*(column.tolist() for _, column in table.items()), strict=True)
    for row, cells in enumerate(chain([tuple(map(str, table.columns))], rows)):
        for number, cell in enumerate(cells):
            if isinstance(cell, str):
                status = sheet.write_string(row, number, _text(cell), None if row else bold)
            elif cell is not None and math.isfinite(cell):
                status = sheet.write_number(row, number, cell)
            else:
                continue
            if status < 0:  # beyond the last row or column of a sheet
                raise OutputError(
                    "a table is too large for a sheet",
                    place=name,
                    expected="at most 1,048,576 rows and 16,384 columns",
                    hint="--table-format csv has no such limit",
                )
    for number, (header, column) in enumerate(table.items()):
        longest = max(len(text) for text in (str(header), *column.tolist()) if isinstance(text, str))
        sheet.set_column(number, number, min(_WIDEST, longest + 1))


def to_xlsx(tables: Mapping[str, pd.DataFrame]) -> bytes:
    """Return tables, by title, as the bytes of a workbook; titles are changed to sheet names that Excel allows.

    Raises:
        OutputError: a table is too large for a sheet.
    """
    from xlsxwriter import Workbook

    stream, names = io.BytesIO(), set[str]()
    with Workbook(stream, {"in_memory": True}) as book:
        book.set_properties({"created": _CREATED})
        for title, table in tables.items():
            _write(book, _sheet_name(title, names), table)
    return stream.getvalue()


def _text(text: str) -> str:
    """Return the text of a workbook cell without control characters, cut to the largest length that Excel allows."""
    return printable(text, lines=True)[:_LONGEST_TEXT]


def _sheet_name(title: str, used: set[str]) -> str:
    """Sheet name that Excel allows and that is not among the used names, to which it is added in lower case."""

    def cut(text: str, length: int) -> str:
        """Start of a text, at most `length` UTF-16 units long."""
        return text.encode("utf-16-le")[: 2 * length].decode("utf-16-le", "ignore")

    plain = cut(_UNSAFE_IN_SHEETS.sub("_", _text(title)), _LONGEST_SHEET).strip(" '") or "table"
    name, count = plain, 1
    while name.lower() in {*used, "history"}:  # reserved by Excel
        count += 1
        end = f"_{count}"
        name = cut(plain, _LONGEST_SHEET - len(end)) + end
    used.add(name.lower())
    return name


def folder_name(name: str) -> str:
    """Convert a name to a folder name of 1 to 61 characters that all operating systems allow."""
    safe = _UNSAFE_IN_FOLDERS.sub("_", name)[:60].strip(" .") or "campaign"
    return f"_{safe}" if _DEVICES.fullmatch(safe) else safe
