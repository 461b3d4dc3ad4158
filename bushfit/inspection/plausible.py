"""Implausible frequencies, amplitudes and stiffnesses, which suggest a wrong unit in a header."""

import math
from collections.abc import Iterator

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Place
from bushfit.reading.preload import Preload
from bushfit.units import display_unit, number

#: Smallest and largest frequency of a test [Hz]; chosen: from one cycle a month to ultrasound.
FREQUENCIES = (4e-7, 1e5)
#: Smallest and largest amplitude [m, rad or -], force [N, N m or Pa] and stiffness by kind of motion; chosen: far
#: beyond those of rubber parts and their laboratories.
_AMPLITUDES = {TRANSLATION: (1e-8, 0.2), ROTATION: (1e-7, 4.0), STRAINING: (1e-8, 2.0)}
_FORCES = {TRANSLATION: (0.0, 2e5), ROTATION: (0.0, 1e5), STRAINING: (0.0, 1e9)}
_STIFFNESSES = {TRANSLATION: (1e4, 1e11), ROTATION: (1e-3, 1e9), STRAINING: (1e4, 1e10)}


def implausible_sizes(
    place: Place, frequency: Array, amplitude: Array, stiffness: Array, preload: Preload | None = None
) -> Iterator[Caveat]:
    """Warn of frequencies, amplitudes and stiffness that no test of a rubber part has.

    Args:
        place: direction or specimen.
        frequency: frequencies [Hz], (n,).
        amplitude: zero-to-peak amplitudes [m, rad or strain], (n,).
        stiffness: magnitudes of the stiffness [N/m, N m/rad or Pa], (n,).
        preload: stated preload; None without one.

    Returns:
        One warning for each quantity beyond its limits.
    """
    motion = place.motion
    static = np.array([abs(preload.value)] if preload else [])
    is_force = preload is not None and preload.unit == motion.force_unit
    quantities = (
        ("frequency", "Hz", frequency, FREQUENCIES),
        ("strain" if motion is STRAINING else "amplitude", motion.displacement_unit, amplitude, _AMPLITUDES[motion]),
        (motion.words[2], motion.stiffness_unit, stiffness, _STIFFNESSES[motion]),
        (f"{motion.words[1]} amplitude", motion.force_unit, amplitude * stiffness, _FORCES[motion]),
        ("preload", preload.unit if preload else "N", static, (_FORCES if is_force else _AMPLITUDES)[motion]),
    )
    has_warned = False
    for name, unit, values, (lowest, highest) in quantities:
        positive = values[values > 0.0]
        is_consequence = name.endswith(" amplitude") and has_warned
        if positive.size and (np.min(positive) < lowest or np.max(positive) > highest) and not is_consequence:
            has_warned = True
            ends = [float(np.min(positive)), float(np.max(positive))]
            shown_unit, factor = ("%", 100.0) if unit == "1" else display_unit(unit, 1.0, math.sqrt(ends[0] * ends[1]))
            found, expected = (
                f"{' to '.join(dict.fromkeys(number(factor * end, 3) for end in pair))} {shown_unit}"
                for pair in (ends, (lowest, highest))
            )
            sentence = f"{name} of {found} is outside all tests of rubber ({expected})"
            yield Caveat("implausible_size", f"{sentence}: is the unit in the header right?")
