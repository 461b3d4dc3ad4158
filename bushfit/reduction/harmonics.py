"""The harmonics of displacement and force over whole cycles of one steady sine, fitted by least squares.

Rows may lie anywhere in time. Drift and overtones are fitted with the fundamental, so that neither leaks into it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtri

from bushfit.reading.measurement import Complex, Floats

#: Harmonics in the fit, as far as the rows can tell them apart; chosen: higher ones of a rig are in the noise.
_HARMONICS = 15
#: Harmonics in the fits that search for the frequency; chosen: the strongest ones.
_FREQUENCY_HARMONICS = 3
#: Condition number of the scaled normal equations up to which rows tell harmonics apart; chosen: errors grow tenfold.
_WORST_CONDITION = 100.0
#: Terms of the drift: mean, slope and curvature.
_DRIFT_TERMS = 3
#: Rows that are fitted at a time; chosen: their harmonics stay in a core's cache.
_CHUNK_ROWS = 1 << 14
#: [cycles] Drift of the phase over a whole step with which its frequency is found; chosen: far below its error.
_SETTLED_DRIFT = 1e-7
#: Rows that the search for the frequency takes of a long step; chosen: enough for its last digit.
_FREQUENCY_ROWS = 1 << 17
#: Probability below which chance alone does not make cycles scatter more than white noise does; chosen.
_WHITE_P = 0.005


@dataclass(frozen=True, eq=False)
class HarmonicFit:
    """Drift and harmonics of displacement and force over the whole cycles of one step, and their residuals.

    Args:
        solution: of both channels, (p, 2): drift, then cosine and negative sine of each harmonic.
        covariance: of the solution for unit variance of the values, (p, p).
        freedom: degrees of freedom: rows less unknowns.
        squares: products of the residuals of the channels, summed over the rows, (2, 2).
        left_over: complex fundamental of the residuals in each cycle, (2, cycles).
    """

    frequency: float
    solution: Floats
    covariance: Floats
    freedom: int
    squares: Floats
    left_over: Complex

    @classmethod
    def of(cls, time: Floats, displacement: Floats, force: Floats, edges: Floats) -> "HarmonicFit":
        """The fit with the frequency at which the phase of the displacement does not drift from cycle to cycle.

        Args:
            time, displacement, force: [s], [m or rad] and [N or N m], (n,).
            edges: where the cycles begin and the last one ends [s], (cycles + 1,).
        """
        middle = (edges[0] + edges[-1]) / 2.0
        time, values = time - middle, np.stack((displacement, force))
        count = edges.size - 1
        frequency = count / float(edges[-1] - edges[0])
        thin = slice(None, None, max(1, time.size // _FREQUENCY_ROWS))
        number = np.arange(count) - (count - 1) / 2.0
        for _ in range(4):  # each squares what the frequency is off by, so that fewer do
            fit = cls._solved(time[thin], values[:, thin], count, frequency, _FREQUENCY_HARMONICS)
            phase = np.unwrap(np.angle(fit.coefficients[0, 1] + fit.left_over[0]))
            drift = float(number @ phase / (number @ number)) / (2.0 * np.pi)
            frequency *= 1.0 + drift
            if abs(drift) * count < _SETTLED_DRIFT:
                break
        return cls._solved(time, values, count, frequency, _HARMONICS)

    @classmethod
    def _solved(cls, time: Floats, values: Floats, count: int, frequency: float, order: int) -> "HarmonicFit":
        """The fit over `count` cycles about time 0, with `order` harmonics or fewer, at a frequency that is given."""
        size = _DRIFT_TERMS + 2 * max(1, min(order, (time.size - _DRIFT_TERMS) // 4))
        gram, moments = np.zeros((size, size)), np.zeros((size, 2))
        for rows, basis in _bases(time, frequency, size):
            gram += basis @ basis.T
            moments += basis @ values[:, rows].T
        scale = 1.0 / np.sqrt(np.diag(gram))
        scale[_DRIFT_TERMS:] = np.sqrt(2.0 / time.size)  # by its own norm, a wave all but zero at the rows would pass
        unit = gram * np.outer(scale, scale)
        while size > _DRIFT_TERMS + 2 and np.linalg.cond(unit[:size, :size]) > _WORST_CONDITION:
            size -= 2
        covariance = np.linalg.inv(unit[:size, :size]) * np.outer(scale[:size], scale[:size])
        solution = covariance @ moments[:size]
        squares, sums, rows_in = np.zeros((2, 2)), np.zeros((2, 2, count)), np.zeros(count)
        for rows, basis in _bases(time, frequency, size):
            left = values[:, rows] - solution.T @ basis
            squares += left @ left.T
            number = np.clip(time[rows] * frequency + count / 2.0, 0, count - 1).astype(np.intp)
            rows_in += np.bincount(number, minlength=count)
            for channel, part in np.ndindex(2, 2):  # times exp(-i omega t)
                sums[channel, part] += np.bincount(number, left[channel] * basis[_DRIFT_TERMS + part], count)
        sums *= 2.0 / np.maximum(rows_in, 1.0)
        left_over = sums[:, 0] + 1j * sums[:, 1]
        return cls(frequency, solution, covariance, max(time.size - size, 1), squares, left_over)

    @property
    def coefficients(self) -> Complex:
        """Complex harmonics of displacement and force, with the mean at 0: (2, order + 1)."""
        waves = self.solution[_DRIFT_TERMS::2] + 1j * self.solution[_DRIFT_TERMS + 1 :: 2]
        return np.vstack((self.solution[:1], waves)).T

    @property
    def chance(self) -> Floats:
        """Expected square of each harmonic of white noise of unit variance, (order,)."""
        return np.diag(self.covariance)[_DRIFT_TERMS:].reshape(-1, 2).sum(axis=1)

    def errors(self) -> Floats:
        """Standard errors of |K|, relative to |K|, and of its phase [rad], (2,).

        Notes:
            e = f - K x is what the noise of both channels leaves in the force. Where e is white, its scatter over the
            rows gives the errors. Where the cycles scatter more than white noise would let them (hum, slow wander),
            their own scatter gives them.
        """
        x, f = self.coefficients[:, 1]
        k = f / x
        (xx, xf), (_, ff) = self.squares
        white = (ff - 2.0 * k.real * xf + abs(k) ** 2 * xx) / self.freedom * self.chance[0] / 2.0
        variance = np.full(2, white)
        cycles = self.left_over.shape[1]
        if cycles > 2:
            scatter = (self.left_over[1] - k * self.left_over[0]) / (f / abs(f))
            own = np.array([scatter.real.var(ddof=1), scatter.imag.var(ddof=1)]) / cycles
            high = fdtri(2 * (cycles - 1), self.freedom, 1.0 - _WHITE_P)
            if own.mean() > high * white:
                variance = own
        return np.sqrt(variance) / abs(f)

    def distortion(self) -> Floats:
        """Total harmonic distortion of displacement and force, over their fundamental, less that of noise, (2,)."""
        power = np.square(np.abs(self.coefficients[:, 1:]))
        noise = np.outer(np.diag(self.squares) / self.freedom, self.chance)
        overtones = np.maximum((power - noise)[:, 1:].sum(axis=1), 0.0)
        return np.sqrt(overtones / power[:, 0])


def cycle_harmonics(phase: Floats, values: Floats, order: int, drift: int = 0) -> tuple[Floats, Complex, Floats]:
    """Mean, complex fundamental and scatter of what is left of each column, (k,) each, by least squares over rows.

    Args:
        phase: of each row [cycles], (n,).
        values: (n, k).
        order: harmonics that are fitted.
        drift: power of the phase up to which a drift is fitted with them.
    """
    turn = np.exp(2j * np.pi * np.outer(phase, np.arange(1, order + 1)))
    basis = np.column_stack((np.vander(phase, 1 + drift, increasing=True), turn.real, -turn.imag))
    solution = np.linalg.lstsq(basis, values, rcond=None)[0]
    fundamental = solution[1 + drift] + 1j * solution[1 + drift + order]
    return solution[0], fundamental, np.std(values - basis @ solution, axis=0)


def _bases(time: Floats, frequency: float, size: int) -> Iterator[tuple[slice, Floats]]:
    """Rows of each chunk, and there the drift, then cosine and negative sine of each harmonic, (size, m)."""
    half = max(float(np.abs(time[[0, -1]]).max()), 1e-300)
    for start in range(0, time.size, _CHUNK_ROWS):
        rows = slice(start, min(start + _CHUNK_ROWS, time.size))
        basis = np.empty((size, rows.stop - start))
        span = time[rows] / half
        basis[0], basis[1], basis[2] = 1.0, span, 1.5 * span**2 - 0.5
        turn = np.exp(2j * np.pi * frequency * time[rows])
        power = turn.copy()
        for column in range(_DRIFT_TERMS, size, 2):
            basis[column], basis[column + 1] = power.real, -power.imag
            power *= turn
        yield rows, basis
