"""The tables and plots of a result, as the bytes of each file; `formats` says which to make: csv, png."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING

import numpy as np

from bushfit.campaign.naming import folder_name
from bushfit.effects import Level
from bushfit.geometry import Direction
from bushfit.reading.csvfile import to_csv
from bushfit.report import tables

if TYPE_CHECKING:
    from bushfit.diagnosis.record import Diagnosis
    from bushfit.fitting.data_sets import LoopData, SweepData
    from bushfit.geometry import Place
    from bushfit.model.result import Result
    from bushfit.prediction import Prediction


def fit_files(
    result: Result, title: str, loops: Sequence[LoopData], sweeps: Sequence[SweepData], formats: Collection[str]
) -> dict[str, bytes]:
    """`loops.csv` and `loops.png` of a fit, `sweeps.csv` and `sweeps.png`; nothing where there are no such tests."""
    model, files = result.model, dict[str, bytes]()
    if "csv" in formats:
        files |= {"loops.csv": to_csv(tables.loops_table(model, loops))} if loops else {}
        files |= {"sweeps.csv": to_csv(tables.sweeps_table(model, sweeps))} if sweeps else {}
    if "png" in formats:
        from bushfit.report.plots import loops_figure, sweeps_figure, to_png

        files |= {"loops.png": to_png(loops_figure(model, loops, title))} if loops else {}
        files |= {"sweeps.png": to_png(sweeps_figure(model, sweeps, title))} if sweeps else {}
    return {name: files[name] for name in artifact_names(("loops", "sweeps"), formats) if name in files}


def prediction_files(
    result: Result,
    predictions: Sequence[Prediction],
    measured: Sequence[SweepData],
    formats: Collection[str],
    notes: Sequence[str] = (),
) -> dict[str, bytes]:
    """`<place>.csv` and `<place>.png` of each prediction, the measured points over the model."""
    names = place_files([prediction.direction for prediction in predictions])
    pairs = list(zip(names, predictions, strict=True))
    files = {f"{name}.csv": to_csv(tables.prediction_table(p)) for name, p in pairs if "csv" in formats}
    if "png" not in formats:
        return files
    from bushfit.prediction import caveats, predict, rig_effects
    from bushfit.report.plots import fine_grid, prediction_figure, to_png

    bare = result.model.without(Level.INSTRUMENT)
    for name, prediction in pairs:
        curves = predict(result, prediction.direction, *fine_grid(prediction))
        rig = predict(result, prediction.direction, *fine_grid(prediction), rig=True) if rig_effects(result) else None
        note = ". ".join(text[0].upper() + text[1:] for text in (*notes, *caveats(result), *prediction.warnings))
        title = result.name if isinstance(prediction.direction, Direction) else str(prediction.direction)
        figure = prediction_figure(prediction, measured, title, curves=curves, rig=rig, model=bare, note=note)
        files[f"{name}.png"] = to_png(figure)
    return files


def measured_file(
    result: Result, fitted: Sequence[SweepData], left: Sequence[SweepData], formats: Collection[str]
) -> dict[str, bytes]:
    """`measured.csv`: every measured sweep, fitted or not, beside the model; nothing where there is none."""
    if not ((fitted or left) and "csv" in formats):
        return {}
    table = tables.sweeps_table(result.model, [*fitted, *left])
    table["fitted"] = np.repeat(["yes", "no"], [sum(s.frequency.size for s in part) for part in (fitted, left)])
    return {"measured.csv": to_csv(table)}


def place_files(places: Sequence[Place]) -> list[str]:
    """The names, without an ending, of the tables and plots of places: safe on every system, each once."""
    names: list[str] = []
    for place in places:
        name = folder_name(str(place))
        names.append(name if name not in names else f"{name}_{len(names) + 1}")
    return names


def resonance_files(places: Sequence[Place]) -> list[str]:
    """The names of the tables of a mass on each place."""
    return [f"{name}_resonance.csv" for name in place_files(places)]


def diagnosis_files(diagnosis: Diagnosis, title: str, formats: Collection[str]) -> dict[str, bytes]:
    """`gap.csv`, `candidates.csv` and `gap.png` of a diagnosis."""
    before, after = diagnosis.before, diagnosis.after
    files = {}
    if "csv" in formats:
        files["gap.csv"] = to_csv(tables.gap_table(before.model, after.model, before.data_sets, after.data_sets))
        files["candidates.csv"] = to_csv(tables.candidates_table(diagnosis))
    if "png" in formats:
        from bushfit.report.plots import gap_figure, to_png

        held, words = diagnosis.holdout, f"{diagnosis.verdict}: {diagnosis.summary}"
        words += f". Held out, {held.before:.2f} x noise before and {held.after:.2f} after" if held.parts else ""
        figure = gap_figure(before.model, after.model, before.data_sets, title, words, mended=after.data_sets)
        files["gap.png"] = to_png(figure)
    return files


def artifact_names(kinds: Sequence[str], formats: Collection[str]) -> list[str]:
    """Names of the tables and plots of some kinds: loops, sweeps, gap, axial, radial, torsion."""
    return [f"{kind}.{ending}" for kind in kinds for ending in ("csv", "png") if ending in formats]
