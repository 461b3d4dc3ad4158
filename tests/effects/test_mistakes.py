"""Mistakes in the record: each mends what it says, nothing else, and only where it can have been made."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.effects.mistakes import MISTAKES
from bushfit.geometry import Bushing, Direction
from bushfit.reading.measurement import Loop, Sweep

PHASE = np.linspace(0.0, 4.0 * np.pi, 200)
LOOP = Loop("slow", Direction.AXIAL, PHASE, 1e-3 * np.sin(PHASE), 400.0 * np.sin(PHASE + 0.1))


def swept(loss: float, direction: Direction = Direction.AXIAL, magnitude: float = 5e5) -> Sweep:
    stiffness = magnitude * (1.0 + 1j * loss) / np.hypot(1.0, loss) * np.ones(4)
    return Sweep("swept", direction, np.array([5.0, 15.0, 25.0, 35.0]), np.full(4, 2e-4), stiffness)


def mended(name: str, test: Any) -> Any:
    found = MISTAKES[name].corrected_test(test)
    assert found is not None, name
    return found


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
    assert MISTAKES["peak_to_peak"].corrected_test(LOOP) is None
    assert mended("sixty_times_faster", LOOP).time == pytest.approx(LOOP.time / 60.0)
    assert mended("pound_force", LOOP).force == pytest.approx(4.4482216 * LOOP.force)
    assert mended("inch", LOOP).displacement == pytest.approx(25.4 * LOOP.displacement)
    assert mended("other_direction", LOOP).direction is Direction.RADIAL
    tube = MISTAKES["diameters"].corrected_bushing(Bushing("tube", 0.02, 0.036, 0.034))
    assert tube == Bushing("tube", 0.01, 0.018, 0.034)
    cycle = Sweep("slow", Direction.AXIAL, np.array([1.0]), np.array([1e-3]), np.array([4e5 + 4e4j]))
    of_loop = MISTAKES["inch"].corrected_harmonic(cycle)
    assert (of_loop.amplitude, of_loop.stiffness) == (pytest.approx(25.4e-3), pytest.approx(cycle.stiffness / 25.4))
    assert MISTAKES["milliseconds"].corrected_harmonic(cycle).frequency == pytest.approx(1000.0)
