"""The direction of a test, from the words in the name of its file and from the units of its columns."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path

from bushfit.geometry import Direction

#: How the words begin, in English, German, French and Spanish, without accents.
_WORDS = {
    "axial": Direction.AXIAL,
    "axiaux": Direction.AXIAL,
    "radial": Direction.RADIAL,
    "radiaux": Direction.RADIAL,
    "torsi": Direction.TORSION,
    "tordu": Direction.TORSION,
    "verdreh": Direction.TORSION,
    "drehwinkel": Direction.TORSION,
    "drehmoment": Direction.TORSION,
    "rotation": Direction.TORSION,
    "rotacion": Direction.TORSION,
}


def named_direction(texts: Iterable[str]) -> Direction | None:
    """The one direction that some texts (a file's name, its headers) speak of; None where none or several do."""
    found = set()
    for text in texts:
        plain = unicodedata.normalize("NFKD", text).encode("ascii", "ignore").decode().casefold()
        for word in re.findall(r"[a-z]+", plain):
            found |= {direction for start, direction in _WORDS.items() if word.startswith(start)}
    return found.pop() if len(found) == 1 else None


def direction_of_file(file: Path, headers: Iterable[str], *, turns: bool) -> Direction | None:
    """The direction that a test's file and headers settle.

    Args:
        file: its name, without the folders, may hold the word.
        headers: of its columns; they count where the name says nothing.
        turns: whether the displacement is in units of angle, which is torsion whatever the words.
    """
    if turns:
        return Direction.TORSION
    return named_direction([file.stem]) or named_direction(headers)
