"""Model: independent numbers, broadcasting, text, and what it refuses."""

from __future__ import annotations

import pickle
from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest

from bushfit.effects import BASE, History
from bushfit.geometry import Direction
from bushfit.model.model import Model


def test_the_whole_reference_table(paper_model: Model, root: Path) -> None:
    """192 points of an independent computation."""
    table = np.loadtxt(root / "data/reference/stiffness_table1.csv", delimiter=",", skiprows=1, dtype=str)
    assert len(table) == 192
    assert set(table[:, 0]) == set(Direction)
    for direction in Direction:
        frequency, amplitude, magnitude, loss = table[table[:, 0] == direction, 1:].astype(float).T
        found = paper_model.stiffness(direction, frequency, amplitude)
        gaps = np.abs(np.abs(found) / magnitude - 1.0), np.abs(found.imag / found.real / loss - 1.0)
        print(f"{direction}: |k| within {gaps[0].max():.1e}, loss factor within {gaps[1].max():.1e}")
        assert np.max(gaps) < 2e-4


def test_one_call_broadcasts(paper_model: Model) -> None:
    frequency, amplitude = np.linspace(5.0, 155.0, 16), np.array([[1e-4], [2e-4], [5e-4]])
    grid = paper_model.stiffness("axial", frequency, amplitude)
    assert (grid.shape, grid.dtype) == ((3, 16), complex)
    assert grid[1, 4] == paper_model.stiffness("axial", frequency[4], amplitude[1, 0])
    assert grid[1, 4].shape == ()
    stacked = {**paper_model.values, "mu": np.array([[1e6], [2e6]])}
    both = paper_model.stiffness("axial", frequency, 1e-4, values=stacked)
    assert both.shape == (2, 16)
    np.testing.assert_allclose(both[1], paper_model.with_values({"mu": 2e6}).stiffness("axial", frequency, 1e-4))


def test_force_of_a_stack_of_histories(paper_model: Model) -> None:
    cycle = np.sin(2.0 * np.pi * np.arange(256) / 256)
    both = paper_model.force("axial", History.steady(np.stack([1e-4 * cycle, 1e-3 * cycle]), 0.1))
    assert both.shape == (2, 256)
    np.testing.assert_allclose(both[1], paper_model.force("axial", History.steady(1e-3 * cycle, 0.1)), rtol=1e-9)


def test_limits_at_rest_and_at_standstill(paper_model: Model) -> None:
    """Zero amplitude: friction is a spring; zero frequency: the springpot is gone."""
    v = paper_model.values
    modulus = v["mu"] + v["sigma_fmax"] / (2.0 * v["eps_half"])
    expected = paper_model.stiffness_per_modulus(Direction.AXIAL) * modulus
    assert complex(paper_model.stiffness("axial", 0.0, 0.0)) == pytest.approx(expected, rel=1e-12)


def test_a_model_does_not_change(paper_model: Model) -> None:
    given = dict(paper_model.values)
    model = Model(paper_model.bushing, BASE, given)
    given["mu"] = 1.0
    assert model.values["mu"] == 1.09e6
    with pytest.raises(TypeError):
        model.values["mu"] = 1.0  # type: ignore[index]
    with pytest.raises(FrozenInstanceError):
        model.effects = ()  # type: ignore[misc]
    other = model.with_effect("inertia", {"inertia.mass": 0.1})
    assert (model.effects, other.effects) == (BASE, (*BASE, "inertia"))
    copy = pickle.loads(pickle.dumps(model))
    assert copy == paper_model != copy.with_values({"mu": 1e6})


def test_order_of_adding_does_not_matter(paper_model: Model) -> None:
    mass, soft = ("inertia", {"inertia.mass": 0.1}), ("rig_compliance", {"rig_compliance.compliance": 5e-8})
    one = paper_model.with_effect(*mass).with_effect(*soft)
    other = paper_model.with_effect(*soft).with_effect(*mass)
    assert one.effects != other.effects
    assert one.equation() == other.equation()
    assert one.stiffness("axial", 100.0, 1e-4) == other.stiffness("axial", 100.0, 1e-4)


def test_equation_is_text(paper_model: Model) -> None:
    text = paper_model.with_effect("inertia", {"inertia.mass": 0.1}).equation()
    assert text.isascii()
    words = ("K = k (mu + m/2 (i omega)^alpha + (A + iB)/(2 e0)", "inertia: ", "mu = 1.09 MPa", "inertia.mass = 0.1 kg")
    assert all(each in text for each in words)
