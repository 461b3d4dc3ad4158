"""How numbers are written: decimal point or comma, and what parts thousands.

"1.234" is one number with a decimal point and another with a thousands point. Which of them a table means, its other
numbers tell; where all of them can be read both ways, that is an error and not a guess.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

#: Blanks that part thousands: plain, unbreakable and thin ones.
_BLANKS = " \u00a0\u2009\u202f"
#: Apostrophes that part thousands.
_APOSTROPHES = "'\u2019"
#: A sign before a number or an exponent; there are two minus signs.
_SIGN = "[+\\-\u2212]"
#: For each sign by which a user names what parts thousands, all that stand for it.
_SEPARATORS = {",": ",", ".": r"\.", " ": f"[{_BLANKS}]", "'": f"[{_APOSTROPHES}]"}
#: Characters of the longest number; chosen: the largest float written out has 309 digits.
_LONGEST_NUMBER = 400
#: What has the characters of a number, in an order that numbers may have.
_LIKE_NUMBER = re.compile(rf"{_SIGN}?[.,]?\d[\d.,{_BLANKS}{_APOSTROPHES}]*(?:[eE]{_SIGN}?\d+)?", re.ASCII)
#: A number in which the sign may part a single group of thousands, or be the decimal mark: 1.234.
_ONE_GROUP = re.compile(rf"{_SIGN}?[1-9]\d{{0,2}}([.,])\d{{3}}", re.ASCII)
#: A number whose thousands nothing parts: 1234.5.
_UNGROUPED = re.compile(rf"{_SIGN}?\d{{4,}}(?:[.,]\d*)?", re.ASCII)


@dataclass(frozen=True)
class Numerals:
    """A way to write numbers: decimal mark, and what parts thousands: ",", ".", " " (any blank), "'" or None."""

    decimal: str = "."
    thousands: str | None = None

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        mark = re.escape(self.decimal)
        forms = [rf"(?:\d+(?:{mark}\d*)?|{mark}\d+)(?:[eE]{_SIGN}?\d+)?"]
        if self.thousands:
            forms.append(rf"[1-9]\d{{0,2}}(?:{_SEPARATORS[self.thousands]}\d{{3}})+(?:{mark}\d*)?")
        return re.compile(rf"{_SIGN}?(?:{'|'.join(forms)})", re.ASCII)

    def allows(self, text: str) -> bool:
        """Whether a cell, without blanks around it, is a number written in this way."""
        return len(text) <= _LONGEST_NUMBER and self._pattern.fullmatch(text) is not None

    def value(self, text: str) -> float | None:
        """The number in a cell; None where it holds none."""
        if not self.allows(text):
            return None
        if self.thousands:
            text = re.sub(_SEPARATORS[self.thousands], "", text)
        return float(text.replace(self.decimal, ".").replace("\u2212", "-"))


#: All ways to write numbers, the plainest first.
ALL_NUMERALS = tuple(
    Numerals(decimal, thousands)
    for thousands, decimal in product((None, ",", ".", " ", "'"), ".,")
    if thousands != decimal
)

#: Line and column of a cell.
Place = tuple[int, int]


@dataclass(frozen=True)
class NumeralEvidence:
    """What cells tell of the ways in which all their numbers may be written, the plainest first.

    `unclear` is place and text of the first that has several values in them, `contrary` of the first written in none.
    """

    ways: tuple[Numerals, ...]
    unclear: tuple[Place, str] | None = None
    contrary: tuple[Place, str] | None = None


def is_like_number(text: str) -> bool:
    """Whether a cell is a number in any way to write them."""
    return _LIKE_NUMBER.fullmatch(text) is not None and any(way.allows(text) for way in ALL_NUMERALS)


def weigh(
    cells: Iterable[tuple[Place, str]], ways: tuple[Numerals, ...] = ALL_NUMERALS, *, all_cells: bool = False
) -> NumeralEvidence:
    """Find the ways in which cells may write their numbers.

    A file that parts thousands is taken to do so in all its numbers, unless the user states how it parts them.

    Args:
        cells: place and text of each; texts that are no numbers in any way do not count.
        ways: in which the numbers may be written.
        all_cells: whether to go on when the decimal mark is settled.
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
        left = tuple(way for way in ways if way.allows(text))
        if not left:
            if is_like_number(text):
                return NumeralEvidence(ways, contrary=(place, text))
            continue
        ways = left
        if group := _ONE_GROUP.fullmatch(text):
            grouped.setdefault(group[1], (place, text))
        if unclear is None and len({way.value(text) for way in ways}) > 1:
            unclear = place, text
        if len({way.decimal for way in ways}) == 1:
            unclear = None
    # 62.598 between 20,000 and 3694,85 is a slip rather than 62 thousand; so is 594,436 between 595.1 and 596.25
    contrary = grouped.get(ways[0].thousands or "") if open_thousands else None
    if contrary and not (ungrouped or contrary[0][1] in columns.get(ways[0].decimal, ())):
        contrary = None
    return NumeralEvidence(ways, unclear, contrary)
