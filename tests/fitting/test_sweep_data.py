"""Residuals in units of noise: white where the model is right, with the derivatives that belong to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import SimulateSettings
from bushfit.fitting.data_sets import Residuals, SweepData, loop_data, sweep_data
from bushfit.fitting.noise import SweepNoise
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from bushfit.reading.measurement import Sweep

RANDOM, SHARED = (5e-3, 7e-3), (4e-3, 3.5e-3)
BLOCKS = {(1e-4, 1): 16, (1e-4, 2): 9, (5e-4, 1): 16}


@pytest.fixture
def data_set(paper_model: Model) -> SweepData:
    """Three blocks, one of them short, in scrambled order, exactly on the model."""
    amplitude = np.concatenate([np.full(n, x) for (x, _), n in BLOCKS.items()])
    repeat = np.concatenate([np.full(n, r) for (_, r), n in BLOCKS.items()])
    frequency = np.concatenate([np.linspace(5.0, 155.0, n) for n in BLOCKS.values()])
    order = np.random.default_rng(0).permutation(amplitude.size)
    amplitude, repeat, frequency = amplitude[order], repeat[order], frequency[order]
    stiffness = paper_model.stiffness("axial", frequency, amplitude)
    sweep = Sweep("sweep", Direction.AXIAL, frequency, amplitude, stiffness, repeat)
    levels = {("sweep", 1e-4): RANDOM, ("sweep", 5e-4): (1e-2, 2e-3)}
    return SweepData(sweep, SweepNoise(levels, SHARED, "repeats", 6))


def covariance_of(data_set: SweepData) -> np.ndarray:
    """Covariance of all gain, then all phase deviations, in the data set's order: random and shared by block."""
    repeat = data_set.repeat
    same = (data_set.amplitude[:, None] == data_set.amplitude) & (repeat[:, None] == repeat)
    random = np.array([data_set.noise.random["sweep", float(x)] for x in data_set.amplitude])
    halves = [np.diag(random[:, part] ** 2) + data_set.noise.shared[part] ** 2 * same for part in (0, 1)]
    zero = np.zeros_like(halves[0])
    return np.block([[halves[0], zero], [zero, halves[1]]])


def test_whitening_gives_the_identity(data_set: SweepData) -> None:
    n = data_set.frequency.size
    unit = np.concatenate([np.eye(n), 1j * np.eye(n)])
    whitening = data_set.whiten(unit).T
    white = whitening @ covariance_of(data_set) @ whitening.T
    worst = np.max(np.abs(white - np.eye(2 * n)))
    print(f"whitened covariance: {worst:.1e} from the identity")
    assert worst < 1e-12


def test_right_model_leaves_no_residual(data_set: SweepData, paper_model: Model) -> None:
    assert np.max(np.abs(data_set.residual(paper_model))) < 1e-10
    assert np.max(data_set.relative(paper_model)) < 1e-12
    assert data_set.size == data_set.residual(paper_model).size == 2 * data_set.frequency.size


def test_blocks_are_found_in_scrambled_rows(data_set: SweepData) -> None:
    assert np.diff(np.append(data_set.block_starts, data_set.frequency.size)).tolist() == list(BLOCKS.values())
    np.testing.assert_array_equal(data_set.measured, data_set.sweep.stiffness[data_set.order])
    for begin, count in zip(data_set.block_starts, BLOCKS.values(), strict=True):
        assert np.all(np.diff(data_set.frequency[begin : begin + count]) > 0.0)


def test_at_amplitudes_keeps_a_level_with_its_noise(data_set: SweepData) -> None:
    part = data_set.at_amplitudes((1e-4,))
    assert set(part.amplitude) == {1e-4}
    assert part.frequency.size == 25
    assert part.noise is data_set.noise


@pytest.mark.parametrize("residuals", ["complex", "magnitude_loss_factor"])
def test_residuals_of_noisy_campaigns_are_white(
    rig: Callable[..., Campaign], shared_noise: SimulateSettings, paper_model: Model, residuals: Residuals
) -> None:
    squares = [
        np.mean(sweep.residual(paper_model) ** 2)
        for seed in range(40)
        for sweep in sweep_data(rig(paper_model, shared_noise, seed).sweeps, residuals)
    ]
    print(f"{residuals}: mean square residual of the true model {np.mean(squares):.3f}")
    assert np.mean(squares) == pytest.approx(1.0, abs=0.05)


def by_differences(respond: Callable[[Model], np.ndarray], model: Model, name: str) -> np.ndarray:
    value = model.values[name]
    far, low, high, end = (respond(model.with_values({name: value * (1.0 + k * 1e-3)})) for k in (-2, -1, 1, 2))
    return (far - 8.0 * low + 8.0 * high - end) / (12e-3 * value)


@pytest.mark.parametrize("residuals", ["complex", "magnitude_loss_factor"])
def test_sweep_jacobian(data_set: SweepData, paper_model: Model, residuals: Residuals) -> None:
    wrong = paper_model.with_values({"mu": 1.3e6, "alpha": 0.3, "sigma_fmax": 1e4})
    chosen = replace(data_set, residuals=residuals)
    found = chosen.jacobian(wrong, FIVE)
    for name, row in zip(FIVE, found, strict=True):
        expected = by_differences(chosen.residual, wrong, name)
        error = np.max(np.abs(row - expected)) / np.max(np.abs(expected))
        print(f"{residuals} d/d{name}: {error:.1e}")
        assert error < 1e-8


def test_magnitude_and_loss_factor_are_what_they_say(data_set: SweepData, paper_model: Model) -> None:
    chosen = replace(data_set, residuals="magnitude_loss_factor")
    stiffer = paper_model.with_values({"mu": 1.2e6})
    found, measured = data_set.stiffness(stiffer), data_set.measured
    deviation = chosen.deviation(stiffer)
    np.testing.assert_allclose(deviation.real, np.abs(found) / np.abs(measured) - 1.0, atol=1e-12)
    loss = found.imag / found.real - measured.imag / measured.real
    np.testing.assert_allclose(deviation.imag, loss * (measured.real / np.abs(measured)) ** 2, atol=1e-12)


@pytest.mark.parametrize("model", ["paper_model", "wrong"])
def test_loop_jacobian(
    rig: Callable[..., Campaign], paper_noise: SimulateSettings, paper_model: Model, model: str
) -> None:
    (data_set,) = loop_data(rig(paper_model, paper_noise, 1).loops)
    at = paper_model if model == "paper_model" else paper_model.with_values({"mu": 2e6, "eps_half": 3e-3, "alpha": 0.6})
    found = data_set.jacobian(at, FIVE)
    for name, row in zip(FIVE, found, strict=True):
        expected = by_differences(data_set.residual, at, name)
        assert np.max(np.abs(row - expected)) < 1e-7 * np.max(np.abs(expected))


def test_a_stack_of_values_is_one_call(data_set: SweepData, paper_model: Model) -> None:
    stacked = {**paper_model.values, "mu": np.array([[1e6], [1.09e6], [1.2e6]])}
    found = data_set.residual(paper_model, stacked)
    assert found.shape == (3, data_set.size)
    assert np.max(np.abs(found[1])) < 1e-10
    np.testing.assert_allclose(
        found[2], data_set.residual(paper_model.with_values({"mu": 1.2e6})), rtol=1e-9, atol=1e-9
    )
