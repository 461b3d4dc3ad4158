"""Everything that a report shows: the records of a result, from a run or from its folder."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pandas as pd

from bushfit.diagnosis.document import DiagnosisFile
from bushfit.errors import ModelError
from bushfit.geometry import Direction, Place
from bushfit.model.document import CampaignTable, TestTable
from bushfit.model.file import from_document, read_document, require_schema
from bushfit.model.result import Result
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.reading.files import read_utf8
from bushfit.reading.tablefile import undefused
from bushfit.report.results import ResultFile, contents, json_file, place_names, table_file
from bushfit.report.tables import columns_of, required, spread
from bushfit.validation import validate_tables

#: Documents that hold a model, the one to use first, and the plain fit beside it.
MODELS, JOINT = ("model", "dynamic", "static"), "joint"
#: Schema of diagnosis.json.
DIAGNOSIS = "bushfit/diagnosis/3"
#: Columns that hold texts; the others hold numbers.
_TEXTS = ("loop", "sweep", "test", "kind", "direction", "stepped", "part", "outlier")
#: Most levels of a grid that is made from the measured points.
_MOST_LEVELS = 10
#: Size of a table that is read at most [bytes].
_LARGEST = 500_000_000


@dataclass(frozen=True, eq=False)
class ReportRecord:
    """Records of a result that a report shows.

    Args:
        result: the model to use.
        joint: the plain fit, where the model to use holds more.
        campaign: as the model file has it.
        diagnosis: the document of diagnosis.json.
        versions: of bushfit and of the packages that the numbers rest on, by name.
        tables: measured minus model (`gap`), measured and modelled `sweeps` and `loops`, by name, where they are known.
        predictions: of every place that was tested or predicted, by the name of its file.
        charts: figures of the run, by name; those that are missing are made from the tables.
    """

    result: Result
    joint: Result | None
    campaign: CampaignTable | None
    diagnosis: DiagnosisFile | None
    versions: Mapping[str, str]
    tables: Mapping[str, pd.DataFrame]
    predictions: Mapping[str, Prediction]
    charts: Mapping[str, ResultFile]

    @property
    def tests(self) -> Sequence[TestTable]:
        """Tests of the campaign; empty if they are not known."""
        return self.campaign.tests if self.campaign else ()


def report_record(files: Sequence[ResultFile], folder: Path | None = None) -> ReportRecord:
    """The records of a result from its files; predictions are computed from the model.

    Args:
        files: documents (model, plain fit, diagnosis), tables (loops, sweeps, gap, and one per predicted place, which
            gives its grid) and figures.
        folder: where the documents were read, for error messages.

    Returns:
        Records for `report_context`.

    Raises:
        ModelError: no model among the documents, or a document or table that is not as bushfit writes it.
    """
    documents, tables = contents(files, "json"), contents(files, "table")
    paths = {name: folder / f"{name}.json" for name in documents} if folder else {}
    name = next((name for name in MODELS if name in documents), None)
    if name is None:
        raise ModelError("there is no model among the results", expected=" or ".join(f"{name}.json" for name in MODELS))
    model, joint, diagnosis = documents[name], documents.get(JOINT), documents.get("diagnosis")
    result = from_document(model, paths.get(name))
    if diagnosis is not None:
        hint = "bushfit diagnose writes it again"
        require_schema(diagnosis, paths.get("diagnosis"), "a diagnosis", DIAGNOSIS, hint=hint)
        diagnosis = validate_tables(diagnosis, paths.get("diagnosis"), DiagnosisFile, kind=ModelError)
    campaign, provenance = model.get("campaign"), model.get("provenance", {})
    if campaign:
        campaign = validate_tables(campaign, paths.get(name), CampaignTable, "campaign", kind=ModelError)
    tested = _tests(tables)
    return ReportRecord(
        result,
        from_document(joint, paths.get(JOINT)) if joint else None,
        campaign or None,
        diagnosis,
        {"bushfit": provenance.get("bushfit") or "", **provenance.get("packages", {})},
        tested,
        _predictions(result, tables, tested.get("sweeps")),
        {file.name: file for file in files if file.kind == "figure"},
    )


def _tests(tables: Mapping[str, pd.DataFrame]) -> dict[str, pd.DataFrame]:
    """Tables of the gap, sweeps and loops, where they are known; sweeps and loops without their own are in the gap."""
    tested = {name: tables[name] for name in ("gap", "sweeps", "loops") if name in tables}
    if "gap" in tested:
        gap = required(tested["gap"], "test", "kind", "direction")
        parts = {"force": "residual", "storage": "stiffness residual", "loss": "loss residual"}
        rows = gap.rename(columns={f"{part} after [noise]": f"{name} [noise]" for part, name in parts.items()})
        for name, kind in (("sweeps", "sweep"), ("loops", "loop")):
            if name not in tested and (gap["kind"] == kind).any():
                tested[name] = rows[gap["kind"] == kind]
    for name, header in (("sweeps", "stepped"), ("loops", "frequency [Hz]")):
        if name in tested:
            required(tested[name], "direction", header, "frequency [Hz]", "outlier")
    return tested


def _predictions(
    result: Result, tables: Mapping[str, pd.DataFrame], sweeps: pd.DataFrame | None
) -> dict[str, Prediction]:
    """Predictions by file name on the grids of the tables of places, or on that of the measured sweeps."""
    places: list[Place] = [*(Direction if result.model.bushing else ()), *result.specimens]
    predictions = {}
    for name, place in zip(place_names(places), places, strict=True):
        table = tables.get(name)
        if table is None and sweeps is not None:
            table = sweeps[sweeps["direction"] == str(place)]
        if table is None or table.empty:
            continue
        headers = ["frequency [Hz]", columns_of(place)[0]]
        axes = [np.unique(column) for column in required(table, *headers)[headers].to_numpy(dtype=float).T]
        if name not in tables:
            axes = [levels[spread(levels.size, _MOST_LEVELS)] for levels in axes]
        predictions[name] = predict(result, place, axes[0], axes[1] / place.display.displacement.factor)
    return predictions


def has_model(folder: Path) -> bool:
    """Check for a model in a folder."""
    return any((folder / f"{name}.json").exists() for name in MODELS)


def read_results(folder: Path) -> list[ResultFile]:
    """Documents and tables of a folder of results.

    Returns:
        Result files with the documents and tables, not with figures.

    Raises:
        ModelError: no folder, no results in it, or a file that is not as bushfit writes it.
    """
    if not folder.is_dir():
        kind = "a file" if folder.exists() else "nothing"
        raise ModelError("a folder of results is needed", file=folder, found=kind, expected="as bushfit run writes it")
    if not has_model(folder):
        present = sorted(path.name for path in folder.iterdir())[:8]
        raise ModelError(
            "there is no model in this folder",
            file=folder,
            found=", ".join(present) or "nothing",
            expected=" or ".join(f"{name}.json" for name in MODELS),
            hint=f"bushfit run CAMPAIGN -o {folder} writes one",
        )
    paths = {name: folder / f"{name}.json" for name in (*MODELS, JOINT, "diagnosis")}
    documents = [json_file(name, read_document(path)) for name, path in paths.items() if path.exists()]
    specimens = report_record(documents, folder).result.specimens
    names = ("loops", "sweeps", "gap", *place_names([*Direction, *specimens]))
    tables = {name: table for name in names if (table := read_table(folder, name)) is not None}
    return [*documents, *(table_file(name, partial(pd.DataFrame, table)) for name, table in tables.items())]


def read_table(folder: Path, name: str) -> pd.DataFrame | None:
    """A table of a folder in the form it was written in: CSV, with decimal commas or without, or a workbook.

    Returns:
        Columns as numbers, or as texts for the names of tests and what they are; None without a file.

    Raises:
        ModelError: a table that is not as bushfit writes it.
    """
    file, workbook = folder / f"{name}.csv", folder / f"{name}.xlsx"
    try:
        if file.exists():
            data = read_utf8(file, ModelError, largest=_LARGEST)
            separator = ";" if b";" in data.partition(b"\n")[0] else ","
            form: dict[str, Any] = {
                "sep": separator,
                "decimal": "," if separator == ";" else ".",
                "encoding": "utf-8-sig",
            }
            types = dict.fromkeys(_TEXTS, str)
            table = pd.read_csv(io.BytesIO(data), dtype=types, keep_default_na=False, na_values=[""], **form)
        elif (file := workbook).exists():
            table = pd.read_excel(file, engine="openpyxl", keep_default_na=False, na_values=[""])
        else:
            return None
        texts = [header for header in table if header in _TEXTS]
        numbers = table.columns.difference(texts)
        table = table.astype(dict.fromkeys(numbers, float))
        if np.isinf(table[numbers].to_numpy()).any():
            raise ValueError("inf")
        return table.assign(**{header: [undefused(str(cell)) for cell in table[header].fillna("")] for header in texts})
    except (ValueError, KeyError, BadZipFile) as error:
        raise ModelError(
            "this table is not as bushfit writes it",
            file=file,
            found=str(error),
            hint="write the results again, or remove the file: the page then omits it",
        ) from error
