"""What the name of a file says of its test, and what lines above its table do."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit import units
from bushfit.geometry import Direction
from bushfit.reading.lines import Line
from bushfit.reading.names import Labels, direction_of_file, is_remark, labels_above, labels_in_names


def amplitudes(said: Labels, expected: str = "m") -> list[tuple[str, str | None]]:
    return [(each.text, each.convention) for each in said.of_dimension(expected)]


@pytest.mark.parametrize(
    ("name", "text", "convention"),
    [
        ("Dyn_axial_A0,05mm", "0.05 mm", None), ("axial 0p1mm", "0.1 mm", None), ("+-2mm", "2 mm", "zero-to-peak"),
        ("radial ±0,5 mm 10Hz", "0.5 mm", "zero-to-peak"), ("2mm_pp", "2 mm", "peak-to-peak"),
        ("2mmpp_radial", "2 mm", "peak-to-peak"), ("ax_2mm p-p_10Hz", "2 mm", "peak-to-peak"),
        ("A0.05mm_SS", "0.05 mm", "peak-to-peak"), ("1mm 0-p", "1 mm", "zero-to-peak"), ("100 um", "100 µm", None),
        ("Amplitude_0.2mm_bushing_18mm", "0.2 mm", None), ("CMP15961_2024-05-03_0.1mm", "0.1 mm", None),
        ("03.05.2024 radial 0.1mm", "0.1 mm", None), ("d20mm_L34mm_0.3mm", "0.3 mm", None),
        ("abc18mm_1mm", "1 mm", None), ("preload_1.5mm_0.2mm", "0.2 mm", None),
        ("K_0_1mm", "0.1 mm", None), ("A_0_25mm", "0.25 mm", None), ("K_.1mm", "0.1 mm", None),
        ("loop 1,0 mm 10mm_min", "1 mm", None), ("5-155Hz_0.1mm", "0.1 mm", None),
    ],
)  # fmt: skip
def test_the_amplitude_in_a_name(name, text, convention):
    assert amplitudes(labels_in_names(name)) == [(text, convention)]


@pytest.mark.parametrize(
    ("name", "keys"),
    [
        ("axial_23C", {"direction": Direction.AXIAL, "temperature": "23 degC"}),
        ("x_-10degC_Fz-2kN", {"temperature": "-10 degC", "preload": "-2 kN"}),
        ("rad-23°C", {"direction": Direction.RADIAL, "temperature": "23 degC"}),
        ("Vorlast2kN_T40C_Wdh1", {"preload": "2 kN", "temperature": "40 degC"}),
        ("preload_1.5mm", {"preload": "1.5 mm"}),
        ("tors_SN12_2024-05-03", {"direction": Direction.TORSION, "specimen_number": "12", "date": "2024-05-03"}),
        ("Teil_Nr3 radial", {"direction": Direction.RADIAL, "specimen_number": "3"}),
        ("P07_axial_2kN", {"direction": Direction.AXIAL, "specimen_number": "P07", "force": "2 kN"}),
        *((name, {}) for name in ("bushing_18mm_P50N", "Lager 5Hz", "part 3C", "02c", "02C", "a 21c", "0.02rad")),
        *((name, {"specimen_number": "7"}) for name in ("Nr. 7", "Probe 7")),
        *((name, {}) for name in ("K_1_5mm", "F1_5kN 23_5C 1e-1mm", "nr55", "NR-60", "NR 45 ShA")),
    ],
)
def test_what_else_a_name_says(name, keys):
    said = labels_in_names(name)
    assert {key: value for key, value in vars(said).items() if value and key != "quantities"} == keys


def test_lines_above_a_table_and_the_name_before_the_headers():
    lines = [
        "# Prüftemperatur: 23,5 °C",
        "Datum;2024-05-03",
        ["Operator", "Date"],
        ["Operator", "", "3"],
        "Amplitude (p-p): 0,2 mm",
        "Frequency\t10\tHz",
        ["Vorlast [kN]", 2.0],
        "Temperatures were kept: see the log of the chamber, please",
        "Part no.: RB-204",
        ["Serial number", 17.0],
        "Amplitude: large",
    ]
    said = labels_above(Line(number, content) for number, content in enumerate(lines, start=1))
    assert said.temperature == "23.5 °C"
    assert units.parse_temperature(said.temperature) == pytest.approx(296.65)
    assert (said.date, said.operator, said.preload, said.specimen_number) == ("2024-05-03", "3", "2 kN", "17")
    assert amplitudes(said) == [("0.2 mm", "peak-to-peak")]
    assert [each.text for each in said.of_dimension("Hz")] == ["10 Hz"]
    headers = ["Radialweg [mm]", "Kraft [N]"]
    assert direction_of_file(Path("radial/axial_1.csv"), headers, turns=False) is Direction.AXIAL
    assert direction_of_file(Path("axial/loop_1.csv"), headers, turns=False) is Direction.RADIAL
    assert direction_of_file(Path("axial_1.csv"), headers, turns=True) is Direction.TORSION
    assert direction_of_file(Path("loop_1.csv"), ["Weg [mm]"], turns=False) is None


@given(st.text())
def test_any_name_and_any_line_say_something_that_can_be_read(text):
    for said in (labels_in_names(text), labels_above([Line(1, text)]), labels_above([Line(1, [text, text])])):
        for expected in ("m", "rad", "1", "Hz"):
            for each in said.of_dimension(expected):
                assert units.parse_quantity(each.text, expected) >= 0.0
        if said.temperature:
            assert units.parse_temperature(said.temperature) > 0.0


def test_remarks_that_may_change_the_meaning_of_a_test():
    remarks = [
        "2 Stück parallel geprüft", "Werte gelten für 2 Lager", "Stiffness of two mounts", "Tested back to back",
        "per coppia di supporti", "Bushings per test: 2", "2 bushings in series", "In Reihe: 2 Lager",
        "Amplitude is double", "Zwei Prüflinge gegenüberliegend", "Force divided by 2", "Mean of 3 parts",
        "All values x 0.5", "Steifigkeit je Paar",
    ]  # fmt: skip
    others = ["Specimens: 2", "Test series: 12", "Versuchsreihe 5", "Lager 2", "Two Rivers", "Amplitude: 2 mm", "n = 2"]
    assert [text for text in (*remarks, *others) if is_remark(text)] == remarks
