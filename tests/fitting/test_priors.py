"""Priors of parameters: rows of the least-squares problem that weigh as one more measurement of the parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.fitting.assess import FitStage, covariance
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.fitting.solve import solve, solve_with_lmfit
from bushfit.model.constraints import Constraints, Prior
from bushfit.model.model import FIVE, Model


@pytest.mark.parametrize("solver", [solve, solve_with_lmfit])
def test_a_prior_weighs_as_one_more_measurement_of_the_parameter(
    measured: PreparedCampaign, paper_model: Model, solver: Callable[[FitProblem], FitResult]
) -> None:
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
    stage = [FitStage(tuple(FIVE), tests)]
    before, after = (covariance(fit.model, stage).stderr("alpha") for fit in (plain, fitted))
    assert after == pytest.approx(np.hypot(before, error) / 2.0, rel=0.03)
