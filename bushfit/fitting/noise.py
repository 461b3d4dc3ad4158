"""Measurement noise of sweeps: what scatters from point to point, and what a whole run shares.

A run is what was recorded in one go: one of frequency and amplitude is stepped, the other held. Its points share a gain
and a phase error. Runs that hold the same are repeats of one line. Everything is counted on ln K = ln|K| + i phase, so
gain errors are real and phase errors imaginary, both relative to |K|.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from scipy.special import chdtrc, fdtrc

from bushfit.campaign.schema import UNSTATED, RigSettings
from bushfit.effects.contract import Array
from bushfit.fitting.outliers import least_absolute
from bushfit.reading.measurement import Sweep
from bushfit.reduction.scatter import MEDIAN_TO_SIGMA, median

#: Least noise of any rig, relative to the largest force or to |K|.
FLOOR = 1e-4
#: Errors that a run shares where nothing was repeated, relative gain and phase [rad]; chosen: those of most rigs.
ASSUMED_SHARED = (5e-3, float(np.radians(0.25)))
#: Degrees of freedom from which on repeats alone tell what a run shares; chosen: those of three repeats at two
#: levels; with fewer, 95 % intervals were too narrow.
_ENOUGH = 4
#: Probability of unequal variances by chance, below which levels get noise of their own.
_EQUAL_NOISE_P = 1e-3
#: Degree, in the logarithm of what is stepped, of the smooth curve that stands in for repeats; chosen: it follows
#: stiffness over two decades.
_SMOOTH_DEGREE = 4
#: Degrees in ln f and ln X of the smooth surface that carries points to the amplitude of their level; chosen: it need
#: only follow the slope over ln X.
_SURFACE_DEGREES = (1, 3)
#: Common steps of two repeats from which on their difference tells a variance and a mean.
FEWEST_STEPS = 3
#: Degrees of freedom from which on a line may have a scatter of its own, and phase another than gain: fewer tell it no
#: better than within a quarter, and wrong weights cost a tenth of the accuracy.
_OWN_SCATTER = 10
#: Probability by chance of a scatter that grows along what is stepped, below which it counts.
_LEVEL_SCATTER_P = 1e-3
#: Exponents of the variance along what is stepped at most, far beyond those of rigs.
_STEEPEST = 6.0
#: Differences from which on outliers are sought among them: of fewer, the median tells no scale.
_FEWEST_SOUGHT = 6
#: Distance of an outlier from the other points [robust standard deviations]: noise alone reaches it once in 1e9.
_OUTLIER = 6.0
#: Shared variance of an outlying pair of repeats over the median of all pairs: noise alone reaches it once in 500
#: campaigns.
_OUTLYING_PAIR = 100.0

#: A line: the name of the sweep, and what its runs hold.
LineKey = tuple[str, float]
_ORIGINS = {
    "repeats": "from repeats",
    "stated": "stated in the campaign",
    "rig": "no repeats of three points or more: points against a smooth curve, shared part as [rig] states",
    "assumed": "no repeats of three points or more: points against a smooth curve, shared part assumed",
}


@dataclass(frozen=True)
class SweepNoise:
    """Noise of all sweeps of a campaign.

    Args:
        random: standard deviation from point to point of (ln|K|, phase), per line.
        shared: standard deviation of what a run shares, (ln|K|, phase [rad]).
        origin: "repeats", "stated" or "assumed": where it comes from.
        freedom: degrees of freedom behind the shared part; 0 where it is not measured.
        scatter_freedom: the same of the random part of each line; 0 where it is stated.
        level: standard deviation of what all runs of a line share, (ln|K|, phase [rad]).
        level_freedom: degrees of freedom behind it; 0 where it counts as known.
        slopes: of sweeps whose random part grows along what is stepped, the exponent, and the step at which it is as
            `random` has it.
    """

    random: dict[LineKey, tuple[float, float]]
    shared: tuple[float, float]
    origin: str
    freedom: int
    scatter_freedom: int = 0
    slopes: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    level: tuple[float, float] = (0.0, 0.0)
    level_freedom: int = 0

    def scatter(self, name: str, held: Array, step: Array) -> Array:
        """Standard deviation from point to point of gain and phase at points of a sweep, (2, n)."""
        of_lines = {line: self.random[name, float(line)] for line in np.unique(held)}
        exponent, at = self.slopes.get(name, (0.0, 1.0))
        return np.array([of_lines[line] for line in held]).T * (step / at) ** exponent

    def describe(self) -> str:
        """One line for reports."""
        shared = f"{words_of(self.shared)} shared by a run"
        if any(self.level):
            shared += f", {words_of(self.level)} by all repeats of a level"
        point = 100.0 * np.sqrt(np.mean(np.square(list(self.random.values()))))
        return f"{point:.2g} % from point to point, {shared} ({_ORIGINS[self.origin]})"


def words_of(error: tuple[float, float]) -> str:
    """A gain and a phase error [rad] in words."""
    return f"{100.0 * error[0]:.2g} % gain and {np.degrees(error[1]):.2g} deg phase"


@dataclass(frozen=True)
class _Line:
    """What the repeats of one line of a sweep tell about the noise.

    Args:
        scatter: deviations of gain and phase from point to point, (k, 2).
        freedom: degrees of freedom behind their sum of squares.
        shared: variances of gain and phase that each pair of repeats shares, (pairs, 2).
        shared_freedom: degrees of freedom behind their mean; 0 without repeats.
        calmer: without repeats, the scatter less the point that adds most to it, (k - 1, 2).
        steps: of repeats, what was stepped at each deviation, (k,).
    """

    scatter: Array
    freedom: float
    shared: Array
    shared_freedom: float = 0.0
    calmer: Array | None = None
    steps: Array = field(default_factory=lambda: np.empty(0))

    @property
    def variance(self) -> Array:
        """Of gain and phase from point to point, (2,)."""
        return np.asarray(np.square(self.scatter).sum(axis=0) / max(self.freedom, 1))


def sweep_noise(sweeps: Sequence[Sweep], rig: RigSettings = UNSTATED) -> SweepNoise:
    """Noise of the sweeps of one rig, estimated from their repeats.

    Without repeats the random part is the scatter about a smooth curve in the logarithm of what is stepped, and the
    shared part is what the rig's class states, else ASSUMED_SHARED. With repeats, what is stated is an error of each
    level, which they cannot show. A `noise` stated in the campaign, or in the file for each point, replaces the random
    part.

    Notes:
        With D the difference of ln K between two repeats at one step, the variance of D over the steps is twice the
        random variance, and the square of its mean estimates twice (shared variance + random variance / number of
        steps). Pairs are pooled within a line and over lines; lines keep a random part of their own where Bartlett's
        test finds them unequal. Where the squares of D grow along what is stepped, so does the random part.
    """
    lines = {
        (sweep.name, float(held)): _line(sweep, log_stiffness, held)
        for sweep, log_stiffness in [(sweep, _at_nominal(sweep)) for sweep in sweeps]
        for held in np.unique(sweep.held)
    }
    slopes = _slopes(sweeps, lines)
    for key, line in lines.items():
        if key[0] in slopes and line.steps.size:
            exponent, at = slopes[key[0]]
            lines[key] = replace(line, scatter=line.scatter / ((line.steps / at) ** exponent)[:, None])
    repeated = [line for line in lines.values() if line.shared_freedom]
    measured = repeated or [line for line in lines.values() if line.calmer is not None]
    variances, scatter_freedom = _pooled(lines, measured)
    stated = {sweep.name: noise for sweep in sweeps if (noise := _stated(sweep)) is not None}
    if stated:
        scatter_freedom, slopes = 0, {}
    random = {
        key: _pair(np.maximum(np.broadcast_to(stated.get(key[0], np.sqrt(variance)), 2), FLOOR))
        for key, variance in variances.items()
    }
    if repeated:
        shared_freedom = round(sum(line.shared_freedom for line in repeated))
        shared, level = _shared(repeated, shared_freedom, rig), of_class(rig, (0.0, 0.0))
        return SweepNoise(random, shared, "repeats", max(shared_freedom, _ENOUGH), scatter_freedom, slopes, level)
    if all(sweep.noise is not None for sweep in sweeps):
        return SweepNoise(random, of_class(rig, (0.0, 0.0)), "stated", 0, scatter_freedom)
    origin = "assumed" if rig.stated == (None, None) else "rig"
    return SweepNoise(random, of_class(rig, ASSUMED_SHARED), origin, 0, scatter_freedom)


def of_class(rig: RigSettings, unstated: tuple[float, float]) -> tuple[float, float]:
    """Gain and phase error [rad] that a rig's class states, else the one given."""
    gain, phase = (default if one is None else one for one, default in zip(rig.stated, unstated, strict=True))
    return gain, phase


def _stated(sweep: Sweep) -> float | None:
    """The noise that the campaign states of a sweep, or the root mean square of what its file states of each point."""
    if sweep.noise is not None or sweep.relative_error is None:
        return sweep.noise
    return float(np.sqrt(np.mean(np.square(sweep.relative_error))))


def _at_nominal(sweep: Sweep) -> Array:
    """ln K of each point as it would be at the amplitude of its level, complex (n,).

    From the amplitude that was reached it is carried there along a smooth surface over ln f and ln X, which tells how K
    goes with amplitude; without two levels or more there is none.
    """
    value = np.log(sweep.stiffness)
    off = np.log(sweep.amplitude_reached / sweep.amplitude)
    distinct = np.unique(sweep.amplitude).size
    if distinct < 2 or not off.any():
        return value
    degrees = min(_SURFACE_DEGREES[0], np.unique(sweep.frequency).size - 1), min(_SURFACE_DEGREES[1], distinct - 1)
    low, span = np.log(sweep.amplitude).min(), float(np.ptp(np.log(sweep.amplitude)))

    def surface(amplitude: Array) -> Array:
        over_range = 2.0 * (np.log(amplitude) - low) / span - 1.0
        return np.polynomial.legendre.legvander2d(unit(np.log(sweep.frequency)), over_range, degrees)

    reached = surface(sweep.amplitude_reached)
    solution = np.linalg.lstsq(reached.astype(complex), value, rcond=None)[0]
    return value - (reached - surface(sweep.amplitude)) @ solution


def _slopes(sweeps: Sequence[Sweep], lines: Mapping[LineKey, _Line]) -> dict[str, tuple[float, float]]:
    """How the scatter of a rig goes with what is stepped, see `_slope`: one law for all sweeps that step the same."""
    found = dict[str, tuple[float, float]]()
    for stepped in {sweep.stepped for sweep in sweeps}:
        alike = {sweep.name for sweep in sweeps if sweep.stepped == stepped}
        if slope := _slope([line for key, line in lines.items() if key[0] in alike and line.steps.size]):
            found |= dict.fromkeys(alike, slope)
    return found


def _slope(lines: Sequence[_Line]) -> tuple[float, float] | None:
    """Exponent with which the scatter of lines goes with what is stepped, and a middle step; None where
    repeats show no growth.

    Notes:
        Squares of the deviations over their line's mean are regressed on ln(step); the test is that of Koenker (1981),
        whose scale is the squares' own scatter, so that heavy tails make no slope. The exponent is that of greatest
        likelihood.
    """
    from scipy.optimize import minimize_scalar

    squares, logs = [], []
    for line in lines:
        steps, place = np.unique(line.steps, return_inverse=True)
        square = np.bincount(place, (np.square(line.scatter) / np.maximum(line.variance, FLOOR**2)).sum(axis=1))
        if steps.size >= _FEWEST_SOUGHT and square.any():
            squares.append(square / square.mean())
            logs.append(np.log(steps))
    if not logs:
        return None
    centred = np.concatenate([log - log.mean() for log in logs])
    ratio = np.concatenate(squares)
    along = float(centred @ (ratio - 1.0)) ** 2 / max(float(centred @ centred) * float(np.var(ratio)), FLOOR**2)
    if chdtrc(1, along) > _LEVEL_SCATTER_P:
        return None

    def unlikely(exponent: float) -> float:
        parts = np.split(ratio * np.exp(-exponent * centred), np.cumsum([log.size for log in logs])[:-1])
        return sum(part.size * float(np.log(part.mean())) for part in parts)

    exponent = float(minimize_scalar(unlikely, bounds=(-_STEEPEST, _STEEPEST), method="bounded").x)
    return exponent / 2.0, float(np.exp(np.concatenate(logs).mean()))


def _pooled(lines: Mapping[LineKey, _Line], measured: Sequence[_Line]) -> tuple[dict[LineKey, Array], int]:
    """Variance of gain and phase of each line, (2,), one for all where they agree, and its degrees of freedom.

    Of few degrees of freedom gain and phase have one, unless they deny it.
    """
    if not measured:
        return {key: line.variance for key, line in lines.items()}, round(min(line.freedom for line in lines.values()))
    told = [line for line in measured if line.freedom >= _OWN_SCATTER]
    alike = _of_equal_noise(told or measured)
    few = [line for line in measured if told and line.freedom < _OWN_SCATTER]
    counted = [*alike, *few] if alike else measured
    freedoms = [line.freedom for line in counted]
    pooled, freedom = np.average([line.variance for line in counted], axis=0, weights=freedoms), sum(freedoms)
    unequal = 2.0 * fdtrc(freedom, freedom, pooled.max() / max(pooled.min(), FLOOR**2)) < _EQUAL_NOISE_P
    if freedom < _OWN_SCATTER and not unequal:
        pooled = np.full(2, pooled.mean())
    if alike or not told:
        return dict.fromkeys(lines, pooled), round(freedom)
    own = {key: line.variance if line.freedom >= _OWN_SCATTER else pooled for key, line in lines.items()}
    return own, round(min(line.freedom for line in told))


def _shared(repeated: Sequence[_Line], freedom: int, rig: RigSettings) -> tuple[float, float]:
    """Standard deviation of what a run shares in gain and phase, outlying pairs of repeats left out.

    Few repeats often show none by chance: what they lack to _ENOUGH degrees of freedom, the rig's class makes up.
    """
    pairs = np.concatenate([line.shared for line in repeated])
    usual = np.abs(pairs) <= _OUTLYING_PAIR * np.median(np.abs(pairs), axis=0)
    usual |= len(pairs) < _FEWEST_SOUGHT
    variance = np.where(usual.any(axis=0), np.mean(pairs, axis=0, where=usual), 0.0)
    measured, assumed = min(freedom / _ENOUGH, 1.0), of_class(rig, ASSUMED_SHARED)
    return _pair(np.sqrt(measured * np.maximum(variance, 0.0) + (1.0 - measured) * np.square(assumed)))


def _pair(values: Array) -> tuple[float, float]:
    """Gain and phase, (2,), as plain numbers."""
    gain, phase = values.tolist()
    return gain, phase


def _line(sweep: Sweep, log_stiffness: Array, held: float) -> _Line:
    """What one line of a sweep tells: by pairs of repeats, or about a smooth curve where there is no pair."""
    chosen = sweep.held == held
    steps, column = np.unique(sweep.step[chosen], return_inverse=True)
    numbers, row = np.unique(sweep.repeat[chosen], return_inverse=True)
    table = np.full((numbers.size, steps.size), np.nan + 0j)
    table[row, column] = log_stiffness[chosen]
    differences = (one - other for one, other in combinations(table, 2))
    kept = [(difference, _usual(difference, np.log(steps))) for difference in differences]
    pairs = [(difference[usual], steps[usual]) for difference, usual in kept if usual.sum() >= FEWEST_STEPS]
    if not pairs:
        return _about_smooth_curve(np.log(steps), np.nanmean(table, axis=0))
    scatter = [_parts(difference - difference.mean()) for difference, _ in pairs]
    shared = [
        (_parts(difference).mean(axis=0) ** 2 - np.square(spread).sum(axis=0) / (len(spread) - 1) / len(spread)) / 2.0
        for (difference, _), spread in zip(pairs, scatter, strict=True)
    ]
    independent = 2.0 / numbers.size  # of each pair: m repeats have m (m - 1)/2 pairs, and m - 1 of them are free
    return _Line(
        np.concatenate(scatter) / np.sqrt(numbers.size),
        independent * sum(len(spread) - 1 for spread in scatter),
        np.array(shared),
        independent * len(pairs),
        steps=np.concatenate([at for _, at in pairs]),
    )


def _usual(difference: Array, log_step: Array) -> Array:
    """Where two repeats were both measured and differ as they do elsewhere, (n,) bool: single outliers are faults.

    Elsewhere is all along the run, and nearby where differences grow along it: by Theil's (1950) median slope.
    """
    usual = ~np.isnan(difference)
    if np.count_nonzero(usual) < _FEWEST_SOUGHT:
        return usual
    parts = _parts(difference)
    off = np.abs(parts - median(parts[usual]))
    scale = MEDIAN_TO_SIGMA * median(off[usual])
    lengths = np.log(np.maximum(np.hypot(*off.T), FLOOR))
    x, y, half = log_step[usual], lengths[usual], np.count_nonzero(usual) // 2
    slope = median((y[-half:] - y[:half]) / (x[-half:] - x[:half]))
    scale = scale * np.exp(np.maximum(slope * (log_step - median(x)), 0.0))[:, None]
    return usual & np.all((off <= _OUTLIER * scale) | (scale == 0.0), axis=1)


def _about_smooth_curve(log_step: Array, log_stiffness: Array) -> _Line:
    """What a line without repeats tells: its scatter about a smooth curve; of one or two points this is assumed."""
    degree = min(_SMOOTH_DEGREE, log_step.size - 2)
    if degree < 1:
        return _Line(np.full((1, 2), ASSUMED_SHARED[0]), 1, np.empty((0, 2)))
    values = _parts(log_stiffness)
    basis = np.polynomial.legendre.legvander(unit(log_step), degree)
    residual = np.abs(values - basis @ least_absolute(basis, values, FLOOR**2))
    usual = np.median(np.sort(residual, axis=0)[degree + 1 :], axis=0)  # the curve goes through degree + 1 points
    inliers = np.all(residual <= np.maximum(_OUTLIER * MEDIAN_TO_SIGMA * usual, FLOOR), axis=1)
    inliers |= np.count_nonzero(inliers) < degree + 2  # too few would leave nothing free
    scatter = _freed(basis[inliers], values[inliers])
    curve = np.linalg.qr(basis)[0]
    off, free = values - curve @ (curve.T @ values), 1.0 - np.square(curve).sum(axis=1)
    falls = np.square(off).sum(axis=1) / np.maximum(free, FLOOR**2)
    worst = int(np.argmax(falls))  # the point without which the sum of squares about the curve falls most
    calmer = _freed(np.delete(basis, worst, axis=0), np.delete(values, worst, axis=0))
    return _Line(scatter, len(scatter), np.empty((0, 2)), calmer=calmer)


def unit(values: Array) -> Array:
    """Values spread from -1 to 1, (n,); all -1 where they are one."""
    return 2.0 * (values - values.min()) / max(float(np.ptp(values)), np.finfo(float).tiny) - 1.0


def _freed(basis: Array, values: Array) -> Array:
    """What a curve, (n, k), leaves of values, (n, m) -> (n - k, m), in orthonormal coordinates: they scatter
    independently. Householder's reflections are applied one by one, and no matrix of n by n is made."""
    reflections, factors = np.linalg.qr(basis, mode="raw")
    turned = values.astype(float)
    for place, (column, factor) in enumerate(zip(reflections, factors, strict=True)):
        mirror = np.append(1.0, column[place + 1 :])
        turned[place:] -= np.outer(factor * mirror, mirror @ turned[place:])
    return turned[basis.shape[1] :]


def _parts(values: Array) -> Array:
    """Gain and phase of ln K, complex (n,) -> (n, 2)."""
    return np.stack([np.real(values), np.imag(values)], axis=-1)


def _of_equal_noise(lines: Sequence[_Line]) -> list[_Line]:
    """Lines of equal noise, those that a single outlier sets apart without it; none where they are unequal."""
    alike = sorted(lines, key=lambda line: -float(line.variance.sum()))
    for place, line in enumerate(alike):
        if line.calmer is not None and line.calmer.size and _unequal(alike):
            alike[place] = replace(line, scatter=line.calmer, freedom=len(line.calmer))
    return [] if _unequal(alike) else alike


def _unequal(lines: Sequence[_Line]) -> bool:
    """Bartlett's test (1937) of the variances of lines, each with as many degrees of freedom in gain as in phase."""
    variance = np.array([line.variance.mean() for line in lines])
    freedom = np.array([2.0 * line.freedom for line in lines])
    if variance.size < 2 or not variance.all():
        return False
    pooled = np.average(variance, weights=freedom)
    few = (np.sum(1.0 / freedom) - 1.0 / freedom.sum()) / (3.0 * (variance.size - 1))
    statistic = float(freedom @ np.log(pooled / variance)) / (1.0 + few)
    return bool(chdtrc(variance.size - 1, statistic) < _EQUAL_NOISE_P)
