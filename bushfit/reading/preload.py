"""Preload of a test: the static displacement or force about which it was made."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

from bushfit.errors import UnitError
from bushfit.geometry import Direction, Place
from bushfit.units import number, parse_quantity

#: Difference of two preloads, relative to the larger one, up to which they are the same preload.
SAME_PRELOAD = 0.02


class Preload(NamedTuple):
    """Static displacement or force about which a test was made, in the direction of the test.

    Args:
        value: displacement [m or rad, or strain], or force [N or N m, or Pa].
        unit: SI unit of a displacement or of a force.
    """

    value: float
    unit: str

    def in_display_unit(self, place: Place) -> tuple[float, str]:
        """Value and unit for users, such as (1.5, "mm"), of a preload in a direction."""
        units = place.display.force if self.unit == place.motion.force_unit else place.display.displacement
        return self.value * units.factor, units.name

    def text(self, place: Place, digits: int = 4) -> str:
        """Text for users with some significant digits, such as "1.5 mm", of a preload in a direction."""
        value, unit = self.in_display_unit(place)
        return f"{number(value, digits)} {unit}"

    def equals(self, preload: Preload | None) -> bool:
        """True if a second preload agrees within 2 %; a preload of zero equals zero in every unit."""
        if preload is None or (self.unit != preload.unit and (self.value or preload.value)):
            return False
        return abs(self.value - preload.value) <= SAME_PRELOAD * max(abs(self.value), abs(preload.value))


def add_preload(text: str, preload: Preload | None, place: Place) -> str:
    """Add the preload to the text on a test or prediction, as in "axial at a preload of 500 N".

    Args:
        text: text on the test.
        preload: preload of the test; None, or a preload of zero, leaves the text as it is.
        place: direction or specimen of the test.
    """
    return f"{text} at a preload of {preload.text(place)}" if preload and preload.value else text


def parse_preload(text: str | None, place: Place) -> Preload | None:
    """Parse the preload that a campaign states for a test of a direction or specimen.

    Args:
        text: text of the campaign, such as "500 N", "1.5 mm axial" or "none"; None if the campaign states none.
        place: direction or specimen of the test.

    Returns:
        The preload; None if the text is not a displacement or force in this direction.
    """
    words = (text or "").split()
    if words and words[-1].lower() in [*Direction] and words.pop().lower() != str(place):
        return None
    if [word.lower() for word in words] in (["none"], ["0"]):
        return Preload(0.0, place.motion.force_unit)
    for unit in (place.motion.displacement_unit, place.motion.force_unit):
        with suppress(UnitError):
            return Preload(parse_quantity(" ".join(words), unit), unit)
    return None


def distinct_preloads(preloads: Sequence[Preload]) -> list[Preload]:
    """List the different preloads of the tests of one direction; preloads within 2 % of each other are equal.

    Returns:
        Preloads in ascending order; empty if some are forces and others displacements.
    """
    distinct = list[Preload]()
    for preload in sorted(preloads):
        if not distinct or not preload.equals(distinct[-1]):
            distinct.append(preload)
    return distinct if len({preload.unit for preload in distinct}) == 1 else []
