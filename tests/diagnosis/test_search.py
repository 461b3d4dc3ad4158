"""The search weighs sets of explanations: the true causes are the most probable, alone and together, in any order."""

import re
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest
from rigged import (
    FREQUENCIES,
    INERTIA,
    LEVELS,
    PLAN,
    SHARED,
    SHOW_MASS,
    SLIP,
    SMALLER,
    TWO,
    asked,
    both,
    changed,
    loop_too_strong,
    names,
    off,
    repeated_loop_too_strong,
    said,
)

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep
from bushfit.effects import BASE
from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.reading.preload import Preload
from bushfit.simulation.exact import simulate_exact
from bushfit.simulation.measured import measure

level_too_stiff = off(0, 1.05, amplitude=LEVELS[1])
#: The second sweep, at its smallest level, or as a whole (as by a preload) and once more at its largest level.
smallest_too_stiff = off(1, 1.06, amplitude=LEVELS[0])
largest_too_stiff = both(off(1, 1.1), off(1, 1.04, amplitude=LEVELS[2]))


def test_a_candidate_that_cannot_be_simulated_without_one_of_its_effects_is_left_out(measured, monkeypatch):
    monkeypatch.setattr("bushfit.diagnosis.hypotheses.laplace", Mock(side_effect=ModelError("too compliant")))
    assert asked(measured(INERTIA, SHARED)).verdict == "described"


@pytest.mark.parametrize(("tamper", "level"), [(smallest_too_stiff, "0.1"), (largest_too_stiff, "0.5")])
def test_a_level_under_one_of_two_preloads_is_measured_again(measured, tamper, level):
    """The smallest level could be friction, but a level alone is off; the rubber was softened before the tests."""
    axial = [
        replace(measured(seed=seed).sweeps[0], name=f"{seed}", preload=Preload(500.0 * seed, "N")) for seed in (0, 1)
    ]
    campaign = replace(measured(), loops=(), sweeps=tuple(axial))
    diagnosis = asked(tamper(campaign), without=("mullins_levels",))
    assert diagnosis.verdict == "unexplained"
    assert f"measure again: the axial level {level} mm at a preload of 500 N" in diagnosis.next_test


@pytest.mark.parametrize(
    ("levels", "loops", "seed"),
    [((3e-4,), (), 1), ((3e-4,), (8e-4,), 5), ((), (2e-4, 1e-3), 4)],
    ids=["level", "loop", "loops"],
)
def test_temperature_is_named_even_if_the_tests_determine_one_combination_of_its_parameters(
    paper_model, levels, loops, seed
):
    """One level or one frequency cannot tell a softer rubber from a faster one."""
    warm = paper_model.with_effect("temperature", {"temperature.softening": 0.006, "temperature.shift": 0.03})
    degrees, of_loops = (283.15, 296.15, 313.15), (283.15, 296.15, 313.15) if not levels else (296.15,)
    plan = replace(
        PLAN,
        repeats=1 if seed == 1 else 2,
        gain_error=2e-3,
        loops=tuple(
            SimulatedLoop(Direction.AXIAL, x, 0.1, cycles=3, temperature=kelvin) for kelvin in of_loops for x in loops
        ),
        sweeps=tuple(
            SimulatedSweep(Direction.AXIAL, levels, FREQUENCIES, temperature=kelvin) for kelvin in degrees if levels
        ),
    )
    diagnosis = asked(measure(simulate_exact(warm, plan), replace(plan, seed=seed)).campaign())
    assert "temperature" in names(diagnosis)


@pytest.mark.parametrize(
    "truth", [TWO, *(pytest.param(one, marks=pytest.mark.slow) for one in (INERTIA, SLIP))], ids="+".join
)
def test_what_is_there_is_all_but_sure(diagnosed, truth):
    """A mass is no fixture resonance far above, which fits as well and says more; slip is no fault of one level."""
    diagnosis = diagnosed(truth, SHARED)
    assert diagnosis.verdict == "named"
    assert names(diagnosis) == set(truth)
    assert diagnosis.odds.nothing < 1e-6
    assert {*diagnosis.odds.labels[0]} == set(truth)
    assert diagnosis.odds.explanations[0][1] > 0.97
    assert diagnosis.result.model.effects[:3] == BASE
    assert diagnosis.calibration[1] < 1.1 < 1.2 < diagnosis.calibration[0]


@pytest.mark.parametrize(
    ("tamper", "place"),
    [(level_too_stiff, "the axial level 0.2 mm"), (repeated_loop_too_strong, "the loop loop_axial_3")],
    ids=["level", "loop"],
)
def test_what_one_place_alone_shows_is_to_be_measured_again(measured, tamper, place):
    """However far the levels' own errors could stretch; the other sorts of places stand in test_explanations.py."""
    diagnosis = asked(tamper(measured(plan=SHARED)))
    assert said(diagnosis) == "unexplained "
    assert diagnosis.after is diagnosis.before
    assert place in diagnosis.summary
    assert re.match(rf"{re.escape(place)}: a deviation of [\d.]+ % from all other tests", diagnosis.where[0].sentence)
    assert diagnosis.next_test == f"measure again: {place}"
    assert diagnosis.odds.labels[0] == (f"fault: {place}",)


def test_a_loop_at_an_amplitude_of_its_own_may_deviate_by_a_law(measured):
    diagnosis = asked(loop_too_strong(measured(plan=SHARED)))
    assert said(diagnosis) == "described unnamed"
    assert diagnosis.summary.endswith("the gap is largest at the loop loop_axial_2")


def test_errors_of_every_level_within_the_class_are_nothing(measured):
    campaign, random = measured(plan=SHARED), np.random.default_rng(3)
    for number, sweep in enumerate(campaign.sweeps):
        levels, place = np.unique(sweep.amplitude, return_inverse=True)
        campaign = changed(campaign, number, (1.0 + 0.005 * random.standard_normal(levels.size))[place])
    assert asked(campaign).verdict == "consistent"


@pytest.mark.parametrize(
    ("effects", "factor", "loss"),
    [({}, 1.04, "linear"), ({}, 1.04, "soft_l1"), pytest.param(SLIP, 1.15, "linear", marks=pytest.mark.slow)],
)
def test_a_wild_row_is_a_warning(measured, effects, factor, loss):
    """One row of 288 is left out and named by its number; it neither makes a gap nor hides one."""
    campaign = measured(effects, SHARED)
    campaign = replace(campaign, fit=replace(campaign.fit, loss=loss))
    sweep = campaign.sweeps[0]
    where = {"amplitude": LEVELS[1], "repeat": 2, "frequency": 65.0}
    row = int(np.flatnonzero(np.all([getattr(sweep, name) == value for name, value in where.items()], axis=0))[0]) + 1
    diagnosis = asked(off(0, factor, **where)(campaign))
    assert names(diagnosis) == set(effects)
    assert [entry.row for entry in diagnosis.result.outliers if entry.test == "sweep_axial"] == [row]
    (note,) = [note for note in map(str, diagnosis.notes) if f"row {row}" in note]
    assert "left out of the fit" in note


def wild(campaign: Campaign, frequencies: tuple[float, ...]) -> Campaign:
    """The smallest levels of both directions off by a sixth at these frequencies, in turn up and down."""
    for number, sweep in enumerate(campaign.sweeps):
        rows = np.flatnonzero((sweep.amplitude == sweep.amplitude.min()) & np.isin(sweep.frequency, frequencies))
        factor = np.ones(sweep.frequency.size)
        factor[rows] = 1.0 + np.where(np.arange(rows.size) % 2, -1 / 6, 1 / 6)
        campaign = changed(campaign, number, factor)
    return campaign


def test_hum_is_told_though_its_rows_are_left_out(measured):
    """At 65 Hz; whatever its phase in a run, so that no share of the stiffness is common to them."""
    diagnosis = asked(wild(measured({}, SHARED), (65.0,)))
    assert diagnosis.verdict == "unexplained"
    assert names(diagnosis) == set()
    assert "65 Hz in several directions" in diagnosis.summary
    assert diagnosis.where[0].frequency == (65.0, 65.0)
    assert diagnosis.where[0].excess > 3.0
    assert diagnosis.odds.nothing < 0.03


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(10, 18, 68), (12, 30, 50), (20, 30, 30)], ids=str)
def test_a_radial_stiffness_off_the_formula_is_not_blamed_on_the_rig(reference_shapes, paper_model, shape):
    """Radial stiffness as finite elements have it, on data that the effect itself did not make; 2 % are little enough
    for a rig that gives way to do the same."""
    model = replace(paper_model, bushing=Bushing("shape", *(1e-3 * length for length in shape)))
    ratio = reference_shapes[shape] / model.bushing.stiffness_per_modulus(Direction.RADIAL)
    campaign = measure(simulate_exact(model, PLAN, steps_per_cycle=512), SHARED).campaign()
    campaign = changed(campaign, 1, ratio)
    diagnosis = asked(campaign)
    (found,) = diagnosis.effects
    alike = {found.name, *(other.label for other in found.alternatives)}
    assert any("stiffness_factor.radial" in name.split(" + ") for name in alike)
    if diagnosis.verdict == "ambiguous":
        # a displacement gain is a near twin; where 2 % are off, so is what gives way
        assert ratio > 0.96 or alike == {"stiffness_factor.radial", "displacement_gain.radial"}
        return
    assert said(diagnosis) == "named stiffness_factor.radial"
    low, high = diagnosis.result.interval("stiffness_factor.radial") or (0.0, 0.0)
    assert low - 0.003 < ratio < high + 0.003


def test_a_branch_of_the_paper_that_a_model_lacks_is_named(measured, fitted):
    """What has no neutral logarithm to begin at begins at the amount that its score suggests."""
    campaign = measured({}, SHARED)
    lacking = Model.with_defaults(campaign.bushing, ("elastic", "friction"), {"eps_half": 0.01})
    diagnosis = asked(campaign, lacking)
    assert said(diagnosis) == "named springpot"
    assert dict(diagnosis.result.model.values) == pytest.approx(dict(fitted(campaign).model.values), rel=1e-2)


@pytest.mark.parametrize(
    ("part", "effects"),
    [
        *(("one direction", {}), ("one frequency", {})),
        *(pytest.param(part, INERTIA, marks=pytest.mark.slow) for part in SMALLER),
    ],
)
def test_with_less_no_bolder_name(measured, part, effects):
    found = asked(SMALLER[part](measured(effects, SHARED)))
    if effects and part in SHOW_MASS:  # with less, what has a mass as its limit is as likely
        assert said(found) == "named inertia" or found.verdict == "ambiguous"
        assert ("inertia",) in found.odds.labels
    else:
        assert said(found) == "consistent "
