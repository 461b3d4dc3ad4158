"""The parts of a file that may hold a table each: sheets of a workbook, or groups of channels of a recording.

python-calamine reads the sheets of xlsx, xlsb, xls and ods: exactly, and imported in a millisecond where openpyxl takes
170. It does so in a process of its own (`workbook_process`), because an archive of some kilobytes may hold sheets of
terabytes.
"""

import json
import marshal
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from bushfit.errors import BushfitError, MeasurementError, did_you_mean
from bushfit.reading import workbook_process
from bushfit.reading.files import view_bytes
from bushfit.reading.instruments import format_of, read_groups, word_for_part
from bushfit.reading.source import Sheet

#: Cells that all sheets which are read span together at most; chosen: a full sheet of ten columns.
_MOST_CELLS = 10_500_000
#: Memory that a workbook may take in its process [bytes]; chosen: what that many cells take, and half as much again.
_MOST_MEMORY = 2 << 30
#: Processor time that a workbook may take there [s]; chosen: what that many cells take, three times.
_MOST_SECONDS = 30
#: By how much longer it is waited for on a machine with much else to do.
_PATIENCE = 15
#: First bytes of a zip archive, which newer workbooks are, and of the older formats of Office.
_WORKBOOKS = (b"PK\x03\x04", b"\xd0\xcf\x11\xe0")
#: Parts that an error lists at most; chosen: a line or two.
_MOST_LISTED = 12
#: What to do about a test whose channels lie in several groups.
_ONE_GROUP = "a test needs its channels in one group, at one rate and of one length: resample those that differ"


def read_sheets(
    data: bytes, file: Path, name: str | None = None, kind: type[BushfitError] = MeasurementError
) -> tuple[Sequence[str], list[Sheet]]:
    """The names of all sheets of a workbook, and the sheet of a name, or else all visible ones, or all if none is.

    Raises:
        kind: no workbook, or one that takes more memory or time than a workbook may.
    """
    book = _known(data)
    wanted = book.get("shown") if name is None else [name]
    if wanted is None or not book["sheets"].keys() >= set(wanted):
        answer = _asked(data, file, kind, sheets=wanted, cells=book["left"])
        book.update(answer, sheets=book["sheets"] | answer["sheets"])
    return book["names"], [
        Sheet(
            title, book["sheets"][title], lambda: bool(_asked(data, file, MeasurementError, formulas=True)["formulas"])
        )
        for title in (book["shown"] if name is None else [name])
        if title in book["sheets"]
    ]


@lru_cache(maxsize=1)
def _known(_: bytes) -> dict[str, Any]:
    """What was read of the last workbook, to be added to: to look at one takes several passes."""
    return {"sheets": {}, "left": _MOST_CELLS}


def _asked(data: bytes, file: Path, kind: type[BushfitError], **order: object) -> Mapping[str, Any]:
    """The answer of `workbook_process` to an order about a workbook.

    Raises:
        kind: the workbook is broken, or takes more memory or time than a workbook may.
    """
    found = find_spec("python_calamine")
    packages = str(Path(found.origin).parents[1]) if found and found.origin else ""
    order |= {"memory": _MOST_MEMORY, "seconds": _MOST_SECONDS, "packages": packages}
    command = [sys.executable, "-I", "-S", workbook_process.__file__, json.dumps(order)]
    try:
        done = subprocess.run(command, input=data, capture_output=True, check=False, timeout=_PATIENCE * _MOST_SECONDS)
        status, answer = done.returncode, marshal.loads(done.stdout) if done.returncode == 0 else {}
    except subprocess.TimeoutExpired:
        status, answer = -getattr(signal, "SIGXCPU", 0), {}
    if "error" in answer:
        expected, hint = "a table as text, or a workbook: xlsx, xlsb, xls or ods", "save it again as xlsx, or as CSV"
        raise kind("the workbook cannot be read", file=file, found=answer["error"], expected=expected, hint=hint)
    if status or "too_many" in answer:
        slow = status == -getattr(signal, "SIGXCPU", 0)
        taken = f"more than {_MOST_SECONDS} s of work" if slow else f"more than {_MOST_MEMORY >> 30} GiB of memory"
        raise kind(
            "the workbook is too large",
            file=file,
            found=f'more, with sheet "{answer["too_many"]}"' if answer else taken,
            expected=f"at most {_MOST_CELLS} cells in the sheets that are read, empty ones between others counted",
            hint="save the sheet as CSV",
        )
    return answer


def parts_of(file: Path) -> Sequence[Sheet]:
    """The visible sheets of a workbook, or the groups of a recording; none where the file is a text.

    Raises:
        MeasurementError: a workbook or recording that cannot be read.
    """
    return _read(view_bytes(file, MeasurementError), file)[1]


def open_part(data: bytes, file: Path, name: str | None, is_usable: Callable[[Sheet], bool]) -> Sheet | None:
    """The part of a file that holds the table: the one that is stated by its name, or else the only usable one.

    None where the file is a text.

    Raises:
        MeasurementError: a workbook or recording that cannot be read, or that has no such or no single usable part.
    """
    names, found = _read(data, file, name)
    if not names:
        if name:
            expected = "a workbook, or a file with groups of channels"
            raise MeasurementError("this is no workbook", file=file, found=f'sheet = "{name}"', expected=expected)
        return None
    kind = word_for_part(file)
    if name is not None:
        if own := [part for part in found if part.sheet == name]:
            return own[0]
        raise MeasurementError(
            f"there is no such {kind}",
            file=file,
            found=f'"{name}"',
            expected=_listed(names),
            hint=did_you_mean(name, names),
        )
    usable = [part for part in found if is_usable(part)] if len(found) > 1 else found
    if len(usable) == 1:
        return usable[0]
    raise MeasurementError(
        f"more than one {kind} holds such a table" if usable else f"no {kind} holds such a table",
        file=file,
        found=_listed([part.sheet for part in usable or found]),
        expected="one",
        hint=_ONE_GROUP if kind == "group" and not usable else 'choose it in the campaign: sheet = "..."',
    )


def _read(data: bytes, file: Path, name: str | None = None) -> tuple[Sequence[str], Sequence[Sheet]]:
    """The names of all parts of a file, and the part of a name, or else all; none of a text."""
    if own := format_of(data, file):
        groups = read_groups(data, file, own)
        if isinstance(groups, MeasurementError):
            raise groups
        return [group.sheet for group in groups], groups
    return read_sheets(data, file, name) if data.startswith(_WORKBOOKS) else ((), ())


def _listed(names: Sequence[str]) -> str:
    return ", ".join(f'"{name}"' for name in names[:_MOST_LISTED]) + (", ..." if len(names) > _MOST_LISTED else "")
