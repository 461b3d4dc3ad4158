"""Lists of channels above a table: the names of its columns, and the scales of recorded counts."""

import re
from collections.abc import Iterable, Sequence

from bushfit.reading.headers import WORDS, Vocabulary, plain
from bushfit.reading.lines import Line
from bushfit.reading.numerals import is_like_number
from bushfit.reading.roles import UNIT_NAMES

#: Name of a column in a list of names above a table: "Sig1 Time (s)", "Column 2: Weg [mm]", "# 3 Force [N]".
_LISTED_NAME = re.compile(
    r"[@#%*\s]*(?:(?:(?:sig|signal|col|column|ch|chan|channel|spalte|kanal)[\s.]*)?(?P<number>\d{1,3})\s*[:=.)\t ]\s*)?"
    r"(?P<name>[^\W\d].*?)\s*",
    re.IGNORECASE,
)
#: Names of a column with the size of one count of a channel.
SCALES = frozenset(map(plain, WORDS["rows_of"]["scales"]))


def listed_names(
    lines: Sequence[Line], rows: Sequence[Sequence[str]], vocabulary: Vocabulary
) -> tuple[int, int, list[str]] | None:
    """Find the names of columns that the lines above a table list, one on each line, such as "Channel 1: Time [s]".

    Args:
        lines: lines above the table.
        rows: cells of its first row, for each possible delimiter.
        vocabulary: known column names, by which a header has a role such as "force".

    Returns:
        Index of the last line of the list, index of the delimiter that gives as many cells as there are names, and the
        names; None without such a list.
    """
    matches = [_LISTED_NAME.fullmatch(line.text) for line in lines]
    listed = [match for match in matches if match and match["number"]]
    if not listed:
        listed = [match for match in matches if match and vocabulary.heading(match["name"])]
    counts = [int(match["number"]) for match in listed if match["number"]]
    names = [re.sub(r"\s{2,}|\t", " ", match["name"]) for match in listed]
    if len(vocabulary.roles(names)) < 2 or counts not in ([], *(list(range(n, n + len(names))) for n in (0, 1))):
        return None
    last = matches.index(listed[-1])
    return next(((last, index, names) for index, row in enumerate(rows) if len(row) == len(names)), None)


def scales_above(lines: Iterable[Sequence[str]], headers: Sequence[str]) -> dict[int, str]:
    """Find the scales of recorded counts in a table of channels above the data: "Name,Units,Scale" and a row for each.

    Returns:
        Scale with its unit, such as "x 0.00125 mm", by index of the header that names the channel.
    """
    scale = unit = None
    scales = dict[int, str]()
    for cells in lines:
        names = list(map(plain, cells))
        if SCALES.intersection(names) and UNIT_NAMES.intersection(names):
            scale, unit = (next(n for n, name in enumerate(names) if name in words) for words in (SCALES, UNIT_NAMES))
        elif scale is not None and unit is not None and len(cells) > max(scale, unit) and is_like_number(cells[scale]):
            matching = [n for n, header in enumerate(headers) if header in cells]
            scales |= dict.fromkeys(matching, f"x {cells[scale]} {cells[unit]}")
    return scales
