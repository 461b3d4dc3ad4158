"""How time and memory of a whole `bushfit run` grow with the tests of a campaign and with the rows of a loop:

    pytest tests/benchmarks/test_growth.py --benchmark-enable --dist no -m slow -s

In the ordinary test run the smallest sizes are taken. Times are processor times and peaks of resident memory of the
command, imports included.
"""

import os
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bushfit.campaign.simulated import SimulateSettings
from bushfit.simulation.files import to_files
from bushfit.simulation.measured import simulate

pytestmark = pytest.mark.slow

_PROGRAM = str(Path(sys.executable).with_name("bushfit"))
_RIG = SimulateSettings(noise=0.005, force_noise=0.003, displacement_noise=0.0002, gain_error=0.003)

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


@pytest.mark.skipif(sys.platform == "win32", reason="os.wait4")
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
