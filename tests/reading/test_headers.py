"""Headers, their role, unit and the convention of amplitudes; numbers as tables write them."""

from pathlib import Path

import numpy as np
import pytest

from bushfit.errors import MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.finding import find_table
from bushfit.reading.headers import LOOP_COLUMNS, SWEEP_COLUMNS
from bushfit.reading.layout import FileFormat
from bushfit.reading.si_columns import si_column
from bushfit.reading.stated import SweepFile
from bushfit.reading.sweeps import read_sweep

PEAK_TO_PEAK = [
    "Amplitude pk-pk [mm]", "amplitude (p-p) (mm)", "Amplitude peak-to-peak [mm]", "amplitude_pp_mm",
    "Displacement p-p [mm]", "double amplitude [mm]", "Doppelamplitude [mm]", "Schwingbreite in mm",
    "Amplitude Spitze-Spitze [mm]", "Amplitude Sp-Sp (mm)", "Amplitude Sp.-Sp. [mm]",
    "Amplitude crête à crête [mm]", "Amplitude crete-a-crete [mm]",
    "Amplitud pico a pico [mm]", "Amplitude [mm p-p]", "Amplitude SS [mm]", "Amplitude s-s (mm)",
    "Amplitude Spitze zu Spitze / mm", "Amplitude [mm SS]", "Amplitude [mmpp]", "Weg [mmp-p]", "Weg SS in mm",
    "Schwingweite [mm]", "2A [mm]", "total amplitude [mm]", "displacement range [mm]", "amplitude totale [mm]",
    "Amplitude c-à-c [mm]", "Amplitud pico-pico (mm)", "両振幅 [mm]", "振幅峰峰值 (mm)",
    "Peak-to-valley amplitude [mm]", "AmpPkPk(mm)", "DA [mm]", "Amplitude (2a) [mm]", "Amplitude max-min [mm]",
    "Double amplitude (mm)", "DispPkPk [mm]", "Ampl. DA (mm)", "Xpp [mm]", "Weg Spitze-Tal [mm]",
]  # fmt: skip
ZERO_TO_PEAK = [
    "Amplitude 0-p [mm]", "Weg 0-s [mm]", "Amplitude 0-S [mm]", "Amplitude (0-P) [mm]", "Amplitude (0-pk) [mm]",
    "Amplitude zero-to-peak (mm)", "Amplitude crête [mm]", "Amplitude (valeur de crête) [mm]",
    "Amplitude Spitze [mm]", "Amplitude Scheitelwert / mm", "Scheitelwert der Amplitude [mm]", "peak amplitude [mm]",
    "Displacement peak (mm)", "Amp_pk_mm", "Ampiezza di picco [mm]", "Amplitud de pico [mm]",
    "Amplituda szczytowa [mm]",
    "Амплитуда пиковая [мм]", "片振幅[mm]", "振幅(ピーク)[mm]", "振幅峰值 (mm)",
    "Amplitude [±mm]", "Amplitude (mm pk)", "±Displacement [mm]",
]  # fmt: skip
RMS = ["Amplitude RMS [mm]", "Amplitude eff. [mm]", "Amp [mm rms]", "Xrms [mm]"]
#: Zero-to-peak amplitudes over those of the file, by header.
FACTORS = dict.fromkeys(PEAK_TO_PEAK, 0.5) | dict.fromkeys(ZERO_TO_PEAK, 1.0) | dict.fromkeys(RMS, 2.0**0.5)
PLAIN = Path(__file__).parents[1] / "files" / "exports" / "plain_sweep.txt"


def amplitudes(folder: Path, header: str, **stated: str) -> np.ndarray:
    """Zero-to-peak amplitudes that a sweep has under a header, over those of the file."""
    file = folder / "sweep.csv"
    file.write_text(PLAIN.read_text(encoding="utf-8").replace("Amplitude [mm]", header), encoding="utf-8")
    found = read_sweep(file, Direction.AXIAL, SweepFile(file=file.name, **stated))  # type: ignore[arg-type]
    return found.amplitude / (1e-3 * np.repeat([0.1, 0.5], 5))


@pytest.mark.parametrize("header", FACTORS)
def test_a_header_says_how_amplitudes_count(header, tmp_path):
    np.testing.assert_allclose(amplitudes(tmp_path, header), FACTORS[header], rtol=1e-9)
    with pytest.raises(MeasurementError, match="header and campaign state different conventions for the amplitudes"):
        amplitudes(tmp_path, header, amplitude="zero-to-peak" if header in PEAK_TO_PEAK else "peak-to-peak")


@pytest.mark.parametrize(
    ("header", "index"),
    [
        ("f [Hz],A [mm],K [N/mm],tan d", 2), ("f [Hz],A [mm],Stiffness K [N/mm],tan d", 2),
        ("f,A,K,tan d\nHz,mm,N/mm,-", 2), ("f [Hz],K [N/mm],A [mm],K* [N/mm],tan d", 3),
        ("f [Hz],A [mm],K,tan d", None), ("f [Hz],A [mm],K [degC],tan d", None),
    ],
)  # fmt: skip
def test_the_symbol_of_a_stiffness_is_one_by_its_unit(header, index, tmp_path):
    file = tmp_path / "sweep.csv"
    row = ",".join(["1.5"] * (header.partition("\n")[0].count(",") + 1))
    file.write_text("\n".join([header, *[row] * 3]))
    column = find_table(file, SWEEP_COLUMNS).roles.get("stiffness")
    assert (column and column.index) == index


@pytest.mark.parametrize(
    ("text", "stated", "line", "headers"),
    [
        ("time,force\ntime,displacement,force\n1,2,3\n", {}, 2, ("time", "displacement", "force")),
        ("time,force\nZeit,Kraft\n1,2\n", {"header_line": 1}, 1, ("time", "force")),
        ("time;force,x\n1;2,3\n", {"delimiter": "comma"}, 1, ("time;force", "x")),
        ("x,y\n1,2\n2,3\n3,4\n", {}, 1, ("x", "y")),
    ],
)
def test_the_header_names_most_columns_unless_it_is_stated(text, stated, line, headers, tmp_path):
    (tmp_path / "loop.csv").write_text(text)
    found = find_table(tmp_path / "loop.csv", LOOP_COLUMNS, file_format=FileFormat(**stated)).layout
    assert (found.header_line, found.headers) == (line, headers)


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
    "settled by an exponent of Fortran": ("1.234;1.234D+03;2.345", {}, 2.345),
    "a power of ten": ("1.234;1.234;2.345 x 10^-2", {}, 0.02345),
    "a power of ten in superscript": ("1.234;1.234;2.345·10⁻²", {}, 0.02345),
    "settled by a group too many": ("1.234.567;1.234;2.345", {}, 2345.0),
}


@pytest.mark.parametrize("case", UNCLEAR)
def test_what_can_be_read_in_two_ways_is_refused(case, tmp_path):
    """Ten rows alike but for their first digit: only the row given can tell what its points and commas mean."""
    cells, stated, force = UNCLEAR[case]
    rows = [f"{n}.001;{n}.002;{n}.003" if "." in cells else f"{n},001;{n},002;{n},003" for n in range(2, 12)]
    file = tmp_path / "loop.csv"
    file.write_text("\n".join(["time [s];displacement [mm];force [N]", cells, *rows]))
    table = find_table(file, LOOP_COLUMNS, file_format=FileFormat(**stated))  # type: ignore[arg-type]
    wanted = {"force": si_column(table, "force", Direction.AXIAL)}
    if force is None:
        with pytest.raises(MeasurementError, match=r"two ways[\s\S]*decimal = "):
            table.read(wanted, fewest_rows=1)
    else:
        assert table.read(wanted, fewest_rows=1)[0]["force"][0] == force
