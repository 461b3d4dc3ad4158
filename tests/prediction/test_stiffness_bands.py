"""Prediction: the table of the interface, bands, the rig's faults left out, and what it says that it cannot."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fits import joint_fit

from bushfit.campaign.simulated import SimulatedSweep, SimulateSettings
from bushfit.geometry import Bushing, Direction
from bushfit.model.covariance import Covariance
from bushfit.model.result import Range, Result
from bushfit.model.transfer import transfer_compound
from bushfit.prediction.caveats import caveats
from bushfit.prediction.grid import PAPER_AMPLITUDES, PAPER_FREQUENCIES, default_grid
from bushfit.prediction.resonance import predict_resonance
from bushfit.prediction.stiffness import predict
from bushfit.reading.measurement import Sweep
from bushfit.report.tables import predicted_resonance_table, prediction_table
from bushfit.simulation.exact import simulate_exact
from bushfit.simulation.measured import measure

#: A grid, not in order [Hz] and [m].
FREQUENCIES = np.array([155.0, 5.0, 55.0])
AMPLITUDES = np.array([5e-4, 1e-4])
FOUR = ("stiffness [N/mm]", "loss factor [-]", "storage stiffness [N/mm]", "loss stiffness [N/mm]")
COMPARED = "compared with finite elements"
OFF = f"+4.9 % in stiffness and +36 % in strain {COMPARED}"
EXCLUDES = "The band excludes the error of the"


@pytest.mark.parametrize(
    ("amplitudes", "frequencies"),
    [((2e-4,), PAPER_FREQUENCIES), ((1e-4, 2e-4, 5e-4), (50.0,))],
    ids=["one amplitude", "one frequency"],
)
def test_bands_of_an_open_model_are_narrow_where_it_was_measured_and_only_there(paper_model, amplitudes, frequencies):
    """The direction that such sweeps leave wholly open cancels where the stiffness does not depend on it."""
    plan = SimulateSettings(repeats=3, noise=5e-3, sweeps=(SimulatedSweep(Direction.AXIAL, amplitudes, frequencies),))
    result = joint_fit(measure(simulate_exact(paper_model, plan), plan).campaign())

    def width(frequency: float, amplitude: float) -> float:
        band = predict(result, Direction.AXIAL, [frequency], [amplitude]).stiffness
        return float(((band.high - band.low) / band.value)[0])

    there = [width(frequency, amplitude) for frequency in frequencies for amplitude in amplitudes]
    elsewhere = width(2.0 * frequencies[-1], 3.0 * amplitudes[-1])
    assert max(there) < 0.04
    assert elsewhere > 0.2


@pytest.fixture
def either(paper_model) -> Result:
    """The paper's bushing with a sleeve that flexes, or a rig that gives way."""
    model = paper_model.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": 2e-8})
    names, measured = ("mu", "sleeve_compliance.compliance"), Range((5.0, 155.0), (1e-3, 0.1))
    covariance = Covariance(names, np.diag([1e6, 1e-18]))
    return Result(model, names, covariance, measured=measured, unresolved=("sleeve_compliance",))


def test_what_may_be_the_rigs_is_predicted_both_ways_and_the_bands_span_both(either):
    found = predict(either, Direction.RADIAL, FREQUENCIES, AMPLITUDES)
    settled = replace(either, model=either.model.with_twin("rig_compliance"), unresolved=())
    other = predict(settled, Direction.RADIAL, FREQUENCIES, AMPLITUDES)
    told = predict(replace(either, unresolved=()), Direction.RADIAL, FREQUENCIES, AMPLITUDES)
    np.testing.assert_array_equal(found.stiffness.value, told.stiffness.value)
    np.testing.assert_array_equal(found.if_in_rig.stiffness.value, other.stiffness.value)
    assert np.all(other.stiffness.value > 1.05 * told.stiffness.value)
    np.testing.assert_array_equal(found.stiffness.low, told.stiffness.low)
    np.testing.assert_allclose(found.stiffness.high, other.stiffness.high)
    assert told.if_in_rig is None
    table = prediction_table(found)
    rigs = [f"{name}, if caused by the rig" for name in FOUR]
    assert list(table.columns[14:]) == rigs
    np.testing.assert_allclose(table[rigs[1]], found.if_in_rig.loss_factor.value)
    said = "\n".join(map(str, (*found.warnings, *caveats(either))))
    assert "is assigned to the bushing, but these tests cannot distinguish it from rig_compliance" in said
    assert "% with sleeve_compliance in the rig; the band, low to high, includes both" in said
    assert predict(either, Direction.RADIAL, FREQUENCIES, AMPLITUDES, rig=True).warnings == told.warnings
    shaken = predict_resonance(either, Direction.RADIAL, 1.0, 1.0, None)
    assert shaken.if_in_rig.peak[0] > 1.02 * shaken.peak[0]
    assert f"at {shaken.if_in_rig.peak[0]:.4g} Hz" in shaken.warnings[-1].text
    rigs_too = predicted_resonance_table(shaken)["transmissibility [-], if caused by the rig"]
    np.testing.assert_allclose(rigs_too, np.abs(shaken.if_in_rig.transmissibility))


def swept(frequency: object, amplitude: object, **more: Any) -> Sweep:
    f, x = np.broadcast_arrays(np.asarray(frequency, dtype=float), amplitude)
    return Sweep("s.csv", more.pop("direction", Direction.AXIAL), f, x, np.full(f.size, 1e6 + 1e5j), **more)


@pytest.mark.parametrize(("kelvin", "beyond"), [(None, True), (300.0, True), (343.0, False)])
def test_the_default_temperature_is_extrapolated_too_if_all_tests_were_warmer(paper_model, kelvin, beyond):
    measured = Range((1.0, 200.0), (1e-4, 1.0), ("axial",), (333.0, 353.0))
    warm = Result(paper_model.with_effect("temperature"), measured=measured)
    kinds = [warning.kind for warning in predict(warm, Direction.AXIAL, [10.0], [1e-4], temperature=kelvin).warnings]
    assert ("extrapolated_temperature" in kinds) is beyond


def test_default_grid_is_that_of_the_sweeps_in_the_direction_where_there_are_any(result):
    """Two that miss the same set point are one, in a file or in one file a frequency."""
    radial = swept([1.0, 80.0, 1.004, 20.0], [1e-3, 4e-4, 2e-4, 1e-3], direction=Direction.RADIAL)
    frequencies, amplitudes = default_grid(result, Direction.RADIAL, [radial])
    assert frequencies.tolist() == [1.0, 20.0, 80.0]
    assert amplitudes.tolist() == [2e-4, 4e-4, 1e-3]
    assert tuple(default_grid(result, Direction.AXIAL, [radial])[1]) == PAPER_AMPLITUDES
    levels = np.array([0.02, 0.05, 0.1, 0.2, 0.35, 0.6, 1.0]) * 1e-3
    missed = ((1.0, 0.985), (10.0, 1.0), (50.0, 1.02))
    files = [swept(f, levels * miss, stepped="amplitude") for f, miss in missed]
    frequencies, amplitudes = default_grid(result, Direction.AXIAL, files)
    assert (frequencies.tolist(), amplitudes.tolist()) == ([1.0, 10.0, 50.0], levels.tolist())


def test_the_compound_is_carried_to_another_bushing(result):
    """Same material, other shape: stiffness goes as the shape does; what belongs to the old bushing stays there."""
    model = result.model.with_effect("stiffness_factor.radial", {"stiffness_factor.radial": 1.1})
    model = model.with_effect("inertia").with_effect("clearance").with_effect("viscous")
    wide = Bushing("wide", 0.010, 0.018, 0.068)
    other, said = transfer_compound(replace(result, model=model), wide)
    assert other.model.effects == ("elastic", "springpot", "friction", "viscous")
    assert "clearance, stiffness_factor.radial, inertia" in said.text
    here, there = (predict(each, Direction.AXIAL, [10.0, 50.0], [1e-4]) for each in (result, other))
    np.testing.assert_allclose(there.stiffness.value, 2.0 * here.stiffness.value)
    np.testing.assert_allclose(
        np.subtract(there.stiffness.high, there.stiffness.low),
        2.0 * np.subtract(here.stiffness.high, here.stiffness.low),
    )
    assert any("extrapolated" in line for line in map(str, predict(other, Direction.RADIAL, [10.0], [5e-3]).warnings))


@pytest.mark.parametrize(
    ("direction", "fitted", "inner", "shape", "said"),
    [
        ("radial", "axial", 0.010, "paper", [f"within its noise. {EXCLUDES} radial formula, for this shape {OFF}"]),
        ("torsion", "axial radial", 0.010, "paper", [f"axial and radial tests. {EXCLUDES} torsion"]),
        ("radial", "axial radial", 0.010, "paper", [f"fitted with the paper's formula, for this shape {OFF}"]),
        ("axial", "axial", 0.010, "paper", []),
        ("radial", "", 0.010, "paper", []),
        ("radial", "axial", 0.010, "calibrated", [f"up to 1 % in stiffness and 3 % in strain {COMPARED}"]),
        ("radial", "axial", 0.016, "paper", ["+7.3 % in stiffness and +47 % in strain", "2 GPa would lower"]),
        ("radial", "axial", 0.017, "paper", ["radial formula, which was not compared with finite elements of this"]),
    ],
)
def test_a_band_that_lacks_the_error_of_a_formula_says_so(result, bushing, direction, fitted, inner, shape, said):
    """Of the very shape; silent where another was fitted by its exact formula, or where an older file does not say."""
    reach = Range((0.1, 155.0), (1e-9, 1.0), tuple(Direction(name) for name in fitted.split()))
    model = replace(result.model, bushing=replace(bushing, inner_radius=inner, shape=shape))
    found = predict(replace(result, model=model, measured=reach), Direction(direction), [5.0], [1e-6]).warnings
    assert len(found) == len(said)
    assert all(part in line.text for part, line in zip(said, found, strict=True)), found
