"""Coupons and mounts beside the bushing, or alone: which tests are fitted, from where, and with which effects.

And that a sweep which does not follow the law of temperature is told apart; tests/cli/test_laboratory.py has shift
factors and predictions where it does, tests/effects/test_limits.py the constants of Williams, Landel and Ferry.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import FitSettings
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.commands.fit import fit
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import BASE
from bushfit.fitting.master_curve import master_curve
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Direction, Place, Specimen
from bushfit.model.model import Model
from bushfit.reading.measurement import Stepped, Sweep
from bushfit.simulation.measured import simulate
from bushfit.units import CELSIUS

DMA = Specimen("DMA", "modulus")
MOUNT = Specimen("mount", "shear", area=772e-6, thickness=6e-3, elements=2)
FREQUENCIES = np.geomspace(1.0, 200.0, 15)
STRAINS = np.geomspace(1e-4, 0.1, 15)
VALUES = {"temperature.softening": 4e-3, "temperature.shift": 0.12}
DEGREES = (-10.0, 8.0, 23.0, 38.0, 53.0)
BAND = tuple(np.geomspace(1.0, 100.0, 7).tolist())
SWEEPS = tuple(
    SimulatedSweep(Direction.AXIAL, (1e-4, 5e-4), BAND, temperature=CELSIUS + degrees) for degrees in DEGREES
)


def sweep(
    model: Model,
    place: Place,
    frequencies: object,
    amplitudes: object,
    stepped: Stepped = "frequency",
    factor: float = 1.0,
) -> Sweep:
    """Simulated with 0.3 % noise, of a model's closed form."""
    random = np.random.default_rng(4)
    frequency, amplitude = (axis.ravel() for axis in np.meshgrid(frequencies, amplitudes))
    noise = 3e-3 * (random.standard_normal(frequency.size) + 1j * random.standard_normal(frequency.size))
    stiffness = factor * (1.0 + noise) * model.stiffness(place, frequency, amplitude)
    return Sweep(f"{place}_{stepped}", place, frequency, amplitude, stiffness, stepped=stepped)


@pytest.fixture
def coupons(paper_model) -> Campaign:
    """A coupon alone: the strain stepped at two frequencies, the frequency at two strains."""
    by_strain = sweep(paper_model, DMA, [10.0, 100.0], STRAINS, "amplitude")
    by_frequency = sweep(paper_model, DMA, FREQUENCIES, [1e-3, 1e-2])
    return Campaign("EPDM", Path("epdm.toml"), None, (), (by_strain, by_frequency), specimens=(DMA,))


@pytest.fixture
def both(rig, coupons) -> Campaign:
    """The paper's tests, and those of the coupon."""
    bushing = rig(2)
    return replace(bushing, sweeps=(*bushing.sweeps, *coupons.sweeps), specimens=(DMA,))


def test_effects_of_the_campaign_are_in_every_fit(coupons, paper_model):
    mount = sweep(paper_model, MOUNT, FREQUENCIES, [1e-4, 5e-4], factor=1.1)
    effects = FitSettings(effects=("stiffness_factor.mount",))
    data = PreparedCampaign.from_campaign(
        replace(coupons, sweeps=(*coupons.sweeps, mount), specimens=(DMA, MOUNT), fit=effects)
    )
    fits = [fit_joint(data), fit(data, effects=("stiffness_factor.mount",)).result, diagnose(data).result]
    for result in fits:
        assert result.model.effects[3:] == ("stiffness_factor.mount",)
        assert result.model.values["stiffness_factor.mount"] == pytest.approx(1.1, rel=0.01)
        assert result.specimens == (DMA, MOUNT)


PLAN = SimulateSettings(
    loops=(SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=2, temperature=CELSIUS + 23.0),),
    sweeps=SWEEPS,
    noise=3e-3,
    force_noise=2e-3,
    displacement_noise=1e-3,
)


@pytest.fixture(scope="module")
def truth(paper_model) -> Model:
    return paper_model.with_effect("temperature", VALUES)


def test_a_sweep_off_the_law_says_so(truth):
    """That at 8 degC as if its chamber had been 8 K warmer than it says."""
    tested = [replace(sweep, temperature=CELSIUS + 16.0) if sweep is SWEEPS[1] else sweep for sweep in SWEEPS]
    simulated = simulate(truth, replace(PLAN, sweeps=tuple(tested))).campaign()
    pairs = zip(simulated.sweeps, DEGREES, strict=True)
    stated = tuple(replace(sweep, temperature=CELSIUS + at) for sweep, at in pairs)
    data = PreparedCampaign.from_campaign(replace(simulated, sweeps=stated))
    found = master_curve(fit_joint(data, effects=(*BASE, "temperature")), data.sweeps)
    off = np.array([(each.best_shift[0] - each.shift[0]) / each.best_shift[1] for each in found])
    assert abs(off[1]) > 4.0 * max(abs(off[0]), abs(off[-1]))
    assert off[1] < -4.0
