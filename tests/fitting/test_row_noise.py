"""Noise of a loop's rows: its correlation found between the cycle's harmonics, and whitened. All data are simulated."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import SimulateSettings
from bushfit.fitting.data_sets import LoopData
from bushfit.fitting.drive import drive_of
from bushfit.fitting.row_noise import RowNoise, row_noise
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop

Rig = Callable[..., Campaign]
ROWS = 3000
IDEAL = SimulateSettings()


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
    response = lfilter(numerator, denominator, np.eye(1, 1000)[0])
    return noise / np.linalg.norm(response)


def cycles_of(loop: Loop, cycles: int, noise: np.ndarray, rows: int = 1000) -> Loop:
    """The second cycle of a loop so many times over, with noise on its force in 0.3 % of half its range."""
    once = slice(rows, 2 * rows)
    force = np.tile(loop.force[once], cycles)
    return replace(
        loop,
        time=(loop.time[1] - loop.time[0]) * np.arange(force.size),
        displacement=np.tile(loop.displacement[once], cycles),
        force=force + 3e-3 * np.ptp(force) / 2.0 * noise,
    )


def test_a_record_that_misses_its_last_cycle_by_rounding_tells_its_noise_from_all(rig: Rig) -> None:
    """Three cycles, whose frequency the motion's own noise puts off by a part in a million: half end too soon."""
    clean = rig(force_noise=0.0, displacement_noise=0.0).loops[0]
    loop = cycles_of(clean.at(slice(None, None, 4)), 3, filtered(np.random.default_rng(0), 750, 0.98), rows=250)
    drives = [
        drive_of(replace(loop, displacement=loop.displacement + 2e-7 * random.standard_normal(750)))
        for random in map(np.random.default_rng, range(6))
    ]
    assert {drive.cycles < 3.0 for drive in drives} == {True, False}
    rows = [drive.row_noise.rows_as_one for drive in drives]
    assert max(rows) < 1.01 * min(rows)


@pytest.mark.parametrize("correlation", [0.0, 0.9, 0.98])
def test_the_rig_s_filter_is_found_and_taken_out(rig: Rig, paper_model: Model, correlation: float) -> None:
    found = [LoopData(drive_of(rig(seed, force_correlation=correlation).loops[0])) for seed in range(15)]
    rows = np.array([data_set.drive.row_noise.rows_as_one for data_set in found])
    true = (1.0 + correlation) / (1.0 - correlation)
    assert rows.mean() == pytest.approx(true, rel=0.15)
    assert np.mean([data_set.relative_noise for data_set in found]) == pytest.approx(3e-3, rel=0.06)
    assert found[0].independent == pytest.approx(found[0].counted / rows[0])
    white = [data_set.residual(paper_model)[data_set.residual(paper_model) != 0.0] for data_set in found]
    assert np.mean([each @ each / data_set.counted for each, data_set in zip(white, found, strict=True)]) == (
        pytest.approx(1.0, abs=0.03)
    )
    assert abs(np.mean([np.corrcoef(each[1:], each[:-1])[0, 1] for each in white])) < 0.02
    if not correlation:
        assert np.mean([data_set.drive.row_noise.order > 0 for data_set in found]) < 0.15
        assert found[0].drive.correlated == ""
    if correlation == 0.9:
        assert found[0].drive.correlated.startswith(", correlated over about ")


@pytest.mark.parametrize(("kind", "cycles"), [("low-passed", 3), ("filtered", 2), ("filtered", 1)])
def test_smooth_misfit_is_judged_by_the_noise_it_stands_in(
    rig: Rig, paper_model: Model, kind: str, cycles: int
) -> None:
    """The harmonics of pure noise, whitened, scatter by one: of low-passed noise too, and of a lone cycle's."""
    (clean,), random = rig(settings=IDEAL).loops, np.random.default_rng(1)
    squares = []
    for _ in range(25):
        rows = 1000 * cycles
        noise = low_passed(random, rows) if kind == "low-passed" else filtered(random, rows, 0.9)
        data_set = LoopData(drive_of(cycles_of(clean, cycles, noise)))
        basis = np.linalg.qr(data_set.contrasts().T)[0]
        squares.append(np.mean(np.square(data_set.residual(paper_model) @ basis)))
    mean, error = np.mean(squares), np.std(squares) / np.sqrt(len(squares))
    print(f"{kind}, {cycles} cycles: mean square of the harmonics {mean:.2f} +- {1.96 * error:.2f}, 1 if right")
    assert 0.75 < mean < 1.35


def test_a_row_left_out_tells_nothing(rig: Rig, paper_model: Model) -> None:
    data_set = LoopData(drive_of(rig(2, force_correlation=0.9).loops[0]))
    weight = np.ones(data_set.size)
    weight[400:420] = 0.0
    light = data_set.weighted(weight)
    wild = replace(light, drive=replace(light.drive, force=np.where(weight > 0.0, light.drive.force, 1e6)))
    assert np.array_equal(wild.residual(paper_model), light.residual(paper_model))
    assert np.all(light.residual(paper_model)[400:421] == 0.0)
    assert light.misfit(paper_model)[420] != 0.0


def test_whitening_is_exact_from_the_first_row_on() -> None:
    found, size = row_noise(*2 * [2.0 * low_passed(np.random.default_rng(0), ROWS)], 3)
    assert size == pytest.approx(2.0, rel=0.1)
    whitening = found.whiten(np.eye(ROWS)[:200]).T[:200]
    covariance = np.linalg.inv(whitening) @ np.linalg.inv(whitening).T
    np.testing.assert_allclose(np.diag(covariance), 1.0, rtol=1e-6)
    np.testing.assert_allclose(np.diag(covariance, 3), covariance[0, 3], atol=1e-6)
    shares = np.zeros((1, 200))
    shares[0, 50:60] = 0.1
    np.testing.assert_allclose(found.error_of_sums(shares), np.sqrt(covariance[50:60, 50:60].mean()), rtol=1e-3)


def test_rows_of_other_cycles_are_whitened_anew() -> None:
    """Means over other cycles tell nothing of one another: between them the correlation is none."""
    from scipy.linalg import block_diag, toeplitz

    lengths, r = (7, 5, 1, 8), 0.9
    root = np.linalg.cholesky(block_diag(*(toeplitz(r ** np.arange(n)) for n in lengths)))
    noise = RowNoise(np.array([1.0, -r]) / np.sqrt(1.0 - r**2), np.ones((1, 1)), breaks=(7, 12, 13))
    white = noise.whiten(root.T)
    np.testing.assert_allclose(white.T @ white, np.eye(sum(lengths)), atol=1e-12)
    weight = np.ones(sum(lengths))
    weight[[3, 11]] = 0.0
    assert np.flatnonzero(~noise.counting(weight)).tolist() == [3, 4, 11]


@pytest.mark.parametrize(
    ("cycles", "rows", "correlation"),
    [(5, 1500, 0.94), *(pytest.param(*case, marks=pytest.mark.slow) for case in ((20, 1000, 0.98), (8, 2000, 0.95)))],
)
def test_harmonics_of_a_long_loop_err_as_its_noise_says(cycles: int, rows: int, correlation: float) -> None:
    """Long loops are counted in bins over groups of cycles. Where groups met, or bins held one row and two in turn, the
    filter took the steps between their weights for information: the mean squares here were 4.0, 4.4 and 2.7."""
    phase = np.arange(cycles * rows + 1) / rows

    def true_force(at: np.ndarray) -> np.ndarray:
        return 100.0 * np.sin(2.0 * np.pi * at + 0.6) + 3.0 * np.sin(6.0 * np.pi * at + 0.9)

    squares = []
    for seed in range(20):
        noise = 0.3 * filtered(np.random.default_rng(seed), phase.size, correlation)
        motion = 1e-3 * np.sin(2.0 * np.pi * phase + 0.4)
        data_set = LoopData(drive_of(Loop("long", Direction.AXIAL, 10.0 * phase, motion, true_force(phase) + noise)))
        drive = data_set.drive
        assert drive.force.size < phase.size
        error = data_set._whitened((true_force(drive.phase) - drive.force) * data_set._per_noise)
        squares.append(np.mean(np.square(error @ np.linalg.qr(data_set.contrasts()[1:].T)[0])))
    mean, unsure = np.mean(squares), np.std(squares) / np.sqrt(len(squares))
    print(f"{cycles} cycles of {rows} rows: mean square of the harmonics {mean:.2f} +- {unsure:.2f}, 1 if right")
    assert 0.7 < mean < 1.5


def test_noise_that_a_filter_took_away_has_a_floor() -> None:
    """No frequency weighs more than the floor of 3e-4 of the variance lets it: 58 times a white row's."""
    found, _ = row_noise(*2 * [low_passed(np.random.default_rng(0), ROWS)], 3)
    gain = np.abs(np.fft.rfft(found.filter, 4096))
    assert 10.0 < gain.max() < 80.0


def test_how_an_unsure_filter_moves_the_covariance() -> None:
    noise, _ = row_noise(*2 * [filtered(np.random.default_rng(0), ROWS, 0.9)], 3)
    assert noise.order == 1
    assert noise.error is not None
    influence = np.cos(np.arange(ROWS) / 40.0)[None]

    def variance(coefficient: float) -> float:
        """Of the influence on rows that the found filter whitens, where the true one has another coefficient."""
        true = RowNoise(noise.filter[0] * np.array([1.0, coefficient]), np.ones((1, 1)))
        impulse = true._coloured(np.eye(1, ROWS)[0]) / true.filter[0]
        share = noise.filter @ np.stack([influence[0], np.append(influence[0][1:], 0.0)])
        return float(np.sum(np.square(np.convolve(share[::-1], impulse)[:ROWS])))

    coefficient, step = noise.filter[1] / noise.filter[0], 1e-4
    expected = (variance(coefficient + step) - variance(coefficient - step)) / (2.0 * step)
    by_coefficient = noise.unsure(influence)[1] / noise.error[1, 1]
    assert float(by_coefficient[0] @ influence[0]) == pytest.approx(expected, rel=0.03)


def test_settling_is_no_noise(rig: Rig) -> None:
    (clean,) = rig(settings=IDEAL).loops
    loop = cycles_of(clean, 3, np.random.default_rng(1).standard_normal(ROWS))
    settled = replace(loop, force=loop.force * (1.0 + 0.02 * np.exp(-loop.time / 10.0)))
    drifting = replace(loop, force=loop.force + 0.06 * np.ptp(loop.force) * loop.time / loop.time[-1])
    for changed in (settled, drifting):
        assert drive_of(changed).row_noise.order == 0
