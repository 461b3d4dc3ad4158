"""Measured data: Loop and Sweep, frozen, SI, checked."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
Waveform = Literal["sine", "triangle"]

#: A turning point of a loop stands out from its neighbours by at least this share of the range.
_TURN_PROMINENCE = 0.1


@dataclass(frozen=True)
class Source:
    """The file a measurement came from, as the campaign names it, for provenance."""

    file: Path
    sha256: str


@dataclass(frozen=True, eq=False)
class Loop:
    """A quasi-static hysteresis loop: time [s], displacement [m or rad], force [N or N m], each (n,).

    noise is the standard deviation of the force relative to its half range, where the campaign states it; of a loop
    that is not `timed` the time was made from its motion.
    """

    name: str
    direction: Direction
    time: Floats
    displacement: Floats
    force: Floats
    noise: float | None = None
    source: Source | None = None
    timed: bool = True

    def __post_init__(self) -> None:
        _check_lengths(self.name, self.time, self.displacement, self.force)


@dataclass(frozen=True, eq=False)
class Sweep:
    """Stepped sine: frequency [Hz], zero-to-peak amplitude [m or rad], complex dynamic stiffness
    [N/m or N m/rad] and repeat number (default: all 1), each (n,).

    amplitude is that of the level, the same for all its points; reached is what each point really reached, where
    that is known: the model is asked there.

    noise is the standard deviation of the real and of the imaginary part, each relative to |K|, where
    the campaign states it.
    """

    name: str
    direction: Direction
    frequency: Floats
    amplitude: Floats
    stiffness: NDArray[np.complex128]
    repeat: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    noise: float | None = None
    source: Source | None = None
    reached: Floats | None = None

    def __post_init__(self) -> None:
        if self.repeat.size == 0:
            object.__setattr__(self, "repeat", np.ones(self.frequency.size, dtype=np.int64))
        _check_lengths(self.name, self.frequency, self.amplitude, self.stiffness, self.repeat, self.amplitude_reached)

    @property
    def amplitude_reached(self) -> Floats:
        """Amplitude of each point as reached, or else of its level [m or rad], (n,)."""
        return self.amplitude if self.reached is None else self.reached


def _check_lengths(name: str, *columns: NDArray[np.generic]) -> None:
    shapes = [column.shape for column in columns]
    if len(set(shapes)) > 1 or len(shapes[0]) != 1:
        raise MeasurementError(f"the columns of {name} differ in shape", found=str(shapes), expected="(n,) each")


def rebuild_time(
    displacement: Floats, *, rate: float | None = None, frequency: float | None = None, waveform: Waveform = "triangle"
) -> Floats:
    """The time of each sample of a loop that was recorded without it, from where the sample lies on its stroke.

    Samples need not be even in time, and noise does not make time run backwards. Strokes that the record cuts short,
    at its start and end, count as parts of a stroke over the whole range.

    Args:
        displacement: [m or rad], (n,), any number of strokes, with a range above zero.
        rate: speed of the displacement [m/s or rad/s]; or else
        frequency: cycles per time [Hz], with
        waveform: the course of the displacement in time.

    Returns:
        Time [s], (n,), strictly increasing from zero.
    """
    edges = _stroke_edges(displacement)
    extremes = float(displacement.min()), float(displacement.max())
    time = np.zeros_like(displacement)
    for number, (first, last) in enumerate(pairwise(edges)):
        stroke = displacement[first : last + 1]
        rises = stroke[-1] > stroke[0]
        start = stroke[0] if number > 0 else extremes[0 if rises else 1]
        end = stroke[-1] if number < len(edges) - 2 else extremes[1 if rises else 0]
        share = np.clip((stroke - start) / (end - start), 0.0, 1.0)
        if waveform == "sine":
            share = np.arccos(1.0 - 2.0 * share) / np.pi
        if rate is not None:
            duration = abs(end - start) / rate
        elif frequency is not None:
            duration = 0.5 / frequency
        else:
            raise TypeError("rebuild_time needs a rate or a frequency")
        elapsed = _strictly_increasing(share) * duration
        time[first : last + 1] = time[first] + elapsed - elapsed[0]
    return time


def _stroke_edges(displacement: Floats) -> NDArray[np.intp]:
    """Indices of the first sample, of the turning points, and of the last sample."""
    from scipy.signal import find_peaks

    prominence = _TURN_PROMINENCE * np.ptp(displacement)
    peaks, troughs = (find_peaks(sign * displacement, prominence=prominence)[0] for sign in (1.0, -1.0))
    turns = np.concatenate([peaks, troughs])
    is_peak = np.arange(turns.size) < peaks.size
    order = np.argsort(turns)
    turns, is_peak = turns[order], is_peak[order]
    turns = turns[np.append(is_peak[1:] != is_peak[:-1], True)[: turns.size]]  # equal peaks in a row are one turn
    if turns.size and displacement[turns[0]] == displacement[0]:
        turns = turns[1:]
    if turns.size and displacement[turns[-1]] == displacement[-1]:
        turns = turns[:-1]
    return np.concatenate([[0], turns, [displacement.size - 1]])


def _strictly_increasing(values: Floats) -> Floats:
    """The running maximum, with its standstills replaced by straight lines."""
    highest = np.maximum.accumulate(values)
    keep = np.append(highest[1:] > highest[:-1], True) & (highest > highest[0])
    keep[0] = True
    index = np.arange(values.size)
    return np.interp(index, index[keep], highest[keep])
