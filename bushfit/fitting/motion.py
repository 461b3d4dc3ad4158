"""What a loop was recorded about, its preload, and the course of its motion over time, in words."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.fourier import basis, least_squares
from bushfit.reading.measurement import Loop
from bushfit.units import for_people, number

if TYPE_CHECKING:
    from bushfit.fitting.drive import Drive

#: Share of half the force's range by which the mean force of a motion about zero may exceed its second harmonic before
#: it is taken for a preload; chosen: wrong zeros of load cells are less, and an uneven stiffness makes both alike.
_PRELOADED = 0.25
#: Share of the amplitude, or of half the force's range, from which on a mean is told as a preload; chosen: sensors are
#: off zero by less.
TOLD_MEAN = 0.05
#: Third harmonic of a triangle over its first.
_TRIANGLE = 1.0 / 9.0
#: Difference of a motion's third harmonic over its first up to which it is called by a name: a rounded triangle has it.
_LIKE = 0.03
#: Share of the amplitude beyond which rows are counted.
_OUTER = 0.9
#: Share of the rows beyond it that parts a sine from a triangle: evenly in time a triangle has 10 % there, a sine 29 %.
_CROWDED = 0.2


def mean_of_preload(drive: Drive) -> float | None:
    """The mean force of a preload about which the displacement counts from zero [N or N m]; None where there is none.

    A stiffness that is not the same to either side makes a mean force too, and a second harmonic of its size.
    """
    mean, _, cosine, _, sine = least_squares(basis(drive.phase, 2), drive.force, drive.weight)
    return float(mean) if abs(mean) - np.hypot(cosine, sine) > _PRELOADED * drive.half_range else None


def preload(drive: Drive) -> Iterator[str]:
    """A sentence on the means that a loop counts from, where they are no sensor's zero."""
    if drive.datum is None:
        return
    (motion, force, _), units = drive.loop.direction.motion.words, drive.loop.direction.display
    mean_motion = float(drive.coefficients[0].real)
    off_zero = abs(mean_motion) > TOLD_MEAN * drive.amplitude
    means = [
        f"a mean {motion} of {number(units.displacement.factor * mean_motion, 3)} {units.displacement.name}"
    ] * off_zero
    if abs(drive.datum) > (TOLD_MEAN if off_zero else _PRELOADED) * drive.half_range:
        unit, factor = for_people(*units.force, drive.datum)
        means.append(f"a mean {force} of {number(factor * drive.datum, 3)} {unit}")
    if means:
        yield f"recorded about {' and '.join(means)}; the model knows no preload: the fit takes the loop about its mean"


def waveform(coefficients: Array) -> str:
    """The name of a motion, in words, from its complex harmonics, mean first."""
    share = abs(coefficients[3]) / abs(coefficients[1]) if coefficients.size > 3 else 0.0
    if abs(share - _TRIANGLE) < _LIKE:
        return "a triangle"
    return "a sine" if share < _LIKE else f"neither sine nor triangle (third harmonic {100 * share:.2g} %)"


def wrong_clock(loop: Loop, coefficients: Array) -> str | None:
    """A sentence where a loop's time was made from its motion, but not as its rows lie; else None."""
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
