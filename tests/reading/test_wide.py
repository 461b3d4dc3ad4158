"""Wide tables and resonance tests: every form of a file reads to the same numbers."""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest
from texts import refused, sweep_from

from bushfit.errors import BushfitError
from bushfit.geometry import Direction
from bushfit.reading.finding import find_table
from bushfit.reading.headers import RESONANCE_COLUMNS
from bushfit.reading.measurement import Sweep
from bushfit.reading.resonance import is_resonance, read_resonance
from bushfit.reading.stated import SweepFile
from bushfit.reading.sweeps import read_sweep
from bushfit.reduction.resonance import transmissibility

FREQUENCIES = ("5", "15", "25", "35")
AMPLITUDES = ("0,05", "0,1", "0,5")
IN_MM = [f"{amplitude} mm" for amplitude in AMPLITUDES]
Cell = Callable[[str, str], str]
G = 9.80665
FREQUENCY = np.linspace(50.0, 400.0, 60)
RATIO = transmissibility(np.full(60, 1e6 * (1 + 0.1j)), 0.5, FREQUENCY)
BASE = 2.0 + 0.01 * FREQUENCY
MASS = BASE * np.abs(RATIO)
ANGLE = np.angle(RATIO)
IN_G = (BASE / G, MASS / G, np.degrees(ANGLE))
REAL, IMAGINARY = MASS / G * np.cos(ANGLE), MASS / G * np.sin(ANGLE)


def number(text: str) -> float:
    return float(text.replace(",", "."))


def stiffness(frequency: str, amplitude: str) -> str:
    """[N/mm] A value that no other point has."""
    return f"{1500.0 + number(frequency) - 300.0 * number(amplitude):.1f}".replace(".", ",")


def loss(frequency: str, amplitude: str) -> str:
    """[-] A value that no other point has."""
    return f"{0.1 + number(frequency) / 1e3 + number(amplitude) / 1e2:.4f}".replace(".", ",")


def block(cell: Cell, heads: Sequence[str] = IN_MM, corner: str = "f [Hz]") -> list[str]:
    """A block of one quantity with frequencies down."""
    rows = [";".join([frequency, *(cell(frequency, a) for a in AMPLITUDES)]) for frequency in FREQUENCIES]
    return [";".join([corner, *heads]), *rows]


def turned(cell: Cell) -> list[str]:
    """A block of one quantity with amplitudes down."""
    rows = [";".join([amplitude, *(cell(f, amplitude) for f in FREQUENCIES)]) for amplitude in AMPLITUDES]
    return [";".join(["Amplitude [mm]", *(f"{frequency} Hz" for frequency in FREQUENCIES)]), *rows]


def both(block_of: Callable[[Cell], list[str]], titles: str = "K* [N/mm];tan delta") -> list[str]:
    """The block of the stiffness, and below it that of the loss factor, each with its title."""
    first, second = titles.split(";")
    return [first, *block_of(stiffness), "", second, *block_of(loss)]


def pairs(*headers: str) -> list[str]:
    """Frequencies down, and stiffness and loss factor beside each other for each amplitude."""
    cells = [[f, *(cell(f, a) for a in AMPLITUDES for cell in (stiffness, loss))] for f in FREQUENCIES]
    return [*headers, *(";".join(row) for row in cells)]


def halves(*headers: str) -> list[str]:
    """Frequencies down, all amplitudes of the stiffness, then all of the loss factor."""
    cells = [[f, *(cell(f, a) for cell in (stiffness, loss) for a in AMPLITUDES)] for f in FREQUENCIES]
    return [*headers, *(";".join(row) for row in cells)]


def beside(left: Sequence[str], right: Sequence[str]) -> list[str]:
    return ["K* [N/mm];;;;;tan delta;;;", *(f"{one};;{other}" for one, other in zip(left, right, strict=True))]


def each(form: str) -> str:
    """A header cell for each amplitude."""
    return ";".join(form.format(amplitude) for amplitude in AMPLITUDES)


SIDE_BY_SIDE = beside(block(stiffness), block(loss))
FORMS = {
    "one below the other": both(block, "Steifigkeit K* [N/mm];tan delta"),
    "amplitudes down": both(turned, "K* [N/mm];Verlustfaktor"),
    "side by side": SIDE_BY_SIDE,
    "side by side, a preamble": ["Rig;3", "Date;12.03.2026", "", *SIDE_BY_SIDE],
    "two things in a corner": beside(*(block(cell, AMPLITUDES, "f [Hz] \\ A [mm]") for cell in (stiffness, loss))),
    "amplitudes in a row of their own": both(lambda cell: ["A [mm];" + each("{0}"), *block(cell, [""] * 3)]),
    "all in one header": halves("f [Hz];" + each("K* {0} mm [N/mm]") + ";" + each("tan delta {0} mm")),
    "underscores": halves("f_Hz;" + each("K*_{0}mm_N/mm") + ";" + each("tan_delta_{0}mm")),
    "at": halves("Frequenz [Hz];" + each("K* bei {0} mm [N/mm]") + ";" + each("tan d (bei {0} mm)")),
    "A = ": halves("f [Hz];" + each("K* [N/mm] A={0} mm") + ";" + each("tan delta A={0} mm")),
    "amplitudes over quantities": pairs("Amplitude [mm];0,05;;0,1;;0,5;", "f [Hz]" + 3 * ";K* [N/mm];tan d"),
    "quantities over amplitudes": halves(";K* [N/mm];;;Verlustfaktor;;", "Frequenz [Hz];" + ";".join(2 * IN_MM)),
    "a units row": pairs("Amplitude [mm];0,05;;0,1;;0,5;", "Frequenz" + 3 * ";K*;tan d", "Hz" + 3 * ";N/mm;-"),
}  # fmt: skip


def check(sweep: Sweep, scale: float = 1.0) -> None:
    """All points are there, each with its own stiffness."""
    found = {
        (f, round(a * 1e3, 9)): k for f, a, k in zip(sweep.frequency, sweep.amplitude, sweep.stiffness, strict=True)
    }
    assert len(found) == len(FREQUENCIES) * len(AMPLITUDES) == sweep.frequency.size
    for frequency in FREQUENCIES:
        for amplitude in AMPLITUDES:
            eta = number(loss(frequency, amplitude))
            expected = 1e3 * number(stiffness(frequency, amplitude)) / np.hypot(1.0, eta) * (1.0 + 1j * eta)
            assert found[number(frequency), round(scale * number(amplitude), 9)] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_every_form_reads_to_the_same_points(form, tmp_path):
    check(sweep_from("\n".join(FORMS[form]) + "\n", tmp_path))
    check(sweep_from("\n".join(FORMS[form]).replace(";", "\t") + "\n", tmp_path))


@pytest.mark.parametrize("form", FORMS)
def test_every_form_reads_from_a_workbook(form, tmp_path):
    book = openpyxl.Workbook()
    book.active.title = "Info"
    book.active.append(["Operator", "A. B."])
    sheet = book.create_sheet("Axial")
    for row in csv.reader(FORMS[form], delimiter=";"):
        sheet.append([number(cell) if cell and cell.replace(",", "").isdecimal() else cell or None for cell in row])
    book.save(tmp_path / "book.xlsx")
    check(read_sweep(tmp_path / "book.xlsx", Direction.AXIAL, SweepFile(file="book.xlsx")))


def test_amplitudes_peak_to_peak_units_stated_and_repeats(tmp_path):
    text = halves("f [Hz];" + each("K* {0} mm p-p [N/mm]") + ";" + each("tan delta {0} mm p-p"))
    check(sweep_from("\n".join(text), tmp_path), scale=0.5)
    text = halves("f [Hz];" + each("K* [N/mm] A={0}") + ";" + each("tan delta A={0}"))
    with pytest.raises(BushfitError, match="the amplitude has no unit"):
        sweep_from("\n".join(text), tmp_path)
    check(sweep_from("\n".join(text), tmp_path, units={"amplitude": "mm"}))
    again = [f"{a} mm" for a in ("0,1", "0,1", "0,5")]
    sweep = sweep_from("\n".join(["K* [N/mm]", *block(stiffness, again), "tan d", *block(loss, again)]), tmp_path)
    assert sorted(sweep.repeat) == [1] * 8 + [2] * 4


BELOW = FORMS["one below the other"]
#: The table, and what the error says besides what tests/cli/spoiled_tables.py has.
SPOILED = [
    ([line.replace("15;", "-15;") for line in BELOW], ['line 4, column "frequency [Hz]"', "not positive"]),
    (
        ["K* [N/mm]", *block(stiffness), "", "tan d", *(line.rpartition(";")[0] for line in block(loss))],
        ["the blocks of this wide table differ", "loss factor of 2 amplitudes"],
    ),
    (
        ["K* [N/mm]", *turned(stiffness), "", "tan d", *(line.rpartition(";")[0] for line in turned(loss))],
        ["the blocks of this wide table differ", "frequencies, 3 rows"],
    ),
    (
        ["K* [N/mm]", *block(stiffness), "", "tan d", *block(loss, ["0,05 mm", "0,1 mm", "0,6 mm"])],
        ["the blocks of this wide table differ"],
    ),
    (block(stiffness), ["is not stated", "K* [N/mm] or tan delta above each block"]),
    (["K* [N/mm]", *block(stiffness)], ["no pair of columns", "frequency [Hz], amplitude [mm], stiffness"]),
]


@pytest.mark.parametrize(("text", "words"), SPOILED, ids=[words[-1] for _, words in SPOILED])
def test_spoiled_wide_tables_have_one_clear_error(text, words, tmp_path):
    with refused("sweep.csv", *words):
        sweep_from("\n".join(text), tmp_path)


def written(folder: Path, header: str, *columns: np.ndarray) -> Path:
    """A file with falling frequencies and these columns; with decimal commas where semicolons part the header."""
    table = pd.DataFrame(dict(enumerate((FREQUENCY, *columns))))[::-1]
    german = ";" in header
    rows = table.to_csv(
        header=False, index=False, float_format="%.9g", sep=";" if german else ",", decimal="," if german else "."
    )
    (folder / "shaker.csv").write_text(f"{header}\n{rows}", encoding="utf-8")
    return folder / "shaker.csv"


FILES = {
    "freq_hz,base_accel_ms2,base_phase_rad,mass_accel_ms2,mass_phase_rad": (BASE, 0.3 + 0 * BASE, MASS, 0.3 + ANGLE),
    "Frequency [Hz],Base acceleration [g],Mass acceleration [g],Phase [deg]": IN_G,
    "Frequency (Hz),Input Acc. (G),Output Acc. (G),Phase Angle (deg)": IN_G,
    "Frequenz [Hz];Fußpunktbeschleunigung [g];Massenbeschleunigung [g];Phasenwinkel [Grad]": IN_G,
    "fréquence [Hz],accélération de la base [m/s2],accélération de la masse [m/s2],déphasage [deg]": (
        BASE,
        MASS,
        np.degrees(ANGLE),
    ),
    "f [Hz],|T| [-],phase [rad],base acceleration [m/s²]": (np.abs(RATIO), ANGLE, BASE),
    "f [Hz],Re T,Im T,base acceleration [mm/s^2]": (RATIO.real, RATIO.imag, 1e3 * BASE),
    "f [Hz],base accel real [g],base accel imag [g],mass accel real [g],mass accel imag [g]": (
        BASE / G, 0 * BASE, REAL, IMAGINARY,
    ),
    "f [Hz],base acceleration pk-pk [g],mass acceleration pk-pk [g],phase [rad]": (2 * BASE / G, 2 * MASS / G, ANGLE),
}  # fmt: skip


@pytest.mark.parametrize("header", FILES)
def test_one_test_in_many_files(tmp_path, header):
    table = find_table(written(tmp_path, header, *FILES[header]), RESONANCE_COLUMNS)
    assert is_resonance(table)
    test = read_resonance(table, Direction.AXIAL)
    assert np.allclose(test.frequency, FREQUENCY)
    assert np.allclose(test.transmissibility, RATIO, rtol=1e-6)
    assert np.allclose(test.base_acceleration, BASE, rtol=1e-6)
