"""Every dialect reads to the same numbers, and its errors name line and column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dialects import DIALECTS, HEADERS, NUMBERS, Dialect, expected

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.headers import LOOP_COLUMNS
from bushfit.reading.layout import FileFormat
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.sweeps import read_sweep
from bushfit.reading.table import Table


def written(dialect: Dialect, folder: Path) -> Path:
    file = folder / f"{dialect.kind}.csv"
    file.write_bytes(dialect.bytes())
    return file


def by_bushfit(file: Path) -> Loop | Sweep:
    return read_loop(file, Direction.AXIAL) if file.stem == "loop" else read_sweep(file, Direction.AXIAL)


@pytest.mark.parametrize("name", DIALECTS)
def test_every_dialect_reads_to_the_same_numbers(name: str, tmp_path: Path) -> None:
    dialect = DIALECTS[name]
    file = written(dialect, tmp_path)
    if dialect.kind == "loop":
        time, displacement, force = expected("loop")
        loop = read_loop(file, Direction.AXIAL)
        assert np.array_equal(loop.time, time)
        assert np.array_equal(loop.displacement, displacement * 1e-3)
        assert np.array_equal(loop.force, force)
    else:
        frequency, amplitude, stiffness, loss_factor = expected("sweep")
        sweep = read_sweep(file, Direction.AXIAL)
        assert np.array_equal(sweep.frequency, frequency)
        assert np.array_equal(sweep.amplitude, amplitude * 1e-3)
        exact = stiffness * 1e3 / np.hypot(1.0, loss_factor) * (1.0 + 1j * loss_factor)
        assert np.array_equal(sweep.stiffness, exact)


@pytest.mark.parametrize("name", DIALECTS)
def test_errors_name_line_and_column_in_every_dialect(name: str, tmp_path: Path) -> None:
    """One cell in the middle is no number; the error has its line as an editor counts, its header, and the cell."""
    dialect = DIALECTS[name]
    row = NUMBERS[dialect.kind][12]
    cells = [dialect.number(row[i]) for i in dialect.columns] + ["ok"] * bool(dialect.extra)
    good = dialect.line(cells)
    cells[list(dialect.columns).index(1)] = "bad"
    bad = dialect.line(cells)
    text = dialect.text()
    assert text.count(good) == 1
    file = tmp_path / f"{dialect.kind}.csv"
    file.write_bytes(dialect.encoded(text.replace(good, bad)))
    line = text.split(dialect.end).index(good) + 1
    header = HEADERS[dialect.language][dialect.kind].split(", ")[1]
    with pytest.raises(MeasurementError) as caught:
        by_bushfit(file)
    message = str(caught.value)
    assert f'line {line}, column "{header}' in message, message
    assert 'found: "bad"' in message, message


UNCLEAR: dict[str, tuple[str, dict[str, str], float | None]] = {
    "a thousand or a bit more than one": ("1.234;1.234;2.345", {}, None),
    "the same, decimal point stated": ("1.234;1.234;2.345", {"decimal": "."}, 2.345),
    "the same, decimal comma stated": ("1.234;1.234;2.345", {"decimal": ","}, 2345.0),
    "the same, nothing parts thousands": ("1.234;1.234;2.345", {"thousands": "none"}, 2.345),
    "commas": ("1,234;1,234;2,345", {}, None),
    "commas, thousands stated": ("1,234;1,234;2,345", {"thousands": ","}, 2345.0),
    "settled by another column": ("1.234;0.5;2.345", {}, 2.345),
    "settled by four digits": ("1.234;1234.567;2.345", {}, 2.345),
    "settled by both marks": ("1.234,5;1.234;2.345", {}, 2345.0),
    "settled by an exponent": ("1.234;1.234e3;2.345", {}, 2.345),
    "settled by a group too many": ("1.234.567;1.234;2.345", {}, 2345.0),
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_can_be_read_in_two_ways_is_refused(case: str, tmp_path: Path) -> None:
    """Ten rows alike but for their first digit: only the row given can tell what its points and commas mean."""
    cells, stated, force = UNCLEAR[case]
    rows = [f"{n}.001;{n}.002;{n}.003" if "." in cells else f"{n},001;{n},002;{n},003" for n in range(2, 12)]
    file = tmp_path / "loop.csv"
    file.write_text("\n".join(["time [s];displacement [mm];force [N]", cells, *rows]))
    table = Table.open(file, LOOP_COLUMNS, stated=FileFormat(**stated))  # type: ignore[arg-type]
    wanted = {"force": table.column("force", "N")}
    if force is None:
        with pytest.raises(MeasurementError, match=r"two ways[\s\S]*decimal = "):
            table.read(wanted, fewest_rows=1)
    else:
        assert table.read(wanted, fewest_rows=1)["force"][0] == force


def test_numbers_in_two_ways_are_refused(tmp_path: Path) -> None:
    text = DIALECTS["German"].text().replace("62,598", "62.598")
    (tmp_path / "loop.csv").write_text(text)
    with pytest.raises(MeasurementError, match=r"line 4[\s\S]*another way[\s\S]*decimal comma"):
        read_loop(tmp_path / "loop.csv", Direction.AXIAL)


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
