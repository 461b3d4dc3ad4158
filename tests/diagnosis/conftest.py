"""Campaigns off the virtual rig with two loops and two sweeps, their fits and their diagnoses, each made once."""

from dataclasses import replace

import numpy as np
import pytest
from rigged import PLAN, SHARED, Diagnosed, Effects, Fitted, Measured

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.simulated import SimulateSettings
from bushfit.diagnosis.fits import fit_model
from bushfit.diagnosis.record import Diagnosis, DiagnosisSettings
from bushfit.diagnosis.rig_errors import in_scatter_units
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import BASE, get_effect
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult
from bushfit.fitting.starts import start_values
from bushfit.model.model import Model
from bushfit.simulation.exact import ExactTests, simulate_exact
from bushfit.simulation.measured import measure


@pytest.fixture(scope="session")
def reference_shapes(root) -> dict[tuple[float, ...], float]:
    """Radial stiffness over modulus [m] from finite elements, by inner radius, outer radius and length [mm]."""
    table = np.loadtxt(root / "data/reference/radial_fe.csv", delimiter=",", skiprows=1)
    return {tuple(row[:3]): float(row[3]) for row in table}


@pytest.fixture(scope="session")
def measured(paper_model) -> Measured:
    """measured({"inertia": {"mass": 0.1}}, plan, seed): the paper's bushing with effects, on the rig."""
    cleaned: dict[tuple[object, ...], ExactTests] = {}

    def campaign(effects: Effects | None = None, plan: SimulateSettings = PLAN, seed: int = 0) -> Campaign:
        model = paper_model
        for name, values in (effects or {}).items():
            model = model.with_effect(name, {f"{name}.{key}": value for key, value in values.items()})
        key = (tuple(model.values.items()), plan.loops, plan.sweeps)
        if key not in cleaned:
            cleaned[key] = simulate_exact(model, plan)
        return measure(cleaned[key], replace(plan, seed=seed)).campaign()

    return campaign


@pytest.fixture(scope="session")
def diagnosed(measured) -> Diagnosed:
    """diagnosed(effects, plan, seed, **settings): the same campaign, diagnosed once."""
    known: dict[str, Diagnosis] = {}

    def finding(
        effects: Effects | None = None, plan: SimulateSettings = PLAN, seed: int = 0, **settings: object
    ) -> Diagnosis:
        key = repr((effects, plan, seed, settings))
        if key not in known:
            data = PreparedCampaign.from_campaign(measured(effects, plan, seed))
            known[key] = diagnose(data, None, DiagnosisSettings(**settings))  # type: ignore[arg-type]
        return known[key]

    return finding


@pytest.fixture(scope="session")
def fitted() -> Fitted:
    """fitted(campaign, *effects): the paper's model and more, fitted to all tests of a campaign."""

    def evidence(campaign: Campaign, *effects: str) -> FitResult:
        data = PreparedCampaign.from_campaign(campaign)
        data_sets = [*data.loops, *data.sweeps]
        start = start_values(campaign.bushing, data_sets, {})
        gone = {get_effect(name).replaces for name in effects}
        kept = [name for name in BASE if name not in gone]
        return fit_model(Model.with_defaults(campaign.bushing, (*kept, *effects), start), data_sets, (), {})

    return evidence


@pytest.fixture(scope="session")
def bare(measured, fitted) -> FitResult:
    """The paper's model fitted to a clean campaign, its residuals in units of what scatters from point to point."""
    return in_scatter_units(fitted(measured(plan=SHARED)))
