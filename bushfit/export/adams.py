"""Adams Car: bushing property files (.bus) with a curve of force over displacement and a damping per degree of freedom.

The curve is the static curve of the law in time, up to the largest amplitude of the grid. The damping is one number at
the middle frequency and amplitude of the grid: a viscous damper in `bushing_car.bus`, the loss angle for the frequency
bushing of Adams Car Ride in `bushing_ride.bus`. A file states its units, which Adams converts: mm, newton, degrees and
second.

Source: Adams Car Ride help, "Frequency Bushing" (damping coefficients are interpreted as loss angles); blocks,
attributes and units as in the public fixture `fixture.bus` of the package suspension_multibody, which reads them;
Altair TeimOrbit format and AutoBush, which reads the same files.
"""

from collections.abc import Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np

from bushfit.caveat import Caveat
from bushfit.export.contract import ExportedFiles, ExportRequest
from bushfit.export.deck import (
    CARDANIC,
    DOFS,
    StiffnessTable,
    band_omissions,
    comment_lines,
    common_omissions,
    describe_amplitudes,
    exported_directions,
    format_real,
    heading,
    stiffness_tables,
)
from bushfit.geometry import ROTATION, TRANSLATION
from bushfit.prediction.caveats import format_deviation
from bushfit.prediction.static_curve import StaticCurve, static_curve, static_rate
from bushfit.reading.measurement import loss_factor
from bushfit.templates import render_template
from bushfit.units import number

#: Names of displacement and force in each degree of freedom, from 1 to 6.
_AXES = (("x", "fx"), ("y", "fy"), ("z", "fz"), ("ax", "tx"), ("ay", "ty"), ("az", "tz"))
#: Factors from SI to the displacement and force of the files: mm and N, deg and N mm.
_SCALES = {TRANSLATION: (1e3, 1.0), ROTATION: (float(np.degrees(1.0)), 1e3)}
#: Units of the files.
_UNITS = {"LENGTH": "mm", "ANGLE": "degrees", "FORCE": "newton", "MASS": "kg", "TIME": "second"}
#: Cosine at even phases of a cycle, for the first harmonic of a curve.
_COSINE = np.cos(2.0 * np.pi * np.arange(64) / 64.0)
#: File for Adams Car or for Adams Car Ride.
Kind = Literal["car", "ride"]
#: Comment on the damping in each kind of file.
_KINDS: dict[Kind, str] = {
    "car": "damping: viscous, N s/mm and N mm s/deg",
    "ride": "damping: the loss angle in deg, for the frequency bushing of Adams Car Ride alone",
}


class _Element(NamedTuple):
    """Approximation of the bushing in one direction by an Adams element with a static curve and a single damping.

    Args:
        tables: exact stiffness over frequency, one table for each amplitude.
        curve: static curve.
        reference: table of the middle amplitude.
        frequency: middle frequency [Hz], at which the damping is exact.
        damping: damping coefficient [N s/m or N m s/rad] for Adams Car, and loss angle [rad] for Adams Car Ride.
    """

    tables: Sequence[StiffnessTable]
    curve: StaticCurve
    reference: StiffnessTable
    frequency: float
    damping: Mapping[Kind, float]

    def error(self, kind: Kind) -> Caveat:
        """Make a warning on the errors of |K| and loss factor that one static curve and damping cause on the grid.

        Args:
            kind: "car" for Adams Car, "ride" for Adams Car Ride.
        """
        damping, written, exact = self.damping[kind], [], []
        for table in self.tables:
            force = np.interp(table.amplitude * _COSINE, self.curve.displacement, self.curve.mean.value)
            storage = 2.0 * np.mean(force * _COSINE) / table.amplitude
            viscous = storage + 2j * np.pi * table.frequency * damping
            by_angle = np.full(table.frequency.size, storage * (1.0 + 1j * np.tan(damping)))
            written.append(by_angle if kind == "ride" else viscous)
            exact.append(table.stiffness)
        element, model = np.concatenate(written), np.concatenate(exact)
        loss = number(float(np.max(np.abs(loss_factor(element) - loss_factor(model)))), 2)
        place, hertz = self.reference.direction, number(self.frequency, 4)
        subject = f"{place}, {kind}: a static curve, with the damping at {hertz} Hz"
        errors = f"the error of |K| is {format_deviation(np.abs(element / model))}, of the loss factor up to {loss}"
        return Caveat("format_error", f"{subject}: {errors}")


def export(request: ExportRequest) -> ExportedFiles:
    """Write one file for Adams Car and one for Adams Car Ride.

    Args:
        request: model, predictions and settings.

    Returns:
        Files bushing_car.bus and bushing_ride.bus, and sentences on properties that the format cannot represent.
    """
    predictions, elements = exported_directions(request), []
    for prediction in predictions:
        tables, place = stiffness_tables(prediction), prediction.direction
        reach, frequencies = tables[-1].amplitude, tables[-1].frequency
        rate = static_rate(request.result, place, request.static_rates)
        if frequencies.size == 1:  # the curve has the rate of this frequency
            rate = 4.0 * reach * float(frequencies[0])
        curve = static_curve(request.result, place, reach, rate, temperature=request.temperature)
        # of two middle amplitudes or frequencies, the lower
        reference, row = tables[(len(tables) - 1) // 2], (frequencies.size - 1) // 2
        frequency, exact = float(frequencies[row]), complex(reference.stiffness[row])
        damping: dict[Kind, float] = {"car": exact.imag / (2.0 * np.pi * frequency), "ride": float(np.angle(exact))}
        elements.append(_Element(tables, curve, reference, frequency, damping))
    shared = [*chain.from_iterable(map(band_omissions, predictions)), *common_omissions(request)]
    if request.units:
        sentence = f"the requested units ({request.units}) are not used: Adams converts those that the file states"
        shared.append(Caveat("format_omission", sentence))
    omissions = {kind: [element.error(kind) for element in elements] for kind in _KINDS}
    files = {
        f"bushing_{kind}.bus": _property_file(request, elements, kind, [*omissions[kind], *shared]) for kind in _KINDS
    }
    return ExportedFiles(files, (*omissions["car"], *omissions["ride"], *shared))


def _property_file(
    request: ExportRequest, elements: Sequence[_Element], kind: Kind, omissions: Sequence[Caveat]
) -> bytes:
    """Write a property file for Adams Car or Adams Car Ride.

    Args:
        request: model, predictions and settings.
        elements: element of each direction.
        kind: "car" for Adams Car, "ride" for Adams Car Ride.
        omissions: properties that the format cannot represent.

    Returns:
        Content of the file.
    """
    amplitudes = describe_amplitudes([element.reference for element in elements])
    rates = ", ".join(f"{element.curve.direction} {element.curve.rate_text}" for element in elements)
    about = [f"damping at {number(elements[0].frequency, 4)} Hz, {amplitudes}", f"static curves at {rates}"]
    comments = comment_lines("$", [*heading(request, ", ".join(_UNITS.values()), omissions), _KINDS[kind], *about])
    damping, curves = [0.0] * len(_AXES), [np.stack((np.arange(-2.0, 3.0), np.zeros(5)), axis=1)] * len(_AXES)
    for element in elements:
        displacement, force = _SCALES[element.reference.direction.motion]
        scale = force / displacement if kind == "car" else float(np.degrees(1.0))
        # rounded, or zero becomes 1e-15, of either sign
        curve = np.stack((element.curve.displacement * displacement, element.curve.mean.value * force), 1).round(9)
        for dof in DOFS[element.reference.direction]:
            damping[dof - 1], curves[dof - 1] = scale * element.damping[kind], curve
    if (stated := request.cardanic) is not None:
        rate = stated.imag / (2.0 * np.pi * elements[0].frequency)
        turn, moment = _SCALES[ROTATION]
        for dof in CARDANIC:
            damping[dof - 1] = moment / turn * rate if kind == "car" else float(np.degrees(np.angle(stated)))
            curves[dof - 1] = curves[dof - 1][:, :1] * (1.0, stated.real * moment / turn)
    rows = [(*axes, *values) for axes, values in zip(_AXES, zip(damping, curves, strict=True), strict=True)]
    template = Path(__file__).with_name("adams.bus.jinja")
    return render_template(template, comments=comments, units=_UNITS, rows=rows, real=format_real).encode("ascii")
