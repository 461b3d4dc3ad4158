"""What is asked of a bushing: operating points in words, and the quantities that are tabled, judged and drawn."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from bushfit.effects import get_parameter, is_parameter, parameter_names
from bushfit.errors import UnitError, did_you_mean
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Direction, Motion
from bushfit.reading.measurement import Sweep
from bushfit.units import display_unit, is_compatible, parse_quantity
from bushfit.validation import converter

#: A direction or a specimen, a frequency and an amplitude, each number with its unit.
_WORDS = re.compile(r"\s*(\S.*?)[\s,]+([-+\d.eE]+\s*[A-Za-z]+)[\s,]+([-+\d.eE]+\s*[^\d\s.]+)\s*")
#: What is known of a quantity, in order, by the end of its column's header: the value [SI], low and high of its 95 %
#: interval, and standard error.
PARTS = {"": 0, ", std error": 3, ", low": 1, ", high": 2}


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
    strain = is_compatible(match[3].lstrip("+-.0123456789eE "), STRAINING.displacement_unit)
    of_specimen = STRAINING if strain else TRANSLATION
    motion = Direction(match[1]).motion if match[1] in set(Direction) else of_specimen
    frequency, amplitude = parse_quantity(match[2], "Hz"), parse_quantity(match[3], motion.displacement_unit)
    if not (frequency > 0.0 and amplitude > 0.0):
        raise UnitError("frequency and amplitude have to be above zero", found=repr(text), expected=expected)
    return Point(match[1], frequency, amplitude, motion.displacement_unit)


_WRITTEN = {"type": "string", "description": 'a place, a frequency and an amplitude: "axial 25 Hz 0.1 mm"'}
#: A point as a key of a TOML file.
At = Annotated[Point, converter(lambda raw, _: parse_point(raw) if isinstance(raw, str) else raw, _WRITTEN)]


@dataclass(frozen=True)
class Quantity:
    """One number of a bushing: what it is called, its unit and the factor from SI to it."""

    name: str
    unit: str
    factor: float = 1.0

    def for_people(self, size: float) -> Quantity:
        """The same in the unit in which people read numbers of that size [SI]."""
        return Quantity(self.name, *display_unit(self.unit, self.factor, size))

    @property
    def tabled(self) -> Quantity:
        """The same as tables have it: a parameter in the unit for its usual size, whatever it is in this batch."""
        return self.for_people(get_parameter(self.name).typical) if is_parameter(self.name) else self

    @property
    def header(self) -> str:
        return f"{self.name} [{self.unit}]"


#: Of the fit, by key of a record: root mean square difference of model and tests, relative, and mean square residual in
#: units of noise.
OF_FIT = {"nrmse": Quantity("NRMSE", "-"), "reduced_chi_square": Quantity("reduced chi-square", "-")}
#: What is told of an operating point: |K| ...
STIFFNESS = "stiffness"
#: ... and K''/K'.
LOSS_FACTOR = "loss factor"


def at_point(point: Point, what: str) -> Quantity:
    """Stiffness or loss factor at an operating point."""
    unit, factor = point.motion.display.stiffness if what == STIFFNESS else ("-", 1.0)
    return Quantity(f"{what} {point}", unit, factor)


def parameter_quantities(names: Collection[str]) -> list[Quantity]:
    """Parameters of the library that are among the names, in its order."""
    in_order = dict.fromkeys([*parameter_names(), *sorted(filter(is_parameter, names))])
    units = {name: get_parameter(name).unit for name in in_order if name in names}
    return [Quantity(name, "-" if unit == "1" else unit) for name, unit in units.items()]


def curve_of(sweeps: Iterable[Sweep]) -> dict[str, float]:
    """|K| [SI] by operating point, of at most twelve steps of the first sweep that holds a level, the middle one.

    Levels and steps have three digits, so that bushings of which a rig reached a little more are told alike.
    """
    for sweep in sweeps:
        held, step = (np.array([float(f"{x:.3g}") for x in each]) for each in (sweep.held, sweep.step))
        levels = [level for level in np.unique(held) if sweep.stepped and np.unique(step[held == level]).size >= 3]
        if levels:
            there = held == levels[(len(levels) - 1) // 2]
            steps = np.unique(step[there])
            found = {}
            for x in steps[np.linspace(0, steps.size - 1, min(steps.size, 12)).round().astype(int)].tolist():
                pair = (x, held[there][0]) if sweep.stepped == "frequency" else (held[there][0], x)
                point = Point(str(sweep.direction), *pair, sweep.direction.motion.displacement_unit)
                found[str(point)] = float(np.abs(sweep.stiffness[there & (step == x)]).mean())
            return found
    return {}


def figures(record: Mapping[str, Any]) -> Iterator[tuple[str, tuple[float | None, ...]]]:
    """All quantities of a row's record that are known, by name: value, low, high and standard error."""
    for name, (value, low, high, stderr, _) in record.get("parameters", {}).items():
        yield name, (value, low, high, stderr)
    for key, of_fit in OF_FIT.items():
        yield of_fit.name, (record.get(key), None, None, None)
    for point, pair in record.get("points", {}).items():
        for what, (value, low, high) in pair.items():
            yield f"{what} {point}", (value, low, high, None)
