"""simulate: tests of a model on the virtual rig, written as a campaign of raw test files."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import Any

from bushfit.campaign.campaign import Campaign, load_campaign, model_of
from bushfit.campaign.simulated import SimulateSettings
from bushfit.commands.loading import HasResult, as_result
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.model.file import to_document
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.reading.tablefile import Form
from bushfit.report.results import ResultFile, write_results
from bushfit.simulation.files import to_files
from bushfit.simulation.measured import simulate as simulate_tests


def simulate_campaign(
    truth: Model, settings: SimulateSettings, effects: Collection[str], form: Form = "csv"
) -> tuple[Result, dict[str, Any], list[ResultFile]]:
    """Simulate the tests of a campaign.

    Args:
        truth: the true model; a smooth correction in it is left out, because it has no law in time.
        settings: tests, noise and errors of the rig.
        effects: effects that a fit of the tests has.
        form: format of the tables.

    Returns:
        The model that was simulated; content of `simulate --json`; and campaign file, tables and truth.json.
    """
    simulated = simulate_tests(truth.without(UNNAMED), settings)
    contents = to_files(simulated, form, effects)
    document = {"truth": to_document(simulated.result), "files": sorted(contents)}
    return simulated.result, document, [ResultFile(name, "raw", content) for name, content in contents.items()]


def simulated_tests(
    source: Model | Result | HasResult | Campaign,
) -> tuple[Model, SimulateSettings, Collection[str]]:
    """Model to simulate, its tests (default: those of the 2007 paper), and names of the effects to add in a fit."""
    if isinstance(source, Campaign):
        return model_of(source), source.simulate or SimulateSettings(), source.fit.effects
    model = source if isinstance(source, Model) else as_result(source).model
    return model, SimulateSettings(), model.effects


def simulate(
    source: Model | Result | HasResult | Campaign, folder: str | Path, *, force: bool = False, **settings: Any
) -> Campaign:
    """Simulate the tests of a model on the virtual rig, write them as a campaign, and load the campaign.

    Args:
        source: model, result or output with a result, with tests as in the paper unless stated in the settings; or a
            campaign with a [simulate] table.
        folder: folder for campaign.toml, the test files, and the true model in truth.json.
        force: True to replace files of an earlier simulation.
        settings: further keys of [simulate], such as noise = 0.005, repeats = 3 or seed = 1.

    Returns:
        The simulated campaign, loaded from the folder.

    Raises:
        BushfitError: the source has no model, or files would be replaced.
    """
    truth, tests, effects = simulated_tests(source)
    _, _, files = simulate_campaign(truth, replace(tests, **settings), effects)
    inputs = [source.path] if isinstance(source, Campaign) else []
    write_results(Path(folder), files, overwrite=force, inputs=inputs)
    return load_campaign(Path(folder) / "campaign.toml")
