"""respond: force of a fitted model over time for a displacement history."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field
from typing_extensions import TypedDict

from bushfit.commands.loading import HasResult, as_result
from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.errors import MeasurementError
from bushfit.geometry import get_places
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.response import TimeResponse, time_response
from bushfit.prediction.validation import Validation
from bushfit.reading.displacements import DisplacementHistory, read_displacements
from bushfit.reading.layout import FileFormat
from bushfit.reading.tablefile import folder_name
from bushfit.reduction.lowpass import low_pass
from bushfit.report import plots
from bushfit.report.response import record_table, response_figures, response_table, validation_table
from bushfit.report.results import ResultFile, table_with_figure
from bushfit.units import number

#: Ratio of mean to range of a displacement above which the mean is the zero of a transducer; chosen: no rubber follows.
_OFFSET = 10.0
#: Largest distance between the ends of a cycle, relative to its range.
_CLOSED = 0.01


class ResponseDocument(TypedDict):
    """Figures of a response for each direction, as `bushfit respond --json` prints them."""

    directions: Annotated[
        dict[str, dict[str, float | None]],
        Field(description="Figures of each direction in SI units; null without fitted tests."),
    ]
    warnings: Annotated[list[str], Field(description="Limits of the response, and corrections of the history.")]


@dataclass(frozen=True, eq=False, repr=False)
class ResponseOutput:
    """Force over time of a fitted model, with its table and figure.

    Args:
        result: the model with its uncertainty.
        time: time of each sample [s], (n,).
        responses: force of each direction or specimen at these times.
        warnings: corrections of the history, and warnings of the model and of each response.
        document: content of `respond --json`: peak and rms force, energy, strain and strain rate of each direction.
        files: table response.csv and figure response.png.
    """

    result: Result
    time: Array
    responses: Sequence[TimeResponse]
    warnings: Sequence[str]
    document: Mapping[str, Any]
    files: Sequence[ResultFile]

    def __repr__(self) -> str:
        return f"Response of {self.result.name}: {', '.join(str(response.direction) for response in self.responses)}"


def respond(
    model: Result | HasResult,
    history: str | Path | Mapping[str, Sequence[float] | Array],
    *,
    step: float | None = None,
    direction: str | None = None,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    file_format: FileFormat | None = None,
    steady: bool = False,
    lowpass: float | None = None,
    temperature: float | None = None,
) -> ResponseOutput:
    """Compute the force over time for a displacement history, with 95 % bands.

    Args:
        model: result, or output with a result.
        history: file with time and one or more displacements; or displacements [m, rad or 1] by direction or specimen,
            (n,) each.
        step: time between samples [s], for displacements that are no file.
        direction: direction, specimen or bushing, if the file does not state it; default all of several bushings.
        columns, units: headers and units of unusual columns by role: time, displacement, axial, radial, torsion.
        file_format: format of the file; default detected.
        steady: True for whole cycles of a steady state, False for a motion from rest.
        lowpass: cut-off frequency of a low-pass for the displacement [Hz], against noise; None for no filter.
        temperature: temperature of the rubber [K]; None for the reference temperature.

    Returns:
        Force with band for each direction, its figures, and the result files.

    Raises:
        MeasurementError, UnitError: a history that cannot be used.
        ModelError: an effect of the model has no law in time.
    """
    result = as_result(model)
    if isinstance(history, str | Path):
        channels = read_displacements(
            Path(history), direction, result.specimens, columns=columns, units=units, file_format=file_format
        )
    elif step is None or not step > 0.0:
        raise MeasurementError("the time between samples is not stated", place="step", expected="seconds above zero")
    else:
        channels = tuple(
            DisplacementHistory(place, np.asarray(values, dtype=float), step)
            for name, values in history.items()
            for place in get_places(name, result.specimens)
        )
    channels = tuple(_without_offset(channel, steady=steady) for channel in channels)
    if steady:
        channels = tuple(_one_cycle(channel) for channel in channels)
    if lowpass:
        channels = tuple(_smoothed(channel, lowpass, steady=steady) for channel in channels)
    responses = [
        time_response(
            result,
            channel.direction,
            History.sampled(channel.displacement, channel.step, periodic=steady),
            temperature=temperature,
        )
        for channel in channels
    ]
    notes = dict.fromkeys(note for channel in channels for note in channel.notes)
    warnings = warnings_of(result, [response.warnings for response in responses], [*notes])
    figures = {str(response.direction): response_figures(response) for response in responses}
    title, time = f"{result.name}: force over time", channels[0].time
    files = table_with_figure(
        "response",
        partial(response_table, time, responses),
        lambda table: plots.response.response_figure(title, table, plots.style.warnings_note(warnings)),
    )
    return ResponseOutput(result, time, responses, warnings, {"directions": figures, "warnings": warnings}, files)


def _without_offset(channel: DisplacementHistory, *, steady: bool) -> DisplacementHistory:
    """Remove an offset far larger than the motion: the mean of a steady state, or the first value of a motion."""
    motion, span = channel.displacement, np.ptp(channel.displacement)
    if not np.all(np.isfinite(motion)) or not span:
        raise MeasurementError(
            "this is no motion", place=str(channel.direction), expected="finite displacements that change"
        )
    if abs(motion.mean()) <= _OFFSET * span:
        return channel
    offset = float(motion.mean() if steady else motion[0])
    unit, factor = channel.direction.display.displacement
    which = "mean" if steady else "first value"
    note = f"{channel.direction}: {number(factor * offset, 4)} {unit}, the {which}, is subtracted as an offset"
    return replace(channel, displacement=motion - offset, notes=(*channel.notes, note))


def _one_cycle(channel: DisplacementHistory) -> DisplacementHistory:
    """Check that a history can be repeated endlessly; a last sample equal to the first is left out."""
    motion, span = channel.displacement, np.ptp(channel.displacement)
    jump = max(_CLOSED * span, 2.0 * np.abs(np.diff(motion)).max())
    if abs(motion[-1] - motion[0]) > jump:
        unit, factor = channel.direction.display.displacement
        first, last = (f"{number(factor * end, 4)} {unit}" for end in (motion[0], motion[-1]))
        raise MeasurementError(
            "a steady state needs whole cycles",
            place=str(channel.direction),
            found=f"{first} at the start, {last} at the end",
            expected="a history that ends where it begins",
            hint="cut it to whole cycles, or leave --steady out",
        )
    is_repeated = abs(motion[-1] - motion[0]) < 0.5 * abs(motion[1] - motion[0])
    return replace(channel, displacement=motion[:-1]) if is_repeated else channel


def _smoothed(channel: DisplacementHistory, frequency: float, *, steady: bool) -> DisplacementHistory:
    """Remove frequencies of a displacement above a cut-off frequency [Hz], and note the size of what is removed."""
    lowest, nyquist = 1.0 / (channel.step * channel.displacement.size), 0.5 / channel.step
    if not lowest <= frequency < nyquist:
        low, high = number(lowest, 4), number(nyquist, 4)
        expected = f"from {low} Hz, one cycle in the history, to below {high} Hz, half of the sampling rate"
        raise MeasurementError(
            "the low-pass does not suit the history",
            place="--lowpass",
            found=f"{number(frequency, 4)} Hz",
            expected=expected,
        )
    smooth = low_pass(channel.displacement, channel.step, frequency, periodic=steady)
    unit, factor = channel.direction.display.displacement
    removed = number(factor * float(np.std(channel.displacement - smooth)), 2)
    cut_off = f"{channel.direction}: low-passed at {number(frequency, 3)} Hz without delay"
    notes = (*channel.notes, f"{cut_off}, which removes {removed} {unit} rms")
    return replace(channel, displacement=smooth, notes=notes)


def validation_files(validations: Sequence[Validation], before: Sequence[Validation], title: str) -> list[ResultFile]:
    """Table validation.csv, and for each validation record a table and a figure of measured and predicted force.

    Args:
        validations: comparisons with the model to use.
        before: comparisons without the effects that a diagnosis added; empty if none were added.
        title: beginning of the titles of the figures.

    Returns:
        Result files, not yet rendered; empty without records.
    """
    files = [ResultFile("validation", "table", lambda: validation_table(validations, before))] if validations else []
    draw = lambda title, table: plots.response.response_figure(title, table)  # noqa: E731  # imported late
    for validation in validations:
        name = f"validation_{folder_name(validation.record.name)}"
        record_title = f"{title}: {validation.record.name}"
        files += table_with_figure(name, partial(record_table, validation), partial(draw, record_title))
    return files
