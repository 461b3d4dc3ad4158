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
TOLD_MEAN = 0.05


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
