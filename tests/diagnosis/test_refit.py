"""Candidate refits: the best come to their end, those far behind are stopped, and nothing known is fitted again."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np
import pytest
from rigged import SHARED, Fitted, Measured

from bushfit.diagnosis.evidence import EVALUATIONS, Evidence, fit
from bushfit.diagnosis.propose import Proposal, proposals
from bushfit.diagnosis.refit import EXCLUDED, Candidate, comes_below, near_its_end, raced, refits
from bushfit.effects.contract import Array
from bushfit.fitting.descent import Descent

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


def test_it_starts_from_values_that_promise_more_than_its_own(plain: Evidence, proposed: list[Proposal]) -> None:
    """Values of the true model are a shorter way, values far from everything none."""
    claims = [claim for claim in proposed if claim.name == "inertia"]
    (own,) = refits(plain, claims, [], {}, (), {})
    (near,) = refits(plain, claims, [], {}, (), {}, {**own.evidence.model.values})
    (far,) = refits(plain, claims, [], {}, (), {}, {name: 3.0 * value for name, value in plain.model.values.items()})
    taken = [found.evidence.solution.evaluations for found in (near, own, far)]
    print(f"evaluations from near, from its own values, and with values far off at hand: {taken}")
    assert taken[0] < taken[1] == taken[2]
    assert own.evidence.chi_square == pytest.approx(near.evidence.chi_square, abs=0.05)


def test_without_proposals_there_is_only_what_is_known(plain: Evidence) -> None:
    known = Candidate("inertia", plain, 0.0)
    assert refits(plain, [], [known], {}, (), {}) == [known]
    assert refits(plain, [], [], {}, (), {}) == []


@dataclass(frozen=True)
class Falling:
    """A fit that comes down by the same at each evaluation, and promises to come down by any amount."""

    chi_square: float
    by: float
    evaluations: int = 1
    converged: bool = False
    expected_fall: float = 1e9
    residual: Array = field(default_factory=lambda: np.zeros(100))

    def stepped(self) -> Falling:
        return replace(self, chi_square=max(self.chi_square - self.by, 0.0), evaluations=self.evaluations + 1)

    def finished(self, evaluations: int) -> Falling:
        here = self
        while here.evaluations < evaluations:
            here = here.stepped()
        return here


def test_a_refit_that_hardly_comes_nearer_is_left_but_where_it_claimed_to_come_near() -> None:
    """Ten thousand behind, by one an evaluation; chosen by hand, as no campaign shows it alone."""
    slow, quick = Falling(11_000.0, 1.0), Falling(11_000.0, 250.0)
    fits = {name: cast(Descent, each) for name, each in (("slow", slow), ("quick", quick), ("claims", slow))}
    ends = raced(fits, {"slow": 9000.0, "quick": 9000.0, "claims": 900.0}, 1000.0)
    evaluations = {name: each.evaluations for name, each in ends.items()}
    assert evaluations["slow"] < 20
    assert evaluations["quick"] == EVALUATIONS
    assert evaluations["claims"] == EVALUATIONS


def test_a_fit_far_above_the_noise_that_hardly_comes_down_is_at_its_end() -> None:
    far, near = cast(Descent, Falling(100_000.0, 1.0)), cast(Descent, Falling(110.0, 0.1))
    assert near_its_end(far, 100.0, 1e-3).evaluations < 10
    assert near_its_end(near, 100.0, 1e-3).evaluations == EVALUATIONS


def test_a_refit_that_came_near_is_left_where_its_pace_will_not_bring_it_to_the_best() -> None:
    """Fifty-five behind, by a tenth an evaluation and by fifteen times that; chosen by hand, as no campaign shows it
    alone."""
    creeps, comes = cast(Descent, Falling(1055.0, 0.1)), cast(Descent, Falling(1055.0, 1.5))
    ends = raced({"creeps": creeps, "comes": comes}, {"creeps": 900.0, "comes": 900.0}, 1000.0)
    evaluations = {name: each.evaluations for name, each in ends.items()}
    assert evaluations["creeps"] < 20
    assert evaluations["comes"] == EVALUATIONS


def test_whether_a_fit_comes_below_a_goal() -> None:
    """A hundred above it, by one an evaluation: asked until it is there, may not be expected to, or took too long."""
    slow, quick = cast(Descent, Falling(1100.0, 1.0)), cast(Descent, Falling(1100.0, 10.0))
    assert comes_below(quick, 1000.0)
    assert not comes_below(slow, 1000.0)
    assert not comes_below(replace(quick, expected_fall=1.0), 1000.0)
    assert comes_below(replace(quick, converged=True), 1101.0)
    assert not comes_below(replace(quick, converged=True), 1100.0)
