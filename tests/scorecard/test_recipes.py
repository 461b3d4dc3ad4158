"""Campaigns by recipe: what is changed shows as it says, and nothing else; laws outside the library stay outside."""

from __future__ import annotations

import numpy as np
import pytest
from cards.awkward import AWKWARD
from cards.families import RECIPES, campaign_of, tasks
from cards.faults import FAULTS, band
from cards.outcome import Task
from cards.outside import LAWS, OUTSIDE_LAWS
from cards.recipe import Recipe, cooked

from bushfit.effects import LIBRARY
from bushfit.effects.history import History
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


@pytest.mark.parametrize("name", ["preload", "transducer_gain", "compliance", "repeat_differs", "mislabelled_level"])
def test_faults_of_one_direction_leave_the_other_alone(name: str, plain: Simulated) -> None:
    axial, radial, *_ = changes(cooked(FAULTS[name], SEED)[0], plain)
    assert min(axial, radial) == 0.0 < max(axial, radial)


def test_the_same_seed_makes_the_same_campaign() -> None:
    task = Task("law", SEED, (), "rate_threshold")
    (one, sealed), (same, again) = campaign_of(task), campaign_of(task)
    assert sealed == again
    assert max(changes(one, same)) == 0.0


def test_no_law_outside_the_library_is_in_it() -> None:
    assert not {name for name, *_ in LAWS} & set(LIBRARY)
    assert all(sentence for _, sentence, _ in LAWS)
    assert {name for recipe in FAULTS.values() for name in recipe.truths} >= {
        "delay",
        "rig_compliance.radial",
        "high_pass",
    }


@pytest.mark.parametrize("name", ["coloured_noise_98", "low_pass_noise"])
def test_coloured_noise_depends_on_the_row_before(name: str) -> None:
    silent = Recipe("silent", plan=AWKWARD[name].plan)
    loop, quiet = (cooked(recipe, SEED)[0].loops[0] for recipe in (AWKWARD[name], silent))
    noise = loop.force - quiet.force
    assert 0.002 < noise.std() / (np.ptp(quiet.force) / 2.0) < 0.004
    assert np.corrcoef(noise[1:], noise[:-1])[0, 1] > 0.97


@pytest.mark.parametrize("name", ["wild_point", "level_errors_one", "heavy_tails", "low_frequency_scatter"])
def test_awkward_campaigns_differ_by_noise_alone(name: str) -> None:
    silent = Recipe("silent", plan=AWKWARD[name].plan)
    largest = changes(cooked(AWKWARD[name], SEED)[0], cooked(silent, SEED)[0])
    print(name, largest)
    assert 0.001 < max(largest[:2]) < 0.12


def test_plans_are_as_the_kinds_say() -> None:
    made = {name: cooked(AWKWARD[name], SEED)[0] for name in ("one_direction", "three_frequencies", "strain_sweeps")}
    assert len(made["one_direction"].sweeps) == 1
    assert len(np.unique(made["three_frequencies"].sweeps[0].frequency)) == 3
    assert made["strain_sweeps"].sweeps[0].stepped == "amplitude"
    assert made["strain_sweeps"].sweeps[0].reached is not None


def test_a_band_passes_its_centre_alone() -> None:
    for frequency, least, most in ((50.0, 0.97, 1.03), (20.0, 0.0, 0.1), (150.0, 0.0, 0.1)):
        wave = np.sin(2.0 * np.pi * np.arange(40 * 512) / 512)
        passed = band(History(wave, 1.0 / (512 * frequency), False, frequency), 50.0, 2.0)
        assert least <= np.abs(passed[-512:]).max() <= most


def test_every_kind_of_a_family_has_its_turn() -> None:
    for family, kind in (("awkward", "awkward"), ("faults", "fault"), ("outside", "law")):
        made = [task for task in tasks(60, 8001, family) if task.kind == kind]  # type: ignore[arg-type]
        assert {task.outside for task in made} == set(RECIPES[kind])
    library = tasks(80, 8001, "library")
    assert {len(task.hidden) for task in library} == {1, 2}
    assert all(len(task.hidden) == 3 for task in tasks(40, 8001, "outside") if task.kind == "three")
