"""What is tabled, judged and drawn of a bushing: parameters, quality, stiffness and loss factor at points."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from bushfit.batch.points import Point
from bushfit.effects import is_parameter, parameter_named, parameter_names
from bushfit.units import for_people

#: What is known of a quantity, in order, by the end of its column's header: the value [SI], low and high of its 95 %
#: interval, and standard error.
PARTS = {"": 0, ", std error": 3, ", low": 1, ", high": 2}


@dataclass(frozen=True)
class Quantity:
    """One number of a bushing: what it is called, its unit and the factor from SI to it."""

    name: str
    unit: str
    factor: float = 1.0

    def for_people(self, size: float) -> Quantity:
        """The same in the unit in which people read numbers of that size [SI]."""
        return Quantity(self.name, *for_people(self.unit, self.factor, size))

    @property
    def tabled(self) -> Quantity:
        """The same as tables have it: a parameter in the unit for its usual size, whatever it is in this batch."""
        return self.for_people(parameter_named(self.name).typical) if is_parameter(self.name) else self

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
    units = {name: parameter_named(name).unit for name in in_order if name in names}
    return [Quantity(name, "-" if unit == "1" else unit) for name, unit in units.items()]


def figures(record: Mapping[str, Any]) -> Iterator[tuple[str, tuple[float | None, ...]]]:
    """All quantities of a row's record that are known, by name: value, low, high and standard error."""
    for name, (value, low, high, stderr, _) in record.get("parameters", {}).items():
        yield name, (value, low, high, stderr)
    for key, quantity in OF_FIT.items():
        yield quantity.name, (record.get(key), None, None, None)
    for point, pair in record.get("points", {}).items():
        for what, (value, low, high) in pair.items():
            yield f"{what} {point}", (value, low, high, None)
