"""The rows of a file: of a text in any encoding, or of a sheet of a workbook."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Protocol

import numpy as np

from bushfit.encoding import to_utf8
from bushfit.layout import HEAD, MOST_LINES, Layout, Line, is_comment, split
from bushfit.measurement import Floats
from bushfit.numerals import Numerals

_LINE_END = re.compile(rb"\r\n|\n|\r")
#: Signs that, inside a number, part thousands.
_SEPARATORS = ("'", "\u2019", "\u00a0", "\u2009", "\u202f")
_GROUP_BY_BLANK = re.compile(rb"\d \d{3}(?!\d)")


class Source(Protocol):
    """A file as rows of cells, with the line or row, from 1, that each stands on."""

    @property
    def encoding(self) -> str | None:
        """The encoding of a text."""

    @property
    def sheet(self) -> str | None:
        """The name of a sheet."""

    def head(self) -> list[Line]:
        """The filled lines at its start."""

    def lines(self, after: int) -> Iterator[Line]:
        """All filled lines after a line."""

    def may_have_comma(self, layout: Layout) -> bool:
        """Whether cells below the header may have a comma in them."""

    def may_group(self, layout: Layout, decimal: str) -> bool:
        """Whether numbers below the header may have thousands separators, when that is the decimal mark."""

    def columns(
        self, layout: Layout, width: int, wanted: Collection[int], numerals: Numerals
    ) -> dict[int, Floats] | None:
        """The numbers of columns by index, each (n,); None where the rows are not so tidy that a library reads them."""


@dataclass(frozen=True, eq=False)
class Text:
    """A text: its bytes in UTF-8, and the encoding they had."""

    data: bytes
    encoding: str | None
    sheet: str | None = None

    @classmethod
    def open(cls, data: bytes, file: Path, encoding: str | None) -> Text:
        """Decode a text.

        Raises:
            MeasurementError: no text, or not in the encoding stated.
        """
        return cls(*to_utf8(data, file, encoding))

    def head(self) -> list[Line]:
        """The filled lines at its start."""
        return list(islice(_lines(io.BytesIO(self.data[:HEAD]), 0), MOST_LINES))

    def lines(self, after: int) -> Iterator[Line]:
        """All filled lines after a line."""
        start = io.BytesIO(self.data)
        start.seek(self._offset(after))
        return _lines(start, after)

    def may_have_comma(self, layout: Layout) -> bool:
        """Whether cells below the header may have a comma in them."""
        return self._has('"' if layout.delimiter == "," else ",", self._offset(layout.lines_before_data))

    def may_group(self, layout: Layout, decimal: str) -> bool:
        """Whether numbers below the header may have thousands separators, when that is the decimal mark."""
        offset = self._offset(layout.lines_before_data)
        if self.may_have_comma(layout) if decimal == "." else self._has(".", offset):
            return True
        if any(self._has(sign, offset) for sign in _SEPARATORS):
            return True
        return layout.delimiter != " " and self._has(" ", offset) and bool(_GROUP_BY_BLANK.search(self.data, offset))

    def columns(
        self, layout: Layout, width: int, wanted: Collection[int], numerals: Numerals
    ) -> dict[int, Floats] | None:
        """The numbers of columns by index, each (n,); None where the rows are not so tidy that pandas reads them."""
        import pandas as pd

        body = io.BytesIO(self.data)
        body.seek(self._offset(layout.lines_before_data))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)
                frame = pd.read_csv(
                    body,
                    sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                    header=None,
                    names=list(range(width)),
                    index_col=False,
                    decimal=numerals.decimal,
                    dtype={index: np.float64 if index in wanted else str for index in range(width)},
                    na_filter=False,
                )
        except (ValueError, pd.errors.ParserWarning):
            return None
        return {index: frame[index].to_numpy() for index in wanted}

    def _has(self, sign: str, offset: int) -> bool:
        return self.data.find(sign.encode(), offset) >= 0

    def _offset(self, after: int) -> int:
        """Index of the first byte after a line of the head."""
        ends = [end.end() for end in islice(_LINE_END.finditer(self.data), after)]
        return 0 if after == 0 else ends[-1] if len(ends) == after else len(self.data)


def _lines(data: io.BytesIO, after: int) -> Iterator[Line]:
    for number, line in enumerate(io.TextIOWrapper(data, encoding="utf-8", errors="replace"), start=after + 1):
        if line.strip(" \t\r\n,;|"):
            yield Line(number, line.rstrip("\n"))


@dataclass(frozen=True, eq=False)
class Sheet:
    """A sheet of a workbook: its rows of texts and numbers, "" where a cell is empty."""

    sheet: str
    content: Sequence[Sequence[str | float]]
    encoding: None = None

    def head(self) -> list[Line]:
        """The filled rows at its start."""
        return list(islice(self.lines(0), MOST_LINES))

    def lines(self, after: int) -> Iterator[Line]:
        """All filled rows after a row."""
        for number, cells in enumerate(islice(self.content, after, None), start=after + 1):
            if any(cell != "" for cell in cells):
                yield Line(number, cells)

    def may_have_comma(self, _: Layout) -> bool:
        """Whether cells may be texts with commas."""
        return True

    def may_group(self, _: Layout, __: str) -> bool:
        """Whether cells may be texts with thousands separators."""
        return True

    def columns(self, *_: object) -> None:
        """Cells are told apart already."""


def rows(source: Source, layout: Layout) -> Iterator[tuple[int, Sequence[str | float]]]:
    """Line and cells of each row of data, comments left out.

    Raises:
        csv.Error: a quoted cell beyond all measure.
    """
    for line in source.lines(layout.lines_before_data):
        if not is_comment(line.content, layout.delimiter):
            yield line.number, split(line.content, layout.delimiter) if isinstance(line.content, str) else line.content
