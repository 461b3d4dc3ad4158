"""Adams Car: bushing property files (.bus), a force over displacement and a damping in each of six directions.

The curve is the storage stiffness at the lowest frequency times each amplitude, so that it softens as the rubber does.
The damping is one number: in `bushing_car.bus` a viscous damper, in `bushing_ride.bus` the loss angle that the bushing
of Adams Car Ride reads there. Both are those of the middle frequency and amplitude of the grid. A file states
its units, which Adams converts; they are mm, newton, degrees and second.

Source: Adams Car Ride help, "Frequency Bushing" (damping coefficients are interpreted as loss angles); blocks,
attributes and units as in the public fixture `fixture.bus` of the package suspension_multibody, which reads them;
Altair TeimOrbit format and AutoBush, which reads the same files.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bushfit.effects.contract import Array
from bushfit.export.contract import Exported, Order
from bushfit.export.deck import (
    DOFS,
    Table,
    commented,
    directions,
    heading,
    middle,
    of_all,
    of_band,
    real,
    stated,
    tables,
    to_bytes,
)
from bushfit.geometry import ROTATION, TRANSLATION
from bushfit.prediction.caveats import percent_off
from bushfit.reading.measurement import loss_factor
from bushfit.units import number

#: Names of what moves and what resists in each degree of freedom: x and fx to az and tz.
_AXES = (("x", "fx"), ("y", "fy"), ("z", "fz"), ("ax", "tx"), ("ay", "ty"), ("az", "tz"))
#: From SI to the displacement and force of the files: mm and N, deg and N mm.
_SCALES = {TRANSLATION: (1e3, 1.0), ROTATION: (float(np.degrees(1.0)), 1e3)}
#: Units of the files.
_UNITS = {"LENGTH": "mm", "ANGLE": "degrees", "FORCE": "newton", "MASS": "kg", "TIME": "second"}
#: What of the damping column each file has.
_KINDS = {
    "car": "damping: viscous, N s/mm and N mm s/deg",
    "ride": "damping: the loss angle in deg, for the frequency bushing of Adams Car Ride alone",
}


class _Element(NamedTuple):
    """What stands for a direction: its tables by amplitude, and the points of its curve, (n,) [m, N or rad, N m].

    The damping is right at the frequency `at` [Hz] of the table `reference`, where the stiffness is `there`.
    """

    tables: Sequence[Table]
    moved: Array
    force: Array
    reference: Table
    at: float
    there: complex

    def damping(self, kind: str) -> float:
        """A damper's constant [N s/m or N m s/rad], or a loss angle [rad]."""
        return float(self.there.imag / (2.0 * np.pi * self.at) if kind == "car" else np.angle(self.there))

    def stiffness(self, kind: str, table: Table) -> Array:
        """Complex stiffness of the element at the points of a table, (n,)."""
        storage = np.interp(table.amplitude, self.moved, self.force) / table.amplitude
        if kind == "ride":
            return np.full(table.frequency.size, storage * (1.0 + 1j * np.tan(self.damping(kind))))
        return storage + 2j * np.pi * table.frequency * self.damping(kind)


def export(order: Order) -> Exported:
    """One file for Adams Car and one for Adams Car Ride, and what they leave out."""
    elements = [_element(tables(each)) for each in directions(order)]
    shared = [line for each in directions(order) for line in of_band(each)] + list(of_all(order))
    if order.units:
        shared.append(f"the units asked for, {order.units}: the file states its own, which Adams converts")
    files, losses = dict[str, bytes](), list[str]()
    for kind in _KINDS:
        own = []
        for element in elements:  # what one curve and one damping cost over the grid of a direction
            pairs = [(element.stiffness(kind, table), table.stiffness) for table in element.tables]
            found, exact = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
            loss = number(float(np.max(np.abs(loss_factor(found) - loss_factor(exact)))), 2)
            own.append(
                f"{element.reference.direction}, {kind}: frequency, one damping, of {number(element.at, 4)} Hz: over "
                f"the grid |K| is {percent_off(np.abs(found / exact))} off, the loss factor up to {loss}"
            )
        files[f"bushing_{kind}.bus"] = to_bytes(_file(order, elements, kind, [*own, *shared]))
        losses += own
    return Exported(files, (*losses, *shared))


def _element(own: Sequence[Table]) -> _Element:
    """The curve through the storage force of each amplitude, and the table and row of the damping.

    A single amplitude is continued in a straight line, because splines need five points.
    """
    amplitude = np.array([table.amplitude for table in own])
    force = amplitude * np.array([table.stiffness[0].real for table in own])
    if amplitude.size == 1:
        amplitude, force = (values[0] * np.array([1.0, 2.0]) for values in (amplitude, force))
    moved, resisting = (np.concatenate([-values[::-1], [0.0], values]) for values in (amplitude, force))
    reference = middle(own)
    row = (reference.frequency.size - 1) // 2  # the middle of the frequencies, the lower of two
    at, there = float(reference.frequency[row]), complex(reference.stiffness[row])
    return _Element(own, moved, resisting, reference, at, there)


def _file(order: Order, elements: Sequence[_Element], kind: str, losses: Sequence[str]) -> Iterator[str]:
    """The lines of a property file."""
    at = f"{number(elements[0].at, 4)} Hz, {stated([element.reference for element in elements])}"
    about = [_KINDS[kind], f"damping at {at}; curves at the lowest frequency"]
    yield from commented("$", [*heading(order, ", ".join(_UNITS.values()), losses), *about])
    yield from _block("MDI_HEADER", {"FILE_TYPE": "'bus'", "FILE_VERSION": "4.0", "FILE_FORMAT": "'ASCII'"})
    yield from _block("UNITS", {name: f"'{unit}'" for name, unit in _UNITS.items()})
    damping, curves = dict[int, float](), dict[int, tuple[Array, Array]]()
    for element in elements:
        displacement, force = _SCALES[element.reference.direction.motion]
        scale = force / displacement if kind == "car" else float(np.degrees(1.0))
        for dof in DOFS[element.reference.direction]:
            damping[dof] = scale * element.damping(kind)
            curves[dof] = element.moved * displacement, element.force * force
    values = {f"{resists.upper()}_DAMPING": real(damping.get(dof, 0.0)) for dof, (_, resists) in enumerate(_AXES, 1)}
    yield from _block("DAMPING", values)
    for dof, (moves, resists) in enumerate(_AXES, start=1):
        curve = curves[dof] if dof in curves else (np.arange(-2.0, 3.0), np.zeros(5))  # nothing known
        yield from _block(f"{resists.upper()}_CURVE", {})
        yield f"{{{moves:>16} {resists:>17}}}"
        yield from (f"{real(moved, 10):>17} {real(resisting):>17}" for moved, resisting in zip(*curve, strict=True))


def _block(name: str, attributes: Mapping[str, str]) -> Iterator[str]:
    """A block and its attributes."""
    yield f"[{name}]"
    yield from (f" {key} = {value}" for key, value in attributes.items())
