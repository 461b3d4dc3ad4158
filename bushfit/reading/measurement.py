"""Measured tests in SI units: hysteresis loops and stepped-sine sweeps; and times of loops without a time column."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from bushfit.caveat import Caveat
from bushfit.errors import MeasurementError
from bushfit.geometry import Place
from bushfit.reading.preload import Preload

Floats = NDArray[np.float64]
Complex = NDArray[np.complex128]
Waveform = Literal["sine", "triangle"]
#: Smallest number of rows of a loop; chosen: fewer do not show its shape.
FEWEST_LOOP_ROWS = 10
#: Temperatures that differ by at most this [K] count as equal; chosen: climate chambers vary by less.
SAME_TEMPERATURE = 2.0
#: Quantity that changes from point to point of a run of a sweep.
Stepped = Literal["frequency", "amplitude"]
#: A loop or a sweep.
AnyTest = TypeVar("AnyTest", "Loop", "Sweep")

#: Smallest prominence of a turning point of a loop, relative to its range; chosen: larger than noise.
_TURN_PROMINENCE = 0.1


@dataclass(frozen=True)
class Source:
    """Provenance of a measurement.

    Args:
        file: path of the test file, as the campaign gives it.
        sha256: SHA-256 of the file in hexadecimal digits.
        conditions: conditions of the test that no fit uses, such as preload and date, by their keys in the campaign.
        notes: warnings on how the file was read, such as columns that were not understood and rows left out.
    """

    file: Path
    sha256: str
    conditions: Mapping[str, str | float] = field(default_factory=dict)
    notes: tuple[Caveat, ...] = ()

    def with_notes(self, notes: Iterable[Caveat]) -> Source:
        """Return the provenance with further warnings on how the file was read."""
        return replace(self, notes=(*self.notes, *notes))


@dataclass(frozen=True)
class RecordPart:
    """Position of a loop in a record of several loops.

    Args:
        first_row: index of the first row of the loop in the record.
        left_out: sentence on the rows left out before and after the loop; None without such rows.
    """

    first_row: int
    left_out: str | None = None


@dataclass(frozen=True, eq=False)
class Loop:
    """Hysteresis loop, or any other record of time, displacement and force.

    Args:
        name: name of the test.
        source: provenance; None for a record without a file.
        weight: weight of the test in a fit, relative to other tests.
        direction: direction of the bushing, or the specimen, that was tested.
        time: time [s], (n,).
        displacement: displacement [m or rad], or strain of a modulus test, (n,).
        force: force [N or N m], or stress [Pa], (n,).
        noise: standard deviation of the force, relative to its half range; None if the campaign does not state it.
        has_recorded_time: True if time was recorded, False if it was rebuilt from the displacement.
        part: position in a record of several loops; None if the record is a single loop.
        softening: stiffness of the first cycle relative to that of the last, minus 1; None if noise and the memory of
            the rubber explain the difference.
        temperature: temperature of the test [K]; None if it is not known.
        preload: static displacement or force about which the test was made; None if it is not known.

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
    has_recorded_time: bool = True
    weight: float = 1.0
    part: RecordPart | None = None
    softening: float | None = None
    temperature: float | None = None
    preload: Preload | None = None

    def __post_init__(self) -> None:
        _check_lengths(self.name, self.time, self.displacement, self.force)

    @property
    def time_step(self) -> float:
        """Time from row to row [s]: the median, which missing rows do not change."""
        return float(np.median(np.diff(self.time)))

    def select(self, rows: slice | NDArray[np.bool_]) -> Loop:
        """Return the loop with only some of its n rows, given by a slice or a mask, (n,)."""
        return replace(self, **{name: getattr(self, name)[rows] for name in ("time", "displacement", "force")})


@dataclass(frozen=True, eq=False)
class Sweep:
    """Complex dynamic stiffness at several operating points, measured with a stepped sine.

    In a run, either the frequency is stepped at a constant amplitude, or the amplitude at a constant frequency. If a
    mass swings on a mount, neither is constant.

    Args:
        name, direction, source, weight: name, tested direction or specimen, provenance, and weight in a fit.
        frequency: frequency [Hz], (n,).
        amplitude: nominal displacement amplitude, zero-to-peak [m or rad, or strain], (n,).
        stiffness: complex stiffness [N/m or N m/rad], or modulus [Pa], (n,).
        repeat: number of the repeat to which each point belongs, from 1, (n,); by default all 1.
        noise: standard deviation of the real and of the imaginary part, relative to |K|; None if not stated.
        reached: amplitude that the rig actually reached [m or rad, or strain], (n,); None if it is not known.
        stepped: quantity that changes from point to point of a run; None if both change.
        relative_error: standard deviation of the real and of the imaginary part of each point, relative to |K|, (n,);
            None if the file does not state it.
        temperature: temperature of the test, or of each point, (n,) [K]; None if it is not known.
        preload: static displacement or force about which the test was made; None if it is not known.

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
    preload: Preload | None = None

    def __post_init__(self) -> None:
        if self.repeat.size == 0:
            object.__setattr__(self, "repeat", np.ones(self.frequency.size, dtype=np.int64))
        _check_lengths(self.name, self.frequency, self.amplitude, self.stiffness, self.repeat, self.amplitude_reached)

    @property
    def amplitude_reached(self) -> Floats:
        """Amplitude at which a model is evaluated [m or rad, or strain], (n,): as reached, or else nominal."""
        return self.amplitude if self.reached is None else self.reached

    @property
    def run_level(self) -> Floats:
        """Constant level of the run of each point, (n,): amplitude [m or rad], frequency [Hz] or repeat number."""
        if self.stepped is None:
            return self.repeat.astype(float)
        return self.amplitude if self.stepped == "frequency" else self.frequency

    @property
    def step(self) -> Floats:
        """Value that changes from point to point of a run, (n,): frequency [Hz] or amplitude [m or rad]."""
        return self.amplitude if self.stepped == "amplitude" else self.frequency


def _check_lengths(name: str, *columns: NDArray[np.generic]) -> None:
    """Raise a MeasurementError if the columns of a test are not one-dimensional arrays of equal length."""
    shapes = [column.shape for column in columns]
    if len(set(shapes)) > 1 or len(shapes[0]) != 1:
        raise MeasurementError(f"the columns of {name} differ in shape", found=str(shapes), expected="(n,) each")


def rebuild_time(
    displacement: Floats, *, rate: float | None = None, frequency: float | None = None, waveform: Waveform = "triangle"
) -> Floats:
    """Rebuild the time of a loop from its displacement and waveform.

    Args:
        displacement: displacement [m or rad], (n,), any number of strokes, with a range above zero.
        rate: speed [m/s or rad/s], of a sine the mean speed of each stroke; None if it is not known.
        frequency: frequency [Hz], used if no rate is given; default 1 Hz.
        waveform: shape of the displacement over time.

    Returns:
        Time [s], (n,), strictly increasing from zero.

    Notes:
        The position of a row on its stroke gives its time. Rows may be uneven in time. The first and the last stroke,
        which the record may cut short, are parts of a stroke over the whole range.
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
        duration = abs(end - start) / rate if rate else 0.5 / (frequency or 1.0)
        highest, row = np.maximum.accumulate(share), np.arange(share.size)
        rises_on = np.append(highest[1:] > highest[:-1], True) & (highest > highest[0])
        rises_on[0] = True
        elapsed = np.interp(row, row[rises_on], highest[rises_on]) * duration  # linear while the motion stands still
        time[first : last + 1] = time[first] + elapsed - elapsed[0]
    return time


def _stroke_edges(displacement: Floats) -> NDArray[np.intp]:
    """Row indices, in ascending order, of the first row, the turning points of the displacement, and the last row."""
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
    """Return the loss factor [-], (n,): the ratio of imaginary to real part of a complex stiffness, (n,)."""
    return np.imag(stiffness) / np.real(stiffness)
