"""How fast, as ratios within one run, one table at the end:

    pytest tests/benchmarks/test_speed.py --benchmark-enable --dist no -m slow -s

In the ordinary test run everything is called once, so that it cannot rot. No time is asserted; the table prints what
was found and what is wanted. Times are processor times, the least of several taken in turns, so that what else the
machine does weighs little.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from ctypes import c_double, c_uint
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmus import Running, request_of, wandering, written
from hidden import hidden_campaign
from scipy.optimize import leastsq

from bushfit.diagnosis.record import DiagnosisSettings
from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.coordinates import Coordinates
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import fit_joint
from bushfit.fitting.starts import start_values
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from tests.fits import jacobian, residual

pytestmark = pytest.mark.slow


Rows = list[tuple[str, str, str]]
#: Communication step [s]: usual in multibody codes, 16 in a cycle of the highest frequency of the motion, 60 Hz.
STEP = 1e-3
#: Simulated time [s], and that of the ordinary test run.
LONG, SHORT = 100.0, 0.2


@pytest.fixture(scope="module")
def table() -> Iterator[Rows]:
    """Rows of what, figure and target; printed once all are there."""
    rows: Rows = []
    yield rows
    widths = [max((len(row[i]) for row in rows), default=0) for i in range(3)]
    print()
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


def seconds(works: Sequence[Callable[[], object]], repeats: int) -> list[float]:
    """Least processor time of a call of each, taken in turns."""
    least = [np.inf] * len(works)
    for _ in range(repeats):
        for number, work in enumerate(works):
            begin = time.process_time()
            work()
            least[number] = min(least[number], time.process_time() - begin)
    return least


def bare_stiffness(model: Model, frequency: np.ndarray, amplitude: np.ndarray) -> np.ndarray:
    """The closed form of the paper's model as one would type it in."""
    p, bushing = model.values, model.bushing
    factor, per = bushing.stiffness_per_modulus(Direction.AXIAL), bushing.unit_strain(Direction.AXIAL)
    e0, omega = per * amplitude, 2.0 * np.pi * frequency
    x = e0 / p["eps_half"]
    y = (np.sqrt(x * x + 6.0 * x + 1.0) - x - 1.0) / 2.0
    scale, c = p["sigma_fmax"] * (1.0 + y), p["eps_half"] * (1.0 + y)
    big = 1.0 + c / e0
    in_phase = 2.0 * scale * (c / e0) * (big / np.sqrt(big * big - 1.0) - 1.0)
    quadrature = 2.0 / np.pi * (2.0 * p["sigma_fmax"] - scale * (c / e0) * np.log((big + 1.0) / (big - 1.0)))
    return factor * (p["mu"] + 0.5 * p["m"] * (1j * omega) ** p["alpha"] + (in_phase + 1j * quadrature) / (2.0 * e0))


@pytest.mark.parametrize("points", [16, 48, 1000, 100_000])
def test_stiffness_against_bare_numpy(benchmark, paper_model, table, points):
    frequency, amplitude = np.linspace(5.0, 155.0, points), np.linspace(1e-5, 1e-3, points)
    found = benchmark(paper_model.stiffness, Direction.AXIAL, frequency, amplitude)
    np.testing.assert_allclose(found, bare_stiffness(paper_model, frequency, amplitude), rtol=1e-8)
    calls, repeats = (max(1, 20_000 // points), 15) if benchmark.enabled else (1, 1)
    fast, bare = seconds(
        [
            lambda: [paper_model.stiffness(Direction.AXIAL, frequency, amplitude) for _ in range(calls)],
            lambda: [bare_stiffness(paper_model, frequency, amplitude) for _ in range(calls)],
        ],
        repeats,
    )
    table.append((f"stiffness of {points} operating points over bare NumPy", f"{fast / bare:.2f}", "<= 1.3"))


def test_joint_fit_against_bare_minpack(benchmark, measured, table):
    """The fit with covariance and advice over MINPACK with the same residual, Jacobian, start and tolerance."""
    found = benchmark(fit_joint, measured)
    data_sets = measured.select_tests(None)
    coordinates = Coordinates.of_parameters(found.model, FIVE)
    start = coordinates.point(start_values(measured.campaign.bushing, data_sets, {}))

    def model_at(point: np.ndarray) -> Model:
        return found.model.with_values(coordinates.values(point))

    def bare() -> np.ndarray:
        best, _ = leastsq(
            lambda point: residual(model_at(point), data_sets),
            start,
            Dfun=lambda point: jacobian(model_at(point), data_sets, FIVE),
            col_deriv=True,
            ftol=1e-9,
            xtol=1e-9,
        )
        return np.asarray(best)

    best = coordinates.values(bare())
    assert dict(best) == pytest.approx(dict(found.model.values), rel=1e-4)
    ours, theirs = seconds([lambda: fit_joint(measured), bare], 40 if benchmark.enabled else 1)
    table.append((f"five-parameter fit, {1e3 * ours:.1f} ms, over bare MINPACK", f"{ours / theirs:.2f}", "<= 1.5"))


def command_seconds(*command: str) -> float:
    """Processor time of a whole command, the caches of compiled modules warm as after an installation."""
    warm = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.Popen(command, env=warm, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return used.ru_utime + used.ru_stime


def test_whole_commands(benchmark, root, tmp_path, table):
    program = str(Path(sys.executable).with_name("bushfit"))
    campaign = str(root / "configs/cmp_15961.toml")
    imported = "import bushfit.cli.fit, bushfit.commands.fit, pandas, scipy.optimize, scipy.ndimage"
    pairs = {
        ("bushfit fit --no-plots over what it imports", "<= 1.15"): (
            (program, "fit", campaign, "--no-plots", "-q", "--force", "-o", str(tmp_path / "fit")),
            (sys.executable, "-c", imported),
        ),
        ("bushfit --help over import click", "<= 3"): ((program, "--help"), (sys.executable, "-c", "import click")),
    }
    for (what, target), (command, imports) in pairs.items():
        turns = [(command_seconds(*command), command_seconds(*imports)) for _ in range(9 if benchmark.enabled else 1)]
        ours, theirs = np.min(turns, axis=0)
        table.append((f"{what}, {1e3 * ours:.0f} ms", f"{ours / theirs:.2f}", target))
    benchmark.pedantic(command_seconds, pairs["bushfit --help over import click", "<= 3"][0], rounds=1)


@pytest.mark.parametrize(
    ("kind", "hidden", "without"),
    [
        ("nothing", (), ()),
        ("one effect", ("second_friction",), ()),
        ("two effects", ("inertia", "viscous"), ()),
        ("an effect that the library lacks", ("maxwell",), ("maxwell",)),
    ],
)
def test_diagnose(benchmark, table, kind, hidden, without):
    simulated = hidden_campaign(5, hidden)
    campaign = simulated.campaign()

    def work() -> object:
        return diagnose(PreparedCampaign.from_campaign(campaign), None, DiagnosisSettings(without=without))

    benchmark.pedantic(work, rounds=1)
    if benchmark.enabled:
        (once,) = seconds([work], 3)
        table.append((f"diagnose where {kind} is hidden, seconds", f"{once:.2f}", "<= 2"))


def test_faster_than_real_time(paper_model, tmp_path, benchmark):
    duration = SHORT if benchmark.disabled else LONG
    running = Running(written(request_of(paper_model), tmp_path), tmp_path / "open")
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
