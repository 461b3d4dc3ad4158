"""The tables and plots of a result, as the bytes of each file; `formats` says which to make: csv, png."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from bushfit.reading.csvfile import to_csv
from bushfit.report import tables

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bushfit.diagnosis.record import Diagnosis
    from bushfit.fitting.data_sets import LoopData, SweepData
    from bushfit.model.model import Model
    from bushfit.model.result import Result
    from bushfit.prediction import Prediction


#: The table of each kind of test.
_TABLES: Mapping[str, Callable[[Model, Any], pd.DataFrame]] = {
    "loops": tables.loops_table,
    "sweeps": tables.sweeps_table,
}


def fit_files(
    kind: Literal["loops", "sweeps"],
    model: Model,
    data_sets: Sequence[LoopData] | Sequence[SweepData],
    formats: Collection[str],
) -> dict[str, bytes]:
    """`loops.csv` and `loops.png` of a fit, or `sweeps.csv` and `sweeps.png`; nothing where there are no such tests."""
    files: dict[str, bytes] = {}
    if data_sets and "csv" in formats:
        files[f"{kind}.csv"] = to_csv(_TABLES[kind](model, data_sets))
    if data_sets and "png" in formats:
        from bushfit.report.plots import loops_figure, sweeps_figure, to_png

        draw: Mapping[str, Callable[[Model, Any, str], Figure]] = {"loops": loops_figure, "sweeps": sweeps_figure}
        files[f"{kind}.png"] = to_png(draw[kind](model, data_sets, model.name))
    return files


def prediction_files(
    result: Result, predictions: Sequence[Prediction], measured: Sequence[SweepData], formats: Collection[str]
) -> dict[str, bytes]:
    """`<direction>.csv` and `<direction>.png` of each prediction, the measured points over the model."""
    files = {f"{p.direction}.csv": to_csv(tables.prediction_table(p)) for p in predictions if "csv" in formats}
    if "png" not in formats:
        return files
    from bushfit.prediction import caveats, predict, rig_effects
    from bushfit.report.plots import fine_grid, prediction_figure, to_png

    for prediction in predictions:
        curves = predict(result, prediction.direction, *fine_grid(prediction))
        rig = predict(result, prediction.direction, *fine_grid(prediction), rig=True) if rig_effects(result) else None
        note = ". ".join(text[0].upper() + text[1:] for text in (*caveats(result), *prediction.warnings))
        figure = prediction_figure(prediction, measured, result.model.name, curves=curves, rig=rig, note=note)
        files[f"{prediction.direction}.png"] = to_png(figure)
    return files


def diagnosis_files(diagnosis: Diagnosis, title: str, formats: Collection[str]) -> dict[str, bytes]:
    """`gap.csv`, `candidates.csv` and `gap.png` of a diagnosis."""
    before, after = diagnosis.before, diagnosis.after
    files = {}
    if "csv" in formats:
        files["gap.csv"] = to_csv(tables.gap_table(before.model, after.model, before.data_sets, after.data_sets))
        files["candidates.csv"] = to_csv(tables.candidates_table(diagnosis))
    if "png" in formats:
        from bushfit.report.plots import gap_figure, to_png

        figure = gap_figure(
            before.model, after.model, before.data_sets, title, diagnosis.summary, mended=after.data_sets
        )
        files["gap.png"] = to_png(figure)
    return files


def artifact_names(kinds: Sequence[str], formats: Collection[str]) -> list[str]:
    """Names of the tables and plots of some kinds: loops, sweeps, gap, axial, radial, torsion."""
    return [f"{kind}.{ending}" for kind in kinds for ending in ("csv", "png") if ending in formats]
