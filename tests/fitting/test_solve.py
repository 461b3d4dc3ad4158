"""The least-squares problem: one minimum from anywhere, a fit that never climbs, bounds held, and effects added."""

import lmfit
import numpy as np
import pytest

from bushfit.effects import BASE
from bushfit.fitting.descent import Descent
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.fitting.starts import start_values
from bushfit.model.model import FIVE, Model
from tests.fits import residual, solve


@pytest.fixture
def axial(measured) -> list[MeasuredTest]:
    return measured.select_tests(None)


@pytest.fixture
def data_sets(rig) -> list[MeasuredTest]:
    return PreparedCampaign.from_campaign(rig(1)).data_sets


def test_a_parameter_pushed_against_a_bound_rests_on_it_and_is_named(axial, paper_model):
    solution = solve(FitProblem(paper_model, axial, FIVE, {"mu": (None, 1.05e6)}))
    assert dict(solution.at_bound) == {"mu": "max"}
    assert solution.model.values["mu"] == pytest.approx(1.05e6, rel=1e-2)
    assert solution.at_minimum
    free = solve(FitProblem(paper_model, axial, FIVE))
    assert not free.at_bound
    assert free.chi_square < solution.chi_square


def test_an_error_that_tests_share_whitens_residuals_and_derivatives_alike(axial, paper_model):
    columns = np.random.default_rng(0).normal(size=(2, sum(test.size for test in axial)))
    shared, mu = SharedErrors.from_columns(columns), paper_model.values["mu"]
    problem = FitProblem(paper_model, axial, FIVE, shared_error=shared)
    above, below = (problem.residual(paper_model.with_values({"mu": mu * np.exp(s)})) for s in (1e-5, -1e-5))
    np.testing.assert_allclose(problem.linearise(paper_model)[1][0], (above - below) / 2e-5, rtol=1e-3, atol=1e-2)


@pytest.mark.parametrize("many", [10, pytest.param(100, marks=pytest.mark.slow)])
def test_random_starts_end_at_one_minimum(measured, axial, result, many):
    """Two decades per parameter: a tenth to ten times the answer, alpha over its own range.

    From a start that is far too stiff a fit may lose a branch for good. It then says that the branch rests on a bound,
    and `starting_model` takes no such start: it takes values read off the tests where they meet these better.
    """
    best, rng = np.array([result.model.values[name] for name in FIVE]), np.random.default_rng(1)
    read_off = residual(measured.starting_model(measured.effects, axial), axial)
    ends, costs = [], []
    for _ in range(many):
        start = dict(zip(FIVE, best * 10.0 ** rng.uniform(-1.0, 1.0, 5), strict=True))
        start["alpha"] = np.clip(10.0 ** rng.uniform(-2.0, 0.0), *result.model.parameters["alpha"].bounds)
        solution = solve(FitProblem(result.model.with_values(start), axial, FIVE))
        if solution.at_bound:
            tried = residual(result.model.with_values(start), axial)
            assert tried @ tried > read_off @ read_off
        else:
            ends.append([solution.model.values[name] for name in FIVE])
            costs.append(solution.chi_square)
    stderr = np.array([result.covariance.stderr(name) or 0.0 for name in FIVE])
    assert len(ends) >= 0.9 * many
    assert np.ptp(costs) < 1e-3
    assert np.all(np.abs(np.array(ends) - best) < 0.02 * stderr)


@pytest.mark.parametrize("effects", [(), ("delay",), ("viscous", "strain_stiffening")], ids="+".join)
@pytest.mark.parametrize("bounds", [{}, {"alpha": (0.26, 0.5)}, {"mu": (None, 9e5)}], ids=str)
def test_it_ends_where_lmfit_ends(paper_model, data_sets, effects, bounds):
    start = start_values(paper_model.bushing, data_sets, {})
    model = Model.with_defaults(paper_model.bushing, (*BASE, *effects), start)
    problem = FitProblem(model, data_sets, tuple(model.parameters), bounds)
    found, parameters = Descent.start(problem).run(100), lmfit.Parameters()
    for name, value, least, most in zip("abcdefgh", problem.start, *problem.limits, strict=False):
        parameters.add(name, float(value), min=float(least), max=float(most))

    def misfit(tried: lmfit.Parameters) -> np.ndarray:
        values = problem.coordinates.values([parameter.value for parameter in tried.values()])
        return problem.residual(model.with_values(values))

    known = lmfit.minimize(misfit, parameters, "least_squares", calc_covar=False, ftol=1e-12, xtol=1e-10)
    end = np.array([parameter.value for parameter in known.params.values()])
    errors = np.sqrt(np.diag(np.linalg.pinv(found.best.jacobian @ found.best.jacobian.T)))
    assert found.converged
    assert found.chi_square == pytest.approx(known.chisqr, abs=1e-2)
    assert np.max(np.abs(found.point - end) / errors) < 0.05
    assert found.solution.at_bound == problem.at_bound(end)
