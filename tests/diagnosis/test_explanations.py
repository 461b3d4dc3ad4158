"""What explains a gap proposes itself: effects by sensitivity, places by their rows, curves by their covariance."""

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rigged import LEVELS, SHARED, both, loop_too_strong, off

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.explanations import Explanation
from bushfit.diagnosis.faulty_parts import find_faulty_parts, is_pattern
from bushfit.diagnosis.hypotheses import SearchState, mean_parameters
from bushfit.diagnosis.laplace import laplace
from bushfit.diagnosis.linear_model import LinearModel
from bushfit.diagnosis.projected_columns import SignatureSet
from bushfit.diagnosis.propose import proposals
from bushfit.diagnosis.recorded_tests import RecordedTests
from bushfit.diagnosis.rig_errors import in_scatter_units, rig_errors
from bushfit.diagnosis.smooth_deviations import compound_shapes, compound_signature
from bushfit.effects import BASE, LIBRARY
from bushfit.fitting.preparation import split_by_kind
from bushfit.fitting.problem import FitResult
from bushfit.model.covariance import Covariance
from bushfit.reading.preload import Preload

SHARED_RIG = RigSettings(gain_error=4e-3, phase_error=3.5e-3)


def best(evidence: FitResult, every: Sequence[Explanation]) -> Explanation:
    """The one that makes the tests likeliest."""
    known = [each for each in every if each.signature]
    signatures = [each.signature for each in known if each.signature]
    rig = rig_errors(evidence, SHARED_RIG)
    linear = LinearModel(evidence.residual, evidence.jacobian, np.zeros(len(evidence.jacobian)), rig)
    worths = linear.explanation_evidence(SignatureSet.split(signatures, rig))
    return max(zip(known, worths, strict=True), key=lambda pair: pair[1].log_evidence)[0]


@pytest.mark.parametrize(("stated", "names"), [(1.0, ["0.1 mm", "0.5 mm at a preload of 500 N"]), (0.96, [])])
def test_a_level_that_another_preload_contradicts_is_no_physics(measured, fitted, stated, names):
    first, second = (measured(seed=seed).sweeps[0] for seed in (0, 1))
    levels = {"amplitude": stated * second.amplitude, "reached": second.amplitude}
    second = replace(second, name="second", preload=Preload(500.0, "N"), **levels)
    parts = find_faulty_parts(fitted(replace(measured(), loops=(), sweeps=(first, second))))
    assert [part.name.removeprefix("the axial level ") for part in parts if part.may_be_physics] == names


def test_a_law_that_replaces_friction_is_uniform_over_a_factor_of_20_in_each_parameter(bare):
    densities = np.sqrt(np.array([*laplace("sliders", bare, bare)[1].values()]) / (2.0 * np.pi))
    np.testing.assert_allclose(densities, np.full(3, 1.0 / np.log(20.0)), rtol=2e-3)


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
def test_the_place_that_went_wrong_is_the_likeliest(measured, fitted, tamper, kind, words):
    """Errors of the rig, of all sizes, are counted beside it."""
    evidence = in_scatter_units(fitted(tamper(measured(plan=SHARED))))
    found = best(evidence, find_faulty_parts(evidence))
    assert (found.kind, found.family) == ("part", kind)
    assert found.name == words
    assert (kind == "frequency" and is_pattern([found])) == ("all directions" in words), "perhaps physics"


def test_every_effect_is_proposed_but_twins_and_what_the_tests_do_not_state(bare):
    found = {each.name: each for each in proposals(bare, (), ())}
    twins = {twin for effect in LIBRARY.values() for twin in effect.twins}
    later = {name for name, effect in LIBRARY.items() if effect.after}
    assert found.keys() >= LIBRARY.keys() - {*BASE, *twins, *later}
    assert not found.keys() & twins
    temperature = found["temperature"]  # none is stated
    assert (temperature.score, temperature.visible) == (0.0, False)


def test_the_compound_bends_a_loop_in_odd_overtones_and_in_the_first_cycle(bare):
    """In steady cycles the h-th overtone has 1/h^2 of the deviation of the stiffness, and no even one occurs."""
    loop = replace(split_by_kind(bare.data_sets)[0][0], gain_error=0.0)
    unit = np.abs(loop.smooth_changes()[1]).max()
    rows, phase = compound_shapes(loop) / unit, loop.phase
    waves = np.exp(2j * np.pi * np.arange(15)[:, None] * phase)
    by_order = np.abs(rows @ waves.T) * 2.0 / phase.size
    odd = np.arange(3, 14, 2)
    expected = np.zeros((2, len(odd), 15))
    expected[:, np.arange(len(odd)), odd] = 1.0 / odd**2
    np.testing.assert_allclose(by_order.reshape(expected.shape), expected, atol=3e-3)
    rested = compound_shapes(replace(loop, from_rest=True))[len(rows) :] / unit
    rested -= np.median(rested[:, phase >= 1.0], axis=1, keepdims=True)  # the zero of the load cell is uncertain
    assert len(rested) == 6
    assert np.median(np.abs(rested[:, phase >= 1.0])) < 1e-9
    np.testing.assert_allclose(np.abs(rested).max(axis=1), 1.0 / (3.0 * np.arange(1, 7)), rtol=0.01)


def test_the_stiffness_formula_of_a_direction_may_be_wrong_where_the_compound_deviates(bare):
    """Half of the deviation, 1 % beside 2 %, equal at every point of the direction."""
    sweep = split_by_kind(bare.data_sets)[1][1]
    stiffness = bare.model.stiffness(sweep.direction, sweep.frequency, sweep.amplitude)
    change = np.zeros(bare.residual.size)
    change[bare.residual_rows[sweep]] = sweep.residual_change(0.5 * stiffness, bare.model)
    distances = np.abs(compound_signature(bare).whole - change).max(axis=1)
    assert distances.min() < 1e-9 * np.abs(change).max()


def test_a_relaxation_faster_than_the_tests_is_no_evidence_of_a_delay(measured, fitted):
    """A loss modulus in proportion to frequency, up to 2 % of the modulus, where the compound may deviate."""
    tests = RecordedTests.of_fit(fitted(measured(plan=SHARED)), SHARED_RIG)
    found = {each.name: each.signature for each in proposals(tests.unwhitened, (), ())}
    viscous, linear = found["viscous"], SearchState.of_tests(tests).linear
    change = 0.02 / np.abs(viscous.stiffness_change).max() * viscous.whole[0]
    bent = replace(linear, residual=linear.residual + change)
    (delay,) = bent.explanation_evidence(SignatureSet.split([found["delay"]], linear.rig))
    assert delay.log_evidence - bent.evidence.log_evidence > 50.0, "of a rubber that follows the model's laws"
    assert delay.with_compound.log_evidence - bent.evidence.with_compound.log_evidence < 1.0


def test_a_parameter_without_influence_is_left_out(measured, fitted):
    """The effect of preload changes no test without a preload; intervals of the others exist as without it."""
    names = []
    for effects in ((), ("preload",)):
        state = SearchState.of_tests(RecordedTests.of_fit(fitted(measured(plan=SHARED), *effects), SHARED_RIG))
        means, covariance = state.parameters
        names.append(covariance.names)
        assert np.isfinite(covariance.matrix).all()
        assert set(means) == set(covariance.names)
    assert names[0] == names[1]


@pytest.mark.parametrize("seed", range(20))
def test_the_mean_of_values_at_a_limit_is_inside_it(seed):
    """Weights that sum to 1 but for rounding must not give a value that a model refuses."""
    covariance = Covariance(("loop_clock.rate",), np.zeros((1, 1)))
    fit = SimpleNamespace(model=SimpleNamespace(values={}))
    state = SimpleNamespace(fit=fit, parameters=({"loop_clock.rate": -2.0}, covariance))
    posteriors = np.random.default_rng(seed).normal(size=3)
    hypotheses = [SimpleNamespace(log_posterior=value, state=state) for value in posteriors]
    assert mean_parameters(hypotheses, ["loop_clock.rate"])[0] == {"loop_clock.rate": -2.0}
