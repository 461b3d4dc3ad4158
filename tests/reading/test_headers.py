"""Headers of columns: the role they name, their unit, and how they count amplitudes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dialects import DIALECTS, expected

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.headers import Heading, Vocabulary, plain, split_convention
from bushfit.reading.sweeps import read_sweep
from bushfit.reading.words import LOOP_COLUMNS, SWEEP_COLUMNS


@pytest.mark.parametrize(
    ("header", "heading"),
    [
        ("Prüfkraft [kN]", Heading("force", "kN")),
        ("PRUEFKRAFT in N", Heading("force", "N")),
        ("F / kN", Heading("force", "kN")),
        ("Axial displacement_mm", Heading("displacement", "mm")),
        ("力\uff08N\uff09", Heading("force", "N")),
        ("f [Hz]", None),
        ("force of habit", None),
        ("x" * 201, None),
    ],
)
def test_a_header_of_a_loop(header: str, heading: Heading | None) -> None:
    assert Vocabulary(LOOP_COLUMNS, {}).heading(header) == heading


def test_the_unit_tells_the_two_meanings_of_f() -> None:
    assert Vocabulary(SWEEP_COLUMNS, {}).heading("f [Hz]") == Heading("frequency", "Hz")
    assert Vocabulary(SWEEP_COLUMNS, {}).heading("F [N]") is None


def test_a_name_from_the_campaign_goes_instead_of_the_usual_ones() -> None:
    vocabulary = Vocabulary(LOOP_COLUMNS, {"force": "Kanal 3"})
    assert vocabulary.heading("kanal_3 [N]") == Heading("force", "N")
    assert vocabulary.heading("force [N]") is None
    assert vocabulary.roles(["time [s]", "Kanal 3", "remark"]) == {"time", "force"}


def test_spellings_that_count_for_nothing() -> None:
    assert len({plain(name) for name in ("Prüf-Weg", "PRUEFWEG", "pruf weg", "prüf_weg")}) == 1
    assert plain("K'") != plain("K''") == plain("K\u2033")


@pytest.mark.parametrize(
    ("text", "split"),
    [
        ("amplitude [mm p-p]", ("amplitude [mm  ]", "peak-to-peak")),
        ("Amplitude 0-p", ("Amplitude", "zero-to-peak")),
        ("stress", ("stress", None)),
    ],
)
def test_what_a_header_says_of_counting_is_taken_out_of_it(text: str, split: tuple[str, str | None]) -> None:
    assert split_convention(text) == split


AMPLITUDES = {
    "Amplitude pk-pk [mm]": 0.5,
    "amplitude (p-p) (mm)": 0.5,
    "Amplitude peak-to-peak [mm]": 0.5,
    "amplitude_pp_mm": 0.5,
    "Displacement p-p [mm]": 0.5,
    "double amplitude [mm]": 0.5,
    "Doppelamplitude [mm]": 0.5,
    "Schwingbreite in mm": 0.5,
    "Amplitude Spitze-Spitze [mm]": 0.5,
    "Amplitude crête à crête [mm]": 0.5,
    "Amplitude crete-a-crete [mm]": 0.5,
    "Amplitud pico a pico [mm]": 0.5,
    "Amplitude [mm p-p]": 0.5,
    "Amplitude SS [mm]": 0.5,
    "Amplitude s-s (mm)": 0.5,
    "Amplitude Spitze zu Spitze / mm": 0.5,
    "Amplitude [mm SS]": 0.5,
    "Amplitude [mmpp]": 0.5,
    "Weg [mmp-p]": 0.5,
    "Weg SS in mm": 0.5,
    "Schwingweite [mm]": 0.5,
    "2A [mm]": 0.5,
    "total amplitude [mm]": 0.5,
    "displacement range [mm]": 0.5,
    "amplitude totale [mm]": 0.5,
    "Amplitude c-à-c [mm]": 0.5,
    "Amplitud pico-pico (mm)": 0.5,
    "Amplitude [mm]": 1.0,
    "Amplitude 0-p [mm]": 1.0,
    "Amplitude zero-to-peak (mm)": 1.0,
}


@pytest.mark.parametrize("header", AMPLITUDES)
def test_a_header_says_how_amplitudes_count(header: str, tmp_path: Path) -> None:
    file = tmp_path / "sweep.csv"
    file.write_text(DIALECTS["plain sweep"].text().replace("amplitude [mm]", header), encoding="utf-8")
    found = read_sweep(file, Direction.AXIAL).amplitude
    assert np.array_equal(found, expected("sweep")[1] * 1e-3 * AMPLITUDES[header])
    contrary = "zero-to-peak" if AMPLITUDES[header] == 0.5 else "peak-to-peak"
    if header != "Amplitude [mm]":
        with pytest.raises(MeasurementError, match="header and campaign count amplitudes differently"):
            read_sweep(file, Direction.AXIAL, amplitude=contrary)  # type: ignore[arg-type]


NAMED = {
    "Amplitude SS [mm]": ("Amplitude SS", 0.5),
    "Level SS [mm]": ("Level SS", 0.5),
    "Pegel p-p [mm]": ("Pegel p-p [mm]", 0.5),
    "Pegel [mm pp]": ("Pegel", 0.5),
    "Schwingbreite [mm]": ("Schwingbreite", 0.5),
    "Doppelamplitude [mm] ": ("Doppelamplitude [mm]", 0.5),
    "Pegel 0-p [mm]": ("Pegel 0-p", 1.0),
    "range [mm]": ("range", 1.0),
    "Stress level [mm]": ("Stress level", 1.0),
}


@pytest.mark.parametrize("header", NAMED)
def test_a_header_that_is_named_says_it_too(header: str, tmp_path: Path) -> None:
    named, counted = NAMED[header]
    file = tmp_path / "sweep.csv"
    file.write_text(DIALECTS["plain sweep"].text().replace("amplitude [mm]", header), encoding="utf-8")
    found = read_sweep(file, Direction.AXIAL, columns={"amplitude": named}).amplitude
    assert np.array_equal(found, expected("sweep")[1] * 1e-3 * counted)
