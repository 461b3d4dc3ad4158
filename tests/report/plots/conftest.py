"""Tests to draw: sweeps and loops of a model, with noise of a fixed seed."""

from collections.abc import Callable

import numpy as np
import pytest
from figures import AMPLITUDES, FREQUENCIES

from bushfit.effects.contract import Array
from bushfit.fitting.preparation import MeasuredLoop, MeasuredSweep, prepare_loops, prepare_sweeps
from bushfit.geometry import Direction
from bushfit.model.model import Model
from bushfit.reading.measurement import Loop, Sweep
from bushfit.simulation import rig


@pytest.fixture
def stiff(paper_model) -> Model:
    """The paper's model, 20 % too stiff."""
    values = vars(paper_model)["values"]
    return paper_model.with_values({name: 1.2 * values[name] for name in ("mu", "m", "sigma_fmax")})


@pytest.fixture(scope="session")
def swept() -> Callable[..., MeasuredSweep]:
    """A sweep of a model, 1 % noise; `left_out` rows are missing."""

    def sweep(
        model: Model,
        direction: Direction = Direction.AXIAL,
        frequencies: Array = FREQUENCIES,
        amplitudes: Array = AMPLITUDES,
        repeats: int = 3,
        left_out: slice = slice(0, 0),
    ) -> MeasuredSweep:
        noise = np.random.default_rng(7)
        numbers = np.arange(1, repeats + 1)
        frequency, amplitude, repeat = (
            np.delete(axis.ravel(), left_out) for axis in np.meshgrid(frequencies, amplitudes, numbers, indexing="ij")
        )
        scatter = 0.01 * (noise.normal(size=frequency.size) + 1j * noise.normal(size=frequency.size))
        stiffness = model.stiffness(direction, frequency, amplitude) * (1.0 + scatter)
        return prepare_sweeps([Sweep(f"{direction}.csv", direction, frequency, amplitude, stiffness, repeat)])[0]

    return sweep


@pytest.fixture(scope="session")
def looped() -> Callable[..., MeasuredLoop]:
    """A loop of a model at 0.1 Hz, 0.5 % noise."""

    def loop(
        model: Model, amplitude: float, *, cycles: int = 3, run_in: int = 0, direction: Direction = Direction.AXIAL
    ) -> MeasuredLoop:
        record = rig.simulate_cycles(
            model, direction, 0.1, amplitude, cycles=cycles, run_in=run_in, steps_per_cycle=1024, kind="loop"
        )
        force = record.force + 0.005 * np.ptp(record.force) * np.random.default_rng(7).normal(size=record.force.size)
        return prepare_loops([Loop(f"{1e3 * amplitude:g} mm.csv", direction, record.time, record.displacement, force)])[
            0
        ]

    return loop
