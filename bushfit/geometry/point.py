"""Operating points as texts: a direction or specimen, a frequency and an amplitude."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Annotated

from bushfit.errors import UnitError, did_you_mean
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Direction, Motion
from bushfit.units import is_compatible, parse_quantity
from bushfit.validation import converter

#: Text of an operating point: direction or specimen, frequency and amplitude, each number with its unit.
_POINT = re.compile(r"\s*(\S.*?)[\s,]+([-+\d.eE]+\s*[A-Za-z]+)[\s,]+([-+\d.eE]+\s*[^\d\s.]+)\s*")


@dataclass(frozen=True)
class Point:
    """An operating point of a bushing or specimen: direction or specimen, frequency and amplitude.

    Args:
        place: direction of the bushing, or name of a specimen, which every campaign of the batch must contain.
        frequency: frequency [Hz].
        amplitude: zero-to-peak amplitude [m or rad], or strain amplitude [1].
        unit: SI unit of the amplitude.
    """

    place: str
    frequency: float
    amplitude: float
    unit: str

    @property
    def motion(self) -> Motion:
        """Kind of motion (translation, rotation or straining) that has the unit of the amplitude."""
        return next(motion for motion in (TRANSLATION, ROTATION, STRAINING) if motion.displacement_unit == self.unit)

    def __str__(self) -> str:
        unit, factor = self.motion.display.displacement
        return f"{self.place} {self.frequency:.6g} Hz {self.amplitude * factor:.6g} {unit}"


def parse_point(text: str) -> Point:
    """Parse an operating point such as "axial 25 Hz 0.1 mm".

    With several bushings, the name of the bushing comes first: "long axial" is the axial direction of "long". A name
    that resembles no direction is the name of a specimen.

    Returns:
        The point in SI units.

    Raises:
        UnitError: a mistyped direction, missing numbers, or incompatible units.
    """
    expected = 'direction, frequency and amplitude, such as "axial 25 Hz 0.1 mm" or "torsion 10 Hz 1 deg"'
    match = _POINT.fullmatch(text)
    axis = match[1].split()[-1] if match else ""
    if not match or (axis not in set(Direction) and did_you_mean(match[1].lower(), list(Direction))):
        hint = "write numbers with a decimal point" if re.search(r"\d,\d", text) else None
        raise UnitError("this is not an operating point", found=repr(text), expected=expected, hint=hint)
    strain = is_compatible(match[3].lstrip("+-.0123456789eE "), STRAINING.displacement_unit)
    of_specimen = STRAINING if strain else TRANSLATION
    motion = Direction(axis).motion if axis in set(Direction) else of_specimen
    frequency, amplitude = parse_quantity(match[2], "Hz"), parse_quantity(match[3], motion.displacement_unit)
    if not (frequency > 0.0 and amplitude > 0.0):
        raise UnitError("frequency and amplitude have to be above zero", found=repr(text), expected=expected)
    return Point(match[1], frequency, amplitude, motion.displacement_unit)


_POINT_SCHEMA = {"type": "string", "description": 'a place, a frequency and an amplitude: "axial 25 Hz 0.1 mm"'}
#: A point as a value in a TOML file.
PointText = Annotated[Point, converter(lambda raw, _: parse_point(raw) if isinstance(raw, str) else raw, _POINT_SCHEMA)]
