"""Candidate refits: the best come to their end, those far behind are stopped, and nothing known is fitted again."""

from __future__ import annotations

import pytest
from rigged import SHARED, Fitted, Measured

from bushfit.diagnosis.evidence import EVALUATIONS, Evidence, fit
from bushfit.diagnosis.propose import Proposal, proposals
from bushfit.diagnosis.refit import EXCLUDED, Candidate, refits

INERTIA = {"inertia": {"mass": 0.06}}


@pytest.fixture(scope="module")
def plain(measured: Measured, fitted: Fitted) -> Evidence:
    return fitted(measured(INERTIA, SHARED))


@pytest.fixture(scope="module")
def proposed(plain: Evidence) -> list[Proposal]:
    return proposals(plain, (), ())[:6]


def test_the_best_is_fitted_to_its_end_and_those_far_behind_are_not(plain: Evidence, proposed: list[Proposal]) -> None:
    found = refits(plain, proposed, [], {}, (), {})
    for candidate in found:
        print(f"{candidate.name:20} gain {candidate.gain:7.1f}, {candidate.evidence.solution.evaluations} evaluations")
    assert [candidate.evidence.bic for candidate in found] == sorted(candidate.evidence.bic for candidate in found)
    best = found[0]
    assert best.name in ("inertia", "fixture_resonance")
    assert not best.left
    alone = fit(best.evidence.model, plain.data_sets, (), {})
    assert best.evidence.chi_square == pytest.approx(alone.chi_square, abs=0.05)
    left = [candidate for candidate in found if candidate.left]
    assert left
    for candidate in left:
        assert candidate.evidence.chi_square > best.evidence.chi_square + EXCLUDED
        assert candidate.evidence.solution.evaluations < EVALUATIONS
        whole = fit(candidate.evidence.model, plain.data_sets, (), {})
        assert whole.chi_square > best.evidence.chi_square + EXCLUDED


def test_what_is_known_is_not_fitted_again(plain: Evidence, proposed: list[Proposal]) -> None:
    everyone = refits(plain, proposed, [], {}, (), {})
    known = next(candidate for candidate in everyone if candidate.name == "inertia")
    others = [claim for claim in proposed if claim.name != "inertia"]
    again = refits(plain, others, [known], {}, (), {})
    assert next(candidate for candidate in again if candidate.name == "inertia") is known
    assert {candidate.name for candidate in again} == {candidate.name for candidate in everyone}


def test_without_proposals_there_is_only_what_is_known(plain: Evidence) -> None:
    known = Candidate("inertia", plain, 0.0)
    assert refits(plain, [], [known], {}, (), {}) == [known]
    assert refits(plain, [], [], {}, (), {}) == []
