"""Errors of the rig as changes of residuals: errors shared by a run, a level or a loop, and drift along a run."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import log

import numpy as np
from scipy.special import chdtri, logsumexp

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.priors import COMPOUND, LEVELS, RUNS, WANDERING, WAVES, WITHIN_CLASS
from bushfit.effects.contract import Array
from bushfit.fitting.preparation import MeasuredSweep, group_repeats, split_by_kind, with_gain_weighting
from bushfit.fitting.problem import FitResult
from bushfit.fitting.rig_class import ASSUMED, class_errors

#: Kinds of errors of the rig; the values are indices of `NoiseCase.errors`.
_RUN, _LEVEL, _WAVE, _LOOP = range(4)
#: Minimum number of points of a run that can drift.
_FEWEST = 4
#: Degrees of freedom of the estimated scatter above which the scatter is treated as known.
_KNOWN = 30


@dataclass(frozen=True)
class NoiseCase:
    """One combination of assumed sizes of the rig's errors and of the rubber's smooth deviation from the model's laws.

    Args:
        scatter: factor on the estimated random noise from point to point of a sweep.
        errors: standard deviations of the errors of a run, of a level (all points at one constant amplitude or
            frequency), of drift along a run, and of a loop, relative to those of the rig's accuracy class.
        log_weight: natural log of the prior probability of the case.
        wide: True if the case assumes errors of levels larger than the accuracy class allows.
        compound: standard deviation of the rubber's deviation, relative to |K|.
    """

    scatter: float
    errors: tuple[float, ...]
    log_weight: float
    wide: bool = False
    compound: float = 0.0


@dataclass(frozen=True, eq=False)
class Block:
    """Residuals that share errors of the rig with each other only, with the changes that these errors cause.

    A block contains the gains, or the phases, of a sweep at one constant amplitude or frequency (a level), or a loop
    and its repeats.

    Args:
        rows: indices of these residuals in the residual vector, (n,).
        columns: change of the whitened residuals due to each of w errors of the size of the rig's accuracy class,
            (w, n).
        kinds: kind of each error (run, level, drift or loop), (w,).
        scatters: True for points of sweeps, whose random noise differs between noise cases; False for loops.
    """

    rows: Array
    columns: Array
    kinds: Array
    scatters: bool


@dataclass(frozen=True, eq=False)
class RigErrors:
    """Errors of the rig that points of the tests share, and their possible sizes; independent of the model.

    Args:
        blocks: sets of residual rows that share errors, with residuals in units of the scatter from point to point.
        cases: assumptions on the sizes of the errors, over which the evidence is averaged.
        variance: variance of a further independent error of each of the n residuals, (n,).
    """

    blocks: Sequence[Block]
    cases: Sequence[NoiseCase]
    variance: Array

    @cached_property
    def log_weight(self) -> Array:
        """Natural log of the prior probability of each noise case (assumed sizes of the errors), (cases,)."""
        return np.array([case.log_weight for case in self.cases])

    @cached_property
    def deviation(self) -> Array:
        """Standard deviation of the rubber's smooth deviation in each case, relative to |K|, (cases,)."""
        return np.array([case.compound for case in self.cases])

    @cached_property
    def is_plain(self) -> Array:
        """Mask of the noise cases with rig errors within the stated accuracy and no rubber deviation, (cases,)."""
        return np.array([not case.wide and case.compound == 0.0 for case in self.cases])

    @cached_property
    def combinations(self) -> tuple[Array, Array]:
        """Distinct combinations of sizes of random noise and rig errors, and the combination of each noise case.

        Returns:
            Factor on the random noise, then the sizes of the errors of runs, levels, drift and loops, (combinations,
            5); and the index of the combination of each case, (cases,). Cases that differ only in the rubber's
            deviation share a combination.
        """
        sizes = np.array([(case.scatter, *case.errors) for case in self.cases])
        distinct, index = np.unique(sizes, axis=0, return_inverse=True)
        return distinct, index.ravel()

    @cached_property
    def weights(self) -> tuple[Array, Array]:
        """Reciprocal variances of the residuals due to random noise alone, without the errors that points share.

        Returns:
            Reciprocal variances for each assumed size of the random noise, (sizes, n); and for each combination in
            `combinations`, the index of the size that it assumes, (combinations,).
        """
        scatters, index = np.unique(self.combinations[0][:, 0], return_inverse=True)
        variances = np.ones((scatters.size, self.variance.size))
        for block in self.blocks:
            if block.scatters:
                variances[:, block.rows] = np.square(scatters)[:, None]
        return 1.0 / (variances + self.variance), index

    @cached_property
    def kernels(self) -> tuple[Array, Array]:
        """Matrices K by which inner products of residuals are corrected for the errors that a block of them shares.

        Returns:
            K = D (1 + D W N^-1 W^T D)^-1 D for each block and each combination of sizes in `combinations`, (blocks,
            combinations, w, w): N are the variances of the random noise, W the changes of the residuals by the w shared
            errors of the block, and D the sizes of these errors. Then the natural log of the determinant of the
            residuals' covariance, (combinations,).

        Notes:
            The covariance is S = N + W^T D^2 W, so R S^-1 R^T = R N^-1 R^T - (W N^-1 R^T)^T K (W N^-1 R^T) for rows R
            (Woodbury identity).
        """
        sizes, _ = self.combinations
        weights, scatter = self.weights
        width = max((len(block.kinds) for block in self.blocks), default=0)
        inner = np.zeros((len(self.blocks), len(weights), width, width))
        kinds = np.full((len(self.blocks), 1, width), -1)
        for number, block in enumerate(self.blocks):
            count = len(block.kinds)
            inner[number, :, :count, :count] = block.columns * weights[:, None, block.rows] @ block.columns.T
            kinds[number, 0, :count] = block.kinds
        errors = np.pad(sizes[:, 1:], ((0, 0), (0, 1)))[np.arange(len(sizes))[:, None], kinds]
        pairs = errors[..., :, None] * errors[..., None, :]
        covariance = np.eye(width) + pairs * inner[:, scatter]
        log_det = np.linalg.slogdet(covariance)[1].sum(axis=0) - np.sum(np.log(weights), axis=1)[scatter]
        return pairs * np.linalg.inv(covariance), log_det


def in_scatter_units(fit: FitResult) -> FitResult:
    """Express the residuals of a fit in units of random noise (scatter from point to point), without shared errors.

    Residuals of sweeps are differences of ln K (gain and phase), because a difference relative to the measurement would
    make noise appear smaller where the model is wrong.

    Args:
        fit: the fitted model and the tests.

    Returns:
        The same fit with the new residuals.
    """
    data_sets = tuple(
        replace(data_set, noise=replace(data_set.noise, shared=(0.0, 0.0), level=(0.0, 0.0)), residuals="complex")
        if isinstance(data_set, MeasuredSweep)
        else data_set
        for data_set in with_gain_weighting(fit.data_sets, weigh=False)
    )
    return fit.reevaluate(fit.model, data_sets)


def rig_errors(fit: FitResult, rig: RigSettings) -> RigErrors:
    """Build the errors of a rig that points of the fitted tests share, with their possible sizes.

    Args:
        fit: the fitted model and the tests, with residuals in units of the scatter from point to point.
        rig: accuracy class that [rig] states; its gain error (relative) and phase error [rad] set the size of an error.
    """
    return RigErrors(list(error_blocks(fit, rig)), noise_cases(fit), np.zeros(fit.residual.size))


def noise_cases(fit: FitResult) -> list[NoiseCase]:
    """List the combinations of assumed sizes of the rig's errors and of the rubber's smooth deviation from the model.

    The random noise from point to point has several sizes if it was estimated from few repeats.

    Args:
        fit: the fitted model and the tests.

    Returns:
        Noise cases, whose prior probabilities sum to one.
    """
    sweeps = split_by_kind(fit.data_sets)[1]
    freedom = max((sweep.noise.random_freedom for sweep in sweeps), default=0)
    thirds = (np.arange(3) + 0.5) / 3
    scatters = np.sqrt(freedom / chdtri(freedom, 1.0 - thirds)).tolist() if 0 < freedom < _KNOWN else [1.0]
    runs, waves = (RUNS, WANDERING) if sweeps else (((0.0, 1.0),),) * 2
    unnormalised = [
        NoiseCase(
            scatter, (run, level, wave, level), log(a * b * c * d / len(scatters)), level > WITHIN_CLASS, deviation
        )
        for scatter, (run, a), (level, b), (wave, c), (deviation, d) in product(scatters, runs, LEVELS, waves, COMPOUND)
        if deviation == 0.0 or level <= WITHIN_CLASS  # errors of levels beyond the class would hide a deviation
    ]
    total = logsumexp([case.log_weight for case in unnormalised])
    return [replace(case, log_weight=float(case.log_weight - total)) for case in unnormalised]


def error_blocks(fit: FitResult, rig: RigSettings) -> Iterator[Block]:
    """Divide the residuals of a fit into blocks that share errors of the rig.

    Args:
        fit: the fitted model and the tests.
        rig: stated accuracy class of the rig (gain and phase errors).

    Yields:
        Gains, then phases, of each sweep at each constant amplitude or frequency, then each loop with its repeats:
        indices of the residuals, and their changes by the errors of the class; every residual is in one block.
    """
    loops, sweeps = split_by_kind(fit.data_sets)
    classes = class_errors(rig, ASSUMED)
    for sweep in sweeps:
        first, count = fit.residual_rows[sweep].start, sweep.frequency.size
        runs = np.split(np.arange(count), sweep.block_starts[1:])
        units = sweep.whiten(np.full(count, 1.0 + 1.0j)).reshape(2, count)
        for level in np.unique(sweep.run_level):
            line = np.flatnonzero(sweep.run_level == level)
            line_runs = [run - line[0] for run in runs if sweep.run_level[run[0]] == level]
            columns, kinds = _shared_errors(line.size, line_runs)
            for part, unit_class in enumerate(classes):
                yield Block(first + part * count + line, unit_class * columns * units[part, line], kinds, scatters=True)
    for group in group_repeats(loops):
        rows = np.concatenate(
            [np.arange(fit.residual_rows[loop].start, fit.residual_rows[loop].stop) for loop in group]
        )
        gain = classes[0] * np.concatenate([loop.gain_and_offset()[0] for loop in group])
        yield Block(rows, gain[None], np.array([_LOOP]), scatters=False)


def _shared_errors(count: int, runs: Sequence[Array]) -> tuple[Array, Array]:
    """Values of the errors that points of a level (one constant amplitude or frequency) share, each of unit size.

    Args:
        count: number n of points.
        runs: indices of the points of each run.

    Returns:
        Value of each of w errors (of the level, of each run, and drift along each run) at the points, (w, n), and the
        kind of each error, (w,).
    """
    columns, kinds = [np.ones(count)], [_LEVEL]
    for run in runs:
        orders = np.arange(1, WAVES + 1)[:, None] if run.size >= _FEWEST else np.empty((0, 1))
        waves = np.sqrt(2.0) * np.cos(np.pi * orders * (np.arange(run.size) + 0.5) / run.size) / orders
        for shape, kind in ((np.ones(run.size), _RUN), *((wave, _WAVE) for wave in waves)):
            column = np.zeros(count)
            column[run] = shape
            columns.append(column)
            kinds.append(kind)
    return np.array(columns), np.array(kinds)
