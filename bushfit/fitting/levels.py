"""Estimate errors shared by all runs of a level from the residuals of a fit, because repeats cannot reveal them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.preparation import MeasuredSweep, MeasuredTest, residual_slices, split_by_kind

#: Relative change of the variances at which Fisher scoring has converged: far below their standard error.
_SETTLED = 1e-3
#: Decrease of -2 ln(likelihood) above which errors of levels are significant; chosen on 40 simulated campaigns: chance
#: gave 3 at most in most of them, and an error as large as the scatter of a point gave 50.
_MATTERS = 6.0
#: The same limit if no run was repeated: the errors shared by a run are then assumed, not measured.
_MATTERS_UNREPEATED = 0.5
#: Smallest remaining share of a level's error, after the fitted parameters are projected out, that determines the
#: error.
_LEFT = 1e-6


class LevelErrors(NamedTuple):
    """Gain and phase errors shared by all runs of a level (one constant amplitude or frequency), estimated from a fit.

    Args:
        error: standard deviation of the relative gain error, and of the phase error [rad].
        freedom: degrees of freedom behind the error; 0 if the error is fixed at the largest that a rig may have.
        significant: True if including these errors lowers -2 ln(likelihood) by more than 6, or by more than 0.5 if no
            run was repeated.
    """

    error: tuple[float, float]
    freedom: int
    significant: bool


def level_errors(
    data_sets: Sequence[MeasuredTest], residual: Array, absorbed: Array, maximum: tuple[float, float]
) -> LevelErrors:
    """Estimate gain and phase errors that all runs of a level (one constant amplitude or frequency) share.

    Args:
        data_sets: fitted tests.
        residual: whitened residuals at the end of the fit, with the rows of priors, (n,).
        absorbed: changes of the whitened residuals that parameters or faults of the record can cause, (k, n).
        maximum: largest standard deviation of gain and of phase [rad] that the rig may have.

    Returns:
        Standard deviations of the errors, with degrees of freedom and significance.

    Notes:
        An error of a level adds v u u^T to the covariance of the whitened residuals, where u is the whitened unit error
        of the level and v its variance. The directions in `absorbed` are projected out (Patterson and Thompson, 1971).
        The restricted likelihood is maximised by Fisher scoring, in the space of the levels.
    """
    rows, kinds, before, size = list[Array](), np.empty(0), (0.0, 0.0), residual.size
    for sweep, block in zip(data_sets, residual_slices(data_sets), strict=True):
        if isinstance(sweep, MeasuredSweep):
            units = level_error_columns(sweep)
            before, kinds = sweep.noise.level, np.append(kinds, np.arange(len(units)) % 2)  # 0 for gain, 1 for phase
            rows.append(np.zeros((len(units), size)))
            rows[-1][:, block] = units
    nothing = LevelErrors(before, 0, significant=False)
    if not rows:
        return nothing
    columns = np.concatenate(rows)
    span, strength, _ = np.linalg.svd(absorbed.T, full_matrices=False)
    span = span[:, strength > _LEFT * strength.max(initial=0.0)]
    remainder = columns - (columns @ span) @ span.T
    values, vectors = np.linalg.eigh(remainder @ remainder.T)
    determined = values > _LEFT * np.square(np.linalg.norm(columns, axis=1)).max()
    root = np.sqrt(values[determined, None]) * vectors[:, determined].T
    components = (vectors[:, determined].T @ (remainder @ residual)) / np.sqrt(values[determined])
    parts = np.array([root[:, kinds == kind] @ root[:, kinds == kind].T for kind in (0, 1)])
    scale = np.array([np.mean(np.square(columns[kinds == kind]).sum(axis=1)) for kind in (0, 1)])
    counted = np.square(before)
    added, most_added = np.zeros(2), np.maximum(np.square(maximum) - counted, 0.0)

    def likelihood(added: Array) -> tuple[Array, Array, float]:
        """Derivatives and value of the restricted log likelihood for given errors of the levels.

        Args:
            added: variance of the gain and of the phase [rad^2] to add to that of the levels, (2,).

        Returns:
            Gradient, (2,), and Fisher information, (2, 2), of ln(likelihood), and the value of -2 ln(likelihood).
        """
        covariance = np.eye(components.size) + np.tensordot(added, parts, 1)
        solved = np.linalg.solve(covariance, parts)
        white = np.linalg.solve(covariance, components)
        gradient = 0.5 * (np.einsum("i,kij,j->k", white, parts, white) - np.trace(solved, axis1=1, axis2=2))
        information = 0.5 * np.einsum("kij,lji->kl", solved, solved)
        return gradient, information, float(np.linalg.slogdet(covariance)[1] + components @ white)

    for _ in range(40):  # Fisher scoring; it converges in fewer iterations
        gradient, information, _ = likelihood(added)
        step = gradient / np.maximum(np.diag(information), np.finfo(float).tiny)
        clipped = np.clip(added + step, 0.0, most_added)
        if np.all(np.abs(clipped - added) <= _SETTLED * (added + 1.0 / scale)):
            break
        added = clipped
    _, information, minimum = likelihood(added)
    freedoms = (2.0 * np.diag(information) * np.square(added + 1.0 / scale))[added < most_added]
    if freedoms.min(initial=np.inf) < 1.0:
        return nothing
    measured = any(sweep.noise.freedom for sweep in split_by_kind(data_sets)[1])
    fall = likelihood(np.zeros(2))[2] - minimum
    significant = fall > (_MATTERS if measured else _MATTERS_UNREPEATED)
    gain, phase = np.sqrt(counted + added).tolist()
    return LevelErrors((gain, phase), int(freedoms.min()) if freedoms.size else 0, significant)


def level_error_columns(sweep: MeasuredSweep) -> Array:
    """Derivatives of a sweep's whitened residuals with respect to a gain and a phase error of each level.

    Returns:
        Derivatives, (2 levels, n): gain [1] and phase [rad] of the first level, then of the next.
    """
    masks = (sweep.run_level == run_level for run_level in np.unique(sweep.run_level))
    return np.array([column for mask in masks for column in sweep.shared_error_columns(mask)])
