"""What an effect promises before any refit: scores are what a linear refit would gain."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigged import SHARED, Fitted, Measured

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.propose import proposals, scores


@pytest.fixture(scope="module")
def clean(measured: Measured, fitted: Fitted) -> Evidence:
    return fitted(measured(plan=SHARED))


def test_scores_are_those_of_a_linear_refit(clean: Evidence) -> None:
    """Chi-square of the residual regressed on the model's Jacobian, less that on Jacobian and column."""
    random = np.random.default_rng(0)
    residual, own = random.standard_normal(clean.residual.size), clean.solution.jacobian
    evidence = replace(clean, solution=replace(clean.solution, residual=residual))
    columns = random.standard_normal((3, residual.size)) * np.array([[1e-3], [1.0], [1e3]])
    before = np.linalg.lstsq(own.T, residual, rcond=None)[1]
    for column, gain, amount, seen in zip(columns, *scores(evidence, columns), strict=True):
        answer, after, *_ = np.linalg.lstsq(np.vstack((own, column)).T, residual, rcond=None)
        assert seen
        assert gain == pytest.approx(float((before - after)[0]), rel=1e-6)
        assert amount == pytest.approx(-answer[-1], rel=1e-6)


def test_columns_that_the_model_absorbs_are_not_seen(clean: Evidence) -> None:
    own = clean.solution.jacobian
    for found in scores(clean, np.vstack((own[:1], own[0] + own[2], np.zeros(own.shape[1])))):
        assert not found.any()


def test_two_powers_that_would_follow_any_law_between_them_are_not_looked_for_together(clean: Evidence) -> None:
    """Stiffening with the square and with the fourth power of amplitude: one of them is asked of each model."""
    powers = {"strain_stiffening", "fifth_power_stiffening"}
    assert powers <= {proposal.name for proposal in proposals(clean, (), ())}
    for power in powers:
        solution = replace(clean.solution, model=clean.model.with_effect(power))
        assert not powers & {proposal.name for proposal in proposals(replace(clean, solution=solution), (), ())}
