"""Campaigns off the virtual rig: the rig runs once a model, the noise is drawn once a seed."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.simulated import SimulateSettings
from bushfit.model.model import Model
from bushfit.simulation.exact import ExactTests, simulate_exact
from bushfit.simulation.measured import measure

#: The noise of data/cmp_15961: 0.5 % a sweep point, 0.3 % of a loop's force, three repeats.
PAPER_NOISE = SimulateSettings(repeats=3, noise=5e-3, force_noise=3e-3, displacement_noise=2e-4)
#: The same rig with a gain error of 0.4 % and a phase error of 0.2 deg in each block.
SHARED_NOISE = replace(PAPER_NOISE, gain_error=4e-3, phase_error=3.5e-3)


@pytest.fixture(scope="session")
def rig(paper_model) -> Callable[..., Campaign]:
    """rig(seed, model, settings=, shared=, ...): the paper's tests of a model, by default with the noise of
    data/cmp_15961, or what else is set of a simulation."""
    cleaned: dict[tuple[object, ...], ExactTests] = {}

    def campaign(
        seed: int = 0,
        model: Model = paper_model,
        *,
        settings: SimulateSettings = PAPER_NOISE,
        shared: bool = False,
        **changes: Any,
    ) -> Campaign:
        noise = replace(SHARED_NOISE if shared else settings, **changes)
        key = (model.bushing, model.effects, tuple(model.values.items()), noise.loops, noise.sweeps)
        if key not in cleaned:
            cleaned[key] = simulate_exact(model, noise)
        return measure(cleaned[key], replace(noise, seed=seed)).campaign()

    return campaign
