"""Measured tests in SI units: a hysteresis loop, a stepped-sine sweep; and the time of a loop recorded without it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from bushfit.errors import MeasurementError
from bushfit.geometry import Place

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
Waveform = Literal["sine", "triangle"]
#: Temperatures as near as this [K] are the same: chosen, chambers keep to less.
SAME_TEMPERATURE = 2.0
#: What changes from point to point of a run.
Stepped = Literal["frequency", "amplitude"]

#: Share of the range by which a turning point of a loop stands out from its neighbours; chosen: noise stays below it.
_TURN_PROMINENCE = 0.1


@dataclass(frozen=True)
class Source:
    """The provenance of a measurement.

    Args:
        file: as the campaign names it.
        sha256: of its content.
        conditions: of the test that no fit uses, as the campaign states them, such as preload and date.
        notes: a sentence for each of its columns that varies from row to row and was not understood.
    """

    file: Path
    sha256: str
    conditions: Mapping[str, str | float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def with_note(self, note: str) -> Source:
        """The same provenance with one more note."""
        return replace(self, notes=(*self.notes, note))


@dataclass(frozen=True)
class RecordPart:
    """Where a loop stands in a record of several: its first row, from 0, and a sentence on what of it is left out."""

    first_row: int
    left_out: str | None = None


@dataclass(frozen=True, eq=False)
class Loop:
    """A hysteresis loop, or any other record of time, displacement and force.

    Args:
        name, source, weight: of the test: its name, the file it came from, and its weight in a fit relative to others.
        direction: of the bushing, or the specimen tested in place of one.
        time: [s], (n,).
        displacement: [m or rad], or strain of a modulus test, (n,).
        force: [N or N m], or stress [Pa], (n,).
        noise: standard deviation of the force relative to its half range, where the campaign states it.
        timed: whether time was recorded; else it was rebuilt from the displacement.
        part: where it stands in a record of several loops; None where the record is one loop.
        softening: by how much its first cycle is stiffer than its last, relative to the last; None where no more than
            noise and the memory of rubber make.
        temperature: at which it was tested [K], where it is known.

    Raises:
        MeasurementError: arrays of different length.
    """

    name: str
    direction: Place
    time: Floats
    displacement: Floats
    force: Floats
    noise: float | None = None
    source: Source | None = None
    timed: bool = True
    weight: float = 1.0
    part: RecordPart | None = None
    softening: float | None = None
    temperature: float | None = None

    def __post_init__(self) -> None:
        _check_lengths(self.name, self.time, self.displacement, self.force)

    def at(self, rows: slice | NDArray[np.bool_]) -> Loop:
        """The record of these rows alone."""
        return replace(self, **{name: getattr(self, name)[rows] for name in ("time", "displacement", "force")})


@dataclass(frozen=True, eq=False)
class Sweep:
    """A sweep: a complex dynamic stiffness for each of its operating points.

    Either the frequency is stepped and the amplitude held, or the amplitude is stepped and the frequency held, or
    neither is held, as where a mass swings on a mount. What was recorded in one go is a run.

    Args:
        name, direction, source, weight: as of `Loop`.
        frequency: [Hz], (n,).
        amplitude: of the level, the same for all its points, zero-to-peak [m or rad, or strain], (n,).
        stiffness: complex [N/m or N m/rad, or Pa], (n,).
        repeat: number of the repeat, (n,); all 1 unless given.
        noise: standard deviation of the real and of the imaginary part relative to |K|, where the campaign states it.
        reached: amplitude that each point really reached [m or rad], (n,); None where it is not known.
        stepped: what changes from point to point of a run; the other is held. None where neither is.
        relative_error: standard deviation of the real and of the imaginary part of each point relative to |K|, (n,),
            where the file states it.
        temperature: at which it was tested [K], or each point, (n,), where it is known.

    Raises:
        MeasurementError: arrays of different length.
    """

    name: str
    direction: Place
    frequency: Floats
    amplitude: Floats
    stiffness: Complex
    repeat: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    noise: float | None = None
    source: Source | None = None
    reached: Floats | None = None
    stepped: Stepped | None = "frequency"
    relative_error: Floats | None = None
    weight: float = 1.0
    temperature: Floats | float | None = None

    def __post_init__(self) -> None:
        if self.repeat.size == 0:
            object.__setattr__(self, "repeat", np.ones(self.frequency.size, dtype=np.int64))
        _check_lengths(self.name, self.frequency, self.amplitude, self.stiffness, self.repeat, self.amplitude_reached)

    @property
    def amplitude_reached(self) -> Floats:
        """Amplitude that each point reached, or else that of its level [m or rad], (n,): a model is evaluated there."""
        return self.amplitude if self.reached is None else self.reached

    @property
    def held(self) -> Floats:
        """What every point of a run has in common, (n,): amplitude [m or rad] or frequency [Hz], or else its number."""
        if self.stepped is None:
            return self.repeat.astype(float)
        return self.amplitude if self.stepped == "frequency" else self.frequency

    @property
    def step(self) -> Floats:
        """What changes from point to point of a run, (n,): frequency [Hz] or amplitude [m or rad]."""
        return self.amplitude if self.stepped == "amplitude" else self.frequency


def _check_lengths(name: str, *columns: NDArray[np.generic]) -> None:
    shapes = [column.shape for column in columns]
    if len(set(shapes)) > 1 or len(shapes[0]) != 1:
        raise MeasurementError(f"the columns of {name} differ in shape", found=str(shapes), expected="(n,) each")


def rebuild_time(
    displacement: Floats, *, rate: float | None = None, frequency: float | None = None, waveform: Waveform = "triangle"
) -> Floats:
    """The time of each row of a loop that was recorded without it, by the place of the row on its stroke.

    Args:
        displacement: [m or rad], (n,), any number of strokes, with a range above zero.
        rate, frequency: speed [m/s or rad/s], or else cycles per time [Hz].
        waveform: the course of the displacement in time.

    Returns:
        Time [s], (n,), strictly increasing from zero.

    Notes:
        Rows need not be even in time, and noise does not make time run backwards. The strokes at the start and the end,
        which the record may cut short, count as parts of a stroke over the whole range.
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
        highest, row = np.maximum.accumulate(share), np.arange(share.size)
        keep = np.append(highest[1:] > highest[:-1], True) & (highest > highest[0])
        keep[0] = True
        elapsed = np.interp(row, row[keep], highest[keep]) * duration  # in straight lines where it stands still
        time[first : last + 1] = time[first] + elapsed - elapsed[0]
    return time


def _stroke_edges(displacement: Floats) -> NDArray[np.intp]:
    """The first row, the rows of the turning points, and the last row."""
    from scipy.signal import find_peaks

    prominence = _TURN_PROMINENCE * np.ptp(displacement)
    peaks, troughs = (find_peaks(sign * displacement, prominence=prominence)[0] for sign in (1.0, -1.0))
    turns = np.sort(np.concatenate([peaks, troughs]))
    is_peak = np.isin(turns, peaks)
    turns = turns[np.append(is_peak[1:] != is_peak[:-1], True)[: turns.size]]  # equal peaks in a row are one turn
    if turns.size and displacement[turns[0]] == displacement[0]:
        turns = turns[1:]
    if turns.size and displacement[turns[-1]] == displacement[-1]:
        turns = turns[:-1]
    return np.concatenate([[0], turns, [displacement.size - 1]])


def loss_factor(stiffness: Complex) -> Floats:
    """Loss over storage stiffness [-], (n,)."""
    return np.imag(stiffness) / np.real(stiffness)
