"""Reshape tables without a column for each quantity into long tables.

A quantity may have a row of its own ("f [Hz]; 1; 2; 5"), rows that name it in a column ("5 Hz; K*; 600; N/mm"), a block
of its own below those of other quantities, or its name beside each number ("f=5 Hz K*=600 N/mm").
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from itertools import islice, zip_longest
from typing import NamedTuple

import numpy as np

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.errors import MeasurementError
from bushfit.reading.blocks import find_segments
from bushfit.reading.headers import ERRORS, VERSUS, WORDS, Vocabulary, plain
from bushfit.reading.layout import Layout
from bushfit.reading.lines import WITH_UNIT, Line, is_row, is_units_row
from bushfit.reading.measurement import FEWEST_LOOP_ROWS
from bushfit.reading.names import name_and_values
from bushfit.reading.numerals import is_like_number, plainest_value
from bushfit.reading.roles import UNIT_NAMES, is_test
from bushfit.reading.source import Channels, RowSource, Sheet, cells_of

#: Level of an amplitude in the name of a quantity: "K* 0.1 mm [N/mm]".
_LEVEL = re.compile(r"(?<![\w.,])\d+(?:[.,]\d+)?\s?(?:[^\W\d]{1,3}|%)(?![^\W_])")
#: Names of a column with the values of several quantities, which another column names.
_VALUES = frozenset(map(plain, WORDS["rows_of"]["values"]))
#: Name, number and unit, if any, in a line of a log: "f=5.00 Hz".
_PAIR = re.compile(
    r"(?<![^\s,;(\[])([^\W\d][^\s=,;]{0,60})\s?=\s?"
    r"([+-]?\d(?:[\d.,eE+-]*\d)?(?:\s?[^\s\d=,;][^\s=,;]*(?![^\s,;]))?)"
)
#: Relative difference up to which two curves of a picture have the same x; chosen: clicks are less exact than tables.
_SAME_X = 0.03
#: First rows that show whether a column names quantities; chosen: more than a test has channels.
_FIRST_ROWS = 50


class KeyedValue(NamedTuple):
    """Value of a named quantity in a row with some keys, such as a frequency, at a line of the file."""

    number: int
    keys: tuple[str | float, ...]
    name: str
    cell: str | float


def reshape_table(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> Sheet | None:
    """Reshape a table without a column for each quantity, such as one with a row for each, into one with columns.

    Args:
        source: lines or rows of the file.
        layout: layout of the file if it is read as a table with a column for each quantity.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Sheet with a column for each quantity, below the lines above the table; None if the table has one already.
    """
    if isinstance(source, Channels) or not layout.headers or layout.headerless:
        return None
    return (
        _spread_pairs(source, vocabulary)
        or _name_curves(source, layout)
        or _exchange_rows(source, layout, vocabulary)
        or _spread_names(source, layout, vocabulary)
        or _join_blocks(source, layout, vocabulary)
    )


def _spread_pairs(source: RowSource, vocabulary: Vocabulary) -> Sheet | None:
    """Make a table of results with their names, on one line ("f=5.0 Hz A=0.1 mm") or on one line each ("f: 5 Hz").

    A name that occurs again begins the next row.
    """
    head = [_named_numbers(line) for line in source.head]
    names = list(dict.fromkeys(name for pairs in head for name, _ in pairs))
    if 2 * sum(map(bool, head)) < len(head) or not is_test(vocabulary.roles(names)):
        return None
    above, rows = list[Sequence[str]](), list[dict[str, str]]()
    for line in source.lines(0):
        pairs = _named_numbers(line)
        above += [] if pairs or rows else [[line.text]]
        for name, text in pairs:
            if not rows or name in rows[-1]:
                rows.append({})
            rows[-1][name] = text
    return Sheet(source.sheet or "", [*above, names, *([row.get(name, "") for name in names] for row in rows)])


def _named_numbers(line: Line) -> list[tuple[str, str]]:
    """Name and number, with its unit if any, of each result in a line."""
    if len(pairs := _PAIR.findall(line.text)) > 1:
        return pairs
    name, *values = name_and_values(line) or [""]
    text = " ".join(values[:2])
    is_number = WITH_UNIT.fullmatch(text) or (len(values) == 1 and is_like_number(text))
    return [(name, text)] * bool(name[:1].isalpha() and is_number)


def _name_curves(source: RowSource, layout: Layout) -> Sheet | None:
    """Name the curves of a digitized picture, whose names stand above their columns X and Y, and keep one column X.

    Curves with x values of their own are interpolated linearly over ln x, at those of the first curve within the range
    of all.

    Raises:
        MeasurementError: the curves have different x values, which do not increase from a value above zero.
    """
    names, axes = ([*map(str, cells_of(line, layout.delimiter)), ""] for line in (*source.head, *source.head)[:2])
    starts = [n for n, axis in enumerate(axes) if plain(axis) == "x"]
    if len(starts) < 2 or [plain(axis) for axis in axes if axis] != ["x", "y"] * len(starts):
        return None
    of_x, names = VERSUS.search(names[0]), ["", *(names[n] for n in starts)]
    rows = [[*map(str, cells_of(line, layout.delimiter)), *axes] for line in source.lines(source.head[1].number)]
    if rows and is_units_row(rows[0][: len(axes) - 1]):
        row_of_units = [rows[0][n] for n in (starts[0], *(n + 1 for n in starts))]
        names = [f"{name} [{unit}]" for name, unit in zip(names, row_of_units, strict=True)]
        del rows[0]
    names[0] = f"{of_x['x'] if of_x and of_x['x'] else 'X'}{names[0]}"
    cells = [[row[n : n + 2] for row in rows if plain(row[n]) not in ("", "x")] for n in starts]
    curves = [np.array([[plainest_value(cell) for cell in pair] for pair in pairs]).reshape(-1, 2).T for pairs in cells]
    x, notes = curves[0][0], tuple[Caveat, ...]()
    if not all(len(curve[0]) == len(x) and np.allclose(curve[0], x, rtol=_SAME_X) for curve in curves):
        if not all(curve.size and curve[0, 0] > 0.0 and (np.diff(curve[0]) > 0.0).all() for curve in curves):
            raise MeasurementError(**ERRORS["other_x"], found=", ".join(names[1:]))
        low, high = max(curve[0, 0] for curve in curves), min(curve[0, -1] for curve in curves)
        x = x[(x > (1.0 - _SAME_X) * low) & (x < (1.0 + _SAME_X) * high)]
        curves = [np.array([x, np.interp(np.log(x), np.log(curve[0]), curve[1])]) for curve in curves]
        sentence = f'the curves have x values of their own: they are interpolated at those of "{names[1]}"'
        notes = (Caveat("resampled", sentence),)
    rows_of_curves = np.column_stack([x, *(curve[1] for curve in curves)]).tolist()
    layout = Layout(layout.delimiter, tuple(names), 1, ("",) * len(names), None, notes=notes)
    return Sheet("", [names, *rows_of_curves], layout=layout)


def _spread_names(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> Sheet | None:
    """Reshape a table in which one column names the quantity of each row, and another contains its value.

    A third column may contain the units.
    """
    plain_headers = list(map(plain, layout.headers))
    values = next((n for n, header in enumerate(plain_headers) if header in _VALUES), None)
    unit = next((n for n, header in enumerate(plain_headers) if header in UNIT_NAMES), None)
    if values is None:
        return None
    lines = source.lines(layout.lines_before_data)
    first = [list(map(str, cells_of(line, layout.delimiter))) for line in islice(lines, _FIRST_ROWS)]
    columns = [{row[n] for row in first if n < len(row)} for n in range(len(layout.headers))]
    names = [
        n for n, texts in enumerate(columns) if n not in (values, unit) and all(map(vocabulary.heading, texts or [""]))
    ]
    if not names:
        return None
    name_column, width = max(names, key=lambda n: len(columns[n])), len(layout.headers)
    keys = [n for n in range(width) if n not in (name_column, values, unit)]
    rows = list[KeyedValue]()
    for line in source.lines(layout.lines_before_data):
        cells = [*cells_of(line, layout.delimiter), *[""] * width]
        name = str(cells[name_column])
        name += f" [{cells[unit]}]" if unit is not None and cells[unit] else ""
        rows.append(KeyedValue(line.number, tuple(cells[n] for n in keys), name, cells[values]))
    several = len({row.name for row in rows}) > 1
    return spread(source, layout, [layout.headers[n] for n in keys], rows) if several else None


def _join_blocks(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> Sheet | None:
    """Join blocks one below the other that have all columns but the last in common, such as the time."""
    roles, width = vocabulary.roles(layout.headers), len(layout.headers)
    if len(roles) < max(2, width - 1) or is_test(roles):
        return None
    headers, rows = list[Sequence[str]]([layout.headers]), list[KeyedValue]()
    for line in source.lines(layout.lines_before_data):
        cells = cells_of(line, layout.delimiter)
        texts = tuple(map(str, cells))
        if len(texts) == width and is_row(texts):
            rows.append(KeyedValue(line.number, tuple(cells[:-1]), headers[-1][-1], cells[-1]))
        elif len(texts) == width and texts[:-1] == layout.headers[:-1] and texts not in headers:
            headers.append(texts)
    return spread(source, layout, layout.headers[:-1], rows) if len(headers) > 1 else None


def spread(source: RowSource, layout: Layout, keys: Sequence[str], values: Sequence[KeyedValue]) -> Sheet:
    """Make one row of the values with equal keys, with a column for each quantity that they name.

    Args:
        source: lines or rows of the file.
        layout: layout of the file, with the line of the header.
        keys: headers of the columns with the keys, such as the frequency.
        values: values in the order of the file.

    Returns:
        Sheet with its layout and the lines above the header, whose rows are in the order of their first values; a
        quantity that occurs again with equal keys begins a further row.
    """
    names = list(dict.fromkeys(value.name for value in values))
    rows = dict[tuple[Sequence[str | float], int], tuple[int, list[str | float]]]()
    counts = Counter[tuple[Sequence[str | float], str]]()
    for number, key, name, cell in values:
        counts[key, name] += 1
        _, row = rows.setdefault((key, counts[key, name]), (number, [*key, *[""] * len(names)]))
        row[len(key) + names.index(name)] = cell
    numbers, content = zip(*rows.values(), strict=True)
    above = [line for line in source.head if line.number < layout.header_line]
    columns = (*keys, *names), layout.header_line, ("",) * (len(keys) + len(names)), None
    layout = Layout(layout.delimiter, *columns, layout.written, notes=layout.notes)
    return Sheet(source.sheet or "", content, numbers=numbers, above=above, layout=layout)


def _exchange_rows(source: RowSource, layout: Layout, vocabulary: Vocabulary) -> Sheet | None:
    """Exchange rows and columns of tables with a row for each quantity, such as "f [Hz]; 1; 2; 5" or "f; Hz; 1; 2; 5".

    Args:
        source: lines or rows of the file.
        layout: layout of the file if it is read as a table with a column for each quantity.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Sheet with the exchanged tables, below the lines above each; None if there is no such table.
    """
    if is_test(vocabulary.roles(layout.headers)):
        return None
    lines = [Line(line.number, list(map(str, cells_of(line, layout.delimiter)))) for line in source.head]
    names = [next(filter(None, map(str, line.content)), "") for line in lines]
    if len(vocabulary.roles([_LEVEL.sub("", name) for name in names if not is_like_number(name)])) < 2:
        return None

    def count_texts(line: Line) -> int | None:
        """Number of texts before the numbers of a row such as "f; Hz; 1; 2; 5" (2); None for any other line."""
        first = next((index for index, cell in enumerate(line.content) if is_like_number(str(cell))), 0)
        numbers = [str(cell) for cell in line.content[first:] if cell != ""]
        is_named = any(line.content[:first]) and len(line.content) - first > 2 and all(map(is_like_number, numbers))
        return first if is_named else None

    content, is_exchanged = list[Sequence[str | float]](), False
    for above, rows in find_segments(lines, count_texts):
        table, group = list[list[str]](), ""
        for line in rows:
            cells, first = list(map(str, line.content)), count_texts(line)
            texts, numbers = cells[:first], cells[first:]
            group = texts[0] or group
            words = sorted(filter(None, (group, *texts[1:])), key=lambda text: bool(_LEVEL.fullmatch(text)))
            table.append([" ".join(f"[{word}]" if units.is_unit(word) else word for word in words), *numbers])
        plain_names = [_LEVEL.sub("", cells[0]) for cells in table]
        roles = vocabulary.roles(plain_names)
        is_record = is_test(roles) and len(table[0]) > FEWEST_LOOP_ROWS  # more than a summary of its channels
        is_table = is_record or ("frequency" in roles and len(roles) > 2)
        is_exchanged |= is_table
        content += [line.content for line in above]
        content += zip_longest(*table, fillvalue="") if is_table else [line.content for line in rows]
    return Sheet(source.sheet or "", content) if is_exchanged else None
