"""Operating points in words: "axial 25 Hz 0.1 mm"."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

from bushfit.errors import UnitError
from bushfit.geometry import Direction
from bushfit.units import quantity
from bushfit.validation import converted

#: A direction, a frequency and an amplitude, each number with its unit.
_WORDS = re.compile(r"\s*([a-z]+)[\s,]+([-+\d.eE]+\s*[A-Za-z]+)[\s,]+([-+\d.eE]+\s*[^\d\s.]+)\s*")


@dataclass(frozen=True)
class Point:
    """An operating point: frequency [Hz], zero-to-peak amplitude [m or rad]."""

    direction: Direction
    frequency: float
    amplitude: float

    def __str__(self) -> str:
        unit, factor = self.direction.display.displacement
        return f"{self.direction} {self.frequency:.6g} Hz {self.amplitude * factor:.6g} {unit}"


def parse_point(text: str) -> Point:
    """The point of a text such as "axial 25 Hz 0.1 mm".

    Raises:
        UnitError: no direction, no numbers, or units that do not fit.
    """
    expected = 'direction, frequency and amplitude, such as "axial 25 Hz 0.1 mm" or "torsion 10 Hz 1 deg"'
    match = _WORDS.fullmatch(text)
    if not match or match[1] not in set(Direction):
        hint = "write numbers with a decimal point" if re.search(r"\d,\d", text) else None
        raise UnitError("this is no operating point", found=repr(text), expected=expected, hint=hint)
    direction = Direction(match[1])
    frequency, amplitude = quantity(match[2], "Hz"), quantity(match[3], direction.motion.displacement_unit)
    if not (frequency > 0.0 and amplitude > 0.0):
        raise UnitError("frequency and amplitude have to be above zero", found=repr(text), expected=expected)
    return Point(direction, frequency, amplitude)


def _parsed(raw: object, _: object) -> object:
    return parse_point(raw) if isinstance(raw, str) else raw


#: A point as a key of a TOML file.
At = Annotated[Point, converted(_parsed)]
