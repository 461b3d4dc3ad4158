"""Correlation of the noise of a loop's rows: an autoregressive model, estimated at frequencies without physics.

A load cell's amplifier filters its noise, so that the errors of neighbouring rows are correlated. A prediction-error
filter, which subtracts from each row its prediction from the rows before, turns such noise into independent numbers of
unit variance.

Notes:
    The model is fitted by the likelihood of the periodogram (Whittle 1953, Brockwell and Davis 1991, eq. 10.8.9) at the
    frequencies between the harmonics of the cycle, where a periodic motion has no power. The Yule-Walker equations are
    solved with the power at harmonics interpolated, and the power below the lowest observed frequency taken from the
    model (expectation and maximisation, Dempster, Laird and Rubin 1977), constant below half that frequency. Rows are
    assumed to be equally spaced, whatever their times.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_banded, toeplitz

from bushfit.effects.contract import Array

#: Candidate orders of the autoregressive model; chosen: 1 describes a first-order filter, 8 a steep one with its
#: corner.
_ORDERS = (0, 1, 2, 3, 4, 6, 8)
#: Lower limit of the spectrum, relative to the variance of the noise; chosen. Without it, whitening would magnify
#: errors of the model and of interpolation at high frequencies, where a filter has removed the noise.
_FLOOR = 3e-4
#: Smallest number of frequencies per coefficient of the model.
_FEWEST = 4
#: Number of successive orders without an improvement after which no higher order is tried.
_PATIENCE = 2
#: Number of the lowest observed frequencies whose mean power is the first estimate of the power below them.
_LOWEST = 3
#: Harmonic of the cycle below which cycles may differ by settling or drift, in addition to noise.
_SLOW = 3.5
#: Largest power between these harmonics that is treated as noise, relative to that of a first-order filter.
_MOST_SLOW = 4.0
#: First even harmonic of a single cycle that is treated as noise; chosen: a symmetric bushing has odd harmonics only,
#: and an asymmetric one mainly adds the second.
_FIRST_EVEN = 4


@dataclass(frozen=True, eq=False)
class RowNoise:
    """Correlated noise of the rows of a loop, of unit variance, as an autoregressive model.

    Args:
        filter: prediction-error filter b, (p + 1,): the sum of b_k times the k-th row before is white with variance 1.
        starts: matrix that whitens the first p rows, which lack p preceding rows, (p, p).
        error: standard errors of the log of the variance, and of b_k/b_0, as independent columns, (p + 1, p + 1); None
            if not estimated.
        observed_share: fraction of the variance of the whitened rows that is observed; the rest is an assumed minimum
            of the spectrum.
        row_scale: standard deviation of a row of unit weight over the noise of a recorded row; above 1 for bins of
            correlated rows.
        breaks: indices of rows that do not depend on the row before: starts of bins averaged over other cycles.
    """

    filter: Array = field(default_factory=lambda: np.ones(1))
    starts: Array = field(default_factory=lambda: np.ones((0, 0)))
    error: Array | None = None
    observed_share: float = 1.0
    row_scale: float = 1.0
    breaks: tuple[int, ...] = ()

    @property
    def order(self) -> int:
        """Order p of the autoregressive model: number of preceding rows that the noise of a row depends on."""
        return self.filter.size - 1

    @property
    def rows_as_one(self) -> float:
        """Number of correlated rows with as much information on slow changes as one independent row, at least 1."""
        return max(1.0 / float(np.sum(self.filter)) ** 2, 1.0)

    def usable_rows(self, weight: Array) -> Array:
        """Find the rows that can be whitened, because they and the preceding rows in their filter have weight.

        Returns:
            Mask of the n rows, (n,).
        """
        counts = weight > 0.0
        usable = counts.copy()
        for k in range(1, self.order + 1):
            usable[k:] &= counts[:-k]
        for first in (0, *self.breaks):
            begun = slice(first, first + self.order)
            usable[begun] = counts[begun].all()
        return usable

    def whiten(self, rows: Array) -> Array:
        """Whiten rows in units of noise, (..., n): their noise becomes uncorrelated with unit variance.

        Returns:
            Whitened rows, (..., n).
        """
        white = self.filter[0] * rows
        for k in range(1, self.order + 1):
            white[..., k:] += self.filter[k] * rows[..., :-k]
        for first in (0, *self.breaks):
            begun = rows[..., first : first + self.order]
            few = begun.shape[-1]
            white[..., first : first + few] = begun @ self.starts[:few, :few].T
        return white

    def noise_sensitivity(self, influence: Array) -> list[Array]:
        """Change of the weights of the rows in k parameter estimates due to an error of each parameter of the noise.

        Args:
            influence: weight of each whitened row in the estimates, (k, n).

        Returns:
            For each parameter of the noise, the change due to one standard error of that parameter, (k, n); multiplied
            by the whitened residuals, it is the change of the estimates. Empty if these errors are not estimated.

        Notes:
            For V = L^-1 L^-T with the filter L, the whitened derivative is -(G + G^T) with G = dL L^-1.
        """
        if self.error is None:
            return []
        moves, rows = [influence], influence.shape[-1]
        band = np.repeat((self.filter / self.filter[0])[:, None], rows, axis=1)
        for delay in range(1, self.order + 1):
            move = np.zeros_like(influence)
            for way in (1, -1):  # rows delayed and filtered by b_0/b, the inverse of the whitening: a banded system
                late = np.zeros_like(influence).T
                late[delay:] = influence[:, ::way][:, : rows - delay].T
                move -= solve_banded((self.order, 0), band, late).T[:, ::way]
            moves.append(move)
        return list(np.tensordot(self.error.T, np.array(moves), axes=1))


class _Autoregression(NamedTuple):
    """An autoregressive model of order p.

    Args:
        polynomial: coefficients 1, a_1, ..., a_p of the prediction-error filter, (p + 1,).
        correlations: covariance of two rows at lags 0 to p, in the squared unit of the rows, (p + 1,).
    """

    polynomial: Array
    correlations: Array

    def spectrum(self, waves: Array) -> Array:
        """Power spectrum at m frequencies, (m,), from their complex exponentials exp(-i omega lag), (lags, m)."""
        variance = self.polynomial @ self.correlations
        return variance / np.abs(self.polynomial @ waves[: self.polynomial.size]) ** 2


def row_noise(residual: Array, settled: Array, cycles: int) -> tuple[RowNoise, float]:
    """Estimate correlation and size of the noise of the rows of a loop.

    Args:
        residual: force without its harmonics [N or N m], (n,); for a record of a single cycle, without its mean, its
            first three and all odd harmonics.
        settled: residual without slow changes from one cycle to the next [N or N m], (n,).
        cycles: number of whole cycles in the rows.

    Returns:
        Correlated noise of unit variance, and the standard deviation of one row [N or N m].
    """
    number = np.arange(residual.size // 2 + 1)
    between = number % cycles > 0 if cycles > 1 else noise_harmonics_of_single_cycle(number)
    fast = between & (number > _SLOW * cycles)
    waves = np.exp(-2j * np.pi / residual.size * np.outer(np.arange(_ORDERS[-1] + 1), number))
    used, power = fast, _periodogram(settled)
    model = _fit_autoregression(power, waves, used)
    slow = between & ~fast
    # a drift without its harmonics is a step per cycle
    steps = np.arange(residual.size) * cycles // residual.size - (cycles - 1) / 2.0
    whole = _periodogram(residual - steps * (steps @ residual) / max(steps @ steps, 1.0))
    first = int(np.argmax(fast))
    steepest = model.spectrum(waves[:, first : first + 1]) * np.square(first / np.maximum(number, 1))
    if slow.any() and np.mean(whole[slow] / steepest[slow]) < _MOST_SLOW:
        used, power, model = between, whole, _fit_autoregression(whole, waves, between)
    polynomial, correlations = model
    order, waves = polynomial.size - 1, waves[: polynomial.size, used]
    slopes = np.vstack((np.ones(waves.shape[1]), -2.0 * (waves[1:] / (polynomial @ waves)).real))
    starts = np.linalg.inv(np.linalg.cholesky(toeplitz(correlations[:order] / correlations[0])))
    innovation = polynomial @ correlations / correlations[0]
    error = np.linalg.cholesky(np.linalg.inv(slopes @ slopes.T))
    share = min(float(np.mean(power[used] / model.spectrum(waves))), 1.0) if order else 1.0
    return RowNoise(polynomial / np.sqrt(innovation), starts, error, share), float(np.sqrt(correlations[0]))


def noise_harmonics_of_single_cycle(number: Array) -> Array:
    """Mask of the harmonics, given by number, (n,), from which the noise of a loop of one cycle is estimated, (n,)."""
    return (number % 2 == 0) & (number >= _FIRST_EVEN)


def _periodogram(rows: Array) -> Array:
    """Power of rows, (n,), at their n // 2 + 1 frequencies, in the squared unit of the rows, above rounding."""
    power = np.abs(np.fft.rfft(rows)) ** 2 / rows.size
    return np.maximum(power, np.finfo(float).eps * power.mean())  # above rounding, for cycles that repeat exactly


def _fit_autoregression(power: Array, waves: Array, used: Array) -> _Autoregression:
    """Fit an autoregressive model to a periodogram; its order, 0 to 8, minimises Schwarz's criterion.

    Args:
        power: periodogram at m frequencies, (m,).
        waves: complex exponentials exp(-i omega lag) at these frequencies, (lags, m).
        used: mask of the frequencies to fit, (m,).
    """
    ends = np.ones(power.size)
    ends[[0, -1]] = 0.5
    cosines, used_numbers = waves.real * (ends / ends.sum()), np.flatnonzero(used)
    lowest = int(used_numbers[0])
    filled = np.interp(np.arange(power.size), used_numbers, power[used_numbers])
    filled[:lowest] = power[used_numbers[:_LOWEST]].mean()
    models, criteria = [], []
    for order in (order for order in _ORDERS if order * _FEWEST <= used_numbers.size):
        for _ in range(60):  # iterations for the unobserved power; ten suffice for nearly all loops
            correlations = cosines[: order + 1] @ filled
            correlations[0] *= 1.0 + _FLOOR
            predictor = -np.linalg.solve(toeplitz(correlations[:-1]), correlations[1:])
            model = _Autoregression(np.append(1.0, predictor), correlations)
            before = filled[:lowest].copy()
            filled[:lowest] = model.spectrum(waves[:, np.maximum(np.arange(lowest), (lowest + 1) // 2)])
            if np.allclose(filled[:lowest], before, rtol=1e-3):
                break
        spectrum = model.spectrum(waves)[used]
        models.append(model)
        criteria.append(2.0 * np.sum(np.log(spectrum) + power[used] / spectrum) + order * np.log(spectrum.size))
        if len(criteria) > _PATIENCE and min(criteria[-_PATIENCE:]) > min(criteria):
            break
    return models[int(np.argmin(criteria))]
