"""Hidden campaigns: the same for the same seed, with what is hidden visible and everything else plausible."""

from __future__ import annotations

import numpy as np
import pytest
from cards.hidden import FIRST, hidden_campaign, hideable
from cards.mistaken import mistaken_campaign

from bushfit.effects import BASE
from bushfit.effects.mistakes import MISTAKES
from bushfit.geometry import ROTATION, Direction
from bushfit.model.model import FIVE
from bushfit.reading.measurement import Loop


def test_the_same_seed_makes_the_same_campaign() -> None:
    (one, sealed), (same, again), (_, other) = (hidden_campaign(seed, ("inertia",)) for seed in (3, 3, 4))
    assert sealed == again != other
    for mine, theirs in zip(one.sweeps, same.sweeps, strict=True):
        assert np.array_equal(mine.stiffness, theirs.stiffness)
    assert np.array_equal(one.loops[0].force, same.loops[0].force)


@pytest.mark.parametrize("hidden", [("inertia",), ("viscous", "force_offset")])
def test_what_is_hidden_is_in_the_truth_and_visible(hidden: tuple[str, ...]) -> None:
    simulated, sealed = hidden_campaign(1, hidden)
    assert simulated.truth.effects == (*BASE, *[name for name in simulated.truth.effects if name in hidden])
    assert {name.partition(".")[0] for name in sealed.values} - set(FIVE) == set(hidden)
    assert sealed.visible > 0.01
    assert dict(simulated.truth.values) == sealed.values


def test_a_clean_campaign_hides_nothing() -> None:
    simulated, sealed = hidden_campaign(2, ())
    assert (sealed.hidden, sealed.visible) == ((), 0.0)
    assert simulated.truth.effects == BASE
    assert simulated.campaign().simulate is None


def test_every_effect_but_the_paper_s_can_be_hidden() -> None:
    assert not set(hideable()) & set(BASE)
    assert set(FIRST) <= set(hideable())


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, mistake in MISTAKES.items() if mistake.kinds])
def test_a_mistake_mends_what_the_card_makes(name: str) -> None:
    """What is written into a file with a mistake is the clean test again, once it is mended."""
    turns = MISTAKES[name].motion is ROTATION
    directions = (Direction.AXIAL, Direction.TORSION if turns else Direction.RADIAL)
    (clean, _), (stated, sealed) = hidden_campaign(5, (), directions=directions), mistaken_campaign(5, name)
    names = {label.partition(":")[2] for label in sealed.hidden}
    assert names
    for true, made in zip((*clean.loops, *clean.sweeps), (*stated.loops, *stated.sweeps), strict=True):
        assert true.name == made.name
        mended = MISTAKES[name].mended(made) if made.name in names else made
        assert mended is not None
        assert mended.direction is true.direction
        columns = ("time", "displacement", "force") if isinstance(true, Loop) else ("amplitude", "stiffness")
        for column in columns:
            assert np.allclose(getattr(mended, column), getattr(true, column), rtol=1e-9)
            assert made.name in names or np.array_equal(getattr(made, column), getattr(true, column))
