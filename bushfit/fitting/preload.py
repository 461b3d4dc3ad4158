"""The preload of a loop: the mean displacement and the mean force that it was recorded about."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from bushfit.fitting.fourier import basis, least_squares
from bushfit.units import for_people, number

if TYPE_CHECKING:
    from bushfit.fitting.drive import Drive

#: Share of half the force's range by which the mean force of a motion about zero may exceed its second harmonic before
#: it is taken for a preload; chosen: wrong zeros of load cells are less, and an uneven stiffness makes both alike.
_PRELOADED = 0.25
#: Share of the amplitude, or of half the force's range, from which on a mean is told as a preload; chosen: sensors are
#: off zero by less.
_TOLD_MEAN = 0.05


def is_preload(drive: Drive, mean: float) -> bool:
    """Whether the mean of the force [N or N m] is that of a preload about which the displacement counts from zero.

    A stiffness that is not the same to either side makes a mean force too, and a second harmonic of its size.
    """
    if abs(mean) <= _PRELOADED * drive.half_range:
        return False
    second = least_squares(basis(drive.phase, 2), drive.force, drive.weight)[[2, 4]]
    return bool(abs(mean) - np.hypot(*second) > _PRELOADED * drive.half_range)


def preload(drive: Drive, mean_force: float) -> Iterator[str]:
    """A sentence on the means that a loop was recorded about [m or rad, N or N m], where they are no sensor's zero."""
    (motion, force), units = drive.loop.direction.motion.words, drive.loop.direction.display
    mean_motion = float(drive.coefficients[0].real)
    means = [
        f"a mean {word} of {number(factor * mean, 3)} {unit}"
        for word, mean, (unit, factor), half in (
            (motion, mean_motion, units.displacement, drive.amplitude),
            (force, mean_force, for_people(*units.force, mean_force), drive.half_range),
        )
        if abs(mean) > _TOLD_MEAN * half
    ]
    if means:
        yield f"recorded about {' and '.join(means)}; the model knows no preload: the fit takes the loop about its mean"
