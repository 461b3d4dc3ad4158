"""A loop of 10 million rows against the fastest library that loads it, and small files one by one:

    pytest tests/benchmarks/test_reading_speed.py --benchmark-enable --dist no -m slow -s

Every run is a process of its own, which tells its seconds without its imports, and its peak memory. In the ordinary
test run the loop has some thousand rows, so that this cannot rot. The long loop needs the dependency group bench.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bushfit.geometry import Direction
from bushfit.simulation import rig

pytestmark = pytest.mark.slow

_WHOLE = """
import json, resource, sys, time
from pathlib import Path
{imports}
file = Path(sys.argv[1])
begin, busy = time.perf_counter(), time.process_time()
{work}
seconds, cpu = time.perf_counter() - begin, time.process_time() - busy
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1 << 20)
print(json.dumps(dict(seconds=seconds, cpu=cpu, peak=peak, found=found)))
"""
LIBRARIES = {
    "polars": ("import polars", "found = len(polars.read_csv(file))"),
    "pandas": ("import pandas", "found = len(pandas.read_csv(file))"),
    "DuckDB": ("import duckdb", "found = len(duckdb.read_csv(str(file)).fetchnumpy()['time [s]'])"),
}
BUSHFIT = (
    "import lmfit, pandas, scipy.optimize\n"
    "from bushfit import units\n"
    "units.si_factor('mm', 'm')  # imports what knows units\n"
    "from bushfit.campaign.campaign import Campaign\n"
    "from bushfit.fitting.prepared_campaign import PreparedCampaign\n"
    "from bushfit.fitting.procedures import fit_static\n"
    "from bushfit.geometry import Bushing, Direction\n"
    "from bushfit.reading.loops import read_loop\n"
    "from bushfit.reading.stated import LoopFile",
    "loop = read_loop(file, Direction.AXIAL, LoopFile(file='loop.csv'))\n"
    "bushing = Bushing('CMP 15 961', 0.010, 0.018, 0.034)\n"
    "result = fit_static(PreparedCampaign.from_campaign(Campaign('c', file, bushing, (loop,))))\n"
    "found = dict(result.model.values)",
)


def run(program: tuple[str, str], file: Path) -> dict[str, float]:
    """One run in a process of its own."""
    code = _WHOLE.format(imports=program[0], work=program[1])
    arguments = [sys.executable, "-c", code, str(file)]
    output = subprocess.run(arguments, check=True, capture_output=True, env=os.environ).stdout
    return json.loads(output.splitlines()[-1])  # DuckDB draws a progress bar


@pytest.fixture
def long_loop(paper_model, tmp_path, benchmark) -> tuple[Path, int]:
    """100 cycles of the paper's loop, with noise on displacement and force."""
    polars = pytest.importorskip("polars", reason="the group bench is not installed")
    pytest.importorskip("duckdb", reason="the group bench is not installed")
    rows = 50_000 if benchmark.disabled else 10_000_000
    cycle = rig.simulate_cycles(paper_model, Direction.AXIAL, 0.1, 1e-3, cycles=1, run_in=6, kind="loop")
    time, rng = np.arange(rows) * (1000.0 / rows), np.random.default_rng(0)
    motion, force = (np.interp(time % 10.0, cycle.time, column) for column in (cycle.displacement, cycle.force))
    table = {
        "time [s]": np.round(time, 5),
        "displacement [mm]": np.round(1e3 * motion + 2e-4 * rng.standard_normal(rows), 6),
        "force [N]": np.round(force + 1.4 * rng.standard_normal(rows), 3),
    }
    file = tmp_path / "loop.csv"
    polars.DataFrame(table).write_csv(file)
    return file, rows


def test_a_loop_of_ten_million_rows(benchmark, long_loop):
    file, rows = long_loop
    programs = {**LIBRARIES, "bushfit: read, check, fit": BUSHFIT}
    count = 1 if benchmark.disabled else 5  # in turn, so that what else the machine does meets all alike
    rounds = [{name: run(program, file) for name, program in programs.items()} for _ in range(count)]
    benchmark.pedantic(run, (BUSHFIT, file), rounds=1)
    best = {name: min((one[name] for one in rounds), key=lambda figures: figures["seconds"]) for name in programs}
    print(f"\n{rows} rows, {file.stat().st_size / 1e6:.0f} MB")
    for name, figures in best.items():
        seconds, cpu, peak = (figures[key] for key in ("seconds", "cpu", "peak"))
        print(f"  {name:26} {seconds:.2f} s, {cpu:.2f} s of both cores together, peak {peak:.2f} GiB")
    whole = best.pop("bushfit: read, check, fit")
    ratio, of_cores = (whole[key] / min(figures[key] for figures in best.values()) for key in ("seconds", "cpu"))
    print(f"  bushfit over the fastest: {ratio:.2f} times the time, {of_cores:.2f} times the work of both cores")
    benchmark.extra_info["over the fastest reader"] = ratio
    assert {figures["found"] for figures in best.values()} == {rows}
    assert whole["peak"] < 2.0
