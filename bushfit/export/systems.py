"""Unit systems of solvers, which know no units: four that fit together, such as mm, t, s and N."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

from bushfit.errors import UnitError
from bushfit.geometry import ROTATION, STRAINING, Display, Motion, Unit
from bushfit.units import agrees, factor, number

#: What the four units of a system measure, in SI.
_BASES = ("m", "kg", "s", "N")
#: Relative error up to which a force counts as mass times acceleration: pounds and inches are known to ten digits.
_ROUNDING = 1e-6


@dataclass(frozen=True)
class UnitSystem:
    """Units of length, mass, time and force, in which force is mass times acceleration.

    Each has its name and the factor from SI to it.
    """

    length: Unit
    mass: Unit
    time: Unit
    force: Unit

    @classmethod
    def parse(cls, text: str) -> UnitSystem:
        """The system that a text such as "mm t s N" names, its units in any order.

        Raises:
            UnitError: not one unit each of length, mass, time and force, or units that do not fit together.
        """
        refused = partial(UnitError, found=f'"{text}"', expected='a length, a mass, a time and a force: "mm t s N"')
        found: dict[str, Unit] = {}
        for word in text.replace(",", " ").split():
            base = next((base for base in _BASES if agrees(word, base)), None)
            if base is None:
                raise refused(f'"{word}" is none of the four units')
            if base in found:
                raise refused(f'"{found[base].name}" and "{word}" measure the same')
            found[base] = Unit(word, 1.0 / factor(word, base))
        if len(found) < len(_BASES):
            raise refused("a unit is missing")
        system = cls(*(found[base] for base in _BASES))
        newtons = system.time.factor**2 / (system.mass.factor * system.length.factor)
        if not math.isclose(newtons * system.force.factor, 1.0, rel_tol=_ROUNDING):
            raise refused(
                f"{system.mass.name} times {system.length.name}/{system.time.name}^2 is {number(newtons, 6)} N, "
                f"and not one {system.force.name}",
                hint='such as "mm t s N", "m kg s N", "mm kg ms kN" or "in lbf*s^2/in s lbf"',
            )
        return system

    def __str__(self) -> str:
        return ", ".join(unit.name for unit in (self.length, self.mass, self.time, self.force))

    @property
    def frequency(self) -> Unit:
        """Cycles per unit of time."""
        return Unit("Hz" if self.time.name == "s" else f"1/{self.time.name}", 1.0 / self.time.factor)

    @property
    def stress(self) -> Unit:
        """Force per area, of moduli."""
        return Unit(f"{self.force.name}/{self.length.name}^2", self.force.factor / self.length.factor**2)

    def display(self, motion: Motion) -> Display:
        """The units of displacement, force and stiffness of a kind of motion; angles are in rad."""
        length, force = self.length, self.force
        if motion is STRAINING:
            return Display(Unit("-", 1.0), self.stress, self.stress)
        if motion is ROTATION:
            moment = Unit(f"{force.name}*{length.name}", force.factor * length.factor)
            return Display(Unit("rad", 1.0), moment, Unit(f"{moment.name}/rad", moment.factor))
        return Display(length, force, Unit(f"{force.name}/{length.name}", force.factor / length.factor))


#: The system of most decks for bushings.
MM_T_S_N = UnitSystem(Unit("mm", 1e3), Unit("t", 1e-3), Unit("s", 1.0), Unit("N", 1.0))
