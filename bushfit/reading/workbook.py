"""Sheets of a workbook; python-calamine reads xlsx, xlsb, xls and ods."""

import io
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from xml.etree import ElementTree

from bushfit.errors import MeasurementError
from bushfit.reading.files import plain_text
from bushfit.reading.source import Sheet
from bushfit.units import is_unit

#: Largest number of cells in all sheets, including empty ones between others; chosen: a full sheet of ten columns.
_MOST_CELLS = 10_500_000
#: Largest size of the unpacked sheets of a workbook [bytes]; chosen: 100 for each of these cells.
_MOST_BYTES = 1 << 30
#: Last cell of a sheet of an xlsx workbook, near the start of its XML.
_DIMENSION = re.compile(rb'<(?:\w+:)?dimension ref="(?:[A-Z]+\d+:)?([A-Z]+\d+)"')
#: Cell with a formula but no value, as written by programs that do not compute formulas.
_NOT_COMPUTED = re.compile(
    rb"(?:</(?:\w+:)?f>|<(?:\w+:)?f\b[^<>]*/>)\s*(?:<(?:\w+:)?v\s*/>|<(?:\w+:)?v>\s*</(?:\w+:)?v>)?\s*</(?:\w+:)?c>"
)
#: Row of a sheet of an xlsx workbook that is hidden, by a user or a filter.
_HIDDEN_ROW = re.compile(rb'<(?:\w+:)?row (?=[^>]*\bhidden="(?:1|true)")[^>]*\br="(\d+)"')
#: Cell of a sheet of an xlsx workbook with one of several styles.
_STYLED_CELL = r'<(?:\w+:)?c (?=[^>]*\bs="({styles})")[^>]*\br="([A-Z]+\d+)"'
#: Formats for percentages that all workbooks have, by their number.
_PERCENTAGES = {"9": "0%", "10": "0.00%"}
#: End of a number format that scales a number or shows a unit: "0.0%", "#,##0.0,", '0.0" kN/mm"'.
_FORMAT_END = re.compile(r'[0#?](?P<thousands>,*)(?:\s*(?P<percent>%)|\s*"\s*(?P<unit>[^"]+?)\s*")?\s*(?:;|$)')


def read_workbook(data: bytes, _: Path) -> Iterator[Sheet]:
    """Read the sheets of a workbook.

    Yields:
        Sheets in order, each with its cells, hidden rows and visibility.

    Raises:
        MeasurementError: too many cells.
    """
    import python_calamine as calamine

    contents, meanings = _xml_of_sheets(data)
    book = calamine.load_workbook(io.BytesIO(data))
    visible_names = {sheet.name for sheet in book.sheets_metadata if sheet.visible == calamine.SheetVisibleEnum.Visible}
    cells_left = _MOST_CELLS
    for name in book.sheet_names:
        sheet, xml = book.get_sheet_by_name(name), contents.get(name, b"")
        cells_left -= sheet.height * sheet.width
        if cells_left < 0:
            raise _too_large(f'more, with sheet "{name}"')
        rows = [_row(row) for row in sheet.to_python(skip_empty_area=False)]
        divided = 0
        for row, column, (factor, unit) in _cells_with(meanings, xml):
            if row < len(rows) and column < len(rows[row]) and isinstance(value := rows[row][column], float):
                rows[row][column] = f"{factor * value:.12g}{unit}"
                divided += factor < 1.0
        yield Sheet(
            name,
            rows,
            lacks_values=lambda: any(map(_NOT_COMPUTED.search, contents.values())),
            hidden=tuple(map(int, _HIDDEN_ROW.findall(xml))),
            divided=divided,
            is_visible=name in visible_names or not visible_names,
        )


def _too_large(found: str) -> MeasurementError:
    """Error for a workbook with too many cells or bytes."""
    expected = f"at most {_MOST_CELLS} cells in all sheets, including empty ones between others"
    return MeasurementError("the workbook is too large", found=found, expected=expected, hint="save the sheet as CSV")


def _xml_of_sheets(data: bytes) -> tuple[dict[str, bytes], dict[str, tuple[float, str]]]:
    """Read the parts of an xlsx workbook that the library for workbooks does not evaluate.

    Returns:
        XML of each sheet by its name, and factor and unit of the numbers in a cell (see `_factor_and_unit`) by the
        number of its style, for styles with another factor or a unit; both are empty for other formats.

    Raises:
        MeasurementError: sheets are too large, or have a very distant cell (the reader allocates all cells up to it).
    """
    from xlsxwriter.utility import xl_cell_to_rowcol

    if not data.startswith(b"PK"):
        return {}, {}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = [part for part in archive.infolist() if re.search(r"sheet[^/]*\.xml$", part.filename)]
        size = sum(part.file_size for part in parts)
        if size > _MOST_BYTES:
            raise _too_large(f"{size} bytes in its sheets")
        contents = {part.filename: archive.read(part) for part in parts}
        book, links, styles = (
            list(ElementTree.fromstring(archive.read(part)).iter()) if part in archive.namelist() else []
            for part in ("xl/workbook.xml", "xl/_rels/workbook.xml.rels", "xl/styles.xml")
        )
    for name, content in contents.items():
        if match := _DIMENSION.search(content[:10_000]):
            last_row, last_column = xl_cell_to_rowcol(match[1].decode())
            if (last_column + 1) * (last_row + 1) > _MOST_CELLS:
                raise _too_large(f"{last_row + 1} rows of {last_column + 1} columns in {name}")
    targets = {link.get("Id"): str(link.get("Target")).lstrip("/").removeprefix("xl/") for link in links}
    sheets = {
        str(sheet.get("name")): targets.get(next((text for key, text in sheet.items() if key.endswith("}id")), ""), "")
        for sheet in book
        if sheet.tag.endswith("}sheet")
    }
    custom = {one.get("numFmtId", ""): str(one.get("formatCode")) for one in styles if one.tag.endswith("}numFmt")}
    cell_styles = next((list(one) for one in styles if one.tag.endswith("}cellXfs")), [])
    formats = [{**_PERCENTAGES, **custom}.get(style.get("numFmtId", ""), "") for style in cell_styles]
    meanings = {str(n): meaning for n, code in enumerate(formats) if (meaning := _factor_and_unit(code)) != (1.0, "")}
    return {name: contents.get(f"xl/{target}", b"") for name, target in sheets.items()}, meanings


def _factor_and_unit(code: str) -> tuple[float, str]:
    """Factor and unit with which a number format, such as "0.0%", shows a number; 1 and "" if it shows neither."""
    if (match := _FORMAT_END.search(code)) is None:
        return 1.0, ""
    if match["percent"]:
        return 100.0, "%"
    unit = match["unit"] or ""
    is_known = not unit or is_unit(unit)  # else a text such as "k" for thousands
    return (1e-3 ** len(match["thousands"]), f" {unit}".rstrip()) if is_known else (1.0, "")


def _cells_with(styles: Mapping[str, tuple[float, str]], xml: bytes) -> Iterator[tuple[int, int, tuple[float, str]]]:
    """Yield row and column index of each cell of a sheet with one of these styles, and factor and unit of its style."""
    from xlsxwriter.utility import xl_cell_to_rowcol

    pattern = _STYLED_CELL.format(styles="|".join(styles)).encode()
    for style, cell in re.findall(pattern, xml) if styles else ():
        yield *xl_cell_to_rowcol(cell.decode()), styles[style.decode()]


def _row(cells: Sequence[object]) -> list[str | float]:
    """Convert the cells of a worksheet row to floats, or else to texts on one line, without empty cells at the end."""
    row: list[str | float] = [
        float(cell) if isinstance(cell, int | float) and not isinstance(cell, bool) else plain_text(str(cell))
        for cell in cells
    ]
    row = [" ".join(cell.split()) if isinstance(cell, str) else cell for cell in row]
    while row and row[-1] == "":
        row.pop()
    return row
