"""Workbooks made part by part, such as one with a forgotten cell far away."""

import io
import zipfile
from collections.abc import Sequence

_PACKAGE = "http://schemas.openxmlformats.org/package/2006/"
_OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_SHEET = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"


def workbook(
    sheets: Sequence[str | bytes], where: str = "xl/worksheets/sheet{}.xml", texts: str | bytes = b""
) -> bytes:
    """A workbook of sheets S1, S2, ... with such rows, which lie where it is said, and with such shared texts."""
    names = {number: where.format(number) for number in range(1, len(sheets) + 1)}
    links = [f'<Relationship Id="r{n}" Type="{_OFFICE}/worksheet" Target="/{name}"/>' for n, name in names.items()]
    links += [f'<Relationship Id="r0" Type="{_OFFICE}/sharedStrings" Target="/xl/sharedStrings.xml"/>'] * bool(texts)
    listed = "".join(f'<sheet name="S{n}" sheetId="{n}" r:id="r{n}"/>' for n in names)
    main = f'<Relationship Id="r1" Type="{_OFFICE}/officeDocument" Target="xl/workbook.xml"/>'
    linked = "".join(links)
    parts: dict[str, str | bytes] = {
        "_rels/.rels": f'<Relationships xmlns="{_PACKAGE}relationships">{main}</Relationships>',
        "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_PACKAGE}relationships">{linked}</Relationships>',
        "xl/workbook.xml": f'<workbook xmlns="{_SHEET}" xmlns:r="{_OFFICE}"><sheets>{listed}</sheets></workbook>',
    }
    for rows, name in zip(sheets, names.values(), strict=True):
        inside = rows if isinstance(rows, bytes) else rows.encode()
        parts[name] = b'<worksheet xmlns="%s"><sheetData>%s</sheetData></worksheet>' % (_SHEET.encode(), inside)
    if texts:
        parts["xl/sharedStrings.xml"] = texts
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return file.getvalue()


def far_apart(last: str = "XFD1048576", sign: str = 'r="{}"') -> str:
    """Rows of two cells, the first and another."""
    return "".join(
        f"<row><c {sign.format(cell)}><v>{number}</v></c></row>" for number, cell in enumerate(("A1", last), start=1)
    )
