"""How much faster than real time an FMU runs, on one core:

    pytest tests/benchmarks/test_fmu_speed.py --benchmark-enable --dist no -m slow -s

In the ordinary test run it is called on little data, so that it cannot rot. No time is asserted.
"""

from __future__ import annotations

import time
from ctypes import c_double, c_uint
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmus import Running, order_of, wandering, written
from pytest_benchmark.fixture import BenchmarkFixture

from bushfit.model.model import Model

pytestmark = pytest.mark.slow

#: Communication step [s]: usual in multibody codes, 16 in a cycle of the highest frequency of the motion, 60 Hz.
STEP = 1e-3
#: Simulated time [s], and that of the ordinary test run.
LONG, SHORT = 100.0, 0.2


def test_faster_than_real_time(paper_model: Model, tmp_path: Path, benchmark: BenchmarkFixture) -> None:
    duration = SHORT if benchmark.disabled else LONG
    running = Running(written(order_of(paper_model), tmp_path), tmp_path / "open")
    shape = wandering(int(duration / STEP) + 1, STEP, seed=1)
    motion = 2e-4 * shape[:, None] * np.array([1.0, 1.0, 50.0])
    made = running.begun(running.instance())
    library, component, count = made.dll, made.component, len(running.inputs)
    inputs = (c_uint * count)(*(running.reference[name] for name in running.inputs))
    outputs = (c_uint * count)(*(running.reference[name] for name in running.outputs))
    step, start, found = c_double(STEP), c_double(0.0), (c_double * count)()
    samples = [(c_double * count)(*row) for row in motion]

    def simulate() -> None:
        for sample in samples:
            library.fmi2SetReal(component, inputs, count, sample)
            library.fmi2DoStep(component, start, step, 1)
            library.fmi2GetReal(component, outputs, count, found)

    began = time.process_time()
    benchmark.pedantic(simulate, rounds=1)
    bare = time.process_time() - began
    made.freeInstance()
    signals = np.rec.fromarrays([np.arange(len(shape)) * STEP, *motion.T], names=["time", *running.inputs])
    began = time.process_time()
    how = {"stop_time": duration, "step_size": STEP, "output_interval": STEP, "output": running.outputs}
    fmpy.simulate_fmu(str(running.file), input=signals, **how)
    whole = time.process_time() - began
    print(f"\nthree directions, {duration:g} s in steps of {1e3 * STEP:g} ms")
    print("simulated time over processor time      (wanted: 100)")
    print(f"called from Python, step by step    {duration / bare:.0f}, {1e6 * bare / len(samples):.2f} us a step")
    print(f"simulated by FMPy                   {duration / whole:.0f}")
    assert np.all(np.isfinite(found[:]))
