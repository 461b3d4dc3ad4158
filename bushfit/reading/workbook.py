"""Sheets of an xlsx workbook, by python-calamine: exact, and imported in a millisecond where openpyxl takes 170."""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Callable, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING

from bushfit.errors import MeasurementError
from bushfit.reading.files import Bytes
from bushfit.reading.source import Sheet

if TYPE_CHECKING:
    from python_calamine import CalamineWorkbook

#: What a workbook may unpack to, and cells that its largest sheet may span: it is held in memory, filled or not.
_LARGEST_BYTES = 1 << 30
_MOST_CELLS = 20_000_000
_CHUNK = 1 << 20
#: Signs of a zip archive, and of the older formats of Office.
_ZIP, _OLD = b"PK\x03\x04", b"\xd0\xcf\x11\xe0"
_ROW, _CELL = re.compile(rb"""<(?:\w+:)?row\b[^>]*?\sr=["'](\d+)"""), re.compile(rb"""\sr=["']([A-Z]+)(\d+)["']""")
_LONGEST_TAG = 256


def is_workbook(data: Bytes) -> bool:
    """Whether a file is a workbook by its first bytes, or another archive."""
    return data[: len(_ZIP)] in (_ZIP, _OLD)


def open_sheet(data: bytes, file: Path, name: str | None, is_usable: Callable[[Sheet], bool]) -> Sheet:
    """The sheet of a workbook that the table is on.

    Args:
        data: the file's bytes.
        file: for errors.
        name: the sheet, where that is stated; else the only one that is usable.
        is_usable: whether a sheet holds such a table.

    Raises:
        MeasurementError: no xlsx workbook, one beyond all measure, or no single sheet that is meant.
    """
    _check(data, file)
    import python_calamine as calamine

    try:
        book = calamine.load_workbook(io.BytesIO(data))
        if name is not None:
            return _sheet(book, name) if name in book.sheet_names else _missing(book.sheet_names, name, file)
        visible = [sheet.name for sheet in book.sheets_metadata if sheet.visible == calamine.SheetVisibleEnum.Visible]
        sheets = [_sheet(book, name) for name in visible or book.sheet_names]
    except (calamine.CalamineError, OSError, ValueError) as error:
        raise MeasurementError(
            "the workbook cannot be read", file=file, found=str(error), hint="save it again as xlsx, or as CSV"
        ) from error
    usable = [sheet for sheet in sheets if is_usable(sheet)] if len(sheets) > 1 else sheets
    if len(usable) == 1:
        return usable[0]
    raise MeasurementError(
        "more than one sheet holds such a table" if usable else "no sheet holds such a table",
        file=file,
        found=_listed([sheet.sheet for sheet in usable or sheets]),
        expected="one",
        hint='choose it in the campaign: sheet = "..."',
    )


def _sheet(book: CalamineWorkbook, name: str) -> Sheet:
    rows = book.get_sheet_by_name(name).to_python(skip_empty_area=False)
    return Sheet(name, [[_cell(cell) for cell in row] for row in rows])


def _cell(value: object) -> str | float:
    """A number as such, anything else as text on one line."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return " ".join(str(value).split())


def _missing(names: Sequence[str], name: str, file: Path) -> Sheet:
    near = get_close_matches(name, names, n=1)
    raise MeasurementError(
        "there is no such sheet",
        file=file,
        found=f'"{name}"',
        expected=_listed(names),
        hint=f'did you mean "{near[0]}"?' if near else None,
    )


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names[:12]) + (", ..." if len(names) > 12 else "")


def _check(data: bytes, file: Path) -> None:
    """Refuse what is no xlsx workbook, and what would fill the memory: calamine lays a sheet out whole."""
    no_workbook = MeasurementError(
        "this is no xlsx workbook", file=file, expected="a table as text, or an xlsx workbook", hint="save it as xlsx"
    )
    if data.startswith(_OLD):
        raise no_workbook
    too_large = MeasurementError(
        "the workbook is too large",
        file=file,
        expected=f"at most {_LARGEST_BYTES >> 30} GiB unpacked, and {_MOST_CELLS} cells a sheet",
        hint="save the sheet as CSV",
    )
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            parts = archive.infolist()
            if "xl/workbook.xml" not in archive.namelist():
                raise no_workbook
            if sum(part.file_size for part in parts) > _LARGEST_BYTES:
                raise too_large
            for part in parts:
                if part.filename.startswith("xl/worksheets/") and _extent(archive, part) > _MOST_CELLS:
                    raise too_large
    except (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        no_workbook.found = str(error)
        raise no_workbook from error


def _extent(archive: zipfile.ZipFile, part: zipfile.ZipInfo) -> int:
    """Cells that a sheet spans, from its first to its last."""
    last_row = last_column = 0
    with archive.open(part) as stream:
        rest = b""
        while chunk := stream.read(_CHUNK):
            text = rest + chunk
            last_row = max(last_row, *map(int, _ROW.findall(text)), 0)
            for column, row in set(_CELL.findall(text)):
                last_row, last_column = max(last_row, int(row)), max(last_column, _column(column))
            rest = text[-_LONGEST_TAG:]
    return last_row * last_column


def _column(letters: bytes) -> int:
    """Number of a column from its letters, from 1."""
    number = 0
    for letter in letters:
        number = 26 * number + letter - 64
    return number
