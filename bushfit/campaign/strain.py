"""Strain of the rubber in a test, which shows a wrong unit or a wrong size."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bushfit.caveat import Caveat
from bushfit.geometry import STRAINING, Bushing, Specimen, unit_strain
from bushfit.reading.measurement import AnyTest, Loop, Sweep
from bushfit.units import format_range, number

#: Largest shear strain of a test [-]; chosen: rubber tears at two to six, and a test has thousands of cycles.
_MOST_STRAIN = 1.5


def implausible_strain(test: Loop | Sweep, bushing: Bushing | None) -> Iterator[Caveat]:
    """Warn of a displacement that no rubber of this size endures; `bushing` is None for a specimen."""
    half_range = float(np.ptp(test.displacement)) / 2.0 if isinstance(test, Loop) else float(test.amplitude.max())
    strain = 2.0 * half_range * unit_strain(bushing, test.direction)
    if strain > _MOST_STRAIN and test.direction.motion is not STRAINING:  # a strain is checked where it is read
        size = format_range(test.direction.motion.displacement_unit, half_range)
        sentence = f"an amplitude of {size} is a shear strain of {number(100.0 * strain, 2)} %"
        yield Caveat("implausible_size", f"{sentence}: are its unit and the size of the rubber right?")


def with_strain_checked(test: AnyTest, bushing: Bushing | None) -> AnyTest:
    """Add a warning to the notes of a test whose displacement no rubber of this size endures.

    Args:
        test: loop or sweep in SI.
        bushing: bushing that was tested; None if it is a specimen.
    """
    if test.source is None or not (bushing or isinstance(test.direction, Specimen)):
        return test
    return replace(test, source=test.source.with_notes(implausible_strain(test, bushing)))
