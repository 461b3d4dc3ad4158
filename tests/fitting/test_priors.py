"""Priors of parameters, which weigh as one more measurement of the parameters, and ties between parameters."""

import json
from dataclasses import replace

import numpy as np
import pytest
from fits import joint_fit

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import ParameterSetting, RigSettings
from bushfit.fitting.agreement import prior_uses
from bushfit.fitting.assess import covariance
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.solve import solve_with_lmfit
from bushfit.model.constraints import Constraints, Prior
from bushfit.model.file import from_document, to_document
from bushfit.model.model import FIVE
from bushfit.model.result import Result
from tests.fits import jacobian, residual, solve


@pytest.mark.parametrize("solver", [solve, solve_with_lmfit])
def test_a_prior_weighs_as_one_more_measurement_of_the_parameter(measured, paper_model, solver):
    """For one parameter of a nearly linear model, the estimate is the mean of tests and prior, by their variances."""
    tests = measured.select_tests(None)
    plain = solve(FitProblem(paper_model, tests, FIVE))
    i = FIVE.index("alpha")
    error = float(np.sqrt(np.linalg.inv(plain.jacobian @ plain.jacobian.T)[i, i]))
    value, error = plain.model.values["alpha"], error * float(plain.coordinates.slopes(plain.model.values)[i])
    prior = Prior(("absent", "alpha"), np.array([1.0, value + 2.0 * error]), np.diag([1.0, error**2]), "")
    known = replace(paper_model, constraints=Constraints([prior]))
    fitted = solver(FitProblem(known, tests, FIVE))
    assert fitted.model.values["alpha"] == pytest.approx(value + error, rel=0.02 * error / value)
    assert fitted.chi_square - plain.chi_square == pytest.approx(2.0, rel=0.05)
    stage = [FitProblem(plain.model, tests, FIVE)]
    covariances = [covariance(fit.model, stage) for fit in (plain, fitted)]
    before, after = (known.stderr("alpha") or 0.0 for known in covariances)
    assert after == pytest.approx(np.hypot(before, error) / 2.0, rel=0.03)
    share = prior_uses([fitted], None)["alpha"].share
    assert share == pytest.approx(before**2 / (before**2 + error**2), rel=0.03)


def _fitted(campaign: Campaign, **settings: ParameterSetting) -> Result:
    return joint_fit(replace(campaign, fit=replace(campaign.fit, parameters=settings)))


def test_a_tie_holds_in_values_errors_and_derivatives(rig):
    tied = _fitted(rig(3), m=ParameterSetting(expression="0.18 * mu + 1e3 * exp(alpha)"))
    mu, m, alpha = (tied.model.values[name] for name in ("mu", "m", "alpha"))
    assert m == pytest.approx(0.18 * mu + 1e3 * np.exp(alpha), rel=1e-12)
    assert list(tied.ties) == ["m"]
    assert "m" not in tied.fitted
    slopes = np.array([0.18, 1e3 * np.exp(alpha)])
    free = tied.covariance.select(["mu", "alpha"]).matrix
    assert tied.covariance.stderr("m") == pytest.approx(float(np.sqrt(slopes @ free @ slopes)))
    tests = PreparedCampaign.from_campaign(rig(3)).data_sets
    above, below = (residual(tied.model.with_values({"mu": mu * np.exp(s)}), tests) for s in (1e-5, -1e-5))
    assert jacobian(tied.model, tests, ["mu"])[0] == pytest.approx((above - below) / 2e-5, rel=1e-3, abs=1e-2)


def test_the_model_of_earlier_tests_is_a_prior_that_counts_as_these_tests(rig, tmp_path):
    """The fit with the covariance of the first campaign is the fit to both campaigns, and its file says how it came."""
    stated = RigSettings(gain_error=5e-3, phase_error=2e-3)
    first, second = replace(rig(1), rig=stated), replace(rig(2), rig=stated, path=tmp_path / "campaign.toml")
    one, two = _fitted(first), _fitted(second)
    (tmp_path / "model.json").write_text(json.dumps(to_document(one)), encoding="utf-8")
    both = joint_fit(replace(second, fit=replace(second.fit, prior="model.json")))
    for name in FIVE:
        ends = sorted((one.model.values[name], two.model.values[name]))
        error = both.covariance.stderr(name)
        assert ends[0] - error < both.model.values[name] < ends[1] + error
        assert error == pytest.approx((two.covariance.stderr(name) or 0.0) / np.sqrt(2.0), rel=0.2)
    read = from_document(to_document(both))
    assert read.priors == both.priors
    assert all(0.2 < use.share < 0.8 and abs(use.distance) < 4.0 for use in read.priors.values())


def test_tests_contradict_a_wrong_prior_and_no_right_one(rig, paper_model):
    truth = paper_model.values["alpha"]
    for shift, contradicts in ((0.5, False), (-6.0, True), (6.0, True)):
        found = _fitted(rig(4), alpha=ParameterSetting(prior=f"{truth + 0.004 * shift} +- 0.004"))
        assert any(warning.kind == "prior_contradicted" for warning in found.warnings) == contradicts
