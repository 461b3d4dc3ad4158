"""The sheets of an xlsx workbook.

python-calamine reads them: exactly, and imported in a millisecond where openpyxl takes 170.
"""

from __future__ import annotations

import io
import re
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING

from bushfit.errors import MeasurementError, did_you_mean
from bushfit.reading.files import Bytes, view_bytes
from bushfit.reading.source import Sheet

if TYPE_CHECKING:
    from python_calamine import CalamineWorkbook

#: Bytes that a workbook unpacks to at most; chosen: it is held in memory.
_LARGEST_BYTES = 1 << 30
#: Cells that a sheet spans at most; chosen: empty ones are held in memory as well.
_MOST_CELLS = 20_000_000
#: Bytes of a sheet that are unpacked at a time; chosen: no sheet is unpacked whole before its size is known.
_CHUNK_BYTES = 1 << 20
#: First bytes of a zip archive, which an xlsx workbook is.
_ZIP_SIGN = b"PK\x03\x04"
#: First bytes of the older formats of Office.
_OLD_OFFICE_SIGN = b"\xd0\xcf\x11\xe0"
#: The number of a row in the XML of a sheet.
_ROW = re.compile(rb"""<(?:\w+:)?row\b[^>]*?\sr=["'](\d+)""")
#: The column and row of a cell in the XML of a sheet.
_CELL = re.compile(rb"""\sr=["']([A-Z]+)(\d+)["']""")
#: Bytes of the longest tag that two chunks may share; chosen: tags of rows and cells are shorter.
_LONGEST_TAG = 256
#: Sheets that an error lists at most; chosen: a line or two.
_MOST_LISTED = 12


def is_workbook(data: Bytes) -> bool:
    """Whether the first bytes of a file are those of a workbook or of another archive."""
    return data[: len(_ZIP_SIGN)] in (_ZIP_SIGN, _OLD_OFFICE_SIGN)


def open_sheet(data: bytes, file: Path, name: str | None, is_usable: Callable[[Sheet], bool]) -> Sheet:
    """The sheet of a workbook that holds the table: the one that is stated by its name, or else the only usable one.

    Raises:
        MeasurementError: no xlsx workbook, one that is far too large, or no single usable sheet.
    """
    if name is not None:
        with _opened(data, file) as book:
            if name in book.sheet_names:
                return _sheet(book, name)
            names = book.sheet_names
        hint = did_you_mean(name, names)
        raise MeasurementError(
            "there is no such sheet", file=file, found=f'"{name}"', expected=_listed(names), hint=hint
        )
    visible = _visible(data, file)
    usable = [sheet for sheet in visible if is_usable(sheet)] if len(visible) > 1 else visible
    if len(usable) == 1:
        return usable[0]
    raise MeasurementError(
        "more than one sheet holds such a table" if usable else "no sheet holds such a table",
        file=file,
        found=_listed([sheet.sheet for sheet in usable or visible]),
        expected="one",
        hint='choose it in the campaign: sheet = "..."',
    )


def sheets(file: Path) -> list[Sheet]:
    """The visible sheets of a workbook; none where the file is no workbook.

    Raises:
        MeasurementError: no xlsx workbook, or one that is far too large.
    """
    data = view_bytes(file, MeasurementError)
    return _visible(data[:], file) if is_workbook(data) else []


def _visible(data: bytes, file: Path) -> list[Sheet]:
    """The visible sheets of a workbook, or all where none is."""
    with _opened(data, file) as book:
        import python_calamine as calamine

        visible = [sheet.name for sheet in book.sheets_metadata if sheet.visible == calamine.SheetVisibleEnum.Visible]
        return [_sheet(book, name) for name in visible or book.sheet_names]


@contextmanager
def _opened(data: bytes, file: Path) -> Iterator[CalamineWorkbook]:
    """A workbook, with errors of reading it in the project's words."""
    _check(data, file)
    import python_calamine as calamine

    try:
        yield calamine.load_workbook(io.BytesIO(data))
    except (calamine.CalamineError, OSError, ValueError) as error:
        raise MeasurementError(
            "the workbook cannot be read", file=file, found=str(error), hint="save it again as xlsx, or as CSV"
        ) from error


def _sheet(book: CalamineWorkbook, name: str) -> Sheet:
    rows = book.get_sheet_by_name(name).to_python(skip_empty_area=False)
    return Sheet(name, [[_cell(cell) for cell in row] for row in rows])


def _cell(value: object) -> str | float:
    """A number as such, anything else as text on one line."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return " ".join(str(value).split())


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names[:_MOST_LISTED]) + (", ..." if len(names) > _MOST_LISTED else "")


def _check(data: bytes, file: Path) -> None:
    """Refuse what is no xlsx workbook, and what would fill the memory, in which calamine holds a whole sheet."""
    no_workbook = MeasurementError(
        "this is no xlsx workbook", file=file, expected="a table as text, or an xlsx workbook", hint="save it as xlsx"
    )
    if data.startswith(_OLD_OFFICE_SIGN):
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
        while chunk := stream.read(_CHUNK_BYTES):
            text = rest + chunk
            last_row = max(last_row, *map(int, _ROW.findall(text)), 0)
            for letters, row in set(_CELL.findall(text)):
                column = reduce(lambda number, letter: 26 * number + letter - 64, letters, 0)
                last_row, last_column = max(last_row, int(row)), max(last_column, column)
            rest = text[-_LONGEST_TAG:]
    return last_row * last_column
