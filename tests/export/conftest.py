"""The paper's bushing to be exported over the whole grid of the kept computation, which bushfit did not make; FMUs."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from fmus import Running, request_of
from readers import HASH

from bushfit.export.contract import ExportedFiles, ExportRequest
from bushfit.export.fmu import export
from bushfit.geometry import Direction
from bushfit.model.result import Result
from bushfit.prediction.stiffness import predict
from bushfit.reading.measurement import Source


@pytest.fixture(scope="session")
def known(root) -> pd.DataFrame:
    """Direction, frequency, amplitude, |K| and loss factor in SI, from an independent computation in time."""
    table = pd.read_csv(root / "data/reference/stiffness_table1.csv")
    return table.set_axis(["direction", "frequency", "amplitude", "stiffness", "loss"], axis=1)


@pytest.fixture(scope="session")
def export_request(known, paper_model) -> ExportRequest:
    """All directions; axially five amplitudes, radially four, in torsion three."""
    result = Result(paper_model)
    predictions = [
        predict(result, direction, rows["frequency"].unique(), rows["amplitude"].unique())
        for direction in Direction
        for rows in [known[known["direction"] == direction]]
    ]
    return ExportRequest(result, Source(Path("model.json"), HASH), tuple(predictions), 0.01)


@pytest.fixture(scope="session")
def named(export_request) -> Callable[[str], ExportRequest]:
    """The same of its axial direction, of a bushing and from a file of any name."""

    def called(name: str) -> ExportRequest:
        assert export_request.result.model.bushing is not None
        model = replace(export_request.result.model, bushing=replace(export_request.result.model.bushing, name=name))
        source = Source(Path(name.replace("\0", "") or "x"), HASH)
        return replace(export_request, result=Result(model), source=source, predictions=export_request.predictions[:1])

    return called


@pytest.fixture(scope="session")
def exported(paper_model) -> ExportedFiles:
    """The paper's bushing in three directions."""
    return export(request_of(paper_model))


@pytest.fixture(scope="session")
def paper(exported, tmp_path_factory) -> Running:
    """The same, ready to run."""
    folder = tmp_path_factory.mktemp("fmu")
    ((name, content),) = exported.files.items()
    (folder / name).write_bytes(content)
    return Running(folder / name, folder / "open")
