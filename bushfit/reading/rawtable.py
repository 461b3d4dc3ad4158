"""Tests as tables like those that a rig writes, which the reader takes back."""

import numpy as np
import pandas as pd

from bushfit.geometry import STRAINING, Display, Place, Unit, stated_strain
from bushfit.reading.measurement import Loop, Sweep, loss_factor
from bushfit.reading.resonance import ResonanceTest


def raw_loop_table(loop: Loop) -> pd.DataFrame:
    """A loop as a rig writes it: time, displacement and force in the units of engineers, or strain and stress."""
    moves, resists, _ = loop.direction.motion.words
    (length, length_factor), (force, force_factor), _ = _as_stated(loop.direction)
    return pd.DataFrame(
        {
            "time [s]": loop.time,
            f"{moves} [{length}]": loop.displacement * length_factor,
            f"{resists} [{force}]": loop.force * force_factor,
        }
    )


def raw_sweep_table(sweep: Sweep) -> pd.DataFrame:
    """A sweep as a rig writes it: frequency, amplitude, repeat, stiffness and loss factor in the units of engineers.

    Where the amplitude is stepped, it is written as reached, without its level.
    """
    motion = sweep.direction.motion
    amplitude, relates = "strain amplitude" if motion is STRAINING else "amplitude", motion.words[2]
    (length, length_factor), _, (stiffness, factor) = _as_stated(sweep.direction)
    level, reached = sweep.amplitude, sweep.reached
    if sweep.stepped == "amplitude" and reached is not None:
        level, reached = reached, None
    return pd.DataFrame(
        {
            "frequency [Hz]": sweep.frequency,
            f"{amplitude} [{length}]": level * length_factor,
            **({} if reached is None else {f"amplitude reached [{length}]": reached * length_factor}),
            "repeat": sweep.repeat,
            f"{relates} [{stiffness}]": np.abs(sweep.stiffness) * factor,
            "loss factor [-]": loss_factor(sweep.stiffness),
        }
    )


def raw_resonance_table(test: ResonanceTest) -> pd.DataFrame:
    """A resonance test as a shaker's controller writes it: accelerations of base and mass, and their phase."""
    return pd.DataFrame(
        {
            "frequency [Hz]": test.frequency,
            "base acceleration [m/s^2]": test.base_acceleration,
            "mass acceleration [m/s^2]": test.base_acceleration * np.abs(test.transmissibility),
            "phase [deg]": np.degrees(np.angle(test.transmissibility)),
        }
    )


def _as_stated(place: Place) -> Display:
    """The units in which files of a place have displacement, force and stiffness; tensor strain is half of gamma."""
    (unit, factor), force, stiffness = place.display
    stated = stated_strain(place)
    return Display(Unit(unit, factor / stated), force, stiffness)
