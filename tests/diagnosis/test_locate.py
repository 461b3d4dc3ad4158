"""Where: the sentences name direction, part, trend and level of what was put there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rigged import LEVELS, SHARED, Diagnosed, Fitted, Measured, changed, cut

from bushfit.diagnosis.locate import largest_smooth_misfit, locate
from bushfit.diagnosis.record import Where


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


@pytest.mark.parametrize(
    ("effect", "key", "size", "direction", "component", "way", "trend"),
    [
        ("inertia", "mass", 0.06, "axial", "storage", "below", "the square of frequency"),
        ("delay", "tau", 1e-4, "axial", "loss", "below", "in proportion to frequency"),
        ("delay", "tau", 1e-4, "radial", "loss", "below", "in proportion to frequency"),
    ],
)
def test_trends(
    diagnosed: Diagnosed, effect: str, key: str, size: float, direction: str, component: str, way: str, trend: str
) -> None:
    where = one(diagnosed({effect: {key: size}}, SHARED).where, direction, component)
    part = {"storage": "stiffness", "loss": "loss"}[component]
    assert where.reading.startswith(f"measured {direction} {part} is up to ")
    assert f"% of |K| {way} the model" in where.reading
    assert trend in where.reading
    assert "at every amplitude" in where.reading
    assert where.frequency[1] == pytest.approx(155.0)
    assert where.frequency[0] > 90.0
    assert where.amplitude == pytest.approx((LEVELS[0], LEVELS[-1]))


def test_the_worst_comes_first_and_all_are_real(diagnosed: Diagnosed) -> None:
    found = diagnosed({"delay": {"tau": 1e-4}}, SHARED).where
    excess = [where.excess for where in found]
    assert excess == sorted(excess, reverse=True)
    assert len(found) > 2
    assert min(excess) > 2.0


@pytest.mark.slow
def test_slip_shows_at_the_smallest_amplitude_and_in_odd_harmonics(diagnosed: Diagnosed) -> None:
    found = diagnosed({"interface_slip": {"force": 6.0}}, SHARED).where
    loss = one(found, "axial", "loss")
    assert loss.amplitude == pytest.approx((LEVELS[0], LEVELS[0]))
    assert "at 0.1 mm" in loss.reading
    loops = [where for where in found if where.kind == "loop"]
    assert any("third harmonic" in where.reading for where in loops)


@pytest.mark.parametrize(
    ("effect", "key", "size", "words"),
    [
        ("force_offset", "offset", 15.0, "a constant force"),
        pytest.param("asymmetry", "c2", 2.0, "a constant force", marks=pytest.mark.slow),
    ],
)
def test_loops_alone(diagnosed: Diagnosed, effect: str, key: str, size: float, words: str) -> None:
    found = diagnosed({effect: {key: size}}, SHARED).where
    print("; ".join(where.reading for where in found))
    assert {where.kind for where in found} == {"loop"}
    assert all(words in where.reading for where in found)


def test_a_level_off_by_itself_is_the_level_that_is_read(measured: Measured, fitted: Fitted) -> None:
    campaign = measured(plan=SHARED)
    level = campaign.sweeps[1].amplitude == LEVELS[1]
    where = one(locate(fitted(changed(campaign, 1, np.where(level, 1.06, 1.0)))), "radial", "storage")
    assert "at 0.2 mm" in where.reading
    assert "above the model" in where.reading
    assert "much the same at every frequency" in where.reading
    assert where.amplitude == pytest.approx((LEVELS[1], LEVELS[1]))


def test_levels_may_have_different_points(measured: Measured, fitted: Fitted) -> None:
    campaign = measured({"inertia": {"mass": 0.06}}, SHARED)
    gone = (campaign.sweeps[0].amplitude == LEVELS[0]) & (campaign.sweeps[0].frequency > 100.0)
    sweeps = (cut(campaign.sweeps[0], ~gone), campaign.sweeps[1])
    found = locate(fitted(replace(campaign, sweeps=sweeps)))
    assert "the square of frequency" in one(found, "axial", "storage").reading


def test_a_region_that_lies_on_either_side_of_the_model_says_so(measured: Measured, fitted: Fitted) -> None:
    """One level above, another below: the sentence names both, as the map shows them."""
    campaign = measured(plan=SHARED)
    amplitude = campaign.sweeps[1].amplitude
    off = np.where(amplitude == LEVELS[0], 1.06, np.where(amplitude == LEVELS[2], 0.95, 1.0))
    reading = one(locate(fitted(changed(campaign, 1, off))), "radial", "storage").reading
    print(reading)
    assert "above the model" in reading
    assert "most at 0.1 mm, there much the same at every frequency" in reading
    assert reading.endswith("; below it at 0.5 mm")
