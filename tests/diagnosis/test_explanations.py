"""What explains a gap proposes itself: effects by sensitivity, places by their rows, curves by their covariance.

Scores of effects are what a linear refit would gain.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from rigged import LEVELS, SHARED, Fitted, Measured, Tamper, both, loop_too_strong, off

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import Explanation, unnamed_curves
from bushfit.diagnosis.faulty_places import faulty_places
from bushfit.diagnosis.linear_model import LinearModel
from bushfit.diagnosis.propose import proposals, scores
from bushfit.diagnosis.rig_errors import in_scatter_units, rig_errors
from bushfit.effects import BASE, LIBRARY
from bushfit.fitting.preparation import split_by_kind
from bushfit.gaussian_process import matern

SHARED_RIG = RigSettings(gain_error=4e-3, phase_error=3.5e-3)


def best(evidence: Evidence, every: Sequence[Explanation]) -> Explanation:
    """The one that makes the tests likeliest."""
    known = [each for each in every if each.group]
    groups = [each.group for each in known if each.group]
    rig = rig_errors(evidence, SHARED_RIG)
    solution = evidence.solution
    precision = np.zeros(len(solution.jacobian))
    worths = LinearModel(solution.residual, solution.jacobian, precision, rig, groups).group_evidence
    return max(zip(known, worths, strict=True), key=lambda pair: pair[1].log_evidence)[0]


@pytest.mark.parametrize(
    ("tamper", "kind", "words"),
    [
        (off(1, 1.0 + 0.05j, frequency=75.0), "frequency", "75 Hz in radial, at every amplitude"),
        (
            both(off(0, 1.0 + 0.05j, frequency=75.0), off(1, 1.0 + 0.05j, frequency=75.0)),
            "frequency",
            "75 Hz in all directions, at every amplitude",
        ),
        (off(0, 0.96, frequency=(65.0, 75.0)), "frequency", "65 to 75 Hz in axial, at every amplitude"),
        (off(0, 1.05, amplitude=LEVELS[1]), "level", "the axial level 0.2 mm"),
        (off(0, 1.1, amplitude=LEVELS[1], repeat=2), "repeat", "repeat 2 of the axial level 0.2 mm"),
        (off(1, 1.06, repeat=3), "repeat", "repeat 3 of the radial sweep sweep_radial"),
        (loop_too_strong, "loop", "the loop loop_axial_2"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_the_place_that_went_wrong_is_the_likeliest(
    measured: Measured, fitted: Fitted, tamper: Tamper, kind: str, words: str
) -> None:
    """Errors of the rig, of all sizes, are counted beside it."""
    evidence = in_scatter_units(fitted(tamper(measured(plan=SHARED))))
    found = best(evidence, faulty_places(evidence))
    assert (found.kind, found.family) == ("place", kind)
    assert found.name == words


def test_a_level_may_be_off_by_a_slope_over_the_logarithm_of_frequency(bare: Evidence) -> None:
    """From -1 to 1 times the shift, and nothing at other levels."""
    gain, _, slope, _ = next(place for place in faulty_places(bare) if place.family == "level").columns
    sweep = split_by_kind(bare.data_sets)[1][0]
    rows = bare.residual_rows[sweep].start + np.arange(sweep.frequency.size)
    touched = gain[rows] != 0.0
    expected = np.interp(np.log(sweep.frequency), np.log([sweep.frequency.min(), sweep.frequency.max()]), [-1.0, 1.0])
    assert np.count_nonzero(slope) == np.count_nonzero(gain)
    ratio = slope[rows][touched] / gain[rows][touched]
    assert np.ptp(ratio) == pytest.approx(2.0)
    assert np.ptp(ratio - expected[touched]) < 1e-9


def test_curves_have_unit_variance_and_fall_off_with_distance(bare: Evidence) -> None:
    """In shares of |K|, of one direction or of all, and of the loops their harmonics; a rough one as far as it goes."""
    made = {each.name: each for each in unnamed_curves(bare)}
    of_one = {f"{how} {where}" for how in ("smooth", "rough") for where in ("axial", "radial")}
    assert set(made) == of_one | {"rough all", "loops"}  # what is smooth in all is the compound's
    sweep = split_by_kind(bare.data_sets)[1][0]
    point = sweep.whiten(np.ones(sweep.frequency.size)).reshape(2, -1)[0]
    same = np.flatnonzero((sweep.amplitude == LEVELS[1]) & (sweep.repeat == 1))
    for how, length, short in (("smooth", 1.5, 0.1), ("rough", 0.5, 0.6)):
        group = made[f"{how} axial"].group
        assert group is not None
        own = group.columns[:, bare.residual_rows[sweep]].reshape(len(group.columns), 2, -1)[:, 0] / point
        correlation = matern(np.log(sweep.frequency[same, None]) / length, np.log(sweep.frequency[same, None]) / length)
        apart = correlation - (own.T @ own)[np.ix_(same, same)]
        assert np.linalg.eigvalsh(apart).min() > -0.01
        assert apart.max() < short
        assert not group.columns[:, : bare.residual_rows[sweep].start].any()


def test_every_effect_is_proposed_but_twins_and_what_the_tests_do_not_state(bare: Evidence) -> None:
    found = {each.name: each for each in proposals(bare, (), ())}
    twins = {twin for effect in LIBRARY.values() for twin in effect.twins}
    later = {name for name, effect in LIBRARY.items() if effect.after}
    assert found.keys() >= LIBRARY.keys() - {*BASE, *twins, *later}
    assert not found.keys() & twins
    temperature = found["temperature"]  # none is stated
    assert temperature is not None
    assert (temperature.score, temperature.visible) == (0.0, False)


def test_scores_are_those_of_a_linear_refit(bare: Evidence) -> None:
    """Chi-square of the residual regressed on the model's Jacobian, less that on Jacobian and column."""
    random = np.random.default_rng(0)
    residual, own = random.standard_normal(bare.residual.size), bare.solution.jacobian
    evidence = replace(bare, solution=replace(bare.solution, residual=residual))
    columns = random.standard_normal((3, residual.size)) * np.array([[1e-3], [1.0], [1e3]])
    before = np.linalg.lstsq(own.T, residual, rcond=None)[1]
    for column, gain, amount, seen in zip(columns, *scores(evidence, columns), strict=True):
        answer, after, *_ = np.linalg.lstsq(np.vstack((own, column)).T, residual, rcond=None)
        assert seen
        assert gain == pytest.approx(float((before - after)[0]), rel=1e-6)
        assert amount == pytest.approx(-answer[-1], rel=1e-6)
