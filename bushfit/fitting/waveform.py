"""The course of a loop's motion over time, and whether it goes with how the rows lie."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array
from bushfit.reading.measurement import Loop

#: Third harmonic of a triangle over its first.
_TRIANGLE = 1.0 / 9.0
#: Difference of a motion's third harmonic over its first up to which it is called by a name: a rounded triangle has it.
_LIKE = 0.03
#: Share of the amplitude beyond which rows are counted.
_OUTER = 0.9
#: Share of the rows beyond it that parts a sine from a triangle: evenly in time a triangle has 10 % there, a sine 29 %.
_CROWDED = 0.2


def waveform(coefficients: Array) -> str:
    """The name of a motion, in words, from its complex harmonics, mean first."""
    share = abs(coefficients[3]) / abs(coefficients[1]) if coefficients.size > 3 else 0.0
    if abs(share - _TRIANGLE) < _LIKE:
        return "a triangle"
    return "a sine" if share < _LIKE else f"neither sine nor triangle (third harmonic {100 * share:.2g} %)"


def wrong_clock(loop: Loop, coefficients: Array) -> str | None:
    """A sentence where the time of a loop was made from its motion, but not as its rows lie; else None.

    The complex harmonics are of its displacement over that time, mean first.
    """
    if loop.timed:
        return None
    motion = loop.displacement
    half = np.ptp(motion) / 2.0
    outer = float(np.mean(np.abs(motion - motion.min() - half) > _OUTER * half))
    like, other = ("a sine", "a triangle") if outer > _CROWDED else ("a triangle", "a sine")
    if waveform(coefficients) != other:
        return None
    return (
        f"{100 * outer:.2g} % of the rows lie beyond {_OUTER:g} of the amplitude, as those of {like} recorded evenly "
        f"in time, but the {loop.direction.motion.words[0]} over time is {other}: where a file has no time, rate means "
        'a triangle, and frequency with waveform = "sine" a sine'
    )
