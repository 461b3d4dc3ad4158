"""What a diagnosis cannot tell apart, predictions leave open: their bands hold the model with each of it.

The data are the virtual rig's, with effects in them that the model of a fit lacks.
"""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from asking import asked
from rigged import Measured, changed
from scipy.stats import binomtest
from test_schemas import complaints

from bushfit.campaign.campaign import Campaign
from bushfit.effects.contract import Array, Level
from bushfit.effects.unnamed import Patch, Unnamed
from bushfit.errors import ModelError
from bushfit.geometry import Direction
from bushfit.model.file import from_document, to_document
from bushfit.model.model import Model
from bushfit.model.result import Alternative, Result, carried
from bushfit.prediction.caveats import caveats
from bushfit.prediction.stiffness import predict, predict_resonance
from bushfit.units import number

FREQUENCIES, AMPLITUDES = np.geomspace(5.0, 155.0, 9), np.geomspace(1e-4, 5e-4, 5)
#: How much stiffer the radial tests are than the axial ones predict, of the bushing or of the rig.
STIFFER = 1.06


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


def test_bands_hold_each_model_that_may_be_right(measured: Measured) -> None:
    found = asked(changed(measured(), 1, STIFFER))
    assert found.verdict == "ambiguous"
    result = found.result
    assert len(result.alternatives) > 1
    band = predict(result, Direction.RADIAL, FREQUENCIES, AMPLITUDES).stiffness
    for each in result.alternatives:
        there = radial(each.model)
        assert np.all((band.low <= there * (1.0 + 1e-9)) & (there <= band.high * (1.0 + 1e-9)))
    assert any("low and high of predictions hold the model with each" in line for line in caveats(result))
    document = json.loads(json.dumps(to_document(result)))
    assert complaints("model", document, whole=False) == []
    again = from_document(document)
    assert [each.model for each in again.alternatives] == [each.model for each in result.alternatives]
    np.testing.assert_array_equal(predict(again, Direction.RADIAL, FREQUENCIES, AMPLITUDES).stiffness.low, band.low)


def test_they_are_told_of_a_resonance_and_stay_with_a_compound_that_is_carried(measured: Measured) -> None:
    result = asked(changed(measured(), 1, STIFFER)).result
    shaken = Direction.RADIAL, 50.0, 1.0, np.linspace(30.0, 80.0, 501)
    peaks = [predict_resonance(Result(each.model), *shaken).peak[0] for each in result.alternatives]
    (line,) = (line for line in predict_resonance(result, *shaken).warnings if "possible" in line)
    assert f"{number(min(peaks), 4)} to {number(max(peaks), 4)} Hz" in line
    other, _ = carried(
        replace(result, warnings=(*result.warnings, *result.undecided)), replace(result.model.bushing, name="x")
    )
    said = caveats(other)
    assert not any("cannot tell what the model lacks" in line for line in (*other.warnings, *said))
    assert any("other values of the parameters possible" in line for line in said)


def test_a_file_keeps_a_correction_that_alternatives_have_too(paper_model: Model) -> None:
    rows = ((5.0, 50.0), (0.01, 0.01), (0.01, 0.02), (0.0, 0.0), (0.001, 0.001), (0.001, 0.001))
    data = Unnamed(0.02, (0.9, 0.9), (Patch(("axial",), *rows),))
    corrected = replace(paper_model, effects=(*paper_model.effects, "unnamed"), unnamed=data)
    found = Result(corrected, alternatives=(Alternative(corrected.with_effect("inertia"), 0.6),))
    document = json.loads(json.dumps(to_document(found)))
    assert from_document(document).alternatives == found.alternatives
    document["alternatives"][0]["values"]["mu"] = -1.0
    with pytest.raises(ModelError, match="alternatives, #1"):
        from_document(document)


def test_what_was_corrected_counts_as_error_where_the_compound_is_carried(paper_model: Model) -> None:
    rows = ((5.0, 155.0), (0.001, 0.1), (0.05, 0.05), (0.0, 0.0), (0.001, 0.001), (0.001, 0.001))
    data = Unnamed(0.05, (2.0, 2.0), (Patch(("axial", "radial"), *rows),))
    corrected = Result(replace(paper_model, effects=(*paper_model.effects, "unnamed"), unnamed=data))
    other, _ = carried(corrected, replace(paper_model.bushing, name="x"))
    band = predict(other, Direction.AXIAL, [20.0], [2e-4]).stiffness
    assert (band.high - band.value) / band.value > 0.05


@pytest.mark.slow
def test_bands_hold_the_truth_whichever_it_is(measured: Measured, paper_model: Model) -> None:
    """Of the campaigns that are told to be ambiguous; simulated, three effects, eight seeds each: a bushing that is
    stiffer radially, a rig that is, and a sleeve that gives way."""
    soft, shares = 4e-8, list[float]()
    sleeve = paper_model.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": soft})
    for seed in range(8):
        plain = radial(paper_model)
        shares += covered(changed(measured(seed=seed), 1, STIFFER), STIFFER * plain, plain)
        shares += covered(measured({"sleeve_compliance": {"compliance": soft}}, seed=seed), radial(sleeve))
    whole = sum(share > 0.95 for share in shares)
    print(f"{whole} of {len(shares)} truths of ambiguous campaigns", binomtest(whole, len(shares)).proportion_ci())
    assert len(shares) > 8
    assert np.mean(shares) > 0.93
