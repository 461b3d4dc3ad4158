"""Quantities of a part for tables, limits and figures, some of them at operating points."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

import numpy as np

from bushfit.batch.document import Estimate
from bushfit.effects import get_parameter, is_parameter, library_parameters
from bushfit.geometry.point import Point
from bushfit.model.covariance import Z95
from bushfit.reading.measurement import Sweep
from bushfit.report.tables import spread_indices
from bushfit.units import display_unit

#: Relative distance in frequency and in amplitude within which a measured point matches a requested one. Chosen: rigs
#: miss their set points by less, and the stiffness of filled rubber changes by less than 1 % over it.
_SAME_FREQUENCY, _SAME_AMPLITUDE = 0.02, 0.05
#: Maximum number of points of a measured curve.
_CURVE_POINTS = 12


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
