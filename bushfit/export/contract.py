"""What every export format is given, the unit system of a solver among it, and what it gives back."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Literal

from bushfit.effects.contract import Circumstances
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import UnitError
from bushfit.geometry import ROTATION, STRAINING, Display, Motion, Place, Unit
from bushfit.model.arms import Arms
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.stiffness import Prediction
from bushfit.reading.measurement import Source
from bushfit.units import CELSIUS, format_range, is_compatible, number, si_factor

#: What the four units of a system measure, in SI.
_BASES = ("m", "kg", "s", "N")
#: Relative error up to which a force counts as mass times acceleration: pounds and inches are known to ten digits.
_ROUNDING = 1e-6
#: Whose bulk data the format `nastran` writes: MSC and NX Nastran's, or Altair OptiStruct's.
Dialect = Literal["nastran", "optistruct"]


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
            base = next((base for base in _BASES if is_compatible(word, base)), None)
            if base is None:
                raise refused(f'"{word}" is none of the four units')
            if base in found:
                raise refused(f'"{found[base].name}" and "{word}" measure the same')
            found[base] = Unit(word, 1.0 / si_factor(word, base))
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


@dataclass(frozen=True, eq=False)
class Order:
    """A model to be written for another program.

    Args:
        result: the fitted model.
        source: the file it came from, with its SHA-256.
        predictions: its dynamic stiffness over the whole grid of frequencies and amplitudes, one a place.
        accuracy: largest relative error of the modulus that arms in place of a springpot may have.
        units: of the files; None leaves them to the format: mm, t, s and N in decks, those of people in tables.
        dialect: of the format `nastran`.
        decimal_comma: whether the format `csv` has semicolons and decimal commas.
        temperature: of the rubber [K], of a model that knows it; None for its reference.
        day: of writing, as decks state it; None leaves it out.
    """

    result: Result
    source: Source
    predictions: tuple[Prediction, ...]
    accuracy: float
    units: UnitSystem | None = None
    dialect: Dialect = "nastran"
    decimal_comma: bool = False
    temperature: float | None = None
    day: str | None = None

    def remarks(self, losses: Iterable[str]) -> Iterator[tuple[str, str]]:
        """What every format says beside its numbers: the campaign and its days, the temperature, of each place within
        what the tests were fitted, what it leaves out, all warnings."""
        campaign, measured, model = self.result.campaign, self.result.measured, self.result.model
        if campaign:
            days = sorted({str(test.conditions["date"]) for test in campaign.tests if "date" in test.conditions})
            yield "campaign", f"{campaign.name}, {campaign.file}, sha256 {campaign.sha256}"
            yield "tests", f"{len(campaign.tests)}, {'made ' + ', '.join(days) if days else 'no date stated'}"
        if model.knows_temperature:
            warmth = number((self.temperature or REFERENCE) - CELSIUS, 3)
            yield "temperature", f"{warmth} degC, as if it were the same at all times and throughout"
        if measured:
            for place in self.places:
                unit, factor = place.display.displacement
                reached = [factor * strain / model.unit_strain(place) for strain in measured.strain]
                warm = [kelvin - CELSIUS for kelvin in measured.temperature or ()]
                parts = [str(place), format_range("Hz", *measured.frequency), format_range(unit, *reached)]
                parts.append(format_range("degC", *warm) if warm else "temperature not stated")
                parts.append("fitted there" if str(place) in measured.directions else "not fitted there")
                yield "valid", ", ".join(parts)
        yield from (("left out", loss) for loss in losses)
        warnings = warnings_of(self.result, [prediction.warnings for prediction in self.predictions])
        yield from (("warning", line) for line in warnings)

    @property
    def under(self) -> Circumstances:
        """What the rubber is under."""
        return Circumstances(self.temperature)

    @property
    def places(self) -> tuple[Place, ...]:
        """Directions and specimens that are exported."""
        return tuple(prediction.direction for prediction in self.predictions)


@dataclass(frozen=True, eq=False)
class Exported:
    """The files of an export by name, what it could not carry, and the error that this costs; and its Maxwell arms."""

    files: Mapping[str, bytes]
    losses: tuple[str, ...] = ()
    arms: tuple[Arms, ...] = ()
