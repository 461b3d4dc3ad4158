"""Classes of files that once were read wrongly, or refused, through `init` and `fit`: as the fit of a plain file.

`inspect --json` gives the values of each of these files in test_exports.py.
"""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from commandline import typing
from export_tables import Export, loop
from exports import EXPORTS
from test_exports import options

GEOMETRY = ("--inner-diameter", "20 mm", "--outer-diameter", "36 mm", "--length", "34 mm", "--direction", "axial")
PLAIN = {"sweep": EXPORTS["damping is a loss factor"], "loop": Export(loop(), "loop")}
#: One of each kind runs with the quick tests.
_QUICK = {"blocks with amplitudes", "clock"}


def with_hum(amplitude: float) -> Export:
    """The plain loop, recorded every 2 ms, with a ripple of 25 Hz [mm]."""
    time = np.arange(15_000) * 2e-3
    phase = 0.2 * np.pi * time
    motion = np.sin(phase) + amplitude * np.sin(250.0 * phase)
    return Export(loop("time [s]|displacement [mm]|force [N]", time, motion, 1000.0 * np.sin(phase + 0.1)), "loop")


#: Exports that once were read wrongly: further columns, statements of headers, damping coefficients, rows and blocks,
#: phases, times, delimiters, columns, contradictions, and symbols, multiples and lines above.
NAMES = """\
displacement and force of the points; mean position and load
omega with the unit of the hint; log10 f; Amplitude RMS [mm]; AmpPkPk(mm); amplitudes stated as rms
damping is a damping ratio; decibels
damping coefficient beside a phase; damping coefficient alone; MTS elastomer
blocks with amplitudes; blocks, means, and an end; missing values; an overflow and means
MTS793, nine acquisitions; end of a loop
phases negative; phases near 174; phases near 366; loss stiffness negative
clock; ISO; date and time; AM and PM; day numbers; day numbers as days; no time below dt = 0.05 s
columns of one width with a units row; carets
columns by unit: t [s]|LVDT 2 [mm]|Load Cell [N]; unit N.mm-1; real and imaginary; F and x; LabVIEW
no header, columns by number; unnamed last column; complex numbers; encoding cp932
amplitudes that agree
the symbol decides: Kd'; multiples: Amp (1/100 mm)|K* (x1000 N/m); a reference behind: /dB re. 1 N/m
counted above: All amplitudes pk-pk
blocks of fixed width, a ratio without a unit; s over its unit; a time in ms beside its rate; a second motion, chosen"""


def fitted(folder: Path, *exports: Export) -> dict[str, float]:
    """Parameters of the campaign that `init` writes of plain files and of an export, as `fit --json` prints them."""
    folder.mkdir()
    stated: dict[str, str] = {}
    for number, export in enumerate(exports):
        file = folder / f"{number}_{export.name}"
        file.write_bytes(export.content if isinstance(export.content, bytes) else export.content.encode())
        stated |= export.stated
    files = sorted(file.name for file in folder.iterdir())
    done = typing(folder)("init", *files, *GEOMETRY, *options(stated), "-o", "campaign.toml", "--no-input")
    done = typing(folder)("fit", "campaign.toml", "--json", "-o", "y", "--no-plots")
    return {name: entry["value"] for name, entry in json.loads(done.stdout)["parameters"].items()}


@pytest.fixture(scope="module")
def plain(tmp_path_factory) -> dict[str, dict[str, float]]:
    """Parameters of a plain sweep, and of a plain sweep with a plain loop."""
    folder = tmp_path_factory.mktemp("plain")
    sweep = EXPORTS["phases negative"]
    return {"sweep": fitted(folder / "sweep", PLAIN["sweep"]), "loop": fitted(folder / "loop", sweep, PLAIN["loop"])}


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=() if name in _QUICK else pytest.mark.slow) for name in re.split("; |\\n", NAMES)],
)
def test_a_fit_of_an_export_equals_that_of_a_plain_file(name, plain, tmp_path):
    export = EXPORTS[name]
    kind = export.kind or "sweep"
    files = [export] if kind == "sweep" else [EXPORTS["phases negative"], export]
    assert fitted(tmp_path / "export", *files) == pytest.approx(plain[kind], rel=1e-3)


def test_a_fit_of_a_loop_with_hum_is_that_of_the_loop(tmp_path):
    """A ripple of 0.5 % is no test of its own."""
    sweep = EXPORTS["phases negative"]
    clean, values = (fitted(tmp_path / f"hum{size}", sweep, with_hum(size)) for size in (0.0, 0.005))
    assert values == pytest.approx(clean, rel=0.02)
