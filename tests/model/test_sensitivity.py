"""Derivatives: analytic for the paper's branches, differences for the rest, both against higher-order differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.effects import BASE, History
from bushfit.effects.contract import Array, Values
from bushfit.geometry import Bushing, Direction
from bushfit.model.model import FIVE, Model
from bushfit.model.sensitivity import differences, force_and_slopes, stiffness_and_slopes

FREQUENCY = np.array([0.1, 5.0, 55.0, 155.0])
AMPLITUDE = np.array([1e-3, 1e-4, 2e-4, 5e-4])


def richardson(model: Model, name: str, respond: Callable[[Model], np.ndarray]) -> np.ndarray:
    """Fourth-order difference over 1e-3 of the value."""
    value, step = model.values[name], 1e-3 * model.values[name]
    far, low, high, end = (respond(model.with_values({name: value + k * step})) for k in (-2, -1, 1, 2))
    return (far - 8.0 * low + 8.0 * high - end) / (12.0 * step)


models = st.builds(
    lambda mu, m, alpha, sigma, eps: Model(
        Bushing("any", 0.01, 0.018, 0.034),
        BASE,
        {"mu": mu, "m": m, "alpha": alpha, "sigma_fmax": sigma, "eps_half": eps},
    ),
    st.floats(2e5, 4e6),
    st.floats(1e4, 1e6),
    st.floats(0.05, 0.9),
    st.floats(1e3, 1e5),
    st.floats(1e-3, 1e-1),
)


@given(models, st.sampled_from(list(Direction)))
def test_stiffness_slopes(model: Model, direction: Direction) -> None:
    amplitude = AMPLITUDE * (100.0 if direction.is_rotation else 1.0)
    _, found = stiffness_and_slopes(model, direction, FREQUENCY, amplitude, FIVE)
    scale = np.abs(model.stiffness(direction, FREQUENCY, amplitude))
    for row, name in zip(found, FIVE, strict=True):
        expected = richardson(model, name, lambda m: m.stiffness(direction, FREQUENCY, amplitude))
        assert np.max(np.abs(row - expected) * model.values[name] / scale) < 1e-9


@pytest.mark.parametrize(("cycles", "tolerance"), [(1.0, 1e-9), (2.4, 1e-5)], ids=["steady", "from rest"])
@pytest.mark.parametrize("direction", ["axial", "radial"])
def test_force_slopes(paper_model: Model, direction: Direction, cycles: float, tolerance: float) -> None:
    motion = 1e-3 * np.sin(2.0 * np.pi * np.arange(int(256 * cycles)) / 256)
    history = History(motion, 10.0 / 256, periodic=cycles == 1.0, frequency=0.1)
    _, found = force_and_slopes(paper_model, direction, history, FIVE)
    peak = np.max(np.abs(paper_model.force(direction, history)))
    for row, name in zip(found, FIVE, strict=True):
        expected = richardson(paper_model, name, lambda m: m.force(direction, history))
        error = np.max(np.abs(row - expected)) * paper_model.values[name] / peak
        print(f"{direction} dF/d{name}: {error:.1e} of the peak per relative change")
        assert error < tolerance


def test_analytic_derivatives_are_used_and_agree_with_the_differences(
    paper_model: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    at = ("axial", FREQUENCY, AMPLITUDE)
    _, by_differences = differences(paper_model, FIVE, lambda values: paper_model.stiffness(*at, values=values))
    monkeypatch.setattr("bushfit.model.sensitivity.differences", None)
    _, analytic = stiffness_and_slopes(paper_model, *at, FIVE)
    np.testing.assert_allclose(analytic, by_differences, rtol=1e-5, atol=1e-5 * np.abs(analytic).max(axis=1).min())
    assert np.array_equal(stiffness_and_slopes(paper_model, *at, ("eps_half", "mu"))[1], analytic[[4, 0]])


def test_one_sided_at_a_bound(paper_model: Model) -> None:
    """alpha = 1 may not be exceeded; the neutral mass 0 may be left both ways or one."""
    edge = paper_model.with_values({"alpha": 1.0})
    at = ("axial", FREQUENCY, AMPLITUDE)

    def respond(values: Values) -> Array:
        assert np.max(values["alpha"]) <= 1.0
        return edge.stiffness(*at, values=values)

    _, found = differences(edge, ["alpha"], respond)
    np.testing.assert_allclose(found, stiffness_and_slopes(edge, *at, ["alpha"])[1], rtol=1e-4)
    heavy = paper_model.with_effect("inertia")
    slope = stiffness_and_slopes(heavy, *at, ["inertia.mass"])[1][0]
    np.testing.assert_allclose(slope, -((2.0 * np.pi * FREQUENCY) ** 2), rtol=1e-6, atol=1e-2)


@pytest.mark.parametrize("direction", list(Direction))
def test_what_belongs_to_another_place_has_no_slope_there(paper_model: Model, direction: Direction) -> None:
    model = paper_model.with_effect("stiffness_factor.radial").with_effect("amplitude_rolloff")
    names = [*model.parameters]
    amplitude = AMPLITUDE * (100.0 if direction.is_rotation else 1.0)
    response, found = stiffness_and_slopes(model, direction, FREQUENCY, amplitude, names)
    known = differences(model, names, lambda v: model.stiffness(direction, FREQUENCY, amplitude, values=v))
    np.testing.assert_array_equal(response, known[0])
    np.testing.assert_array_equal(found, known[1])
    moved = dict(zip(names, np.any(found != 0.0, axis=1), strict=True))
    assert moved["mu"]
    assert moved["stiffness_factor.radial"] == (direction == Direction.RADIAL)


@pytest.mark.parametrize("cycles", [0, 2], ids=["steady", "from rest"])
@pytest.mark.parametrize("moved", [0.0, 1e-9, 1e-5, 1e-4, 0.02])
def test_slopes_under_a_compliant_rig_hold_however_near_the_last_model_was(
    paper_model: Model, moved: float, cycles: int
) -> None:
    """The motion is solved no further than a fit needs: derivatives are right to a thousandth all the same."""
    last = paper_model.with_effect("sleeve_compliance", {"sleeve_compliance.compliance": 8e-8})
    last = last.with_values({"sigma_fmax": 5e4, "eps_half": 2e-3}).with_effect("maxwell", {"maxwell.mu1": 0.0})
    model = last.with_values({name: value * (1.0 + moved) for name, value in last.values.items() if name in FIVE})
    samples = np.arange(256 * max(cycles, 1)) / 256
    loop = History(3e-4 * np.sin(2.0 * np.pi * samples), 1.0 / 256, periodic=not cycles, frequency=1.0, accuracy=1e-8)
    exact = replace(loop, accuracy=1e-13, solved={})
    names = list(model.parameters)
    force_and_slopes(last, Direction.AXIAL, loop, names)
    force, slopes = force_and_slopes(model, Direction.AXIAL, loop, names)
    np.testing.assert_allclose(
        force, model.force(Direction.AXIAL, exact, kind="loop"), rtol=0.0, atol=1e-7 * force.max()
    )
    for name, slope in zip(names, slopes, strict=True):
        expected = differences(model, [name], lambda values: model.force("axial", exact, kind="loop", values=values))[1]
        off = np.abs(slope - expected[0]).max() / np.abs(expected).max() if np.any(expected) else np.abs(slope).max()
        print(f"{name}: off by {off:.1e}")
        assert off < 1e-3
