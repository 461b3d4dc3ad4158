"""Notation of the numbers of a table: decimal mark and thousands separator, from all its cells."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from typing import TYPE_CHECKING

from bushfit.reading.numerals import ALL_NUMERALS, Numerals, Place, consistent_notations
from bushfit.reading.source import Text

if TYPE_CHECKING:
    from bushfit.reading.table import Table

#: Number of first numbers that may show the decimal mark; chosen: a long record need not be read completely.
_FIRST = 1000


def find_first_decimal(table: Table) -> str | None:
    """Decimal mark of the first thousand numbers; None if they leave it open."""
    ways = consistent_notations(islice(_number_texts(table), _FIRST), _possible_numerals(table)).ways
    return ways[0].decimal if len({way.decimal for way in ways}) == 1 else None


def find_numerals(table: Table) -> Numerals:
    """Find the notation of the numbers in the columns whose quantity is known.

    Returns:
        Decimal mark and thousands separator.

    Raises:
        MeasurementError: the numbers have two notations, or can be read in two ways.
    """
    notations = _possible_numerals(table)
    if isinstance(table.source, Text):
        absent = [sign for sign in ",. '" if not table.source.may_contain(sign, table.layout)]
        decimal = "," if table.layout.delimiter == "," and "," in absent else ""  # is not the decimal mark
        possible = (way for way in notations if way.thousands not in absent and way.decimal != decimal)
        notations = tuple(possible) or notations
    evidence = consistent_notations(_number_texts(table), notations)
    if not evidence.is_contrary and any(way.thousands for way in evidence.ways):
        evidence = consistent_notations(_number_texts(table), notations, all_cells=True)
    usual = evidence.ways[0]
    if evidence.question is None:
        return usual
    (line, index), text = evidence.question
    if evidence.is_contrary:
        problem, found = "this number has another format than the others", f'"{text}"'
        expected = f"numbers with a decimal {'comma' if usual.decimal == ',' else 'point'}"
        hint = "correct this cell; or, if all numbers of the file have this format, state "
        hint += 'decimal = "..." and thousands = "..." in the campaign'
    else:
        problem = "this number can be read in two ways"
        found = f'"{text}", and no other number in the file shows the decimal mark'
        expected = " or ".join(dict.fromkeys(f"{way.value(text) or 0.0:.15g}" for way in evidence.ways))
        hint = 'state decimal = "." or decimal = "," in the campaign'
    column = next(column for column in table.roles.values() if column.index == index)
    raise table.error(problem, line=line, column=column, found=found, expected=expected, hint=hint)


def _possible_numerals(table: Table) -> tuple[Numerals, ...]:
    """Return the notations of numbers that agree with the decimal mark and thousands separator the user states."""
    decimal, thousands = table.opened.stated.decimal, table.opened.stated.thousands
    fitting = (way for way in ALL_NUMERALS if decimal in (None, way.decimal))
    notations = tuple(way for way in fitting if thousands in (None, way.thousands or "none"))
    if not notations:
        raise table.error("decimal mark and thousands separator are the same", found=decimal, expected="two signs")
    return notations


def _number_texts(table: Table) -> Iterator[tuple[Place, str]]:
    """Yield location and text of each cell in columns of known quantity, unless the file stores it as a number."""
    indices = {column.index for column in table.roles.values()} - table.source.numeric - table.clocks
    for line, cells in table.rows() if indices else ():
        for index in indices:
            if isinstance(cell := cells[index], str):
                yield (line, index), cell
