"""Input of a report: documents and tables read from a results folder, tables of tests, and predictions."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pandas as pd

from bushfit.errors import ModelError, quote_path
from bushfit.geometry import Direction, Place
from bushfit.model.file import from_document, read_document
from bushfit.model.result import Result
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.reading.files import read_utf8
from bushfit.reading.tablefile import unescape_formula
from bushfit.report.results import ResultFile, place_names
from bushfit.report.tables import response_headers, spread_indices

#: Documents with a model in order of preference; document of the fit without the effects that a diagnosis added.
MODELS, JOINT = ("model", "dynamic", "static"), "joint"
#: Headers of columns of texts; all other columns contain numbers.
_TEXTS = ("loop", "sweep", "test", "kind", "direction", "stepped", "part", "outlier")
#: Largest number of frequencies, and of amplitudes, of a grid that is made from the measured points.
_MOST_LEVELS = 10
#: Largest size of a table file that is read [bytes].
_LARGEST = 500_000_000


def tested_tables(tables: Mapping[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """Select the tables of measured and modelled tests: `gap`, `sweeps`, `loops`, and `validation_...`.

    A diagnosis writes no tables `sweeps` and `loops`. They are made from its table of the gap, which has the same
    columns, with a row for each point of a sweep and each row of a loop.

    Args:
        tables: tables of a result by file name without extension, such as "gap".

    Returns:
        The selected tables by file name, with `sweeps` and `loops` made from `gap` if they are missing.
    """
    tested = {name: tables[name] for name in ("gap", "sweeps", "loops") if name in tables}
    if "gap" in tested:
        gap = tested["gap"]
        parts = {"force": "residual", "storage": "stiffness residual", "loss": "loss residual"}
        rows = gap.rename(columns={f"{part} after [noise]": f"{name} [noise]" for part, name in parts.items()})
        for name, kind in (("sweeps", "sweep"), ("loops", "loop")):
            if name not in tested and (gap["kind"] == kind).any():
                tested[name] = rows[gap["kind"] == kind]
    return tested | {name: table for name, table in tables.items() if name.startswith("validation_")}


def predict_tables(
    result: Result, tables: Mapping[str, pd.DataFrame], sweeps: pd.DataFrame | None
) -> dict[str, Prediction]:
    """Compute a prediction for each direction or specimen, on the grid of its prediction table or else of its sweeps.

    Args:
        result: final model.
        tables: tables of the result by file name without extension; prediction tables are named by direction.
        sweeps: table of the measured sweeps; None without sweeps.

    Returns:
        Predictions by the file name of their table; none for a direction without table and sweeps.
    """
    places: list[Place] = [*(Direction if result.model.bushing else ()), *result.specimens]
    predictions = {}
    for name, place in zip(place_names(places), places, strict=True):
        table = tables.get(name)
        if table is None and sweeps is not None:
            table = sweeps[sweeps["direction"] == str(place)]
        if table is None or table.empty:
            continue
        axes = [np.unique(table[header]) for header in ("frequency [Hz]", response_headers(place)[0])]
        if name not in tables:
            axes = [levels[spread_indices(levels.size, _MOST_LEVELS)] for levels in axes]
        predictions[name] = predict(result, place, axes[0], axes[1] / place.display.displacement.factor)
    return predictions


def read_results(folder: Path) -> list[ResultFile]:
    """Read the documents and tables of a results folder.

    Returns:
        Result files for the documents and tables; figures are not read.

    Raises:
        ModelError: the folder does not exist or contains no model, or a file is not as bushfit writes it.
    """
    if not folder.is_dir():
        kind = "a file" if folder.exists() else "nothing"
        raise ModelError("a folder of results is needed", file=folder, found=kind, expected="a folder of bushfit run")
    if not any((folder / f"{name}.json").exists() for name in MODELS):
        present = sorted(path.name for path in folder.iterdir())[:8]
        raise ModelError(
            "there is no model in this folder",
            file=folder,
            found=", ".join(present) or "nothing",
            expected=" or ".join(f"{name}.json" for name in MODELS),
            hint=f"to write a model: bushfit run CAMPAIGN -o {quote_path(folder)}",
        )
    paths = {name: folder / f"{name}.json" for name in (*MODELS, JOINT, "diagnosis")}
    documents = {name: read_document(path) for name, path in paths.items() if path.exists()}
    model = next(name for name in MODELS if name in documents)
    records = sorted({path.stem for path in folder.glob("validation*") if path.suffix in (".csv", ".xlsx")})
    places = [*Direction, *from_document(documents[model], paths[model]).specimens]
    tables = {name: read_table(folder, name) for name in ("loops", "sweeps", "gap", *records, *place_names(places))}
    files = [ResultFile(name, "json", document) for name, document in documents.items()]
    return files + [ResultFile(name, "table", table) for name, table in tables.items() if table is not None]


def read_table(folder: Path, name: str) -> pd.DataFrame | None:
    """Read a table that bushfit wrote into a folder: CSV, with decimal points or commas, or an Excel workbook.

    Args:
        folder: results folder.
        name: file name of the table, without extension.

    Returns:
        Table with columns of floats, and of texts for names and kinds of tests; None if there is no such file.

    Raises:
        ModelError: a table that is not as bushfit writes it.
    """
    file = folder / f"{name}.csv"
    options: dict[str, Any] = {"keep_default_na": False, "na_values": [""]}
    try:
        if file.exists():
            data = read_utf8(file, ModelError, largest=_LARGEST)
            separator, decimal = (";", ",") if b";" in data.partition(b"\n")[0] else (",", ".")
            options |= {"sep": separator, "decimal": decimal, "encoding": "utf-8-sig"}
            table = pd.read_csv(io.BytesIO(data), dtype=dict.fromkeys(_TEXTS, str), **options)
        elif (file := folder / f"{name}.xlsx").exists():
            table = pd.read_excel(file, engine="openpyxl", **options)
        else:
            return None
        for header in table:
            if header in _TEXTS:
                table[header] = [unescape_formula(str(cell)) for cell in table[header].fillna("")]
            elif np.isinf(values := table[header].to_numpy(dtype=float)).any():
                raise ValueError("inf")
            else:
                table[header] = values
        return table
    except (ValueError, KeyError, BadZipFile) as error:
        raise ModelError(
            "this table does not have the format that bushfit writes",
            file=file,
            found=str(error),
            hint="write the results again, or remove the file: the page then omits the table",
        ) from error
