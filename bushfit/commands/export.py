"""export: a fitted model in the files of other programs."""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import partial
from typing import Unpack

import numpy as np
from typing_extensions import TypedDict

from bushfit.campaign.campaign import Campaign
from bushfit.commands.predict import GridOptions, predict
from bushfit.commands.predicted import PredictionOutput
from bushfit.export.contract import Dialect, Exported, ExportRequest, UnitSystem
from bushfit.model.arms import ACCURACY
from bushfit.model.result import Result
from bushfit.progress import track
from bushfit.reading.measurement import Source
from bushfit.report.results import ResultFile
from bushfit.report.tables import arms_table

#: Module below bushfit and function that write each format; imported when the format is asked for.
FORMATS = {
    "fmu": "export.fmu:export",
    "nastran": "export.nastran:export",
    "abaqus": "export.abaqus:export",
    "adams": "export.adams:export",
    "prony": "export.prony:export",
    "csv": "report.spreadsheets:csv",
    "xlsx": "report.spreadsheets:xlsx",
}


class FormatEntry(TypedDict):
    """Entry of an export format in `export --json`: its files, and properties of the model that it cannot represent.

    Args:
        files: names of the files of the format.
        left_out: properties of the model that the format cannot represent, with the error that this causes.
    """

    files: list[str]
    left_out: list[str]


class ExportDocument(TypedDict):
    """Content of `export --json`.

    Args:
        formats: files and limitations of each exported format, by name.
        warnings: warnings on the use of the numbers.
    """

    formats: dict[str, FormatEntry]
    warnings: list[str]


@dataclass(frozen=True, eq=False)
class ExportOutput:
    """Output of the command export: predictions, exported files and their limitations.

    Args:
        predicted: prediction over the exported grid.
        exported: files and limitations of each format, by its name.
        document: content of `export --json`.
        files: files of all formats, and table of the Maxwell arms.
    """

    predicted: PredictionOutput
    exported: Mapping[str, Exported]
    document: ExportDocument
    files: Sequence[ResultFile]


def export(
    result: Result,
    source: Source,
    formats: Sequence[str],
    campaign: Campaign | None = None,
    *,
    accuracy: float = ACCURACY,
    units: UnitSystem | None = None,
    dialect: Dialect = "nastran",
    decimal_comma: bool = False,
    static_rates: Mapping[str, float] | None = None,
    time_domain: bool = False,
    cardanic: complex | None = None,
    temperature: float | None = None,
    **grid: Unpack[GridOptions],
) -> ExportOutput:
    """Convert a fitted model to files for other programs.

    Args:
        result: fitted model.
        source: name and SHA-256 of its model file, which the files quote.
        formats: names of formats: "fmu", "nastran", "abaqus", "adams", "prony", "csv", "xlsx".
        campaign: campaign whose grid is the default.
        accuracy: largest relative error of the modulus in an FMU, and the aim for a Prony series.
        units: units of length, mass, time and force; default those usual for each format.
        dialect: dialect of the format nastran.
        decimal_comma: True to write CSV files with decimal commas.
        static_rates: rates of the static curves of adams by SI unit of displacement: "m" [m/s] or "rad" [rad/s];
            default the rate of the slowest loop.
        time_domain: True to write the materials of abaqus as Prony series.
        cardanic: complex stiffness of the rotations about x and y in decks [N m/rad]; None for no stiffness.
        temperature: temperature [K], if the model has the effect of temperature.
        grid: directions, frequencies and amplitudes, as of `predict`; all directions share one list of frequencies.

    Returns:
        Predictions, the content for each format with its omissions, and the result files.

    Raises:
        ModelError: a model that a format cannot represent, or an invalid grid.
    """
    predicted = predict(result, campaign, temperature=temperature, **grid)
    frequencies = [np.unique(prediction.frequency) for prediction in predicted.predictions]
    if not all(np.array_equal(axis, frequencies[0]) for axis in frequencies):
        grid["frequencies"] = np.unique(np.concatenate(frequencies))
        predicted = predict(result, campaign, temperature=temperature, **grid)
    settings = (accuracy, units, dialect, decimal_comma, temperature, static_rates, time_domain, cardanic)
    today = datetime.now(UTC).date().isoformat()
    request = ExportRequest(result, source, tuple(predicted.predictions), *settings, today)
    exported: dict[str, Exported] = {}
    for name in track("formats written", formats):
        module, _, function = FORMATS[name].partition(":")
        exported[name] = getattr(importlib.import_module(f"bushfit.{module}"), function)(request)
    document: ExportDocument = {
        "formats": {
            name: {"files": list(written.files), "left_out": list(written.omissions)}
            for name, written in exported.items()
        },
        "warnings": predicted.warnings,
    }
    contents = {name: content for written in exported.values() for name, content in written.files.items()}
    files = [ResultFile(name, "raw", content) for name, content in contents.items()]
    if arms := tuple(part for written in exported.values() for part in written.arms):
        places = [prediction.direction for prediction in predicted.predictions]
        files.append(ResultFile("arms", "table", partial(arms_table, result.model, arms, places)))
    return ExportOutput(replace(predicted, arms=arms), exported, document, files)
