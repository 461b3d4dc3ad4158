"""Where: the sentences name direction, part, trend and level of what was put there; held-out gaps are a refit's."""

from collections.abc import Callable

import numpy as np
import pytest
from rigged import INERTIA, LEVELS, SHARED, SLIP, TWO, Effects

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


def test_a_clean_campaign_has_no_place(measured, fitted):
    assert find_regions(fitted(measured(plan=SHARED))) == ()


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
    assert where.reading.startswith(f"measured {direction} {part} is up to ")
    assert "% of |K| below the model" in where.reading
    assert trend in where.reading
    assert max(len(sentence.split()) for sentence in where.reading.split(". ")) <= 25
    assert "at every amplitude" in where.reading
    assert where.frequency[1] == pytest.approx(155.0)
    assert where.frequency[0] > 90.0
    assert where.amplitude == pytest.approx((LEVELS[0], LEVELS[-1]))


def test_slip_shows_at_the_smallest_amplitude_and_in_odd_harmonics(where_of):
    found = where_of(SLIP)
    loss = one(found, "axial", "loss")
    assert loss.amplitude == pytest.approx((LEVELS[0], LEVELS[0]))
    assert "at 0.1 mm" in loss.reading
    assert any("third harmonic" in where.reading for where in found if where.kind == "loop")


@pytest.mark.parametrize(
    ("effects", "reading"),
    [({"force_offset": {"offset": 15.0}}, "a constant force"), ({"asymmetry": {"c2": 2.0}}, "second harmonic")],
)
def test_loops_alone(where_of, effects, reading):
    found = where_of(effects)
    assert {where.kind for where in found} == {"loop"}
    assert all(reading in where.reading for where in found), found


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
    refitted = fit_model(evidence.model, part.rest(evidence.data_sets), (), {}).model
    expected = np.sqrt(np.mean(residual(refitted, evidence.data_sets)[part.rows(evidence.data_sets)] ** 2))
    as_fitted = np.sqrt(np.mean(evidence.residual[part.rows(evidence.data_sets)] ** 2))
    # the parts of a block that is cut in two share an error, which whitening then treats apart
    assert found.after == pytest.approx(expected, rel=0.05)
    assert effects or "third" not in which or found.after > 1.05 * as_fitted


def test_the_prediction_s_own_error_is_that_of_a_sandwich_of_runs_and_loops(measured, fitted):
    """In full, by parameters: A^-1 M A^-1, M of what each run and each loop of the rest pulls, and at least A."""
    evidence, which = fitted(measured(INERTIA, SHARED)), "amplitude level 3"
    (found,) = [part for part in hold_out(evidence, evidence, {}).parts if part.part == which]
    rows = next(part for part in hold_out_parts(evidence.data_sets) if part.name == which).rows(evidence.data_sets)
    slopes, left = evidence.jacobian, evidence.residual
    pairs = [
        (data, getattr(data, "held_value", np.zeros(data.size // data.residuals_per_point)))
        for data in evidence.data_sets
    ]
    lines = np.concatenate([np.tile(held, data.residuals_per_point) for data, held in pairs])
    tests = np.repeat(np.arange(len(pairs)), [data.size for data, _ in pairs])
    root = np.linalg.inv(np.linalg.cholesky(slopes[:, ~rows] @ slopes[:, ~rows].T))
    left = left - slopes.T @ (root.T @ root @ slopes[:, ~rows] @ left[~rows])
    groups = {(test, line): (tests == test) & (lines == line) & ~rows for test, line in zip(tests, lines, strict=True)}
    pulls = np.array([root @ slopes[:, group] @ left[group] for group in groups.values()])
    size, vectors = np.linalg.eigh(pulls.T @ pulls)
    error = slopes[:, rows].T @ root.T @ vectors * np.sqrt(np.maximum(size, 1.0))
    whole = np.eye(int(rows.sum())) + error @ error.T
    expected = np.sqrt(left[rows] @ np.linalg.solve(whole, left[rows]) / len(whole))
    assert found.whitened == pytest.approx((expected, expected), rel=1e-6)
