"""Operating points as text, and the quantities of a part for tables, limits and figures."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from bushfit.batch.document import Estimate
from bushfit.effects import get_parameter, is_parameter, library_parameters
from bushfit.errors import UnitError, did_you_mean
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Direction, Motion
from bushfit.model.covariance import Z95
from bushfit.reading.measurement import Sweep
from bushfit.report.tables import spread_indices
from bushfit.units import display_unit, is_compatible, parse_quantity
from bushfit.validation import converter

#: Text of an operating point: direction or specimen, frequency and amplitude, each number with its unit.
_POINT = re.compile(r"\s*(\S.*?)[\s,]+([-+\d.eE]+\s*[A-Za-z]+)[\s,]+([-+\d.eE]+\s*[^\d\s.]+)\s*")
#: Relative distance in frequency and in amplitude within which a measured point matches a requested one. Chosen: rigs
#: miss their set points by less, and the stiffness of filled rubber changes by less than 1 % over it.
_SAME_FREQUENCY, _SAME_AMPLITUDE = 0.02, 0.05
#: Maximum number of points of a measured curve.
_CURVE_POINTS = 12


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


@dataclass(frozen=True)
class PartQuantity:
    """Quantity that is evaluated for each part of a batch.

    Args:
        name: name of the quantity, such as "mu" or "stiffness axial 25 Hz 0.1 mm".
        unit: display unit.
        factor: factor from SI to the display unit.
    """

    name: str
    unit: str
    factor: float = 1.0

    def in_display_unit(self, value: float) -> PartQuantity:
        """Copy of the quantity with the display unit for a value of this magnitude [SI], such as MPa for 2e6 Pa."""
        return PartQuantity(self.name, *display_unit(self.unit, self.factor, value))

    @property
    def in_table_unit(self) -> PartQuantity:
        """Copy of the quantity in the unit of its table column, which for a parameter is that of a typical value."""
        return self.in_display_unit(get_parameter(self.name).typical) if is_parameter(self.name) else self

    @property
    def header(self) -> str:
        """Column header of the quantity in the batch table: name and unit, such as "mu [MPa]"."""
        return f"{self.name} [{self.unit}]"


#: Quality of the fit: NRMSE is the relative root mean square difference of model and tests, reduced chi-square the mean
#: square residual in units of noise. The keys are those of a limits file.
FIT_QUALITY = {
    "nrmse": PartQuantity("NRMSE", "%", 100.0),
    "reduced_chi_square": PartQuantity("reduced chi-square", "-"),
}
FIT_NAMES = frozenset(quantity.name for quantity in FIT_QUALITY.values())
#: Quantities at an operating point: |K|, and K''/K'.
STIFFNESS, LOSS_FACTOR = "stiffness", "loss factor"


def point_quantity(point: Point, name: str) -> PartQuantity:
    """Make the quantity "stiffness" or "loss factor" (`name`) at an operating point."""
    unit, factor = point.motion.display.stiffness if name == STIFFNESS else ("-", 1.0)
    return PartQuantity(f"{name} {point}", unit, factor)


def list_quantities(names: Collection[str], points: Iterable[Point]) -> dict[str, PartQuantity]:
    """List the quantities of a batch by name: parameters, quality of the fit, then stiffness and loss factor at points.

    Args:
        names: names of the quantities that have values; those that are parameters are listed in library order.
        points: operating points of stiffness and loss factor.
    """
    in_order = dict.fromkeys([*library_parameters(), *sorted(filter(is_parameter, names))])
    units = {name: get_parameter(name).unit for name in in_order if name in names}
    parameters = [PartQuantity(name, "-" if unit == "1" else unit) for name, unit in units.items()]
    at_points = [point_quantity(point, name) for point in points for name in (STIFFNESS, LOSS_FACTOR)]
    return {quantity.name: quantity for quantity in (*parameters, *FIT_QUALITY.values(), *at_points)}


def measured_at(sweeps: Iterable[Sweep], point: Point, noise: float) -> dict[str, Estimate]:
    """Mean measured stiffness and loss factor at an operating point, with 95 % intervals.

    Args:
        sweeps: sweeps of one part.
        point: operating point.
        noise: standard deviation of the real and imaginary part of one measured point, relative to |K|.

    Returns:
        Means over the repeats [SI] by name of the quantity; empty if no sweep contains the point.
    """
    for sweep in sweeps:
        near = np.abs(sweep.frequency / point.frequency - 1.0) <= _SAME_FREQUENCY
        near &= np.abs(sweep.amplitude / point.amplitude - 1.0) <= _SAME_AMPLITUDE
        if str(sweep.direction) == point.place and near.any():
            mean, error = complex(sweep.stiffness[near].mean()), noise / float(near.sum()) ** 0.5
            stiffness, loss = abs(mean), mean.imag / mean.real
            errors = (stiffness, stiffness * error, point.motion.stiffness_unit), (loss, (1.0 + loss**2) * error, "1")
            return {
                f"{name} {point}": Estimate(value, value - Z95 * stderr, value + Z95 * stderr, stderr, unit)
                for name, (value, stderr, unit) in zip((STIFFNESS, LOSS_FACTOR), errors, strict=True)
            }
    return {}


def measured_curve(sweeps: Iterable[Sweep]) -> dict[str, float]:
    """Measured |K| along one run of a sweep, for the comparison of the parts of a batch.

    The run is that of the middle constant amplitude (or frequency) of the first sweep over frequency (or amplitude).
    Both are rounded to three digits, so that parts have common points although a rig reaches its set points with some
    error.

    Args:
        sweeps: sweeps of one part.

    Returns:
        |K| [SI] by operating point, at most twelve points.
    """
    for sweep in sweeps:
        constant, step = (np.array([float(f"{x:.3g}") for x in values]) for values in (sweep.run_level, sweep.step))
        levels = [level for level in np.unique(constant) if np.unique(step[constant == level]).size >= 3]
        if not levels or not sweep.stepped:
            continue
        level = float(levels[(len(levels) - 1) // 2])
        steps = np.unique(step[constant == level])
        curve = {}
        for x in steps[spread_indices(steps.size, _CURVE_POINTS)].tolist():
            frequency, amplitude = (x, level) if sweep.stepped == "frequency" else (level, x)
            point = Point(str(sweep.direction), frequency, amplitude, sweep.direction.motion.displacement_unit)
            curve[str(point)] = float(np.abs(sweep.stiffness[(constant == level) & (step == x)]).mean())
        return curve
    return {}
