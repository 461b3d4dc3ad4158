"""The direction of a test, by words in the name and headers of its file, and by the units of its columns."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Iterable
from pathlib import Path

from bushfit.geometry import Direction

#: For the starts of words in English, German, French and Spanish, without accents, the direction they name.
_WORD_STARTS = {
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
    """The one direction that texts, such as headers, name; None where they name none or several."""
    plain = unicodedata.normalize("NFKD", " ".join(texts)).encode("ascii", "ignore").decode().casefold()
    words = re.findall(r"[a-z]+", plain)
    found = {_WORD_STARTS[start] for start in _WORD_STARTS for word in words if word.startswith(start)}
    return found.pop() if len(found) == 1 else None


def direction_of_file(file: Path, headers: Iterable[str], *, turns: bool) -> Direction | None:
    """The direction that the file of a test names; None where it does not say.

    Args:
        file: of which the name, without the folders, may hold a word.
        headers: of its columns; they count where the name says nothing.
        turns: whether the displacement is in units of angle: then it is a rotation, torsion unless another is named.
    """
    named = named_direction([file.stem]) or named_direction(headers)
    return Direction.TORSION if turns and not (named and named.is_rotation) else named
