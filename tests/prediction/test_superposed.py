"""A small harmonic on a large motion: against the virtual rig stepped through time, and what it cannot answer."""

import numpy as np
import pytest

from bushfit.errors import ModelError
from bushfit.geometry import Direction
from bushfit.model import rig
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction.stiffness import predict
from bushfit.prediction.superposed import LargeMotion

LAWS = {
    "paper": {},
    "strain_stiffening": {"strain_stiffening.c3": 60.0},
    "asymmetry": {"asymmetry.c2": 3.0},
    "bump_stop": {"bump_stop.gap": 7e-4, "bump_stop.stiffness": 2e5},
    "sleeve_compliance": {"sleeve_compliance.compliance": 3e-7},
}
#: Of the harmonic: frequency [Hz] and amplitude [m].
FREQUENCY, AMPLITUDE = 21.0, 1e-4


def on_the_rig(model: Model, motion: LargeMotion) -> complex:
    """From rest: six slow cycles, or a ramp to the offset and 300 cycles; the harmonic of the end of the record."""
    steps = 512
    if motion.frequency:
        cycles = round(6 * FREQUENCY / motion.frequency)
        phase = np.arange(cycles * steps) / steps
        large = motion.displacement * np.sin(2.0 * np.pi * phase * motion.frequency / FREQUENCY)
        whole = round(2 * FREQUENCY / motion.frequency)
    else:
        phase = np.arange(300 * steps) / steps
        large, whole = motion.displacement * np.minimum(phase / 10.0, 1.0), 6
    displacement = large + AMPLITUDE * np.sin(2.0 * np.pi * phase)
    record = rig.imposed(model, Direction.AXIAL, displacement, 1.0 / (steps * FREQUENCY), FREQUENCY)
    against_creep = 1.0 if motion.frequency else np.hanning(whole * steps + 1)[:-1]
    window = against_creep * np.exp(-2j * np.pi * phase[-whole * steps :])
    return complex(window @ record.force[-whole * steps :]) / complex(window @ record.displacement[-whole * steps :])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("displacement", "slow"),
    [(1e-3, 2.0), (2e-3, 2.0), (1e-3, 0.0), (-1e-3, 0.0)],
    ids=["1 mm", "2 mm", "at 1", "at -1"],
)
def test_it_is_that_of_the_virtual_rig_within_a_percent(paper_model, law, displacement, slow):
    motion = LargeMotion(displacement, "m", slow)
    model = paper_model if law == "paper" else paper_model.with_effect(law, LAWS[law])
    found = predict(Result(model), Direction.AXIAL, [FREQUENCY], [AMPLITUDE], over=motion)
    stiffness = complex(found.storage_stiffness.value[0], found.loss_stiffness.value[0])
    expected = on_the_rig(model, motion)
    alone = model.stiffness("axial", FREQUENCY, AMPLITUDE)
    assert abs(stiffness / expected - 1.0) < 2e-3
    if motion.frequency or law in ("strain_stiffening", "asymmetry"):
        assert abs(alone / expected - 1.0) > 0.02


def test_a_vanishing_motion_changes_nothing_and_the_band_is_that_of_the_harmonic_alone(paper_model):
    covariance = Covariance(("mu", "sigma_fmax"), np.array([[4e8, 1e6], [1e6, 1e6]]))
    measured = Range((5.0, 155.0), (0.005, 0.05), ("axial",))
    result = Result(paper_model, ("mu", "sigma_fmax"), covariance, measured=measured)
    grid = (Direction.AXIAL, [10.0, 50.0], [2e-4, 5e-4])
    alone, over = (predict(result, *grid, over=motion) for motion in (None, LargeMotion(1e-9, "m")))
    for name in ("stiffness", "loss_factor"):
        for end in ("value", "low", "high"):
            values = [getattr(getattr(prediction, name), end) for prediction in (alone, over)]
            np.testing.assert_allclose(*values, rtol=2e-3)
    assert not any("large motion" in line for line in (*alone.warnings, *over.warnings))
    large = predict(result, *grid, over=LargeMotion(2e-3, "m", 0.5))
    told = [line for line in large.warnings if line.startswith("axial, with the large motion: predicted at")]
    assert [("frequencies of 0.5 Hz" in line, "strains of" in line) for line in told] == [(True, False), (False, True)]


@pytest.mark.parametrize(
    ("effects", "motion", "words"),
    [
        ([], LargeMotion(1e-3, "m", 1e-4), "do not suit the slow motion"),
        (["kraus"], LargeMotion(1e-3, "m"), "a law in time"),
    ],
)
def test_what_it_cannot_answer(paper_model, effects, motion, words):
    model = paper_model
    for effect in effects:
        model = model.with_effect(effect)
    with pytest.raises(ModelError, match=words):
        predict(Result(model), Direction.AXIAL, [5.0, 20.0], [1e-4], over=motion)
