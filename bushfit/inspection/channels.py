"""Recorded channels of a loop or a raw history: sampling, and faults such as gaps, clipped values and outliers."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from bushfit.caveat import Caveat
from bushfit.inspection.labels import wrong_labels
from bushfit.inspection.plausible import implausible_sizes
from bushfit.reading.measurement import Floats, Loop
from bushfit.reading.names import Labels
from bushfit.reduction.cycles import lone_outliers, stretches
from bushfit.reduction.turning_points import noise_threshold
from bushfit.units import number

#: Minimum duration of a gap in units of the median time step; chosen: jitter of the clock is shorter.
_GAP_STEPS = 5.0
#: Minimum duration of a gap in units of the 99 % quantile of the time steps; chosen: random rows leave no such gap.
_GAP_WIDEST_STEPS = 3.0
#: Maximum range of the time steps of an even clock, relative to the median step; chosen: files round times.
EVEN_CLOCK = 0.02
#: Minimum number of equal rows of a stuck recorder; chosen: a converter repeats fewer at the ends of the motion.
_STUCK_ROWS = 5
#: Minimum motion during the equal rows, relative to the range of the motion; chosen: a resting motion changes by less.
_STUCK_MOTION = 0.02
#: Minimum number of rows with exactly the extreme value of a clipped channel; chosen: noise makes fewer equal.
_FLAT_ROWS = 8
#: Minimum ratio of these rows to rows just below the extreme; chosen: the ratio is smaller without clipping.
_FLAT_RATIO = 5.0
#: Distance from the extreme, relative to the range, of values just below it; at least one step of the converter.
_JUST_BELOW = 2e-3


def describe_sampling(record: Loop) -> str:
    """Describe the time steps of a record.

    Returns:
        A clause such as "even, every 0.01 s".
    """
    if not record.has_recorded_time:
        return "no time in the file"
    steps = np.diff(record.time)
    usual = record.time_step
    if np.ptp(steps) < EVEN_CLOCK * usual:
        return f"even, every {usual:.4g} s"
    return f"uneven, every {steps.min():.3g} to {steps.max():.3g} s, mostly {usual:.3g} s"


class RecordedChannel(NamedTuple):
    """Recorded displacement or force: name, display unit, factor from SI to that unit, and values [SI], (n,)."""

    name: str
    unit: str
    factor: float
    values: Floats

    def format_row(self, row: int) -> str:
        """Format the value of a row (index from 0) in the display unit, without the unit."""
        return number(self.factor * self.values[row], 4)


def odd_recording(
    record: Loop,
    labels: Mapping[str, Labels],
    frequencies: Sequence[float],
    amplitudes: Sequence[float],
    stiffness: Sequence[float],
) -> list[Caveat]:
    """Find oddities of a record: labels that contradict it, implausible sizes, and faults of its channels.

    Args:
        record: record of a loop, of several loops or of a raw history [SI].
        labels: amplitudes and frequencies stated in texts, by origin: "name" or "text above the table".
        frequencies: frequencies of its motion [Hz].
        amplitudes: zero-to-peak amplitudes of its motion [m, rad or strain], (n,).
        stiffness: magnitudes of the stiffness at these amplitudes [N/m, N m/rad or Pa], (n,).

    Returns:
        One warning for each oddity.
    """
    place, sampling_rate = record.direction, 1.0 / record.time_step
    names, units = place.motion.words, place.display
    motion = RecordedChannel(names[0], *units.displacement, record.displacement)
    force = RecordedChannel(names[1], *units.force, record.force)
    odd = [
        *wrong_labels(labels, place, amplitudes, frequencies, sampling_rate),
        *implausible_sizes(place, np.array(frequencies), np.array(amplitudes), np.array(stiffness), record.preload),
        *gaps(motion, record),
        *stuck_rows(motion, force),
    ]
    for channel in (motion, force):
        odd += [*cut_off_ends(channel), *single_outliers(channel, record)]
    return odd


def gaps(motion: RecordedChannel, record: Loop) -> Iterator[Caveat]:
    """Find gaps in the recorded time, or in the motion if no time was recorded.

    Yields:
        One warning on the number of gaps, and on the first.
    """
    steps = np.diff(record.time) if record.has_recorded_time else np.abs(np.diff(motion.values))
    usual = np.median(steps)
    wide = steps > max(_GAP_STEPS * usual, _GAP_WIDEST_STEPS * np.quantile(steps, 0.99))  # gaps left out
    if not record.has_recorded_time:
        outliers = lone_outliers(record.time, motion.values)
        wide &= (steps > noise_threshold(motion.values)) & ~(outliers[1:] | outliers[:-1])
    if not wide.any():
        return
    first, count = int(np.argmax(wide)), int(wide.sum())
    channel, size = "time", f"{steps[first]:.3g} s without a row; usual time step {usual:.3g} s"
    if not record.has_recorded_time:
        ends = f"{motion.format_row(first)} to {motion.format_row(first + 1)} {motion.unit}"
        channel, size = "the motion", f"the {motion.name} jumps from {ends} in one row"
    sentence = f"{count} gap{'s' * (count > 1)} in {channel}, the first after data row {first + 1}: {size}"
    yield Caveat("gaps", sentence)


def stuck_rows(motion: RecordedChannel, force: RecordedChannel) -> Iterator[Caveat]:
    """Find rows in which the recorder repeats its values although the motion continued.

    Yields:
        One warning on the longest run of such rows.
    """
    moves = (np.diff(motion.values) != 0.0) | (np.diff(force.values) != 0.0)
    last, smallest = motion.values.size - 1, _STUCK_MOTION * np.ptp(motion.values)
    stuck = [
        rows
        for rows in stretches(moves, _STUCK_ROWS)  # a record may end stuck: then the motion did not continue
        if abs(motion.values[min(rows.stop, last)] - motion.values[rows.start]) > smallest
    ]
    if stuck:
        longest = max(stuck, key=lambda rows: rows.stop - rows.start)
        rows = f"{longest.stop - longest.start} rows from data row {longest.start + 1} on"
        sentence = f"{rows} repeat the same {motion.name} and {force.name}, although the motion continued"
        yield Caveat("stuck_rows", sentence)


def cut_off_ends(channel: RecordedChannel) -> Iterator[Caveat]:
    """Find a channel that is clipped at its largest or smallest value.

    Yields:
        One warning for each end.
    """
    values, span = channel.values, float(np.ptp(channel.values))
    rounding, steps = 1e-9 * span, np.abs(np.diff(values))
    finest = float(steps[steps > rounding].min(initial=span))
    width = max(1.01 * finest, _JUST_BELOW * span)  # one step of the converter, rounded
    for side, row in (("top", int(np.argmax(values))), ("bottom", int(np.argmin(values)))):
        depth = np.abs(values - values[row])
        flat_rows = int(np.count_nonzero(depth <= rounding))
        below = int(np.count_nonzero(depth <= width)) - flat_rows
        if flat_rows >= max(_FLAT_ROWS, _FLAT_RATIO * below):
            extreme = f"{channel.format_row(row)} {channel.unit}"
            sentence = f"the {channel.name} is cut off at its {side}: {flat_rows} rows are exactly {extreme}"
            yield Caveat("cut_off", sentence)


def single_outliers(channel: RecordedChannel, record: Loop) -> Iterator[Caveat]:
    """Find single rows of a channel that are far from their neighbours.

    Yields:
        One warning, which lists the first three rows.
    """
    rows = np.flatnonzero(lone_outliers(record.time, channel.values))
    if rows.size:
        listed = ", ".join(
            f"data row {row + 1} ({channel.format_row(row)} {channel.unit} between {channel.format_row(row - 1)} and "
            f"{channel.format_row(row + 1)})"
            for row in rows[:3]
        )
        more = f" and {rows.size - 3} more" if rows.size > 3 else ""
        count = "outliers" if rows.size > 1 else "an outlier"
        yield Caveat("outlying_samples", f"the {channel.name} has {count} at {listed}{more}")
