"""The tables and plots of a result, as bytes by file name; `formats` says which to make: csv, png."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

from bushfit.reading.csvfile import to_csv
from bushfit.report import tables

if TYPE_CHECKING:
    from bushfit.diagnosis.record import Diagnosis
    from bushfit.fitting.data_sets import LoopData, SweepData
    from bushfit.model.model import Model
    from bushfit.model.result import Result
    from bushfit.prediction import Prediction


def loop_files(model: Model, data_sets: Sequence[LoopData], formats: Collection[str]) -> dict[str, bytes]:
    """`loops.csv` and `loops.png`; nothing where there are no loops."""
    if not data_sets:
        return {}
    files = {}
    if "csv" in formats:
        files["loops.csv"] = to_csv(tables.loops_table(model, data_sets))
    if "png" in formats:
        from bushfit.report.plots import loops_figure, to_png

        files["loops.png"] = to_png(loops_figure(model, data_sets, model.bushing.name))
    return files


def sweep_files(model: Model, data_sets: Sequence[SweepData], formats: Collection[str]) -> dict[str, bytes]:
    """`sweeps.csv` and `sweeps.png`; nothing where there are no sweeps."""
    if not data_sets:
        return {}
    files = {}
    if "csv" in formats:
        files["sweeps.csv"] = to_csv(tables.sweeps_table(model, data_sets))
    if "png" in formats:
        from bushfit.report.plots import sweeps_figure, to_png

        files["sweeps.png"] = to_png(sweeps_figure(model, data_sets, model.bushing.name))
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
        over = [data_set for data_set in measured if data_set.direction is prediction.direction]
        curves = predict(result, prediction.direction, *fine_grid(prediction))
        rig = predict(result, prediction.direction, *fine_grid(prediction), rig=True) if rig_effects(result) else None
        note = ". ".join(text[0].upper() + text[1:] for text in (*caveats(result), *prediction.warnings))
        title = result.model.bushing.name
        files[f"{prediction.direction}.png"] = to_png(
            prediction_figure(prediction, over, title, curves=curves, rig=rig, note=note)
        )
    return files


def diagnosis_files(diagnosis: Diagnosis, title: str, formats: Collection[str]) -> dict[str, bytes]:
    """`gap.csv`, `candidates.csv` and `gap.png` of a diagnosis."""
    before, after = diagnosis.before, diagnosis.after
    files = {}
    if "csv" in formats:
        files["gap.csv"] = to_csv(tables.gap_table(before.model, after.model, before.data_sets))
        files["candidates.csv"] = to_csv(tables.candidates_table(diagnosis))
    if "png" in formats:
        from bushfit.report.plots import gap_figure, to_png

        files["gap.png"] = to_png(gap_figure(before.model, after.model, before.data_sets, title, diagnosis.summary))
    return files


def artifact_names(kinds: Sequence[str], formats: Collection[str]) -> list[str]:
    """Names of the tables and plots of some kinds: loops, sweeps, gap, axial, radial, torsion."""
    return [f"{kind}.{ending}" for kind in kinds for ending in ("csv", "png") if ending in formats]
