"""What can be wrong with a recorded channel, whatever the test: gaps, stuck rows, cut-off tops, wild rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bushfit.geometry import Direction
from bushfit.measurement import Floats, Loop
from bushfit.sheets import display_units

#: A gap is that many usual steps of the clock, and so many times the widest steps of an uneven clock.
_GAP, _UNEVEN = 5.0, 3.0
#: Rows in which nothing moves though the motion went on by this share of its range.
_STUCK_ROWS, _STUCK_MOTION = 5, 0.02
#: A top is cut off where so many rows hold the very same extreme, and so many times those just below it.
_FLAT_ROWS, _FLAT_RATIO = 8, 5.0
#: A row is wild beyond so many standard deviations from its neighbours, this share of the range, and this many times
#: what a few rows a cycle make of a bend.
_WILD, _WILD_SHARE, _BEND = 10.0, 0.03, 3.0
_MOST_LISTED = 3

Flags = NDArray[np.bool_]


def clock(history: Loop) -> str:
    """The sampling in words."""
    steps = np.diff(history.time)
    usual = float(np.median(steps))
    if np.ptp(steps) < 0.02 * usual:
        return f"even, every {usual:.4g} s"
    return f"uneven, every {steps.min():.3g} to {steps.max():.3g} s, mostly {usual:.3g} s"


def odd_channels(history: Loop, rows_per_cycle: float) -> Iterator[str]:
    """Sentences on the channels of a loop or a raw history."""
    names = ("rotation", "moment") if history.direction is Direction.TORSION else ("displacement", "force")
    shown = display_units(history.direction)
    steps = np.diff(history.time)
    wide = steps > max(_GAP * np.median(steps), _UNEVEN * np.quantile(steps, 0.99))
    still = (np.diff(history.displacement) == 0.0) & (np.diff(history.force) == 0.0)
    yield from _gaps(steps, wide)
    yield from _stuck(history, still, names)
    whole = ~np.any(np.lib.stride_tricks.sliding_window_view(wide | still, 4), axis=1)
    for name, kind, values in zip(names, ("length", "force"), (history.displacement, history.force), strict=True):
        unit, factor = shown[kind]
        yield from _cut_off(name, unit, factor, values)
        yield from _wild(name, unit, factor, values, whole, rows_per_cycle)


def _gaps(steps: Floats, wide: Flags) -> Iterator[str]:
    if wide.any():
        first, count = int(np.argmax(wide)), int(wide.sum())
        yield (
            f"{count} gap{'s' * (count > 1)} in time, the first after row {first + 1}: {steps[first]:.3g} s without a "
            f"row, else mostly {np.median(steps):.3g} s"
        )


def _stuck(history: Loop, still: Flags, names: tuple[str, str]) -> Iterator[str]:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], still.astype(np.int8), [0]))))
    starts, ends = edges[::2], edges[1::2]
    moved = np.zeros(starts.size)
    inside = ends < history.displacement.size - 1
    moved[inside] = np.abs(history.displacement[ends[inside] + 1] - history.displacement[starts[inside]])
    stuck = (ends - starts + 1 >= _STUCK_ROWS) & (moved > _STUCK_MOTION * np.ptp(history.displacement))
    if stuck.any():
        longest = int(np.argmax(np.where(stuck, ends - starts, 0)))
        yield (
            f"{ends[longest] - starts[longest] + 1} rows from row {starts[longest] + 1} on repeat one {names[0]} and "
            f"{names[1]}, while the motion went on"
        )


def _cut_off(name: str, unit: str, factor: float, values: Floats) -> Iterator[str]:
    span = float(np.ptp(values))
    steps = np.abs(np.diff(values))
    finest = float(steps[steps > 1e-9 * span].min(initial=span))
    width = max(1.01 * finest, 2e-3 * span)
    for side, extreme in (("top", float(values.max())), ("bottom", float(values.min()))):
        depth = np.abs(values - extreme)
        same = int(np.count_nonzero(depth <= 1e-9 * span))
        below = int(np.count_nonzero(depth <= width)) - same
        if same >= _FLAT_ROWS and same >= _FLAT_RATIO * below:
            yield f"the {name} is cut off at its {side}: {same} rows hold exactly {factor * extreme:.4g} {unit}"


def _wild(name: str, unit: str, factor: float, values: Floats, whole: Flags, rows_per_cycle: float) -> Iterator[str]:
    # a cubic through two neighbours on either side, where no gap and no standstill is between them
    middle = (4.0 * (values[1:-3] + values[3:-1]) - (values[:-4] + values[4:])) / 6.0
    off = np.where(whole, np.abs(values[2:-2] - middle), 0.0)
    noise = 1.4826 * float(np.median(off))
    bend = _BEND * (2.0 * np.pi / rows_per_cycle) ** 2 / 2.0
    limit = max(_WILD * noise, max(_WILD_SHARE, bend) * float(np.ptp(values)) / 2.0)
    # a wild row takes its neighbours along: the worst of five counts
    worst = np.array([off[max(i - 2, 0) : i + 3].max() for i in np.flatnonzero(off > limit)])
    rows = np.flatnonzero(off > limit)[off[off > limit] == worst] + 2
    if rows.size:
        listed = ", ".join(
            f"row {row + 1} ({factor * values[row]:.4g} {unit} between {factor * values[row - 1]:.4g} and "
            f"{factor * values[row + 1]:.4g})"
            for row in rows[:_MOST_LISTED]
        )
        more = f" and {rows.size - _MOST_LISTED} more" if rows.size > _MOST_LISTED else ""
        yield f"the {name} is wild at {listed}{more}"
