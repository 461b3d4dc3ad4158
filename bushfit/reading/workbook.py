"""Sheets of a workbook; python-calamine reads xlsx, xlsb, xls and ods."""

import io
import re
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from bushfit.errors import MeasurementError
from bushfit.reading.source import Sheet

#: Largest number of cells in all sheets, including empty ones between others; chosen: a full sheet of ten columns.
_MOST_CELLS = 10_500_000
#: Largest size of the unpacked sheets of a workbook [bytes]; chosen: 100 for each of these cells.
_MOST_BYTES = 1 << 30
#: Last cell of a sheet of an xlsx workbook, near the start of its XML.
_DIMENSION = re.compile(rb'<(?:\w+:)?dimension ref="(?:[A-Z]+\d+:)?([A-Z]+)(\d+)"')
#: Cell with a formula but no value, as written by programs that do not compute formulas.
_NOT_COMPUTED = re.compile(
    rb"(?:</(?:\w+:)?f>|<(?:\w+:)?f\b[^<>]*/>)\s*(?:<(?:\w+:)?v\s*/>|<(?:\w+:)?v>\s*</(?:\w+:)?v>)?\s*</(?:\w+:)?c>"
)
#: Row of a sheet of an xlsx workbook that is hidden, by a user or a filter.
_HIDDEN_ROW = re.compile(rb'<(?:\w+:)?row (?=[^>]*\bhidden="(?:1|true)")[^>]*\br="(\d+)"')


def workbook(data: bytes, _: Path) -> Iterator[Sheet]:
    """Read the sheets of a workbook.

    Yields:
        Each sheet.

    Raises:
        MeasurementError: too many cells.
    """
    import python_calamine as calamine

    contents = _xml_of_sheets(data)
    book = calamine.load_workbook(io.BytesIO(data))
    visible_names = {sheet.name for sheet in book.sheets_metadata if sheet.visible == calamine.SheetVisibleEnum.Visible}
    cells_left, has_xml = _MOST_CELLS, len(contents) == len(book.sheet_names)
    for number, name in enumerate(book.sheet_names):
        sheet = book.get_sheet_by_name(name)
        cells_left -= sheet.height * sheet.width
        if cells_left < 0:
            raise _too_large(f'more, with sheet "{name}"')
        yield Sheet(
            name,
            [_row(row) for row in sheet.to_python(skip_empty_area=False)],
            lacks_values=lambda: any(map(_NOT_COMPUTED.search, contents)),
            hidden=tuple(map(int, _HIDDEN_ROW.findall(contents[number]))) if has_xml else (),
            is_visible=name in visible_names or not visible_names,
        )


def _too_large(found: str) -> MeasurementError:
    """Error for a workbook with too many cells or bytes."""
    expected = f"at most {_MOST_CELLS} cells in all sheets, including empty ones between others"
    return MeasurementError("the workbook is too large", found=found, expected=expected, hint="save the sheet as CSV")


def _xml_of_sheets(data: bytes) -> list[bytes]:
    """XML of each sheet in an xlsx workbook; an empty list for other formats.

    Raises:
        MeasurementError: sheets are too large, or have a very distant cell (the reader allocates all cells up to it).
    """
    if not data.startswith(b"PK"):
        return []
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = [part for part in archive.infolist() if re.search(r"sheet[^/]*\.xml$", part.filename)]
        size = sum(part.file_size for part in parts)
        if size > _MOST_BYTES:
            raise _too_large(f"{size} bytes in its sheets")
        contents = {part.filename: archive.read(part) for part in parts}
    for name, content in contents.items():
        if match := _DIMENSION.search(content[:10_000]):
            column = 0
            for letter in match[1]:
                column = 26 * column + letter - 64
            if column * int(match[2]) > _MOST_CELLS:
                raise _too_large(f"{match[2].decode()} rows of {column} columns in {name}")
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
