"""Reads a workbook in a process of its own, which may use so much memory and time and no more: run as a script.

calamine holds a sheet whole, with all empty cells between its first and its last, and ends its process where it gets no
memory for that. So this process is not the user's, and the system bounds it, whatever the workbook holds. It takes the
bytes of a workbook on standard input and an order in JSON as its argument, and answers with marshal on standard output.
It imports nothing of bushfit, to be there within a fiftieth of a second.
"""

import io
import json
import marshal
import re
import sys
import zipfile
import zlib
from typing import Any

#: A cell with a formula and no value, as programs that do not compute write it.
_NOT_COMPUTED = re.compile(
    rb"(?:</(?:\w+:)?f>|<(?:\w+:)?f\b[^<>]*/>)\s*(?:<(?:\w+:)?v\s*/>|<(?:\w+:)?v>\s*</(?:\w+:)?v>)?\s*</(?:\w+:)?c>"
)
#: Bytes of a part that are looked at in one go; chosen: no part is unpacked whole.
_CHUNK_BYTES = 1 << 20
#: Bytes of the longest end of a cell that two chunks may share; chosen: the ends above are shorter.
_LONGEST_END = 256


def bound(memory: int, seconds: int) -> None:
    """Let this process have no more address space [bytes] and processor time [s], and leave no image of itself."""
    try:
        import resource
    except ImportError:  # Windows has no such bounds; its caller waits no longer than it has to
        return
    for kind, most in ((resource.RLIMIT_AS, memory), (resource.RLIMIT_CPU, seconds), (resource.RLIMIT_CORE, 0)):
        _, hard = resource.getrlimit(kind)
        least = most if hard == resource.RLIM_INFINITY else min(most, hard)
        resource.setrlimit(kind, (least, hard))


def answer(data: bytes, order: dict[str, Any]) -> dict[str, Any]:
    """What is asked of a workbook: `names` of all sheets, those `shown` (all if none is), and the cells of `sheets`.

    Of `order`, `sheets` are the names of those that are wanted, None for those shown, and `cells` is how many they may
    span together; how many are `left` is answered, or with which sheet they are `too_many`. An order with `formulas` in
    it asks whether the workbook has `formulas` without values. `error` is what calamine says of a broken workbook.
    """
    import python_calamine as calamine

    try:
        if "formulas" in order:
            return {"formulas": _not_computed(data)}
        book = calamine.load_workbook(io.BytesIO(data))
        names, left, sheets = book.sheet_names, order["cells"], {}
        visible = [sheet.name for sheet in book.sheets_metadata if sheet.visible == calamine.SheetVisibleEnum.Visible]
        shown = visible or names
        for name in (name for name in names if name in (shown if order["sheets"] is None else order["sheets"])):
            sheet = book.get_sheet_by_name(name)
            last_row, last_column = sheet.end or (0, 0)
            left -= (last_row + 1) * (last_column + 1)
            if left < 0:
                return {"too_many": name}
            rows = ([_cell(cell) for cell in row] for row in sheet.to_python(skip_empty_area=False))
            sheets[name] = [row if any(cell != "" for cell in row) else [] for row in rows]
    except (calamine.CalamineError, zipfile.BadZipFile, zlib.error, OSError, ValueError, NotImplementedError) as error:
        return {"error": str(error)}
    return {"names": names, "shown": shown, "sheets": sheets, "left": left}


def _cell(value: object) -> str | float:
    """A number as such, anything else as text on one line."""
    if isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    return " ".join(str(value).split())


def _not_computed(data: bytes) -> bool:
    """Whether an xlsx workbook has a formula without its value; an xls has a value for each."""
    if not data.startswith(b"PK"):
        return False
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        for part in archive.infolist():
            with archive.open(part) as stream:
                rest = b""
                while chunk := stream.read(_CHUNK_BYTES):
                    if _NOT_COMPUTED.search(rest + chunk):
                        return True
                    rest = chunk[-_LONGEST_END:]
    return False


if __name__ == "__main__":
    given = json.loads(sys.argv[1])
    sys.path.append(given.pop("packages"))
    bound(given.pop("memory"), given.pop("seconds"))
    marshal.dump(answer(sys.stdin.buffer.read(), given), sys.stdout.buffer)
