"""Gains are what a refit would gain, and noise made as a rig makes it passes the thresholds as often as stated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigged import PLAN, SHARED, Fitted, Measured

from bushfit.campaign.schema import SimulateSettings
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.locate import contrasts
from bushfit.diagnosis.propose import proposals
from bushfit.diagnosis.score_test import PATTERN_LEFT, ScoreTest
from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import parted

LEVEL = 0.95
SEEDS = 300


@pytest.fixture(scope="module")
def clean(measured: Measured, fitted: Fitted) -> Evidence:
    return fitted(measured(plan=SHARED))


def with_residual(evidence: Evidence, residual: Array) -> Evidence:
    return replace(evidence, solution=replace(evidence.solution, residual=residual))


def with_freedom(evidence: Evidence, freedom: int) -> Evidence:
    """The same fit, the shared variance of its sweeps known from so many degrees of freedom (0: exactly), and the
    scatter exactly."""
    _, sweeps = parted(evidence.data_sets)
    noise = replace(sweeps[0].noise, freedom=freedom, scatter_freedom=0)
    data_sets = [
        replace(data_set, noise=noise) if data_set.kind == "sweep" else data_set for data_set in evidence.data_sets
    ]
    return replace(evidence, data_sets=tuple(data_sets))


def test_gains_are_those_of_a_linear_refit(clean: Evidence) -> None:
    """Chi-square of the residual regressed on the model's Jacobian, less that on Jacobian and columns."""
    random = np.random.default_rng(0)
    evidence = with_residual(clean, random.standard_normal(clean.residual.size))
    columns = random.standard_normal((7, clean.residual.size)) * np.array([[1e-3], [1], [1e3], [1], [1], [1], [1]])
    groups = [np.array([0]), np.array([1, 2]), np.array([3, 4, 5, 6])]
    questions = ScoreTest(evidence, columns, groups, PATTERN_LEFT)
    own = evidence.solution.jacobian

    def left(rows: Array) -> tuple[float, Array]:
        answer = np.linalg.lstsq(rows.T, evidence.residual, rcond=None)[0]
        return float(np.sum((evidence.residual - answer @ rows) ** 2)), -answer

    for group, gain, answer in zip(groups, questions.gains(), questions.amounts(), strict=True):
        chi_square, refitted = left(np.vstack((own, columns[group])))
        expected = left(own)[0] - chi_square
        print(f"{group.size} columns: gain {gain:.6f}, refit {expected:.6f}")
        assert gain == pytest.approx(expected, rel=1e-8)
        np.testing.assert_allclose(answer, refitted[-group.size :], rtol=1e-6)


def test_columns_that_the_model_absorbs_are_not_asked(clean: Evidence) -> None:
    own = clean.solution.jacobian
    questions = ScoreTest(clean, np.vstack((own[:1], own[0] + own[2])), [np.array([0]), np.array([0, 1])], PATTERN_LEFT)
    assert questions.sizes == [0, 0]
    assert questions.gains() == [0.0, 0.0]
    assert questions.largest_by_chance(LEVEL) == np.inf


@pytest.mark.slow
@pytest.mark.parametrize("plan", [PLAN, SHARED], ids=["independent", "shared"])
def test_clean_campaigns_pass_the_thresholds_at_the_stated_rates(
    measured: Measured, fitted: Fitted, plan: SimulateSettings
) -> None:
    """Whole campaigns, their noise estimated anew from each."""
    smooth = []
    for seed in range(SEEDS):
        evidence = fitted(measured(plan=plan, seed=seed))
        columns = contrasts(evidence)
        questions = ScoreTest(evidence, columns, [np.arange(len(columns))], PATTERN_LEFT)
        smooth.append(questions.gains()[0] > questions.largest_by_chance(LEVEL))
    print(f"{SEEDS} clean campaigns: smooth misfit above its {100 * LEVEL:.0f} % threshold in {np.mean(smooth):.1%}")
    # counts over 300 seeds scatter: 15 +- 4 are expected
    assert 0.0 < np.mean(smooth) < 0.09


def blocks(evidence: Evidence) -> list[Array]:
    """Indices of the residuals of each run."""
    return [block for _, _, own, _ in evidence.rigs for block in own]


def blockwise(evidence: Evidence) -> tuple[Array, list[Array]]:
    """ScoreTest about every block: one column each, its mean."""
    every = blocks(evidence)
    columns = np.zeros((len(every), evidence.residual.size))
    for row, block in zip(columns, every, strict=True):
        row[block] = 1.0
    return columns, [np.array([i]) for i in range(len(columns))]


@pytest.mark.parametrize("freedom", [0, 12])
def test_drawn_noise_passes_the_threshold_at_the_stated_rate(clean: Evidence, freedom: int) -> None:
    """Noise drawn in full, residual by residual, the blocks' shared variance divided by its own estimate."""
    random, count = np.random.default_rng(4), 400
    noise = random.standard_normal((count, clean.residual.size))
    if freedom:
        scale = np.sqrt(freedom / random.chisquare(freedom, count))[:, None]
        for block in blocks(clean):
            noise[:, block] += (scale - 1.0) * noise[:, block].mean(axis=1)[:, None]
    evidence = with_freedom(clean, freedom)
    assert max(freedoms.shared for freedoms, _, _, _ in evidence.rigs) == freedom
    threshold = ScoreTest(evidence, *blockwise(clean), PATTERN_LEFT).largest_by_chance(LEVEL)
    drawn = (ScoreTest(with_residual(evidence, row), *blockwise(clean), PATTERN_LEFT) for row in noise)
    share = float(np.mean([max(one.gains()) > threshold for one in drawn]))
    print(f"{freedom} degrees of freedom: {100 * share:.1f} % above, {100 * (1 - LEVEL):.0f} % stated")
    assert abs(share - (1 - LEVEL)) < 4.0 * np.sqrt(LEVEL * (1 - LEVEL) / count)


def test_shared_variance_from_few_repeats_raises_the_threshold(clean: Evidence) -> None:
    thresholds = [
        ScoreTest(with_freedom(clean, freedom), *blockwise(clean), PATTERN_LEFT).largest_by_chance(LEVEL)
        for freedom in (0, 12, 4)
    ]
    print("known, 12, 4 degrees of freedom: " + ", ".join(f"{x:.1f}" for x in thresholds))
    assert thresholds[0] < thresholds[1] < thresholds[2]


@pytest.mark.parametrize("sense", [0, 1, -1])
def test_senses(clean: Evidence, sense: int) -> None:
    """One unit column: the 95 % quantile of chi-square with one degree, or that of its positive half."""
    column = clean.beside(np.random.default_rng(1).standard_normal((1, clean.residual.size)))
    questions = ScoreTest(clean, column, [np.array([0])], PATTERN_LEFT)
    found = questions.largest_by_chance(LEVEL, [sense])
    print(f"sense {sense:+d}: {found:.2f}")
    assert found == pytest.approx(3.841 if sense == 0 else 2.706, rel=0.1)


def test_the_sense_of_a_question_is_that_of_its_answer(clean: Evidence) -> None:
    """Two opposite columns, one answer physical: noise that pleases one displeases the other."""
    column = clean.beside(np.random.default_rng(1).standard_normal((1, clean.residual.size)))
    both = np.vstack((column, -column))
    groups = [np.array([0]), np.array([1])]
    questions = ScoreTest(clean, both, groups, PATTERN_LEFT)
    two_sided = questions.largest_by_chance(LEVEL, [0, 0])
    one_sided = questions.largest_by_chance(LEVEL, [1, 1])
    assert one_sided == pytest.approx(two_sided, rel=1e-9)


def test_two_powers_that_would_follow_any_law_between_them_are_not_looked_for_together(clean: Evidence) -> None:
    """Stiffening with the square and with the fourth power of amplitude: one of them is asked of each model."""
    powers = {"strain_stiffening", "fifth_power_stiffening"}
    assert powers <= {proposal.name for proposal in proposals(clean, (), ())}
    for power in powers:
        solution = replace(clean.solution, model=clean.model.with_effect(power))
        assert not powers & {proposal.name for proposal in proposals(replace(clean, solution=solution), (), ())}
