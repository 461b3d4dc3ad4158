"""plan: choose the tests that would reduce the uncertainty most, within the limits of the rig."""

from collections import Counter
from collections.abc import Mapping, Sequence
from functools import partial
from itertools import accumulate
from typing import Any, Unpack

import numpy as np
import pandas as pd

from bushfit.campaign.campaign import Campaign, model_of
from bushfit.campaign.schema import RigSettings
from bushfit.commands.fit import prepare_tests
from bushfit.effects.contract import Array
from bushfit.errors import ModelError, unknown_name
from bushfit.geometry import default_places, get_places
from bushfit.model.result import Result
from bushfit.planning.campaign import campaign_toml
from bushfit.planning.compound import guess_parameters
from bushfit.planning.contract import Aim, Knowledge, PlanRequest, operating_points
from bushfit.planning.knowledge import from_campaign, from_result, with_rig_class
from bushfit.planning.plan import Plan
from bushfit.planning.plan import plan as choose_tests
from bushfit.prediction.grid import GridOptions, default_grid, grid_settings, requested_grid
from bushfit.report.results import ResultFile
from bushfit.units import number

#: Predicted quantities that may be targets.
PREDICTED = ("stiffness", "loss_factor")
#: Name of the campaign file of a plan, which `simulate` takes.
CAMPAIGN_FILE = "campaign.toml"


def plan(
    source: Campaign | Result | Knowledge,
    campaign: Campaign | None = None,
    *,
    aim: Aim = "predictions",
    hours: float = 8.0,
    test_directions: Sequence[str] = (),
    parameters: Sequence[str] = (),
    rivals: Sequence[str] = (),
    targets: Mapping[str, float] | None = None,
    **grid: Unpack[GridOptions],
) -> Plan:
    """Choose the next tests of a campaign, of a fitted model, or of a compound that was not tested yet.

    Args:
        source: campaign with tests, with a compound, or with a model to simulate; or a fitted model.
        campaign: campaign with the rig and the wanted predictions, if `source` is a fitted model.
        aim: reduce the uncertainty of "parameters" or "predictions", or distinguish "rivals".
        hours: maximum duration on the rig [h].
        test_directions: directions or specimens that the rig can test; default axial and radial, or all specimens.
        parameters: parameters whose errors are reduced; default all.
        rivals: effects to distinguish; default those that the diagnosis cannot distinguish.
        targets: wanted half-width of the 95 % interval relative to the value, by parameter, or by "stiffness" or
            "loss_factor" everywhere or in one direction, such as "stiffness.axial".
        grid: directions, frequencies [Hz], amplitudes [m], torsion_amplitudes [rad] and strain_amplitudes of the wanted
            predictions.

    Returns:
        Tests in their order with their expected results.

    Raises:
        CampaignError: the campaign has no tests, no compound and no model.
        FitError: tests that cannot support a fit.
        ModelError: a parameter that is not fitted, a direction without a body, or no tests for this aim.
    """
    knowledge = _knowledge(source, rivals if aim == "rivals" else None)
    campaign = source if isinstance(source, Campaign) else campaign
    for name in parameters:
        if name not in knowledge.names:
            raise unknown_name("this is not a parameter of the plan", name, knowledge.names, ModelError, "--parameters")
    specimens = knowledge.result.specimens
    default = default_places(knowledge.model.bushing, () if knowledge.model.bushing else specimens)
    places = tuple(place for name in test_directions for place in get_places(name, specimens)) or tuple(default)
    settings, sweeps = grid_settings(grid, campaign), campaign.sweeps if campaign else ()
    wanted_places = [place for name in settings.directions or () for place in get_places(name, specimens)]
    start = Result(knowledge.model, specimens=specimens)
    grids = {
        place: requested_grid(default_grid(start, place, sweeps), settings, place) for place in wanted_places or default
    }
    rig = with_rig_class(campaign.rig if campaign else RigSettings(), knowledge.noise)
    wanted, possible = dict[str, float](), {name: [name] for name in knowledge.names}
    for quantity in PREDICTED:
        predictions = [f"{quantity}.{place}" for place in grids]
        possible |= {quantity: predictions, **{prediction: [prediction] for prediction in predictions}}
    for name, half_width in (targets or {}).items():
        if name not in possible:
            raise unknown_name("there is no such target", name, possible, ModelError, "--target")
        for target in possible[name]:
            wanted[target] = min(half_width, wanted.get(target, half_width))
    request = PlanRequest(aim, hours, rig, places, grids, tuple(parameters) or knowledge.names, wanted)
    return choose_tests(knowledge, request)


def plan_files(plan: Plan) -> list[ResultFile]:
    """Result files of a plan: document, sheet of tests for the operator and, if it has tests, a campaign file."""
    files = [ResultFile("plan", "json", plan.document), ResultFile("plan", "table", partial(plan_sheet, plan))]
    if plan.tests:
        files.append(ResultFile(CAMPAIGN_FILE, "raw", campaign_toml(plan.knowledge, plan.tests).encode()))
    return files


def _knowledge(source: Campaign | Result | Knowledge, rivals: Sequence[str] | None) -> Knowledge:
    """Model and uncertainty of its parameters before the planned tests.

    Args:
        source: fitted model; campaign with tests, [compound] or [simulate]; or knowledge, which is returned unchanged.
        rivals: names of effects to distinguish; empty for those that a diagnosis of the tests cannot distinguish, None
            to distinguish none.
    """
    if isinstance(source, Knowledge):
        return source
    if isinstance(source, Result):
        return from_result(source)
    if source.loops or source.sweeps:
        return from_campaign(prepare_tests(source), rivals)
    if source.bushing and source.compound:
        return guess_parameters(source.bushing, source.compound)
    return from_result(Result(model_of(source), specimens=source.specimens))


def plan_sheet(plan: Plan) -> pd.DataFrame:
    """Table of tests for the operator of the rig: one row for each run in order, with zero-to-peak amplitudes.

    The force, moment or stress is the largest that the model predicts, to choose a load cell.

    Args:
        plan: plan with its tests in order.

    Returns:
        Table of texts, with durations [min].
    """
    tests, runs, model = plan.tests, plan.document["tests"], plan.knowledge.model
    counts, minutes = Counter(tests), [run["minutes"] for run in runs]
    amplitudes, frequencies, forces = list[str](), list[str](), list[str]()
    for test in tests:
        (frequency, amplitude), (length, force, _) = operating_points(test), test.direction.display
        largest = float(np.max(np.abs(model.stiffness(test.direction, frequency, amplitude)) * amplitude))
        amplitudes.append(f"{_distinct(length.factor * amplitude)} {length.name}")
        frequencies.append(_distinct(frequency))
        forces.append(f"{number(force.factor * largest, 2)} {force.name}")
    columns: dict[str, Sequence[Any]] = {
        "order": range(1, len(tests) + 1),
        "direction": [run["place"] for run in runs],
        "test": [f"sweep over {run['stepped']}" if run["kind"] == "sweep" else "loop" for run in runs],
        "amplitude": amplitudes,
        "frequency [Hz]": frequencies,
        "cycles": ["until steady" if run["cycles"] is None else str(run["cycles"]) for run in runs],
        "repeat": [f"{tests[: index + 1].count(test)} of {counts[test]}" for index, test in enumerate(tests)],
        "force up to": forces,
        "minutes": [round(duration, 1) for duration in minutes],
        "minutes so far": [round(total, 1) for total in accumulate(minutes)],
        "what for": [plan.purposes[test] for test in tests],
    }
    return pd.DataFrame(columns)


def _distinct(values: Array) -> str:
    """Format the distinct numbers of an array in order, separated by spaces."""
    return " ".join(dict.fromkeys(number(value, 4) for value in values.tolist()))
