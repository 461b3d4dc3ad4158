"""What `import bushfit` offers in a notebook or a script: each function does what the command of its name does.

Numbers are in SI: Hz, m, rad, N/m, and shares such as 0.01. See python.md.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.campaign import load_campaign as load_campaign
from bushfit.campaign.schema import Loss, PredictSettings, SimulateSettings
from bushfit.diagnosis.record import Settings
from bushfit.effects.contract import Array
from bushfit.errors import BushfitError, did_you_mean
from bushfit.fitting.data import Data
from bushfit.jobs import Outcome
from bushfit.jobs.compare import MOST, Compare, Compared
from bushfit.jobs.diagnose import Diagnose, Diagnosed, Ran, Run
from bushfit.jobs.fits import Fit, FitDynamic, FitStatic, Fitted
from bushfit.jobs.predict import Predict, Predicted
from bushfit.model.file import load_result
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.report.contents import Formats
from bushfit.report.folder import write_files

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


#: Frequencies or amplitudes.
Numbers = Sequence[float] | Array
#: The command that writes what such an outcome holds; of a fit, by its document.
_COMMANDS = {
    "static": "fit-static",
    "dynamic": "fit-dynamic",
    "model": "fit",
    Diagnosed: "diagnose",
    Ran: "run",
    Predicted: "predict",
    Compared: "compare",
}


def load_model(path: str | Path) -> Result:
    """The model in a model.json, with its uncertainty.

    Raises:
        ModelError: no such file, or no model.
    """
    return load_result(Path(path))


def fit(
    campaign: Campaign,
    *,
    directions: Sequence[str] = (),
    effects: Sequence[str] = (),
    profile: bool = False,
    loss: Loss | None = None,
) -> Fitted:
    """All five parameters from the loops and sweeps of a campaign together: the fit to use.

    Args:
        directions: whose tests to fit, or specimens by name; axial, and all specimens, unless given.
        effects: added to the paper's three, such as "inertia".
        profile: whether to add 95 % intervals by profile likelihood, which takes some seconds.
        loss: "soft_l1" to let points far off pull less, and outliers not at all; that of the campaign unless given.

    Raises:
        BushfitError: tests or settings that cannot support it.
    """
    if loss:
        campaign = replace(campaign, fit=replace(campaign.fit, loss=loss))
    return Fit(tuple(directions), tuple(effects), profile).run(Data.of(campaign))


def fit_static(campaign: Campaign, *, dynamic: Result | Outcome | None = None) -> Fitted:
    """mu, sigma_fmax and eps_half from the loops, with m and alpha held at a result where one is given."""
    return FitStatic(_result(dynamic) if dynamic else None).run(Data.of(campaign))


def fit_dynamic(campaign: Campaign, *, static: Result | Outcome | None = None) -> Fitted:
    """m and alpha from the sweep of smallest amplitude, the rest held at a result, or at a fit of the loops."""
    return FitDynamic(_result(static) if static else None).run(Data.of(campaign))


def diagnose(
    campaign: Campaign,
    *,
    model: Result | Outcome | None = None,
    adopt: Sequence[str] = (),
    without: Sequence[str] = (),
    max_effects: int = 3,
    tolerance: float = 0.01,
) -> Diagnosed:
    """Where model and tests disagree, what is missing, and the model with it.

    Args:
        model: whose effects to start from; the paper's three unless given.
        adopt: effects to add by hand, whatever the evidence.
        without: effects not to consider.
        max_effects: effects added in turn at the most.
        tolerance: gaps below this share of |K| do not count.

    Raises:
        BushfitError: tests or settings that cannot support it.
    """
    start = _result(model) if model else None
    settings = Settings(max_effects, tolerance, tuple(adopt), tuple(without), start.unresolved if start else ())
    return Diagnose(settings, start.model if start else None).run(Data.of(campaign))


def run(campaign: Campaign) -> Ran:
    """The whole chain: the fits, what is missing, and the prediction."""
    return Run().run(Data.of(campaign))


def predict(
    model: Result | Outcome,
    campaign: Campaign | None = None,
    *,
    directions: Sequence[str] | None = None,
    frequencies: Numbers | None = None,
    amplitudes: Numbers | None = None,
    torsion_amplitudes: Numbers | None = None,
    strain_amplitudes: Numbers | None = None,
    temperature: float | None = None,
) -> Predicted:
    """Stiffness and loss factor over a grid, with 95 % bands.

    Args:
        model: a result, or what a fit or a diagnosis found.
        campaign: whose sweeps to lay beside; its grid holds where none is given.
        directions: or specimens by name; axial and radial, and all specimens, unless given.
        frequencies: [Hz].
        amplitudes, torsion_amplitudes, strain_amplitudes: zero-to-peak, of displacements [m], of rotations [rad], and
            of a specimen's strain.
        temperature: [K], where the model has an effect of it.

    Raises:
        ModelError: a place, frequency or amplitude that the model cannot have.
    """
    asked = _asked(directions, frequencies, amplitudes, torsion_amplitudes, strain_amplitudes)
    return Predict(asked, temperature=temperature).run(_result(model), campaign)


def compare(
    reference: Result | Outcome | Campaign,
    *others: Result | Outcome | Campaign,
    families: Sequence[str] | None = None,
    directions: Sequence[str] | None = None,
    frequencies: Numbers | None = None,
    amplitudes: Numbers | None = None,
    torsion_amplitudes: Numbers | None = None,
    strain_amplitudes: Numbers | None = None,
) -> Compared:
    """Results beside the first: what differs, by how much, and whether by more than chance; or model families.

    Args:
        reference, others: results, what fits or diagnoses found, or campaigns, which are fitted as by `fit`.
        families: with one campaign alone, families to fit to it, such as "sliders" or "kraus+inertia"; () is all.
        directions: or specimens by name; where all were fitted unless given.
        frequencies, amplitudes, torsion_amplitudes, strain_amplitudes: as of `predict`; as far as all were measured
            unless given.

    Raises:
        BushfitError: too few results or too many, or places and points that one of them cannot be predicted at.
    """
    job = Compare(_asked(directions, frequencies, amplitudes, torsion_amplitudes, strain_amplitudes))
    if families is not None and isinstance(reference, Campaign) and not others:
        return job.run_families(reference, str(reference.path), families)
    if families is not None or not 1 <= len(others) < MOST:
        raise BushfitError(
            "this cannot be compared",
            found=f"{1 + len(others)} results{' and families' if families is not None else ''}",
            expected=f"2 to {MOST} results, or one campaign and families",
        )
    opened = [each if isinstance(each, Campaign) else _result(each) for each in (reference, *others)]
    sources = [str(each.path) if isinstance(each, Campaign) else each.name for each in opened]
    return job.run([job.entry(*pair) for pair in zip(opened, sources, strict=True)])


def simulate(
    source: Model | Result | Outcome | Campaign, folder: str | Path, *, force: bool = False, **settings: Any
) -> Campaign:
    """Put a model on the virtual rig, write the campaign of its simulated tests, and load it.

    Args:
        source: a model, which is tested as the paper's bushing was, or a campaign with a [simulate] table.
        folder: for campaign.toml, the test files, and the model behind them in truth.json.
        force: replaces files that stand there.
        settings: what the rig does otherwise, by the keys of [simulate]: noise = 0.005, repeats = 3, seed = 1.

    Raises:
        BushfitError: no model, or files that stand there.
    """
    from bushfit.campaign.campaign import model_of
    from bushfit.simulation.files import to_files
    from bushfit.simulation.measured import simulate as measured

    if isinstance(source, Campaign):
        truth, plan = model_of(source), source.simulate or SimulateSettings()
    else:
        truth, plan = source if isinstance(source, Model) else _result(source).model, SimulateSettings()
    write_files(Path(folder), to_files(measured(truth, replace(plan, **settings))), force=force, by="simulate")
    return load_campaign(Path(folder) / "campaign.toml")


def table(outcome: Outcome | Compared, name: str) -> pd.DataFrame:
    """A table of what was found, by the name of its file: "axial" of a prediction, "sweeps" of a fit."""
    return _made(outcome.contents.tables, name, "table")


def picture(outcome: Outcome | Compared, name: str) -> Figure:
    """A picture of what was found, by the name of its file, as a figure of matplotlib."""
    return _made(outcome.contents.pictures, name, "picture")


def parameters(model: Result | Outcome) -> pd.DataFrame:
    """The parameters in SI: value, standard error, ends of the 95 % interval, unit, and whether each was fitted."""
    from bushfit.report.spreadsheets import parameters_table

    ends = {"95 %, low": "low", "95 %, high": "high"}
    table = parameters_table(_result(model)).set_index("parameter").rename_axis(None).rename(columns=ends)
    table["fitted"] = table["fitted"] == "yes"
    columns = ["value", "std error", "low", "high"]
    return table[[*columns, "unit", "fitted"]].astype(dict.fromkeys(columns, float))


def save(
    outcome: Outcome | Compared, folder: str | Path, *, tables: bool = True, pictures: bool = True, force: bool = False
) -> Path:
    """Write what was found into a folder, all of it or none, as the command would, and return the folder.

    Args:
        force: replaces results that stand there, and removes what the same command wrote before and does not now.

    Raises:
        OutputError: the folder cannot be written, or results stand there.
    """
    by = _COMMANDS[outcome.stem if isinstance(outcome, Fitted) else type(outcome)]
    write_files(Path(folder), Formats(tables, pictures).files(outcome.contents), force=force, by=by)
    return Path(folder)


def _asked(directions: Sequence[str] | None, *axes: Numbers | None) -> PredictSettings:
    """Places, then frequencies and amplitudes of displacements, rotations and strains, as they are asked for."""
    frequencies, amplitudes, rotations, strains = (
        None if axis is None else tuple(float(value) for value in axis) for axis in axes
    )
    return PredictSettings(
        frequencies, amplitudes, rotations, None if directions is None else tuple(directions), strains
    )


def _result(model: Result | Outcome) -> Result:
    return model if isinstance(model, Result) else model.result


def _made(known: Mapping[str, Callable[[], Any]], name: str, what: str) -> Any:
    """A table or a picture, made now."""
    if name not in known:
        expected = "one of " + ", ".join(known) if known else f"an outcome with a {what}"
        raise BushfitError(f"there is no such {what}", found=name, expected=expected, hint=did_you_mean(name, known))
    return known[name]()
