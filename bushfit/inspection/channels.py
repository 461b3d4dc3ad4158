"""What can be wrong with a recorded channel, whatever the test: gaps, stuck rows, cut-off tops, wild rows."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bushfit.reading.measurement import Floats, Loop
from bushfit.reduction.cycles import least_turn, wild_rows
from bushfit.units import number

#: A gap is that many usual steps of the clock, and so many times the widest steps of an uneven clock.
_GAP, _UNEVEN = 5.0, 3.0
#: Rows in which nothing moves though the motion went on by this share of its range.
_STUCK_ROWS, _STUCK_MOTION = 5, 0.02
#: A top is cut off where so many rows hold the very same extreme, and so many times those just below it.
_FLAT_ROWS, _FLAT_RATIO = 8, 5.0
#: Values are equal, and just below the extreme, within these shares of the range.
_EQUAL, _BELOW = 1e-9, 2e-3
_MOST_LISTED = 3

Flags = NDArray[np.bool_]


def clock(history: Loop) -> str:
    """The sampling in words."""
    steps = np.diff(history.time)
    usual = float(np.median(steps))
    if np.ptp(steps) < 0.02 * usual:
        return f"even, every {usual:.4g} s"
    return f"uneven, every {steps.min():.3g} to {steps.max():.3g} s, mostly {usual:.3g} s"


class Channel(NamedTuple):
    """A recorded channel, and how it is shown."""

    name: str
    unit: str
    factor: float
    values: Floats

    def shown(self, row: int) -> str:
        return number(self.factor * self.values[row], 4)


def odd_channels(history: Loop) -> Iterator[str]:
    """Sentences on the channels of a loop or a raw history."""
    names = history.direction.motion.words
    units = history.direction.display
    motion = Channel(names[0], *units.displacement, history.displacement)
    force = Channel(names[1], *units.force, history.force)
    still = (np.diff(motion.values) == 0.0) & (np.diff(force.values) == 0.0)
    yield from _gaps(history.time) if history.timed else _jumps(motion, history.time)
    yield from _stuck(motion, force, still)
    for channel in (motion, force):
        yield from _cut_off(channel)
        yield from _wild(channel, history.time)


def _wide(steps: Floats) -> Flags:
    return steps > max(_GAP * np.median(steps), _UNEVEN * np.quantile(steps, 0.99))


def _gaps(time: Floats) -> Iterator[str]:
    steps = np.diff(time)
    wide = _wide(steps)
    if wide.any():
        first, count = int(np.argmax(wide)), int(wide.sum())
        yield (
            f"{count} gap{'s' * (count > 1)} in time, the first after data row {first + 1}: {steps[first]:.3g} s "
            f"without a row, else mostly {np.median(steps):.3g} s"
        )


def _jumps(motion: Channel, time: Floats) -> Iterator[str]:
    """Gaps in a file without time, where only the motion tells of them."""
    steps, wild = np.abs(np.diff(motion.values)), wild_rows(time, motion.values)
    wide = _wide(steps) & (steps > least_turn(motion.values)) & ~(wild[1:] | wild[:-1])
    if wide.any():
        first, count = int(np.argmax(wide)), int(wide.sum())
        yield (
            f"{count} gap{'s' * (count > 1)} in the motion, the first after data row {first + 1}: the {motion.name} "
            f"goes from {motion.shown(first)} to {motion.shown(first + 1)} {motion.unit} at once"
        )


def _stuck(motion: Channel, force: Channel, still: Flags) -> Iterator[str]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], still.astype(np.int8), [0]))))
    starts, ends = edges[::2], edges[1::2]
    moved = np.zeros(starts.size)
    inside = ends < motion.values.size - 1
    moved[inside] = np.abs(motion.values[ends[inside] + 1] - motion.values[starts[inside]])
    stuck = (ends - starts + 1 >= _STUCK_ROWS) & (moved > _STUCK_MOTION * np.ptp(motion.values))
    if stuck.any():
        longest = int(np.argmax(np.where(stuck, ends - starts, 0)))
        yield (
            f"{ends[longest] - starts[longest] + 1} rows from data row {starts[longest] + 1} on repeat one "
            f"{motion.name} and {force.name}, while the motion went on"
        )


def _cut_off(channel: Channel) -> Iterator[str]:
    values, span = channel.values, float(np.ptp(channel.values))
    steps = np.abs(np.diff(values))
    finest = float(steps[steps > _EQUAL * span].min(initial=span))
    width = max(1.01 * finest, _BELOW * span)
    for side, row in (("top", int(np.argmax(values))), ("bottom", int(np.argmin(values)))):
        depth = np.abs(values - values[row])
        same = int(np.count_nonzero(depth <= _EQUAL * span))
        below = int(np.count_nonzero(depth <= width)) - same
        if same >= _FLAT_ROWS and same >= _FLAT_RATIO * below:
            yield (
                f"the {channel.name} is cut off at its {side}: {same} rows hold exactly {channel.shown(row)} "
                f"{channel.unit}"
            )


def _wild(channel: Channel, time: Floats) -> Iterator[str]:
    rows = np.flatnonzero(wild_rows(time, channel.values))
    if rows.size:
        listed = ", ".join(
            f"data row {row + 1} ({channel.shown(row)} {channel.unit} between {channel.shown(row - 1)} and "
            f"{channel.shown(row + 1)})"
            for row in rows[:_MOST_LISTED]
        )
        more = f" and {rows.size - _MOST_LISTED} more" if rows.size > _MOST_LISTED else ""
        yield f"the {channel.name} is wild at {listed}{more}"
