"""The tables and pictures of a result or a plan, by the names of their files without endings."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from typing import Any

import numpy as np
import pandas as pd

from bushfit.campaign.schema import SimulatedLoop
from bushfit.diagnosis.record import Diagnosis
from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import LoopData, SweepData
from bushfit.fitting.master_curve import master_curve
from bushfit.geometry import Direction, Place
from bushfit.model.arms import Arms
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.planning.contract import Plan, Test, operating_points
from bushfit.prediction.caveats import warnings_of
from bushfit.prediction.stiffness import Prediction
from bushfit.reading.tablefile import folder_name
from bushfit.report import plots, tables
from bushfit.report.compared import SideBySide
from bushfit.report.contents import Contents
from bushfit.units import number

#: Columns of the sheet, those of a plan without any test too.
_COLUMNS = (
    *("order", "direction", "test", "amplitude", "frequency [Hz]", "cycles", "repeat", "force up to", "minutes"),
    *("minutes so far", "what for"),
)


def fit_contents(result: Result, title: str, loops: Sequence[LoopData], sweeps: Sequence[SweepData]) -> Contents:
    """`loops` and `sweeps` of a fit, a table and a picture each; nothing where there are no such tests."""
    contents = Contents()
    if loops:
        of_loops = cache(partial(tables.loops_table, result.model, loops))
        contents |= Contents.shown("loops", of_loops, lambda: plots.fits.loops_figure(result, of_loops(), title))
    if sweeps:
        of_sweeps = cache(partial(tables.sweeps_table, result.model, sweeps))
        contents |= Contents.shown("sweeps", of_sweeps, lambda: plots.fits.sweeps_figure(result, of_sweeps(), title))
    return contents


def temperature_contents(result: Result, title: str, sweeps: Sequence[SweepData]) -> Contents:
    """`master_curve` and `shift_factors` of sweeps at several temperatures, a table and a picture each."""
    found = cache(partial(master_curve, result, sweeps))
    curves = Contents.shown(
        "master_curve",
        lambda: tables.master_curve_table(found()),
        lambda: plots.master_curve.master_curve_figure(result.model, found(), title),
    )
    return curves | Contents.shown(
        "shift_factors",
        lambda: tables.shift_factors_table(found()),
        lambda: plots.master_curve.shift_factors_figure(result, found(), title),
    )


def prediction_contents(
    result: Result, predictions: Sequence[Prediction], measured: Sequence[SweepData], notes: Sequence[str] = ()
) -> Contents:
    """A table and a picture of each prediction, named after its place, the measured points over the model."""

    def picture(prediction: Prediction) -> Any:
        note = plots.style.first_sentences(warnings_of(result, [], (*prediction.warnings, *notes)))
        title = result.name if isinstance(prediction.direction, Direction) else str(prediction.direction)
        sweeps = [sweep for sweep in measured if sweep.direction == prediction.direction]
        table = tables.sweeps_table(result.model, sweeps) if sweeps else None
        return plots.prediction.prediction_figure(result, prediction, table, title, note)

    names = place_names([prediction.direction for prediction in predictions])
    pairs = list(zip(names, predictions, strict=True))
    made = {name: partial(tables.prediction_table, prediction) for name, prediction in pairs}
    return Contents({}, made, {name: partial(picture, prediction) for name, prediction in pairs})


def more_contents(
    what: str, table: Callable[[Any], pd.DataFrame], places: Sequence[Place], found: Sequence[Any]
) -> Contents:
    """One more table of each place: `wide`, with amplitude across, or the `resonance` of a mass on it."""
    pairs = zip(names_of_more(places, what), found, strict=True)
    return Contents(tables={name: partial(table, each) for name, each in pairs})


def arms_contents(model: Model, arms: Sequence[Arms], places: Sequence[Place], title: str) -> Contents:
    """`arms`: Maxwell arms as a table, and a picture of their modulus and its error; nothing where there are none."""
    table = partial(tables.arms_table, model, arms, places)
    found = Contents.shown("arms", table, lambda: plots.master_curve.arms_figure(model, arms, title))
    return found if arms else Contents()


def measured_contents(result: Result, fitted: Sequence[SweepData], left: Sequence[SweepData]) -> Contents:
    """`measured`: every measured sweep, fitted or not, beside the model; nothing where there is none."""

    def table() -> pd.DataFrame:
        shown = tables.sweeps_table(result.model, [*fitted, *left])
        shown["fitted"] = np.repeat(["yes", "no"], [sum(s.frequency.size for s in part) for part in (fitted, left)])
        return shown

    return Contents(tables={"measured": table} if fitted or left else {})


def diagnosis_contents(diagnosis: Diagnosis, title: str) -> Contents:
    """`gap` and `candidates` of a diagnosis, tables, and a picture of the gap."""
    gap = cache(partial(tables.gap_table, diagnosis))

    def picture() -> Any:
        return plots.gap.gap_figure(gap(), diagnosis.result, diagnosis.to_document(), title)

    candidates = {"candidates": partial(tables.candidates_table, diagnosis)}
    return Contents.shown("gap", gap, picture) | Contents(tables=candidates)


def comparison_contents(document: Mapping[str, Any]) -> Contents:
    """`compare`, document, picture and page; and `parameters`, `differences` and, of families, `families`, tables."""
    names = ("parameters", *(["families"] if document["families"] else []), "differences")
    made = {name: partial(lambda name: SideBySide.of(document).tables()[name], name) for name in names}
    picture = {"compare": lambda: plots.batch.comparison_figure(SideBySide.of(document))}
    return Contents({"compare": document}, made, picture)


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


def plan_contents(plan: Plan) -> Contents:
    """`plan`: the sheet as a table, and the picture."""
    return Contents.shown("plan", partial(plan_sheet, plan), lambda: plots.plan.plan_figure(plan))


def plan_sheet(plan: Plan) -> pd.DataFrame:
    """A row for each run of the rig, in the order in which they are made.

    Amplitudes count zero-to-peak. The force, moment or stress is what the model expects at most, to choose a load cell.
    """
    tests = plan.planned.tests
    counts, seen, rows = Counter(tests), Counter[Test](), []
    for order, (test, minutes) in enumerate(zip(tests, plan.planned.minutes, strict=True), start=1):
        seen[test] += 1
        (frequency, amplitude), (length, force, _) = operating_points(test), test.direction.display
        stiffness = np.abs(plan.knowledge.model.stiffness(test.direction, frequency, amplitude))
        most = number(force.factor * float(np.max(stiffness * amplitude)), 2)
        rows.append(
            {
                "order": order,
                "direction": str(test.direction),
                "test": "loop" if isinstance(test, SimulatedLoop) else f"sweep over {test.stepped}",
                "amplitude": f"{_listed(length.factor * amplitude)} {length.name}",
                "frequency [Hz]": _listed(frequency),
                "cycles": str(test.cycles) if isinstance(test, SimulatedLoop) else "until steady",
                "repeat": f"{seen[test]} of {counts[test]}",
                "force up to": f"{most} {force.name}",
                "minutes": round(float(minutes), 1),
                "minutes so far": round(float(np.sum(plan.planned.minutes[:order])), 1),
                "what for": plan.purposes[test],
            }
        )
    return pd.DataFrame(rows, columns=_COLUMNS)


def _listed(values: Array) -> str:
    """The distinct numbers among some, in their order."""
    return " ".join(dict.fromkeys(number(value, 4) for value in values.tolist()))
