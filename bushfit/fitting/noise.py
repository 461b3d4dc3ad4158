"""Measurement noise of sweeps: what scatters from point to point, and what a whole block shares.

A block is one run of the rig: one direction, amplitude and repeat. Its points share a gain and a phase error.
Everything is counted on ln K = ln|K| + i phase, so gain errors are real and phase errors imaginary, both
relative to |K|.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.special import chdtrc

from bushfit.effects.contract import Array
from bushfit.reading.measurement import Sweep
from bushfit.reduction.scatter import MEDIAN_TO_SIGMA

#: Least noise of any rig, relative to the largest force or to |K|.
FLOOR = 1e-4
#: Errors that a block shares where nothing was repeated, relative gain and phase [rad]; chosen: those of most rigs.
ASSUMED_SHARED = (5e-3, float(np.radians(0.25)))
#: Probability of unequal variances by chance, below which levels get noise of their own.
_EQUAL_NOISE_P = 1e-3
#: Degree in ln f of the smooth curve that stands in for repeats; chosen: it follows stiffness over two decades.
_SMOOTH_DEGREE = 4
#: Common frequencies of two repeats from which on their difference tells a variance and a mean.
_FEWEST_FREQUENCIES = 3
#: Distance of an outlier from the other points [robust standard deviations]: noise alone reaches it once in 1e9.
_OUTLIER = 6.0
#: Shared variance of an outlying pair of repeats over the median of all pairs: noise alone reaches it once in 500
#: campaigns.
_OUTLYING_PAIR = 100.0
#: Rounds of reweighting towards the least sum of distances; chosen: nine of ten curves have then come within a third
#: of the noise of where they end.
_ROUNDS = 25
#: Least distance relative to the median distance, so that no point takes all the weight.
_LEAST_DISTANCE = 1e-3

LevelKey = tuple[str, float]
_ORIGINS = {
    "repeats": "from repeats",
    "stated": "stated in the campaign",
    "assumed": "no repeats of three frequencies or more: points against a smooth curve, shared part assumed",
}


@dataclass(frozen=True)
class SweepNoise:
    """Noise of all sweeps of a campaign.

    Args:
        random: standard deviation from point to point of (ln|K|, phase), per level (sweep name, amplitude).
        shared: standard deviation of what a block shares, (ln|K|, phase [rad]).
        origin: "repeats", "stated" or "assumed": where it comes from.
        freedom: degrees of freedom behind the shared part; 0 where it is not measured.
        scatter_freedom: the same of the random part of each level; 0 where it is stated.
    """

    random: dict[LevelKey, tuple[float, float]]
    shared: tuple[float, float]
    origin: str
    freedom: int
    scatter_freedom: int = 0

    def describe(self) -> str:
        """One line for reports."""
        point = 100.0 * np.sqrt(np.mean(np.square(list(self.random.values()))))
        return (
            f"{point:.2g} % from point to point, {100 * self.shared[0]:.2g} % gain and "
            f"{np.degrees(self.shared[1]):.2g} deg phase shared by a block ({_ORIGINS[self.origin]})"
        )


@dataclass(frozen=True)
class _Level:
    """What one amplitude of one sweep tells about the noise.

    Args:
        scatter: deviations of gain and phase from point to point, (k, 2).
        freedom: degrees of freedom behind their sum of squares.
        shared: variances of gain and phase that each pair of repeats shares, (pairs, 2).
        repeats: number of them.
        calmer: without repeats, the scatter less the point that adds most to it, (k - 1, 2).
    """

    scatter: Array
    freedom: int
    shared: Array
    repeats: int
    calmer: Array | None = None

    @property
    def variance(self) -> Array:
        """Of gain and phase from point to point, (2,)."""
        return np.asarray(np.square(self.scatter).sum(axis=0) / max(self.freedom, 1))


def sweep_noise(sweeps: Sequence[Sweep]) -> SweepNoise:
    """Noise of a campaign's sweeps, estimated from their repeats.

    Without repeats the random part is the scatter about a smooth curve in ln f, and the shared part is ASSUMED_SHARED.
    A `noise` stated in the campaign replaces the random part.

    Notes:
        With D_f the difference of ln K between two repeats at the frequency f, the variance of D_f over f is twice
        the random variance, and the square of its mean estimates twice (shared variance + random variance / number of
        frequencies). Pairs are pooled within a level and over levels; levels keep a random part of their own where
        Bartlett's test finds them unequal.
    """
    levels = {
        (sweep.name, float(amplitude)): _level(sweep, amplitude)
        for sweep in sweeps
        for amplitude in np.unique(sweep.amplitude)
    }
    repeated = [level for level in levels.values() if level.repeats > 1]
    measured = repeated or [level for level in levels.values() if level.calmer is not None]
    variances, scatter_freedom = _pooled(levels, measured)
    stated = {sweep.name: sweep.noise for sweep in sweeps if sweep.noise is not None}
    if stated:
        scatter_freedom = 0
    random = {
        key: _pair(np.maximum(np.broadcast_to(stated.get(key[0], np.sqrt(variance)), 2), FLOOR))
        for key, variance in variances.items()
    }
    if repeated:
        shared_freedom = sum(level.repeats - 1 for level in repeated)
        return SweepNoise(random, _shared(repeated), "repeats", shared_freedom, scatter_freedom)
    shared, origin = ((0.0, 0.0), "stated") if len(stated) == len(sweeps) else (ASSUMED_SHARED, "assumed")
    return SweepNoise(random, shared, origin, 0, scatter_freedom)


def _pooled(levels: Mapping[LevelKey, _Level], measured: Sequence[_Level]) -> tuple[dict[LevelKey, Array], int]:
    """Variance of gain and phase of each level, (2,), and the degrees of freedom behind it.

    One variance for all where the levels that measure it agree, else each level's own.
    """
    alike = _of_equal_noise(measured)
    if not alike:
        return {key: level.variance for key, level in levels.items()}, min(level.freedom for level in levels.values())
    freedoms = [level.freedom for level in alike]
    pooled = np.average([level.variance for level in alike], axis=0, weights=freedoms)
    return dict.fromkeys(levels, pooled), sum(freedoms)


def _shared(repeated: Sequence[_Level]) -> tuple[float, float]:
    """Standard deviation of what a block shares in gain and phase, outlying pairs of repeats left out."""
    pairs = np.concatenate([level.shared for level in repeated])
    usual = np.abs(pairs) <= _OUTLYING_PAIR * np.median(np.abs(pairs), axis=0)
    variance = np.where(usual.any(axis=0), np.mean(pairs, axis=0, where=usual), 0.0)
    return _pair(np.sqrt(np.maximum(variance, 0.0)))


def _pair(values: Array) -> tuple[float, float]:
    """Gain and phase, (2,), as plain numbers."""
    gain, phase = values.tolist()
    return gain, phase


def _level(sweep: Sweep, amplitude: float) -> _Level:
    """What one amplitude of a sweep tells: by pairs of repeats, or about a smooth curve where there is no pair."""
    chosen = sweep.amplitude == amplitude
    frequencies, column = np.unique(sweep.frequency[chosen], return_inverse=True)
    numbers, row = np.unique(sweep.repeat[chosen], return_inverse=True)
    table = np.full((numbers.size, frequencies.size), np.nan + 0j)
    table[row, column] = np.log(sweep.stiffness[chosen])
    pairs = [_without_outliers(one - other) for one, other in combinations(table, 2)]
    pairs = [difference for difference in pairs if difference.size >= _FEWEST_FREQUENCIES]
    if not pairs:
        return _about_smooth_curve(np.log(frequencies), np.nanmean(table, axis=0))
    scatter = [_parts(difference - difference.mean()) for difference in pairs]
    shared = [
        (_parts(difference).mean(axis=0) ** 2 - np.square(spread).sum(axis=0) / (len(spread) - 1) / len(spread)) / 2.0
        for difference, spread in zip(pairs, scatter, strict=True)
    ]
    freedom = (numbers.size - 1) * (pairs[0].size - 1)
    return _Level(np.concatenate(scatter) / np.sqrt(numbers.size), freedom, np.array(shared), int(numbers.size))


def _without_outliers(difference: Array) -> Array:
    """Differences of two repeats where both were measured, complex (k,), less single outliers.

    These are faults and no measure of the noise.
    """
    difference = difference[~np.isnan(difference)]
    if not difference.size:
        return difference
    parts = _parts(difference)
    off = np.abs(parts - np.median(parts, axis=0))
    scale = MEDIAN_TO_SIGMA * np.median(off, axis=0)
    return difference[np.all((off <= _OUTLIER * scale) | (scale == 0.0), axis=1)]


def _about_smooth_curve(log_frequency: Array, log_stiffness: Array) -> _Level:
    """What one amplitude without repeats tells: its scatter about a smooth curve, outliers left out.

    Of one or two points the scatter is assumed.
    """
    degree = min(_SMOOTH_DEGREE, log_frequency.size - 2)
    if degree < 1:
        return _Level(np.full((1, 2), ASSUMED_SHARED[0]), 1, np.empty((0, 2)), 1)
    values = _parts(log_stiffness)
    basis = np.polynomial.legendre.legvander(
        2.0 * (log_frequency - log_frequency.min()) / np.ptp(log_frequency) - 1.0, degree
    )
    residual = np.abs(values - basis @ _least_absolute(basis, values))
    usual = np.median(np.sort(residual, axis=0)[degree + 1 :], axis=0)  # the curve goes through degree + 1 points
    inliers = np.all(residual <= np.maximum(_OUTLIER * MEDIAN_TO_SIGMA * usual, FLOOR), axis=1)
    inliers |= np.count_nonzero(inliers) < degree + 2  # too few would leave nothing free
    scatter = _complement(basis[inliers]).T @ values[inliers]
    free = _complement(basis)
    falls = np.square(free @ (free.T @ values)).sum(axis=1) / np.maximum(np.square(free).sum(axis=1), FLOOR**2)
    worst = int(np.argmax(falls))  # the point without which the sum of squares about the curve falls most
    calmer = _complement(np.delete(basis, worst, axis=0)).T @ np.delete(values, worst, axis=0)
    return _Level(scatter, len(scatter), np.empty((0, 2)), 1, calmer)


def _complement(basis: Array) -> Array:
    """Orthonormal basis of what a curve, (n, k), leaves free, (n, n - k): coordinates in it scatter independently."""
    return np.linalg.qr(basis, mode="complete")[0][:, basis.shape[1] :]


def _least_absolute(basis: Array, values: Array) -> Array:
    """Coefficients of a curve, (n, k), with the least sum of distances to gain and phase, (n, 2) -> (k, 2).

    Outliers do not bend it.

    Notes:
        Least squares, weighted anew by one over the distance.
    """
    root_weight = np.ones((len(values), 1))
    for _ in range(_ROUNDS):
        solution = np.linalg.lstsq(basis * root_weight, values * root_weight, rcond=None)[0]
        distance = np.linalg.norm(values - basis @ solution, axis=1, keepdims=True)
        root_weight = np.sqrt(1.0 / np.maximum(distance, _LEAST_DISTANCE * np.median(distance) + FLOOR**2))
    return np.asarray(solution)


def _parts(values: Array) -> Array:
    """Gain and phase of ln K, complex (n,) -> (n, 2)."""
    return np.stack([np.real(values), np.imag(values)], axis=-1)


def _of_equal_noise(levels: Sequence[_Level]) -> list[_Level]:
    """Levels of equal noise, those that a single outlier sets apart without it; none where they are unequal."""
    alike = sorted(levels, key=lambda level: -float(level.variance.sum()))
    for place, level in enumerate(alike):
        if level.calmer is not None and level.calmer.size and _unequal(alike):
            alike[place] = replace(level, scatter=level.calmer, freedom=len(level.calmer))
    return [] if _unequal(alike) else alike


def _unequal(levels: Sequence[_Level]) -> bool:
    """Bartlett's test (1937) of the variances of levels, each with as many degrees of freedom in gain as in phase."""
    variance = np.array([level.variance.mean() for level in levels])
    freedom = np.array([2.0 * level.freedom for level in levels])
    if variance.size < 2 or not variance.all():
        return False
    pooled = np.average(variance, weights=freedom)
    few = (np.sum(1.0 / freedom) - 1.0 / freedom.sum()) / (3.0 * (variance.size - 1))
    statistic = float(freedom @ np.log(pooled / variance)) / (1.0 + few)
    return bool(chdtrc(variance.size - 1, statistic) < _EQUAL_NOISE_P)
