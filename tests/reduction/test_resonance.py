"""Resonance tests, simulated with a known stiffness and reduced again."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit.effects.contract import Array
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Source
from bushfit.reading.resonance import ResonanceTest
from bushfit.reduction.resonance import MOST_POINTS, Resonance, reduce_resonance, shaken_response, transmissibility

#: [kg] and [m/s^2]: the paper's bushing then has its resonance near 165 Hz, at some 0.1 mm.
MASS, BASE = 0.6, 20.0


def shaken(model: Model, rows: int, noise: Callable[[int], Array] | None = None) -> ResonanceTest:
    """A test of the paper's bushing from 60 to 500 Hz, simulated; `noise` of T is relative."""
    frequency = np.geomspace(60.0, 500.0, rows)
    base = BASE / (2.0 * np.pi * frequency) ** 2
    _, ratio = shaken_response(lambda x: model.stiffness(Direction.AXIAL, frequency, x), MASS, frequency, base)
    if noise:
        ratio = ratio * (1.0 + noise(rows) + 1j * noise(rows))
    return ResonanceTest("t", Direction.AXIAL, frequency, ratio, np.full(rows, BASE), Source(Path("t.csv"), ""))


def misses(found: Resonance, model: Model) -> Array:
    """What the points miss the stiffness by at their frequency and amplitude, relative to |K|, complex, (k,)."""
    truth = model.stiffness(Direction.AXIAL, found.frequency, found.amplitude)
    return found.stiffness / truth - 1.0


@given(st.floats(1e4, 1e7), st.floats(0.01, 1.0), st.floats(0.0, 0.9), st.floats(1e-3, 1.0), st.floats(1e-7, 1e-3))
def test_a_response_solves_its_equation(stiffness, loss, softer, half, base):
    """X = |T(K(X)) - 1| X_base, for a stiffness that falls with X from K to (1 - softer) K."""
    resonance = np.sqrt(stiffness / 0.5) / (2.0 * np.pi)
    frequency = resonance * np.array([0.1, 0.5, 0.9, 1.0, 1.1, 2.0, 10.0])

    def of_amplitude(x: Array) -> Array:
        return stiffness * (1.0 - softer * x / (x + half)) * (1.0 + 1j * loss)

    amplitude, ratio = shaken_response(of_amplitude, 0.5, frequency, np.full(7, base))
    assert np.allclose(ratio, transmissibility(of_amplitude(amplitude), 0.5, frequency), rtol=1e-12)
    assert np.allclose(amplitude, np.abs(ratio - 1.0) * base, rtol=1e-9)


@pytest.mark.parametrize("rows", [40, 2000])
def test_a_clean_test_gives_the_stiffness_back(paper_model, rows):
    found = reduce_resonance(shaken(paper_model, rows), MASS)
    off = np.abs(misses(found, paper_model))
    assert off.size == min(rows, MOST_POINTS)
    assert off.max() < (1e-12 if rows < MOST_POINTS else 1e-3)
    assert found.rows.sum() == rows
    assert not found.turned
    assert found.warnings == ()


def wandering(random: np.random.Generator, sigma: float) -> Callable[[int], Array]:
    """Noise that neighbouring rows share: white noise averaged over a thirtieth of the rows."""

    def noise(rows: int) -> Array:
        width = rows // 30
        white = random.standard_normal(rows + width - 1)
        return sigma / np.sqrt(width) * np.convolve(white, np.ones(width), "valid")

    return noise


@pytest.mark.parametrize(
    ("rows", "sigma", "shared", "least", "most"),
    [
        (12, 0.003, False, 0.92, 0.98),
        (40, 0.01, False, 0.92, 0.98),
        (2000, 0.05, False, 0.93, 0.99),
        (2000, 0.01, True, 0.9, 0.98),
    ],
)
def test_standard_errors_cover_what_points_miss(paper_model, rows, sigma, shared, least, most):
    """Also where neighbouring rows share their errors, as those of a slow sweep do."""
    off = []
    for seed in range(40):
        random = np.random.default_rng(seed)
        noise = wandering(random, sigma) if shared else lambda n, r=random: sigma * r.standard_normal(n)
        found = reduce_resonance(shaken(paper_model, rows, noise), MASS)
        missed = misses(found, paper_model) / found.relative_error
        off += [missed.real, missed.imag]
    assert least < float(np.mean(np.abs(np.concatenate(off)) < 1.96)) < most


def test_a_sweep_without_its_resonance_says_so(paper_model):
    test = shaken(paper_model, 80)
    above = test.frequency > 250.0
    cut = {name: getattr(test, name)[above] for name in ("frequency", "transmissibility", "base_acceleration")}
    assert any(
        "no resonance" in sentence for sentence in map(str, reduce_resonance(replace(test, **cut), MASS).warnings)
    )
