"""A motion over time, evenly sampled: from rest, or one cycle of a steady state."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class History:
    """A displacement or strain over time, evenly sampled.

    Args:
        value: samples [m, rad or 1] along the last axis; leading axes hold other motions or other parameter values.
        step: time between samples [s].
        periodic: True where the samples are whole cycles of a steady state, after which the first sample comes again;
            False where the motion starts from rest before the first sample.
        frequency: of the excitation [Hz]; like the step, it may differ between motions, (..., 1).
        driver: the imposed motion, where something that gives way lies between it and this one.
        solved: where equations over this motion were solved last, by name: good starts of the next solution, no more.
        accuracy: how far equations over this motion may be from solved, relative to it, before a last step; answers
            from another start differ by as little.

    >>> cycle = History.steady(np.array([0.0, 1.0, 0.0, -1.0]), 5.0)
    >>> cycle.step, cycle.amplitude, cycle.turning.strides
    (0.05, array([1.]), array([-2.,  2.]))
    """

    value: Array
    step: float
    periodic: bool
    frequency: float
    driver: Array | None = None
    solved: dict[str, Any] = field(default_factory=dict)
    accuracy: float = 1e-10

    @classmethod
    def steady(cls, value: Array, frequency: float, cycles: int = 1) -> History:
        """Create the history of a steady state.

        Args:
            value: samples of whole cycles, (..., n).
            frequency: of the excitation [Hz].
            cycles: number of cycles in the samples.
        """
        return cls(value, cycles / (frequency * value.shape[-1]), periodic=True, frequency=frequency)

    @property
    def omega(self) -> float:
        """Angular frequency of the excitation [rad/s]."""
        return 2.0 * np.pi * self.frequency

    @cached_property
    def amplitude(self) -> Array:
        """Half of the range of the values, (..., 1)."""
        return np.ptp(self.value, axis=-1, keepdims=True) / 2.0

    @cached_property
    def harmonics(self) -> Array:
        """Angular frequencies of numpy.fft.rfft over the samples [rad/s]."""
        return 2.0 * np.pi * np.fft.rfftfreq(self.value.shape[-1], self.step)

    @cached_property
    def spectrum(self) -> Array:
        """numpy.fft.rfft over the samples."""
        return np.fft.rfft(self.value)

    def response(self, transfer: Callable[[Array], Array]) -> Array:
        """Steady response of a linear system, y_h = H(h omega) x_h for every harmonic h; H(0) must be finite."""
        return np.fft.irfft(transfer(self.harmonics) * self.spectrum, n=self.value.shape[-1])

    @cached_property
    def fundamental(self) -> Array:
        """The last cycle's first harmonic X exp(i omega t), whose real part is its share of the motion, same shape."""
        samples = self.value.shape[-1]
        cycle = round(1.0 / float(np.max(self.step * self.frequency)))
        turn = np.exp(2j * np.pi * np.arange(samples) / cycle)
        return 2.0 * np.mean(self.value[..., -cycle:] * turn[-cycle:].conj(), axis=-1, keepdims=True) * turn

    @cached_property
    def turning(self) -> Turning:
        """The pieces of each motion between its turning points, in the order in which friction follows them."""
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
        return Turning(np.diff(levels), self.value - _take(levels, piece), _single_row(piece))

    @cached_property
    def rate(self) -> Array:
        """Time derivative of the values by central differences, same shape; a motion from rest was at 0 before."""
        if self.periodic:
            ahead, behind = np.roll(self.value, -1, axis=-1), np.roll(self.value, 1, axis=-1)
            return (ahead - behind) / (2.0 * self.step)
        from_rest = np.concatenate([np.zeros_like(self.value[..., :1]), self.value], axis=-1)
        return np.gradient(from_rest, axis=-1)[..., 1:] / self.step

    @property
    def cycles(self) -> int:
        """Cycles of the excitation in the samples, to the nearest whole one."""
        return round(self.value.shape[-1] * float(np.max(self.step * self.frequency)))

    @property
    def sense(self) -> Array:
        """Sign of the rate, 0 at rest; that of the imposed motion, where this one is driven by it."""
        leading = self if self.driver is None else self.with_value(self.driver)
        return np.sign(leading.rate)

    @property
    def acceleration(self) -> Array:
        """Second time derivative by differences; each end takes its neighbour's, so that the start gets no kick."""
        inner = np.diff(self.value, n=2, axis=-1) / self.step**2
        return np.concatenate([inner[..., :1], inner, inner[..., -1:]], axis=-1)

    def with_value(self, value: Array, solved: dict[str, Any] | None = None) -> History:
        """Other values at the same times; with `solved` of values near them, where there were some."""
        return replace(self, value=value, solved={} if solved is None else solved)

    def faster(self, factor: Any) -> History:
        """History of the same motion, faster by a factor: a number, or (..., 1)."""
        return replace(self, step=self.step / factor, frequency=self.frequency * factor, solved={})

    def driven(self) -> History:
        """History of the same motion, which becomes the driver of histories derived from it."""
        return replace(self, driver=self.value, solved={})

    def scaled(self, factor: float) -> History:
        """All values times a factor, such as strain per displacement; computed once, as a fit asks for it often."""
        if factor not in self._by_factor:
            self._by_factor[factor] = self.with_value(self.value * factor)
        return self._by_factor[factor]

    @cached_property
    def _by_factor(self) -> dict[float, History]:
        """The scaled histories by their factor."""
        return {}


@dataclass(frozen=True, eq=False)
class Turning:
    """The pieces of a motion between its turning points.

    A motion from rest begins at 0, before its first sample; a steady cycle at its top, to which it returns.

    Args:
        strides: change of the value over each piece, (..., k); 0 beyond the last where other motions have more.
        travel: change of the value from the turning point before each sample to it, (..., n).
        piece: number of the piece that each sample is on, (..., n), or (n,) where all turn at the same samples.
    """

    strides: Array
    travel: Array
    piece: Array

    def at_samples(self, of_pieces: Array) -> Array:
        """Expand values of the pieces, (..., k), to the samples, (..., n)."""
        return _take(of_pieces, self.piece)


def _single_row(rows: Array) -> Array:
    """Single row, (n,), if all rows, (..., n), are equal; otherwise all rows."""
    first = rows.reshape(-1, rows.shape[-1])[0]
    return first if np.all(rows == first) else rows


def _take(values: Array, indices: Array) -> Array:
    """Values of each row, (..., n), at indices, (m,), or at a row of indices for each row, (..., m)."""
    if indices.ndim == 1:
        return values.take(indices, axis=-1)
    shape = np.broadcast_shapes(values.shape[:-1], indices.shape[:-1])
    rows, columns = (np.broadcast_to(array, (*shape, array.shape[-1])) for array in (values, indices))
    return np.take_along_axis(rows, columns, axis=-1)


def reversals(value: Array) -> Array:
    """Reversals of a motion.

    Args:
        value: samples, (..., n).

    Returns:
        True at each sample, except the last, at which the motion reverses, (..., n - 1). If the motion rests before it
        reverses, the last sample of the rest is the reversal.

    >>> reversals(np.array([0.0, 1.0, 1.0, 0.0]))
    array([False, False,  True])
    """
    steps = np.diff(value, axis=-1)
    rising = steps > 0.0
    if not (moves := steps != 0.0).all():
        moving = np.maximum.accumulate(np.where(moves, np.arange(steps.shape[-1]), 0), axis=-1)
        rising, moves = (np.take_along_axis(array, moving, axis=-1) for array in (rising, moves))
        moves[..., 1:] &= moves[..., :-1]
    turned = np.zeros_like(rising)
    turned[..., 1:] = (rising[..., 1:] != rising[..., :-1]) & moves[..., 1:]
    return turned
