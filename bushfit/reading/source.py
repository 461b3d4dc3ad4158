"""Rows of a test file: lines of a text, rows of a worksheet, or samples of recorded channels."""

from __future__ import annotations

import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import Any, NamedTuple

from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.reading.files import CHUNK_BYTES, HEAD_BYTES
from bushfit.reading.layout import MOST_HEAD_LINES, Layout
from bushfit.reading.lines import LONGEST_LINE, Line, split
from bushfit.reading.numerals import APOSTROPHES, BLANKS
from bushfit.units import SIZES

#: Smallest positive value and largest magnitude of a number in a table [SI unit]; the largest allows for nanoseconds
#: since 1970.
LEAST_VALUE, LARGEST_VALUE = SIZES[0], 1e19
_LINE_END = re.compile(rb"\r\n|\n|\r")
#: Bytes, or rows, at the end of a file that are searched for notes; chosen: room for a paragraph.
_TAIL_BYTES, _TAIL_ROWS = 2048, 20
#: Largest text, in bytes, and sheet, in rows, that is searched for blocks without their own headers; chosen: both have
#: some 100,000 rows.
_MOST_BYTES, _MOST_ROWS = 1 << 22, 100_000
#: Bytes that occur in rows of numbers, which cannot begin a block.
_NUMERIC = b"0123456789.,+-eEdD \t\r\n"
#: Rows of channels that are converted at a time; chosen: they take a few MiB.
_CHUNK_ROWS = 1 << 14
#: Thousands separated by a blank.
_GROUP_BY_BLANK = re.compile(rb"\d \d{3}(?!\d)")


@dataclass(frozen=True, eq=False)
class Text:
    """Delimited text in UTF-8, or a chunk of its lines.

    Args:
        data: bytes of the text.
        encoding: original encoding of its file.
        before: number of lines of the file before the text.
    """

    data: bytes
    encoding: str | None
    before: int = 0
    sheet: None = None
    layout: None = None
    numeric: frozenset[int] = frozenset()
    hidden: tuple[int, ...] = ()
    divided: int = 0

    @cached_property
    def head(self) -> list[Line]:
        """First non-empty lines of the text, which can contain the header."""
        return list(islice(_non_empty_lines(io.BytesIO(self.data[:HEAD_BYTES]), self.before), MOST_HEAD_LINES))

    def lines(self, after: int) -> Iterator[Line]:
        """Yield the non-empty lines of the text below the line of the file with number `after`."""
        stream = io.BytesIO(self.data)
        stream.seek(self.offset(after))
        return _non_empty_lines(stream, max(after, self.before))

    def tail(self) -> Iterator[Line]:
        """Yield the last non-empty lines of the text, which can be notes."""
        start = self.data.rfind(b"\n", 0, max(len(self.data) - _TAIL_BYTES, 0)) + 1
        return _non_empty_lines(io.BytesIO(self.data[start:]), self.before + self.data.count(b"\n", 0, start))

    def offset(self, after: int) -> int:
        """Return the index of the first byte after the line of the file with number `after`."""
        ends = [0, *(end.end() for end in islice(_LINE_END.finditer(self.data), max(after - self.before, 0)))]
        return ends[-1] if len(ends) > after - self.before else len(self.data)

    def chunks(self, after: int) -> Iterator[Text]:
        """Yield the text below the line with number `after` in chunks of a few MiB."""
        start = self.offset(after)
        while start < len(self.data):
            end = self.data.find(b"\n", start + CHUNK_BYTES) + 1 or len(self.data)
            chunk = Text(self.data[start:end], self.encoding, after)
            yield chunk
            start, after = end, after + chunk.data.count(b"\n")

    def after(self, line: int) -> Text:
        """Return the text below the line of the file with number `line`."""
        return Text(self.data[self.offset(line) :], self.encoding, max(line, self.before))

    def is_one_block(self, layout: Layout) -> bool:
        """Return True if the bytes below the header rule out another table, or are too many to be searched for one."""
        end = self.offset(layout.lines_before_data)
        return len(self.data) > _MOST_BYTES or not self.data[end:].translate(None, _NUMERIC + layout.delimiter.encode())

    def repeats_header(self, layout: Layout) -> bool:
        """Return True if the line of the header occurs again."""
        header = self.data[self.offset(layout.header_line - 1) : self.offset(layout.header_line)].strip()
        return self.data.find(header, self.offset(layout.header_line)) >= 0

    def may_contain(self, sign: str, layout: Layout) -> bool:
        """Return True if cells below the header can contain a decimal mark or thousands separator."""
        start = self.offset(layout.lines_before_data)
        quoted = '"' if sign == layout.delimiter == "," else sign  # only a quoted cell can contain the delimiter
        marks = {" ": BLANKS[1:], "'": APOSTROPHES}.get(sign, quoted)
        is_grouped = sign == " " != layout.delimiter and _GROUP_BY_BLANK.search(self.data, start) is not None
        return is_grouped or any(self.data.find(mark.encode(), start) >= 0 for mark in marks)

    def first_words(self, delimiter: str) -> set[str]:
        """Return the distinct texts without digits in the first column, such as "Mean" of a summary row.

        Args:
            delimiter: character between cells.
        """
        mark = re.escape(delimiter).encode()
        first = re.compile(rb'\n[ \t"%b]*([^\d\r\n"%b]+)(?=["\r\n%b])' % (mark, mark, mark))
        return {word.decode("utf-8", "replace").strip() for word in set(first.findall(b"\n" + self.data))}

    def frame(self, layout: Layout, types: Mapping[int, Any], width: int, decimal: str) -> Any:
        """Read columns of a chunk with pandas.

        Args:
            layout: location of the table.
            types: pandas data type of each column to read, by index.
            width: number of columns of the table.
            decimal: decimal mark.

        Returns:
            Data frame with these columns; None if pandas cannot parse the chunk, or rows differ in length.

        Notes:
            pandas does not check the length of rows if some columns are skipped; the delimiters are counted instead. An
            unclosed quote swallows line ends. pandas rounds correctly from 3.1 on.
        """
        import pandas as pd

        mark, quoted = layout.delimiter, b'"' in self.data
        skips = len(types) < width and mark != " " and not quoted
        if not skips:
            types = {index: types.get(index, str) for index in range(width)}
        is_float = set(types.values()) == {float}
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)
                frame = pd.read_csv(
                    io.BytesIO(self.data),
                    sep=r"\s+" if mark == " " else mark,
                    header=None,
                    names=list(range(width)),
                    usecols=list(types) if skips else None,
                    index_col=False,
                    decimal=decimal,
                    dtype=float if is_float else dict(types),  # one type for all columns spares pandas a copy
                    na_filter=False,
                    compression=None,
                )
        except (ValueError, pd.errors.ParserWarning):
            return None
        has_lost_cells = skips and self.data.count(mark.encode()) != len(frame) * (width - 1)
        has_lost_rows = quoted and len(frame) != sum(1 for _ in self.lines(0))
        return None if has_lost_cells or has_lost_rows else frame


def _non_empty_lines(data: io.BytesIO, after: int) -> Iterator[Line]:
    """Non-empty lines of a stream whose first line has the number `after` + 1; closes the stream.

    Raises:
        MeasurementError: a line is far too long.
    """
    with io.TextIOWrapper(data, encoding="utf-8", errors="replace") as text:
        for number, line in enumerate(text, start=after + 1):
            if len(line) > LONGEST_LINE:
                found = f"a line of {len(line)} characters"
                raise MeasurementError("the table cannot be read", place=f"line {number}", found=found)
            if line.strip(" \t\r\n,;|^+-=:"):
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
        above: lines above the table, such as those above the first block, or properties of a recording.
        numbers: line number in the file of each row, if the rows were rearranged below the header; None for a sheet.
        hidden: numbers of the rows that the workbook hides.
        divided: number of cells that a number format shows divided by a power of 1000, as they are read.
        is_visible: False for a hidden sheet of a workbook.
    """

    sheet: str
    content: Sequence[Sequence[str | float]] = ()
    lacks_values: Callable[[], bool] = lambda: False
    encoding: None = None
    layout: Layout | None = None
    numeric: frozenset[int] = frozenset()
    above: Sequence[Line] = ()
    numbers: Sequence[int] | None = None
    hidden: Sequence[int] = ()
    divided: int = 0
    is_visible: bool = True

    def after(self, line: int) -> Sheet:
        """Return a copy of the sheet whose first rows, up to the one with number `line`, are empty."""
        return replace(self, content=[*[()] * line, *self.content[line:]])

    def is_one_block(self, _layout: Layout) -> bool:
        """Return True if the sheet is too long to be searched for other tables, or has channels instead of rows."""
        return not 0 < len(self.content) <= _MOST_ROWS

    def may_contain(self, _sign: str, _layout: Layout) -> bool:
        """Return True: cells of a sheet may contain any sign."""
        return True

    @cached_property
    def head(self) -> list[Line]:
        """Lines above the table, and the first non-empty rows, which can contain the header."""
        return [*self.above, *islice(self.lines(0), MOST_HEAD_LINES)]

    def tail(self) -> Iterator[Line]:
        """Yield the last non-empty rows of the sheet, which can be notes."""
        start = max(len(self.content) - _TAIL_ROWS, 0)
        numbers = self.numbers or range(1, len(self.content) + 1)
        return (Line(*row) for row in zip(numbers[start:], self.content[start:], strict=True) if any(row[1]))

    def lines(self, after: int) -> Iterator[Line]:
        """Yield the non-empty rows of the sheet below the row with number `after`; all rows of a rearranged table."""
        rows = enumerate(islice(self.content, after, None), start=after + 1)
        for number, cells in rows if self.numbers is None else zip(self.numbers, self.content, strict=True):
            if any(cell != "" for cell in cells):
                yield Line(number, cells)


@dataclass(frozen=True, eq=False)
class Channels(Sheet):
    """Recorded channels of equal length as the columns of a table; row numbers count samples from 1.

    Args:
        arrays: samples of each channel, (n,) each: floats, or objects that are texts.
        format: name of the file format, such as "TDMS".
    """

    arrays: Sequence[NDArray[Any]] = ()
    format: str = ""

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


def cells_of(line: Line, delimiter: str) -> Sequence[str | float]:
    """Return the cells of a line of text or row of a sheet; numbers of a sheet remain numbers."""
    return split(line.content, delimiter) if isinstance(line.content, str) else line.content
