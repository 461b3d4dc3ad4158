"""export: convert a fitted model to the files of other programs."""

from collections.abc import Sequence
from datetime import UTC, datetime
from functools import partial
from pkgutil import resolve_name
from typing import Any

import numpy as np
from typing_extensions import TypedDict

from bushfit.campaign.campaign import Campaign
from bushfit.caveat import WarningEntries, to_entries
from bushfit.commands.predict import predict
from bushfit.export.contract import ExportedFiles, ExportRequest
from bushfit.model.result import Result
from bushfit.prediction.grid import GridOptions
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
        left_out_kinds: for each property, format_error if its sentence states this error, else format_omission.
    """

    files: list[str]
    left_out: list[str]
    left_out_kinds: list[str]


class ExportDocument(WarningEntries):
    """Content of `export --json`.

    Args:
        formats: files and limitations of each exported format, by name.
        warnings: warnings on the use of the numbers.
    """

    formats: dict[str, FormatEntry]


def export(
    result: Result, source: Source, names: Sequence[str], campaign: Campaign | None, grid: GridOptions, **settings: Any
) -> tuple[ExportDocument, list[ResultFile]]:
    """Convert a fitted model to files for other programs.

    Args:
        result: fitted model.
        source: name and SHA-256 of its model file, which the files quote.
        names: names of formats: "fmu", "nastran", "abaqus", "adams", "prony", "csv", "xlsx".
        campaign: campaign whose grid is the default.
        grid: directions, frequencies [Hz], amplitudes [m], torsion_amplitudes [rad] and strain_amplitudes; all
            directions share one list of frequencies.
        settings: settings of `ExportRequest`, such as `accuracy`, `units` and `temperature`.

    Returns:
        Content of `export --json`, with the omissions of each format; and the result files.

    Raises:
        ModelError: a model that a format cannot represent, or an invalid grid.
    """
    temperature = settings["temperature"]
    predicted = predict(result, campaign, temperature=temperature, **grid)
    frequencies = [np.unique(prediction.frequency) for prediction in predicted.predictions]
    if not all(np.array_equal(axis, frequencies[0]) for axis in frequencies):
        grid["frequencies"] = np.unique(np.concatenate(frequencies))
        predicted = predict(result, campaign, temperature=temperature, **grid)
    today = datetime.now(UTC).date().isoformat()
    request = ExportRequest(result, source, tuple(predicted.predictions), day=today, **settings)
    exported, formats = list[ExportedFiles](), dict[str, FormatEntry]()
    for name in track("formats written", names):
        written: ExportedFiles = resolve_name(f"bushfit.{FORMATS[name]}")(request)
        exported.append(written)
        limits = to_entries(written.omissions)
        left_out, kinds = limits["warnings"], limits["warning_kinds"]
        formats[name] = {"files": [*written.files], "left_out": left_out, "left_out_kinds": kinds}
    document: ExportDocument = {"formats": formats, **to_entries(predicted.warnings)}
    contents = {name: content for written in exported for name, content in written.files.items()}
    files = [ResultFile(name, "raw", content) for name, content in contents.items()]
    if arms := tuple(part for written in exported for part in written.arms):
        places = [prediction.direction for prediction in predicted.predictions]
        files.append(ResultFile("arms", "table", partial(arms_table, result.model, arms, places)))
    return document, files
