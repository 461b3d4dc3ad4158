"""The direction of a test, by words in the name and headers of its file, and by the units of its columns."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path

from bushfit.geometry import Direction

#: For the starts of words in English, German, French and Spanish, without accents, the direction they name.
_WORD_STARTS = {
    **dict.fromkeys(("axial", "axiaux"), Direction.AXIAL),
    **dict.fromkeys(("radial", "radiaux"), Direction.RADIAL),
    **dict.fromkeys(("torsi", "tordu", "verdreh", "drehwinkel", "drehmoment"), Direction.TORSION),
    **dict.fromkeys(("rotation", "rotacion"), Direction.TORSION),
}
#: Short for a direction in names; in headers rad is a unit.
_SHORT = {"ax": Direction.AXIAL, "rad": Direction.RADIAL, "tors": Direction.TORSION, "tor": Direction.TORSION}
#: A word, without the letters of a unit behind a number.
_WORD = re.compile(r"(?<![a-z\d.,])(?:[a-z]+)")


def named_direction(texts: Iterable[str], *, short: bool = False) -> Direction | None:
    """The one direction that texts, such as headers, name; None where they name none or several.

    With `short`, "ax", "rad" and "tors" count as well, as in names of files.
    """
    plain = unicodedata.normalize("NFKD", " ".join(texts)).encode("ascii", "ignore").decode().casefold()
    found = {named for start, named in _WORD_STARTS.items() if re.search(rf"(?<![a-z]){start}", plain)}
    if short and not found:
        found = {_SHORT[word] for word in _WORD.findall(plain) if word in _SHORT}
    return found.pop() if len(found) == 1 else None


def direction_of_file(file: Path, headers: Iterable[str], *, turns: bool, sheet: str | None = None) -> Direction | None:
    """The direction that the file of a test names; None where it does not say.

    Args:
        file: of which the name, without the folders, may hold a word.
        headers: of its columns; they count where the name says nothing.
        turns: whether the displacement is in units of angle: then it is a rotation, torsion unless another is named.
        sheet: of a workbook with several; its name goes before the file's.
    """
    named = named_direction([sheet or ""], short=True) or named_direction([file.stem], short=True)
    named = named or named_direction(headers)
    return Direction.TORSION if turns and not (named and named.is_rotation) else named
