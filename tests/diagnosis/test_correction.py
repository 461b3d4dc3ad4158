"""The smooth correction of what has no name stands where it was not fitted, or it is not kept; what a diagnosis cannot
tell apart, predictions leave open; and the power law of what has no name, with its phase and powers.

The data are the virtual rig's, with effects that the model of a fit lacks, or with terms that are added to their
stiffness in the frequency domain.
"""

import json
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from rigged import LEVELS, Fitted, asked, changed
from test_report_text import TURNED
from test_schemas import complaints

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.closing import GapDescription, describe_gap
from bushfit.diagnosis.fits import fit_model
from bushfit.diagnosis.power_law import PowerLaw, nearest_power_law
from bushfit.effects.contract import Array, Level
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitResult
from bushfit.fitting.starts import start_values
from bushfit.geometry import Direction, unit_strain
from bushfit.model.file import from_document, to_document
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction.caveats import caveats
from bushfit.prediction.stiffness import predict
from bushfit.report.results import to_json

FREQUENCIES, AMPLITUDES = np.geomspace(5.0, 155.0, 9), np.geomspace(1e-4, 5e-4, 5)
#: How much stiffer the radial tests are than the axial ones predict, of the bushing or of the rig.
STIFFER = 1.06
#: A term's stiffness, complex [N/m], by frequency [Hz], amplitude [m] and the stiffness without it.
Added = Callable[[Array, Array, Array], Array]


def with_relaxation(campaign: Campaign, size: float = 0.06) -> Campaign:
    """A relaxation in parallel whose time grows with strain, a share of the stiffness: no effect of the library."""
    sweeps = []
    for sweep in campaign.sweeps:
        strain = sweep.amplitude * unit_strain(campaign.bushing, sweep.direction)
        turn = 2j * np.pi * sweep.frequency * 4e-3 * (strain / 0.025) ** 1.2
        sweeps.append(replace(sweep, stiffness=sweep.stiffness * (1.0 + size * turn / (1.0 + turn))))
    return replace(campaign, sweeps=tuple(sweeps), loops=())


@pytest.fixture(scope="module")
def evidence(measured, fitted) -> FitResult:
    return fitted(with_relaxation(measured()))


@pytest.fixture(scope="module")
def described(evidence) -> GapDescription:
    found = describe_gap(evidence, RigSettings(), evidence.model.values, {})
    assert found is not None
    return found


@pytest.fixture(scope="module")
def result(described) -> Result:
    strain = tuple(x * described.after.model.unit_strain(Direction.AXIAL) for x in LEVELS)
    measured = Range((5.0, 155.0), (min(strain), max(strain)), ("axial", "radial"))
    return Result(described.after.model, measured=measured)


def test_what_the_diagnosis_says(measured):
    """On a rig of which it is known that no error of a level makes it up."""
    rig = RigSettings(gain_error=5e-4, phase_error=5e-4)
    campaign = replace(with_relaxation(measured()), rig=rig)
    found = asked(campaign, max_effects=1)
    assert found.verdict == "described"
    assert [effect.name for effect in found.effects] == ["unnamed"]
    assert "unnamed" in found.result.model.effects
    assert found.holdout.after - 1.0 < 0.5 * (found.holdout.before - 1.0)  # type: ignore[operator]
    assert found.description is None
    assert "% of |K|" in found.summary.partition(";")[0], "the size comes first"
    document = found.to_document()
    assert any("contain a part of this gap" in line for line in document["warnings"])
    assert complaints("diagnosis", json.loads(to_json(document)), whole=True) == []
    inside = predict(found.result, Direction.AXIAL, [45.0, 95.0], [LEVELS[1]]).stiffness
    assert np.all(inside.high - inside.value < 0.01 * inside.value)
    adopted = asked(campaign, found.result.model, max_effects=0, adopt=("rig_compliance",)).result.model
    assert adopted.effects[-1] == "rig_compliance", "the correction is left out, because it would hide what is adopted"


def test_held_out_tests_are_predicted_from_the_others(evidence, described):
    """The reported figure is that of a correction made of the other tests alone."""
    frequencies = np.unique(evidence.data_sets[0].frequency)
    third = frequencies[1:-1:3]
    rest = [test.without(np.flatnonzero(np.isin(test.frequency, third))) for test in evidence.data_sets]
    other = describe_gap(fit_model(evidence.model, rest, (), {}), RigSettings(), evidence.model.values, {})
    residuals = [
        test.residual(other.after.model)[np.tile(np.isin(test.frequency, third), 2)] for test in evidence.data_sets
    ]
    part = next(part for part in described.holdout.parts if part.part == "every third frequency")
    assert part.after == pytest.approx(np.sqrt(np.mean(np.square(np.concatenate(residuals)))), rel=0.1)


def test_predictions_use_it_inside_the_range_and_open_outside(result):
    """Inside, the corrected stiffness has a narrow band; at ten times the frequency it is that of the parameters."""
    plain, amplitude = Result(result.model.without("unnamed")), [LEVELS[1]]
    inside, outside = np.array([45.0, 95.0]), np.array([2000.0])
    corrected = predict(result, Direction.AXIAL, inside, amplitude)
    half = (corrected.stiffness.high - corrected.stiffness.low) / 2.0 / corrected.stiffness.value
    assert np.all(half < 0.01)
    far, plain_far = (predict(each, Direction.AXIAL, outside, amplitude) for each in (result, plain))
    assert far.stiffness.value == pytest.approx(plain_far.stiffness.value, rel=2e-3)
    unnamed = result.model.unnamed
    half_far = (far.stiffness.high - far.stiffness.low) / 2.0 / far.stiffness.value
    assert half_far == pytest.approx([unnamed.largest], rel=0.05)
    told = " ".join(line for line in map(str, caveats(result)) if line.startswith("the smooth correction"))
    percent = [float(figure) for figure in re.findall(r"up to ±?([\d.]+) %", told)]
    assert percent == pytest.approx([196.0 * unnamed.far_deviation, 100.0 * unnamed.largest], rel=0.05)
    assert any("extrapolated" in line for line in map(str, far.warnings))


def covered(campaign: Campaign, *truths: Array) -> list[float]:
    """Share of a grid on which the radial band holds |K| of the bushing, whichever it is, (n,) each; none where no set
    was told."""
    found = asked(campaign)
    if found.verdict != "ambiguous":
        return []
    band = predict(found.result, Direction.RADIAL, FREQUENCIES, AMPLITUDES).stiffness
    return [float(np.mean((band.low <= truth) & (truth <= band.high))) for truth in truths]


def radial(model: Model) -> Array:
    """|K| of a bushing on the grid, (n,) [N/m]."""
    bare = model.without(Level.INSTRUMENT)
    return np.abs(bare.stiffness(Direction.RADIAL, *np.meshgrid(FREQUENCIES, AMPLITUDES)).ravel())


def test_bands_hold_each_model_that_may_be_right(measured):
    found = asked(changed(measured(), 1, STIFFER))
    assert found.verdict == "ambiguous"
    result = found.result
    assert len(result.alternatives) > 1
    probabilities = [each.probability for each in result.alternatives]
    assert min(probabilities) >= 0.025
    without_errors = replace(result, model_error=None, alternatives=(), usable=())
    band = predict(result, Direction.RADIAL, FREQUENCIES, AMPLITUDES).stiffness
    for each in result.alternatives:
        there = radial(each.model)
        assert np.all((band.low <= there * (1.0 + 1e-9)) & (there <= band.high * (1.0 + 1e-9)))
        own = replace(without_errors, model=each.model, covariance=each.covariance)
        alone = predict(own, Direction.RADIAL, FREQUENCIES, AMPLITUDES).stiffness
        assert np.all((band.low <= alone.low) & (alone.high <= band.high)), "with the errors of its own fit"
        assert 0.0 < np.median((alone.high - alone.value) / alone.value) < 0.02
    assert any("the bands, low to high, include each alternative" in line for line in map(str, caveats(result)))
    document = json.loads(json.dumps(to_document(result)))
    assert complaints("model", document, whole=False) == []
    again = from_document(document)
    assert [each.model for each in again.alternatives] == [each.model for each in result.alternatives]
    np.testing.assert_array_equal(predict(again, Direction.RADIAL, FREQUENCIES, AMPLITUDES).stiffness.low, band.low)


def test_bands_of_a_consistent_campaign_hold_what_the_rig_may_have(measured, paper_model):
    """A sleeve that takes 1 % off the radial stiffness: probably there, but nothing may be missing as well."""
    soft = {"compliance": 2.2e-9}
    found = asked(measured({"sleeve_compliance": soft}))
    assert found.verdict == "consistent"
    assert any("sleeve_compliance" in each.model.effects for each in found.result.alternatives)
    assert sum(each.probability for each in found.result.alternatives) <= 1.0
    band = predict(found.result, Direction.RADIAL, FREQUENCIES, AMPLITUDES).stiffness
    sleeve = paper_model.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": soft["compliance"]})
    for truth in (radial(paper_model), radial(sleeve)):
        assert np.mean((band.low <= truth) & (truth <= band.high)) > 0.9


@pytest.mark.slow
def test_bands_hold_the_truth_whichever_it_is(measured, paper_model):
    """Of the campaigns that are told to be ambiguous; simulated, three effects, five seeds each: a bushing that is
    stiffer radially, a rig that is, and a sleeve that gives way."""
    soft, shares = 4e-8, list[float]()
    sleeve = paper_model.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": soft})
    for seed in range(5):
        plain = radial(paper_model)
        shares += covered(changed(measured(seed=seed), 1, STIFFER), STIFFER * plain, plain)
        shares += covered(measured({"sleeve_compliance": {"compliance": soft}}, seed=seed), radial(sleeve))
    assert len(shares) > 5
    assert np.mean(shares) > 0.93


def with_term(campaign: Campaign, term: Added) -> Campaign:
    """The sweeps of a campaign with a term in parallel, and no loops."""
    added = (
        replace(sweep, stiffness=sweep.stiffness + term(sweep.frequency, sweep.amplitude, sweep.stiffness))
        for sweep in campaign.sweeps
    )
    return replace(campaign, sweeps=tuple(added), loops=())


def power_law(size: float, phase_deg: float, p: float, q: float) -> Added:
    """The same stiffness in every direction, of a size [N/m] at 50 Hz and 0.2 mm."""
    turn = size * np.exp(1j * np.radians(phase_deg))
    return lambda frequency, amplitude, _: turn * (frequency / 50.0) ** p * (amplitude / 2e-4) ** q


def found_in(campaign: Campaign, fitted: Fitted) -> PowerLaw:
    start = start_values(campaign.bushing, PreparedCampaign.from_campaign(campaign).sweeps, {})
    found = nearest_power_law(fitted(campaign), campaign.rig, start, {})
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("law", "words"),
    [
        ((60e3, 90.0, 1.0, 0.0), "a damper"),
        ((60e3, 180.0, 2.0, 0.0), "a mass"),
        ((60e3, 0.0, 0.0, 2.0), "a spring that stiffens"),
        ((60e3, 90.0, 0.0, -1.0), "dry friction"),
        ((60e3, 40.0, 1.4, 0.7), "adds stiffness and adds loss"),
        ((60e3, -60.0, 0.6, -0.6), "adds stiffness and lowers loss"),
    ],
)
def test_laws_are_found_with_their_phase_and_powers(law, words, measured, fitted):
    """Of 3 % of the stiffness, each within three and a half standard errors, and called what they act like."""
    found = found_in(with_term(measured(), power_law(*law)), fitted)
    assert found.quantity == "stiffness"
    assert found.is_likely
    for (value, low, high), true in zip(
        (found.phase_deg, found.frequency_power, found.amplitude_power), law[1:], strict=True
    ):
        off = (true - value + 180.0) % 360.0 - 180.0
        assert abs(off) < 3.5 * (high - low) / 3.92, (value, low, high, true)
    assert ("acts like" in found.sentence) == (" and " not in words)
    assert words in found.sentence


@pytest.mark.parametrize(
    ("units", "phase", "power", "words"),
    [
        (("stiffness",), 90.0, 1.0, ("adds loss", "acts like a damper")),
        (("stiffness",), -90.0, 1.0, ("lowers loss",)),
        (("gain", "stiffness"), 90.0, 1.0, ("acts like a damper or a delay of the displacement",)),
        (("stiffness",), 93.6, 1.0, ("lowers stiffness and adds loss",)),
        (("stiffness",), 180.0, 2.0, ("lowers stiffness", "grows with frequency to the power 2", "acts like a mass")),
    ],
)
def test_a_law_is_called_what_its_phase_and_powers_act_like(units, phase, power, words):
    """Of one standard error of the phase each; a law 3.6 of them away has no name."""
    ends = (phase - 1.96, phase + 1.96)
    law = PowerLaw(
        units[0], units[1:], (phase, *ends), (power, power - 0.1, power + 0.1), (0.0, -0.1, 0.1), is_likely=True
    )
    for each in words:
        assert each in law.sentence
    assert ("acts like" in law.sentence) == any("acts like" in each for each in words)


def test_a_compliance_beside_a_relaxation_is_named_and_the_rig_is_tested_next(measured):
    campaign = with_relaxation(measured({"rig_compliance": {"compliance": 8e-8}}, TURNED), 0.04)
    found = asked(replace(campaign, rig=RigSettings(gain_error=5e-4, phase_error=5e-4)))
    assert found.verdict == "partly"
    low, high = found.result.interval("sleeve_compliance.compliance")
    assert low < 8e-8 < high
    assert "steel dummy" in found.next_test


def test_a_mass_for_which_the_rig_compensates_too_much_has_no_name(measured):
    """The library has a mass, but of the other sign: an effect that resembles it least badly is not named."""
    campaign = measured()
    sweeps = [
        replace(sweep, stiffness=sweep.stiffness + 0.12 * np.square(2.0 * np.pi * sweep.frequency))
        for sweep in campaign.sweeps
    ]
    found = asked(replace(campaign, sweeps=tuple(sweeps)))
    assert {effect.name for effect in found.effects} <= {"unnamed"}
    assert "grows with frequency to the power 2, independent of amplitude" in found.summary
