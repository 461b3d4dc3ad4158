"""The smooth correction of what has no name: it stands where it was not fitted, or it is not kept.

The data are the virtual rig's, with a resonance in parallel that is added to their stiffness in the frequency domain.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from asking import asked, no_loops, one_frequency, one_level
from rigged import LEVELS, Fitted, Measured
from test_schemas import complaints

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import RigSettings
from bushfit.caveats import caveats
from bushfit.diagnosis.correction import Correction, correct
from bushfit.diagnosis.described import Described, describe, weighed
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.record import Diagnosis
from bushfit.errors import ModelError
from bushfit.fitting.assess import linear_errors
from bushfit.geometry import Direction
from bushfit.model.file import from_document, to_document
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction import predict
from bushfit.report.folder import to_json


def with_relaxation(campaign: Campaign, size: float = 0.06) -> Campaign:
    """A relaxation in parallel whose time grows with amplitude, a share of the stiffness: no effect of the library."""
    sweeps = []
    for sweep in campaign.sweeps:
        turn = 2j * np.pi * sweep.frequency * 4e-3 * (sweep.amplitude / LEVELS[1]) ** 1.2
        sweeps.append(replace(sweep, stiffness=sweep.stiffness * (1.0 + size * turn / (1.0 + turn))))
    return replace(campaign, sweeps=tuple(sweeps), loops=())


#: Middle and width [Hz] of a mode that is narrower than two steps of the sweeps, and its size.
MODE = 47.0, 12.0, 0.06


def with_mode(campaign: Campaign) -> Campaign:
    """A damped mode in parallel, a share of the stiffness, (2 zeta i r)/(1 - r^2 + 2 zeta i r): a resonance."""
    middle, width, size = MODE
    sweeps = []
    for sweep in campaign.sweeps:
        ratio, damping = sweep.frequency / middle, width / (2.0 * middle)
        turn = 2j * damping * ratio
        sweeps.append(replace(sweep, stiffness=sweep.stiffness * (1.0 + size * turn / (1.0 - ratio**2 + turn))))
    return replace(campaign, sweeps=tuple(sweeps), loops=())


@pytest.fixture(scope="module")
def resonant(measured: Measured, fitted: Fitted) -> Described:
    evidence = fitted(with_mode(measured()))
    found = describe(evidence, RigSettings(), evidence.model.values, (), {})
    assert found is not None
    return found


@pytest.fixture(scope="module")
def evidence(measured: Measured, fitted: Fitted) -> Evidence:
    return fitted(with_relaxation(measured()))


@pytest.fixture(scope="module")
def correction(evidence: Evidence) -> Correction:
    found = correct(evidence, *weighed(evidence, RigSettings()))
    assert found is not None
    print(found.held, found.band, found.data.size, found.data.lengths)
    return found


@pytest.fixture(scope="module")
def described(evidence: Evidence) -> Described:
    found = describe(evidence, RigSettings(), evidence.model.values, (), {})
    assert found is not None
    return found


@pytest.fixture(scope="module")
def result(described: Described) -> Result:
    strain = tuple(x * described.after.model.unit_strain(Direction.AXIAL) for x in LEVELS)
    measured = Range((5.0, 155.0), (min(strain), max(strain)), ("axial", "radial"))
    return Result(described.after.model, measured=measured)


def test_it_stands_where_it_was_not_fitted(correction: Correction) -> None:
    """The excess over the noise floor halves in whole runs that were held out, by a band narrower than half the gap."""
    held = correction.held
    assert held.before is not None
    assert held.after is not None
    assert held.after - 1.0 < 0.5 * (held.before - 1.0)
    assert len(held.parts) == 3
    assert correction.band < 0.5


def test_the_parameters_can_do_nothing_of_it(evidence: Evidence, described: Described) -> None:
    """The correction is orthogonal to what the parameters can do, so they stay as the plain fit has them."""
    assert dict(described.after.model.values) == pytest.approx(dict(evidence.model.values), rel=1e-4)
    moved = described.after.residual - evidence.residual
    share = np.linalg.norm(evidence.span.T @ moved) / np.linalg.norm(moved)
    print(f"share of the correction along the parameters: {share:.4f}")
    assert share < 0.02
    assert described.after.chi_square < 1.15 * evidence.residual.size


def test_it_moves_along_frequency_with_strain(measured: Measured, fitted: Fitted, correction: Correction) -> None:
    """A time that grows by the power 1.2 of strain moves frequencies by the power -1.2: the tilt is 1; without such a
    shift what is predicted of the middle level is worse."""
    held = {part.part: part.after for part in correction.held.parts}
    print(correction.data.tilt, held)
    assert correction.data.tilt > 0.0
    assert held["the middle of what is held"] < 1.2


def test_a_peak_is_found_where_it_is(resonant: Described) -> None:
    """Its middle within 1 % and its width within 10 %, though frequencies lie 10 Hz apart; between them too the
    corrected stiffness is that of the rig, within 0.6 % where the peak makes 6 %."""
    middle, width, size = MODE
    correction, model = resonant.correction, resonant.after.model
    print(correction.data.peak, correction.held)
    assert correction.data.peak == pytest.approx((middle, width), rel=0.1)
    assert correction.data.peak[0] == pytest.approx(middle, rel=0.01)
    assert "a peak, as of a resonance, at 47 Hz" in resonant.words
    frequency = np.linspace(20.0, 90.0, 71)
    turn = 1j * width * frequency
    mode = 1.0 + size * turn / (middle**2 - frequency**2 + turn)
    shape = model.stiffness(Direction.AXIAL, frequency, LEVELS[1]) / mode
    smooth = np.polynomial.Polynomial.fit(frequency, shape, 3)(frequency)
    off = np.abs(shape / smooth - 1.0)
    print(f"off a smooth curve once the mode is taken out: {off.max():.4f}")
    assert off.max() < 0.006


def test_the_model_file_holds_the_peak(resonant: Described) -> None:
    result = Result(resonant.after.model, measured=Range((5.0, 155.0), (0.01, 0.1), ("axial", "radial")))
    document = json.loads(json.dumps(to_document(result)))
    assert from_document(document).model.unnamed == result.model.unnamed
    document["unnamed"]["patches"][0]["peak_in_phase"].pop()
    with pytest.raises(ModelError, match="strength of a peak"):
        from_document(document)


def test_nothing_is_described_on_clean_campaigns(measured: Measured, fitted: Fitted) -> None:
    for seed in range(4):
        clean = fitted(measured(seed=seed))
        assert describe(clean, RigSettings(), clean.model.values, (), {}) is None


def test_where_the_parameters_can_do_all_nothing_is_described(measured: Measured, fitted: Fitted) -> None:
    """One frequency at one level in two directions: whatever is off there, they meet it."""
    alone = fitted(one_frequency(one_level(no_loops(with_relaxation(measured())))))
    assert describe(alone, RigSettings(), {}, (), {}) is None


def test_errors_of_levels_are_not_described(measured: Measured, fitted: Fitted) -> None:
    """The middle level 8 % off in both directions: nothing predicts it from the others."""
    campaign = replace(measured(), loops=())
    sweeps = [
        replace(sweep, stiffness=sweep.stiffness * np.where(sweep.amplitude == LEVELS[1], 1.08, 1.0))
        for sweep in campaign.sweeps
    ]
    wrong = fitted(replace(campaign, sweeps=tuple(sweeps)))
    assert describe(wrong, RigSettings(), wrong.model.values, (), {}) is None


def test_what_the_diagnosis_says(measured: Measured) -> None:
    """On a rig of which it is known that no error of a level makes it up."""
    rig = RigSettings(gain_error=5e-4, phase_error=5e-4)
    found = asked(replace(with_relaxation(measured()), rig=rig), max_effects=1)
    assert found.verdict == "described"
    assert [effect.name for effect in found.effects] == ["unnamed"]
    assert "unnamed" in found.result.model.effects
    assert found.holdout.after - 1.0 < 0.5 * (found.holdout.before - 1.0)  # type: ignore[operator]
    assert "power law" in found.summary
    assert found.description is None
    words = found.summary.partition(";")[0]
    assert "% of |K|" in words, "the size comes first"
    document = found.to_document()
    assert any("intervals are invalid" in line for line in document["warnings"])
    assert complaints("diagnosis", json.loads(to_json(document)), whole=True) == []
    inside = predict(found.result, Direction.AXIAL, [45.0, 95.0], [LEVELS[1]]).stiffness
    assert np.all(inside.high - inside.value < 0.01 * inside.value)
    assert found.result.covariance.stderr("m") > 1.5 * plain_error(found, "m")  # type: ignore[operator]


def plain_error(found: Diagnosis, name: str) -> float:
    """Standard error of a parameter as if the misfit of the plain model were that of the one with its correction."""
    after = found.after
    errors = linear_errors(after.solution.jacobian)
    names = after.solution.coordinates.names
    slope = after.solution.coordinates.slopes(after.model.values)[names.index(name)]
    return float(errors[names.index(name)] * slope)


def test_the_model_file_holds_it(result: Result) -> None:
    again = from_document(json.loads(json.dumps(to_document(result)))).model
    assert again.unnamed == result.model.unnamed
    assert len(json.dumps(to_document(result), indent=2)) < 60_000
    test = Direction.RADIAL, np.array([7.0, 80.0]), np.array([1.5e-4, 4e-4])
    assert again.stiffness(*test) == pytest.approx(result.model.stiffness(*test), rel=1e-12)


@pytest.mark.parametrize(
    ("spoil", "place"),
    [
        (lambda data: data["patches"][0]["in_phase"].pop(), "patches"),
        (lambda data: data["patches"][0].update(strain=[-1.0] * len(data["patches"][0]["strain"])), "patches"),
        (lambda data: data.update(size=0.0), "unnamed"),
        (lambda data: data.update(lengths=["a", 1.0]), "lengths"),
        (lambda data: data.pop("patches"), "patches"),
    ],
)
def test_spoiled_data_is_one_clear_error(spoil: object, place: str, result: Result) -> None:
    document = json.loads(json.dumps(to_document(result)))
    spoil(document["unnamed"])  # type: ignore[operator]
    with pytest.raises(ModelError) as error:
        from_document(document)
    print(error.value)
    assert place in str(error.value)


def test_an_effect_without_its_data_is_refused(result: Result) -> None:
    document = to_document(result)
    del document["unnamed"]
    with pytest.raises(ModelError, match="without its data"):
        from_document(document)


def test_predictions_use_it_inside_the_range_and_open_outside(result: Result, evidence: Evidence) -> None:
    """Inside, the corrected stiffness lies nearer to the rig's; at four times the frequency it is the plain model's."""
    plain, amplitude = Result(evidence.model), [LEVELS[1]]
    inside, outside = np.array([45.0, 95.0]), np.array([2000.0])
    corrected, without = (predict(each, Direction.AXIAL, inside, amplitude) for each in (result, plain))
    half = (corrected.stiffness.high - corrected.stiffness.low) / 2.0 / corrected.stiffness.value
    change = np.abs(corrected.stiffness.value / without.stiffness.value - 1.0)
    print("inside: half band", half, "change", change)
    assert np.all(half < 0.01)
    far, plain_far = (predict(each, Direction.AXIAL, outside, amplitude) for each in (result, plain))
    assert far.stiffness.value == pytest.approx(plain_far.stiffness.value, rel=2e-3)
    unnamed = result.model.unnamed
    assert unnamed is not None
    half_far = (far.stiffness.high - far.stiffness.low) / 2.0 / far.stiffness.value
    print("outside: half band", half_far, "gap", unnamed.largest, "size between nodes", unnamed.size)
    assert half_far == pytest.approx([unnamed.largest], rel=0.05)
    assert any("the band opens" in line for line in caveats(result))
    assert any("cannot tell it from the rig's" in line for line in caveats(result))
    assert any("extrapolated" in line for line in far.warnings)


def test_a_direction_without_tests_has_no_correction_within_its_size(result: Result) -> None:
    model = result.model
    plain = Model.started(model.bushing, [name for name in model.effects if name != "unnamed"], model.values)
    test = Direction.TORSION, np.array([20.0]), np.array([0.02])
    assert model.stiffness(*test) == pytest.approx(plain.stiffness(*test))
