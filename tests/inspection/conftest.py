"""A loop and a sweep of the paper's bushing without noise, and measured by a good rig."""

from __future__ import annotations

import pytest
from looking import plan

from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import Undisturbed, undisturbed


@pytest.fixture(scope="module")
def clean(paper_model: Model) -> Undisturbed:
    return undisturbed(paper_model, plan(), steps_per_cycle=256)


@pytest.fixture
def loop(clean: Undisturbed) -> Loop:
    return measure(clean, plan(seed=1, force_noise=3e-3, displacement_noise=2e-4)).loops[0]


@pytest.fixture
def sweep(clean: Undisturbed) -> Sweep:
    return measure(clean, plan(seed=1, noise=5e-3, gain_error=2e-3, phase_error=2e-3)).sweeps[0]
