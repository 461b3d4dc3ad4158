"""Measurement noise of sweeps: scatter from point to point, and errors shared by a whole run.

A run is one recording, in which frequency or amplitude is stepped and the other is constant. Its points share a gain
error and a phase error. A level is the set of all runs (repeats) with the same constant value. All errors are
errors of ln K = ln|K| + i phase, so gain errors are real and phase errors imaginary, both relative to |K|.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.special import chdtrc, fdtrc

from bushfit.campaign.schema import UNSTATED, RigSettings
from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.fitting.repeats import (
    FEWEST_SOUGHT,
    FLOOR,
    LevelNoise,
    difference_freedom,
    disturbed_steps,
    level_noise,
    log_stiffness_at_nominal,
)
from bushfit.fitting.rig_class import class_errors, describe_class, format_class_errors, largest_error
from bushfit.reading.measurement import Sweep

#: Degrees of freedom from which on repeats alone determine the errors shared by a run; chosen: those of three repeats
#: at two levels; with fewer, 95 % intervals were too narrow.
_ENOUGH = 4
#: Significance level at which variances are unequal, or the scatter grows along the stepped quantity.
_BY_CHANCE = 1e-3
#: Smallest number of degrees of freedom at which a level may have a separate scatter, and phase a scatter different
#: from gain: fewer determine the scatter within a quarter only, and wrong weights cost a tenth of the accuracy.
_SEPARATE_SCATTER = 10
#: Largest exponent of the variance over the stepped quantity, far beyond those of rigs.
_STEEPEST = 6.0
#: Shared variance, relative to the median of all pairs, above which a pair of repeats is outlying: noise alone reaches
#: it once in 500 campaigns.
_OUTLYING_PAIR = 100.0

#: Key of a level: name of the sweep, and constant value of its runs (amplitude [m or rad], frequency [Hz] or run
#: number).
LevelKey = tuple[str, float]
_ORIGINS = {
    "repeats": "from repeats",
    "stated": "stated in the campaign",
    "assumed": "no repeats: scatter about a smooth curve; gain and phase assumed, unless [rig] states them",
}


@dataclass(frozen=True)
class SweepNoise:
    """Noise of all sweeps of a campaign: random errors of points, and errors shared by a run or by repeats of runs.

    Args:
        random: standard deviation of the random error of one point, in (ln|K|, phase [rad]), by level: the runs of a
            sweep at one constant amplitude or frequency.
        shared: standard deviation of the errors shared by a run, (ln|K|, phase [rad]).
        origin: source of the noise: "repeats", "stated" or "assumed".
        freedom: degrees of freedom behind `shared`; 0 if it is not estimated from repeats.
        random_freedom: degrees of freedom behind `random`; 0 if it is stated.
        slopes: power law (exponent, reference) of each sweep, by name, whose random error grows along a run: it is
            `random` times (step/reference)^exponent, with the stepped frequency [Hz] or amplitude [m or rad].
        level: standard deviation of the errors shared by all runs of a level, (ln|K|, phase [rad]).
        level_freedom: degrees of freedom behind `level`; 0 if it is exact.
        excess_warnings: warning on each sweep whose runs differ by more than the accuracy class of its rig explains, by
            name.
    """

    random: dict[LevelKey, tuple[float, float]]
    shared: tuple[float, float]
    origin: str
    freedom: int
    random_freedom: int = 0
    slopes: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    level: tuple[float, float] = (0.0, 0.0)
    level_freedom: int = 0
    excess_warnings: Mapping[str, Caveat] = field(default_factory=dict)

    def random_noise(self, name: str, run_levels: Array, step: Array) -> Array:
        """Standard deviation of the random error of n points of a sweep in relative gain and in phase [rad], (2, n).

        Args:
            name: name of the sweep.
            run_levels: amplitude [m or rad] or frequency [Hz] that is constant in the run of each point, (n,).
            step: frequency [Hz] or amplitude [m or rad] that changes along the run, (n,).
        """
        of_levels = {level: self.random[name, float(level)] for level in np.unique(run_levels)}
        exponent, reference = self.slopes.get(name, (0.0, 1.0))
        return np.array([of_levels[level] for level in run_levels]).T * (step / reference) ** exponent

    def describe(self) -> str:
        """Describe size and origin of the sweeps' noise in one line for reports."""
        shared = f"{format_class_errors(self.shared)} for a whole run"
        if any(self.level):
            shared += f", {format_class_errors(self.level)} for all repeats of a level"
        point = 100.0 * np.sqrt(np.mean(np.square(list(self.random.values()))))
        return f"{point:.2g} % per point, and {shared} ({_ORIGINS[self.origin]})"


def sweep_noise(sweeps: Sequence[Sweep], rig: RigSettings = UNSTATED) -> SweepNoise:
    """Estimate the noise of the sweeps of one rig from their repeats.

    Without repeats, the scatter is estimated about a smooth curve over the logarithm of the stepped quantity, and the
    shared error is taken from the rig's class, stated or assumed. With repeats, a stated class is the size of an error
    that all runs at one constant amplitude or frequency share, which repeats cannot reveal. A noise stated in the
    campaign, or for each point in the file, replaces the scatter.

    Returns:
        Standard deviations of gain and phase (of ln K) of all sweeps: scatter of the points, and shared errors.

    Notes:
        Let D be the difference of ln K between two repeats at one step. The mean square of the change of D from one
        step to the next is four times the random variance, even if D drifts along the run (von Neumann, 1941); the
        square of the mean of D estimates twice (shared variance + random variance / number of steps). Pairs are pooled
        within a level and over levels; levels keep separate variances if Bartlett's test finds them unequal. If the
        squares of D grow along the stepped quantity, so does the scatter.
    """
    at_levels = [(sweep, log_stiffness_at_nominal(sweep)) for sweep in sweeps]

    def of_levels(without: Collection[float]) -> dict[LevelKey, LevelNoise]:
        """Noise of every run at one constant value, by sweep and value, without the points at the given steps."""
        return {
            (sweep.name, float(run_level)): level_noise(sweep, log_stiffness, run_level, without)
            for sweep, log_stiffness in at_levels
            for run_level in np.unique(sweep.run_level)
        }

    levels = of_levels(())
    if disturbed := disturbed_steps(levels.values()):
        levels = of_levels(disturbed)
    slopes, by_name = dict[str, tuple[float, float]](), {sweep.name: sweep for sweep in sweeps}
    for stepped in {sweep.stepped for sweep in sweeps}:  # one law for all sweeps with the same stepped quantity
        names = [name for name, sweep in by_name.items() if sweep.stepped == stepped]
        if slope := _scatter_growth([level for key, level in levels.items() if key[0] in names and level.steps.size]):
            slopes |= dict.fromkeys(names, slope)
    for key, level in levels.items():
        if key[0] in slopes and level.steps.size:
            exponent, reference = slopes[key[0]]
            levels[key] = replace(level, errors=level.errors / ((level.steps / reference) ** exponent)[:, None])
    repeated = [level for level in levels.values() if level.shared_freedom]
    measured = repeated or [level for level in levels.values() if level.squared_distances]
    variances, random_freedom = _pool_variances(levels, measured)
    stated_noise = {name: sweep.noise for name, sweep in by_name.items() if sweep.noise is not None}
    for name, sweep in by_name.items():
        if sweep.noise is None and sweep.relative_error is not None:
            stated_noise[name] = float(np.sqrt(np.mean(np.square(sweep.relative_error))))
    if stated_noise:
        random_freedom, slopes = 0, {}
    random = {
        key: _as_pair(np.maximum(np.broadcast_to(stated_noise.get(key[0], np.sqrt(variance)), 2), FLOOR))
        for key, variance in variances.items()
    }
    if repeated:
        freedom, excesses = max(round(sum(level.shared_freedom for level in repeated)), _ENOUGH), dict[str, Caveat]()
        largest = np.maximum(largest_error(rig), largest_error(UNSTATED))  # [rig] states errors that repeats share
        for name in by_name:
            error = _shared_errors([level for key, level in levels.items() if key[0] == name], rig)
            if np.any(error > largest):
                excesses[name] = Caveat(
                    "runs_differ",
                    f"repeats differ as a whole by an error of {format_class_errors(_as_pair(error))}, more than a rig "
                    f"of this class causes, {describe_class(rig)}. Measure again, or state the class under [rig]",
                )
        errors = _as_pair(_shared_errors(repeated, rig)), "repeats", freedom, random_freedom
        return SweepNoise(random, *errors, slopes, class_errors(rig, (0.0, 0.0)), excess_warnings=excesses)
    if all(sweep.noise is not None for sweep in sweeps):
        return SweepNoise(random, class_errors(rig, (0.0, 0.0)), "stated", 0, random_freedom)
    return SweepNoise(random, class_errors(rig), "assumed", 0, random_freedom)


def _scatter_growth(levels: Sequence[LevelNoise]) -> tuple[float, float] | None:
    """Fit a power law to the growth of random errors with the stepped frequency or amplitude of a run.

    Returns:
        Exponent p, and the step [Hz, or m or rad] s_0 at the geometric mean: the standard deviation of the random
        errors is proportional to (step/s_0)^p. None if there is no growth at a significance level of 0.1 %.

    Notes:
        Squares of the errors, divided by the mean of their level, are regressed on ln(step). Koenker's test (1981)
        decides, because its scale is the scatter of the squares, so that heavy tails do not produce a slope. The
        exponent maximises the likelihood.
    """
    squares, logs = [], []
    for level in levels:
        steps, place = np.unique(level.steps, return_inverse=True)
        square = np.bincount(place, (np.square(level.errors) / np.maximum(level.variance, FLOOR**2)).sum(axis=1))
        if steps.size >= FEWEST_SOUGHT and square.any():
            squares.append(square / square.mean())
            logs.append(np.log(steps))
    if not logs:
        return None
    centred = np.concatenate([log - log.mean() for log in logs])
    ratio = np.concatenate(squares)
    scale = float(np.var(ratio)) * centred.size / difference_freedom(centred.size)
    statistic = float(centred @ (ratio - 1.0)) ** 2 / max(float(centred @ centred) * scale, FLOOR**2)
    if chdtrc(1, statistic) > _BY_CHANCE:
        return None

    from scipy.optimize import minimize_scalar

    def negative_log_likelihood(exponent: float) -> float:
        """Negative log likelihood of the random errors if their variance grows with this power of the step."""
        parts = np.split(ratio * np.exp(-exponent * centred), np.cumsum([log.size for log in logs])[:-1])
        return sum(part.size * float(np.log(part.mean())) for part in parts)

    exponent = float(minimize_scalar(negative_log_likelihood, bounds=(-_STEEPEST, _STEEPEST), method="bounded").x)
    return exponent / 2.0, float(np.exp(np.concatenate(logs).mean()))


def _pool_variances(
    levels: Mapping[LevelKey, LevelNoise], measured: Sequence[LevelNoise]
) -> tuple[dict[LevelKey, Array], int]:
    """Variances of the random errors in gain [1] and phase [rad^2] at each level, pooled over levels that agree.

    With few degrees of freedom gain and phase share one variance, unless they differ at a significance level of 0.1 %.

    Args:
        levels: noise of all levels (runs at one constant value), by name of the sweep and constant value.
        measured: noise of the levels with repeats or enough points.

    Returns:
        Variances of gain and phase by level, (2,) each, and the degrees of freedom of the pooled variances.
    """
    if not measured:
        return {key: one.variance for key, one in levels.items()}, round(min(one.freedom for one in levels.values()))
    well_known = [level for level in measured if level.freedom >= _SEPARATE_SCATTER]
    compared = sorted(well_known or measured, key=lambda level: -float(level.variance.sum()))
    for i, level in enumerate(compared):  # a single outlier may make variances unequal
        if level.without_largest and _variances_differ(compared):
            compared[i] = level.without_largest
    equal = not _variances_differ(compared)
    few = [level for level in measured if well_known and level.freedom < _SEPARATE_SCATTER]
    counted = [*compared, *few] if equal else measured
    freedoms = [level.freedom for level in counted]
    pooled, freedom = np.average([level.variance for level in counted], axis=0, weights=freedoms), sum(freedoms)
    unequal = 2.0 * fdtrc(freedom, freedom, pooled.max() / max(pooled.min(), FLOOR**2)) < _BY_CHANCE
    if freedom < _SEPARATE_SCATTER and not unequal:
        pooled = np.full(2, pooled.mean())
    if equal or not well_known:
        return dict.fromkeys(levels, pooled), round(freedom)
    by_level = {key: level.variance if level.freedom >= _SEPARATE_SCATTER else pooled for key, level in levels.items()}
    return by_level, round(min(level.freedom for level in well_known))


def _shared_errors(levels: Sequence[LevelNoise], rig: RigSettings) -> Array:
    """Standard deviations of relative gain and phase [rad] errors shared by the points of a run, (2,), from repeats.

    Outlying pairs of repeats are left out. Few repeats often agree by chance: below four degrees of freedom the
    variance is averaged with that of the rig's accuracy class.

    Args:
        levels: noise of the levels with repeats.
        rig: accuracy class of the rig (gain and phase errors).
    """
    pairs, freedom = np.concatenate([level.shared for level in levels]), sum(level.shared_freedom for level in levels)
    usual = np.abs(pairs) <= _OUTLYING_PAIR * np.median(np.abs(pairs), axis=0) if len(pairs) else np.empty((0, 2), bool)
    usual |= len(pairs) < FEWEST_SOUGHT
    variance = np.sum(pairs, axis=0, where=usual) / np.maximum(usual.sum(axis=0), 1)
    measured = min(freedom / _ENOUGH, 1.0)
    return np.sqrt(measured * np.maximum(variance, 0.0) + (1.0 - measured) * np.square(class_errors(rig)))


def _as_pair(values: Array) -> tuple[float, float]:
    """Convert an array of a gain and a phase, (2,), to a tuple of floats."""
    gain, phase = values.tolist()
    return gain, phase


def _variances_differ(levels: Sequence[LevelNoise]) -> bool:
    """True if the variances of levels differ at a significance level of 0.1 %, by Bartlett's test (1937)."""
    variance = np.array([level.variance.mean() for level in levels])
    freedom = np.array([2.0 * level.freedom for level in levels])
    if variance.size < 2 or not variance.all():
        return False
    pooled = np.average(variance, weights=freedom)
    few = (np.sum(1.0 / freedom) - 1.0 / freedom.sum()) / (3.0 * (variance.size - 1))
    statistic = float(freedom @ np.log(pooled / variance)) / (1.0 + few)
    return bool(chdtrc(variance.size - 1, statistic) < _BY_CHANCE)
