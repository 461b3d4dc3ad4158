"""What the tests of this folder share: simulated tests of good and bad rigs, written as files and looked at."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.geometry import Direction
from bushfit.inspection.opening import inspect_file
from bushfit.inspection.record import Inspection
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.tablefile import to_csv
from bushfit.simulation.files import raw_loop_table, raw_sweep_table

NOISE = {
    "good": {"noise": 1e-3, "force_noise": 5e-4, "displacement_noise": 1e-4},
    "bad": {"noise": 1e-2, "force_noise": 1e-2, "displacement_noise": 2e-3, "gain_error": 5e-3, "phase_error": 5e-3},
}
#: Clean campaigns: of a commit, and of all.
SEEDS = [4, pytest.param(12, marks=pytest.mark.slow)]


def plan(**settings: float) -> SimulateSettings:
    loops = (
        SimulatedLoop(Direction.AXIAL, 1e-3, 0.1, cycles=3),
        SimulatedLoop(Direction.AXIAL, 3e-4, 0.2, cycles=2, waveform="triangle"),
    )
    sweep = SimulatedSweep(Direction.AXIAL, (1e-4, 2e-4, 5e-4), tuple(float(f) for f in range(5, 156, 10)))
    return SimulateSettings(repeats=3, loops=loops, sweeps=(sweep,), **settings)


def look(folder: Path, test: Loop | Sweep, name: str = "axial.csv", **stated: object) -> Inspection:
    """A test written as a file and looked at."""
    table = raw_sweep_table(test) if isinstance(test, Sweep) else raw_loop_table(test)
    (folder / name).write_bytes(to_csv(table))
    return inspect_file(folder / name, stated)


def without(sweep: Sweep, rows: np.ndarray) -> Sweep:
    kept = ~rows
    names = ("frequency", "amplitude", "stiffness", "repeat")
    return replace(sweep, **{name: getattr(sweep, name)[kept] for name in names})
