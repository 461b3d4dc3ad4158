"""A parameter at rest on a bound counts as one that noise takes off it half of the times."""

from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.schema import RigSettings, SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.effects import BASE
from bushfit.fitting.data import Data
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.planning.contract import Knowledge, Points, Wanted
from bushfit.planning.criterion import View
from bushfit.planning.knowledge import noise_of, of_campaign, rig_of
from bushfit.planning.plan import plan
from bushfit.planning.sensitivity import Information, relative_slopes
from bushfit.simulation.measured import simulate

AXIAL = Direction.AXIAL
PAPER = Bushing("paper's", 0.010, 0.018, 0.034)
#: A compound whose stiffness follows a power of frequency and of nothing else: its spring is on the least it may be.
NO_SPRING = {"mu": 1e3, "m": 4e6, "alpha": 0.1, "sigma_fmax": 3e4, "eps_half": 0.016}
SWEEP = SimulatedSweep(AXIAL, (1e-4, 2e-4, 5e-4, 1e-3), (5.0, 20.0, 60.0, 150.0))
LOOP = SimulatedLoop(AXIAL, 1e-3, 0.1)


@pytest.fixture(scope="module")
def data() -> Data:
    settings = SimulateSettings(loops=(LOOP,), sweeps=(SWEEP,), repeats=2, noise=0.005, force_noise=0.005, seed=2)
    return Data.of(simulate(Model(PAPER, BASE, NO_SPRING), settings).campaign())


@pytest.fixture(scope="module")
def measured(data: Data) -> Knowledge:
    return of_campaign(data)


def test_what_a_fit_within_bounds_finds_scatters_as_counted() -> None:
    """Against 400,000 draws of a linear model: what noise takes beyond the bound ends on it, the others held to it."""
    rng = np.random.default_rng(4)
    root = rng.normal(size=(3, 9))
    none = Information(np.empty((0, 5, 5)), np.empty((0, 5, 0)), np.empty((0, 0)))
    view = View(none, np.eye(3), np.empty((0, 2)), bounded=1)
    covariance = np.linalg.inv(root @ root.T)
    free = rng.multivariate_normal(np.zeros(3), covariance, 400_000)
    held = free - np.outer(free[:, 2], covariance[:, 2] / covariance[2, 2])
    found = np.where(free[:, 2:] > 0.0, free, held)
    counted = view.off(Information((root @ root.T)[None], np.empty((1, 3, 0)), np.empty((1, 0))))[0]
    scale = np.sqrt(np.outer(np.diag(counted), np.diag(counted)))
    np.testing.assert_allclose(found.T @ found / len(found) / scale, counted / scale, atol=0.01)
    assert counted[0, 0] < 0.97 * covariance[0, 0]


def test_tests_tell_a_bounded_parameter_as_if_it_were_free(data: Data, measured: Knowledge) -> None:
    """The others go with it as they would to make up for it, and are known worse than where it is held."""
    k, covariance = len(measured.names), measured.covariance
    counted = Data.of(replace(data.campaign, rig=rig_of(data.campaign.rig, noise_of(data))))
    slopes = relative_slopes(measured, [*counted.loops, *counted.sweeps])
    made_up = -np.linalg.lstsq(slopes[:k].T, slopes[k])[0]
    assert measured.bounded == ("mu",)
    np.testing.assert_allclose(covariance[:k, k] / covariance[k, k], made_up, rtol=1e-3)
    place = measured.names.index("m")  # the springpot stands in for the spring
    assert measured.errors[place] > 2.0 * _held(measured).errors[place]


def test_a_plan_beside_a_bound_counts_it_and_says_so(measured: Knowledge) -> None:
    points = (Points(AXIAL, np.array([20.0, 100.0]), np.array([2e-4, 2e-4])),)
    wanted = Wanted("predictions", 2.0, RigSettings(), (AXIAL,), points, measured.names)
    counted, ignored = plan(measured, wanted), plan(_held(measured), wanted)
    place = measured.names.index("m")
    assert counted.planned.errors.shape == (len(measured.names),)
    assert counted.planned.errors[place] > 1.1 * ignored.planned.errors[place]
    assert any("mu came to rest on a bound" in note for note in counted.notes)
    assert not any("mu" in words for words in counted.purposes.values())


@pytest.mark.parametrize("effect", ["temperature", "force_saturation"])
def test_a_parameter_that_the_tests_do_not_see_stops_no_plan(data: Data, effect: str) -> None:
    """Tests at one temperature, and a force that saturates nowhere."""
    campaign = replace(data.campaign, fit=replace(data.campaign.fit, effects=(effect,)))
    known = of_campaign(Data.of(campaign))
    points = (Points(AXIAL, np.array([20.0, 100.0]), np.array([2e-4, 2e-4])),)
    planned = plan(known, Wanted("predictions", 2.0, RigSettings(), (AXIAL,), points, known.names)).planned
    assert np.all(np.isfinite(known.covariance))
    assert np.all(np.isfinite(planned.stiffness))


def _held(known: Knowledge) -> Knowledge:
    """The same with what rests on a bound held there."""
    k = len(known.names)
    return replace(known, bounded=(), covariance=np.linalg.inv(np.linalg.inv(known.covariance)[:k, :k]))
