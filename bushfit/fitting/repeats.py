"""Noise of one level of a sweep, from the differences of repeats, or about a smooth curve without repeats.

A level is the set of points, repeats included, at one constant amplitude (frequency is stepped) or one constant
frequency (amplitude is stepped). Errors are errors of ln K = ln|K| + i phase, so gain errors are real and phase errors
imaginary, both relative to |K|.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from scipy.linalg import lapack, qr
from scipy.special import chdtrc

from bushfit.effects.contract import Array
from bushfit.fitting.outliers import least_absolute
from bushfit.fitting.rig_class import ASSUMED
from bushfit.reading.measurement import Sweep
from bushfit.reduction.arrays import MEDIAN_TO_SIGMA, median

#: Smallest noise of any rig, relative to the largest force or to |K|.
FLOOR = 1e-4
#: Degree, in the logarithm of the stepped quantity, of the smooth curve that replaces repeats; chosen: it follows
#: stiffness over two decades.
_SMOOTH_DEGREE = 4
#: Degrees in ln f and ln X of the smooth surface that corrects points to the nominal amplitude of their level; chosen:
#: it need only follow the slope over ln X.
_SURFACE_DEGREES = (1, 3)
#: Fewest common steps of two repeats that determine a variance and a mean of their difference.
FEWEST_STEPS = 3
#: Fewest differences among which outliers are sought: the median of fewer is no reliable scale.
FEWEST_SOUGHT = 6
#: Probability by chance of the scatter of many levels at one step, below which the step is disturbed; small, as the
#: scatter at other steps is estimated from few points.
_DISTURBED = 1e-9
#: Distance of an outlier from the other points [robust standard deviations]: noise alone reaches it once in 1e9.
_OUTLIER = 6.0


@dataclass(frozen=True)
class LevelNoise:
    """Noise of one level of a sweep, estimated from its repeats, or about a smooth curve without repeats.

    Args:
        errors: random errors of gain (relative) and phase [rad], scaled so that the sum of their squares divided by
            `freedom` is the variance of one point: differences of neighbouring points between two repeats, or
            residuals about a smooth curve, (k, 2).
        freedom: degrees of freedom of this sum of squares.
        shared: variances of the gain and phase errors shared by a run, estimated from each pair of repeats, (pairs, 2).
        shared_freedom: degrees of freedom of the mean of `shared`; 0 without repeats.
        without_largest: noise of the level without its largest deviation; None with repeats or few points.
        steps: frequency [Hz] or amplitude [m or rad] of each deviation, (k,); empty without repeats.
        squared_distances: squared distance of the point at each step from the smooth curve, by step, in units of the
            robust standard deviation; empty with repeats.
    """

    errors: Array
    freedom: float
    shared: Array
    shared_freedom: float = 0.0
    without_largest: "LevelNoise | None" = None
    steps: Array = field(default_factory=lambda: np.empty(0))
    squared_distances: Mapping[float, float] = field(default_factory=dict)

    @property
    def variance(self) -> Array:
        """Variances of the random error of one point in relative |K| and in phase [rad^2], (2,)."""
        return np.asarray(np.square(self.errors).sum(axis=0) / max(self.freedom, 1))


def level_noise(sweep: Sweep, log_stiffness: Array, run_level: float, disturbed: Collection[float] = ()) -> LevelNoise:
    """Estimate the noise of a level of a sweep (its runs at one constant value), from repeats or about a smooth curve.

    Args:
        sweep: measured sweep.
        log_stiffness: ln K of the sweep's points, complex (n,).
        run_level: constant quantity of the level: amplitude [m or rad], frequency [Hz] or number of the run.
        disturbed: frequencies or amplitudes to leave out, see `disturbed_steps`.

    Returns:
        Noise of the level.
    """
    chosen = (sweep.run_level == run_level) & ~np.isin(sweep.step, [*disturbed])
    steps, column = np.unique(sweep.step[chosen], return_inverse=True)
    numbers, row = np.unique(sweep.repeat[chosen], return_inverse=True)
    table = np.full((numbers.size, steps.size), np.nan + 0j)
    table[row, column] = log_stiffness[chosen]
    scatter, shared, between, freedom = list[Array](), list[Array](), list[Array](), 0.0
    for one, second in combinations(table, 2):
        usual = _is_typical(one - second, np.log(steps))
        if usual.sum() < FEWEST_STEPS:
            continue
        difference, pair_steps = (one - second)[usual], steps[usual]
        spread = _gain_and_phase(np.diff(difference)) / np.sqrt(2.0)
        free = difference_freedom(len(spread))
        shared.append(
            (_gain_and_phase(difference).mean(axis=0) ** 2 - np.square(spread).mean(axis=0) / len(difference)) / 2.0
        )
        scatter.append(spread * np.sqrt(free / len(spread) / numbers.size))
        between.append(np.sqrt(pair_steps[1:] * pair_steps[:-1]))
        freedom += free
    if not scatter:
        return _about_smooth_curve(steps, np.nanmean(table, axis=0))
    independent = 2.0 / numbers.size  # of each pair: m repeats have m (m - 1)/2 pairs, and m - 1 of them are free
    joined = np.concatenate(scatter), independent * freedom, np.array(shared), independent * len(scatter)
    return LevelNoise(*joined, steps=np.concatenate(between))


def difference_freedom(steps: int) -> float:
    """Effective degrees of freedom of a noise variance estimated from `steps` successive differences of repeats."""
    return 2.0 * steps**2 / (3.0 * steps - 1.0)


def _is_typical(difference: Array, log_step: Array) -> Array:
    """Mask of the steps at which the difference of two repeats is not an outlier, (n,).

    An outlier is more than six robust standard deviations from the median. The limit grows along the run if the
    differences do, by Theil's (1950) median slope.

    Args:
        difference: difference of ln K between the repeats at each step, complex (n,).
        log_step: natural log of the stepped frequency or amplitude, (n,).
    """
    usual = ~np.isnan(difference)
    if np.count_nonzero(usual) < FEWEST_SOUGHT:
        return usual
    parts = _gain_and_phase(difference)
    distance = np.abs(parts - median(parts[usual]))
    scale = MEDIAN_TO_SIGMA * median(distance[usual])
    lengths = np.log(np.maximum(np.hypot(*distance.T), FLOOR))
    x, y, half = log_step[usual], lengths[usual], np.count_nonzero(usual) // 2
    slope = median((y[-half:] - y[:half]) / (x[-half:] - x[:half]))
    scale = scale * np.exp(np.maximum(slope * (log_step - median(x)), 0.0))[:, None]
    return usual & np.all((distance <= _OUTLIER * scale) | (scale == 0.0), axis=1)


def _about_smooth_curve(steps: Array, log_stiffness: Array) -> LevelNoise:
    """Noise of a level without repeats: residuals of ln K about a polynomial of degree 4 or less over ln(step).

    If the level has one or two points, the random error is assumed to be 0.5 %.

    Args:
        steps: stepped frequency [Hz] or amplitude [m or rad] of each point, (n,).
        log_stiffness: ln K of each point, complex (n,).
    """
    degree = min(_SMOOTH_DEGREE, steps.size - 2)
    if degree < 1:
        return LevelNoise(np.full((1, 2), ASSUMED[0]), 1, np.empty((0, 2)))
    values = _gain_and_phase(log_stiffness)
    basis = np.polynomial.legendre.legvander(to_unit_interval(np.log(steps)), degree)
    residual = np.abs(values - basis @ least_absolute(basis, values, FLOOR**2))
    usual = np.median(np.sort(residual, axis=0)[degree + 1 :], axis=0)  # the curve goes through degree + 1 points
    inliers = np.all(residual <= np.maximum(_OUTLIER * MEDIAN_TO_SIGMA * usual, FLOOR), axis=1)
    inliers |= np.count_nonzero(inliers) < degree + 2  # too few would leave nothing free
    curve = np.linalg.qr(basis)[0]
    misfit, free = values - curve @ (curve.T @ values), 1.0 - np.square(curve).sum(axis=1)
    falls = np.square(misfit).sum(axis=1) / np.maximum(free, FLOOR**2)
    worst = int(np.argmax(falls))  # the point without which the sum of squares about the curve falls most
    squares = np.square(residual / np.maximum(MEDIAN_TO_SIGMA * usual, FLOOR)).sum(axis=1)
    squared = dict(zip(steps.tolist(), squares.tolist(), strict=True))

    def of_points(chosen: Array) -> LevelNoise:
        """Noise of the points of a mask, (n,), about the curve of k functions fitted to them, as n - k residuals."""
        (reflections, factors), _ = qr(basis[chosen], mode="raw")
        turned, *_ = lapack.dormqr("L", "T", reflections, factors, values[chosen], lwork=values.shape[1])
        return LevelNoise(turned[basis.shape[1] :], len(turned) - basis.shape[1], np.empty((0, 2)))

    calmer = of_points(np.arange(steps.size) != worst)
    return replace(of_points(inliers), without_largest=calmer if calmer.freedom else None, squared_distances=squared)


def disturbed_steps(levels: Iterable[LevelNoise]) -> list[float]:
    """Find frequencies or amplitudes at which sweeps without repeats scatter far more than elsewhere (mains hum).

    The sum of squares at a step must have a probability by chance below 1e-9.

    Args:
        levels: noise of the levels (runs at one constant value) of all sweeps.

    Returns:
        Frequencies [Hz] or amplitudes [m or rad].
    """
    points: dict[float, list[float]] = defaultdict(list)
    for level in levels:
        for step, square in level.squared_distances.items():
            points[step].append(square)
    repeated = [(step, squares) for step, squares in points.items() if len(squares) >= FEWEST_STEPS]
    return [step for step, squares in repeated if chdtrc(2 * len(squares), sum(squares)) < _DISTURBED]


def to_unit_interval(values: Array) -> Array:
    """Scale values, (n,), linearly to the interval from -1 to 1, for Legendre polynomials; all -1 if they are equal."""
    return 2.0 * (values - values.min()) / max(float(np.ptp(values)), np.finfo(float).tiny) - 1.0


def _gain_and_phase(values: Array) -> Array:
    """Split ln K, complex (n,), into ln |K| (gain) and phase [rad], (n, 2)."""
    return np.stack([np.real(values), np.imag(values)], axis=-1)


def log_stiffness_at_nominal(sweep: Sweep) -> Array:
    """Logarithm of the stiffness of each point of a sweep, corrected from the reached to the nominal amplitude.

    The correction follows a smooth surface fitted to ln K over ln f and ln X. With fewer than two nominal amplitudes
    there is no correction.

    Returns:
        ln K, complex (n,).
    """
    value = np.log(sweep.stiffness)
    log_ratio = np.log(sweep.amplitude_reached / sweep.amplitude)
    distinct = np.unique(sweep.amplitude).size
    if distinct < 2 or not log_ratio.any():
        return value
    degrees = min(_SURFACE_DEGREES[0], np.unique(sweep.frequency).size - 1), min(_SURFACE_DEGREES[1], distinct - 1)
    low, span = np.log(sweep.amplitude).min(), float(np.ptp(np.log(sweep.amplitude)))

    def surface(amplitude: Array) -> Array:
        """Polynomials of the smooth surface at the points' frequencies and given amplitudes [m or rad], (n, terms)."""
        over_range = 2.0 * (np.log(amplitude) - low) / span - 1.0
        return np.polynomial.legendre.legvander2d(to_unit_interval(np.log(sweep.frequency)), over_range, degrees)

    reached = surface(sweep.amplitude_reached)
    solution = np.linalg.lstsq(reached.astype(complex), value, rcond=None)[0]
    return value - (reached - surface(sweep.amplitude)) @ solution
