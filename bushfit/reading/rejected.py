"""Rows of a table that are not data: the reason for each, a sentence that lists them, and errors if there are many."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np

from bushfit import units
from bushfit.caveat import Caveat
from bushfit.errors import MeasurementError, UnitError
from bushfit.reading.headers import (
    ALL_COLUMNS,
    ERRORS,
    ROLE_SETS,
    WORDS,
    Column,
    Vocabulary,
    parse_unit,
    plain,
    split_unit,
)
from bushfit.reading.lines import Line, is_row, is_summary_row
from bushfit.reading.measurement import Floats
from bushfit.reading.numerals import is_like_number
from bushfit.reading.roles import is_test
from bushfit.reading.source import LEAST_VALUE, RowSource, Sheet
from bushfit.reading.times import parse_clock

if TYPE_CHECKING:
    from bushfit.reading.table import Table

#: Largest ratio of left-out rows that look like data to rows of data; chosen: with more, the meaning is in doubt.
_MOST_LEFT_OUT = 0.1
#: Largest number of lines that a note lists.
_MOST_LISTED = 4
#: Rows with an unknown word instead of a number that are always left out; chosen: a mean, a deviation, a range.
_MOST_WORDS = 3
#: Placeholders for a missing value.
_MISSING = frozenset(WORDS["rows_of"]["missing"])
#: Smallest ratio of nines that mark a missing value to the largest other number; chosen: outliers are rarely nines.
_MARK_RATIO = 3.0

#: Roles of a stiffness, of which zero is no measurement.
_SIZES = ("stiffness", "storage_stiffness")
#: Line number and cells of a row that is not data, and the reason, see `row_fault`.
FaultyRow = tuple[int, Sequence[str | float], str]


def row_fault(table: Table, cells: Sequence[str | float]) -> str | None:
    """Find the reason why a row is not data.

    Returns:
        "other" for what is clearly not data, such as a remark or a mean; "missing" for a placeholder such as NaN
        instead of a number; "word" for another word instead of a number; "doubtful" for a row that looks like data
        but cannot be read; None for a row of data.
    """
    texts = [str(cell) for cell in cells]
    if is_summary_row(texts) or next(filter(None, texts), "").endswith(":"):
        return "other"
    if any(texts[len(table.headers) :]):
        return "doubtful" if is_row(texts) else "other"
    if table.layout.delimiter == " " and not texts[-1] and is_row(texts):
        return "doubtful"  # a cell is missing, and all behind it are displaced
    for index in table.needed:
        if cells[index] in table.marks.get(index, ()):
            return "missing"
        if isinstance(cells[index], str) and not is_like_number(texts[index]):
            if index in table.clocks and parse_clock(texts[index]) is not None:
                continue
            if index in table.clocks or not any(map(is_like_number, texts)):
                return "other"
            if not any(is_like_number(texts[number]) for number in table.needed):
                return "other"
            if is_like_number(texts[index].rstrip("*!?#")):
                return "missing"  # a number that is marked as faulty
            word = texts[index].lower().strip("#*!?-./ ")
            is_word = texts[index] and not any(sign.isdigit() for sign in word)
            return "doubtful" if not is_word else "missing" if word in _MISSING else "word"
    return None


def begins_other_table(cells: Sequence[str]) -> bool:
    """Return True if a row has names with units in brackets and no number, as the header of another table has."""
    filled = [cell for cell in cells if cell]
    in_brackets = [cell for cell in filled if cell[-1] in "])" and units.is_unit(units.split_header(cell)[1] or "?")]
    return len(filled) > 1 and len(in_brackets) > 0 and not any(map(is_like_number, filled))


def find_other_tables(table: Table) -> list[tuple[int, str]]:
    """Find the headers of other tests below a table, such as a sweep below a loop.

    Returns:
        Line number and names of the columns of each header.
    """
    vocabulary, rows = Vocabulary(ALL_COLUMNS), () if table.source.is_one_block(table.layout) else table.all_rows()
    headers = ((line, [str(cell) for cell in cells if cell != ""]) for line, cells, fault in rows if fault == "other")
    tests = ((line, texts) for line, texts in headers if is_test(vocabulary.roles(texts)))
    return [(line, ", ".join(texts)) for line, texts in tests if not table.layout.is_header(texts, vocabulary)]


def note_left_out(table: Table, rows: Sequence[FaultyRow], count: int) -> Iterator[Caveat]:
    """Warning on rows that are left out because they are not data, except repeated headers and rows of units.

    Args:
        rows: the rows that are left out.
        count: number of rows of data.

    Yields:
        A warning on each other table, and one on other rows.

    Raises:
        MeasurementError: so many of these rows look like data that the meaning of the table is in doubt.
    """
    left_out = [row for row in rows if not table.layout.is_repeated([str(cell) for cell in row[1]])]
    in_doubt = [row for row in left_out if row[2] in ("doubtful", "word")]
    is_much = len(in_doubt) > _MOST_WORDS or sum(fault == "doubtful" for *_, fault in in_doubt) > 1
    empty, lines = {tuple(cell == "" for cell in row[1]) for row in in_doubt}, np.array([row[0] for row in in_doubt])
    complete = lines[1:][np.diff(lines) == 2]  # each k-th row, if another channel was sampled more slowly
    are_between_samples = len(empty) == 1 and any(*empty) and complete.size > 2 and np.ptp(np.diff(complete)) == 0
    if is_much and len(in_doubt) > _MOST_LEFT_OUT * count and not are_between_samples:
        raise bad_row(table, *in_doubt[0][:2], len(in_doubt))
    below = table.other_tables if any(fault == "other" for *_, fault in left_out) else ()
    for line, names in below:
        sentence = f"line {line} begins another table ({names}): header_line = {line} in the campaign reads it"
        yield Caveat("other_table", sentence)
    yield from list_left_out(table.source, [Line(*row[:2]) for row in left_out if not below or row[0] < below[0][0]])


def list_left_out(source: RowSource, lines: Sequence[Line]) -> Iterator[Caveat]:
    """Warn of lines of a file, or rows of a sheet, that are left out.

    Yields:
        The warning, which lists the first lines; nothing without lines.
    """
    listed = [
        f"{'row' if isinstance(source, Sheet) else 'line'} {line} "
        f"({', '.join(str(cell) for cell in cells if cell != '')[:40]})"
        for line, cells in lines[:_MOST_LISTED]
    ]
    more, rows = ", ..." * (len(lines) > _MOST_LISTED), f"{len(lines)} row{'s' * (len(lines) > 1)}"
    if lines:
        yield Caveat("rows_left_out", f"{rows} left out, not data of this test: {', '.join(listed)}{more}")


def bad_row(
    table: Table, line: int, cells: Sequence[str | float], count: int = 1, column: Column | None = None
) -> MeasurementError:
    """Return the error for a row that does not match the header, or has a cell that is not a number.

    Args:
        line: line number of the row.
        cells: cells of the row.
        count: number of such rows in the table.
        column: column of the bad cell; by default, the first needed column without a number.
    """
    also = f", and {count - 1} more such rows" if count > 1 else ""
    needed = [column for column in table.roles.values() if column.index in table.needed]
    bad = (one for one in needed if isinstance(cells[one.index], str) and not is_like_number(str(cells[one.index])))
    column = column or next(bad, None)
    filled = next((n for n in range(len(cells), 0, -1) if cells[n - 1] != ""), 0)
    if column is None or len(cells) > len(table.headers) or (table.layout.delimiter == " " and cells[-1] == ""):
        commas = table.layout.delimiter == "," and not any("." in str(cell) for cell in cells)
        return table.error(
            "the row does not match the header",
            line=line,
            found=f"{filled} cell{'s' * (filled != 1)}{also}",
            expected=f"{len(table.headers)} cells",
            hint="separate the columns by semicolons if numbers have a decimal comma" if commas else None,
        )
    if (cell := cells[column.index]) == "" and (lost := lost_formulas(table)):
        return lost
    if count > 1 and filled <= column.index and next(table.rows(), None) is None:
        found, expected = f"{filled} cells", f"{len(table.headers)} cells: {', '.join(table.headers)}"
        return table.error(**ERRORS["fewer_cells"], line=line, found=found, expected=expected)
    problem = "the cell is empty" if cell == "" else "this is not a finite number, or beyond the range of every rig"
    advice = "write each row on one line; tables copied from a PDF often have broken rows" if cell == "" else None
    expected = f"a number such as 12{table.numerals.decimal}5"
    return table.error(problem, line=line, column=column, found=f'"{cell}"{also}', expected=expected, hint=advice)


def lost_formulas(table: Table) -> MeasurementError | None:
    """Return the error for a workbook whose formulas have no saved values; None for any other table."""
    if not (isinstance(table.source, Sheet) and table.source.lacks_values()):
        return None
    return table.error(**ERRORS["lost_formulas"])


def check_positive(table: Table, wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> None:
    """Refuse values that are not positive, or positive but smaller than any rig records.

    Args:
        table: table of the columns.
        wanted: columns by role; positive ones are checked.
        values: values in SI by role, (n,) each.

    Raises:
        MeasurementError: a value is not positive or too small.
    """
    for role in ROLE_SETS["positive"]:
        if role in values:
            problem = f"the {role.replace('_', ' ')} is not positive"
            hint = "correct this cell, or delete its row from the file"
            table.refuse(values[role] <= 0.0, wanted[role], problem, "a number above zero", hint)
            smallest = f"{LEAST_VALUE / abs(wanted[role].scale):.3g} or more"
            table.refuse(values[role] < LEAST_VALUE, wanted[role], "no rig records values this small", smallest)


def mark_missing(table: Table, wanted: Mapping[str, Column], values: Mapping[str, Floats]) -> bool:
    """Find numbers that mark missing values: nines beyond all others, -1 beside positive numbers, a stiffness of zero.

    Args:
        table: table of the columns, to whose marks the cells with such numbers are added.
        wanted: columns by role, with their factors to SI.
        values: values in SI by role, (n,) each.

    Returns:
        True if there is such a number, so that the table has to be read again without its rows.
    """
    marks = list[tuple[int, str | float]]()
    for role, column in ((role, column) for role, column in wanted.items() if role != "time"):
        for row in {int(values[role].argmin()), int(values[role].argmax())} if values[role].size else ():
            number = float(values[role][row] / column.scale)
            is_size = number == -1.0 or (number == 0.0 and role in _SIZES and not column.logarithm)
            if not is_size and (abs(number) < 99.0 or not set(f"{abs(number):.9g}") <= set("9.")):
                continue
            rest = values[role][values[role] != values[role][row]] / column.scale
            is_apart = abs(number) > _MARK_RATIO * np.abs(rest).max(initial=0.0)
            if rest.size > values[role].size / 2 and (rest.min() > 0.0 if is_size else is_apart):
                marks.append((column.index, next(islice(table.rows(), row, None))[1][column.index]))
    for index, cell in marks:  # not earlier: the rows depend on them
        table.marks.setdefault(index, set()).add(cell)
    return bool(marks)


def refuse_other_columns(table: Table, left_out: Iterable[FaultyRow], vocabulary: Vocabulary) -> None:
    """Refuse a table in which a later header or row of units changes the order or the units of the columns.

    Args:
        table: table with its columns by role.
        left_out: rows of the table that are not data.
        vocabulary: known column names, by which a header has a role such as "force".

    Raises:
        MeasurementError: a header repeats the columns in another order.
        UnitError: a header or row of units states other units.
    """
    first = table.layout.units_line or table.layout.header_line
    columns = sorted(table.roles.values(), key=lambda column: column.index)
    for line, cells, _ in left_out:
        texts = [str(cell) for cell in cells]
        is_header, compatible, different = table.layout.is_header(texts, vocabulary), 0, list[Column]()
        for column in columns:
            text = texts[column.index]
            name, unit, convention = split_unit(text) if is_header else ("", *parse_unit(text.strip("[]() "))[:2])
            heading = vocabulary.heading(text)
            is_same = plain(name) == plain(split_unit(column.header)[0]) or (heading and heading.role == column.role)
            if is_header and not is_same:
                found = ", ".join(filter(None, texts))
                expected = f"the columns of line {table.layout.header_line}: {', '.join(table.headers)}"
                raise table.error(**ERRORS["other_order"], line=line, found=found, expected=expected)
            if not (unit and column.unit) or unit == "-" or is_like_number(unit):
                continue
            scales = [units.kelvin_scale(one) for one in (unit, column.unit)]
            if not all(scales) and units.is_compatible(unit, column.unit):
                scales = [(units.si_factor(one, one), 0.0) for one in (unit, column.unit)]
            if all(scales):
                compatible += 1
                different += [column] * (scales[0] != scales[1] or convention not in (None, column.convention))
        if different and (is_header or compatible > 1):
            raise UnitError(
                f"the {different[0].role.replace('_', ' ')} has two units",
                file=table.file,
                place=table.place(line, different[0]),
                found=f"{', '.join(texts[column.index] for column in different)} on line {line}, "
                f"{', '.join(str(column.unit) for column in different)} on line {first}",
                **ERRORS["two_units"],
            )
