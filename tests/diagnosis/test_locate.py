"""Where: the sentences name direction, part, trend and level of what was put there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from asking import INERTIA, SLIP
from rigged import LEVELS, SHARED, Effects, Fitted, Measured, both, cut, off

from bushfit.diagnosis.locate import largest_smooth_misfit, locate
from bushfit.diagnosis.record import Where

DELAY = {"delay": {"tau": 1e-4}}


def one(found: tuple[Where, ...], direction: str, component: str) -> Where:
    """The region of a direction and a part."""
    (where,) = [where for where in found if (where.direction, where.component) == (direction, component)]
    print(f"{where.excess:.1f} x noise: {where.reading}")
    return where


def test_a_clean_campaign_has_no_place(measured: Measured, fitted: Fitted) -> None:
    evidence = fitted(measured(plan=SHARED))
    print(f"largest smooth misfit {100 * largest_smooth_misfit(evidence):.2f} %")
    assert locate(evidence) == ()
    assert largest_smooth_misfit(evidence) < 0.01


@pytest.fixture(scope="module")
def where_of(measured: Measured, fitted: Fitted) -> Callable[[Effects], tuple[Where, ...]]:
    return lambda effects: locate(fitted(measured(effects, SHARED)))


@pytest.mark.parametrize(
    ("effects", "direction", "component", "trend"),
    [
        (INERTIA, "axial", "storage", "the square of frequency"),
        (DELAY, "axial", "loss", "in proportion to frequency"),
        (DELAY, "radial", "loss", "in proportion to frequency"),
    ],
)
def test_trends(
    where_of: Callable[[Effects], tuple[Where, ...]], effects: Effects, direction: str, component: str, trend: str
) -> None:
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
    assert "at every amplitude" in where.reading
    assert where.frequency[1] == pytest.approx(155.0)
    assert where.frequency[0] > 90.0
    assert where.amplitude == pytest.approx((LEVELS[0], LEVELS[-1]))


def test_slip_shows_at_the_smallest_amplitude_and_in_odd_harmonics(
    where_of: Callable[[Effects], tuple[Where, ...]],
) -> None:
    found = where_of(SLIP)
    loss = one(found, "axial", "loss")
    assert loss.amplitude == pytest.approx((LEVELS[0], LEVELS[0]))
    assert "at 0.1 mm" in loss.reading
    assert any("third harmonic" in where.reading for where in found if where.kind == "loop")


@pytest.mark.parametrize("effects", [{"force_offset": {"offset": 15.0}}, {"asymmetry": {"c2": 2.0}}])
def test_loops_alone(where_of: Callable[[Effects], tuple[Where, ...]], effects: Effects) -> None:
    found = where_of(effects)
    assert {where.kind for where in found} == {"loop"}
    assert all("a constant force" in where.reading for where in found)


def test_a_level_off_by_itself_is_the_level_that_is_read(measured: Measured, fitted: Fitted) -> None:
    where = one(locate(fitted(off(1, 1.06, amplitude=LEVELS[1])(measured(plan=SHARED)))), "radial", "storage")
    assert "at 0.2 mm" in where.reading
    assert "above the model" in where.reading
    assert "much the same at every frequency" in where.reading
    assert where.amplitude == pytest.approx((LEVELS[1], LEVELS[1]))


def test_levels_may_have_different_points(measured: Measured, fitted: Fitted) -> None:
    campaign = measured(INERTIA, SHARED)
    gone = (campaign.sweeps[0].amplitude == LEVELS[0]) & (campaign.sweeps[0].frequency > 100.0)
    sweeps = (cut(campaign.sweeps[0], ~gone), campaign.sweeps[1])
    found = locate(fitted(replace(campaign, sweeps=sweeps)))
    assert "the square of frequency" in one(found, "axial", "storage").reading


def test_a_region_that_lies_on_either_side_of_the_model_says_so(measured: Measured, fitted: Fitted) -> None:
    """One level above, another below: the sentence names both, as the map shows them."""
    tampered = both(off(1, 1.06, amplitude=LEVELS[0]), off(1, 0.95, amplitude=LEVELS[2]))(measured(plan=SHARED))
    reading = one(locate(fitted(tampered)), "radial", "storage").reading
    assert "above the model" in reading
    assert "most at 0.1 mm, there much the same at every frequency" in reading
    assert reading.endswith("; below it at 0.5 mm")
