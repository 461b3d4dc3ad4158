"""A wide table in a workbook, and a resonance test in many files: every form of a file reads to the same numbers."""

import csv
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pytest

from bushfit.geometry import Direction
from bushfit.reading.finding import find_table
from bushfit.reading.headers import RESONANCE_COLUMNS
from bushfit.reading.resonance import is_resonance, read_resonance
from bushfit.reading.stated import SweepFile
from bushfit.reading.sweeps import read_sweep
from bushfit.reduction.resonance import transmissibility

WIDE = Path(__file__).parents[1] / "files" / "exports"
G = 9.80665
FREQUENCY = np.linspace(50.0, 400.0, 60)
RATIO = transmissibility(np.full(60, 1e6 * (1 + 0.1j)), 0.5, FREQUENCY)
BASE = 2.0 + 0.01 * FREQUENCY
MASS = BASE * np.abs(RATIO)
ANGLE = np.angle(RATIO)
IN_G = (BASE / G, MASS / G, np.degrees(ANGLE))
REAL, IMAGINARY = MASS / G * np.cos(ANGLE), MASS / G * np.sin(ANGLE)


@pytest.mark.parametrize("form", ["one_below_the_other", "side_by_side", "amplitudes_over_quantities"])
def test_a_wide_table_reads_from_a_workbook(form, tmp_path):
    book = openpyxl.Workbook()
    book.active.append(["Operator", "A. B."])
    sheet = book.create_sheet("Axial")
    for row in csv.reader((WIDE / f"wide_{form}.csv").read_text(encoding="utf-8").splitlines(), delimiter=";"):
        cells = [cell.replace(",", ".") for cell in row]
        sheet.append([float(cell) if cell.replace(".", "").isdecimal() else cell or None for cell in cells])
    book.save(tmp_path / "book.xlsx")
    found = read_sweep(tmp_path / "book.xlsx", Direction.AXIAL, SweepFile(file="book.xlsx"))
    expected = pd.read_csv(WIDE / "expected" / "wide.csv").sort_values(["amplitude", "frequency"])
    order = np.lexsort((found.frequency, found.amplitude))
    np.testing.assert_allclose(found.stiffness.real[order], expected["storage"], rtol=1e-6)
    np.testing.assert_allclose(found.stiffness.imag[order], expected["loss"], rtol=1e-6)


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
