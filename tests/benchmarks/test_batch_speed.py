"""Many at once, against one core and against a shell loop, and the memory it takes:

    pytest tests/benchmarks/test_batch_speed.py --benchmark-enable --dist no -m slow -s

In the ordinary test run a few campaigns are taken, so that it cannot rot. BUSHFIT_MANY sets how many campaigns the
test of memory goes up to (20000 takes minutes). No time is asserted; the ratios are printed.
"""

import os
import subprocess
import sys
import time
from dataclasses import replace
from itertools import product
from pathlib import Path

import pytest

from bushfit.batch.executor import local_workers
from bushfit.batch.manifest import RowSettings, read_manifest
from bushfit.batch.row import RowTask
from bushfit.batch.run import run_batch
from bushfit.batch.summary import BatchPlan
from bushfit.campaign.simulated import SimulateSettings
from bushfit.report.results import Formats
from bushfit.simulation.files import to_files
from bushfit.simulation.measured import simulate

pytestmark = pytest.mark.slow

_PROGRAM = str(Path(sys.executable).with_name("bushfit"))
_KINDS = 8


@pytest.fixture(scope="module")
def bushings(paper_model, tmp_path_factory) -> Path:
    """Eight unlike bushings, two sweeps in three repeats and a loop each."""
    folder = tmp_path_factory.mktemp("bushings")
    plan = SimulateSettings(repeats=3, noise=0.005, force_noise=0.003, displacement_noise=0.0002, gain_error=0.003)
    for number in range(_KINDS):
        scale = 0.8 + 0.05 * number
        model = paper_model.with_values({name: scale * value for name, value in paper_model.values.items()})
        place = folder / f"kind_{number}"
        place.mkdir()
        for name, content in to_files(simulate(model, replace(plan, seed=number))).items():
            (place / name).write_bytes(content)
        light = (place / "campaign.toml").read_text(encoding="utf-8").partition("[[loops]]")[0]
        light += '[[sweeps]]\nfile = "sweep_axial.csv"\ndirection = "axial"\n'
        (place / "light.toml").write_text(light, encoding="utf-8")
    return folder


def manifest(bushings: Path, count: int, name: str = "campaign") -> Path:
    """So many rows."""
    file = bushings / f"{name}_{count}.csv"
    file.write_text("campaign\n" + "".join(f"kind_{n % _KINDS}/{name}.toml\n" for n in range(count)))
    return file


def plan_of(bushings: Path, count: int, folder: Path) -> BatchPlan:
    rows, none = read_manifest(str(manifest(bushings, count)), RowSettings()).rows, Formats(False, False, False)
    return BatchPlan("benchmark", rows, RowTask(folder, (), none, resume=False), None, None, none)


def seconds(bushings: Path, count: int, jobs: int, folder: Path) -> float:
    plan = plan_of(bushings, count, folder)
    begin = time.perf_counter()
    result = run_batch(plan, local_workers(jobs), lambda _: None)
    assert result.document.done == count
    return time.perf_counter() - begin


def test_campaigns_a_second(benchmark, bushings, tmp_path):
    """Wall time of batches on one core and on two, and of a shell loop over `bushfit fit`, with plots and without."""
    count = 300 if benchmark.enabled else 8
    seconds(bushings, 8, 2, tmp_path / "warm")
    two = benchmark.pedantic(seconds, (bushings, count, 2, tmp_path / "two"), rounds=1)
    one = seconds(bushings, count, 1, tmp_path / "one")
    singles: dict[tuple[str, ...], list[float]] = {(): [], ("--no-plots",): []}
    for number, (options, taken) in product(range(3 if benchmark.enabled else 1), singles.items()):
        folder = str(tmp_path / f"{number}{len(options)}")
        command = [_PROGRAM, "fit", str(bushings / f"kind_{number}/campaign.toml"), "-q", "-o", folder, *options]
        begin = time.perf_counter()
        subprocess.run(command, check=True)
        taken.append(time.perf_counter() - begin)
    typed, bare = (sorted(taken)[len(taken) // 2] for taken in singles.values())
    print(
        f"\n{count} campaigns: {count / two:.0f} a second on 2 cores, {one / two:.2f} times one core's rate, "
        f"{typed * count / two:.0f} times a shell loop over `bushfit fit` ({typed:.2f} s each), "
        f"{bare * count / two:.0f} times one over `bushfit fit --no-plots` ({bare:.2f} s each)"
    )
    benchmark.extra_info.update(rate=count / two, over_one_core=one / two, over_shell_loop=typed * count / two)


def peaks(command: list[str]) -> tuple[int, int]:
    """Largest resident memory of a process and of its largest descendant [MB], sampled while it runs."""
    running, parent, child = subprocess.Popen(command), 0, 0
    while running.poll() is None:
        listed = subprocess.run(["ps", "-eo", "pid=,ppid=,rss="], capture_output=True, text=True, check=True).stdout
        table = {int(pid): (int(ppid), int(rss)) for pid, ppid, rss in map(str.split, listed.splitlines())}
        mine = {running.pid}
        for pid in sorted(table):
            if table[pid][0] in mine:
                mine.add(pid)
        parent = max(parent, table.get(running.pid, (0, 0))[1])
        child = max(child, *(table[pid][1] for pid in mine - {running.pid} if pid in table), 0)
        time.sleep(0.1)
    assert running.returncode == 0
    return parent // 1024, child // 1024


def batch_of(bushings: Path, count: int, output: Path) -> tuple[int, int]:
    """Peaks of a batch of so many; of one sweep each, because they are to be many."""
    file = str(manifest(bushings, count, "light"))
    return peaks([_PROGRAM, "batch", file, "-o", str(output / str(count)), "--no-plots", "-q"])


@pytest.mark.skipif(sys.platform == "win32", reason="ps")
def test_memory_does_not_grow_with_the_batch(benchmark, bushings, tmp_path):
    few, many = (100, int(os.environ.get("BUSHFIT_MANY", "2000"))) if benchmark.enabled else (4, 8)
    one, other = batch_of(bushings, few, tmp_path), benchmark.pedantic(batch_of, (bushings, many, tmp_path), rounds=1)
    print(f"\nfrom {few} to {many} campaigns: parent {one[0]} to {other[0]} MB, worker {one[1]} to {other[1]} MB")
    benchmark.extra_info.update(parent_MB=[one[0], other[0]], worker_MB=[one[1], other[1]])
    assert other[0] < 1.5 * one[0]
    assert other[1] < 1.5 * one[1]
