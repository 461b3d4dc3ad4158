"""Profile likelihood, honest where the data leave a side open; and what they leave open is said, and what helps."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fits import joint_fit
from tries import SEEDS

from bushfit.campaign.schema import RigSettings
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.procedures import fit_joint
from bushfit.fitting.profile import find_limit
from bushfit.geometry import Direction
from bushfit.model.file import from_document, to_document
from bushfit.model.model import FIVE
from bushfit.progress import report_progress_to
from tests.fits import solve

FREQUENCIES = (5.0, 15.0, 45.0, 100.0, 155.0)
BAND = tuple(float(f) for f in range(5, 156, 10))


def plan(largest: float, **changes: Any) -> dict[str, Any]:
    """One loop at an amplitude [m], a sweep at a fifth and a half of it."""
    loop = SimulatedLoop(Direction.AXIAL, largest, 0.1, cycles=1)
    sweep = SimulatedSweep(Direction.AXIAL, (0.2 * largest, 0.5 * largest), FREQUENCIES)
    return {"loops": (loop,), "sweeps": (sweep,), **changes}


def test_good_data_make_it_the_symmetric_interval(rig):
    told: list[tuple[str, int | None, int | None, str]] = []
    data = PreparedCampaign.from_campaign(replace(rig(1, **plan(1e-3)), rig=RigSettings(gain_error=0.0)))
    with report_progress_to(lambda *step: told.append(step)):
        result = fit_joint(data, profile=True)
    assert told == [("profiles", done, 5, "") for done in (*range(6), None)]
    assert fit_joint(data).profile == {}
    for profile in (result.profile, {"mu": (1.0, None)}):
        assert from_document(to_document(replace(result, profile=profile))).profile == profile
    assert to_document(fit_joint(data))["covariance"] == to_document(result)["covariance"]
    for name in FIVE:
        symmetric, profile = result.interval(name), result.profile[name]
        off = (np.array(profile, dtype=float) - symmetric) / np.ptp(symmetric)
        assert np.all(np.abs(off) < 0.05)


def test_what_the_data_leave_open_stays_open(rig, paper_model):
    """Tests that end at a tenth of eps_half show mu + sigma_fmax/eps_half alone: without friction that ever gives way,
    all of the stiffness may be friction's."""
    result = joint_fit(rig(0, **plan(2e-5)), profile=True)
    low, high = result.profile["mu"]
    assert low is None
    assert high > paper_model.values["mu"]
    for name in ("sigma_fmax", "eps_half"):
        low, high = result.profile[name]
        assert low is not None
        assert high is None or high > 4.0 * low
    assert None not in result.profile["alpha"]


@pytest.mark.parametrize("largest", [1e-3, 1e-4], ids=["good", "weak"])
def test_an_end_is_where_chi_square_has_risen_as_far_as_is_allowed(rig, largest):
    data = PreparedCampaign.from_campaign(rig(3, **plan(largest, loops=())))
    data_sets = data.select_tests(None)
    result = joint_fit(data.campaign, profile=True)
    best = solve(FitProblem(result.model, data_sets, FIVE))
    linear = np.sqrt(np.diag(np.linalg.inv(best.jacobian @ best.jacobian.T)))
    slopes = best.coordinates.slopes(best.model.values)
    allowed = result.covariance.half_width(np.eye(5)) / slopes / linear
    rises = {}
    for name, ratio in zip(FIVE, allowed, strict=True):
        others = [other for other in FIVE if other != name]
        for end in result.profile[name]:
            if end is not None:
                refit = solve(FitProblem(result.model.with_values({name: end}), data_sets, others))
                rises[name, end] = (refit.chi_square - best.chi_square) / ratio**2
    assert len(rises) >= (10 if largest == 1e-3 else 5)
    assert all(abs(rise - 1.0) < 0.02 for rise in rises.values())


def test_what_rests_on_a_bound_is_told_by_how_far_from_it_the_tests_let_it_be(rig, paper_model):
    """Of rubber that is all springpot and friction the tests show how much of a spring there is at most."""
    rubber = paper_model.with_values({"mu": 1e3, "m": 6e5, "alpha": 0.15})
    data = PreparedCampaign.from_campaign(replace(rig(0, rubber, **plan(1e-3)), rig=RigSettings(gain_error=0.0)))
    best = solve(FitProblem(fit_joint(data).model, data.select_tests(None), FIVE))
    assert best.at_bound == {"mu": "min"}
    limit = find_limit(best, "mu", "max")
    assert limit is not None
    held = best.model.with_values({"mu": limit})
    rise = solve(FitProblem(held, data.select_tests(None), FIVE[1:])).chi_square - best.chi_square
    assert rise == pytest.approx(1.645**2 * max(best.chi_square / (best.residual.size - 5), 1.0), rel=0.05)
    (told,) = (line for line in map(str, fit_joint(data).warnings) if line.startswith("mu ended"))
    assert "at most" in told
    assert "(95 %)" in told


@pytest.mark.slow
@pytest.mark.parametrize("shared", [False, True], ids=["independent", "shared"])
def test_profiles_hold_the_truth_as_often_as_they_say(rig, paper_model, shared):
    inside = []
    for seed in range(SEEDS // 2):
        campaign = rig(seed, shared=shared, **plan(1e-3))
        result = joint_fit(replace(campaign, rig=RigSettings(gain_error=0.0)), profile=True)
        for name in FIVE:
            low, high = result.profile[name]
            truth = paper_model.values[name]
            inside.append((low is None or low <= truth) and (high is None or truth <= high))
    share, each = np.mean(inside), np.mean(np.reshape(inside, (SEEDS // 2, -1)), axis=0)
    print(f"profile intervals, block errors {shared}: {share:.3f}, {dict(zip(FIVE, each, strict=True))}")
    chance = np.sqrt(0.95 * 0.05 / len(inside))
    assert 0.93 - 2.0 * chance <= share <= 0.97 + 2.0 * chance


def loop(amplitude: float, rate: float) -> SimulatedLoop:
    return SimulatedLoop(Direction.AXIAL, amplitude, rate)


def sweep(*amplitudes: float, band: tuple[float, ...] = BAND) -> SimulatedSweep:
    return SimulatedSweep(Direction.AXIAL, amplitudes, band)


#: Tests that lack something: loops, sweeps, what must be said, what is known.
LACKING = {
    "small amplitudes": (
        (loop(3e-5, 0.1),), (sweep(1e-5, 3e-5),),
        "sigma_fmax and eps_half are determined only as a ratio", "modulus at small amplitude",
    ),
    "one loop": ((loop(1e-3, 0.1),), (), "one loop rate, 0.1 Hz", "loss modulus of the springpot at 0.1 Hz"),
    "loops of one rate": (
        (loop(1e-3, 0.1), loop(3e-4, 0.1)), (), "mu, m and alpha cannot be", "storage modulus without friction",
    ),
    "one frequency": (
        (loop(1e-3, 10.0),), (sweep(1e-4, 5e-4, band=(10.0,)),), "one frequency, 10 Hz", "at 10 Hz",
    ),
    "one amplitude": ((), (sweep(2e-4),), "one amplitude; there is no loop: ", ""),
}  # fmt: skip


@pytest.mark.parametrize("case", LACKING)
def test_what_is_lacking_is_said_with_what_is_known(rig, case):
    loops, sweeps, reason, known = LACKING[case]
    for seed in (1, 2):
        lines = [*map(str, joint_fit(rig(seed, loops=loops, sweeps=sweeps)).warnings)]
        (said,) = [line for line in lines if "standard errors:" in line]
        assert reason in said
        if known:
            assert any(line.startswith("combinations that the tests determine") and known in line for line in lines)
        assert "bushfit plan chooses further tests that determine these parameters" in lines
