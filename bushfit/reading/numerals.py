"""Notation of numbers: decimal mark and thousands separator.

"1.234" has one value with a decimal point and another with a thousands point. The other numbers of the table decide; if
all of them can be read both ways, that is an error.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property, lru_cache
from itertools import islice, product
from typing import TYPE_CHECKING, NamedTuple

from bushfit.reading.headers import ERRORS
from bushfit.units import SUPERSCRIPTS

if TYPE_CHECKING:
    from bushfit.reading.table import Table

#: Number of first numbers that may show the decimal mark; chosen: a long record need not be read completely.
_FIRST = 1000
#: Blanks that separate thousands: plain, unbreakable and thin ones.
BLANKS = " \u00a0\u2009\u202f"
#: Apostrophes that separate thousands.
APOSTROPHES = "'\u2019"
#: Sign before a number or an exponent; there are two minus signs.
_SIGN = "[+\\-\u2212]"
#: Pattern of each thousands separator, by the sign with which a user states it.
_SEPARATORS = {",": ",", ".": r"\.", " ": f"[{BLANKS}]", "'": f"[{APOSTROPHES}]"}
#: Largest number of characters of a number; chosen: the largest float written out has 309 digits.
_LONGEST_NUMBER = 400
#: Superscript digits and minus sign.
_RAISED = f"[{''.join(map(chr, SUPERSCRIPTS))}]"
#: Factor of a power of ten before its exponent: "x10^2", "·10²".
_TIMES_TEN = rf"[{BLANKS}]?[x×*·⋅][{BLANKS}]?10(?:\^|\*\*|(?={_RAISED}))"
#: Exponent behind a number; Fortran writes 1.0D-03.
EXPONENT = rf"(?:(?:[eEdD]|{_TIMES_TEN})(?:{_SIGN}?\d+|{_RAISED}+))"
#: Number in running text that may have thousands separators: "1,500", "12 500.0"; the separator is not mixed.
_GROUPED = re.compile(
    rf"(?<![\w.,'])[1-9]\d{{0,2}}(?P<mark>[.,{BLANKS}{APOSTROPHES}])\d{{3}}(?:(?P=mark)\d{{3}})*"
    r"(?:(?!(?P=mark))[.,]\d+)?(?![.,']?\d)"
)
#: Text in front of a number whose thousands are separated by blanks; "Run 1 500 N" has two numbers.
_BEFORE_BLANKS = re.compile(r"(?:^|[:=;,(\t])[\s+-]*$")
#: Text with the characters of a number, in an order that numbers may have.
_LIKE_NUMBER = re.compile(rf"{_SIGN}?[.,]?\d[\d.,{BLANKS}{APOSTROPHES}]*{EXPONENT}?", re.ASCII)
#: Number whose point or comma may be the thousands separator or the decimal mark: 1.234.
_ONE_GROUP = re.compile(rf"{_SIGN}?[1-9]\d{{0,2}}([.,])\d{{3}}", re.ASCII)
#: Number without thousands separators: 1234.5.
_UNGROUPED = re.compile(rf"{_SIGN}?\d{{4,}}(?:[.,]\d*)?", re.ASCII)


@dataclass(frozen=True)
class Numerals:
    """Notation of numbers: decimal mark "." or ",", and thousands separator ",", ".", " " (any blank), "'" or None."""

    decimal: str = "."
    thousands: str | None = None

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        """Regular expression of a number in this notation."""
        mark = re.escape(self.decimal)
        forms = [rf"(?:\d+(?:{mark}\d*)?|{mark}\d+){EXPONENT}?"]
        if self.thousands:
            sign, digits = _SEPARATORS[self.thousands], "2,3" if self.thousands == "," else "3"  # India: 6,05,432
            forms.append(rf"[1-9]\d{{0,2}}(?:{sign}\d{{{digits}}})*{sign}\d{{3}}(?:{mark}\d*)?")
        return re.compile(rf"{_SIGN}?(?:{'|'.join(forms)})", re.ASCII)

    def allows(self, text: str) -> bool:
        """Return True if the stripped text of a cell is a number in this notation."""
        return len(text) <= _LONGEST_NUMBER and self._pattern.fullmatch(text) is not None

    def value(self, text: str) -> float | None:
        """Return the number in a cell; None if the text is not a number in this notation."""
        if not self.allows(text):
            return None
        if self.thousands:
            text = re.sub(_SEPARATORS[self.thousands], "", text)
        if "^" in text or "*" in text or not text.isascii():
            text = re.sub(_TIMES_TEN, "e", text).translate(SUPERSCRIPTS)
        return float(text.replace(self.decimal, ".").replace("\u2212", "-").lower().replace("d", "e"))


#: All notations, the plainest first.
ALL_NUMERALS = tuple(
    Numerals(decimal, thousands)
    for thousands, decimal in product((None, ",", ".", " ", "'"), ".,")
    if thousands != decimal
)

#: Line number and column index of a cell.
Place = tuple[int, int]


class NumeralEvidence(NamedTuple):
    """Notations (decimal mark and thousands separator) in which a table can be read, and the first problematic cell.

    Args:
        ways: notations in which all numbers can be read, the simplest first.
        question: location and text of the first number that contradicts the others, or else has different values in
            these notations; None if there is none.
        is_contrary: True if this number contradicts the others.
    """

    ways: tuple[Numerals, ...]
    question: tuple[Place, str] | None = None
    is_contrary: bool = False


@lru_cache(maxsize=4096)
def is_like_number(text: str) -> bool:
    """True if a cell is a number in any notation; cached, because the first rows are examined several times."""
    return _LIKE_NUMBER.fullmatch(text) is not None and any(way.allows(text) for way in ALL_NUMERALS)


def plainest_value(text: str) -> float:
    """Number in a cell, in the first notation that fits; NaN if none does.

    Notations without a thousands separator are tried first, and a decimal point before a decimal comma.
    """
    return next((value for way in ALL_NUMERALS if (value := way.value(text)) is not None), math.nan)


def without_groups(text: str, decimal: str | None) -> str:
    """Write the numbers of a running text without thousands separators and, if these are clear, with a decimal point.

    Args:
        text: text that may contain numbers such as "1,500" or "1.500,0".
        decimal: decimal mark of the numbers in the same file; None if it is not known.

    Returns:
        Text in which numbers that have one value only are plain; the others are unchanged.
    """

    def plain(match: re.Match[str]) -> str:
        """One number without separators."""
        if match["mark"] in BLANKS and not _BEFORE_BLANKS.search(text[: match.start()]):
            return match[0]
        values = {way.decimal: value for way in ALL_NUMERALS if (value := way.value(match[0])) is not None}
        distinct = {values[decimal]} if decimal in values else {*values.values()}
        return f"{distinct.pop():.12g}" if len(distinct) == 1 else match[0]

    return _GROUPED.sub(plain, text)


def consistent_notations(
    cells: Iterable[tuple[Place, str]], ways: tuple[Numerals, ...] = ALL_NUMERALS, *, all_cells: bool = False
) -> NumeralEvidence:
    """Find the notations of numbers in which all cells of a table can be read.

    Args:
        cells: location and text of each cell; texts that are not numbers are ignored.
        ways: candidate notations.
        all_cells: True to continue after the decimal mark is known.

    Returns:
        Remaining notations, and the first number that is ambiguous or contradicts the others.

    Notes:
        A file with thousands separators is assumed to have them in all numbers, unless the user states the separator.
    """
    open_thousands = len({way.thousands for way in ways}) > 1
    unclear, ungrouped = None, False
    columns: dict[str, set[int]] = {}
    grouped: dict[str, tuple[Place, str]] = {}
    for place, text in cells:
        if not all_cells and len({way.decimal for way in ways}) == 1:
            break
        ungrouped = ungrouped or _UNGROUPED.fullmatch(text) is not None
        if text.isdecimal():
            continue
        for mark in ".,":
            if mark in text and text.replace(mark, "", 1).isdecimal():
                columns.setdefault(mark, set()).add(place[1])
        fitting = tuple(way for way in ways if way.allows(text))
        if not fitting:
            if is_like_number(text):
                return NumeralEvidence(ways, (place, text), is_contrary=True)
            continue
        ways = fitting
        if group := _ONE_GROUP.fullmatch(text):
            grouped.setdefault(group[1], (place, text))
        if unclear is None and len({way.value(text) for way in ways}) > 1:
            unclear = place, text
        if len({way.decimal for way in ways}) == 1:
            unclear = None
    # 62.598 between 20,000 and 3694,85 is a slip rather than 62 thousand; so is 594,436 between 595.1 and 596.25
    contrary = grouped.get(ways[0].thousands or "") if open_thousands else None
    if contrary and (ungrouped or contrary[0][1] in columns.get(ways[0].decimal, ())):
        return NumeralEvidence(ways, contrary, is_contrary=True)
    return NumeralEvidence(ways, unclear)


def find_first_decimal(table: Table) -> str | None:
    """Decimal mark of the first thousand numbers; None if these and the separator of columns leave it open."""
    is_separator = table.layout.delimiter == "," and not table.source.may_contain(",", table.layout)
    decimal = common_decimal(islice(_number_texts(table), _FIRST), _possible_numerals(table))
    return decimal or ("." if is_separator else None)


def common_decimal(cells: Iterable[tuple[Place, str]], ways: tuple[Numerals, ...] = ALL_NUMERALS) -> str | None:
    """Decimal mark of some cells, given by location and text; None if they leave it open."""
    remaining = consistent_notations(cells, ways).ways
    return remaining[0].decimal if len({way.decimal for way in remaining}) == 1 else None


def find_numerals(table: Table) -> Numerals:
    """Find the notation of the numbers in the columns whose quantity is known.

    Returns:
        Decimal mark and thousands separator.

    Raises:
        MeasurementError: the numbers have two notations, or can be read in two ways.
    """
    notations = _possible_numerals(table)
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
    kind, found = "two_readings", f'"{text}", and no other number in the file shows the decimal mark'
    expected = " or ".join(dict.fromkeys(f"{way.value(text) or 0.0:.15g}" for way in evidence.ways))
    if evidence.is_contrary:
        kind, found = "other_format", f'"{text}"'
        expected = f"numbers with a decimal {'comma' if usual.decimal == ',' else 'point'}"
    column = next(column for column in table.roles.values() if column.index == index)
    raise table.error(**ERRORS[kind], line=line, column=column, found=found, expected=expected)


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
