"""Coupons and mounts beside the bushing, or alone: which tests are fitted, from where, and with which effects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import FitSettings
from bushfit.diagnosis.workflow import diagnose
from bushfit.errors import FitError, ModelError
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import fit_dynamic, fit_joint, fit_static
from bushfit.geometry import Direction, Place, Specimen
from bushfit.jobs.fits import Fit
from bushfit.model.model import Model
from bushfit.reading.measurement import Stepped, Sweep

DMA = Specimen("DMA", "modulus")
MOUNT = Specimen("mount", "shear", area=772e-6, thickness=6e-3, elements=2)
FREQUENCIES = np.geomspace(1.0, 200.0, 15)
STRAINS = np.geomspace(1e-4, 0.1, 15)


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
def coupons(paper_model: Model) -> Campaign:
    """A coupon alone: the strain stepped at two frequencies, the frequency at two strains."""
    tests = (
        sweep(paper_model, DMA, [10.0, 100.0], STRAINS, "amplitude"),
        sweep(paper_model, DMA, FREQUENCIES, [1e-3, 1e-2]),
    )
    return Campaign("EPDM", Path("epdm.toml"), None, (), tests, specimens=(DMA,))


@pytest.fixture
def both(rig: Callable[..., Campaign], coupons: Campaign) -> Campaign:
    """The paper's tests, and those of the coupon."""
    bushing = rig(2)
    return replace(bushing, sweeps=(*bushing.sweeps, *coupons.sweeps), specimens=(DMA,))


def test_coupons_are_fitted_beside_the_axial_tests(both: Campaign) -> None:
    data = Data.of(both)
    assert {str(data_set.direction) for data_set in data.chosen(None)} == {"axial", "DMA"}
    assert {str(data_set.direction) for data_set in data.chosen(["DMA", "radial"])} == {"DMA", "radial"}
    assert {data_set.direction for data_set in data.static_loops()} == {Direction.AXIAL}
    assert data.smallest_sweep.direction is Direction.AXIAL
    with pytest.raises(ModelError, match=r"no such direction or specimen[\s\S]*dma[\s\S]*torsion, DMA"):
        data.chosen(["dma"])
    result = fit_joint(data)
    assert result.measured is not None
    assert result.measured.directions == ("axial", "DMA")
    assert {test.place for test in result.tests if not test.fitted} == {"radial"}


def test_two_steps_with_a_coupon(coupons: Campaign) -> None:
    """fit-dynamic takes the sweep of the frequency; of one of the amplitude the smallest at each frequency."""
    frequency = Data.of(coupons).smallest_sweep
    assert set(frequency.amplitude) == {1e-3}
    amplitude = Data.of(replace(coupons, sweeps=coupons.sweeps[:1])).smallest_sweep
    assert amplitude.frequency.tolist() == [10.0, 100.0]
    static = fit_joint(Data.of(coupons))
    assert fit_dynamic(Data.of(coupons), static).model.values["alpha"] == pytest.approx(0.24, rel=0.1)
    with pytest.raises(FitError, match="fit-static needs a loop"):
        fit_static(Data.of(coupons))


def test_effects_of_the_campaign_are_in_every_fit(coupons: Campaign, paper_model: Model) -> None:
    mount = sweep(paper_model, MOUNT, FREQUENCIES, [1e-4, 5e-4], factor=1.1)
    effects = FitSettings(effects=("stiffness_factor.mount",))
    data = Data.of(replace(coupons, sweeps=(*coupons.sweeps, mount), specimens=(DMA, MOUNT), fit=effects))
    fits = [fit_joint(data), Fit(effects=("stiffness_factor.mount",)).run(data).result, diagnose(data).result]
    for result in fits:
        assert result.model.effects[3:] == ("stiffness_factor.mount",)
        assert result.model.values["stiffness_factor.mount"] == pytest.approx(1.1, rel=0.01)
        assert result.specimens == (DMA, MOUNT)
    unknown = replace(data.campaign, fit=FitSettings(effects=("inertai",)))
    with pytest.raises(ModelError, match=r"epdm.toml, \[fit\] effects: unknown effect[\s\S]*inertia\?"):
        fit_joint(Data.of(unknown))


@pytest.mark.parametrize("scale", [1e-4, 3.0])
def test_a_start_beyond_its_bounds_is_moved(coupons: Campaign, paper_model: Model, scale: float) -> None:
    """Strains from 1e-8, or up to 30 %: eps_half would start beyond its bounds, or far from where it is."""
    tests = tuple(replace(test, amplitude=scale * test.amplitude) for test in coupons.sweeps)
    clean = tuple(replace(t, stiffness=paper_model.stiffness(DMA, t.frequency, t.amplitude)) for t in tests)
    result = fit_joint(Data.of(replace(coupons, sweeps=clean)))
    assert result.quality is not None
    assert result.quality.nrmse < 1e-3
