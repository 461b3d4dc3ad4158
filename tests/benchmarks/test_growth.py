"""How time and memory of whole commands grow: `run` with its tests and the rows of a loop, `batch` with its campaigns.

    pytest tests/benchmarks/test_growth.py --benchmark-enable --dist no -m slow -s

In the ordinary test run the smallest sizes are taken. BUSHFIT_MANY sets how many campaigns the memory of `batch` is
measured for. No time is asserted; imports are included.
"""

import os
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.simulated import SimulateSettings
from bushfit.simulation.files import to_files
from bushfit.simulation.measured import simulate

pytestmark = [pytest.mark.slow, pytest.mark.skipif(sys.platform == "win32", reason="os.wait4 and ps")]

_PROGRAM = str(Path(sys.executable).with_name("bushfit"))
_RIG = SimulateSettings(noise=0.005, force_noise=0.003, displacement_noise=0.0002, gain_error=0.003)
#: Campaigns of a batch that differ; further ones repeat them.
_KINDS = 8

#: Seconds and megabytes by size.
Curve = Mapping[int, tuple[float, float]]


@pytest.fixture(scope="module")
def tests(paper_model, tmp_path_factory) -> tuple[Path, str]:
    """A hundred simulated loops and sweeps of one bushing, and the head of a campaign of them."""
    folder, head = tmp_path_factory.mktemp("growth"), ""
    for seed in range(100):
        files = to_files(simulate(paper_model, replace(_RIG, seed=seed)))
        head = files["campaign.toml"].decode().partition("[[loops]]")[0]
        (folder / f"loop_{seed}.csv").write_bytes(files["loop_axial_1.csv"])
        (folder / f"sweep_{seed}.csv").write_bytes(files["sweep_axial.csv"])
    return folder, head


def listed(kind: str, numbers: range) -> str:
    return "".join(f'[[{kind}s]]\nfile = "{kind}_{n}.csv"\ndirection = "axial"\n\n' for n in numbers)


def used(campaign: Path, output: Path) -> tuple[float, float]:
    """Processor time [s] and largest resident memory [MB] of a run."""
    warm = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    command = (_PROGRAM, "run", str(campaign), "-q", "--no-plots", "--force", "-o", str(output))
    process = subprocess.Popen(command, env=warm)
    _, status, found = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == 0
    return found.ru_utime + found.ru_stime, found.ru_maxrss / 1024


def test_growth_of_a_run(benchmark, tests, tmp_path):
    folder, head = tests
    whole, curves = benchmark.enabled, dict[str, Curve]()
    for name, of in (
        ("loops of 3,000 rows", lambda n: listed("loop", range(n)) + listed("sweep", range(1))),
        ("sweeps of 144 points", lambda n: listed("loop", range(1)) + listed("sweep", range(n))),
    ):
        found = {}
        for count in (1, 3, 10, 30, 100) if whole else (1,):
            (folder / "tests.toml").write_text(head + of(count), encoding="utf-8")
            found[count] = used(folder / "tests.toml", tmp_path / "run")
        curves[name] = found
    header, *rows = (folder / "loop_0.csv").read_text(encoding="utf-8").splitlines()
    time, *columns = np.array([row.split(",") for row in rows], dtype=float).T
    found = {}
    for count in (3_000, 30_000, 300_000, 3_000_000) if whole else (3_000,):
        at = np.linspace(0.0, time.size - 1.0, count)
        dense = [np.interp(at, np.arange(time.size), column) for column in (time, *columns)]
        with (folder / "loop_1000.csv").open("w", encoding="utf-8") as file:
            file.write(header + "\n")
            np.savetxt(file, np.column_stack(dense), fmt="%.9g", delimiter=",")
        text = head + listed("loop", range(1000, 1001)) + listed("sweep", range(1))
        (folder / "tests.toml").write_text(text, encoding="utf-8")
        found[count] = used(folder / "tests.toml", tmp_path / "run")
    curves["one loop, by its rows"] = found
    print()
    for name, curve in curves.items():
        print(f"{name}: " + ", ".join(f"{n}: {s:.1f} s {mb:.0f} MB" for n, (s, mb) in curve.items()))
    benchmark.pedantic(used, (folder / "tests.toml", tmp_path / "run"), rounds=1)


def batch(tests: tuple[Path, str], count: int, output: Path, *options: str) -> tuple[float, int, int]:
    """Wall time [s] of a batch of so many campaigns, and peaks of memory of the command and of a worker [MB]."""
    folder, head = tests
    for kind in range(_KINDS):
        text = head + listed("loop", range(kind, kind + 1)) + listed("sweep", range(kind, kind + 1))
        (folder / f"kind_{kind}.toml").write_text(text, encoding="utf-8")
    manifest = folder / f"many_{count}.csv"
    manifest.write_text("campaign\n" + "".join(f"kind_{n % _KINDS}.toml\n" for n in range(count)))
    begin, parent, child = time.perf_counter(), 0, 0
    running = subprocess.Popen(
        [_PROGRAM, "batch", str(manifest), "-o", str(output / f"{count}{options}"), "-q", *options]
    )
    while running.poll() is None:
        listing = subprocess.run(["ps", "-eo", "pid=,ppid=,rss="], capture_output=True, text=True, check=True).stdout
        table = {int(pid): (int(ppid), int(rss)) for pid, ppid, rss in map(str.split, listing.splitlines())}
        mine = {running.pid}
        for pid in sorted(table):
            if table[pid][0] in mine:
                mine.add(pid)
        parent = max(parent, table.get(running.pid, (0, 0))[1])
        child = max(child, *(table[pid][1] for pid in mine - {running.pid} if pid in table), 0)
        time.sleep(0.1)
    assert running.returncode == 0
    return time.perf_counter() - begin, parent // 1024, child // 1024


def test_many_campaigns(benchmark, tests, tmp_path):
    """Rates on one core and on two, over a shell loop with `bushfit fit`; memory does not grow with the batch."""
    few, many = (100, int(os.environ.get("BUSHFIT_MANY", "400"))) if benchmark.enabled else (4, 8)
    first, *_ = batch(tests, few, tmp_path)
    two, *large = benchmark.pedantic(batch, (tests, many, tmp_path), rounds=1)
    one, *small = batch(tests, few, tmp_path, "--jobs", "1")
    begin = time.perf_counter()
    subprocess.run([_PROGRAM, "fit", str(tests[0] / "kind_0.toml"), "-q", "-o", str(tmp_path / "fit")], check=True)
    typed = time.perf_counter() - begin
    print(
        f"\n{many / two:.0f} campaigns a second on 2 cores, {one / first:.2f} times one core's rate, "
        f"{typed * many / two:.0f} times a shell loop ({typed:.2f} s each); from {few} to {many} campaigns: "
        f"command {small[0]} to {large[0]} MB, worker {small[1]} to {large[1]} MB"
    )
    assert large[0] < 1.5 * small[0]
    assert large[1] < 1.5 * small[1]
