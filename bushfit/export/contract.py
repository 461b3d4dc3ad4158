"""Input and output of every export format, and the unit systems of solvers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.contract import RubberConditions
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import UnitError
from bushfit.geometry import ROTATION, STRAINING, Display, Motion, Place, Unit
from bushfit.model.arms import Arms
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.stiffness import Prediction
from bushfit.reading.measurement import Source
from bushfit.units import CELSIUS, format_range, is_compatible, number, si_factor

#: SI units of the four quantities of a system.
_BASES = {"m": "length", "kg": "mass", "s": "time", "N": "force"}
#: Relative tolerance of force = mass * acceleration in a system.
_ROUNDING = 1e-6
#: Bulk data of MSC and NX Nastran, or of Altair OptiStruct.
Dialect = Literal["nastran", "optistruct"]


@dataclass(frozen=True)
class UnitSystem:
    """Consistent units of length, mass, time and force of a solver, each with the factor from SI."""

    length: Unit
    mass: Unit
    time: Unit
    force: Unit

    @classmethod
    def parse(cls, text: str) -> UnitSystem:
        """Parse a unit system of a solver such as "mm t s N", with the units in any order.

        Returns:
            The system, each unit with its factor from SI.

        Raises:
            UnitError: a unit is missing, repeated or unknown, or force is not mass times acceleration.
        """
        refuse = partial(UnitError, found=f'"{text}"', expected='a length, a mass, a time and a force: "mm t s N"')
        units: dict[str, Unit] = {}
        for word in text.replace(",", " ").split():
            base = next((base for base in _BASES if is_compatible(word, base)), None)
            if base is None:
                raise refuse(f'"{word}" is not a unit of length, mass, time or force')
            if base in units:
                raise refuse(f'"{units[base].name}" and "{word}" are both units of {_BASES[base]}')
            units[base] = Unit(word, 1.0 / si_factor(word, base))
        if len(units) < len(_BASES):
            raise refuse("a unit is missing")
        system = cls(*(units[base] for base in _BASES))
        newtons = system.time.factor**2 / (system.mass.factor * system.length.factor)
        if not math.isclose(newtons * system.force.factor, 1.0, rel_tol=_ROUNDING):
            raise refuse(
                f"{system.mass.name} times {system.length.name}/{system.time.name}^2 is {number(newtons, 6)} N, "
                f"and not one {system.force.name}",
                hint='such as "mm t s N", "m kg s N", "mm kg ms kN" or "in lbf*s^2/in s lbf"',
            )
        return system

    def __str__(self) -> str:
        return ", ".join(unit.name for unit in (self.length, self.mass, self.time, self.force))

    @property
    def frequency(self) -> Unit:
        """Unit of frequency in this unit system, the inverse of the unit of time, with its factor from Hz."""
        return Unit("Hz" if self.time.name == "s" else f"1/{self.time.name}", 1.0 / self.time.factor)

    @property
    def stress(self) -> Unit:
        """Unit of stresses and moduli in this unit system, with its factor from Pa."""
        return Unit(f"{self.force.name}/{self.length.name}^2", self.force.factor / self.length.factor**2)

    def display(self, motion: Motion) -> Display:
        """Units of displacement, force and stiffness for a kind of motion in this system; angles are in rad.

        Returns:
            Units with their factors from SI.
        """
        length, force = self.length, self.force
        if motion is STRAINING:
            return Display(Unit("-", 1.0), self.stress, self.stress)
        if motion is ROTATION:
            moment = Unit(f"{force.name}*{length.name}", force.factor * length.factor)
            return Display(Unit("rad", 1.0), moment, Unit(f"{moment.name}/rad", moment.factor))
        return Display(length, force, Unit(f"{force.name}/{length.name}", force.factor / length.factor))


#: The unit system of most decks for bushings.
MM_T_S_N = UnitSystem(Unit("mm", 1e3), Unit("t", 1e-3), Unit("s", 1.0), Unit("N", 1.0))


@dataclass(frozen=True, eq=False)
class ExportRequest:
    """Input of every export format: a fitted model, its predictions, and the settings of the export.

    Args:
        result: fitted model.
        source: model file with its SHA-256.
        predictions: dynamic stiffness over the grid of frequencies and amplitudes, one per direction or specimen.
        accuracy: largest relative error of the modulus of Maxwell arms that replace a springpot.
        units: unit system of the files; None for the default: mm, t, s and N in decks, display units in tables.
        dialect: solver of the format `nastran`.
        decimal_comma: True for semicolons and decimal commas in the format `csv`.
        temperature: temperature of the rubber [K]; None for the reference temperature of the model.
        static_rates: rates of static curves by SI unit of displacement; None for the rates of the slowest loop.
        time_domain: True for materials in the time domain in the format `abaqus`.
        cardanic: complex stiffness of the rotations about x and y in decks [N m/rad]; None to leave them free.
        day: date to write into decks; None for no date.
    """

    result: Result
    source: Source
    predictions: tuple[Prediction, ...]
    accuracy: float
    units: UnitSystem | None = None
    dialect: Dialect = "nastran"
    decimal_comma: bool = False
    temperature: float | None = None
    static_rates: Mapping[str, float] | None = None
    time_domain: bool = False
    cardanic: complex | None = None
    day: str | None = None

    def remarks(self, omissions: Iterable[Caveat]) -> Iterator[tuple[str, str]]:
        """Generate the notes for the head of an exported file.

        Args:
            omissions: properties of the model that the format cannot represent.

        Yields:
            Kind and text of each note: campaign, tests, temperature, range of validity, omissions and warnings.
        """
        campaign, measured, model = self.result.campaign, self.result.measured, self.result.model
        if campaign:
            days = sorted({str(test.conditions["date"]) for test in campaign.tests if "date" in test.conditions})
            yield "campaign", f"{campaign.name}, {campaign.file}, sha256 {campaign.sha256}"
            yield "tests", f"{len(campaign.tests)}, {'made ' + ', '.join(days) if days else 'no date stated'}"
        if "temperature" in model.depends_on:
            celsius = number((self.temperature or REFERENCE) - CELSIUS, 3)
            yield "temperature", f"{celsius} degC, assumed constant in time and in the whole bushing"
        if measured:
            for place in self.places:
                fitted = str(place) in measured.directions
                tests = [test for test in campaign.tests if test.place == str(place)] if campaign and fitted else []
                strained = tuple(strain / model.unit_strain(place) for strain in measured.strain)
                frequencies = np.array([test.frequency_Hz for test in tests] or measured.frequency)
                amplitudes = np.array([test.amplitude for test in tests] or strained)
                parts = [str(place), format_range("Hz", frequencies.min(), frequencies.max())]
                parts.append(place.display.displacement.text(amplitudes.min(), amplitudes.max()))
                temperatures = [kelvin - CELSIUS for kelvin in measured.temperature or ()]
                parts.append(format_range("degC", *temperatures) if temperatures else "temperature not stated")
                parts.append("fitted" if fitted else "not fitted")
                yield "valid", ", ".join(parts)
        yield from (("limit", omission.text) for omission in omissions)
        warnings = warnings_of(self.result, [prediction.warnings for prediction in self.predictions])
        yield from (("warning", warning.text) for warning in warnings)

    @property
    def conditions(self) -> RubberConditions:
        """Conditions of the rubber in the exported files: its temperature, without preload and history."""
        return RubberConditions(self.temperature)

    @property
    def places(self) -> tuple[Place, ...]:
        """Directions and specimens whose predictions are exported."""
        return tuple(prediction.direction for prediction in self.predictions)


@dataclass(frozen=True, eq=False)
class ExportedFiles:
    """Files that an export format makes, and properties of the model that it cannot represent.

    Args:
        files: content by file name.
        omissions: properties that the format cannot represent: of the kind "format_error" if the sentence states the
            error that this causes, else "format_omission".
        arms: groups of Maxwell arms in the files; empty if the format has none.
    """

    files: Mapping[str, bytes]
    omissions: Sequence[Caveat] = ()
    arms: tuple[Arms, ...] = ()
