"""Noise: what scatters and what a block shares, told apart by repeats; and that of a loop's rows, whitened."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.schema import RigSettings
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.fitting.prepare_loop import correlation_text, prepare_loop
from bushfit.fitting.rig_class import ASSUMED
from bushfit.fitting.row_noise import RowNoise, row_noise
from bushfit.geometry import Direction
from bushfit.reading.measurement import Loop, Sweep

FREQUENCIES = np.arange(5.0, 156.0, 10.0)
AMPLITUDES = (1e-4, 2e-4, 5e-4)


Noisy = Callable[..., Sweep]
ROWS = 3000


@pytest.fixture
def noisy_sweep(paper_model) -> Noisy:
    """Sweep(seed, random, gain, phase, repeats): errors of each kind, relative and [rad]."""

    def draw(seed: int, random: float = 5e-3, gain: float = 0.0, phase: float = 0.0, repeats: int = 3) -> Sweep:
        rng = np.random.default_rng(seed)
        level, repeat, f = (
            axis.ravel() for axis in np.meshgrid(AMPLITUDES, np.arange(1, repeats + 1), FREQUENCIES, indexing="ij")
        )
        block = np.repeat(rng.standard_normal((2, 3 * repeats)), FREQUENCIES.size, axis=1)
        scatter = random * rng.standard_normal((2, level.size))
        error = gain * block[0] + scatter[0] + 1j * (phase * block[1] + scatter[1])
        clean = paper_model.stiffness(Direction.AXIAL, f, level)
        return Sweep("sweep", Direction.AXIAL, f, level, clean * np.exp(error), repeat)

    return draw


def scatter_of(found: Sequence[SweepNoise]) -> np.ndarray:
    """Root mean square scatter of gain and phase over all lines, (2,)."""
    return np.sqrt(np.mean([np.square(list(noise.random.values())) for noise in found], axis=(0, 1)))


@pytest.mark.parametrize(("random", "gain", "phase"), [(5e-3, 0.0, 0.0), (1e-3, 8e-3, 1e-3), (1e-2, 3e-3, 6e-3)])
def test_both_parts_are_recovered(noisy_sweep, random, gain, phase):
    found = [sweep_noise([noisy_sweep(seed, random, gain, phase)]) for seed in range(200)]
    shared = np.sqrt(np.mean([np.square(noise.shared) for noise in found], axis=0))
    assert {noise.origin for noise in found} == {"repeats"}
    assert found[0].freedom == 6
    np.testing.assert_allclose(scatter_of(found), random, rtol=0.015)
    # a variance of nothing is estimated as nothing or a little, never as less
    np.testing.assert_allclose(shared, [gain, phase], rtol=0.1, atol=0.25 * random)


def test_scatter_grows_towards_low_frequency_where_repeats_show_it(noisy_sweep):
    flat = [sweep_noise([noisy_sweep(seed)]) for seed in range(200)]
    assert sum(bool(noise.slopes) for noise in flat) <= 2
    found = []
    for seed in range(50):
        clean, scattered = noisy_sweep(seed, 0.0), noisy_sweep(seed)
        error = np.log(scattered.stiffness / clean.stiffness) * (clean.frequency / 100.0) ** -0.6
        noise = sweep_noise([replace(clean, stiffness=clean.stiffness * np.exp(error))])
        ends = noise.random_noise("sweep", np.full(2, 1e-4), np.array([5.0, 155.0]))
        found.append(ends.mean(axis=0) / (5e-3 * (np.array([5.0, 155.0]) / 100.0) ** -0.6))
    np.testing.assert_allclose(np.mean(found, axis=0), 1.0, rtol=0.2)  # without growth they are 0.3 and 2.4


def test_the_class_of_a_rig_is_an_error_of_each_level(noisy_sweep):
    rig = RigSettings(gain_error=3e-3, displacement_error=4e-3)
    repeated, single = (sweep_noise([noisy_sweep(0, repeats=repeats)], rig) for repeats in (3, 1))
    assert repeated.level == pytest.approx((5e-3, 0.0))
    assert single.level == (0.0, 0.0)
    assert single.shared == pytest.approx((5e-3, ASSUMED[1]))
    assert "[rig]" in single.describe()


def test_a_column_of_errors_states_the_scatter(noisy_sweep):
    stated = replace(noisy_sweep(0), relative_error=np.tile([1e-2, 2e-2], noisy_sweep(0).frequency.size // 2))
    np.testing.assert_allclose(scatter_of([sweep_noise([stated])]), np.sqrt(2.5e-4))


def test_no_repeats_fall_back_to_a_smooth_curve_and_an_assumption(noisy_sweep):
    found = [sweep_noise([noisy_sweep(seed, 5e-3, repeats=1)]) for seed in range(50)]
    np.testing.assert_allclose(scatter_of(found), 5e-3, rtol=0.1)
    assert {noise.shared for noise in found} == {ASSUMED}
    assert {noise.origin for noise in found} == {"assumed"}
    assert "unless [rig] states" in found[0].describe()


def filtered(random: np.random.Generator, rows: int, correlation: float) -> np.ndarray:
    """Noise of unit variance, each row's correlated with the next."""
    noise = random.standard_normal(rows)
    for row in range(1, rows):
        noise[row] = correlation * noise[row - 1] + np.sqrt(1.0 - correlation**2) * noise[row]
    return noise


def low_passed(random: np.random.Generator, rows: int) -> np.ndarray:
    """Noise behind a second-order Butterworth filter at a twentieth of the sampling rate, unit variance."""
    from scipy.signal import butter, lfilter

    numerator, denominator = butter(2, 0.1)
    noise = lfilter(numerator, denominator, random.standard_normal(rows + 1000))[1000:]
    return noise / np.linalg.norm(lfilter(numerator, denominator, np.eye(1, 1000)[0]))


@pytest.mark.parametrize("correlation", [0.0, 0.9, 0.98])
def test_the_rig_s_filter_is_found_and_taken_out(rig, paper_model, correlation):
    found = [prepare_loop(rig(seed, force_correlation=correlation).loops[0]) for seed in range(15)]
    rows = np.array([data_set.row_noise.rows_as_one for data_set in found])
    assert rows.mean() == pytest.approx((1.0 + correlation) / (1.0 - correlation), rel=0.15)
    assert np.mean([data_set.relative_noise for data_set in found]) == pytest.approx(3e-3, rel=0.06)
    assert found[0].independent_count == pytest.approx(found[0].residual_count / rows[0])
    white = [data_set.residual(paper_model)[data_set.residual(paper_model) != 0.0] for data_set in found]
    assert np.mean([each @ each / data_set.residual_count for each, data_set in zip(white, found, strict=True)]) == (
        pytest.approx(1.0, abs=0.03)
    )
    assert abs(np.mean([np.corrcoef(each[1:], each[:-1])[0, 1] for each in white])) < 0.02
    if not correlation:
        assert np.mean([data_set.row_noise.order > 0 for data_set in found]) < 0.15
        assert correlation_text(found[0]) == ""
    if correlation == 0.9:
        assert correlation_text(found[0]).startswith(", correlated over about ")


def test_whitening_is_exact_from_the_first_row_on():
    found, size = row_noise(*2 * [2.0 * low_passed(np.random.default_rng(0), ROWS)], 3)
    assert size == pytest.approx(2.0, rel=0.1)
    whitening = found.whiten(np.eye(ROWS)[:200]).T[:200]
    covariance = np.linalg.inv(whitening) @ np.linalg.inv(whitening).T
    np.testing.assert_allclose(np.diag(covariance), 1.0, rtol=1e-6)
    np.testing.assert_allclose(np.diag(covariance, 3), covariance[0, 3], atol=1e-6)


def test_rows_of_other_cycles_are_whitened_anew():
    """Means over other cycles tell nothing of one another: between them the correlation is none."""
    from scipy.linalg import block_diag, toeplitz

    lengths, r = (7, 5, 1, 8), 0.9
    root = np.linalg.cholesky(block_diag(*(toeplitz(r ** np.arange(n)) for n in lengths)))
    noise = RowNoise(np.array([1.0, -r]) / np.sqrt(1.0 - r**2), np.ones((1, 1)), breaks=(7, 12, 13))
    white = noise.whiten(root.T)
    np.testing.assert_allclose(white.T @ white, np.eye(sum(lengths)), atol=1e-12)
    weight = np.ones(sum(lengths))
    weight[[3, 11]] = 0.0
    assert np.flatnonzero(~noise.usable_rows(weight)).tolist() == [3, 4, 11]


@pytest.mark.parametrize(
    ("kind", "cycles", "rows", "correlation"),
    [
        ("low-passed", 3, 1000, 0.0),
        ("filtered", 2, 1000, 0.9),
        ("filtered", 1, 1000, 0.9),
        ("filtered", 5, 1500, 0.94),
        pytest.param("filtered", 20, 1000, 0.98, marks=pytest.mark.slow),
        pytest.param("filtered", 8, 2000, 0.95, marks=pytest.mark.slow),
    ],
)
def test_harmonics_err_as_the_noise_says(kind, cycles, rows, correlation):
    """Of low-passed noise too, and of a lone cycle's. Long loops are counted in bins over groups of cycles: where these
    met, or bins held one row and two in turn, the mean squares here were 4.0, 4.4 and 2.7."""
    phase = np.arange(cycles * rows + 1) / rows

    def true_force(at: np.ndarray) -> np.ndarray:
        return 100.0 * np.sin(2.0 * np.pi * at + 0.6) + 3.0 * np.sin(6.0 * np.pi * at + 0.9)

    squares = []
    for random in map(np.random.default_rng, range(20)):
        made = low_passed(random, phase.size) if kind == "low-passed" else filtered(random, phase.size, correlation)
        motion = 1e-3 * np.sin(2.0 * np.pi * phase + 0.4)
        force = true_force(phase) + 0.3 * made
        data_set = prepare_loop(Loop("long", Direction.AXIAL, 10.0 * phase, motion, force))
        prepared = data_set
        assert prepared.measured_force.size < phase.size or cycles < 5
        error = data_set.whiten((true_force(prepared.phase) - prepared.measured_force) * data_set._per_noise)
        squares.append(np.mean(np.square(error @ np.linalg.qr(data_set.smooth_changes()[1:].T)[0])))
    assert 0.7 < np.mean(squares) < 1.5
