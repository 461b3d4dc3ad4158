"""A model as tables for spreadsheets: predictions, long and wide, parameters, and provenance."""

import pandas as pd

from bushfit.export.contract import ExportedFiles, ExportRequest
from bushfit.export.deck import NO_LOOPS
from bushfit.model.result import Result
from bushfit.reading.tablefile import to_csv, to_xlsx
from bushfit.report.results import place_names
from bushfit.report.tables import prediction_table, wide_table
from bushfit.version import __version__

#: Tables that belong to no direction or specimen; they come last.
_OF_ALL = ("parameters", "provenance")


def csv(request: ExportRequest) -> ExportedFiles:
    """Export a model as CSV files, one for each table (predictions, parameters, provenance)."""
    written = {name: to_csv(table, decimal_comma=request.decimal_comma) for name, table in _tables(request).items()}
    return ExportedFiles({f"{name.replace(' ', '_')}.csv": file for name, file in written.items()}, (NO_LOOPS,))


def xlsx(request: ExportRequest) -> ExportedFiles:
    """Export a model as an Excel workbook, `bushing.xlsx`, with a sheet for each table."""
    return ExportedFiles({"bushing.xlsx": to_xlsx(_tables(request))}, (NO_LOOPS,))


def _tables(request: ExportRequest) -> dict[str, pd.DataFrame]:
    """Tables of an export by name: long and wide predictions of each direction or specimen, parameters, provenance."""
    result, bushing, source = request.result, request.result.model.bushing, request.source
    sizes = ("inner_radius", "outer_radius", "length") if bushing else ()
    origin = [
        ("bushing", result.name),
        *((f"{key} [m]", f"{getattr(bushing, key):.15g}") for key in sizes),
        ("effects", ", ".join(result.model.effects)),
        ("model", str(source.file)),
        ("model, sha256", source.sha256),
        *(row for file, sha256 in result.files.items() for row in (("test", file), ("test, sha256", sha256))),
        ("bushfit", __version__),
        *request.remarks([NO_LOOPS]),
    ]
    provenance = pd.DataFrame(origin, columns=["what", "value"])
    tables = {"parameters": parameters_table(result), "provenance": provenance}
    for name, prediction in zip(place_names(request.places), request.predictions, strict=True):
        display = request.units.display(prediction.direction.motion) if request.units else None
        while {name, f"{name} wide"} & tables.keys():  # a specimen may have any name
            name += "_"
        tables[name] = prediction_table(prediction, display)
        tables[f"{name} wide"] = wide_table(prediction, display)
    return dict(sorted(tables.items(), key=lambda pair: pair[0] in _OF_ALL))


def parameters_table(result: Result) -> pd.DataFrame:
    """Table of all parameters of a model in SI units.

    Args:
        result: fitted or given model.

    Returns:
        A row per parameter: value, unit, standard error and 95 % interval (empty if not known), fitted, and meaning.
    """
    parameters, values = result.model.parameters, result.model.values  # noqa: PD011 - no frame
    low, high = zip(*(result.interval(name) or (None, None) for name in values), strict=True)
    columns = {
        "parameter": [*values],
        "value": [*values.values()],
        "unit": [parameters[name].unit for name in values],
        "std error": [result.covariance.stderr(name) for name in values],
        "95 %, low": low,
        "95 %, high": high,
        "fitted": ["yes" if name in result.fitted else "no" for name in values],
        "meaning": [parameters[name].meaning for name in values],
    }
    return pd.DataFrame(columns)
