"""export: one fitted model in the files of other programs."""

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import numpy as np
from typing_extensions import Doc, TypedDict

from bushfit.campaign.campaign import Campaign
from bushfit.errors import ModelError
from bushfit.export.contract import Dialect, Exported, Order, UnitSystem
from bushfit.jobs.predict import Predict, Predicted
from bushfit.model.result import Result
from bushfit.progress import track
from bushfit.reading.files import sha256, view_bytes
from bushfit.reading.measurement import Source
from bushfit.report.artifacts import arms_contents
from bushfit.report.contents import Contents

#: Where each format is written: a module below bushfit, and its function of an Order; loaded when asked for.
FORMATS = {
    "fmu": "export.fmu:export",
    "nastran": "export.nastran:export",
    "abaqus": "export.abaqus:export",
    "adams": "export.adams:export",
    "csv": "report.spreadsheets:csv",
    "xlsx": "report.spreadsheets:xlsx",
}


class FormatEntry(TypedDict):
    """One format."""

    files: Annotated[list[str], Doc("by name.")]
    left_out: Annotated[list[str], Doc("what it cannot carry, and the error that this costs over the exported grid.")]


class ExportDocument(TypedDict):
    """What was exported."""

    formats: Annotated[dict[str, FormatEntry], Doc("by name.")]
    warnings: Annotated[list[str], Doc("what a user must know before using the numbers.")]


@dataclass(frozen=True, eq=False)
class Written:
    """The outcome of an export: what was predicted, and each format's files and losses by its name."""

    predicted: Predicted
    exported: Mapping[str, Exported]

    @property
    def files(self) -> dict[str, bytes]:
        """The files of all formats by name."""
        return {name: content for each in self.exported.values() for name, content in each.files.items()}

    @property
    def contents(self) -> Contents:
        """Table and picture of the Maxwell arms, where a format has them."""
        arms = tuple(part for each in self.exported.values() for part in each.arms)
        result, places = self.predicted.result, [found.direction for found in self.predicted.predictions]
        return arms_contents(result.model, arms, places, result.name)

    @property
    def document(self) -> ExportDocument:
        """What `--json` prints."""
        return {
            "formats": {
                name: {"files": list(each.files), "left_out": list(each.losses)} for name, each in self.exported.items()
            },
            "warnings": self.predicted.warnings,
        }


@dataclass(frozen=True)
class Export:
    """A model over the grid of a prediction in some formats; directions share one list of frequencies."""

    formats: Sequence[str]
    predict: Predict = field(default_factory=Predict)
    accuracy: float = 0.01
    units: UnitSystem | None = None
    dialect: Dialect = "nastran"
    decimal_comma: bool = False

    def run(self, result: Result, source: Source, campaign: Campaign | None) -> Written:
        """Predict, and write every format.

        Raises:
            ModelError: a model that a format cannot hold, or as `Predict.run`.
        """
        predicted = self.predict.run(result, campaign)
        grids = [np.unique(prediction.frequency) for prediction in predicted.predictions]
        if not all(np.array_equal(grid, grids[0]) for grid in grids):
            asked = replace(self.predict.asked, frequencies=tuple(np.unique(np.concatenate(grids)).tolist()))
            predicted = replace(self.predict, asked=asked).run(result, campaign)
        settings = (self.accuracy, self.units, self.dialect, self.decimal_comma)
        day = datetime.now(UTC).date().isoformat()
        order = Order(result, source, tuple(predicted.predictions), *settings, self.predict.temperature, day)
        exported = {}
        for name in track("formats written", self.formats):
            module, _, function = FORMATS[name].partition(":")
            exported[name] = getattr(importlib.import_module(f"bushfit.{module}"), function)(order)
        return Written(predicted, exported)


def source_of(file: Path) -> Source:
    """A model file by its name and hash."""
    return Source(Path(file.name), sha256(view_bytes(file, ModelError)).result())
