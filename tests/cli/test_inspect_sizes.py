"""Points far off the curve of a sweep without repeats, and sizes that no test of rubber has."""

import json
from pathlib import Path

import numpy as np
import pytest
from shell import Run

FREQUENCY = np.linspace(5.0, 155.0, 10)
HEADER = "frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]"


def odd(typed: Run, folder: Path, header: str, stiffness: np.ndarray, frequency: np.ndarray = FREQUENCY) -> list[str]:
    columns = (frequency, np.full(frequency.size, 0.1), stiffness, np.full(frequency.size, 0.1))
    np.savetxt(folder / "axial.csv", np.column_stack(columns), "%.6g", ",", header=header, comments="")
    (seen,) = json.loads(typed("inspect", "axial.csv", "--json", "--no-plots").stdout)["files"]
    sentences: list[str] = seen["odd"]
    return sentences


@pytest.mark.parametrize("row", [0, 1, 5, 9])
@pytest.mark.parametrize("factor", [10.0, 0.1, 1.3])
def test_an_outlier_without_repeats_is_found(typed, tmp_path, row, factor):
    scatter = 1.0 + 2e-3 * np.random.default_rng(row).standard_normal(10)
    stiffness = 594.0 * (FREQUENCY / 5.0) ** 0.06 * scatter
    assert odd(typed, tmp_path, HEADER, stiffness) == []
    stiffness[row] *= factor
    (sentence,) = odd(typed, tmp_path, HEADER, stiffness)
    assert sentence.startswith(f"data row {row + 1} (")
    assert "off the smooth curve through the others" in sentence


def test_a_bent_curve_is_no_outlier(typed, tmp_path):
    frequency = np.geomspace(0.1, 1000.0, 25)
    stiffness = 600.0 + 900.0 / (1.0 + (100.0 / frequency) ** 1.5)
    assert not [line for line in odd(typed, tmp_path, HEADER, stiffness, frequency) if "smooth curve" in line]


@pytest.mark.parametrize(
    ("header", "words"),
    [
        (HEADER.replace("[mm]", "[Mm]"), "amplitude of 1e8 mm"),
        (HEADER.replace("[Hz]", "[MHz]"), "frequency of 5000000 to 1.55e8 Hz"),
        ("frequency [Hz],strain [-],G' [mPa],tan delta [-]", "modulus of"),
        ("frequency [Hz],strain [km/m],G' [MPa],tan delta [-]", "strain of 10000 to 10000 %"),
    ],
)
def test_a_size_that_no_test_has_is_odd(typed, tmp_path, header, words):
    (sentence,) = odd(typed, tmp_path, header, 500.0 + 0.5 * FREQUENCY)
    assert sentence.startswith(words)
    assert "is the unit in the header right?" in sentence
