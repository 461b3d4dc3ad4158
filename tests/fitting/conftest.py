"""Campaigns off the virtual rig: the rig runs once a model, the noise is drawn once a seed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import SimulateSettings
from bushfit.model.model import Model
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import Undisturbed, undisturbed

#: The noise of data/cmp_15961: 0.5 % a sweep point, 0.3 % of a loop's force, three repeats.
PAPER_NOISE = SimulateSettings(repeats=3, noise=5e-3, force_noise=3e-3, displacement_noise=2e-4)
#: The same rig with a gain error of 0.4 % and a phase error of 0.2 deg in each block.
SHARED_NOISE = replace(PAPER_NOISE, gain_error=4e-3, phase_error=3.5e-3)

Rig = Callable[..., Campaign]


@pytest.fixture
def paper_noise() -> SimulateSettings:
    return PAPER_NOISE


@pytest.fixture
def shared_noise() -> SimulateSettings:
    return SHARED_NOISE


@pytest.fixture(scope="session")
def rig() -> Rig:
    """rig(model, noise, seed): the paper's tests of a model; without noise what an ideal rig writes."""
    cleaned: dict[tuple[object, ...], Undisturbed] = {}

    def campaign(model: Model, noise: SimulateSettings | None = None, seed: int = 0) -> Campaign:
        noise = noise or SimulateSettings()
        key = (model.bushing, model.effects, tuple(model.values.items()), noise.loops, noise.sweeps)
        if key not in cleaned:
            cleaned[key] = undisturbed(model, noise)
        return measure(cleaned[key], replace(noise, seed=seed)).campaign()

    return campaign
