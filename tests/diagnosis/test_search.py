"""The search: candidates judged, effects added in turn, left out, or too small to count."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
import pytest
from asking import INERTIA, TWO, asked, names
from rigged import SHARED, Diagnosed, Fitted, Measured

from bushfit.diagnosis.propose import sensitivity
from bushfit.diagnosis.record import Settings
from bushfit.diagnosis.search import Search
from bushfit.effects import BASE, LIBRARY, effect_named
from bushfit.effects.contract import Array, Values
from bushfit.fitting.data_sets import DataSet
from bushfit.model.model import Model


def test_what_was_left_on_its_way_has_no_gain(diagnosed: Diagnosed) -> None:
    judged = {candidate.name: candidate for candidate in diagnosed(INERTIA, SHARED).candidates}
    left = [candidate for candidate in judged.values() if "left on its way" in candidate.why]
    assert left
    for candidate in left:
        assert candidate.gain is candidate.bic is candidate.heldout is None
        assert candidate.score > 0.0


def test_every_candidate_is_judged(diagnosed: Diagnosed) -> None:
    candidates = diagnosed(INERTIA, SHARED).candidates
    twins = {twin for effect in LIBRARY.values() for twin in effect.twins}
    later = {name for name, effect in LIBRARY.items() if effect.after}
    assert {judged.name for judged in candidates} >= LIBRARY.keys() - {*BASE, *twins, *later}
    assert not {judged.name for judged in candidates} & twins
    assert all(judged.why for judged in candidates)
    (kept,) = [judged for judged in candidates if judged.why == "kept"]
    assert kept.name == "inertia"
    scores = [judged.score for judged in candidates]
    assert scores == sorted(scores, reverse=True)
    refitted = [judged for judged in candidates if judged.gain is not None]
    assert all(judged.parameters for judged in refitted)
    assert max(judged.gain or 0.0 for judged in refitted) > 200.0


def test_what_the_tests_do_not_state_is_not_proposed(diagnosed: Diagnosed) -> None:
    """No temperature is stated: none can be told."""
    candidates = diagnosed(INERTIA, SHARED).candidates
    (judged,) = [candidate for candidate in candidates if candidate.name == "temperature"]
    assert (judged.score, judged.gain) == (0.0, None)


def test_adopt_adds_by_hand_whatever_the_evidence(measured: Measured, diagnosed: Diagnosed) -> None:
    campaign = measured(INERTIA, SHARED)
    adopted = asked(campaign, adopt=("inertia",))
    assert adopted.verdict == "consistent"
    assert "inertia" in adopted.result.model.effects
    assert adopted.result.model.values["inertia.mass"] == pytest.approx(0.06, rel=0.05)
    needless = asked(measured({}, SHARED), adopt=("viscous",))
    assert needless.verdict == "consistent"
    assert needless.result.model.effects == (*BASE, "viscous")


def test_without_leaves_an_effect_out(measured: Measured) -> None:
    diagnosis = asked(measured(INERTIA, SHARED), without=("inertia",))
    assert "inertia" not in names(diagnosis)
    assert "inertia" not in {judged.name for judged in diagnosis.candidates}
    assert all("inertia" not in (*effect.alternatives, *effect.richer) for effect in diagnosis.effects)
    assert diagnosis.verdict != "consistent"


def test_no_effects_allowed_names_nothing_and_still_sees_the_gap(measured: Measured) -> None:
    diagnosis = asked(measured(INERTIA, SHARED), max_effects=0)
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.effects == ()
    assert diagnosis.after is diagnosis.before
    assert diagnosis.where


def test_one_of_two_is_partly_or_less(measured: Measured) -> None:
    diagnosis = asked(measured(TWO, SHARED), max_effects=1)
    assert diagnosis.verdict in ("partly", "unexplained", "described")
    assert len(diagnosis.result.model.effects) <= 4
    assert diagnosis.remainder or diagnosis.verdict == "described"


def test_a_gap_within_tolerance_is_no_gap(measured: Measured) -> None:
    diagnosis = asked(measured(INERTIA, SHARED), tolerance=0.5)
    assert diagnosis.verdict == "consistent"
    assert diagnosis.effects == ()


@pytest.mark.parametrize("seed", range(6))
def test_chance_alone_names_nothing_however_small_a_gap_counts(measured: Measured, seed: int) -> None:
    """The thresholds hold without the tolerance: something always fits noise a little."""
    diagnosis = asked(measured({}, SHARED, seed), tolerance=0.0)
    assert max(judged.score for judged in diagnosis.candidates) > 1.0
    assert diagnosis.effects == ()


def test_a_search_made_again_passes_over_what_fell_far_behind(measured: Measured, fitted: Fitted) -> None:
    plain = fitted(measured(INERTIA, SHARED))
    whole = Search.begin(plain, Settings(), plain.model.values, (), {})
    again = whole.without_part(plain, 1)
    assert again.settings.max_effects == 1 < whole.settings.max_effects
    foremost = {claim.name for claim in whole.first.proposed[:3]}
    behind = {candidate.name for candidate in whole.first.tried if candidate.left} - foremost
    assert behind
    refitted = {candidate.name for candidate in whole.first.tried}
    assert {candidate.name for candidate in again.first.tried} == refitted - behind
    best, same = whole.first.best, again.first.best
    assert best
    assert same
    assert same.name == best.name == "inertia"
    assert same.evidence.chi_square == pytest.approx(best.evidence.chi_square, abs=0.05)


def test_a_wrong_name_is_exchanged_for_the_right_one(measured: Measured, fitted: Fitted) -> None:
    """The mass is there and the dashpot was added."""
    campaign = measured(INERTIA, SHARED)
    plain, wrong = fitted(campaign), fitted(campaign, "viscous")
    search = Search.begin(plain, Settings(), plain.model.values, (), {})
    found, added = search.exchange(wrong, ["viscous"])
    (step,) = search.steps(found, added)
    print(f"chi-square {wrong.chi_square:.0f} with viscous, {found.chi_square:.0f} with {added}")
    assert added == [step.name] == ["inertia"]
    assert found.chi_square < wrong.chi_square
    assert step.gain == pytest.approx(plain.chi_square - found.chi_square)


def test_what_belongs_to_another_direction_has_no_sensitivity_there(measured: Measured, fitted: Fitted) -> None:
    plain = fitted(measured(INERTIA, SHARED))
    effect = effect_named("stiffness_factor.radial")
    _, (column,) = sensitivity(plain.model, plain.data_sets, effect)
    there = {(str(data_set.direction), bool(np.any(column[place]))) for data_set, place in plain.place.items()}
    assert there == {("axial", False), ("radial", True)}


class Gapped:
    """A test that answers the stiffness of a stop, and nothing finite where its gap is wide."""

    direction, frequency, amplitude = "axial", np.array([5.0, 50.0]), np.array([1e-4, 1e-3])

    def residual(self, model: Model, values: Values | None = None) -> Array:
        if "bump_stop" not in model.effects:
            return np.array([3.0])
        values = values or model.values
        return np.where(values["bump_stop.gap"] > 5e-4, np.nan, 3.0 + 2.0 * values["bump_stop.stiffness"])


def test_shapes_without_a_response_are_left_out(paper_model: Model) -> None:
    """The widest gap, at which no stop is asked for its stiffness either, is one of them."""
    stop = effect_named("bump_stop")
    shapes, columns = sensitivity(paper_model, cast(Sequence[DataSet], [Gapped()]), stop)
    assert 0 < len(shapes) == len(columns)
    assert all(shape["bump_stop.gap"] <= 5e-4 for shape in shapes)
    np.testing.assert_allclose(columns, 2.0 * stop.amount.typical, rtol=1e-6)
