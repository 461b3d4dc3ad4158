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
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.optimize import leastsq

from bushfit.campaign.campaign import load_campaign
from bushfit.diagnosis.record import DiagnosisSettings
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import BASE, History
from bushfit.fitting.coordinates import Coordinates, jacobian, residual
from bushfit.fitting.preparation import prepare_loops, prepare_sweeps
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem
from bushfit.fitting.procedures import fit_joint
from bushfit.fitting.solve import solve
from bushfit.fitting.starts import start_values
from bushfit.geometry import Direction
from bushfit.model.model import FIVE, Model
from bushfit.reading.measurement import Loop, Sweep

pytestmark = pytest.mark.slow


Rows = list[tuple[str, str, str]]


@pytest.fixture(scope="module")
def table() -> Iterator[Rows]:
    """Rows of what, figure and target; printed once all are there."""
    rows: Rows = []
    yield rows
    widths = [max(len(row[i]) for row in rows) for i in range(3)]
    print()
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip())


@pytest.fixture(scope="module")
def data(root: Path) -> PreparedCampaign:
    return PreparedCampaign.from_campaign(load_campaign(root / "configs/cmp_15961.toml"))


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
def test_stiffness_against_bare_numpy(
    benchmark: BenchmarkFixture, paper_model: Model, table: Rows, points: int
) -> None:
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


def test_joint_fit_against_bare_minpack(benchmark: BenchmarkFixture, data: PreparedCampaign, table: Rows) -> None:
    """The fit with covariance and advice over MINPACK with the same residual, Jacobian, start and tolerance."""
    found = benchmark(fit_joint, data)
    data_sets = data.select_tests(None)
    coordinates = Coordinates.of_parameters(found.model, FIVE)
    start = coordinates.point(start_values(data.campaign.bushing, data_sets, {}))

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
    for name in FIVE:
        assert best[name] == pytest.approx(found.model.values[name], rel=1e-4)
    ours, theirs = seconds([lambda: fit_joint(data), bare], 40 if benchmark.enabled else 1)
    table.append((f"five-parameter fit, {1e3 * ours:.1f} ms, over bare MINPACK", f"{ours / theirs:.2f}", "<= 1.5"))


def command_seconds(*command: str) -> float:
    """Processor time of a whole command, the caches of compiled modules warm as after an installation."""
    warm = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    process = subprocess.Popen(command, env=warm, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return used.ru_utime + used.ru_stime


def test_whole_commands(benchmark: BenchmarkFixture, root: Path, tmp_path: Path, table: Rows) -> None:
    program = str(Path(sys.executable).with_name("bushfit"))
    campaign = str(root / "configs/cmp_15961.toml")
    pairs = {
        ("bushfit fit --no-plots over what it imports", "<= 1.15"): (
            (program, "fit", campaign, "--no-plots", "-q", "--force", "-o", str(tmp_path / "fit")),
            (
                sys.executable,
                "-c",
                "import bushfit.cli.fit, bushfit.commands.fit, pandas, scipy.optimize, scipy.ndimage",
            ),
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
def test_diagnose(
    benchmark: BenchmarkFixture, table: Rows, kind: str, hidden: tuple[str, ...], without: tuple[str, ...]
) -> None:
    simulated = hidden_campaign(5, hidden)
    campaign = simulated.campaign()

    def work() -> object:
        return diagnose(PreparedCampaign.from_campaign(campaign), None, DiagnosisSettings(without=without))

    benchmark.pedantic(work, rounds=1)
    if benchmark.enabled:
        (once,) = seconds([work], 3)
        table.append((f"diagnose where {kind} is hidden, seconds", f"{once:.2f}", "<= 2"))


def sweep(model: Model, frequencies: int, amplitudes: int) -> Sweep:
    """Half a per cent of noise on a grid, each point three times."""
    axes = np.linspace(5.0, 155.0, frequencies), np.geomspace(1e-4, 5e-4, amplitudes), np.arange(1, 4)
    frequency, amplitude, repeat = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
    random = np.random.default_rng(0)
    noise = 1.0 + 0.005 * (random.standard_normal(frequency.size) + 1j * random.standard_normal(frequency.size))
    stiffness = model.stiffness(Direction.AXIAL, frequency, amplitude) * noise
    return Sweep("grid", Direction.AXIAL, frequency, amplitude, stiffness, repeat)


def loop(model: Model, rows: int) -> Loop:
    """One cycle of 1 mm at 0.1 Hz with 0.3 % of noise."""
    phase = np.arange(rows) / rows
    motion = 1e-3 * np.sin(2.0 * np.pi * phase)
    force = model.force(Direction.AXIAL, History.steady(motion, 0.1))
    force = force + 0.003 * force.max() * np.random.default_rng(0).standard_normal(rows)
    return Loop("loop", Direction.AXIAL, 10.0 * phase, motion, force)


def fitted(model: Model, loops: Sequence[Loop], sweeps: Sequence[Sweep]) -> Callable[[], object]:
    """From measurements to a solution."""
    return lambda: solve(FitProblem(model, [*prepare_loops(loops), *prepare_sweeps(sweeps)], FIVE))


@pytest.mark.parametrize("axis", ["rows of a loop", "frequencies", "amplitudes"])
def test_growth(benchmark: BenchmarkFixture, paper_model: Model, table: Rows, axis: str) -> None:
    """Where time is fixed cost + n times something, its slope in a log-log plot rises to 1 and stays there."""
    standard = loop(paper_model, 1000)
    start = paper_model.with_values({name: 1.2 * value for name, value in paper_model.values.items()})
    match axis:
        case "rows of a loop":
            works = {n: fitted(start, [loop(paper_model, n)], []) for n in (4000, 16000, 64000, 256000)}
        case "frequencies":
            works = {n: fitted(start, [standard], [sweep(paper_model, n, 3)]) for n in (100, 400, 1600, 6400)}
        case _:
            works = {n: fitted(start, [standard], [sweep(paper_model, 16, n)]) for n in (20, 80, 320, 1280)}
    benchmark.pedantic(works[min(works)], rounds=1)
    chosen = works if benchmark.enabled else {min(works): works[min(works)]}
    times = seconds(list(chosen.values()), 3 if benchmark.enabled else 1)
    shown = ", ".join(f"{n}: {1e3 * t:.0f} ms" for n, t in zip(chosen, times, strict=True))
    slopes = np.diff(np.log(times)) / np.diff(np.log(list(chosen)))
    figure = f"{slopes.max():.2f}" if slopes.size else "-"
    table.append((f"growth with {axis} ({shown}), steepest exponent", figure, "about 1"))


def test_growth_with_effects(benchmark: BenchmarkFixture, paper_model: Model, table: Rows) -> None:
    """An effect costs among others what it costs alone."""
    grid, added = sweep(paper_model, 1000, 10), ("viscous", "second_friction", "inertia", "delay")

    def asked(*names: str) -> Callable[[], object]:
        model = Model.with_defaults(paper_model.bushing, (*BASE, *names), paper_model.values)
        return lambda: [model.stiffness(Direction.AXIAL, grid.frequency, grid.amplitude) for _ in range(5)]

    works = [asked(), *map(asked, added), asked(*added)]
    benchmark.pedantic(works[0], rounds=1)
    base, *each, every = seconds(works, 9 if benchmark.enabled else 1)
    share = (every - base) / sum(one - base for one in each)
    table.append(("growth with effects: four together over the sum of each alone", f"{share:.2f}", "about 1"))


#: Communication step [s]: usual in multibody codes, 16 in a cycle of the highest frequency of the motion, 60 Hz.
STEP = 1e-3
#: Simulated time [s], and that of the ordinary test run.
LONG, SHORT = 100.0, 0.2


def test_faster_than_real_time(paper_model: Model, tmp_path: Path, benchmark: BenchmarkFixture) -> None:
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
