"""Faults that any recorded channel may have: gaps, stuck rows, cut-off tops and outliers."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bushfit.reading.measurement import Floats, Loop
from bushfit.reduction.cycles import least_prominence, lone_outliers
from bushfit.units import number

#: Usual steps of the clock that make a gap; chosen: a clock that stutters takes fewer.
_GAP_STEPS = 5.0
#: Widest steps of an uneven clock that make a gap; chosen: rows kept at random leave no such holes.
_GAP_WIDEST_STEPS = 3.0
#: Share of its usual step by which the steps of an even clock differ; chosen: times are rounded in files.
_EVEN_CLOCK = 0.02
#: Rows that a stuck recorder repeats; chosen: a converter repeats fewer where the motion turns.
_STUCK_ROWS = 5
#: Share of its range by which the motion goes on meanwhile; chosen: a motion that stands still goes on by less.
_STUCK_MOTION = 0.02
#: Rows that hold the very same extreme where a top is cut off; chosen: noise makes fewer alike.
_FLAT_ROWS = 8
#: Such rows to one that lies just below the extreme; chosen: a top that is not cut off has more of the latter.
_FLAT_RATIO = 5.0
#: Share of the range within which values lie just below the extreme, or else one step of the converter.
_JUST_BELOW = 2e-3


def sampling(history: Loop) -> str:
    """How the rows of a record lie in time, in words: "even, every 0.01 s"."""
    steps = np.diff(history.time)
    usual = float(np.median(steps))
    if np.ptp(steps) < _EVEN_CLOCK * usual:
        return f"even, every {usual:.4g} s"
    return f"uneven, every {steps.min():.3g} to {steps.max():.3g} s, mostly {usual:.3g} s"


class Channel(NamedTuple):
    """A recorded channel: its values in SI, (n,), and the unit in which they are told with the factor to it."""

    name: str
    unit: str
    factor: float
    values: Floats

    def shown(self, row: int) -> str:
        """The value of a row in words, without its unit."""
        return number(self.factor * self.values[row], 4)


def odd_channels(history: Loop) -> Iterator[str]:
    """A sentence for each fault in the channels of a loop or a raw history."""
    names, units = history.direction.motion.words, history.direction.display
    motion = Channel(names[0], *units.displacement, history.displacement)
    force = Channel(names[1], *units.force, history.force)
    yield from _gaps(motion, history.time, timed=history.timed)
    yield from _stuck(motion, force)
    for channel in (motion, force):
        yield from _cut_off(channel)
        yield from _outliers(channel, history.time)


def _gaps(motion: Channel, time: Floats, *, timed: bool) -> Iterator[str]:
    """A sentence on gaps in a recorded time; in a file without it, only the motion tells of them."""
    steps = np.diff(time) if timed else np.abs(np.diff(motion.values))
    widest = np.quantile(steps, 0.99)  # gaps left out
    wide = steps > max(_GAP_STEPS * np.median(steps), _GAP_WIDEST_STEPS * widest)
    if not timed:
        outliers = lone_outliers(time, motion.values)
        wide &= (steps > least_prominence(motion.values)) & ~(outliers[1:] | outliers[:-1])
    if wide.any():
        first, count = int(np.argmax(wide)), int(wide.sum())
        what = (
            f"{steps[first]:.3g} s without a row, else mostly {np.median(steps):.3g} s"
            if timed
            else f"the {motion.name} goes from {motion.shown(first)} to {motion.shown(first + 1)} {motion.unit} at once"
        )
        where = "time" if timed else "the motion"
        yield f"{count} gap{'s' * (count > 1)} in {where}, the first after data row {first + 1}: {what}"


def _stuck(motion: Channel, force: Channel) -> Iterator[str]:
    """A sentence on rows in which the recorder stood still though the motion went on."""
    still = (np.diff(motion.values) == 0.0) & (np.diff(force.values) == 0.0)
    edges = np.flatnonzero(np.diff(np.concatenate(([0], still.astype(np.int8), [0]))))
    starts, ends = edges[::2], edges[1::2]
    after = np.minimum(ends + 1, motion.values.size - 1)  # a record may end stuck: then nothing went on
    moved = np.abs(motion.values[after] - motion.values[starts])
    stuck = (ends - starts + 1 >= _STUCK_ROWS) & (moved > _STUCK_MOTION * np.ptp(motion.values))
    if stuck.any():
        longest = int(np.argmax(np.where(stuck, ends - starts, 0)))
        yield (
            f"{ends[longest] - starts[longest] + 1} rows from data row {starts[longest] + 1} on repeat one "
            f"{motion.name} and {force.name}, while the motion went on"
        )


def _cut_off(channel: Channel) -> Iterator[str]:
    """A sentence on each end of its range at which a channel is cut off."""
    values, span = channel.values, float(np.ptp(channel.values))
    rounding = 1e-9 * span
    steps = np.abs(np.diff(values))
    finest = float(steps[steps > rounding].min(initial=span))
    width = max(1.01 * finest, _JUST_BELOW * span)  # one step of the converter, rounded
    for side, row in (("top", int(np.argmax(values))), ("bottom", int(np.argmin(values)))):
        depth = np.abs(values - values[row])
        same = int(np.count_nonzero(depth <= rounding))
        below = int(np.count_nonzero(depth <= width)) - same
        if same >= _FLAT_ROWS and same >= _FLAT_RATIO * below:
            yield (
                f"the {channel.name} is cut off at its {side}: {same} rows hold exactly {channel.shown(row)} "
                f"{channel.unit}"
            )


def _outliers(channel: Channel, time: Floats) -> Iterator[str]:
    """A sentence on rows that lie alone far off their neighbours."""
    rows = np.flatnonzero(lone_outliers(time, channel.values))
    if rows.size:
        listed = ", ".join(
            f"data row {row + 1} ({channel.shown(row)} {channel.unit} between {channel.shown(row - 1)} and "
            f"{channel.shown(row + 1)})"
            for row in rows[:3]
        )
        more = f" and {rows.size - 3} more" if rows.size > 3 else ""
        outlier = "outliers" if rows.size > 1 else "an outlier"
        yield f"the {channel.name} has {outlier} at {listed}{more}"
