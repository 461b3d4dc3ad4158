"""Everything that a report shows: the records of a result, from a run or from its folder."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd

from bushfit.diagnosis.document import DiagnosisFile
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.geometry import Direction, Place
from bushfit.model.document import CampaignTable, TestTable
from bushfit.model.file import from_document, read_document, require_schema
from bushfit.model.result import Result
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.reading.files import read_utf8, view_bytes
from bushfit.reading.parts import read_sheets
from bushfit.reading.tablefile import undefused
from bushfit.report.results import Documents, ResultFile, Tables, json_file, place_names, table_file
from bushfit.report.tables import TEXTS, columns_of, required, spread
from bushfit.validation import validate_tables

#: Documents that hold a model, the one to use first, and the plain fit beside it.
MODELS, JOINT = ("model", "dynamic", "static"), "joint"
#: Schema of diagnosis.json.
DIAGNOSIS = "bushfit/diagnosis/3"
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
        sweeps, loops: measured and modelled tests, as `tables.sweeps_table` and `tables.loops_table` make them.
        gap: measured minus model before and after a diagnosis, as `tables.gap_table` makes it.
        predictions: of every place that was tested or predicted.
    """

    result: Result
    joint: Result | None
    campaign: CampaignTable | None
    diagnosis: DiagnosisFile | None
    versions: Mapping[str, str]
    sweeps: pd.DataFrame | None
    loops: pd.DataFrame | None
    gap: pd.DataFrame | None
    predictions: Sequence[Prediction]

    @property
    def tests(self) -> Sequence[TestTable]:
        """Tests of the campaign; empty if they are not known."""
        return self.campaign.tests if self.campaign else ()


def report_record(documents: Documents, tables: Tables, files: Mapping[str, Path] | None = None) -> ReportRecord:
    """The records of a result from its documents and tables; predictions are computed from the model.

    Args:
        documents: JSON documents by name: the model, the plain fit, the diagnosis.
        tables: by name: loops, sweeps, gap, and one per predicted place, which gives its grid.
        files: of the documents, for error messages.

    Returns:
        Record for `report_context`.

    Raises:
        ModelError: no model among the documents, or a document or table that is not as bushfit writes it.
    """
    paths = files or {}
    name = next((name for name in MODELS if name in documents), None)
    if name is None:
        raise ModelError("there is no model among the results", expected=" or ".join(f"{name}.json" for name in MODELS))
    model, joint, diagnosis = documents[name], documents.get(JOINT), documents.get("diagnosis")
    result = from_document(model, paths.get(name))
    if diagnosis is not None:
        hint = "bushfit diagnose writes it anew"
        require_schema(diagnosis, paths.get("diagnosis"), "a diagnosis", DIAGNOSIS, hint=hint)
        diagnosis = validate_tables(diagnosis, paths.get("diagnosis"), DiagnosisFile, kind=ModelError)
    campaign, provenance = model.get("campaign"), model.get("provenance", {})
    gap = tables.get("gap")
    sweeps, loops = tables.get("sweeps"), tables.get("loops")
    if gap is not None:
        required(gap, "test", "kind", "direction")
        sweeps = sweeps if sweeps is not None else _of_kind(gap, "sweep")
        loops = loops if loops is not None else _of_kind(gap, "loop")
    for table, header in ((sweeps, "stepped"), (loops, "frequency [Hz]")):
        if table is not None:
            required(table, "direction", header, "outlier")
    return ReportRecord(
        result,
        from_document(joint, paths.get(JOINT)) if joint else None,
        validate_tables(campaign, paths.get(name), CampaignTable, "campaign", kind=ModelError) if campaign else None,
        diagnosis,
        {"bushfit": provenance.get("bushfit") or "", **provenance.get("packages", {})},
        sweeps,
        loops,
        gap,
        _predictions(result, tables, sweeps),
    )


def _of_kind(gap: pd.DataFrame, kind: str) -> pd.DataFrame | None:
    """The sweeps or loops of a table of the gap, as tables of their own would hold them."""
    names = {"force after [noise]": "residual [noise]", "storage after [noise]": "stiffness residual [noise]"}
    names["loss after [noise]"] = "loss residual [noise]"
    rows = gap[gap["kind"] == kind].rename(columns=names)
    return rows if len(rows) else None


def _predictions(result: Result, tables: Tables, sweeps: pd.DataFrame | None) -> list[Prediction]:
    """Predictions on the grids of the tables of places, or on that of the measured sweeps."""
    places: list[Place] = [*(Direction if result.model.bushing else ()), *result.specimens]
    predictions = []
    for name, place in zip(place_names(places), places, strict=True):
        table = tables.get(name)
        if table is None and sweeps is not None:
            table = sweeps[sweeps["direction"] == str(place)]
        if table is None or table.empty:
            continue
        amplitude = columns_of(place)[0]
        columns = required(table, "frequency [Hz]", amplitude)[["frequency [Hz]", amplitude]].to_numpy(dtype=float).T
        frequencies, amplitudes = (_levels(column, name in tables) for column in columns)
        predictions.append(predict(result, place, frequencies, amplitudes / place.display.displacement.factor))
    return predictions


def _levels(values: Array, as_predicted: bool) -> Array:
    levels = np.unique(values)
    return levels if as_predicted else levels[spread(levels.size, _MOST_LEVELS)]


def has_model(folder: Path) -> bool:
    """Check for a model in a folder."""
    return any((folder / f"{name}.json").exists() for name in MODELS)


def read_results(folder: Path) -> list[ResultFile]:
    """Documents and tables of a folder of results.

    Returns:
        Result files with the documents and tables of the folder.

    Raises:
        ModelError: no folder, no results in it, or a file that is not as bushfit writes it.
    """
    if not folder.is_dir():
        kind = "a file" if folder.exists() else "nothing"
        raise ModelError("a folder of results is needed", file=folder, found=kind, expected="as bushfit run writes it")
    files = {
        name: folder / f"{name}.json" for name in (*MODELS, JOINT, "diagnosis") if (folder / f"{name}.json").exists()
    }
    if not has_model(folder):
        present = sorted(path.name for path in folder.iterdir())[:8]
        raise ModelError(
            "there is no model in this folder",
            file=folder,
            found=", ".join(present) or "nothing",
            expected=" or ".join(f"{name}.json" for name in MODELS),
            hint=f"bushfit run CAMPAIGN -o {folder} writes one",
        )
    read = {name: read_document(file) for name, file in files.items()}
    specimens = report_record(read, {}, files).result.specimens
    names = ("loops", "sweeps", "gap", *place_names([*Direction, *specimens]))
    tables = {name: table for name in names if (table := read_table(folder, name)) is not None}
    return [
        *(json_file(name, document) for name, document in read.items()),
        *(table_file(name, partial(pd.DataFrame, table)) for name, table in tables.items()),
    ]


def read_table(folder: Path, name: str) -> pd.DataFrame | None:
    """A table of a folder in the form it was written in; None where it is missing.

    Returns:
        Columns as numbers, or as texts for the headers in `tables.TEXTS`; None without a file.

    Raises:
        ModelError: a table that is not as bushfit writes it.
    """
    for ending, read in (("csv", _csv), ("xlsx", _workbook)):
        file = folder / f"{name}.{ending}"
        if not file.exists():
            continue
        try:
            cells = read(file)
            return pd.DataFrame({header: _column(header, cells[header]) for header in cells.columns})
        except (ValueError, KeyError, pd.errors.ParserError) as error:
            raise ModelError(
                "this table is not as bushfit writes it",
                file=file,
                found=str(error),
                hint="write the results again, or remove the file: the page then omits it",
            ) from error
    return None


def _column(header: str, cells: pd.Series[str]) -> object:
    """Texts, or numbers with nan for empty cells."""
    if header in TEXTS:
        return [undefused(cell) for cell in cells]
    values = cells.str.replace(",", ".").replace("", "nan").astype(float)
    if np.isinf(values).any():
        raise ValueError(f"{header}: inf")
    return values


def _csv(file: Path) -> pd.DataFrame:
    """Cells of a CSV file as texts, with commas and decimal points, or semicolons and decimal commas."""
    data = read_utf8(file, ModelError, largest=_LARGEST)
    separator = re.search("[,;]", data.partition(b"\n")[0].decode("utf-8-sig"))
    return pd.read_csv(
        io.BytesIO(data), sep=separator[0] if separator else ",", dtype=str, keep_default_na=False, encoding="utf-8-sig"
    )


def _workbook(file: Path) -> pd.DataFrame:
    """Cells of the first sheet of a workbook as texts."""
    (first, _), *_ = read_sheets(view_bytes(file, ModelError, largest=_LARGEST), file, kind=ModelError)
    header, *rows = first.content
    cells = ([*map(str, row), *[""] * (len(header) - len(row))] for row in rows if row)
    return pd.DataFrame(list(cells), columns=[str(cell) for cell in header])
