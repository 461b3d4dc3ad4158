"""Harmonics of displacement and force: Fourier series fitted by least squares to rows at any times.

A series of order m has 2 m + 1 real coefficients (mean, m cosines, m negative sines) or m + 1 complex ones (mean
first): coefficient c_k stands for the term Re c_k exp(2 pi i k phase). Phase is in cycles.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray
from scipy.special import fdtri

from bushfit.reading.measurement import Complex, Floats

#: Rows of a cycle for each harmonic; two determine a harmonic, and more avoid a fit of noise.
_ROWS_PER_HARMONIC = 5
#: Largest number of harmonics of a step, and number of harmonics in the search for its frequency.
_HARMONICS, _FREQUENCY_HARMONICS = 15, 3
#: Largest condition number of the scaled normal equations with which rows separate harmonics; chosen: errors grow
#: tenfold.
_WORST_CONDITION = 100.0
#: Singular value of the normal equations, relative to the largest one, below which rows do not separate columns.
_SINGULAR = 1e-12
#: Terms of the drift of a step: mean, slope and curvature.
_DRIFT_TERMS = 3
#: Rows of a step in one chunk of the fit, so that their harmonics stay in a core's cache; rows that are enough to
#: search for its frequency.
_CHUNK_ROWS, _FREQUENCY_ROWS = 1 << 14, 1 << 17
#: [cycles] Drift of the phase over a whole step with which its frequency is found; chosen: far below its error.
_SETTLED_DRIFT = 1e-7
#: Significance level of the test that cycles scatter more than white noise does; chosen.
_WHITE_P = 0.005


def basis(phase: Floats, order: int, *drift: Floats) -> Floats:
    """Compute the basis functions of a Fourier series with drift at the rows of a record.

    Args:
        phase: phase of each row [cycles], (n,).
        order: number of harmonics.
        drift: values of each drift function at the rows, (n,) each.

    Returns:
        Columns 1, drift, cos(2 pi k phase) and -sin(2 pi k phase) for k = 1 ... order, (n, 1 + drifts + 2 order).
    """
    first = 1 + len(drift)
    rows = np.ones((first + 2 * order, phase.size))
    for row, values in zip(rows[1:first], drift, strict=True):
        row[:] = values
    turn = np.exp(2j * np.pi * phase)
    power = turn.copy()
    for k in range(first, first + order):  # row by row, which stays in the cache: ten times as fast as all at once
        rows[k] = power.real
        np.negative(power.imag, out=rows[order + k])
        power *= turn
    return rows.T


def least_squares(columns: Floats, values: Floats, weight: NDArray[Any] | None = None) -> Floats:
    """Solve a linear least-squares problem by normal equations.

    Args:
        columns: basis functions from `basis`, (n, k); nearly orthogonal over whole cycles, so that normal equations
            lose no digits.
        values: values to fit, (n,) or (n, channels).
        weight: weight of each row, (n,); None for equal weights.

    Returns:
        Real coefficients of the columns, (k,) or (k, channels).
    """
    weighed = columns.T if weight is None or np.all(weight == 1.0) else columns.T * weight
    # four rows per cycle do not tell two harmonics apart
    return np.asarray(np.linalg.lstsq(weighed @ columns, weighed @ values, rcond=_SINGULAR)[0])


def as_complex(real: Floats) -> Complex:
    """Convert [mean, a_1 .. a_m, -b_1 .. -b_m] of a_k cos + b_k sin, (2 m + 1,), to mean and a_k - i b_k, (m + 1,)."""
    order = real.size // 2
    return np.concatenate((real[:1], real[1 : order + 1] + 1j * real[order + 1 :]))


def series(coefficients: Complex, phase: Floats) -> Floats:
    """Evaluate a Fourier series with complex coefficients, (m + 1,), at phases [cycles], (n,)."""
    return polyval(np.exp(2j * np.pi * phase), coefficients).real


def resolved_order(rows_per_cycle: float, max_order: int) -> int:
    """Number of harmonics that a record with `rows_per_cycle` rows in a cycle determines, from 1 to `max_order`."""
    return int(np.clip(rows_per_cycle / _ROWS_PER_HARMONIC, 1, max_order))


def spread_rows(rows: int, max_rows: int) -> NDArray[np.intp]:
    """Indices of up to `max_rows` of `rows` rows, ascending, spread evenly but not periodically, (max_rows,)."""
    count = min(rows, max_rows)
    number = np.arange(count)
    golden = 0.6180339887498949  # ratio less 1: its multiples, less whole numbers, spread evenly
    return (number if count == rows else (number + number * golden % 1.0) * (rows / count)).astype(np.intp)


def cycle_harmonics(phase: Floats, values: Floats, order: int, drift: int = 0) -> tuple[Floats, Complex, Floats]:
    """Fit harmonics to displacement and force, or other recorded channels, by least squares.

    Args:
        phase: phase of each row [cycles], (n,).
        values: values of k channels at the rows, (n, k).
        order: number of harmonics in the fit.
        drift: degree of the polynomial in the phase that is fitted with the harmonics; 0 for a constant.

    Returns:
        Mean, complex fundamental, and standard deviation of the residuals of each channel, (k,) each.
    """
    columns = basis(phase, order, *(phase**power for power in range(1, drift + 1)))
    solution = least_squares(columns, values)
    fundamental = solution[1 + drift] + 1j * solution[1 + drift + order]
    return solution[0], fundamental, np.std(values - columns @ solution, axis=0)


@dataclass(frozen=True, eq=False)
class HarmonicFit:
    """Least-squares fit of drift and harmonics to displacement and force over the whole cycles of a steady sine.

    Drift and overtones are fitted with the fundamental, so that neither leaks into it.

    Args:
        frequency: fundamental frequency [Hz].
        coefficients: mean and complex harmonics of displacement [m or rad] and force [N or N m], (2, order + 1).
        noise_power: expected squared magnitude of each harmonic for white noise of unit variance, (order,).
        freedom: degrees of freedom: rows minus unknowns.
        squares: sums over the rows of squares and products of the residuals of displacement and force, (2, 2).
        cycle_residuals: complex fundamental of the residuals in each cycle, (2, cycles).
    """

    frequency: float
    coefficients: Complex
    noise_power: Floats
    freedom: int
    squares: Floats
    cycle_residuals: Complex

    @classmethod
    def to_cycles(cls, time: Floats, displacement: Floats, force: Floats, edges: Floats) -> "HarmonicFit":
        """Fit whole cycles, at the frequency at which the phase of the displacement does not drift between cycles.

        Args:
            time, displacement, force: record [s, m or rad, N or N m], (n,) each.
            edges: beginnings of the cycles, and end of the last one [s], (cycles + 1,).

        Returns:
            Fit with up to 15 harmonics.
        """
        time, values = time - (edges[0] + edges[-1]) / 2.0, np.stack((displacement, force))
        count = edges.size - 1
        frequency = count / float(edges[-1] - edges[0])
        thin = slice(None, None, max(1, time.size // _FREQUENCY_ROWS))
        number = np.arange(count) - (count - 1) / 2.0
        for _ in range(4):  # each squares what the frequency is off by, so that fewer do
            fit = cls._fit_at(frequency, time[thin], values[:, thin], count, _FREQUENCY_HARMONICS)
            phase = np.unwrap(np.angle(fit.coefficients[0, 1] + fit.cycle_residuals[0]))
            drift = float(number @ phase / (number @ number)) / (2.0 * np.pi)
            frequency *= 1.0 + drift
            if abs(drift) * count < _SETTLED_DRIFT:
                break
        return cls._fit_at(frequency, time, values, count, _HARMONICS)

    @classmethod
    def _fit_at(cls, frequency: float, time: Floats, values: Floats, count: int, order: int) -> "HarmonicFit":
        """Fit drift and harmonics to whole cycles of displacement and force at a fixed frequency.

        Args:
            frequency: fundamental frequency [Hz].
            time: time of each row, 0 in the middle of the cycles [s], (n,).
            values: displacement and force [m or rad, N or N m], (2, n).
            count: number of cycles.
            order: largest number of harmonics.
        """
        order, solution, covariance = _drift_and_harmonics(time, values, frequency, order)
        squares, sums, rows_in = np.zeros((2, 2)), np.zeros((2, count), dtype=complex), np.zeros(count)
        for rows, columns in _chunks(time, frequency, order):
            residual = values[:, rows] - solution.T @ columns
            squares += residual @ residual.T
            cosine, sine = columns[_DRIFT_TERMS], columns[_DRIFT_TERMS + order]
            number = np.clip(time[rows] * frequency + count / 2.0, 0, count - 1).astype(np.intp)
            rows_in += np.bincount(number, minlength=count)
            for channel in range(2):
                sums[channel].real += np.bincount(number, residual[channel] * cosine, count)
                sums[channel].imag += np.bincount(number, residual[channel] * sine, count)
        sums *= 2.0 / np.maximum(rows_in, 1.0)
        cosines, sines = np.split(np.arange(_DRIFT_TERMS, len(solution)), 2)
        coefficients = np.vstack((solution[:1], solution[cosines] + 1j * solution[sines])).T
        noise_power = np.diag(covariance)[cosines] + np.diag(covariance)[sines]
        return cls(frequency, coefficients, noise_power, max(time.size - len(solution), 1), squares, sums)

    def errors(self) -> Floats:
        """Compute the standard errors of the complex stiffness K = F/X of the fundamentals.

        Returns:
            Relative standard error of |K|, and standard error of the phase of K [rad], (2,).

        Notes:
            e = f - K x is the force residual due to the noise of both channels. If e is white, the errors follow from
            its scatter over the rows. If the cycles scatter more than white noise does (hum, slow wander), the errors
            follow from the scatter of the cycles.
        """
        x, f = self.coefficients[:, 1]
        k = f / x
        (xx, xf), (_, ff) = self.squares
        white = (ff - 2.0 * k.real * xf + abs(k) ** 2 * xx) / self.freedom * self.noise_power[0] / 2.0
        variance = np.full(2, white)
        cycles = self.cycle_residuals.shape[1]
        if cycles > 2:
            scatter = (self.cycle_residuals[1] - k * self.cycle_residuals[0]) / (f / abs(f))
            cycle_variance = np.array([scatter.real.var(ddof=1), scatter.imag.var(ddof=1)]) / cycles
            high = fdtri(2 * (cycles - 1), self.freedom, 1.0 - _WHITE_P)
            if cycle_variance.mean() > high * white:
                variance = cycle_variance
        return np.sqrt(variance) / abs(f)

    def distortion(self) -> Floats:
        """Total harmonic distortion of displacement and force, relative to the fundamental, without noise, (2,)."""
        power = np.square(np.abs(self.coefficients[:, 1:]))
        noise = np.outer(np.diag(self.squares) / self.freedom, self.noise_power)
        overtones = np.maximum((power - noise)[:, 1:].sum(axis=1), 0.0)
        return np.sqrt(overtones / power[:, 0])


def _drift_and_harmonics(time: Floats, values: Floats, frequency: float, order: int) -> tuple[int, Floats, Floats]:
    """Fit drift and harmonics to displacement and force by least squares.

    Args:
        time: time of each row, 0 in the middle [s], (n,).
        values: displacement and force, (2, n).
        frequency: fundamental frequency [Hz].
        order: largest number of harmonics.

    Returns:
        Number of harmonics that the rows determine, at most `order`; coefficients of mean, drift and harmonics for
        displacement and force, (p, 2); and their covariance for values of unit variance, (p, p).
    """
    max_order = order = max(1, min(order, (time.size - _DRIFT_TERMS) // 4))
    size = _DRIFT_TERMS + 2 * max_order
    gram, moments = np.zeros((size, size)), np.zeros((size, 2))
    for rows, columns in _chunks(time, frequency, max_order):
        gram += columns @ columns.T
        moments += columns @ values[:, rows].T
    scale = 1.0 / np.sqrt(np.diag(gram))
    scale[_DRIFT_TERMS:] = np.sqrt(2.0 / time.size)  # by its own norm, a wave all but zero at the rows would pass
    unit, columns_kept = gram * np.outer(scale, scale), np.arange(size)
    while order > 1 and np.linalg.cond(unit[np.ix_(columns_kept, columns_kept)]) > _WORST_CONDITION:
        order -= 1
        columns_kept = np.r_[: _DRIFT_TERMS + order, _DRIFT_TERMS + max_order : _DRIFT_TERMS + max_order + order]
    kept_scale = scale[columns_kept]
    covariance = np.linalg.inv(unit[np.ix_(columns_kept, columns_kept)]) * np.outer(kept_scale, kept_scale)
    return order, covariance @ moments[columns_kept], covariance


def _chunks(time: Floats, frequency: float, order: int) -> Iterator[tuple[slice, Floats]]:
    """Yield, chunk by chunk, a slice of m rows and the drift and harmonics at these rows, (3 + 2 order, m).

    Args:
        time: time of each row, 0 in the middle [s], (n,).
        frequency: fundamental frequency [Hz].
        order: number of harmonics.
    """
    half = max(float(np.abs(time[[0, -1]]).max()), 1e-300)
    for start in range(0, time.size, _CHUNK_ROWS):
        rows = slice(start, start + _CHUNK_ROWS)
        span = time[rows] / half
        yield rows, basis(time[rows] * frequency, order, span, 1.5 * span**2 - 0.5).T
