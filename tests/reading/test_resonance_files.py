"""Resonance tests as shakers and laboratories write them: one test, simulated, in many files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from bushfit.geometry import Direction
from bushfit.reading.resonance import ResonanceTest, is_resonance, read_resonance
from bushfit.reading.table import Table
from bushfit.reading.words import RESONANCE_COLUMNS
from bushfit.reduction.resonance import transmissibility

G = 9.80665
FREQUENCY = np.linspace(50.0, 400.0, 60)
RATIO = transmissibility(np.full(60, 1e6 * (1 + 0.1j)), 0.5, FREQUENCY)
BASE = 2.0 + 0.01 * FREQUENCY
MASS = BASE * np.abs(RATIO)
ANGLE = np.angle(RATIO)


def written(folder: Path, header: str, *columns: np.ndarray) -> Path:
    """A file with frequencies and these columns; with decimal commas where semicolons part the header."""
    table = pd.DataFrame(dict(enumerate((FREQUENCY, *columns))))
    german = ";" in header
    rows = table.to_csv(
        header=False, index=False, float_format="%.9g", sep=";" if german else ",", decimal="," if german else "."
    )
    (folder / "shaker.csv").write_text(f"{header}\n{rows}", encoding="utf-8")
    return folder / "shaker.csv"


def read(file: Path, base_acceleration: float | None = None) -> ResonanceTest:
    table = Table.open(file, RESONANCE_COLUMNS)
    assert is_resonance(table)
    return read_resonance(table, Direction.AXIAL, base_acceleration)


IN_G = (BASE / G, MASS / G, np.degrees(ANGLE))
REAL, IMAGINARY = MASS / G * np.cos(ANGLE), MASS / G * np.sin(ANGLE)
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
        BASE / G,
        0 * BASE,
        REAL,
        IMAGINARY,
    ),
    "f [Hz],base acceleration pk-pk [g],mass acceleration pk-pk [g],phase [rad]": (2 * BASE / G, 2 * MASS / G, ANGLE),
}


@pytest.mark.parametrize("header", FILES)
def test_one_test_in_many_files(tmp_path: Path, header: str) -> None:
    test = read(written(tmp_path, header, *FILES[header]))
    assert np.allclose(test.frequency, FREQUENCY)
    assert np.allclose(test.transmissibility, RATIO, rtol=1e-6)
    assert np.allclose(test.base_acceleration, BASE, rtol=1e-6)


def test_rows_are_sorted_by_frequency(tmp_path: Path) -> None:
    file = written(tmp_path, "f [Hz],|T|,phase [rad]", np.abs(RATIO), ANGLE)
    lines = file.read_text().splitlines()
    file.write_text("\n".join([lines[0], *lines[:0:-1]]) + "\n")
    test = read(file, 1.5)
    assert np.allclose(test.frequency, FREQUENCY)
    assert np.allclose(test.transmissibility, RATIO, rtol=1e-6)
    assert set(test.base_acceleration) == {1.5}
