"""The rows of a test file: of a text in any encoding, of a sheet of a workbook, or of a group of recorded channels."""

from __future__ import annotations

import csv
import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.files import HEAD_BYTES
from bushfit.reading.layout import MOST_HEAD_LINES, Layout, Line, is_comment, split
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import Numerals
from bushfit.units import SIZES

if TYPE_CHECKING:
    import pandas as pd

#: [SI] The least size of what is above zero or changes, and the largest value of a cell: beyond every rig.
LEAST_VALUE, LARGEST_VALUE = SIZES
_LINE_END = re.compile(rb"\r\n|\n|\r")
#: Signs that part thousands in a number, other than those which may part columns or decimals.
_SEPARATORS = ("'", "\u2019", "\u00a0", "\u2009", "\u202f")
#: Rows of channels that are made at a time; chosen: they fill some MiB.
_CHUNK_ROWS = 1 << 14
#: Thousands that are parted by a blank.
_GROUP_BY_BLANK = re.compile(rb"\d \d{3}(?!\d)")


@dataclass(frozen=True, eq=False)
class Text:
    """A text as rows of cells, with the line, from 1, that each stands on; `data` is UTF-8."""

    data: bytes
    encoding: str | None
    sheet: None = None
    layout: None = None
    numeric: frozenset[int] = frozenset()

    def head(self) -> list[Line]:
        """The filled lines at its start."""
        return list(islice(_lines(io.BytesIO(self.data[:HEAD_BYTES]), 0), MOST_HEAD_LINES))

    def lines(self, after: int) -> Iterator[Line]:
        """All filled lines after a line."""
        stream = io.BytesIO(self.data)
        stream.seek(self._offset(after))
        return _lines(stream, after)

    def may_have_comma(self, layout: Layout) -> bool:
        """Whether cells below the header may have a comma in them."""
        return self._has('"' if layout.delimiter == "," else ",", layout)

    def may_group(self, layout: Layout, decimal: str) -> bool:
        """Whether numbers below the header may have thousands separators, if `decimal` is their decimal mark."""
        signs = _SEPARATORS if decimal == "." else (*_SEPARATORS, ".")
        if any(self._has(sign, layout) for sign in signs) or (decimal == "." and self.may_have_comma(layout)):
            return True
        has_blanks = layout.delimiter != " " and self._has(" ", layout)
        return has_blanks and bool(_GROUP_BY_BLANK.search(self.data, self._offset(layout.lines_before_data)))

    def columns(
        self, layout: Layout, width: int, scales: Mapping[int, float], numerals: Numerals
    ) -> dict[int, Floats] | None:
        """The values of columns in SI by their index, (n,) each, if the rows are so tidy that pandas reads them.

        `scales` has factors to SI by index, `width` is the cells of a row. None where the rows are not tidy, or where a
        cell holds no number, or one beyond LARGEST_VALUE.
        """
        frame = self._frame(layout, width, set(scales), numerals)
        if frame is None:
            return None
        columns = {index: frame[index].to_numpy() for index in scales}
        for index, column in columns.items():
            largest = LARGEST_VALUE / abs(scales[index])
            if not (column.min(initial=0.0) >= -largest and column.max(initial=0.0) <= largest):
                return None
            column.flags.writeable = True  # the frame is nobody else's
            column *= scales[index]
        return columns

    def _frame(self, layout: Layout, width: int, numbers: Set[int], numerals: Numerals) -> pd.DataFrame | None:
        """The rows as pandas reads them, the columns `numbers` as floats; None where it does not read them.

        pandas rounds correctly from 3.1 on.
        """
        import pandas as pd

        rest = io.BytesIO(self.data)
        rest.seek(self._offset(layout.lines_before_data))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", pd.errors.ParserWarning)
                frame = pd.read_csv(
                    rest,
                    sep=r"\s+" if layout.delimiter == " " else layout.delimiter,
                    header=None,
                    names=list(range(width)),
                    index_col=False,
                    decimal=numerals.decimal,
                    # one type for all columns spares pandas a copy
                    dtype=float if len(numbers) == width else {i: float if i in numbers else str for i in range(width)},
                    na_filter=False,
                    compression=None,
                )
        except (ValueError, pd.errors.ParserWarning):
            return None
        if self._has('"', layout) and len(frame) != sum(1 for _ in self.lines(layout.lines_before_data)):
            return None  # a quote left open took lines into its cell
        return frame

    def _has(self, sign: str, layout: Layout) -> bool:
        """Whether a sign stands anywhere below the header."""
        return self.data.find(sign.encode(), self._offset(layout.lines_before_data)) >= 0

    def _offset(self, after: int) -> int:
        """Index of the first byte after a line of the head."""
        ends = [0, *(end.end() for end in islice(_LINE_END.finditer(self.data), after))]
        return ends[after] if len(ends) > after else len(self.data)


def _lines(data: io.BytesIO, after: int) -> Iterator[Line]:
    """The filled lines of a stream that begins after a line of the file; the stream is closed."""
    with io.TextIOWrapper(data, encoding="utf-8", errors="replace") as text:
        for number, line in enumerate(text, start=after + 1):
            if line.strip(" \t\r\n,;|"):
                yield Line(number, line.rstrip("\n"))


@dataclass(frozen=True, eq=False)
class Sheet:
    """A sheet of a workbook as rows of texts and numbers, "" where a cell is empty.

    `lacks_values` tells whether the workbook has formulas whose values were not saved, which are empty cells, too;
    `layout` where its table lies, and `numeric` which columns hold numbers alone, where that need not be found.
    """

    sheet: str
    content: Sequence[Sequence[str | float]] = ()
    lacks_values: Callable[[], bool] = lambda: False
    encoding: None = None
    layout: Layout | None = None
    numeric: frozenset[int] = frozenset()

    def head(self) -> list[Line]:
        """The filled rows at its start."""
        return list(islice(self.lines(0), MOST_HEAD_LINES))

    def lines(self, after: int) -> Iterator[Line]:
        """All filled rows after a row."""
        for number, cells in enumerate(islice(self.content, after, None), start=after + 1):
            if any(cell != "" for cell in cells):
                yield Line(number, cells)


@dataclass(frozen=True, eq=False)
class Channels(Sheet):
    """A group of recorded channels of one length as rows of cells, which count from 1 below the `layout`.

    `arrays` are their values, (n,) each, floats or texts as objects; `above` is what the file says of all of them.
    """

    arrays: Sequence[NDArray[Any]] = ()
    above: Sequence[Line] = ()
    format: str = ""

    def head(self) -> list[Line]:
        """What is said of the channels, and the first rows."""
        return [*self.above, *islice(self.lines(0), MOST_HEAD_LINES)]

    def lines(self, after: int) -> Iterator[Line]:
        """All rows after a row."""
        for start in range(after, len(self.arrays[0]), _CHUNK_ROWS):
            chunk = zip(*(values[start : start + _CHUNK_ROWS].tolist() for values in self.arrays), strict=True)
            yield from (Line(number, cells) for number, cells in enumerate(chunk, start=start + 1))

    def values(self, scales: Mapping[int, float]) -> dict[int, Floats] | None:
        """The values of channels in SI by their index, (n,) each; None where a cell holds no number that a rig records.

        `scales` has factors to SI by index.
        """
        if not self.numeric >= set(scales):
            return None
        found = {index: self.arrays[index] * scale for index, scale in scales.items()}
        return found if all(np.all(np.abs(values) <= LARGEST_VALUE) for values in found.values()) else None


#: The rows of a test file.
RowSource = Text | Sheet


def rows(source: RowSource, layout: Layout) -> Iterator[tuple[int, Sequence[str | float]]]:
    """Line and cells of each row of data; comments are left out.

    Raises:
        csv.Error: a line or a quoted cell that is far too long.
    """
    for number, content in source.lines(layout.lines_before_data):
        if layout.numbered or not is_comment(content, layout.delimiter):
            try:
                yield number, split(content, layout.delimiter) if isinstance(content, str) else content
            except csv.Error as error:
                raise csv.Error(f"{error}, line {number}") from error
