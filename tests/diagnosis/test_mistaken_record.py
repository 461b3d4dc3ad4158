"""Mistakes in the record of the paper's bushing on the rig are stated, and corrected only if the user adopts them."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rigged import SHARED, Tamper, asked, said
from tries import some

from bushfit.diagnosis.recording_mistakes import MistakeScreening, RecordingMistake, possible_mistakes
from bushfit.effects.mistakes import MISTAKES
from bushfit.errors import FitError
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.geometry import Direction
from bushfit.model.result import Outlier
from bushfit.reading.measurement import Loop, Sweep

AXIAL = "peak_to_peak:sweep_axial"
PHASE = np.linspace(0.0, 4.0 * np.pi, 200)
LOOP = Loop("slow", Direction.AXIAL, PHASE, 1e-3 * np.sin(PHASE), 400.0 * np.sin(PHASE + 0.1))


def doubled(sweep: Sweep) -> Sweep:
    return replace(sweep, amplitude=2.0 * sweep.amplitude)


def on_sweeps(change: Callable[[Sweep], Sweep], *numbers: int) -> Tamper:
    return lambda c: replace(c, sweeps=tuple(change(s) if i in numbers else s for i, s in enumerate(c.sweeps)))


def on_loops(change: Callable[[Loop], Loop], *numbers: int) -> Tamper:
    return lambda c: replace(c, loops=tuple(change(x) if i in numbers else x for i, x in enumerate(c.loops)))


def sized(**factors: float) -> Tamper:
    return lambda c: replace(
        c, bushing=replace(c.bushing, **{key: factor * getattr(c.bushing, key) for key, factor in factors.items()})
    )


in_kilograms = on_loops(lambda x: replace(x, force=x.force / 9.80665), 0, 1)
MADE: dict[str, Tamper] = {
    AXIAL: on_sweeps(doubled, 0),
    "ten_times_slower:loop_axial_1 ten_times_slower:loop_axial_2": on_loops(
        lambda x: replace(x, time=x.time / 10), 0, 1
    ),
    "phase_in_radians:sweep_axial": on_sweeps(
        lambda s: replace(s, stiffness=np.abs(s.stiffness) * np.exp(1j * np.radians(np.angle(s.stiffness)))), 0
    ),
    "other_direction:sweep_radial": on_sweeps(lambda s: replace(s, direction=Direction.AXIAL), 1),
    "diameters": sized(inner_radius=2.0, outer_radius=2.0),
    "inch:sweep_axial inch:sweep_radial": on_sweeps(
        lambda s: replace(s, amplitude=s.amplitude / 25.4, stiffness=25.4 * s.stiffness), 0, 1
    ),
    "radians_per_second:sweep_radial": on_sweeps(lambda s: replace(s, frequency=6.2831853 * s.frequency), 1),
}


@pytest.mark.parametrize("truth", some(MADE, {AXIAL}))
def test_a_mistake_is_named_with_the_line_that_puts_it_right(truth, measured):
    campaign = MADE[truth](measured(None, SHARED))
    diagnosis = asked(campaign)
    assert diagnosis.verdict == "named"
    assert [effect.label for effect in diagnosis.effects] == truth.split()
    assert diagnosis.summary.startswith("probable mistake in the record: ")
    for effect, entry in zip(diagnosis.effects, diagnosis.to_document()["effects"], strict=True):
        assert (entry["level"], entry["parameters"], entry["test"]) == ("record", {}, effect.test)
        assert entry["correction"] in diagnosis.next_test
    before, after = diagnosis.calibration
    assert after < 1.02 < before - 0.02  # root mean squares over thousands of rows of loops, which agree
    assert diagnosis.result.model is diagnosis.before.model
    assert not diagnosis.has_added_effects
    assert any("fitted to the tests as they are" in warning for warning in map(str, diagnosis.result.warnings))
    mended = asked(campaign, adopt=tuple(truth.split()))
    assert mended.verdict == "consistent"
    assert mended.calibration[0] == pytest.approx(after, rel=1e-6)
    assert [line for line in map(str, mended.notes) if line.startswith("corrected by --adopt ")]
    assert [line for line in map(str, mended.result.warnings) if line.startswith("corrected by --adopt ")]


#: Factors of the stated displacement and force, by the mistake in a test that strains rubber beyond all limits.
IMPOSSIBLE = {
    f"{name}_{test}": factor
    for name, factor in (("thousandth_of", 1e3), ("millionth_of", 1e6))
    for test in ("displacement:loop_axial_1", "displacement:sweep_axial", "amplitude:sweep_axial")
}


@pytest.mark.parametrize("truth", some(IMPOSSIBLE, {"thousandth_of_displacement:loop_axial_1"}))
def test_where_no_fit_can_begin_the_option_is_offered_that_corrects_the_unit(truth, measured):
    factor = IMPOSSIBLE[truth]
    of_loop = on_loops(lambda x: replace(x, displacement=factor * x.displacement), 0)
    of_channel = 1.0 / factor if "displacement" in truth else 1.0
    of_sweep = on_sweeps(lambda s: replace(s, amplitude=factor * s.amplitude, stiffness=of_channel * s.stiffness), 0)
    campaign = (of_loop if "loop" in truth else of_sweep)(measured(None, SHARED))
    with pytest.raises(FitError, match=f"--adopt {truth} corrects it"):
        asked(campaign)
    assert asked(campaign, adopt=(truth,)).verdict == "consistent"


def test_a_mistake_in_every_explanation_is_reported_before_the_rest_is_decided(measured):
    """Loops in kgf of a bushing whose sleeve or radial fixture flexes: the effects are ambiguous, the unit is not."""
    diagnosis = asked(in_kilograms(measured({"sleeve_compliance": {"compliance": 2e-8}}, SHARED)))
    assert said(diagnosis) == "ambiguous kilogram_force + kilogram_force"
    assert diagnosis.summary.startswith("probable mistake in the record: the forces of loop_axial_1 and loop_")
    assert not diagnosis.has_added_effects


def test_a_test_that_is_wrong_by_an_unknown_factor_is_named_with_the_factor(measured, monkeypatch):
    campaign = on_sweeps(lambda s: replace(s, stiffness=0.4 * s.stiffness), 0)(measured(None, SHARED))
    assert said(diagnosis := asked(campaign)) == "named unknown_factor"
    assert "of sweep_axial are 0.399 (95 % interval 0.398 to 0.400) times those of the other" in diagnosis.summary
    # a correction after which the fit leaves out other points is not compared
    corrected, one = RecordingMistake.corrected_campaign, Outlier("sweep_axial", None, 5, "stiffness", 9.0)
    monkeypatch.setattr(RecordingMistake, "corrected_campaign", lambda mistake: corrected(mistake).without([one]))
    assert not any(effect.test for effect in asked(campaign).effects)


def test_of_the_corrections_of_the_same_tests_those_far_behind_leave_room_for_others(measured, monkeypatch):
    """Rates of one loop often fit a rubber of another law by chance; they must not crowd out amplitudes of sweeps."""
    data = PreparedCampaign.from_campaign(measured(None, SHARED))
    misfits = {"sixty_times_faster": 30.0, "ten_times_faster": 50.0, "peak_to_peak": 90.0}
    monkeypatch.setattr(MistakeScreening, "misfit", lambda _, c: misfits[c.kind.name] if c else 100.0)
    possible = [each for each in possible_mistakes(data, ()) if each.kind.name in misfits and len(each.tests) == 1]
    selected = {mistake.labels for mistake in MistakeScreening(data).best(possible, 9)}
    assert ("peak_to_peak:sweep_axial",) in selected
    assert ("sixty_times_faster:loop_axial_1",) in selected
    assert ("ten_times_faster:loop_axial_1",) not in selected


def test_what_all_tests_share_is_not_seen_and_not_named(measured):
    """All forces in kgf are all moduli 9.81 times too small: the tests agree."""
    campaign = in_kilograms(measured(None, SHARED))
    campaign = on_sweeps(lambda s: replace(s, stiffness=s.stiffness / 9.80665), 0, 1)(campaign)
    assert said(asked(campaign)) == "consistent "


def swept(loss: float, direction: Direction = Direction.AXIAL, magnitude: float = 5e5) -> Sweep:
    stiffness = magnitude * (1.0 + 1j * loss) / np.hypot(1.0, loss) * np.ones(4)
    return Sweep("swept", direction, np.array([5.0, 15.0, 25.0, 35.0]), np.full(4, 2e-4), stiffness)


def mended(name: str, test: Any) -> Any:
    return MISTAKES[name].corrected_test(test)


@given(st.floats(0.02, 0.6), st.floats(1e5, 1e7))
def test_the_loss_is_mended_as_it_was_measured(loss, magnitude):
    truth = swept(loss, magnitude=magnitude).stiffness
    angle = np.arctan(loss)
    as_stated = {
        "sin_delta": swept(np.sin(angle), magnitude=magnitude),
        "loss_as_ratio": swept(loss / 100.0, magnitude=magnitude),
        "phase_in_radians": swept(np.tan(np.radians(angle)), magnitude=magnitude),
        "complement": swept(1.0 / loss, magnitude=magnitude),
        "loss_in_per_cent": swept(100.0 * loss, magnitude=magnitude),
        "storage_for_magnitude": swept(loss, magnitude=magnitude * np.cos(angle)),
        "magnitude_for_storage": replace(swept(0.1), stiffness=np.abs(truth) + 1j * truth.imag),
    }
    for name, test in as_stated.items():
        np.testing.assert_allclose(mended(name, test).stiffness, truth, rtol=1e-9, err_msg=name)


def test_amplitudes_rates_units_and_directions_are_mended():
    assert mended("peak_to_peak", swept(0.1)).amplitude == pytest.approx(1e-4)
    assert mended("zero_to_peak", swept(0.1)).amplitude == pytest.approx(4e-4)
    assert np.array_equal(mended("peak_to_peak", swept(0.1)).stiffness, swept(0.1).stiffness)
    assert not MISTAKES["peak_to_peak"].is_possible(LOOP)
    assert mended("sixty_times_faster", LOOP).time == pytest.approx(LOOP.time / 60.0)
    assert mended("other_direction", LOOP).direction is Direction.RADIAL
    cycle = Sweep("slow", Direction.AXIAL, np.array([1.0]), np.array([1e-3]), np.array([4e5 + 4e4j]))
    of_loop = MISTAKES["inch"].corrected_test(cycle)
    assert (of_loop.amplitude, of_loop.stiffness) == (pytest.approx(25.4e-3), pytest.approx(cycle.stiffness / 25.4))
    assert MISTAKES["milliseconds"].corrected_test(cycle).frequency == pytest.approx(1000.0)
