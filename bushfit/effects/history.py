"""A motion over time, evenly sampled: from rest, or one cycle of a steady state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit.reduction.turning_points import reversals

Array = NDArray[Any]
#: Tolerance of implicit equations for any motion, relative to its maximum: far below the error of its sampling.
_SAMPLED_ACCURACY = 1e-6


@dataclass(frozen=True, eq=False)
class History:
    """Displacement or strain over time, evenly sampled: input of the laws that compute a stress or force over time.

    Args:
        value: samples [m, rad or 1], (..., n); leading axes are different motions or parameter values.
        step: time between samples [s].
        periodic: True if the samples are whole cycles of a steady state; False if the motion starts from rest before
            the first sample.
        frequency: frequency of the excitation [Hz]; like the step, it may differ between motions, (..., 1).
        driver: motion imposed by the rig, if a compliance lies between it and this motion; None if they are equal.
        solved: previous solutions of implicit equations (of a compliance) for this motion, by name; start values for
            the next solution.
        accuracy: tolerance of implicit equations for this motion, relative to its maximum.
        second_order: True for fractional derivatives of second order in the step, False for the sum of Garcia Tarrago
            et al. 2007, Eq. 3, which is of first order. A steady state has neither error.

    >>> cycle = History.steady(np.array([0.0, 1.0, 0.0, -1.0]), 5.0)
    >>> cycle.step, cycle.amplitude, cycle.strokes.strides
    (0.05, array([1.]), array([-2.,  2.]))
    """

    value: Array
    step: float
    periodic: bool
    frequency: float
    driver: Array | None = None
    solved: dict[str, Any] = field(default_factory=dict)
    accuracy: float = 1e-10
    second_order: bool = False
    _by_factor: dict[float, History] = field(default_factory=dict, init=False)

    @classmethod
    def steady(cls, value: Array, frequency: float, cycles: int = 1) -> History:
        """Create the history of a steady state.

        Args:
            value: samples of whole cycles at equal time steps, without the first sample of the next cycle [m, rad or
                1], (..., n).
            frequency: frequency of the excitation [Hz].
            cycles: number of cycles in the samples.
        """
        return cls(value, cycles / (frequency * value.shape[-1]), periodic=True, frequency=frequency)

    @classmethod
    def sampled(cls, value: Array, step: float, *, periodic: bool = False) -> History:
        """Create the history of any motion, with fractional derivatives of second order in the step.

        Args:
            value: samples [m, rad or 1], (n,).
            step: time between samples [s].
            periodic: True if the samples are repeated endlessly, False for a motion from rest.

        Returns:
            History whose frequency is the mean frequency of the motion, for effects that depend on a frequency.

        Notes:
            The mean frequency is the rms rate over the rms displacement from the mean, over 2 pi (S. O. Rice, Bell
            Syst. Tech. J. 24 (1945) 46), which is exact for a sine; but at least one cycle in the history.

        >>> round(History.sampled(np.sin(np.linspace(0.0, 20.0 * np.pi, 1000)), 1e-3).frequency, 2)
        10.01
        """
        moving, resting = float(np.std(np.diff(value))) / step, float(np.std(value))
        lowest = 1.0 / (step * value.size)
        frequency = max(moving / (2.0 * np.pi * resting), lowest) if resting else lowest
        return cls(value, step, periodic, frequency, accuracy=_SAMPLED_ACCURACY, second_order=True)

    @property
    def omega(self) -> float:
        """Angular frequency of the excitation [rad/s]."""
        return 2.0 * np.pi * self.frequency

    @cached_property
    def amplitude(self) -> Array:
        """Amplitude of the motion: half of the range of the values, (..., 1)."""
        return np.ptp(self.value, axis=-1, keepdims=True) / 2.0

    @cached_property
    def harmonics(self) -> Array:
        """Angular frequencies of the entries of `spectrum` [rad/s], (n // 2 + 1,)."""
        return 2.0 * np.pi * np.fft.rfftfreq(self.value.shape[-1], self.step)

    @cached_property
    def spectrum(self) -> Array:
        """Fourier transform of the samples, by numpy.fft.rfft, (..., n // 2 + 1)."""
        return np.fft.rfft(self.value)

    def response(self, transfer: Callable[[Array], Array]) -> Array:
        """Steady response over time of a linear system to this motion, y_h = H(h omega) x_h for every harmonic h.

        Args:
            transfer: function H of angular frequencies [rad/s] that gives output over input; finite at 0.

        Returns:
            Response at each sample, (..., n).
        """
        return np.fft.irfft(transfer(self.harmonics) * self.spectrum, n=self.value.shape[-1])

    @cached_property
    def fundamental(self) -> Array:
        """First harmonic X exp(i omega t) of the last cycle at all samples, complex, (..., n)."""
        samples = self.value.shape[-1]
        cycle = round(1.0 / float(np.max(self.step * self.frequency)))
        turn = np.exp(2j * np.pi * np.arange(samples) / cycle)
        return 2.0 * np.mean(self.value[..., -cycle:] * turn[-cycle:].conj(), axis=-1, keepdims=True) * turn

    @cached_property
    def strokes(self) -> Strokes:
        """Strokes of each motion between its turning points, in order of time; input of the friction laws."""
        count, samples = self.value.shape[-1], np.arange(self.value.shape[-1])
        if self.periodic:
            top = _single_row(np.argmax(self.value, axis=-1)[..., None])
            path = _take(self.value, (top + np.arange(count + 1)) % count)
            place = (samples - top) % count
        else:
            path = np.concatenate([np.zeros_like(self.value[..., :1]), self.value], axis=-1)
            place = np.minimum(samples + 1, count - 1)
        turned = _single_row(reversals(path))
        passed = np.cumsum(turned, axis=-1)
        ends = np.full((*turned.shape[:-1], int(passed[..., -1].max()) + 2), count)
        ends[..., 0] = 0
        *rows, turns = np.nonzero(turned)
        ends[*rows, passed[turned]] = turns
        levels, piece = _take(path, ends), _take(passed, place)
        return Strokes(np.diff(levels), self.value - _take(levels, piece), _single_row(piece))

    @cached_property
    def rate(self) -> Array:
        """Time derivative of the values by central differences, (..., n) [m/s, rad/s or 1/s]."""
        if self.periodic:
            ahead, behind = np.roll(self.value, -1, axis=-1), np.roll(self.value, 1, axis=-1)
            return (ahead - behind) / (2.0 * self.step)
        from_rest = np.concatenate([np.zeros_like(self.value[..., :1]), self.value], axis=-1)
        return np.gradient(from_rest, axis=-1)[..., 1:] / self.step

    @property
    def cycles(self) -> int:
        """Number of cycles of the excitation in the samples, rounded."""
        return round(self.value.shape[-1] * float(np.max(self.step * self.frequency)))

    @property
    def sense(self) -> Array:
        """Sign of the rate (-1, 0 or 1), (..., n): of the motion that the rig imposes (`driver`) if there is one."""
        leading = self if self.driver is None else self.with_value(self.driver)
        return np.sign(leading.rate)

    @property
    def acceleration(self) -> Array:
        """Second time derivative by differences, (..., n) [m/s^2 or rad/s^2]; each end copies the adjacent value."""
        inner = np.diff(self.value, n=2, axis=-1) / self.step**2
        return np.concatenate([inner[..., :1], inner, inner[..., -1:]], axis=-1)

    def with_value(self, value: Array, solved: dict[str, Any] | None = None) -> History:
        """Create a history of other values, (..., n), at the same times.

        Args:
            value: samples [m, rad or 1].
            solved: start values of implicit equations, see `History`.
        """
        return replace(self, value=value, solved={} if solved is None else solved)

    def faster(self, factor: Any) -> History:
        """Create the history of the same motion run `factor` times as fast: same displacements, shorter time steps.

        Args:
            factor: a number, or (..., 1).
        """
        return replace(self, step=self.step / factor, frequency=self.frequency * factor, solved={})

    def as_driver(self) -> History:
        """Copy the history and mark its motion as imposed by the rig, for this and all histories made from it."""
        return replace(self, driver=self.value, solved={})

    def scaled(self, factor: float) -> History:
        """Create a history with all values multiplied by a factor, such as strain per displacement; cached."""
        if factor not in self._by_factor:
            self._by_factor[factor] = self.with_value(self.value * factor)
        return self._by_factor[factor]


@dataclass(frozen=True, eq=False)
class Strokes:
    """Strokes of a motion between its turning points, by which friction and slider laws compute their stress.

    A motion from rest begins at 0, before its first sample; a steady cycle begins and ends at its maximum.

    Args:
        strides: change of the value over each of the k strokes, (..., k); 0 for motions with fewer strokes.
        travel: change of the value between the previous turning point and each sample, (..., n).
        piece: index (0 to k - 1) of the stroke of each sample, (..., n), or (n,) if all motions turn at equal samples.
    """

    strides: Array
    travel: Array
    piece: Array

    def at_samples(self, stroke_values: Array) -> Array:
        """Expand values per stroke, (..., k), to values per sample, (..., n)."""
        return _take(stroke_values, self.piece)


def _single_row(rows: Array) -> Array:
    """Return a single row, (n,), if all rows, (..., n), are equal; otherwise all rows."""
    first = rows.reshape(-1, rows.shape[-1])[0]
    return first if np.all(rows == first) else rows


def _take(values: Array, indices: Array) -> Array:
    """Select values of each row, (..., n), at indices (m,) that are the same for all rows, or (..., m) per row."""
    if indices.ndim == 1:
        return values.take(indices, axis=-1)
    shape = np.broadcast_shapes(values.shape[:-1], indices.shape[:-1])
    rows, columns = (np.broadcast_to(array, (*shape, array.shape[-1])) for array in (values, indices))
    return np.take_along_axis(rows, columns, axis=-1)
