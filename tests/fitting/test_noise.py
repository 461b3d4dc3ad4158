"""Noise from repeats: what scatters and what a block shares are told apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from bushfit.campaign.schema import RigSettings
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.fitting.rig_class import ASSUMED
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Sweep

FREQUENCIES = np.arange(5.0, 156.0, 10.0)
AMPLITUDES = (1e-4, 2e-4, 5e-4)


Noisy = Callable[..., Sweep]


@pytest.fixture
def noisy_sweep(paper_model: Model) -> Noisy:
    """Sweep(seed, random, gain, phase, repeats): errors of each kind, relative and [rad]."""

    def draw(
        seed: int,
        random: float = 5e-3,
        gain: float = 0.0,
        phase: float = 0.0,
        repeats: int = 3,
        loss: float | None = None,
    ) -> Sweep:
        rng = np.random.default_rng(seed)
        level, repeat, f = (
            axis.ravel() for axis in np.meshgrid(AMPLITUDES, np.arange(1, repeats + 1), FREQUENCIES, indexing="ij")
        )
        block = np.repeat(rng.standard_normal((2, 3 * repeats)), FREQUENCIES.size, axis=1)
        scatter = rng.standard_normal((2, level.size)) * np.array([[random], [random if loss is None else loss]])
        error = gain * block[0] + scatter[0] + 1j * (phase * block[1] + scatter[1])
        clean = paper_model.stiffness(Direction.AXIAL, f, level)
        return Sweep("sweep", Direction.AXIAL, f, level, clean * np.exp(error), repeat)

    return draw


def scatter_of(found: Sequence[SweepNoise]) -> np.ndarray:
    """Root mean square scatter of gain and phase over all lines, (2,)."""
    return np.sqrt(np.mean([np.square(list(noise.random.values())) for noise in found], axis=(0, 1)))


def kept(sweep: Sweep, rows: np.ndarray) -> Sweep:
    columns = ("frequency", "amplitude", "stiffness", "repeat")
    return replace(sweep, **{name: getattr(sweep, name)[rows] for name in columns}, reached=None)


def with_a_loud_level(quiet: Sweep, loud: Sweep) -> dict[tuple[str, float], tuple[float, float]]:
    """The scatter of each line where the largest level is that of another sweep."""
    stiffness = np.where(quiet.amplitude == 5e-4, loud.stiffness, quiet.stiffness)
    return sweep_noise([replace(quiet, stiffness=stiffness)]).random


@pytest.mark.parametrize(("random", "gain", "phase"), [(5e-3, 0.0, 0.0), (1e-3, 8e-3, 1e-3), (1e-2, 3e-3, 6e-3)])
def test_both_parts_are_recovered(noisy_sweep: Noisy, random: float, gain: float, phase: float) -> None:
    found = [sweep_noise([noisy_sweep(seed, random, gain, phase)]) for seed in range(200)]
    shared = np.sqrt(np.mean([np.square(noise.shared) for noise in found], axis=0))
    assert {noise.origin for noise in found} == {"repeats"}
    assert found[0].freedom == 6
    np.testing.assert_allclose(scatter_of(found), random, rtol=0.015)
    # a variance of nothing is estimated as nothing or a little, never as less
    np.testing.assert_allclose(shared, [gain, phase], rtol=0.1, atol=0.25 * random)


def test_scatter_of_gain_and_phase_need_not_be_alike(noisy_sweep: Noisy) -> None:
    found = [sweep_noise([noisy_sweep(seed, 2e-3, loss=8e-3)]) for seed in range(50)]
    np.testing.assert_allclose(scatter_of(found), [2e-3, 8e-3], rtol=0.05)


@pytest.mark.parametrize(("loss", "alike"), [(5e-3, True), (2e-1, False)])
def test_few_differences_share_one_scatter_unless_they_deny_it(noisy_sweep: Noisy, loss: float, alike: bool) -> None:
    """Two runs of eight points: seven differences part phase from gain where it scatters forty times as much."""
    whole = noisy_sweep(3, 5e-3, repeats=2, loss=loss)
    found = sweep_noise([kept(whole, (whole.amplitude == AMPLITUDES[0]) & (whole.frequency < 80.0))])
    assert found.scatter_freedom < 10
    (scatter,) = found.random.values()
    assert (scatter[0] == scatter[1]) is alike
    assert scatter[1] == pytest.approx(loss, rel=0.7)


def test_a_noisier_level_keeps_noise_of_its_own(noisy_sweep: Noisy) -> None:
    quiet = noisy_sweep(1, 1e-3)
    random = with_a_loud_level(quiet, noisy_sweep(2, 2e-2))
    assert random["sweep", 5e-4][0] == pytest.approx(2e-2, rel=0.4)
    assert random["sweep", 1e-4][0] == pytest.approx(1e-3, rel=0.4)
    assert len(set(sweep_noise([quiet]).random.values())) == 1


def test_scatter_with_few_differences_is_not_too_small(noisy_sweep: Noisy) -> None:
    """Three frequencies: few differences are no sign of calm, and none is taken for an outlier."""
    wholes = [noisy_sweep(seed) for seed in range(200)]
    found = [sweep_noise([kept(whole, np.isin(whole.frequency, [5.0, 75.0, 155.0]))]) for whole in wholes]
    assert {noise.scatter_freedom for noise in found} == {10}
    assert {len(set(noise.random.values())) for noise in found} == {1}
    assert np.sqrt(np.mean(np.square(scatter_of(found)))) == pytest.approx(5e-3, rel=0.03)


def test_scatter_grows_towards_low_frequency_where_repeats_show_it(noisy_sweep: Noisy) -> None:
    flat = [sweep_noise([noisy_sweep(seed)]) for seed in range(200)]
    assert sum(bool(noise.slopes) for noise in flat) <= 2
    found = []
    for seed in range(50):
        clean, scattered = noisy_sweep(seed, 0.0), noisy_sweep(seed)
        error = np.log(scattered.stiffness / clean.stiffness) * (clean.frequency / 100.0) ** -0.6
        noise = sweep_noise([replace(clean, stiffness=clean.stiffness * np.exp(error))])
        ends = noise.scatter("sweep", np.full(2, 1e-4), np.array([5.0, 155.0]))
        found.append(ends.mean(axis=0) / (5e-3 * (np.array([5.0, 155.0]) / 100.0) ** -0.6))
    np.testing.assert_allclose(np.mean(found, axis=0), 1.0, rtol=0.2)  # without growth they are 0.3 and 2.4


def test_the_class_of_a_rig_is_an_error_of_each_level(noisy_sweep: Noisy) -> None:
    rig = RigSettings(gain_error=3e-3, displacement_error=4e-3)
    repeated, single = (sweep_noise([noisy_sweep(0, repeats=repeats)], rig) for repeats in (3, 1))
    assert repeated.level == pytest.approx((5e-3, 0.0))
    assert single.level == (0.0, 0.0)
    assert single.shared == pytest.approx((5e-3, ASSUMED[1]))
    assert "[rig]" in single.describe()


def test_repeats_without_a_common_frequency() -> None:
    frequency = np.array([5.0, 15.0, 25.0, 35.0, 45.0, 55.0, 65.0, 75.0])
    stiffness = 6e5 * frequency**0.05 * np.exp(0.1j)
    sweep = Sweep("x", Direction.AXIAL, frequency, np.full(8, 1e-4), stiffness, np.array([1, 2] * 4))
    noise = sweep_noise([sweep])
    assert noise.origin == "assumed"
    assert "no repeats of three points or more" in noise.describe()


def test_missing_points_do_not_matter(noisy_sweep: Noisy) -> None:
    whole = noisy_sweep(3, 5e-3, 4e-3, 3e-3)
    part = kept(whole, np.random.default_rng(0).random(whole.frequency.size) > 0.15)
    one, other = sweep_noise([whole]), sweep_noise([part])
    np.testing.assert_allclose(other.shared, one.shared, rtol=0.3)
    np.testing.assert_allclose(other.random["sweep", 1e-4], one.random["sweep", 1e-4], rtol=0.3)
    assert other.origin == "repeats"


def test_no_repeats_fall_back_to_a_smooth_curve_and_an_assumption(noisy_sweep: Noisy) -> None:
    found = [sweep_noise([noisy_sweep(seed, 5e-3, repeats=1)]) for seed in range(50)]
    np.testing.assert_allclose(scatter_of(found), 5e-3, rtol=0.1)
    assert {noise.shared for noise in found} == {ASSUMED}
    assert {noise.origin for noise in found} == {"assumed"}
    assert "by the class of [rig]" in found[0].describe()


def test_levels_without_repeats_are_pooled(noisy_sweep: Noisy) -> None:
    noise = sweep_noise([noisy_sweep(0, repeats=1)])
    assert len(set(noise.random.values())) == 1
    assert noise.scatter_freedom >= len(AMPLITUDES) * (FREQUENCIES.size - 5) - 1  # it may take one point for an outlier
    random = with_a_loud_level(noisy_sweep(1, 1e-3, repeats=1), noisy_sweep(2, 2e-2, repeats=1))
    assert random["sweep", 5e-4][0] > 8.0 * random["sweep", 1e-4][0]


def test_the_smooth_curve_bends_enough_for_the_model(noisy_sweep: Noisy) -> None:
    clean = sweep_noise([noisy_sweep(0, 0.0, repeats=1)])
    assert max(max(pair) for pair in clean.random.values()) <= 2e-4


def test_stated_noise_replaces_the_random_part(noisy_sweep: Noisy) -> None:
    stated = sweep_noise([replace(noisy_sweep(0, repeats=1), noise=7e-3)])
    assert stated.origin == "stated"
    assert set(stated.random.values()) == {(7e-3, 7e-3)}
    assert stated.shared == (0.0, 0.0)


def test_no_noise_is_zero(noisy_sweep: Noisy) -> None:
    """Neither of equal repeats nor of one, two or three points."""
    whole = noisy_sweep(0)
    tiny = [kept(whole, np.arange(rows)) for rows in (1, 2, 3)]
    for sweep in (noisy_sweep(0, 0.0), *tiny):
        noise = sweep_noise([sweep])
        assert all(np.isfinite(pair).all() and min(pair) > 0.0 for pair in noise.random.values())


def test_frequencies_where_many_lines_scatter_are_no_noise() -> None:
    """Hum of 8 % at 55 and 65 Hz: the noise elsewhere stays 0.5 %, and a sweep of these two alone is no error."""
    frequency, amplitude = map(np.ravel, np.meshgrid(np.arange(5.0, 156.0, 10.0), [1e-4, 2e-4, 4e-4, 8e-4]))
    scatter = np.random.default_rng(3).normal(size=(2, 2, frequency.size))
    hum = np.isin(frequency, [55.0, 65.0])
    off = (5e-3 * scatter[0] + 0.08 * hum * scatter[1]).T @ [1.0, 1.0j]
    stiffness = (1e6 + 1e5j) * (frequency / 50.0) ** 0.1 * (1.0 + off)
    once = np.ones(frequency.size, dtype=int)
    whole = Sweep("whole", Direction.AXIAL, frequency, amplitude, stiffness, once)
    only = Sweep("only", Direction.RADIAL, frequency[hum], amplitude[hum], stiffness[hum], once[hum])
    noise = np.array([*sweep_noise([whole, only]).random.values()])
    assert np.all((noise > 3.5e-3) & (noise < 6.5e-3))
