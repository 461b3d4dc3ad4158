"""Model: an independent table, broadcasting, files, text, errors."""

from __future__ import annotations

import csv
import json
import pickle
import re
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bushfit.effects import BASE, History
from bushfit.errors import ModelError
from bushfit.geometry import Bushing, Direction
from bushfit.model.file import from_document, to_document
from bushfit.model.model import FIVE, Model
from bushfit.model.result import Result


def test_the_whole_reference_table(paper_model: Model, root: Path) -> None:
    with (root / "data/reference/stiffness_table1.csv").open(newline="") as stream:
        rows = list(csv.reader(stream))[1:]
    directions = np.array([row[0] for row in rows])
    frequency, amplitude, magnitude, loss = np.array([row[1:] for row in rows], dtype=float).T
    assert len(rows) == 192
    assert set(directions) == set(Direction)
    for direction in Direction:
        at = directions == direction
        found = paper_model.stiffness(direction, frequency[at], amplitude[at])
        gaps = np.abs(np.abs(found) / magnitude[at] - 1.0), np.abs(found.imag / found.real / loss[at] - 1.0)
        print(f"{direction}: |k| within {gaps[0].max():.1e}, loss factor within {gaps[1].max():.1e}, {at.sum()} points")
        assert max(gaps[0].max(), gaps[1].max()) < 2e-4


@pytest.mark.parametrize(
    ("direction", "amplitude", "frequency", "magnitude", "loss"),
    [
        ("axial", 1e-4, 5.0, 5.910e5, 0.0986),
        ("axial", 1e-4, 155.0, 6.939e5, 0.1414),
        ("axial", 5e-4, 5.0, 5.226e5, 0.1134),
        ("radial", 1e-4, 5.0, 4.121e6, 0.1139),
        ("radial", 1e-4, 155.0, 4.929e6, 0.1588),
    ],
)
def test_spot_values(
    paper_model: Model, direction: Direction, amplitude: float, frequency: float, magnitude: float, loss: float
) -> None:
    found = complex(paper_model.stiffness(direction, frequency, amplitude)[()])
    assert abs(found) == pytest.approx(magnitude, rel=2e-4)
    assert found.imag / found.real == pytest.approx(loss, abs=6e-5)


def test_one_call_broadcasts(paper_model: Model) -> None:
    frequency, amplitude = np.linspace(5.0, 155.0, 16), np.array([[1e-4], [2e-4], [5e-4]])
    grid = paper_model.stiffness("axial", frequency, amplitude)
    assert grid.shape == (3, 16)
    assert grid.dtype == complex
    assert grid[1, 4] == paper_model.stiffness("axial", frequency[4], amplitude[1, 0])
    stacked = {**paper_model.values, "mu": np.array([[1e6], [2e6]])}
    both = paper_model.stiffness("axial", frequency, 1e-4, values=stacked)
    assert both.shape == (2, 16)
    np.testing.assert_allclose(both[1], paper_model.with_values({"mu": 2e6}).stiffness("axial", frequency, 1e-4))


def test_scalars_give_a_scalar(paper_model: Model) -> None:
    assert paper_model.stiffness("axial", 5.0, 1e-4).shape == ()


def test_force_of_a_stack_of_histories(paper_model: Model) -> None:
    cycle = np.sin(2.0 * np.pi * np.arange(256) / 256)
    both = paper_model.force("axial", History.steady(np.stack([1e-4 * cycle, 1e-3 * cycle]), 0.1))
    assert both.shape == (2, 256)
    np.testing.assert_allclose(both[1], paper_model.force("axial", History.steady(1e-3 * cycle, 0.1)), rtol=1e-9)


def test_limits_at_rest_and_at_standstill(paper_model: Model) -> None:
    """Zero amplitude: friction is a spring; zero frequency: the springpot is gone."""
    v = paper_model.values
    still = paper_model.stiffness("axial", 0.0, 0.0)
    expected = paper_model.bushing.stiffness_per_modulus(Direction.AXIAL) * (
        v["mu"] + v["sigma_fmax"] / (2.0 * v["eps_half"])
    )
    assert complex(still[()]) == pytest.approx(expected, rel=1e-12)


def test_json_there_and_back(paper_model: Model) -> None:
    document = json.loads(json.dumps(to_document(Result(paper_model))))
    assert document["parameters"]["mu"].items() >= {"value": 1.09e6, "unit": "Pa"}.items()
    assert document["effects"] == list(BASE)
    assert document["bushing"]["outer_radius_m"] == 0.018
    back = from_document(document).model
    assert back == paper_model


def test_pickle_and_equality(paper_model: Model) -> None:
    copy = pickle.loads(pickle.dumps(paper_model))
    assert copy == paper_model
    assert copy.with_values({"mu": 1e6}) != paper_model


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
    assert model.effects == BASE
    assert other.effects == (*BASE, "inertia")


def test_equation_is_text(paper_model: Model) -> None:
    text = paper_model.with_effect("inertia", {"inertia.mass": 0.1}).equation()
    assert text.isascii()
    assert "K = k (mu + m/2 (i omega)^alpha + (A + iB)/(2 e0)" in text
    assert "inertia: " in text
    assert "mu = 1.09 MPa" in text
    assert "inertia.mass = 0.1 kg" in text


def test_order_of_adding_does_not_matter(paper_model: Model) -> None:
    sizes = {"rig_compliance": {"rig_compliance.compliance": 5e-8}, "inertia": {"inertia.mass": 0.1}}
    one, other = paper_model, paper_model
    for name in sizes:
        one = one.with_effect(name, sizes[name])
    for name in reversed(sizes):
        other = other.with_effect(name, sizes[name])
    assert one.effects != other.effects
    assert one.equation() == other.equation()
    assert one.stiffness("axial", 100.0, 1e-4) == other.stiffness("axial", 100.0, 1e-4)


@pytest.mark.parametrize(
    ("effects", "changes", "words"),
    [
        (("elastic", "springpott", "friction"), {}, "did you mean springpot"),
        (("elastic", "elastic"), {}, "listed twice"),
        (BASE, {"alpha": 1.5}, "alpha: impossible value"),
        (BASE, {"mu": -1.0}, "mu: impossible value"),
        (BASE, {"eps_half": float("nan")}, "eps_half: impossible value"),
        (BASE, {"sigma_fmax": float("inf")}, "sigma_fmax: impossible value"),
        (BASE, {"nu": 0.5}, "nu: unknown parameter"),
        (("elastic", "friction"), {}, "unknown parameter"),
    ],
)
def test_errors_say_what_is_wrong(
    bushing: Bushing, table_1: dict[str, float], effects: tuple[str, ...], changes: dict[str, float], words: str
) -> None:
    with pytest.raises(ModelError, match=re.escape(words)):
        Model(bushing, effects, {**table_1, **changes})


@pytest.mark.parametrize("name", FIVE)
def test_a_missing_value_is_named(bushing: Bushing, table_1: dict[str, float], name: str) -> None:
    del table_1[name]
    with pytest.raises(ModelError, match=f"{name}: a parameter has no value"):
        Model(bushing, BASE, table_1)


def _without(key: str) -> Any:
    return lambda document: document.pop(key)


def _with(*path: str, value: object) -> Any:
    def change(document: dict[str, Any]) -> None:
        for key in path[:-1]:
            document = document[key]
        document[path[-1]] = value

    return change


@pytest.mark.parametrize(
    "damage",
    [
        _without("bushing"),
        _without("effects"),
        _without("parameters"),
        _with("effects", value=3),
        _with("bushing", value="CMP"),
        _with("bushing", "length_m", value="long"),
        _with("bushing", "length_m", value=None),
        _with("parameters", value=[1, 2]),
        _with("parameters", "mu", value=1.0),
        _with("parameters", "mu", value={}),
        _with("parameters", "mu", "value", value=None),
    ],
)
def test_a_damaged_document_is_a_model_error(paper_model: Model, damage: Any) -> None:
    document = json.loads(json.dumps(to_document(Result(paper_model))))
    damage(document)
    with pytest.raises(ModelError):
        from_document(document)
