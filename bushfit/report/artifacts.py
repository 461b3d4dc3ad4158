"""The tables and pictures of a result, by the names of their files without endings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from bushfit.campaign.naming import folder_name
from bushfit.effects import Level
from bushfit.geometry import Direction
from bushfit.report import tables
from bushfit.report.compared import SideBySide
from bushfit.report.contents import Contents

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from bushfit.diagnosis.record import Diagnosis
    from bushfit.fitting.data_sets import LoopData, SweepData
    from bushfit.geometry import Place
    from bushfit.model.arms import Arms
    from bushfit.model.model import Model
    from bushfit.model.result import Result
    from bushfit.prediction import PredictedResonance, Prediction


def fit_contents(result: Result, title: str, loops: Sequence[LoopData], sweeps: Sequence[SweepData]) -> Contents:
    """`loops` and `sweeps` of a fit, a table and a picture each; nothing where there are no such tests."""

    def loops_picture() -> Figure:
        from bushfit.report.plots import loops_figure

        return loops_figure(result.model, loops, title)

    def sweeps_picture() -> Figure:
        from bushfit.report.plots import sweeps_figure

        return sweeps_figure(result.model, sweeps, title)

    found = Contents()
    if loops:
        found |= Contents({}, {"loops": partial(tables.loops_table, result.model, loops)}, {"loops": loops_picture})
    if sweeps:
        found |= Contents(
            {}, {"sweeps": partial(tables.sweeps_table, result.model, sweeps)}, {"sweeps": sweeps_picture}
        )
    return found


def prediction_contents(
    result: Result, predictions: Sequence[Prediction], measured: Sequence[SweepData], notes: Sequence[str] = ()
) -> Contents:
    """A table and a picture of each prediction, named after its place, the measured points over the model."""

    def picture(prediction: Prediction) -> Figure:
        from bushfit.caveats import caveats, rig_effects
        from bushfit.prediction import predict
        from bushfit.report.plots import fine_grid, prediction_figure

        grid = fine_grid(prediction)
        curves = predict(result, prediction.direction, *grid)
        rig = predict(result, prediction.direction, *grid, rig=True) if rig_effects(result) else None
        bare = result.model.without(Level.INSTRUMENT)
        note = ". ".join(text[0].upper() + text[1:] for text in (*notes, *caveats(result), *prediction.warnings))
        title = result.name if isinstance(prediction.direction, Direction) else str(prediction.direction)
        return prediction_figure(prediction, measured, title, curves=curves, rig=rig, model=bare, note=note)

    names = place_names([prediction.direction for prediction in predictions])
    pairs = list(zip(names, predictions, strict=True))
    return Contents(
        {},
        {name: partial(tables.prediction_table, prediction) for name, prediction in pairs},
        {name: partial(picture, prediction) for name, prediction in pairs},
    )


def wide_contents(predictions: Sequence[Prediction]) -> Contents:
    """The table of each prediction with frequency down and amplitude across."""
    names = names_of_more([prediction.direction for prediction in predictions], "wide")
    pairs = zip(names, predictions, strict=True)
    return Contents(tables={name: partial(tables.wide_table, prediction) for name, prediction in pairs})


def resonance_contents(resonances: Sequence[PredictedResonance]) -> Contents:
    """A table of a mass on each place."""
    names = names_of_more([found.place for found in resonances], "resonance")
    pairs = zip(names, resonances, strict=True)
    return Contents(tables={name: partial(tables.shaken_table, found) for name, found in pairs})


def arms_contents(model: Model, arms: Sequence[Arms], places: Sequence[Place], title: str) -> Contents:
    """`arms`: Maxwell arms as a table, and a picture of their modulus and its error; nothing where there are none."""

    def picture() -> Figure:
        from bushfit.report.plots import arms_figure

        return arms_figure(model, arms, title)

    table = partial(tables.arms_table, model, arms, places)
    return Contents({}, {"arms": table}, {"arms": picture}) if arms else Contents()


def measured_contents(result: Result, fitted: Sequence[SweepData], left: Sequence[SweepData]) -> Contents:
    """`measured`: every measured sweep, fitted or not, beside the model; nothing where there is none."""

    def table() -> pd.DataFrame:
        shown = tables.sweeps_table(result.model, [*fitted, *left])
        shown["fitted"] = np.repeat(["yes", "no"], [sum(s.frequency.size for s in part) for part in (fitted, left)])
        return shown

    return Contents(tables={"measured": table} if fitted or left else {})


def diagnosis_contents(diagnosis: Diagnosis, title: str) -> Contents:
    """`gap` and `candidates` of a diagnosis, tables, and a picture of the gap."""
    before, after = diagnosis.before, diagnosis.after

    def picture() -> Figure:
        from bushfit.report.plots import gap_figure

        held, words = diagnosis.holdout, f"{diagnosis.verdict}: {diagnosis.summary}"
        words += f". Held out, {held.before:.2f} x noise before and {held.after:.2f} after" if held.parts else ""
        return gap_figure(before.model, after.model, before.data_sets, title, words, mended=after.data_sets)

    tests = before.data_sets, after.data_sets
    gap = partial(tables.gap_table, before.model, after.model, *tests, diagnosis.result.model)
    found = {"gap": gap, "candidates": partial(tables.candidates_table, diagnosis)}
    return Contents({}, found, {"gap": picture})


def comparison_contents(document: Mapping[str, Any]) -> Contents:
    """`compare`, document, picture and page; and `parameters`, `differences` and, of families, `families`, tables."""

    def picture() -> Figure:
        from bushfit.report.plots import comparison_figure

        return comparison_figure(SideBySide.of(document))

    def table(name: str) -> pd.DataFrame:
        return SideBySide.of(document).tables()[name]

    names = ("parameters", *(["families"] if document["families"] else []), "differences")
    made = {name: partial(table, name) for name in names}
    return Contents({"compare": document}, made, {"compare": picture}).paged("compare")


def place_names(places: Sequence[Place]) -> list[str]:
    """The names, without an ending, of the tables and pictures of places: safe on every system, each once."""
    names: list[str] = []
    for place in places:
        name = folder_name(str(place))
        names.append(name if name not in names else f"{name}_{len(names) + 1}")
    return names


def names_of_more(places: Sequence[Place], what: str) -> list[str]:
    """The names of one more table of each place, such as axial_wide: none that a place itself has."""
    taken, names = place_names(places), list[str]()
    for name in taken:
        more = f"{name}_{what}"
        while more in taken:
            more += "_"
        names.append(more)
    return names
