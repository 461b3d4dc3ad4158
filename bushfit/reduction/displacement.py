"""Preparation of displacement histories: offset, whole cycles, and a low-pass filter against noise."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bushfit.caveat import Caveat
from bushfit.errors import MeasurementError, error_location
from bushfit.reading.displacements import FEWEST_ROWS, DisplacementHistory, even_time
from bushfit.reading.headers import ERRORS
from bushfit.reading.measurement import Loop
from bushfit.reduction.arrays import difference_noise
from bushfit.units import number

#: Ratio of mean to range of a displacement above which the mean is the zero of a transducer; chosen: no rubber follows.
_OFFSET = 10.0
#: Largest displacement [m or rad]: forces of larger ones are no numbers.
_LARGEST = 1e30
#: Largest distance between the ends of a cycle, relative to its range.
_CLOSED = 0.01
#: Largest number of samples of a segment of the spectrum, share of the record, and ratio of the density to that of the
#: noise above which a frequency has motion; chosen: eight segments or more do not reach this ratio by chance.
_SEGMENT, _SHARE, _ABOVE = 4096, 8, 4.0
#: Order of the filter: at half of the cut-off frequency, it changes the motion by 0.4 %.
_ORDER = 4
#: Cycles of the cut-off frequency by which the filter extends a record, point-symmetric about its ends.
_EXTENSION = 3.0


def noise_and_highest_frequency(value: NDArray[Any], step: float) -> tuple[float, float]:
    """Estimate the white noise of a displacement, and the highest frequency of the motion above it.

    Args:
        value: displacement in any unit, evenly sampled, (n,).
        step: time between samples [s].

    Returns:
        Standard deviation of the noise, in the unit of the displacement; and highest frequency [Hz] at which the
        spectrum of the motion is above the noise.

    Notes:
        The fourth difference of a finely sampled motion is small compared with that of noise; its median magnitude
        excludes jumps of the motion.
    """
    from scipy.signal import welch  # slow to import, and few results have histories

    noise = float(difference_noise(value, 4))
    frequency, density = welch(value, 1.0 / step, nperseg=min(_SEGMENT, max(value.size // _SHARE, 8)))
    return noise, float(frequency[density > _ABOVE * 2.0 * noise**2 * step].max(initial=frequency[1]))


def prepare_displacements(
    channels: Sequence[DisplacementHistory], *, steady: bool = False, lowpass: float | None = None
) -> list[DisplacementHistory]:
    """Prepare the channels of a displacement history for a model; notes state all changes.

    Args:
        channels: evenly sampled displacements at the same times, one per direction.
        steady: True for whole cycles of a steady state, False for a motion from rest.
        lowpass: cut-off frequency of a low-pass filter [Hz]; None for no filter.

    Returns:
        Channels that move, without an offset far larger than the motion (the mean of a steady state, or the first value
        of a motion), and in a steady state without a last sample that repeats the first.

    Raises:
        MeasurementError: no motion, a steady state that does not end where it begins, or a low-pass that does not suit
            the history.
    """
    channels = [_without_offset(channel, steady=steady) for channel in _moving_channels(channels)]
    if steady:
        ends = np.array([channel.displacement[[-1, 0, 1]] / np.ptp(channel.displacement) for channel in channels])
        for channel in channels:
            _require_cycle(channel)
        if np.abs(ends[:, 0] - ends[:, 1]).sum() < 0.5 * np.abs(ends[:, 2] - ends[:, 1]).sum():
            channels = [replace(channel, displacement=channel.displacement[:-1]) for channel in channels]
    if lowpass is None:
        return channels
    return [_smooth_displacement(channel, lowpass, steady=steady) for channel in channels]


def prepare_record(record: Loop, lowpass: float | None = None) -> Loop:
    """Prepare a validation record for a model: even time steps, and a displacement without offset and (optional) noise.

    Args:
        record: record of time, displacement and force, in SI.
        lowpass: cut-off frequency of a low-pass filter for the displacement [Hz]; None for no filter.

    Returns:
        Record at evenly spaced times; the notes of its source state all changes.
    """
    with error_location(record.source.file if record.source else None, "time"):
        time, notes = even_time(record.time)
    displacement, force = (np.interp(time, record.time, values) for values in (record.displacement, record.force))
    channel = DisplacementHistory(record.direction, displacement, float(time[1] - time[0]), notes=notes)
    with error_location(record.source.file if record.source else None):
        (channel,) = prepare_displacements([channel], lowpass=lowpass)
    source = record.source and record.source.with_notes(channel.notes)
    return replace(record, time=time, displacement=channel.displacement, force=force, source=source)


def _moving_channels(channels: Sequence[DisplacementHistory]) -> list[DisplacementHistory]:
    """Check that channels have equal lengths and finite values, and leave out those that never move, with a note."""
    no_motion, shapes = "this is not a motion", {channel.displacement.shape for channel in channels}
    if len(shapes) != 1 or len(shape := shapes.pop()) != 1 or shape[0] < FEWEST_ROWS:
        found = ", ".join(f"{channel.direction}: {channel.displacement.shape}" for channel in channels)
        expected = f"at least {FEWEST_ROWS} displacements, the same number in each direction"
        raise MeasurementError("this is not a history", found=found or "no direction", expected=expected)
    for channel in channels:
        if not np.all(np.abs(channel.displacement) < _LARGEST):
            raise MeasurementError(no_motion, place=str(channel.direction), expected="finite displacements")
    still = [channel.direction for channel in channels if not np.ptp(channel.displacement)]
    if len(still) == len(channels):
        raise MeasurementError(no_motion, place=", ".join(map(str, still)), expected="displacements that change")
    notes = tuple(Caveat("still_channel", "left out: the displacement is constant").about(place) for place in still)
    return [replace(channel, notes=(*channel.notes, *notes)) for channel in channels if channel.direction not in still]


def _without_offset(channel: DisplacementHistory, *, steady: bool) -> DisplacementHistory:
    """Remove an offset far larger than the motion: the mean of a steady state, or the first value of a motion."""
    motion, span = channel.displacement, np.ptp(channel.displacement)
    if abs(motion.mean()) <= _OFFSET * span:
        return channel
    offset = float(motion.mean() if steady else motion[0])
    unit, factor = channel.direction.display.displacement
    datum = "mean" if steady else "first value"
    sentence = f"{number(factor * offset, 4)} {unit}, the {datum}, is subtracted as an offset"
    note = Caveat("offset_subtracted", sentence).about(channel.direction)
    return replace(channel, displacement=motion - offset, notes=(*channel.notes, note))


def _require_cycle(channel: DisplacementHistory) -> None:
    """Raise a MeasurementError if a history does not end where it begins."""
    motion, span = channel.displacement, np.ptp(channel.displacement)
    jump = max(_CLOSED * span, 2.0 * np.abs(np.diff(motion)).max())
    if abs(motion[-1] - motion[0]) > jump:
        unit, factor = channel.direction.display.displacement
        first, last = (f"{number(factor * end, 4)} {unit}" for end in (motion[0], motion[-1]))
        found = f"{first} at the start, {last} at the end"
        raise MeasurementError(**ERRORS["incomplete_cycles"], place=str(channel.direction), found=found)


def _smooth_displacement(channel: DisplacementHistory, frequency: float, *, steady: bool) -> DisplacementHistory:
    """Filter a displacement by a Butterworth low-pass of fourth order, forward and backward, so without delay.

    Args:
        channel: evenly sampled displacement.
        frequency: cut-off frequency [Hz], at which half of the amplitude remains.
        steady: True if the samples are repeated endlessly.

    Returns:
        The filtered displacement, with a note on the size of what is removed.
    """
    lowest, nyquist = 1.0 / (channel.step * channel.displacement.size), 0.5 / channel.step
    if not lowest <= frequency < nyquist:
        low, high = number(lowest, 4), number(nyquist, 4)
        found, problem = f"{number(frequency, 4)} Hz", "the low-pass does not suit the history"
        expected = f"at least {low} Hz (one cycle in the history) and below {high} Hz (half of the sampling rate)"
        raise MeasurementError(problem, place="lowpass", found=found, expected=expected)
    from scipy.signal import butter, sosfiltfilt

    motion, sections = channel.displacement, butter(_ORDER, frequency, fs=1.0 / channel.step, output="sos")
    if steady:
        smooth = np.asarray(sosfiltfilt(sections, np.tile(motion, 3))[motion.size : 2 * motion.size])
    else:
        extension = min(motion.size - 1, round(_EXTENSION / (frequency * channel.step)))
        smooth = np.asarray(sosfiltfilt(sections, motion, padlen=extension))
    unit, factor = channel.direction.display.displacement
    removed = number(factor * float(np.std(motion - smooth)), 2)
    sentence = f"low-passed at {number(frequency, 3)} Hz without delay, which removes {removed} {unit} rms"
    note = Caveat("low_passed", sentence).about(channel.direction)
    return replace(channel, displacement=smooth, notes=(*channel.notes, note))
