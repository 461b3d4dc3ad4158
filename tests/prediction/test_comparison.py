"""Two results compared: known differences are found and covered, equal bushings are equal, m waits for alpha."""

from dataclasses import astuple, replace

import numpy as np
import pytest
from fits import joint_fit
from scipy.stats import binom
from scipy.stats import f as fisher
from scipy.stats import t as student

from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.effects.contract import Array
from bushfit.geometry import Direction
from bushfit.model.covariance import Covariance
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result
from bushfit.prediction.bands import Band
from bushfit.prediction.comparison import Comparison, compare, with_holm
from bushfit.prediction.parameter_comparison import JointContrast, ParameterContrast
from bushfit.simulation.exact import ExactTests, simulate_exact
from bushfit.simulation.measured import measure

AXIAL = Direction.AXIAL
GRID = (np.array([1.0, 5.0, 35.0, 155.0]), np.array([1e-4, 5e-4]))
#: A short campaign, quick to fit.
PLAN = SimulateSettings(
    repeats=3,
    noise=5e-3,
    force_noise=3e-3,
    loops=(SimulatedLoop(AXIAL, 1e-3, 0.1, cycles=2),),
    sweeps=(SimulatedSweep(AXIAL, (1e-4, 5e-4), (5.0, 25.0, 65.0, 105.0, 155.0)),),
)
MOVED = dict(zip(FIVE, (1.02, 0.99, 1.01, 1.03, 0.98), strict=True))
#: The bushing of another supplier: values over those of the paper's.
OTHER = {"mu": 1.08, "m": 1.05, "alpha": 1.04, "sigma_fmax": 0.9}


def fitted(clean: ExactTests, seed: int) -> Result:
    return joint_fit(measure(clean, replace(PLAN, seed=seed)).campaign())


def against(reference: Result, other: Result) -> Comparison:
    return with_holm([compare(reference, other, [(AXIAL, AXIAL)], [GRID])])[0]


def known(model: Model, covariance: Array) -> Result:
    return Result(model, fitted=FIVE, covariance=Covariance(FIVE, covariance))


def scaled(model: Model, **factors: float) -> Model:
    return model.with_values({name: factor * model.values[name] for name, factor in factors.items()})


def rows(found: Comparison) -> dict[str, ParameterContrast]:
    return {row.name: row for row in found.parameters}


@pytest.fixture(scope="module")
def campaigns(paper_model) -> tuple[ExactTests, ExactTests]:
    return simulate_exact(paper_model, PLAN), simulate_exact(scaled(paper_model, **OTHER), PLAN)


@pytest.fixture(scope="module")
def fits(campaigns) -> list[tuple[Result, Result, Result]]:
    """The paper's bushing twice, of other noise, and the other one, for every seed."""
    one, other = campaigns
    return [(fitted(one, 3 * k), fitted(one, 3 * k + 1), fitted(other, 3 * k + 2)) for k in range(16)]


def test_equal_bushings_differ_no_oftener_than_said(fits):
    """By parameters (Holm), all together, any word on stiffness or loss, and the headline: 5 % of the pairs each."""
    found = [against(one, two) for one, two, _ in fits]
    alarms = {
        "a parameter, Holm": sum(any(row.holm is not None and row.holm < 0.05 for row in f.parameters) for f in found),
        "all together": sum(f.joint is not None and f.joint.p < 0.05 for f in found),
        "words": sum(any("higher" in line or "lower" in line for line in f.sentences()) for f in found),
        "headline": sum(bool(f.significant_differences) for f in found),
    }
    assert max(alarms.values()) <= binom.isf(3e-3, len(fits), 0.05)  # more in 3 of a thousand


def test_known_differences_are_found_and_covered(fits, paper_model):
    truth = {name: factor - 1.0 for name, factor in OTHER.items()} | {"eps_half": 0.0}
    truth["alpha"] *= paper_model.values["alpha"]
    x, f = (axis.ravel() for axis in np.meshgrid(GRID[1], GRID[0], indexing="ij"))
    stiffness, before = (model.stiffness(AXIAL, f, x) for model in (scaled(paper_model, **OTHER), paper_model))
    ratio = np.log(np.abs(stiffness / before))
    loss = stiffness.imag / stiffness.real - before.imag / before.real
    covered, curves, everywhere, seen = list[bool](), list[float](), list[bool](), list[bool]()
    for one, _, other in fits:
        found = against(one, other)
        for name, row in rows(found).items():
            if name in truth and row.interval:
                covered.append(row.interval[0] <= truth[name] <= row.interval[1])
        (each,) = found.contrasts
        inside = [(b.low <= t) & (t <= b.high) for b, t in ((each.stiffness, ratio), (each.loss_factor, loss))]
        wide = [found.widened(each.stiffness), found.widened(each.loss_factor)]
        curves.append(float(np.mean(inside)))
        everywhere.append(all(((b.low <= t) & (t <= b.high)).all() for b, t in zip(wide, (ratio, loss), strict=True)))
        seen.append((rows(found)["mu"].holm or 0.0) < 0.05)
    assert np.mean(covered) >= 0.90
    assert np.mean(curves) >= 0.88
    assert np.mean(everywhere) >= 0.85
    assert all(seen)


@pytest.mark.parametrize(
    ("deviation", "joint", "named"),
    [
        (2.1, 0.2, []),  # stiffness differs at 3.6 %
        (-2.1, 0.04, ["axial stiffness", "the parameters taken together"]),
        (-2.4, 0.2, ["axial stiffness"]),  # at 1.6 %
        (0.5, 0.04, []),
        (0.5, 0.02, ["the parameters taken together"]),
    ],
)
def test_the_headline_joins_two_tests(paper_model, deviation, joint, named):
    """Hochberg's procedure: both at 5 %, or one at 2.5 %."""
    one = known(paper_model, np.diag([1e8, 1e6, 1e-6, 1e4, 1e-8]))
    found = against(one, one)
    half = (1.96, 9.0) if deviation > 0.0 else (9.0, 1.96)  # the end away from zero does not matter
    bands = [
        Band(np.array([x]), np.array([x - half[0]]), np.array([x + half[1]]), np.ones((1, 1))) for x in (deviation, 0.0)
    ]
    contrast = replace(found.contrasts[0], stiffness=bands[0], loss_factor=bands[1])
    assert replace(found, contrasts=(contrast,), joint=JointContrast(joint, 5)).significant_differences == named
    contrast = replace(contrast, stiffness=(unknown := replace(bands[0], root=np.empty((0, 1)))), loss_factor=unknown)
    assert not replace(found, contrasts=(contrast,), joint=None).significant_differences


@pytest.mark.parametrize("freedom", [1e6, 12.0])
def test_figures_are_those_of_independent_normal_errors(paper_model, freedom):
    """Against scipy: t of each parameter with the degrees of freedom of Welch, and Hotelling's T^2 of all together."""
    random = np.random.default_rng(1)
    values = np.array([paper_model.values[name] for name in FIVE])
    parts = [1e-2 * values[:, None] * random.standard_normal((5, 9)) for _ in range(2)]
    one, other = (part @ part.T for part in parts)
    moved, share = values * list(MOVED.values()), np.sqrt(2.0 / freedom)
    results = [
        replace(each, covariance=Covariance(FIVE, matrix, (share * matrix,)))
        for each, matrix in ((known(paper_model, one), one), (known(scaled(paper_model, **MOVED), other), other))
    ]
    found = against(*results)
    logarithmic = np.array([name != "alpha" for name in FIVE])
    slopes = [np.diag(np.where(logarithmic, 1.0 / at, 1.0)) for at in (values, moved)]
    each = np.array([slopes[0] @ one @ slopes[0], slopes[1] @ other @ slopes[1]])
    covariance, squares = each.sum(axis=0), np.diagonal(each, axis1=1, axis2=2)
    welch = freedom * squares.sum(axis=0) ** 2 / np.square(squares).sum(axis=0)
    difference = np.where(logarithmic, np.log(moved / values), moved - values)
    left = welch.min() - 4.0
    statistic = difference @ np.linalg.solve(covariance, difference) * left / (5.0 * welch.min())
    assert astuple(found.joint or JointContrast(1.0, 0)) == pytest.approx((fisher.sf(statistic, 5, left), 5), rel=1e-3)
    error = np.sqrt(np.diag(covariance))
    for i, name in enumerate(FIVE):
        row = rows(found)[name]
        if name != "m":
            assert row.p == pytest.approx(2.0 * student.sf(abs(difference[i]) / error[i], welch[i]), rel=1e-3)


def test_m_is_compared_at_a_frequency_where_alpha_is_free_and_alone_where_it_is_held(paper_model):
    one = known(paper_model, np.diag([1e8, 1e6, 1e-6, 1e4, 1e-8]))
    other = replace(one, model=paper_model.with_values({"alpha": 0.25, "m": 1.9e5}))
    found = rows(against(one, other))
    assert found["m"].note == "comparable only at equal alpha"
    assert found["m"].p is None
    omega = 2.0 * np.pi * np.sqrt(155.0)
    row = found["m at 12.4 Hz"]
    assert (row.reference, row.other) == pytest.approx((2e5 * omega**0.24, 1.9e5 * omega**0.25))
    assert row.unit == "Pa"
    held = [replace(each, covariance=each.covariance.select(["mu", "m"])) for each in (one, one)]
    found = rows(against(*held))
    assert list(found) == list(FIVE)
    assert found["m"].p == pytest.approx(1.0)
    assert found["alpha"].note == "fixed in both"
