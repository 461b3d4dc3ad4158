"""How a table writes its numbers: decimal point or comma, and what parts thousands.

"1.234" is one number with a decimal point and another with a thousands point. What a table means is settled by its
other numbers; where all of them can be read both ways, nothing is guessed.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from itertools import product

#: Signs that part thousands, and the two minus signs.
_BLANKS, _APOSTROPHES, _SIGN = " \u00a0\u2009\u202f", "'\u2019", "[+\\-\u2212]"
_GROUPS = {",": ",", ".": r"\.", " ": f"[{_BLANKS}]", "'": f"[{_APOSTROPHES}]"}
#: Characters of a number.
_LONGEST = 400
_LIKE = re.compile(rf"{_SIGN}?[.,]?\d[\d.,{_BLANKS}{_APOSTROPHES}]*(?:[eE]{_SIGN}?\d+)?", re.ASCII)

#: A number that may have one group of thousands, and one with thousands that are not grouped.
_ONE_GROUP = re.compile(rf"{_SIGN}?[1-9]\d{{0,2}}([.,])\d{{3}}", re.ASCII)
_BARE = re.compile(rf"{_SIGN}?\d{{4,}}(?:[.,]\d*)?", re.ASCII)


@dataclass(frozen=True)
class Numerals:
    """A way to write numbers.

    Args:
        decimal: "." or ",".
        thousands: ",", ".", " " (any blank), "'" or None.
    """

    decimal: str = "."
    thousands: str | None = None

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        mark = re.escape(self.decimal)
        forms = [rf"(?:\d+(?:{mark}\d*)?|{mark}\d+)(?:[eE]{_SIGN}?\d+)?"]
        if self.thousands:
            forms.append(rf"[1-9]\d{{0,2}}(?:{_GROUPS[self.thousands]}\d{{3}})+(?:{mark}\d*)?")
        return re.compile(rf"{_SIGN}?(?:{'|'.join(forms)})", re.ASCII)

    def allows(self, text: str) -> bool:
        """Whether a cell, without blanks around it, is a number when written in this way."""
        return len(text) <= _LONGEST and self._pattern.fullmatch(text) is not None

    def value(self, text: str) -> float | None:
        """The number in a cell; None where it holds none."""
        if not self.allows(text):
            return None
        if self.thousands:
            text = re.sub(_GROUPS[self.thousands], "", text)
        return float(text.replace(self.decimal, ".").replace("\u2212", "-"))


#: All ways, the plainest first.
ALL = tuple(
    Numerals(decimal, thousands)
    for thousands, decimal in product((None, ",", ".", " ", "'"), ".,")
    if thousands != decimal
)


#: Line and column of a cell.
Place = tuple[int, int]


@dataclass(frozen=True)
class Evidence:
    """What cells tell of the way their numbers are written.

    Args:
        ways: those that all numbers so far allow, the plainest first.
        unclear: place and text of the first cell that two of them read differently; None where none is.
        contrary: place and text of the first cell that none of the ways allows that the others do.
    """

    ways: tuple[Numerals, ...]
    unclear: tuple[Place, str] | None = None
    contrary: tuple[Place, str] | None = None


def is_like_number(text: str) -> bool:
    """Whether a cell is a number in some way to write them."""
    return len(text) <= _LONGEST and _LIKE.fullmatch(text) is not None and any(way.allows(text) for way in ALL)


def weigh(cells: Iterable[tuple[Place, str]], ways: tuple[Numerals, ...] = ALL, *, all_cells: bool = False) -> Evidence:
    """Find the ways that numbers are written in. A file that groups thousands does so throughout, unless it is stated.

    Args:
        cells: place and text of each; texts that are no numbers in any way count for nothing.
        ways: those that may be.
        all_cells: go on when the decimal mark is settled, for thousands separators and contradictions.
    """
    open_thousands = len({way.thousands for way in ways}) > 1
    unclear, bare = None, False
    grouped: dict[str, tuple[Place, str]] = {}
    for place, text in cells:
        if not all_cells and len({way.decimal for way in ways}) == 1:
            break
        bare = bare or _BARE.fullmatch(text) is not None
        if text.isdecimal():
            continue
        left = tuple(way for way in ways if way.allows(text))
        if not left:
            if is_like_number(text):
                return Evidence(ways, contrary=(place, text))
            continue
        ways = left
        if group := _ONE_GROUP.fullmatch(text):
            grouped.setdefault(group[1], (place, text))
        if unclear is None and len({way.value(text) for way in ways}) > 1:
            unclear = place, text
        if len({way.decimal for way in ways}) == 1:
            unclear = None
    # 62.598 between 20,000 and 3694,85 is a slip rather than 62 thousand
    contrary = grouped.get(ways[0].thousands or "") if bare and open_thousands else None
    return Evidence(ways, unclear, contrary)
