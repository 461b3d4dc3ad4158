"""respond: force of a fitted model over time for a displacement history."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from bushfit.caveat import Caveat, WarningEntries, to_entries
from bushfit.commands.loading import HasResult, as_result
from bushfit.commands.predict import check_temperature
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
from bushfit.reduction.displacement import prepare_displacements
from bushfit.report import plots
from bushfit.report.response import response_table, validation_table
from bushfit.report.results import ResultFile

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class ResponseDocument(WarningEntries):
    """Peak force, energy and other values of the force over time, by direction, printed by `bushfit respond --json`.

    Args:
        directions: for each direction, values in SI units by name (see `TimeResponse.summary`).
        warnings: limits of the response, and corrections of the history.
    """

    directions: dict[str, dict[str, float | None]]


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
    warnings: Sequence[Caveat]
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
        step: time between samples [s], for displacements that are not read from a file.
        direction: direction, specimen or bushing, if the file does not state it; default all of several bushings.
        columns, units: headers and units of unusual columns by role: time, displacement, axial, radial, torsion.
        file_format: format of the file; default detected.
        steady: True for whole cycles of a steady state, False for a motion from rest.
        lowpass: cut-off frequency of a low-pass for the displacement [Hz], against noise; None for no filter.
        temperature: temperature of the rubber [K]; None for the reference temperature.

    Returns:
        Force with band for each direction, its peak, energy and strain, and the result files.

    Raises:
        MeasurementError, UnitError: a history that cannot be used.
        ModelError: an effect of the model has no law in time, or the model does not depend on temperature.
    """
    result = as_result(model)
    check_temperature(result, temperature)
    if isinstance(history, str | Path):
        channels = read_displacements(
            Path(history), direction, result.specimens, columns=columns, units=units, file_format=file_format
        )
    elif step is None or not 0.0 < step < np.inf:
        raise MeasurementError("the time between samples is not stated", place="step", expected="seconds above zero")
    else:
        channels = tuple(
            DisplacementHistory(place, np.asarray(values, dtype=float), step)
            for name, values in history.items()
            for place in get_places(name, result.specimens)
        )
    prepared = prepare_displacements(channels, steady=steady, lowpass=lowpass)
    responses = [
        time_response(
            result,
            channel.direction,
            History.sampled(channel.displacement, channel.step, periodic=steady),
            temperature=temperature,
        )
        for channel in prepared
    ]
    notes = dict.fromkeys(note for channel in prepared for note in channel.notes)
    warnings = warnings_of(result, [response.warnings for response in responses], [*notes])
    document: ResponseDocument = {
        "directions": {str(response.direction): response.summary for response in responses},
        **to_entries(warnings),
    }
    title, time = f"{result.name}: force over time", prepared[0].time
    table = ResultFile("response", "table", partial(response_table, time, responses))
    files = [table, ResultFile("response", "figure", partial(draw_response, title, table, warnings))]
    return ResponseOutput(result, time, responses, warnings, document, files)


def draw_response(title: str, table: ResultFile, warnings: Sequence[Caveat] = ()) -> Figure:
    """Draw the force over time in a table of `respond`, or of a validation record, with warnings below the figure.

    Args:
        title: title of the figure.
        table: result file whose content is the table of time, displacement and forces.
        warnings: warnings to print below the figure.
    """
    return plots.response.response_figure(title, table.content(), plots.style.warnings_note(warnings))


def validation_files(validations: Sequence[Validation], title: str) -> list[ResultFile]:
    """Table validation.csv, and for each validation record a table and a figure of measured and predicted force.

    Args:
        validations: validation records, compared with the force that the final model predicts.
        title: beginning of the titles of the figures.

    Returns:
        Result files, not yet rendered; empty without records.
    """
    files = [ResultFile("validation", "table", partial(validation_table, validations))] if validations else []
    for validation in validations:
        name = f"validation_{folder_name(validation.record.name)}"
        record_title = f"{title}: {validation.record.name}"
        table = partial(response_table, validation.record.time, [validation.response], validation.measured)
        record = ResultFile(name, "table", table)
        files += [record, ResultFile(name, "figure", partial(draw_response, record_title, record))]
    return files
