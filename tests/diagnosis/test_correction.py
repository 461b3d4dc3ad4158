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
from bushfit.diagnosis.described import Described, describe
from bushfit.diagnosis.evidence import Evidence
from bushfit.errors import ModelError
from bushfit.geometry import Direction
from bushfit.model.file import from_document, to_document
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction.caveats import caveats
from bushfit.prediction.stiffness import predict
from bushfit.report.folder import to_json


def with_relaxation(campaign: Campaign, size: float = 0.06) -> Campaign:
    """A relaxation in parallel whose time grows with amplitude, a share of the stiffness: no effect of the library."""
    sweeps = []
    for sweep in campaign.sweeps:
        turn = 2j * np.pi * sweep.frequency * 4e-3 * (sweep.amplitude / LEVELS[1]) ** 1.2
        sweeps.append(replace(sweep, stiffness=sweep.stiffness * (1.0 + size * turn / (1.0 + turn))))
    return replace(campaign, sweeps=tuple(sweeps), loops=())


@pytest.fixture(scope="module")
def evidence(measured: Measured, fitted: Fitted) -> Evidence:
    return fitted(with_relaxation(measured()))


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


def test_it_stands_where_it_was_not_fitted(described: Described) -> None:
    """The excess over the noise floor halves in whole runs that were held out, by a band narrower than half the gap."""
    held, correction = described.held, described.after.model.unnamed
    assert correction is not None
    print(held, correction.uncertainty, correction.size, correction.lengths)
    assert held.before is not None
    assert held.after is not None
    assert held.after - 1.0 < 0.5 * (held.before - 1.0)
    assert len(held.parts) == 3
    assert correction.uncertainty < 0.5


def test_the_parameters_beside_it_are_no_longer_bent(
    measured: Measured, fitted: Fitted, evidence: Evidence, described: Described
) -> None:
    """They lie nearer to those of the same rig without the gap than the plain fit's do."""
    truth = fitted(replace(measured(), loops=())).model.values
    off = [
        float(np.linalg.norm([np.log(model.values[name] / truth[name]) for name in truth]))
        for model in (evidence.model, described.after.model)
    ]
    print("off the parameters without the gap, plain and beside the correction:", off)
    assert off[1] < off[0]
    assert described.after.chi_square < 1.15 * evidence.residual.size


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
    assert any("the parameters are those beside it" in line for line in document["warnings"])
    assert complaints("diagnosis", json.loads(to_json(document)), whole=True) == []
    inside = predict(found.result, Direction.AXIAL, [45.0, 95.0], [LEVELS[1]]).stiffness
    assert np.all(inside.high - inside.value < 0.01 * inside.value)


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


def test_a_file_of_an_earlier_version_is_read_as_far_as_it_says_the_same(result: Result) -> None:
    document = json.loads(json.dumps(to_document(result)))
    document["unnamed"] |= {"tilt": 0.0, "peak": None}
    for patch in document["unnamed"]["patches"]:
        patch |= {"peak_in_phase": [], "peak_in_quadrature": []}
    assert from_document(document).model.unnamed == result.model.unnamed
    with pytest.raises(ModelError, match="a tilt or a peak"):
        from_document(document | {"unnamed": document["unnamed"] | {"tilt": 0.5}})


def test_an_effect_without_its_data_is_refused(result: Result) -> None:
    document = to_document(result)
    del document["unnamed"]
    with pytest.raises(ModelError, match="without its data"):
        from_document(document)


def test_predictions_use_it_inside_the_range_and_open_outside(result: Result) -> None:
    """Inside, the corrected stiffness has a narrow band; at ten times the frequency it is that of the parameters."""
    plain, amplitude = Result(result.model.without("unnamed")), [LEVELS[1]]
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
