"""Kinds of motion in a test: translation, rotation and strain, with the names and units of their quantities."""

import math
from dataclasses import dataclass
from typing import NamedTuple

from bushfit.units import format_range


class Unit(NamedTuple):
    """Unit of a quantity: a value in SI times `factor` is the value in this unit."""

    name: str
    factor: float

    def text(self, *values: float, digits: int = 3) -> str:
        """Format a positive value, or the ends of a range: "0.2 mm", "0.1 to 0.5 mm".

        Args:
            *values: values [SI].
            digits: number of significant digits.
        """
        return format_range(self.name, *(self.factor * value for value in values), digits=digits)


class Display(NamedTuple):
    """Units in which displacement, force and stiffness are printed, each with its factor from SI."""

    displacement: Unit
    force: Unit
    stiffness: Unit


@dataclass(frozen=True)
class Motion:
    """Kind of motion in a test (translation, rotation or strain), with the names and units of displacement and force.

    Args:
        words: names of displacement, force and stiffness, such as "rotation", "moment" and "stiffness".
        displacement_unit, force_unit, stiffness_unit: SI units.
        display: display units of displacement, force and stiffness.
    """

    words: tuple[str, str, str]
    displacement_unit: str
    force_unit: str
    stiffness_unit: str
    display: Display


TRANSLATION = Motion(
    words=("displacement", "force", "stiffness"),
    displacement_unit="m",
    force_unit="N",
    stiffness_unit="N/m",
    display=Display(Unit("mm", 1e3), Unit("N", 1.0), Unit("N/mm", 1e-3)),
)
ROTATION = Motion(
    words=("rotation", "moment", "stiffness"),
    displacement_unit="rad",
    force_unit="N*m",
    stiffness_unit="N*m/rad",
    display=Display(Unit("deg", math.degrees(1.0)), Unit("N m", 1.0), Unit("N m/rad", 1.0)),
)
#: Motion of a material test, in terms of strain and stress, whatever the shape of the specimen.
STRAINING = Motion(
    words=("strain", "stress", "modulus"),
    displacement_unit="1",
    force_unit="Pa",
    stiffness_unit="Pa",
    display=Display(Unit("%", 100.0), Unit("kPa", 1e-3), Unit("MPa", 1e-6)),
)
