"""Where: the sentences name direction, part, trend and level of what was put there; held-out gaps are a refit's."""

from collections.abc import Callable

import numpy as np
import pytest
from rigged import INERTIA, LEVELS, SHARED, TWO, Effects

from bushfit.diagnosis.fits import fit_model
from bushfit.diagnosis.holdout import hold_out, hold_out_parts
from bushfit.diagnosis.locate import find_regions
from bushfit.diagnosis.record import MisfitRegion
from tests.fits import residual

DELAY = {"delay": {"tau": 1e-4}}
#: A mass that bends a plain model far.
HEAVY = {"inertia": {"mass": 0.2}}


def one(found: tuple[MisfitRegion, ...], direction: str, component: str) -> MisfitRegion:
    """The region of a direction and a part."""
    (where,) = [where for where in found if (where.direction, where.component) == (direction, component)]
    return where


@pytest.fixture(scope="module")
def where_of(measured, fitted) -> Callable[[Effects], tuple[MisfitRegion, ...]]:
    return lambda effects: find_regions(fitted(measured(effects, SHARED)))


@pytest.mark.parametrize(
    ("effects", "direction", "component", "trend"),
    [
        (INERTIA, "axial", "storage", "the square of frequency"),
        (DELAY, "axial", "loss", "in proportion to frequency"),
        (DELAY, "radial", "loss", "in proportion to frequency"),
    ],
)
def test_trends(where_of, effects, direction, component, trend):
    """The worst comes first, and all are real."""
    found = where_of(effects)
    excess = [where.excess for where in found]
    assert excess == sorted(excess, reverse=True)
    assert min(excess) > 2.0
    where = one(found, direction, component)
    part = {"storage": "stiffness", "loss": "loss"}[component]
    assert where.sentence.startswith(f"measured {direction} {part} is up to ")
    assert "% of |K| below the model" in where.sentence
    assert trend in where.sentence
    assert max(len(sentence.split()) for sentence in where.sentence.split(". ")) <= 25
    assert "at every amplitude" in where.sentence
    assert where.frequency[1] == pytest.approx(155.0)
    assert where.frequency[0] > 90.0
    assert where.amplitude == pytest.approx((LEVELS[0], LEVELS[-1]))


@pytest.mark.parametrize(
    ("effects", "reading"),
    [({"force_offset": {"offset": 15.0}}, "a constant force"), ({"asymmetry": {"c2": 2.0}}, "second harmonic")],
)
def test_loops_alone(where_of, effects, reading):
    found = where_of(effects)
    assert {where.kind for where in found} == {"loop"}
    assert all(reading in where.sentence for where in found), found


@pytest.mark.parametrize(
    ("hidden", "effects", "which"),
    [
        *((INERTIA, ("inertia",), which) for which in ("top third of the frequencies", "amplitude level 3")),
        *((INERTIA, (), which) for which in ("top third of the frequencies", "loop loop_axial_1")),
        (HEAVY, ("viscous",), "radial direction"),
        (TWO, (), "loop loop_axial_1"),
    ],
    ids=["right", "right level", "lacking", "lacking loop", "far", "far loop"],
)
def test_the_gap_is_that_of_a_refit(measured, fitted, hidden, effects, which):
    """Of the right model, and of one that has far to go without the part: one step would miss the last two by 60 and
    30 %."""
    evidence = fitted(measured(hidden, SHARED), *effects)
    (found,) = [part for part in hold_out(evidence, evidence, {}).parts if part.part == which]
    (part,) = [part for part in hold_out_parts(evidence.data_sets) if part.name == which]
    refitted = fit_model(evidence.model, part.remaining_tests(evidence.data_sets), (), {}).model
    expected = np.sqrt(np.mean(residual(refitted, evidence.data_sets)[part.rows(evidence.data_sets)] ** 2))
    as_fitted = np.sqrt(np.mean(evidence.residual[part.rows(evidence.data_sets)] ** 2))
    # the parts of a block that is cut in two share an error, which whitening then treats apart
    assert found.after == pytest.approx(expected, rel=0.05)
    assert effects or "third" not in which or found.after > 1.05 * as_fitted
