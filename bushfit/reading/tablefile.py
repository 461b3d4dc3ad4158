"""Tables as files, in the form that their reader wants: CSV, CSV with decimal commas, or a workbook."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import pandas as pd

#: Commas and decimal points; semicolons and decimal commas; a workbook.
Form = Literal["csv", "decimal-comma", "xlsx"]
#: Cells of a row.
Row = Iterable[str | float | None]


def ending(form: Form) -> str:
    """The ending of such a file."""
    return "xlsx" if form == "xlsx" else "csv"


def to_bytes(name: str, table: pd.DataFrame, form: Form) -> bytes:
    """The bytes of a table's file; a workbook has one sheet, of that name.

    Raises:
        OutputError: a table that is too large for a sheet.
    """
    from bushfit.reading.csvfile import to_csv
    from bushfit.reading.xlsxfile import to_xlsx

    return to_xlsx({name: table}) if form == "xlsx" else to_csv(table, decimal_comma=form == "decimal-comma")


@contextmanager
def opened(file: Path, form: Form, headers: Iterable[str]) -> Iterator[Callable[[Row], None]]:
    """Give what writes a row of a new file as it comes; in the end the file is whole and on the disk.

    Raises:
        OutputError: more rows than a sheet has.
    """
    from bushfit.reading.csvfile import Rows, encoding
    from bushfit.reading.xlsxfile import streamed

    if form == "xlsx":
        with streamed(file, headers) as sheet:
            yield sheet.add
    else:
        decimal_comma = form == "decimal-comma"
        with file.open("w", encoding=encoding(decimal_comma), errors="replace", newline="") as stream:
            yield Rows(stream, headers, decimal_comma=decimal_comma).add
    with file.open("rb") as written:
        os.fsync(written.fileno())
