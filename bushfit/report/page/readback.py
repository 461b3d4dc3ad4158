"""Result folders read back: documents and tables by name, as they were before they were files.

pydantic checks what a page reads of the documents, so that what is spoiled is one clear error.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd

from bushfit.diagnosis.document import DiagnosisFile
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.geometry import Direction, Place
from bushfit.model.document import CampaignTable, TestTable
from bushfit.model.file import from_document, read_document, require_schema
from bushfit.model.result import Result
from bushfit.reading.files import read_utf8, view_bytes
from bushfit.reading.parts import read_sheets
from bushfit.reading.tablefile import for_each_distinct, in_a_line, undefused
from bushfit.report.results import Documents, ResultFile, Tables, json_file, place_names, table_file
from bushfit.report.tables import TEXTS, required
from bushfit.validation import LARGEST_NUMBER, validate_tables

#: Documents that hold a model, the one to use first.
MODELS = ("model", "dynamic", "static")
#: The plain fit, beside a model with what was added.
PLAIN = "joint"
#: What "schema" of a diagnosis says, and what an older one lacks.
DIAGNOSES = "bushfit/diagnosis/3", "bushfit/diagnosis/2"
_ODDS = {"schema": DIAGNOSES[0], "nothing": 0.0, "odds": []}
#: Documents of a result.
_DOCUMENTS = (*MODELS, PLAIN, "diagnosis")
#: Tables of a result beside those of the predictions, which are named after places.
_TABLES = ("loops", "sweeps", "gap", "candidates")
#: Powers of ten that are exact.
_TENS = np.array([float(f"1e{power}") for power in range(23)])
#: Size of a table that is read back at most [bytes]: ten times that of a loop as it is written.
_LARGEST = 500_000_000


@dataclass(frozen=True, eq=False)
class ReportData:
    """All that a report is made of: the documents of a result, checked, and its tables.

    Args:
        result: the model to use.
        plain: the plain fit, where another model is to be used.
        campaign: the campaign.
        has_odds: whether the diagnosis tells probabilities, as that of an older version does not.
        versions: of bushfit and of the packages that the numbers rest on.
        tables: by name, as their files give them back.
    """

    result: Result
    plain: Result | None
    campaign: CampaignTable | None
    diagnosis: DiagnosisFile | None
    has_odds: bool
    versions: Mapping[str, str]
    tables: Tables

    @classmethod
    def of(cls, documents: Documents, tables: Tables, files: Mapping[str, Path] | None = None) -> ReportData:
        """Documents and tables by their names, the documents checked; errors name the `files` they were read from.

        Raises:
            ModelError: no model among them, or one that is spoiled.
        """
        at = files or {}
        name = next((name for name in MODELS if name in documents), None)
        if name is None:
            expected = " or ".join(f"{name}.json" for name in MODELS)
            raise ModelError("there is no model among the results", expected=expected)
        model, plain, diagnosis = documents[name], documents.get(PLAIN), documents.get("diagnosis")
        result = from_document(model, at.get(name))
        has_odds = diagnosis is not None and diagnosis.get("schema") == DIAGNOSES[0]
        if diagnosis is not None:
            hint = "bushfit diagnose writes it anew"
            require_schema(diagnosis, at.get("diagnosis"), "a diagnosis", *DIAGNOSES, hint=hint)
            diagnosis = diagnosis if has_odds else {**diagnosis, **_ODDS}
            diagnosis = validate_tables(diagnosis, at.get("diagnosis"), DiagnosisFile, kind=ModelError)
        campaign, provenance = model.get("campaign"), model.get("provenance", {})
        return cls(
            result,
            from_document(plain, at.get(PLAIN)) if plain else None,
            validate_tables(campaign, at.get(name), CampaignTable, "campaign", kind=ModelError) if campaign else None,
            diagnosis,
            has_odds,
            {"bushfit": provenance.get("bushfit") or "", **provenance.get("packages", {})},
            {name: canonical(table) for name, table in tables.items()},
        )

    @property
    def tests(self) -> Sequence[TestTable]:
        """The tests of the campaign, as far as they are known."""
        return self.campaign.tests if self.campaign else ()

    @cached_property
    def places(self) -> dict[str, Place]:
        """Every place of which there are tests or predictions, directions first, by the name of its table."""
        every: list[Place] = [*(Direction if self.result.model.bushing else ()), *self.result.specimens]
        tables = (table for table in self.tables.values() if "direction" in table)
        tested = {place for table in tables for place in table["direction"].unique()}
        named = zip(place_names(every), every, strict=True)
        return {name: place for name, place in named if name in self.tables or str(place) in tested}

    @property
    def gap(self) -> pd.DataFrame | None:
        """The table of what is left before and after a diagnosis, where there is one."""
        return required(self.tables["gap"], "test", "kind", "direction") if "gap" in self.tables else None

    def measured(self, kind: Literal["sweep", "loop"]) -> Iterator[tuple[str, Place, pd.DataFrame]]:
        """Points of sweeps, or rows of loops, beside the model, of each place that has any: name, place and rows.

        They stand in a table of their own, else among those of the gap.
        """
        gap = self.gap
        if (table := self.tables.get(f"{kind}s")) is not None:
            table = required(table.rename(columns={kind: "test"}), "test", "direction")
        elif gap is not None and any(str(name).startswith("model ") for name in gap):  # not an older version's
            table = gap[gap["kind"] == kind]
        if table is None:
            return
        for name, place in self.places.items():
            rows = table[table["direction"] == str(place)]
            if len(rows):
                yield name, place, rows


def has_model(folder: Path) -> bool:
    """Whether a folder holds a model, and so perhaps more of a result."""
    return any((folder / f"{name}.json").exists() for name in MODELS)


def read_results(folder: Path) -> list[ResultFile]:
    """Documents and tables of a results folder.

    Raises:
        ModelError: no folder, none of results, or a file in it that is not as bushfit writes it.
    """
    if not folder.is_dir():
        found = "a file" if folder.exists() else "nothing"
        raise ModelError("a folder of results is needed", file=folder, found=found, expected="as bushfit run writes it")
    files = {name: folder / f"{name}.json" for name in _DOCUMENTS if (folder / f"{name}.json").exists()}
    if not has_model(folder):
        standing = sorted(path.name for path in folder.iterdir())[:8]
        raise ModelError(
            "there is no model in this folder",
            file=folder,
            found=", ".join(standing) or "nothing",
            expected=" or ".join(f"{name}.json" for name in MODELS),
            hint=f"bushfit run CAMPAIGN -o {folder} makes one",
        )
    documents = {name: read_document(file) for name, file in files.items()}
    specimens = ReportData.of(documents, {}, files).result.specimens
    tables = {name: read_table(folder, name) for name in (*_TABLES, *place_names([*Direction, *specimens]))}
    made = [table_file(name, partial(pd.DataFrame, table)) for name, table in tables.items() if table is not None]
    return [*(json_file(name, document) for name, document in documents.items()), *made]


def canonical(table: pd.DataFrame) -> pd.DataFrame:
    """A table as its file would give it back: texts, and numbers of seven digits; nan where a cell is empty."""

    def column(name: str) -> object:
        values = table[name]
        if name in TEXTS:
            return for_each_distinct(values.astype(str), lambda value: in_a_line(str(value)))
        return _of_seven_digits(values.to_numpy(dtype=float, na_value=np.nan))

    return pd.DataFrame({str(name): column(name) for name in table.columns})


def _of_seven_digits(values: Array) -> Array:
    """What seven digits give back of numbers, (n,): by arithmetic, which is exact up to the 22nd power of ten, but for
    the few that are larger, or nearly half way between two."""
    with np.errstate(divide="ignore", invalid="ignore"):
        places = 6.0 - np.floor(np.log10(np.abs(values)))
        usual = np.abs(places) < _TENS.size
        tens = _TENS[np.where(usual, np.abs(places), 0.0).astype(int)]
        scaled = np.where(places < 0.0, values / tens, values * tens)
        whole = np.rint(scaled)
        sure = usual & (np.abs(np.abs(scaled - whole) - 0.5) > 1e-6) & (np.abs(whole) >= 1e6) & (np.abs(whole) <= 1e7)
    found = np.where(places < 0.0, whole * tens, whole / tens)
    found[~sure] = [float(f"{value:.7g}") for value in values[~sure].tolist()]
    return found


def read_table(folder: Path, name: str) -> pd.DataFrame | None:
    """A table in whichever form it stands, CSV first; None where it does not.

    Raises:
        ModelError: a table that is not as bushfit writes it.
    """
    for ending, read in (("csv", _csv), ("xlsx", _workbook)):
        file = folder / f"{name}.{ending}"
        if not file.exists():
            continue
        try:
            texts = read(file)
            return pd.DataFrame({header: _column(header, texts[header]) for header in texts.columns})
        except (ValueError, KeyError, pd.errors.ParserError) as error:
            raise ModelError(
                "this table is not as bushfit writes it",
                file=file,
                found=str(error),
                hint="write the results anew, or take the file away: the page then goes without it",
            ) from error
    return None


def _column(header: str, cells: pd.Series[str]) -> object:
    """Texts as they were, or numbers, of which an empty cell is none."""
    if header in TEXTS:
        return [undefused(cell) for cell in cells]
    values = np.array([float(cell.replace(",", ".")) if cell else 0.0 for cell in cells], dtype=float)
    for cell, size in zip(cells, np.abs(values), strict=True):
        if not (size == 0.0 or 1.0 / LARGEST_NUMBER < size < LARGEST_NUMBER):
            raise ValueError(f"{header}: {cell}")
    return np.where(cells == "", np.nan, values)


def _csv(file: Path) -> pd.DataFrame:
    """Cells of a CSV file as texts, with commas and points, or semicolons and decimal commas."""
    data = read_utf8(file, ModelError, largest=_LARGEST)
    mark = re.search("[,;]", data.partition(b"\n")[0].decode("utf-8-sig"))
    return pd.read_csv(
        io.BytesIO(data), sep=mark[0] if mark else ",", dtype=str, keep_default_na=False, encoding="utf-8-sig"
    )


def _workbook(file: Path) -> pd.DataFrame:
    """Cells of the first sheet of a workbook as texts."""
    (first, _), *_ = read_sheets(view_bytes(file, ModelError, largest=_LARGEST), file, kind=ModelError)
    header, *rows = first.content
    return pd.DataFrame([[str(cell) for cell in row] for row in rows if row], columns=[str(cell) for cell in header])
