"""Common parts of solver decks: tables over frequency, comments, the heading, and the omissions of a deck."""

import re
import textwrap
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects import Level as EffectLevel
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.export.contract import ExportRequest, UnitSystem
from bushfit.geometry import Direction, bushing_at
from bushfit.prediction.caveats import format_deviation
from bushfit.prediction.stiffness import Prediction
from bushfit.units import number
from bushfit.version import __version__

#: Maximum length of a comment line with its mark [characters].
_WIDTH = 80
#: Characters outside printable ASCII.
_UNPRINTABLE = re.compile(r"[^\x20-\x7e]")
#: Degrees of freedom of a direction, with the axis of the bushing along z: 1 to 3 are x, y, z; 6 is rotation about z.
DOFS = {Direction.AXIAL: (3,), Direction.RADIAL: (1, 2), Direction.TORSION: (6,)}
#: Degrees of freedom without a law: the rotations about x and y.
CARDANIC = (4, 5)
#: Limit of every format with stiffness over frequency.
NO_LOOPS = Caveat("format_omission", "no law in time: for loops, overtones and transients, use the format fmu")


class StiffnessTable(NamedTuple):
    """Stiffness of one direction over frequency at one amplitude.

    Args:
        direction: direction of the bushing.
        amplitude: zero-to-peak amplitude [m or rad]; 0 for the constant of the rotations about x and y.
        frequency: frequencies [Hz], (n,).
        stiffness: complex stiffness at each frequency [N/m or N m/rad], (n,).
    """

    direction: Direction
    amplitude: float
    frequency: Array
    stiffness: Array


#: Tables of all directions at one amplitude each, for one property of a solver.
AmplitudeLevel = tuple[StiffnessTable, ...]


def exported_directions(request: ExportRequest) -> list[Prediction]:
    """Select the predictions for directions of the bushing, without specimens.

    Returns:
        One prediction per direction, all on one list of frequencies [Hz].

    Raises:
        ModelError: there is no direction, or there are several bushings.
    """
    predictions = [prediction for prediction in request.predictions if prediction.direction.axis]
    if len(bodies := dict.fromkeys(prediction.direction.body for prediction in predictions)) > 1:
        expected, hint = "one bushing", f'--direction "{next(iter(bodies))}" selects one'
        raise ModelError("this format represents one bushing", found=", ".join(bodies), expected=expected, hint=hint)
    if not predictions:
        raise ModelError(
            "there is no direction of a bushing to export",
            found=", ".join(map(str, request.places)),
            expected="axial, radial or torsion",
            hint="use the format csv or xlsx, which include specimens",
        )
    return predictions


def stiffness_tables(prediction: Prediction) -> list[StiffnessTable]:
    """Split the prediction of one direction by amplitude.

    Returns:
        Tables of stiffness and loss over frequency, one for each amplitude, in ascending order.
    """
    direction = prediction.direction.axis
    assert direction
    tables = []
    for amplitude in np.unique(prediction.amplitude).tolist():
        mask = prediction.amplitude == amplitude
        table = prediction.frequency[mask], prediction.complex_stiffness[mask]
        tables.append(StiffnessTable(direction, amplitude, *table))
    return tables


def by_dof(level: AmplitudeLevel) -> Iterator[tuple[int, StiffnessTable]]:
    """Yield each degree of freedom (1 to 3 translations, 4 to 6 rotations) with its table, for one amplitude level."""
    pairs = [(dof, table) for table in level for dof in (DOFS[table.direction] if table.amplitude else CARDANIC)]
    yield from sorted(pairs, key=lambda pair: pair[0])


class StiffnessForm(NamedTuple):
    """Conversion between a complex stiffness and the two real tables of a solver, such as stiffness and damping.

    Args:
        parts: function of frequency [Hz] and complex stiffness that returns the two tables, (n,) each.
        joined: inverse function, of frequency, first and second table, that returns the complex stiffness, (n,).
    """

    parts: Callable[[Array, Array], tuple[Array, Array]]
    joined: Callable[[Array, Array, Array], Array]

    def in_units(self, table: StiffnessTable, units: UnitSystem) -> tuple[Array, Array, Array]:
        """Convert a stiffness table to the frequency and the two real quantities of this format, such as K and damping.

        Args:
            table: complex stiffness over frequency [SI].
            units: unit system of the deck.

        Returns:
            Frequency and the two quantities in the units of the deck, (n,) each.
        """
        frequency = table.frequency * units.frequency.factor
        factor = units.display(table.direction.motion).stiffness.factor
        return frequency, *self.parts(frequency, table.stiffness * factor)


def comment_lines(mark: str, lines: Iterable[str]) -> list[str]:
    """Wrap comments to lines of 80 ASCII characters.

    Args:
        mark: comment sign at the start of each line.
        lines: comments; characters outside printable ASCII become escape sequences.

    Returns:
        Lines with the mark; continuation lines have a bar after the mark.
    """
    wrapped = []
    for line in lines:
        plain = _UNPRINTABLE.sub(lambda sign: ascii(sign[0])[1:-1], line)
        wrapped += textwrap.wrap(plain, _WIDTH, initial_indent=f"{mark} ", subsequent_indent=f"{mark} | ") or [mark]
    return wrapped


def heading(request: ExportRequest, units: str | UnitSystem, omissions: Iterable[Caveat]) -> list[str]:
    """List the comments at the head of a deck: bushing, model and its hash, units, axes, omissions and warnings.

    Args:
        request: model and settings.
        units: description of the units, or unit system of a deck whose rotations are in rad.
        omissions: properties that the deck cannot represent.

    Returns:
        Lines without comment signs.
    """
    place = exported_directions(request)[0].direction
    bushing, source = bushing_at(request.result.model.bushing, place), request.source
    sizes = (bushing.inner_radius, bushing.outer_radius, bushing.length) if bushing else ()
    if isinstance(units, UnitSystem):
        units = f"{units}; frequency in {units.frequency.name}, rotation in rad"
    return [
        f"written by bushfit {__version__}{f' on {request.day}' if request.day else ''}",
        f"bushing: {request.result.name}",
        f"inner radius, outer radius, length: {', '.join(number(1e3 * size, 6) for size in sizes)} mm",
        f"model: {source.file}",
        f"sha256: {source.sha256}",
        f"units: {units}",
        "axes: z along the bushing (axial 3, torsion 6), x and y across (radial 1, 2)",
        *map(": ".join, request.remarks(omissions)),
    ]


def amplitude_levels(request: ExportRequest) -> Iterator[tuple[int, AmplitudeLevel]]:
    """Stack the stiffness tables of all directions by amplitude, the smallest amplitudes first.

    A direction with fewer amplitudes than others repeats its largest.

    Yields:
        Rank, from 1, and the tables of one amplitude of each direction, with the stated constant of the rotations about
        x and y, if there is one.
    """
    by_direction = [stiffness_tables(prediction) for prediction in exported_directions(request)]
    stated: AmplitudeLevel = ()
    if request.cardanic is not None:
        frequency = by_direction[0][0].frequency
        stated = (StiffnessTable(Direction.TORSION, 0.0, frequency, np.full(frequency.size, request.cardanic)),)
    for rank in range(1, max(map(len, by_direction)) + 1):
        yield rank, (*(tables[min(rank, len(tables)) - 1] for tables in by_direction), *stated)


def describe_amplitudes(level: Iterable[StiffnessTable]) -> str:
    """Format the amplitudes of a level: "axial at 0.2 mm, torsion at 1 deg"."""
    tables = [table for table in level if table.amplitude]
    rows = [(table.direction, table.amplitude, *table.direction.display.displacement) for table in tables]
    return ", ".join(f"{place} at {number(amplitude * factor, 6)} {unit}" for place, amplitude, unit, factor in rows)


def format_real(value: float, digits: int = 5) -> str:
    """Format a number in exponential notation with `digits` significant digits; zero becomes "0."."""
    return f"{value:.{digits - 1}E}" if value else "0."


def table_omissions(request: ExportRequest, form: StiffnessForm) -> Iterator[Caveat]:
    """Generate warnings on what a deck with linear tables over frequency, one set per amplitude, cannot represent.

    Args:
        request: model, predictions and settings.
        form: conversion of the complex stiffness to the quantities that the solver interpolates.

    Yields:
        Warnings with the errors of |K|; those on a single direction come first.
    """
    model = request.result.model.without(EffectLevel.INSTRUMENT)
    for prediction in exported_directions(request):
        tables, place = stiffness_tables(prediction), prediction.direction
        if len(tables) > 1:
            reference = tables[(len(tables) - 1) // 2]
            ratios = np.concatenate([np.abs(reference.stiffness / table.stiffness) for table in tables])
            unit, factor = place.display.displacement
            low, value, high = (number(table.amplitude * factor, 4) for table in (tables[0], reference, tables[-1]))
            errors = f"errors of {format_deviation(ratios)} in |K| at {low} to {high} {unit}"
            sentence = f"each property has one amplitude. The property of {value} {unit} has {errors}"
            yield Caveat("format_error", sentence).about(place)
        if tables[0].frequency.size > 1:
            worst = 0.0
            for table in tables:  # linear interpolation halfway between two frequencies
                halfway = 0.5 * (table.frequency[1:] + table.frequency[:-1])
                lines = (0.5 * (part[1:] + part[:-1]) for part in form.parts(table.frequency, table.stiffness))
                exact = model.stiffness(place, halfway, table.amplitude, conditions=request.conditions)
                worst = max(worst, float(np.max(np.abs(form.joined(halfway, *lines) / exact - 1.0))))
            sentence = f"interpolated between the frequencies, |K| has errors of up to {number(100.0 * worst, 2)} %"
            yield Caveat("format_error", sentence).about(place)
        else:
            sentence = f"one frequency, {number(tables[0].frequency[0], 4)} Hz: K and loss are constants"
            yield Caveat("format_omission", sentence).about(place)
        yield from band_omissions(prediction)
    yield from common_omissions(request)


def common_omissions(request: ExportRequest) -> Iterator[Caveat]:
    """Yield warnings on the properties of a model that no deck can represent.

    Args:
        request: model and directions to export.

    Yields:
        Warnings on the time domain, the coupling of directions, motions that the model lacks, and specimens.
    """
    yield NO_LOOPS
    omit = partial(Caveat, "format_omission")
    yield omit("coupling between directions is not included")
    present = {prediction.direction for prediction in exported_directions(request)}
    missing = [str(direction) for direction in DOFS if direction not in present]
    if request.cardanic is None:
        missing.append("rotations about x and y")
    else:
        stiffness, loss = request.cardanic.real, request.cardanic.imag / request.cardanic.real
        constant = f"{number(stiffness, 5)} N m/rad, loss factor {number(loss, 3)}"
        yield omit(f"rotations about x and y: the stated constant, {constant}, which no test supports")
    if missing:
        yield omit(f"no stiffness in {', '.join(missing)}")
    if specimens := [str(place) for place in request.places if not place.axis]:
        yield omit(f"specimens: {', '.join(specimens)}")


def band_omissions(prediction: Prediction) -> Iterator[Caveat]:
    """Yield warnings on the uncertainty of a prediction, which a deck omits: it contains the predicted values alone.

    Args:
        prediction: predicted stiffness of one direction.

    Yields:
        Largest half width of the 95 % band of |K| [%]; and, if the tests cannot tell whether an effect belongs to the
        bushing or to the rig, the change of |K| in case it belongs to the rig.
    """
    place, band = prediction.direction, prediction.stiffness
    if (width := float(np.max((band.high - band.low) / (2.0 * band.value)))) > 0.0:
        sentence = f"the 95 % band of up to +/-{number(100.0 * width, 2)} % of |K| is left out"
        yield Caveat("format_omission", sentence).about(place)
    if prediction.if_in_rig:
        deviation = format_deviation(prediction.if_in_rig.stiffness.value / band.value)
        sentence = f"if the unassigned effect belongs to the rig, |K| is {deviation}; these values are left out"
        yield Caveat("format_omission", sentence).about(place)
