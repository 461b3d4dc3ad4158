"""`bushfit run`: the whole chain."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from bushfit.cli.common import (
    Options,
    campaign_argument,
    enforce_nrmse,
    loss_option,
    max_nrmse_option,
    new_table,
    open_campaign,
    report,
    shared_options,
    tell_fit,
    warn,
)
from bushfit.units import alike, for_people

if TYPE_CHECKING:
    from bushfit.fitting.data import Data
    from bushfit.fitting.procedures import TwoStep
    from bushfit.model.result import Result


@click.command("run")
@campaign_argument
@loss_option
@max_nrmse_option
@shared_options
def command(campaign: Path, loss: str | None, max_nrmse: float | None, options: Options) -> None:
    """Fit CAMPAIGN in every way, ask what the model lacks, and predict from the result.

    fit-static and fit-dynamic are repeated in turn until they agree (the paper's procedure), with the table of each
    pass; then all parameters are fitted together, and both results stand side by side; then diagnose, on all tests;
    then predict. Steps whose tests are missing are passed over, and said.

    Writes static.json, dynamic.json, model.json (with what diagnose added; then joint.json is the plain fit),
    diagnosis.json, candidates.csv, and as CSV and PNG: loops, sweeps, gap, axial and radial.
    """
    from bushfit.cli.diagnose import tell_diagnosis
    from bushfit.cli.predict import tell_predictions
    from bushfit.fitting.data import Data
    from bushfit.jobs.diagnose import Diagnose
    from bushfit.jobs.fits import Fit, FitStatic, tests_of
    from bushfit.jobs.predict import Predict
    from bushfit.report.artifacts import artifact_names, diagnosis_files, fit_files
    from bushfit.report.folder import to_json

    loaded = open_campaign(campaign, loss)
    folder = options.folder(loaded.slug)
    names = [*Diagnose().names(loaded, options.formats), *Predict().names(loaded, options.formats)]
    options.require_free(folder, [*names, *artifact_names(tests_of(loaded), options.formats)])
    data = Data.of(loaded)
    results: dict[str, Result] = {}
    if loaded.loops:
        static = FitStatic().run(data)
        results["static"] = static.result
        tell_fit(options, loaded.name, static)
    two_step = _two_step(options, data)
    if two_step:
        results["dynamic"] = two_step.result
        _tell_passes(options, two_step)
        report(options, f"{loaded.name}: static and dynamic fit in turn", two_step.result)
    joint = Fit().run(data)
    tell_fit(options, loaded.name, joint)
    if two_step:
        _tell_cost(options, two_step.result, joint.result)
    diagnosed = Diagnose().run(data)
    tell_diagnosis(options, loaded.name, diagnosed)
    added = diagnosed.diagnosis.after is not diagnosed.diagnosis.before
    results |= {"joint": joint.result, "model": diagnosed.result} if added else {"model": joint.result}
    final = results["model"]
    predicted = Predict().run(final, loaded)
    tell_predictions(options, predicted)
    marked = data.without(final.outliers)
    documents = {**{name: result.to_document() for name, result in results.items()}, "diagnosis": diagnosed.document}
    files = {
        **{f"{name}.json": to_json(document) for name, document in documents.items()},
        **fit_files("loops", final.model, marked.loops, options.formats),
        **fit_files("sweeps", final.model, marked.sweeps, options.formats),
        **diagnosis_files(diagnosed.diagnosis, loaded.name, options.formats),
        **predicted.files(options.formats),
    }
    options.write(folder, files)
    found = ", ".join(effect.name for effect in diagnosed.diagnosis.effects)
    which = f"with {found}; joint.json is without" if added else "the joint fit"
    options.console.print(f"the model to use: {folder / 'model.json'}, {which}", markup=False)
    options.tell(documents)
    enforce_nrmse(final, max_nrmse)


def _two_step(options: Options, data: Data) -> TwoStep | None:
    """The paper's procedure, or a word on why it is passed over."""
    from bushfit.errors import FitError
    from bushfit.fitting.procedures import fit_two_step

    if not (data.loops and data.sweeps):
        missing = "sweeps" if data.loops else "loops"
        options.console.print(f"no {missing}: the two-step procedure is passed over", markup=False)
        return None
    try:
        return fit_two_step(data)
    except FitError as error:
        warn(options, [f"the two-step procedure is passed over: {error.problem}"])
        return None


def _tell_passes(options: Options, two_step: TwoStep) -> None:
    parameters, last = two_step.result.model.parameters, two_step.passes[-1]
    units = {name: for_people(parameters[name].unit, 1.0, value) for name, value in last.items()}
    headers = (f"{name} [{unit}]" for name, (unit, _) in units.items())
    table = new_table("static and dynamic fit in turn, pass by pass", "pass", *headers)
    # from the last pass, whose decimals the others have
    columns = [alike([p[name] * factor for p in two_step.passes[::-1]], 5, 2) for name, (_, factor) in units.items()]
    for count, row in enumerate(list(zip(*columns, strict=True))[::-1], start=1):
        table.add_row(str(count), *row)
    options.console.print(table)


def _tell_cost(options: Options, two_step: Result, joint: Result) -> None:
    """What the two-step procedure costs: its values and errors beside those of the joint fit."""
    columns = ("two-step", "std error", "joint", "std error", "unit", "difference", "error ratio")
    table = new_table("what the two-step procedure costs", "parameter", *columns)
    for name in joint.fitted:
        if name not in two_step.model.values:
            continue
        one, other = two_step.model.values[name], joint.model.values[name]
        errors = two_step.covariance.stderr(name), joint.covariance.stderr(name)
        ratio = f"{errors[0] / errors[1]:.1f}" if errors[0] and errors[1] else ""
        unit, factor = for_people(joint.model.parameters[name].unit, 1.0, other)
        shown = ["" if error is None else alike([error * factor], 2)[0] for error in errors]
        second, first = alike([other * factor, one * factor], 4, least=2)
        table.add_row(name, first, shown[0], second, shown[1], unit, f"{100 * (one / other - 1):+.1f} %", ratio)
    options.console.print(table)
