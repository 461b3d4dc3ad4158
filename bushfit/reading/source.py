"""Rows of a test file: lines of a text, rows of a worksheet, or samples of recorded channels."""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.files import HEAD_BYTES
from bushfit.reading.layout import MOST_HEAD_LINES, Layout, Line, is_comment, split
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import Numerals
from bushfit.units import SIZES

#: Smallest positive value and largest magnitude of a number in a table [SI unit].
LEAST_VALUE, LARGEST_VALUE = SIZES
_LINE_END = re.compile(rb"\r\n|\n|\r")
#: Thousands separators that cannot also be delimiters or decimal marks.
_SEPARATORS = ("'", "\u2019", "\u00a0", "\u2009", "\u202f")
#: Rows of channels that are converted at a time; chosen: they take a few MiB.
_CHUNK_ROWS = 1 << 14
#: Thousands separated by a blank.
_GROUP_BY_BLANK = re.compile(rb"\d \d{3}(?!\d)")


@dataclass(frozen=True, eq=False)
class Text:
    """Delimited text in UTF-8, with the original encoding of its file; parsed columns are cached."""

    data: bytes
    encoding: str | None
    sheet: None = None
    layout: None = None
    numeric: frozenset[int] = frozenset()
    _parsed: dict[tuple[Any, ...], Any] = field(default_factory=dict, repr=False)

    def head(self) -> list[Line]:
        """Return the first non-empty lines of the text, which can contain the header."""
        return list(islice(_lines(io.BytesIO(self.data[:HEAD_BYTES]), 0), MOST_HEAD_LINES))

    def lines(self, after: int) -> Iterator[Line]:
        """Yield the non-empty lines of the text below the line with number `after`."""
        stream = io.BytesIO(self.data)
        stream.seek(self.offset(after))
        return _lines(stream, after)

    def offset(self, after: int) -> int:
        """Return the index of the first byte after line number `after`."""
        ends = [0, *(end.end() for end in islice(_LINE_END.finditer(self.data), after))]
        return ends[after] if len(ends) > after else len(self.data)

    def has(self, sign: str, layout: Layout) -> bool:
        """Return True if the text below the header contains the character `sign`."""
        start = self.offset(layout.lines_before_data)
        if (start, sign) not in self._parsed:
            self._parsed[start, sign] = self.data.find(sign.encode(), start) >= 0
        return bool(self._parsed[start, sign])

    def may_have_comma(self, layout: Layout) -> bool:
        """Return True if cells below the header can contain a comma."""
        return self.has('"' if layout.delimiter == "," else ",", layout)

    def may_have_thousands_separators(self, layout: Layout, decimal: str) -> bool:
        """Return True if numbers below the header can have thousands separators, given their decimal mark."""
        signs = _SEPARATORS if decimal == "." else (*_SEPARATORS, ".")
        if any(self.has(sign, layout) for sign in signs) or (decimal == "." and self.may_have_comma(layout)):
            return True
        has_blanks = layout.delimiter != " " and self.has(" ", layout)
        return has_blanks and bool(_GROUP_BY_BLANK.search(self.data, self.offset(layout.lines_before_data)))

    def columns(
        self, layout: Layout, first: Sequence[str], indices: frozenset[int], numerals: Numerals
    ) -> dict[int, Floats] | None:
        """Read columns of numbers with pandas.

        Args:
            layout: location of the table.
            first: cells of the first row of data.
            indices: indices of the columns to read, from 0.
            numerals: notation of the numbers.

        Returns:
            Numbers as in the file by column index, (n,) each; None if rows differ in length or a cell is not a number.

        Notes:
            All columns that begin with a number are parsed as numbers: a summary row such as "Mean" then fails, as it
            must. pandas does not check the length of rows if some columns are skipped; the delimiters are counted
            instead. pandas rounds correctly from 3.1 on.
        """
        width, start = len(first), self.offset(layout.lines_before_data)
        numbers = [index for index in range(width) if index in indices or numerals.allows(first[index])]
        key = (start, layout.delimiter, numerals.decimal, *numbers)
        if key not in self._parsed:
            has_quotes = self.has('"', layout)
            skips = len(numbers) < width and layout.delimiter != " " and not has_quotes
            types: Any = float if len(numbers) == width else {i: float if i in numbers else str for i in range(width)}
            frame = self._frame(layout, width, numbers if skips else None, types, numerals.decimal)
            if frame is not None and has_quotes:  # an unclosed quote swallows line ends
                frame = frame if len(frame) == sum(1 for _ in self.lines(layout.lines_before_data)) else None
            self._parsed[key] = frame
        frame = self._parsed[key]
        return None if frame is None else {index: frame[index].to_numpy() for index in indices}

    def texts(self, layout: Layout, indices: Sequence[int]) -> dict[int, tuple[list[str], NDArray[np.intp]]] | None:
        """Read columns of texts: by column index, the distinct texts, and the index of each row's text in them, (n,).

        Returns None if rows differ in length, or cells may contain delimiters.
        """
        if layout.delimiter == " " or self.has('"', layout):
            return None
        key = (self.offset(layout.lines_before_data), layout.delimiter, "texts", *indices)
        if key not in self._parsed:
            self._parsed[key] = self._frame(layout, len(layout.headers), list(indices), "category", ".")
        frame = self._parsed[key]
        if frame is None:
            return None
        return {n: (list(frame[n].cat.categories), frame[n].cat.codes.to_numpy().astype(np.intp)) for n in indices}

    def _frame(self, layout: Layout, width: int, used: list[int] | None, types: Any, decimal: str) -> Any:
        """Data frame of some columns; None if pandas cannot parse the text.

        Args:
            layout: location of the table.
            width: number of columns of the table.
            used: indices of the columns to read; None for all.
            types: data types of the columns, as pandas takes them.
            decimal: decimal mark.
        """
        import pandas as pd

        start, mark = self.offset(layout.lines_before_data), layout.delimiter
        stream = io.BytesIO(self.data)
        stream.seek(start)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)
                frame = pd.read_csv(
                    stream,
                    sep=r"\s+" if mark == " " else mark,
                    header=None,
                    names=list(range(width)),
                    usecols=used,
                    index_col=False,
                    decimal=decimal,
                    dtype=types,  # one type for all columns spares pandas a copy
                    na_filter=False,
                    compression=None,
                )
        except (ValueError, pd.errors.ParserWarning):
            return None
        is_skipping = used is not None and self.data.count(mark.encode(), start) != len(frame) * (width - 1)
        return None if is_skipping else frame

    def suspicious(self, layout: Layout, largest_share: float) -> list[tuple[int, int, int]] | None:
        """Find lines below the header with letters, dashes or an empty cell, which may not be rows of data.

        Returns line number, first byte and end of each; None if they are more than a share of all lines.
        """
        mark = re.escape(layout.delimiter.encode())
        pattern = re.compile(
            rb"[A-DF-Za-df-z#]|--" + (rb"|%s\s*%s|%s[ \t]*\r?\n" % (mark, mark, mark) if mark.strip() else b"")
        )
        place = counted = self.offset(layout.lines_before_data)
        number, lines = layout.lines_before_data + 1, list[tuple[int, int, int]]()
        limit = largest_share * self.data.count(b"\n", place) + 20
        while (match := pattern.search(self.data, place)) and len(lines) <= limit:
            start = self.data.rfind(b"\n", 0, match.start()) + 1
            end = self.data.find(b"\n", match.start())
            end = len(self.data) if end < 0 else end
            number += self.data.count(b"\n", counted, start)
            counted, place = start, end
            lines.append((number, start, end))
        return lines if len(lines) <= limit else None


def _lines(data: io.BytesIO, after: int) -> Iterator[Line]:
    """Non-empty lines of a stream whose first line has the number `after` + 1; closes the stream."""
    with io.TextIOWrapper(data, encoding="utf-8", errors="replace") as text:
        for number, line in enumerate(text, start=after + 1):
            if line.strip(" \t\r\n,;|^"):
                yield Line(number, line.rstrip("\n"))


@dataclass(frozen=True, eq=False)
class Sheet:
    """Worksheet of a workbook, or another table in memory.

    Args:
        sheet: name of the worksheet, or title of the table.
        content: texts and numbers of the cells of each row; "" for an empty cell.
        lacks_values: function that returns True if the workbook has formulas without saved values.
        encoding: always None; only texts have an encoding.
        layout: header and units, if the file format defines them; None if they have to be found.
        numeric: indices of columns that contain only numbers.
    """

    sheet: str
    content: Sequence[Sequence[str | float]] = ()
    lacks_values: Callable[[], bool] = lambda: False
    encoding: None = None
    layout: Layout | None = None
    numeric: frozenset[int] = frozenset()

    def head(self) -> list[Line]:
        """Return the first non-empty rows of the sheet, which can contain the header."""
        return list(islice(self.lines(0), MOST_HEAD_LINES))

    def lines(self, after: int) -> Iterator[Line]:
        """Yield the non-empty rows of the sheet below the row with number `after`."""
        for number, cells in enumerate(islice(self.content, after, None), start=after + 1):
            if any(cell != "" for cell in cells):
                yield Line(number, cells)


@dataclass(frozen=True, eq=False)
class Combined(Sheet):
    """Table that was rearranged from blocks of a sheet or text.

    Args:
        numbers: original line number of each row.
        above: lines above the first block.
    """

    numbers: Sequence[int] = ()
    above: Sequence[Line] = ()

    def head(self) -> list[Line]:
        """Return the lines above the first block, and the first rows, which can contain the header."""
        return [*self.above, *islice(self.lines(0), MOST_HEAD_LINES)]

    def lines(self, after: int) -> Iterator[Line]:  # noqa: ARG002
        """Yield all rows, with their original line numbers; `after` is ignored: all rows are below the header."""
        return (Line(number, cells) for number, cells in zip(self.numbers, self.content, strict=True))


@dataclass(frozen=True, eq=False)
class Channels(Sheet):
    """Recorded channels of equal length as the columns of a table; row numbers count samples from 1.

    Args:
        arrays: samples of each channel, (n,) each: floats, or objects that are texts.
        above: properties of the recording, as lines above the table.
        format: name of the file format, such as "TDMS".
    """

    arrays: Sequence[NDArray[Any]] = ()
    above: Sequence[Line] = ()
    format: str = ""

    def head(self) -> list[Line]:
        """Return the properties of the recording as lines, and the first samples as rows."""
        return [*self.above, *islice(self.lines(0), MOST_HEAD_LINES)]

    def lines(self, after: int) -> Iterator[Line]:
        """Yield the samples of all channels as rows, after row number `after`."""
        for start in range(after, len(self.arrays[0]), _CHUNK_ROWS):
            chunk = zip(*(values[start : start + _CHUNK_ROWS].tolist() for values in self.arrays), strict=True)
            yield from (Line(number, cells) for number, cells in enumerate(chunk, start=start + 1))


class Channel(NamedTuple):
    """Recorded channel: samples, (n,), their unit or "", and the base channel, such as time; None if there is none."""

    name: str
    values: NDArray[Any]
    unit: str = ""
    over: Channel | None = None


#: Channels that a file stores together: name of the group, channels, and properties, (name, value) or (line,) each.
Group = tuple[str, list[Channel], Sequence[tuple[Any, ...]]]


#: Part of a file that can contain a table.
RowSource = Text | Sheet


def rows(source: RowSource, layout: Layout) -> Iterator[tuple[int, Sequence[str | float]]]:
    """Yield the line number and the cells of each line below the header, without comments.

    Raises:
        csv.Error: a line or a quoted cell is far too long.
    """
    for line in source.lines(layout.lines_before_data):
        if layout.numbered or not is_comment(line.content, layout.delimiter):
            yield line.number, cells_of(line, layout)


def cells_of(line: Line, layout: Layout) -> Sequence[str | float]:
    """Return the cells of a line of text or row of a sheet; numbers of a sheet remain numbers.

    Raises:
        csv.Error: the line or a quoted cell is far too long; the message has the line number.
    """
    try:
        return split(line.content, layout.delimiter) if isinstance(line.content, str) else line.content
    except csv.Error as error:
        raise csv.Error(f"{error}, line {line.number}") from error
