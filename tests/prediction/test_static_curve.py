"""Slow motions against the virtual rig: the static curve, and a large motion below a small harmonic."""

import numpy as np
import pytest

from bushfit.effects.unnamed import Patch, SmoothCorrection
from bushfit.errors import ModelError
from bushfit.geometry import Direction
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Range, Result
from bushfit.prediction.static_curve import static_curve
from bushfit.prediction.stiffness import predict
from bushfit.prediction.superposed import LargeMotion
from bushfit.reading.preload import Preload
from bushfit.simulation import rig

#: 10 mm/min.
RATE = 10e-3 / 60.0
#: Values of effects by name, each beside the laws of the paper.
LAWS = {
    "paper": {},
    "strain_stiffening": {"strain_stiffening.c3": 60.0},
    "fifth_power_stiffening": {"fifth_power_stiffening.c5": 4000.0},
    "asymmetry": {"asymmetry.c2": 3.0},
    "bump_stop": {"bump_stop.gap": 7e-4, "bump_stop.stiffness": 2e5},
    "sleeve_compliance": {"sleeve_compliance.compliance": 3e-7},
}
#: Of the harmonic: frequency [Hz] and amplitude [m].
FREQUENCY, AMPLITUDE = 21.0, 1e-4


@pytest.mark.parametrize("law", LAWS)
def test_the_curve_is_that_of_the_virtual_rig(paper_model, law):
    """The last of 12 triangular cycles from rest, stepped through time, at equal displacements."""
    model = paper_model if law == "paper" else paper_model.with_effect(law, LAWS[law])
    reach = 2e-3
    curve = static_curve(Result(model), Direction.AXIAL, reach, RATE)
    frequency = RATE / (4.0 * reach)
    record = rig.simulate_cycles(
        model, Direction.AXIAL, frequency, reach, cycles=1, run_in=11, steps_per_cycle=4000, waveform="triangle"
    )
    top, bottom = np.argmax(record.displacement), np.argmin(record.displacement)
    falling = slice(top, bottom + 1)
    rising = np.r_[bottom : record.force.size, 1 : top + 1]
    unloading = np.interp(curve.displacement, record.displacement[falling][::-1], record.force[falling][::-1])
    loading = np.interp(curve.displacement, record.displacement[rising], record.force[rising])
    largest = np.abs(record.force).max()
    for name, force in (("loading", loading), ("unloading", unloading), ("mean", 0.5 * (loading + unloading))):
        assert np.abs(getattr(curve, name).value - force).max() < 1e-3 * largest
    if law == "asymmetry":
        assert curve.mean.value[-1] > -1.05 * curve.mean.value[0] > 0.0
    np.testing.assert_allclose(
        np.trapezoid(curve.slope.value, curve.displacement), np.ptp(curve.mean.value[[0, -1]]), rtol=0.002
    )
    assert curve.secant.value[0] == pytest.approx(np.ptp(curve.mean.value[[0, -1]]) / (2.0 * reach), rel=1e-12)


def test_the_band_is_what_the_covariance_makes_of_the_force(paper_model):
    covariance = Covariance(("mu", "sigma_fmax"), np.array([[4e8, 1e6], [1e6, 1e6]]))
    curve = static_curve(Result(paper_model, ("mu", "sigma_fmax"), covariance), Direction.RADIAL, 5e-4, RATE)
    rows = []
    for name, step in (("mu", 1e3), ("sigma_fmax", 10.0)):
        changed = paper_model.with_values({name: paper_model.values[name] + step})
        rows.append((static_curve(Result(changed), Direction.RADIAL, 5e-4, RATE), step))
    for name in ("loading", "mean", "slope", "secant"):
        band = getattr(curve, name)
        slopes = np.array([(getattr(moved, name).value - band.value) / step for moved, step in rows])
        half = 1.959964 * np.sqrt(np.einsum("in,ij,jn->n", slopes, covariance.matrix, slopes))
        np.testing.assert_allclose(band.high - band.value, half, rtol=1e-4, atol=1e-6 * half.max())
        np.testing.assert_allclose(band.value - band.low, half, rtol=1e-4, atol=1e-6 * half.max())


@pytest.mark.parametrize(("c2", "c3"), [(0.0, 20.0), (2.0, 30.0), (3.0, 0.0)])
@pytest.mark.parametrize(("offset", "reach"), [(1e-3, 5e-4), (-8e-4, 6e-4)])
def test_about_a_preload_it_is_that_of_the_rig_with_the_whole_elastic_law(paper_model, c2, c3, offset, reach):
    samples, frequency = 1000, RATE / (4.0 * reach)
    phase = np.arange(8 * samples + 1) / samples
    motion = offset * np.minimum(2.0 * phase, 1.0) + reach * rig.wave("triangle", phase - 0.5) * (phase >= 0.5)
    whole = paper_model.with_effect("asymmetry", {"asymmetry.c2": c2})
    whole = whole.with_effect("strain_stiffening", {"strain_stiffening.c3": c3})
    force = rig.simulate_motion(whole, Direction.AXIAL, motion, 1.0 / (frequency * samples), frequency).force
    rising = np.diff(motion[-samples - 1 :]) > 0.0
    ways = []
    for way in (rising, ~rising):
        rows = np.nonzero(way)[0] - samples
        rows = rows[np.argsort(motion[rows])]
        ways.append(np.interp(np.linspace(-0.9, 0.9, 91) * reach, motion[rows] - offset, force[rows]))
    values = {f"preload.{name}": 0.0 for name in ("friction", "friction_square", "rate", "rate_square")}
    loaded = paper_model.with_effect("preload", {"preload.c2": c2, "preload.c3": c3, **values})
    curve = static_curve(Result(loaded), Direction.AXIAL, reach, RATE, preload=Preload(offset, "m"))
    expected, mean = np.mean(ways, axis=0), curve.mean.value[5:-5]
    np.testing.assert_allclose(mean - mean[45], expected - expected[45], atol=0.005 * np.ptp(expected) / 2.0)


def test_a_smooth_correction_changes_the_curve_as_in_a_sine(paper_model):
    node = (RATE / 4e-3,), (1e-3 * paper_model.unit_strain(Direction.AXIAL),)
    data = SmoothCorrection(0.1, (1.0, 1.0), (Patch(("axial",), *node, (0.1,), (0.0,), (0.01,), (0.01,)),))
    effects = (*paper_model.effects, "unnamed")
    corrected = Model.with_defaults(paper_model.bushing, effects, paper_model.values, data)
    curve, plain = (static_curve(Result(model), Direction.AXIAL, 1e-3, RATE) for model in (corrected, paper_model))
    assert curve.secant.value == pytest.approx(1.1 * plain.secant.value, rel=1e-3)
    assert curve.secant.high - curve.secant.value == pytest.approx(1.96 * 0.01 * plain.secant.value, rel=0.05)


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
    record = rig.simulate_motion(model, Direction.AXIAL, displacement, 1.0 / (steps * FREQUENCY), FREQUENCY)
    against_creep = 1.0 if motion.frequency else np.hanning(whole * steps + 1)[:-1]
    window = against_creep * np.exp(-2j * np.pi * phase[-whole * steps :])
    return complex(window @ record.force[-whole * steps :]) / complex(window @ record.displacement[-whole * steps :])


@pytest.mark.parametrize("law", [law for law in LAWS if law != "fifth_power_stiffening"])
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
    assert not any("large motion" in line for line in map(str, (*alone.warnings, *over.warnings)))
    large = predict(result, *grid, over=LargeMotion(2e-3, "m", 0.5))
    told = [line for line in map(str, large.warnings) if line.startswith("axial, with the large motion: predicted at")]
    assert [("frequencies of 0.5 Hz" in line, "strains of" in line) for line in told] == [(True, False), (False, True)]


@pytest.mark.parametrize(
    ("effect", "motion", "words"),
    [
        ("maxwell", LargeMotion(1e-3, "m", 1e-4), "is not fast compared with the slow motion"),
        ("kraus", LargeMotion(1e-3, "m"), "computed over time"),
    ],
)
def test_what_it_cannot_answer(paper_model, effect, motion, words):
    with pytest.raises(ModelError, match=words):
        predict(Result(paper_model.with_effect(effect)), Direction.AXIAL, [5.0, 20.0], [1e-4], over=motion)
