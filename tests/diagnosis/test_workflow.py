"""The workflow: what is there is named, what is not is not, and with less data less is said."""

import json
from dataclasses import replace

import numpy as np
import pytest
from rigged import (
    INERTIA,
    PLAN,
    SHARED,
    asked,
    changed,
    missing_points,
    no_loops,
    no_repeats,
    no_sweeps,
    one_direction,
    one_frequency,
    one_level,
    one_loop,
    said,
)

from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import Model
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import undisturbed


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(10, 18, 68), (12, 30, 50), (20, 30, 30)], ids=str)
def test_a_radial_stiffness_off_the_formula_is_not_blamed_on_the_rig(reference_shapes, paper_model, shape):
    """Radial stiffness as finite elements have it, on data that the effect itself did not make; 2 % are little enough
    for a rig that gives way to do the same."""
    model = replace(paper_model, bushing=Bushing("shape", *(1e-3 * length for length in shape)))
    ratio = reference_shapes[shape] / model.bushing.stiffness_per_modulus(Direction.RADIAL)
    campaign = measure(undisturbed(model, PLAN, steps_per_cycle=512), SHARED).campaign()
    campaign = changed(campaign, 1, ratio)
    diagnosis = asked(campaign)
    (found,) = diagnosis.effects
    alike = {found.name, *found.alternatives}
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
    for name, value in fitted(campaign).model.values.items():
        assert diagnosis.result.model.values[name] == pytest.approx(value, rel=1e-2)


#: Sweeps of several frequencies show a mass; loops at 0.1 Hz and sweeps at 25 Hz do not.
SHOW_MASS = (no_loops, one_direction, no_repeats, missing_points, one_level)
CUTS = (*SHOW_MASS, no_sweeps, one_loop, one_frequency)


@pytest.mark.parametrize(
    ("part", "effects"),
    [(one_direction, {}), (one_frequency, {}), *(pytest.param(part, INERTIA, marks=pytest.mark.slow) for part in CUTS)],
)
def test_with_less_no_bolder_name(measured, part, effects):
    found = asked(part(measured(effects, SHARED)))
    if effects and part in SHOW_MASS:  # with less, what has a mass as its limit is as likely
        assert said(found) == "named inertia" or found.verdict == "ambiguous"
        assert "inertia" in {*found.odds.labels}
    else:
        assert said(found) == "consistent "


@pytest.mark.slow
def test_inputs_are_left_alone_and_the_same_comes_twice(measured):
    campaign = measured(INERTIA, SHARED)
    tests = [vars(test) for test in (*campaign.sweeps, *campaign.loops)]
    arrays = [array for test in tests for array in test.values() if isinstance(array, np.ndarray)]
    copies = [array.copy() for array in arrays]
    one, other = (json.dumps(diagnose(PreparedCampaign.from_campaign(campaign)).to_document()) for _ in range(2))
    assert one == other
    assert all(np.array_equal(array, copy) for array, copy in zip(arrays, copies, strict=True))
