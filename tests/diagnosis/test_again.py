"""A name is doubted where the tests without a part bring another one out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
from asking import INERTIA
from rigged import SHARED, Fitted, Measured

from bushfit.diagnosis.again import searched_again
from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.holdout import hold_out
from bushfit.diagnosis.record import Settings
from bushfit.diagnosis.search import Search


@pytest.mark.parametrize("case", ["nothing near", "a rival as good", "growth as good"])
def test_where_growth_misses_what_was_named_its_rivals_are_tried_if_one_comes_as_near(
    measured: Measured, fitted: Fitted, monkeypatch: pytest.MonkeyPatch, exchanged: list[Sequence[str]], case: str
) -> None:
    """The mass is there and was named; without each part growth goes astray and adds a dashpot: one that does nothing,
    or, told so, one that does as well."""
    campaign = measured(INERTIA, SHARED)
    plain, right = fitted(campaign), fitted(campaign, "inertia")
    search = Search.begin(plain, Settings(), plain.model.values, (), {})
    (step,) = search.steps(right, ["inertia"])
    assert not step.rivals
    if case == "a rival as good":  # a candidate in its place with the same prediction, in no set with it
        twin = replace(step.place.tried[0], name="loop_clock")
        step = replace(step, place=replace(step.place, tried=(*step.place.tried, twin)))

    def astray(anew: Search) -> tuple[Evidence, list[str]]:
        found = fit(right.model, anew.base.data_sets, (), {}) if case == "growth as good" else anew.base
        return found, ["viscous"]

    monkeypatch.setattr(Search, "grow", astray)
    again = searched_again(search, right, [step], hold_out(plain, right, {}))
    print(f"{len(again)} parts, {sum(each.came_again for each in again)} times again, exchanged in {len(exchanged)}")
    assert len(again) > 4
    assert all(each.came_again for each in again)
    begun = {"nothing near": [], "a rival as good": ["inertia"], "growth as good": ["viscous"]}[case]
    assert exchanged == [begun] * (len(again) if begun else 0)
