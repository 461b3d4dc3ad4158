"""Hidden campaigns: the same for the same seed, what is hidden visible, what a recipe changes as large as it says."""

from __future__ import annotations

import numpy as np
import pytest
from cards.awkward import AWKWARD
from cards.families import RECIPES, campaign_of, tasks
from cards.faults import FAULTS
from cards.hidden import hidden_campaign
from cards.mistaken import mistaken_campaign
from cards.outcome import Task
from cards.outside import OUTSIDE_LAWS
from cards.recipe import Recipe, cooked

from bushfit.effects import BASE
from bushfit.effects.mistakes import MISTAKES
from bushfit.geometry import ROTATION, Direction
from bushfit.model.model import FIVE
from bushfit.reading.measurement import Loop
from bushfit.simulation.measured import Simulated

SEED = 4


@pytest.fixture(scope="module")
def plain() -> Simulated:
    return cooked(Recipe("as planned"), SEED)[0]


def changes(one: Simulated, other: Simulated) -> list[float]:
    """Largest change of each sweep relative to |K|, and of each loop relative to half the range of its force."""
    swept = [
        np.max(np.abs(a.stiffness - b.stiffness) / np.abs(b.stiffness))
        for a, b in zip(one.sweeps, other.sweeps, strict=True)
    ]
    looped = [
        2.0 * np.max(np.abs(a.force - b.force)) / np.ptp(b.force) for a, b in zip(one.loops, other.loops, strict=True)
    ]
    return [float(change) for change in (*swept, *looped)]


@pytest.mark.parametrize(
    "task", [Task("law", SEED, (), "rate_threshold"), Task("single", 3, ("inertia",)), Task("clean", 2, ())]
)
def test_the_same_seed_makes_the_same_campaign(task: Task) -> None:
    (one, sealed), (same, again) = campaign_of(task), campaign_of(task)
    assert sealed == again
    assert max(changes(one, same)) == 0.0
    assert one.campaign().simulate is None
    if task.kind == "clean":
        assert (sealed.hidden, sealed.visible, one.truth.effects) == ((), 0.0, BASE)


@pytest.mark.parametrize("hidden", [("inertia",), ("viscous", "force_offset")])
def test_what_is_hidden_is_in_the_truth_and_visible(hidden: tuple[str, ...]) -> None:
    simulated, sealed = hidden_campaign(1, hidden)
    assert {*simulated.truth.effects} == {*BASE, *hidden}
    assert {name.partition(".")[0] for name in sealed.values} - set(FIVE) == set(hidden)
    assert sealed.visible > 0.01
    assert dict(simulated.truth.values) == sealed.values


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


@pytest.mark.slow
@pytest.mark.parametrize("name", [*FAULTS, *OUTSIDE_LAWS])
def test_what_is_wrong_shows_about_as_large_as_asked(name: str, plain: Simulated) -> None:
    made, sealed = cooked({**FAULTS, **OUTSIDE_LAWS}[name], SEED)
    found = changes(made, plain)
    print(name, sealed.visible, found)
    if name == "loop_rate":
        assert max(found) == 0.0
        assert any(a.time[-1] != b.time[-1] for a, b in zip(made.loops, plain.loops, strict=True))
    elif name == "force_saturation":
        assert 0.002 < max(found[:2]) < 0.2
        assert max(found[2:]) == 0.0
    else:
        assert 0.3 * sealed.visible < max(found) < 4.0 * sealed.visible
    assert dict(made.truth.values) == dict(plain.truth.values) == dict(sealed.values)


@pytest.mark.parametrize("name", ["coloured_noise_98", "low_pass_noise"])
def test_coloured_noise_depends_on_the_row_before(name: str) -> None:
    silent = Recipe("silent", plan=AWKWARD[name].plan)
    loop, quiet = (cooked(recipe, SEED)[0].loops[0] for recipe in (AWKWARD[name], silent))
    noise = loop.force - quiet.force
    assert 0.002 < noise.std() / (np.ptp(quiet.force) / 2.0) < 0.004
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] > 0.97


def test_every_kind_of_a_family_has_its_turn() -> None:
    for family, kind in (("awkward", "awkward"), ("faults", "fault"), ("outside", "law")):
        made = [task for task in tasks(60, 8001, family) if task.kind == kind]  # type: ignore[arg-type]
        assert {task.outside for task in made} == set(RECIPES[kind])
    mistaken = tasks(500, 1, "mistakes")
    assert {task.hidden[0] for task in mistaken if task.hidden} == set(MISTAKES)
    for family, at_once in (("library", {1, 2}), ("outside", {0, 3}), ("mistakes", {0, 1})):
        assert {len(task.hidden) for task in tasks(80, 8001, family)} == at_once  # type: ignore[arg-type]
