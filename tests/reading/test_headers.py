"""Headers of columns: the role they name, their unit, and how they count amplitudes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from dialects import DIALECTS, expected

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.headers import Heading, Vocabulary, plain, split_convention
from bushfit.reading.sweeps import read_sweep
from bushfit.reading.words import LOOP_COLUMNS, SWEEP_COLUMNS

LOOPS, SWEEPS = Vocabulary(LOOP_COLUMNS, {}), Vocabulary(SWEEP_COLUMNS, {})


@pytest.mark.parametrize(
    ("vocabulary", "header", "heading"),
    [
        (LOOPS, "Prüfkraft [kN]", Heading("force", "kN")),
        (LOOPS, "PRUEFKRAFT in N", Heading("force", "N")),
        (LOOPS, "F / kN", Heading("force", "kN")),
        (LOOPS, "Axial displacement_mm", Heading("displacement", "mm")),
        (LOOPS, "力\uff08N\uff09", Heading("force", "N")),
        (LOOPS, "f [Hz]", None),
        (LOOPS, "force of habit", None),
        (LOOPS, "x" * 201, None),
        (SWEEPS, "f [Hz]", Heading("frequency", "Hz")),
        (SWEEPS, "F [N]", None),
        (Vocabulary(LOOP_COLUMNS, {"force": "Kanal 3"}), "kanal_3 [N]", Heading("force", "N")),
        (Vocabulary(LOOP_COLUMNS, {"force": "Kanal 3"}), "force [N]", None),
    ],
)
def test_what_a_header_says_of_its_column(vocabulary: Vocabulary, header: str, heading: Heading | None) -> None:
    assert vocabulary.heading(header) == heading


def test_spellings_that_count_for_nothing() -> None:
    assert len({plain(name) for name in ("Prüf-Weg", "PRUEFWEG", "pruf weg", "prüf_weg")}) == 1
    assert plain("K'") != plain("K''") == plain("K\u2033")


PEAK_TO_PEAK = [
    "Amplitude pk-pk [mm]", "amplitude (p-p) (mm)", "Amplitude peak-to-peak [mm]", "amplitude_pp_mm",
    "Displacement p-p [mm]", "double amplitude [mm]", "Doppelamplitude [mm]", "Schwingbreite in mm",
    "Amplitude Spitze-Spitze [mm]", "Amplitude Sp-Sp (mm)", "Amplitude Sp.-Sp. [mm]",
    "Amplitude crête à crête [mm]", "Amplitude crete-a-crete [mm]",
    "Amplitud pico a pico [mm]", "Amplitude [mm p-p]", "Amplitude SS [mm]", "Amplitude s-s (mm)",
    "Amplitude Spitze zu Spitze / mm", "Amplitude [mm SS]", "Amplitude [mmpp]", "Weg [mmp-p]", "Weg SS in mm",
    "Schwingweite [mm]", "2A [mm]", "total amplitude [mm]", "displacement range [mm]", "amplitude totale [mm]",
    "Amplitude c-à-c [mm]", "Amplitud pico-pico (mm)",
]  # fmt: skip
ZERO_TO_PEAK = ["Amplitude 0-p [mm]", "Amplitude zero-to-peak (mm)"]


def amplitudes(folder: Path, header: str, columns: Mapping[str, str] | None = None, **stated: str) -> np.ndarray:
    """Those that a sweep has under a header, over those of the file: 1, or 0.5 where they count peak-to-peak."""
    file = folder / "sweep.csv"
    file.write_text(DIALECTS["plain sweep"].text().replace("amplitude [mm]", header), encoding="utf-8")
    found = read_sweep(file, Direction.AXIAL, columns=columns, **stated)  # type: ignore[arg-type]
    return found.amplitude / (expected("sweep")[1] * 1e-3)


@pytest.mark.parametrize("header", [*PEAK_TO_PEAK, *ZERO_TO_PEAK])
def test_a_header_says_how_amplitudes_count(header: str, tmp_path: Path) -> None:
    doubled = header in PEAK_TO_PEAK
    assert set(amplitudes(tmp_path, header)) == {0.5 if doubled else 1.0}
    with pytest.raises(MeasurementError, match="header and campaign count amplitudes differently"):
        amplitudes(tmp_path, header, amplitude="zero-to-peak" if doubled else "peak-to-peak")


@pytest.mark.parametrize(
    ("header", "named", "counted"),
    [
        ("Amplitude SS [mm]", "Amplitude SS", 0.5),
        ("Pegel p-p [mm]", "Pegel p-p [mm]", 0.5),
        ("Pegel [mm pp]", "Pegel", 0.5),
        ("Schwingbreite [mm]", "Schwingbreite", 0.5),
        ("Doppelamplitude [mm] ", "Doppelamplitude [mm]", 0.5),
        ("Pegel 0-p [mm]", "Pegel 0-p", 1.0),
        ("range [mm]", "range", 1.0),
        ("Stress level [mm]", "Stress level", 1.0),
    ],
)
def test_a_header_that_is_named_says_it_too(header: str, named: str, counted: float, tmp_path: Path) -> None:
    assert set(amplitudes(tmp_path, header, {"amplitude": named})) == {counted}


def test_what_a_header_says_of_counting_is_taken_out_of_it() -> None:
    assert split_convention("amplitude [mm p-p]") == ("amplitude [mm  ]", "peak-to-peak")
    assert split_convention("stress") == ("stress", None)
