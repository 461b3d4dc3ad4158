"""The paper's procedure where its way leads along the bounds of a parameter."""

from __future__ import annotations

import pytest

from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.effects import BASE
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_two_step
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.simulation.measured import simulate


@pytest.mark.parametrize(
    ("seed", "m", "alpha", "sigma_fmax", "eps_half", "noise"),
    [
        (14, 1.2e5, 0.16, 3.6e4, 0.062, 0.0092),
        (31, 1.8e5, 0.055, 3.2e4, 0.016, 0.01),
        (69, 2.8e4, 0.22, 6.3e4, 0.04, 0.0052),
        (35, 7.0e3, 0.20, 8.0e4, 0.083, 0.0014),
    ],
)
def test_a_value_extrapolated_beyond_its_bounds_is_moved_back(
    bushing: Bushing, seed: int, m: float, alpha: float, sigma_fmax: float, eps_half: float, noise: float
) -> None:
    """A springpot that a noisy sweep of one level hardly shows: the passes extrapolate to an alpha below the least."""
    values = {"mu": 1.09e6, "m": m, "alpha": alpha, "sigma_fmax": sigma_fmax, "eps_half": eps_half}
    truth = Model(bushing, BASE, values)
    plan = SimulateSettings(
        seed=seed,
        repeats=2,
        noise=noise,
        force_noise=0.003,
        loops=(SimulatedLoop(Direction.AXIAL, 1e-3, 0.1),),
        sweeps=(SimulatedSweep(Direction.AXIAL, (1e-4,), (5.0, 25.0, 75.0, 155.0)),),
    )
    found = fit_two_step(Data.of(simulate(truth, plan).campaign()))
    low, high = truth.parameters["alpha"].bounds
    assert all(low <= values["alpha"] <= high for values in found.passes)
