"""Operating points in words: "axial 25 Hz 0.1 mm", or of a specimen "DMA 10 Hz 1 %"."""

import re
from dataclasses import dataclass
from typing import Annotated

from bushfit.errors import UnitError, did_you_mean
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Direction, Motion
from bushfit.units import agrees, quantity
from bushfit.validation import converted

#: A direction or a specimen, a frequency and an amplitude, each number with its unit.
_WORDS = re.compile(r"\s*(\S.*?)[\s,]+([-+\d.eE]+\s*[A-Za-z]+)[\s,]+([-+\d.eE]+\s*[^\d\s.]+)\s*")


@dataclass(frozen=True)
class Point:
    """An operating point at a direction, or at a specimen by its name, which each campaign has to know.

    Args:
        frequency: [Hz].
        amplitude, unit: zero-to-peak [m or rad], or strain, and its SI unit.
    """

    place: str
    frequency: float
    amplitude: float
    unit: str

    @property
    def motion(self) -> Motion:
        """That of the direction, or as the unit of the amplitude tells."""
        return next(motion for motion in (TRANSLATION, ROTATION, STRAINING) if motion.displacement_unit == self.unit)

    def __str__(self) -> str:
        unit, factor = self.motion.display.displacement
        return f"{self.place} {self.frequency:.6g} Hz {self.amplitude * factor:.6g} {unit}"


def parse_point(text: str) -> Point:
    """The point of a text such as "axial 25 Hz 0.1 mm"; what is like no direction is the name of a specimen.

    Raises:
        UnitError: no direction, no numbers, or units that do not fit.
    """
    expected = 'direction, frequency and amplitude, such as "axial 25 Hz 0.1 mm" or "torsion 10 Hz 1 deg"'
    match = _WORDS.fullmatch(text)
    if not match or (match[1] not in set(Direction) and did_you_mean(match[1].lower(), list(Direction))):
        hint = "write numbers with a decimal point" if re.search(r"\d,\d", text) else None
        raise UnitError("this is no operating point", found=repr(text), expected=expected, hint=hint)
    motion = Direction(match[1]).motion if match[1] in set(Direction) else _motion(match[3])
    frequency, amplitude = quantity(match[2], "Hz"), quantity(match[3], motion.displacement_unit)
    if not (frequency > 0.0 and amplitude > 0.0):
        raise UnitError("frequency and amplitude have to be above zero", found=repr(text), expected=expected)
    return Point(match[1], frequency, amplitude, motion.displacement_unit)


def _motion(amplitude: str) -> Motion:
    """The motion of a specimen by the amplitude in words: strain, or else displacement."""
    return STRAINING if agrees(amplitude.lstrip("+-.0123456789eE "), STRAINING.displacement_unit) else TRANSLATION


_WRITTEN = {"type": "string", "description": 'a place, a frequency and an amplitude: "axial 25 Hz 0.1 mm"'}
#: A point as a key of a TOML file.
At = Annotated[Point, converted(lambda raw, _: parse_point(raw) if isinstance(raw, str) else raw, _WRITTEN)]
