"""The rows of a table in its file, and the errors that name a line and column of it."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from bushfit.errors import MeasurementError
from bushfit.reading.headers import Column
from bushfit.reading.layout import FileFormat, Layout
from bushfit.reading.source import RowSource, rows

#: Characters of what was found that an error quotes; chosen: two lines of a terminal.
_LONGEST_FOUND = 200


@dataclass(frozen=True, eq=False)
class Cells:
    """A table as its file has it: a header and rows of cells; `stated` is what the user states of its format."""

    file: Path
    source: RowSource
    layout: Layout
    stated: FileFormat

    @property
    def headers(self) -> tuple[str, ...]:
        """The cells of the header."""
        return self.layout.headers

    def rows(self) -> Iterator[tuple[int, Sequence[str | float]]]:
        """Line and cells of each row of data.

        Raises:
            MeasurementError: a line or a quoted cell that is far too long.
        """
        try:
            for line, cells in rows(self.source, self.layout):
                if any(cell != "" for cell in cells):
                    yield line, cells
        except csv.Error as error:
            raise self.error("the table cannot be read", found=str(error)) from error

    def error(
        self,
        problem: str,
        *,
        line: int | None = None,
        column: Column | None = None,
        found: str | None = None,
        kind: type[MeasurementError] = MeasurementError,
        **said: str | None,
    ) -> MeasurementError:
        """An error in this table, at a line (from 1) and column where they are known, with what else is `said`."""
        found = found if found is None or len(found) <= _LONGEST_FOUND else found[:_LONGEST_FOUND] + "..."
        return kind(problem, file=self.file, place=self.place(line, column), found=found, **said)

    def place(self, line: int | None, column: Column | None) -> str | None:
        """A place in the file in words: its sheet, line and column, as far as there are such."""
        sheet = self.source.sheet
        parts = [
            f'sheet "{sheet}"' if sheet else None,
            f"{'row' if sheet else 'line'} {line}" if line else None,
            f'column "{column.header}"' if column else None,
        ]
        return ", ".join(part for part in parts if part) or None
