"""Campaigns off the virtual rig with two loops and two sweeps, whole or cut down, and their diagnoses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign import Campaign
from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import BASE
from bushfit.effects.contract import Array
from bushfit.fitting.data import Data
from bushfit.fitting.starts import start_values
from bushfit.geometry import Direction
from bushfit.measurement import Sweep
from bushfit.model import Model
from bushfit.schema import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.simulation import Undisturbed, measure, undisturbed

FREQUENCIES = tuple(float(f) for f in range(5, 156, 10))
PLAN = SimulateSettings(
    repeats=3,
    noise=5e-3,
    force_noise=3e-3,
    displacement_noise=2e-4,
    loops=tuple(SimulatedLoop(Direction.AXIAL, amplitude, 0.1, cycles=3) for amplitude in (5e-4, 1e-3)),
    sweeps=tuple(
        SimulatedSweep(direction, (1e-4, 2e-4, 5e-4), FREQUENCIES) for direction in (Direction.AXIAL, Direction.RADIAL)
    ),
)
SHARED = replace(PLAN, gain_error=4e-3, phase_error=3.5e-3)

Values = Mapping[str, Mapping[str, float]]
Measured = Callable[..., Campaign]
Diagnosed = Callable[..., Diagnosis]
Fitted = Callable[..., Evidence]


@pytest.fixture(scope="session")
def measured(paper_model: Model) -> Measured:
    """measured({"inertia": {"mass": 0.1}}, plan, seed): the paper's bushing with effects, on the rig."""
    cleaned: dict[tuple[object, ...], Undisturbed] = {}

    def campaign(effects: Values | None = None, plan: SimulateSettings = PLAN, seed: int = 0) -> Campaign:
        model = paper_model
        for name, values in (effects or {}).items():
            model = model.with_effect(name, {f"{name}.{key}": value for key, value in values.items()})
        key = (tuple(model.values.items()), plan.loops, plan.sweeps)
        if key not in cleaned:
            cleaned[key] = undisturbed(model, plan)
        return measure(cleaned[key], replace(plan, seed=seed)).campaign()

    return campaign


@pytest.fixture(scope="session")
def diagnosed(measured: Measured) -> Diagnosed:
    """diagnosed(effects, plan, seed, **settings): the same campaign, diagnosed once."""
    known: dict[str, Diagnosis] = {}

    def finding(
        effects: Values | None = None, plan: SimulateSettings = PLAN, seed: int = 0, **settings: object
    ) -> Diagnosis:
        key = repr((effects, plan, seed, settings))
        if key not in known:
            data = Data.of(measured(effects, plan, seed))
            known[key] = diagnose(data, None, Settings(**settings))  # type: ignore[arg-type]
        return known[key]

    return finding


@pytest.fixture(scope="session")
def fitted() -> Fitted:
    """fitted(campaign, *effects): the paper's model and more, fitted to all tests of a campaign."""

    def evidence(campaign: Campaign, *effects: str) -> Evidence:
        data = Data.of(campaign)
        terms = [*data.loops, *data.sweeps]
        start = start_values(campaign.bushing, terms, {})
        return fit(Model.started(campaign.bushing, (*BASE, *effects), start), terms, (), {})

    return evidence


def cut(sweep: Sweep, kept: Array) -> Sweep:
    """The chosen points of a sweep."""
    columns = ("frequency", "amplitude", "stiffness", "repeat")
    return replace(sweep, **{name: getattr(sweep, name)[kept] for name in columns})


def changed(campaign: Campaign, sweep: int, factor: Array | complex) -> Campaign:
    """One sweep of a campaign with its stiffness multiplied."""
    sweeps = list(campaign.sweeps)
    sweeps[sweep] = replace(sweeps[sweep], stiffness=sweeps[sweep].stiffness * np.asarray(factor))
    return replace(campaign, sweeps=tuple(sweeps))
