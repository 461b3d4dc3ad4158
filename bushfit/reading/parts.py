"""Parts of a file that can contain a table: the text, worksheets of a workbook, or groups of recorded channels.

python-calamine reads xlsx, xlsb, xls and ods.
"""

import io
import re
import zipfile
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from bushfit.errors import MeasurementError, did_you_mean
from bushfit.reading.files import join_quoted, sha256, to_utf8, view_bytes
from bushfit.reading.instruments import format_of, read_groups, word_for_part
from bushfit.reading.layout import FileFormat
from bushfit.reading.source import RowSource, Sheet, Text

#: Largest number of cells in all sheets, including empty ones between others; chosen: a full sheet of ten columns.
_MOST_CELLS = 10_500_000
#: Largest size of the unpacked sheets of a workbook [bytes]; chosen: 100 for each of these cells.
_MOST_BYTES = 1 << 30
#: First bytes of workbooks: of a zip archive (newer formats), and of the older formats of Office.
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
#: First bytes of web pages, which some programs save as .xls, and the number of bytes that are searched for them.
_WEB_PAGES, _FIRST_BYTES = (b"<html", b"<!doctype html", b"<table"), 100
#: Last cell of a sheet of an xlsx workbook, near the start of its XML.
_DIMENSION = re.compile(rb'<(?:\w+:)?dimension ref="(?:[A-Z]+\d+:)?([A-Z]+)(\d+)"')
#: Cell with a formula but no value, as written by programs that do not compute formulas.
_NOT_COMPUTED = re.compile(
    rb"(?:</(?:\w+:)?f>|<(?:\w+:)?f\b[^<>]*/>)\s*(?:<(?:\w+:)?v\s*/>|<(?:\w+:)?v>\s*</(?:\w+:)?v>)?\s*</(?:\w+:)?c>"
)
#: Row of a sheet of an xlsx workbook that is hidden, by a user or a filter.
_HIDDEN_ROW = re.compile(rb'<(?:\w+:)?row (?=[^>]*\bhidden="(?:1|true)")[^>]*\br="(\d+)"')
#: Largest number of parts that an error lists; chosen: a line or two.
_MOST_LISTED = 12
_ONE_GROUP = "a test needs its channels in one group, at one rate and of one length: resample those that differ"


@dataclass(frozen=True, eq=False)
class OpenedFile:
    """Content of a test file.

    Args:
        file: path of the file.
        checksum: SHA-256 of the file, which may still be running in a thread.
        stated: format of the file as the user states it.
        parts: text, sheets or groups of channels that can contain the table.
    """

    file: Path
    checksum: Future[str]
    stated: FileFormat
    parts: Sequence[RowSource]

    def choose(self, is_usable: Callable[[RowSource], bool]) -> RowSource:
        """Choose the part (sheet or group) that contains the table of the test; a file with one part needs no choice.

        Args:
            is_usable: function that returns True if a part can contain the table.

        Returns:
            The only part that is usable.

        Raises:
            MeasurementError: no part, or more than one, is usable.
        """
        parts = self.parts
        usable = [part for part in parts if is_usable(part)] if len(parts) > 1 else parts
        if len(usable) == 1:
            return usable[0]
        kind = word_for_part(self.file)
        raise MeasurementError(
            f"more than one {kind} holds such a table" if usable else f"no {kind} holds such a table",
            file=self.file,
            found=_listed([part.sheet or "" for part in usable or parts]),
            expected="one",
            hint=_ONE_GROUP if kind == "group" and not usable else 'choose it in the campaign: sheet = "..."',
        )


def open_file(file: Path, file_format: FileFormat) -> OpenedFile:
    """Read a text in any encoding, a workbook or a recording; `file_format.sheet` selects one of its parts.

    Returns:
        Content of the file, with all visible parts or the selected one.

    Raises:
        MeasurementError: the file cannot be read, or has no part with this name.
    """
    data = view_bytes(file, MeasurementError)
    checksum, parts = sha256(data), _read_parts(data, file)
    name = file_format.sheet
    if not parts and name:
        expected = "a workbook, or a file with groups of channels"
        raise MeasurementError("this is not a workbook", file=file, found=f'sheet = "{name}"', expected=expected)
    if data[:_FIRST_BYTES].lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(_WEB_PAGES):
        advice = "open it in a spreadsheet program, and save it as xlsx or CSV"
        raise MeasurementError("this is a web page", file=file, found="HTML", expected="a table", hint=advice)
    if not parts:
        text, encoding = to_utf8(data, file, file_format.encoding)
        return OpenedFile(file, checksum, file_format, [Text(join_quoted(text), encoding)])
    chosen = [part for part, visible in parts if (visible if name is None else part.sheet == name)]
    if not chosen:
        problem, names = f"there is no such {word_for_part(file)}", [part.sheet for part, _ in parts]
        hint = did_you_mean(name or "", names)
        raise MeasurementError(problem, file=file, found=f'"{name}"', expected=_listed(names), hint=hint)
    return OpenedFile(file, checksum, file_format, chosen)


def _read_parts(data: bytes, file: Path) -> Sequence[tuple[Sheet, bool]]:
    """Return the sheets of a workbook, or groups of a recording, each with True if visible; nothing for a text.

    Raises:
        MeasurementError: a workbook or recording that cannot be read.
    """
    if recording := format_of(data, file):
        return [(group, True) for group in read_groups(data, file, recording)]
    if not data.startswith(_WORKBOOKS):
        return ()
    try:
        return _sheets(data)
    except OverflowError as error:
        found, limit = str(error), f"at most {_MOST_CELLS} cells in all sheets, including empty ones between others"
        problem, details = "the workbook is too large", {"expected": limit, "hint": "save the sheet as CSV"}
    except ValueError as error:
        found, problem, details = (
            str(error),
            "the workbook cannot be read",
            {"hint": "save it again as xlsx, or as CSV"},
        )
        details["expected"] = "a table as text, or a workbook: xlsx, xlsb, xls or ods"
    raise MeasurementError(problem, file=file, found=found, **details)


@lru_cache(maxsize=1)
def _sheets(data: bytes) -> Sequence[tuple[Sheet, bool]]:
    """Sheets of a workbook, each with True if visible; cached, because an inspection reads a file several times.

    Raises:
        OverflowError: too many cells.
        ValueError: a broken workbook.
    """
    import python_calamine as calamine

    try:
        contents = _xml_of_sheets(data)
        book = calamine.load_workbook(io.BytesIO(data))
        visible_names = {
            sheet.name for sheet in book.sheets_metadata if sheet.visible == calamine.SheetVisibleEnum.Visible
        }
        sheets, cells_left = list[tuple[Sheet, bool]](), _MOST_CELLS
        for name in book.sheet_names:
            sheet = book.get_sheet_by_name(name)
            cells_left -= sheet.height * sheet.width
            if cells_left < 0:
                raise OverflowError(f'more, with sheet "{name}"')
            content = [_row(row) for row in sheet.to_python(skip_empty_area=False)]
            lacks_values = lambda: any(map(_NOT_COMPUTED.search, contents))  # noqa: E731
            rows = _HIDDEN_ROW.findall(contents[len(sheets)]) if len(contents) == len(book.sheet_names) else ()
            part = Sheet(name, content, lacks_values, hidden=tuple(map(int, rows)))
            sheets.append((part, name in visible_names or not visible_names))
        return sheets
    except (calamine.CalamineError, zipfile.BadZipFile, OSError, NotImplementedError, RuntimeError) as error:
        raise ValueError(str(error)) from error


def _xml_of_sheets(data: bytes) -> list[bytes]:
    """XML of each sheet in an xlsx workbook; an empty list for other formats.

    Raises:
        OverflowError: sheets that are too large, or have a cell too far out: the reader allocates all cells before it.
    """
    if not data.startswith(b"PK"):
        return []
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = [part for part in archive.infolist() if re.search(r"sheet[^/]*\.xml$", part.filename)]
        size = sum(part.file_size for part in parts)
        if size > _MOST_BYTES:
            raise OverflowError(f"{size} bytes in its sheets")
        contents = {part.filename: archive.read(part) for part in parts}
    for name, content in contents.items():
        if match := _DIMENSION.search(content[:10_000]):
            column = 0
            for letter in match[1]:
                column = 26 * column + letter - 64
            if column * int(match[2]) > _MOST_CELLS:
                raise OverflowError(f"{match[2].decode()} rows of {column} columns in {name}")
    return [contents[name] for name in sorted(contents, key=lambda name: (len(name), name))]


def _row(cells: Sequence[object]) -> list[str | float]:
    """Convert the cells of a worksheet row to floats, or else to texts on one line, without empty cells at the end."""
    row: list[str | float] = [
        float(cell) if isinstance(cell, int | float) and not isinstance(cell, bool) else " ".join(str(cell).split())
        for cell in cells
    ]
    while row and row[-1] == "":
        row.pop()
    return row


def _listed(names: Sequence[str]) -> str:
    """List at most twelve names as text, in quotation marks and separated by commas."""
    return ", ".join(f'"{name}"' for name in names[:_MOST_LISTED]) + (", ..." if len(names) > _MOST_LISTED else "")
