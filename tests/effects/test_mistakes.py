"""Mistakes in the record: each mends what it says, nothing else, and only where it can have been made."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.effects import LIBRARY
from bushfit.effects.contract import Level
from bushfit.effects.mistakes import MISTAKES, candidate_named, file_or_name, mistake_named
from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction
from bushfit.reading.measurement import Loop, Source, Sweep

PHASE = np.linspace(0.0, 4.0 * np.pi, 200)
LOOP = Loop("slow", Direction.AXIAL, PHASE, 1e-3 * np.sin(PHASE), 400.0 * np.sin(PHASE + 0.1))
NAMES = sorted(name for name, mistake in MISTAKES.items() if mistake.kinds)


def swept(loss: float, direction: Direction = Direction.AXIAL, magnitude: float = 5e5) -> Sweep:
    stiffness = magnitude * (1.0 + 1j * loss) / np.hypot(1.0, loss) * np.ones(4)
    return Sweep("swept", direction, np.array([5.0, 15.0, 25.0, 35.0]), np.full(4, 2e-4), stiffness)


def stated(loss: float, magnitude: float = 5e5) -> Sweep:
    """A sweep as the reader has it from |K| and a loss factor, whatever these are."""
    return swept(loss, magnitude=magnitude)


def test_names_stand_for_one_thing_and_no_mistake_has_a_parameter() -> None:
    assert not MISTAKES.keys() & LIBRARY.keys()
    assert all(mistake.level is Level.RECORD and mistake.parameters == () for mistake in MISTAKES.values())
    assert str(Level.RECORD) == "record"


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("direction", list(Direction))
def test_a_test_keeps_its_shape_name_and_weight(name: str, direction: Direction) -> None:
    for test in (swept(0.1, direction), Loop("slow", direction, LOOP.time, LOOP.displacement, LOOP.force)):
        mended = MISTAKES[name].mended(test)
        kind = "sweep" if isinstance(test, Sweep) else "loop"
        if mended is None:
            mistake = MISTAKES[name]
            turned = mistake.motion is not None and mistake.motion is not direction.motion
            assert kind not in mistake.kinds or turned or mistake.doubt or (mistake.swaps and direction == "torsion")
        else:
            assert type(mended) is type(test)
            assert (mended.name, mended.weight, mended.noise) == (test.name, test.weight, test.noise)


@given(st.floats(0.02, 0.6), st.floats(1e5, 1e7))
def test_the_loss_is_mended_as_it_was_measured(loss: float, magnitude: float) -> None:
    truth = swept(loss, magnitude=magnitude).stiffness
    angle = np.arctan(loss)
    cases = {
        "sin_delta": stated(np.sin(angle), magnitude),
        "loss_as_ratio": stated(loss / 100.0, magnitude),
        "phase_in_radians": stated(np.tan(np.radians(angle)), magnitude),
        "complement": stated(1.0 / loss, magnitude),
        "loss_in_per_cent": stated(100.0 * loss, magnitude),
        "storage_for_magnitude": stated(loss, magnitude * np.cos(angle)),
    }
    for name, test in cases.items():
        mended = MISTAKES[name].mended(test)
        assert mended is not None, name
        assert np.allclose(mended.stiffness, truth, rtol=1e-9), name
    beside = Sweep("swept", Direction.AXIAL, *np.ones((2, 4)), np.abs(truth) + 1j * truth.imag)
    assert np.allclose(MISTAKES["magnitude_for_storage"].mended(beside).stiffness, truth)  # type: ignore[union-attr]


def test_amplitudes_rates_units_and_directions_are_mended() -> None:
    halved = MISTAKES["peak_to_peak"].mended(swept(0.1))
    doubled = MISTAKES["zero_to_peak"].mended(swept(0.1))
    assert halved is not None and doubled is not None  # noqa: PT018
    assert halved.amplitude == pytest.approx(1e-4)
    assert doubled.amplitude == pytest.approx(4e-4)
    assert np.array_equal(halved.stiffness, swept(0.1).stiffness)
    assert MISTAKES["peak_to_peak"].mended(LOOP) is None
    faster, pounds, inches = (MISTAKES[name].mended(LOOP) for name in ("sixty_times_faster", "pound_force", "inch"))
    assert faster is not None and pounds is not None and inches is not None  # noqa: PT018
    assert faster.time == pytest.approx(LOOP.time / 60.0)
    assert pounds.force == pytest.approx(4.4482216 * LOOP.force)
    assert inches.displacement == pytest.approx(25.4 * LOOP.displacement)
    other = MISTAKES["other_direction"].mended(LOOP)
    assert other is not None
    assert other.direction is Direction.RADIAL
    tube = MISTAKES["diameters"].mended_bushing(Bushing("tube", 0.02, 0.036, 0.034))
    assert tube == Bushing("tube", 0.01, 0.018, 0.034)


def test_the_fundamental_of_a_loop_is_mended_as_the_loop_is() -> None:
    cycle = Sweep("slow", Direction.AXIAL, np.array([1.0]), np.array([1e-3]), np.array([4e5 + 4e4j]))
    mended = MISTAKES["inch"].mended_cycle(cycle)
    assert mended.amplitude == pytest.approx(25.4e-3)
    assert mended.stiffness == pytest.approx(cycle.stiffness / 25.4)
    assert MISTAKES["milliseconds"].mended_cycle(cycle).frequency == pytest.approx(1000.0)


def test_a_correction_names_file_table_and_line() -> None:
    test = Sweep(
        "a", Direction.RADIAL, *np.ones((2, 3)), np.ones(3, complex), source=Source(Path("tests/radial.csv"), "0")
    )
    assert MISTAKES["peak_to_peak"].corrected(test) == '[[sweeps]] of radial.csv: amplitude = "peak-to-peak"'
    assert MISTAKES["other_direction"].corrected(test) == '[[sweeps]] of radial.csv: direction = "axial"'
    assert 'units = { force = "kgf" }' in MISTAKES["kilogram_force"].corrected(LOOP)
    assert 'units = { stiffness = "kgf/mm" }' in MISTAKES["kilogram_force"].corrected(test)
    assert "inner_radius" in MISTAKES["diameters"].corrected(None)
    assert file_or_name(test) == "radial.csv"
    assert not any("{{" in MISTAKES[name].corrected(test) + MISTAKES[name].corrected(LOOP) for name in NAMES)


def test_a_name_with_its_test_is_known_and_another_refused() -> None:
    assert candidate_named("peak_to_peak:sweep_axial") is candidate_named("peak_to_peak") is MISTAKES["peak_to_peak"]
    assert candidate_named("inertia") is LIBRARY["inertia"]
    assert mistake_named("inertia") is None
    with pytest.raises(ModelError, match="unknown mistake"):
        candidate_named("peak_to_pique:sweep_axial")
    with pytest.raises(ModelError, match="unknown effect"):
        candidate_named("peak_to_pique")
