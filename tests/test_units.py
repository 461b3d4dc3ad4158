"""Units: known ones convert, others are refused, nothing is guessed."""

import math

import pint
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bushfit import units
from bushfit.errors import UnitError


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (1.09e6, "Pa", "1.09 MPa"), (0.19e6, "Pa*s^alpha", "0.19 MPa*s^alpha"), (1.46e4, "Pa", "14.6 kPa"),
        (-1.46e4, "Pa", "-14.6 kPa"), (5e-5, "m", "0.05 mm"), (1.41e-8, "m/N", "0.0141 mm/kN"),
        (1.2e-4, "s", "0.12 ms"), (3.1e7, "N/m", "31 kN/mm"), (0.0, "Pa", "0 Pa"), (0.24, "1", "0.24 -"),
    ],
)  # fmt: skip
def test_units_that_people_read(value, unit, shown):
    name, factor = units.display_unit(unit, 1.0, value)
    assert f"{value * factor:.6g} {name}" == shown
    plain = name.removesuffix("^alpha")
    assert units.si_factor(plain, unit.removesuffix("^alpha")) * factor == pytest.approx(1.0), "the same quantity"


@pytest.mark.parametrize(
    ("text", "expected", "value"),
    [
        ("18mm", "m", 0.018), ("-1e2 µm", "m", -1e-4), ("2 °", "rad", math.radians(2)), ("0.5 %", "1", 0.005),
        ("60 1/min", "Hz", 1.0), ("10 mm/min", "m/s", 1e-2 / 60), ("3 kNmm", "N*m", 3.0), ("1 kN·mm⁻¹", "N/m", 1e6),
        ("1 N mm^-1", "N/m", 1e3), ("1 Nm/deg", "N*m/rad", math.degrees(1)), ("1 N/mm2", "Pa", 1e6),
        ("1 kp/mm", "N/m", 9806.65), ("1 kgf/cm2", "Pa", 98066.5), ("1 Ncm", "N*m", 1e-2), ("2 Inch", "m", 0.0508),
        ("2 mils", "m", 5.08e-5), ("3 N/M", "N/m", 3.0), ("3 Âµm", "m", 3e-6),
        ("30 RPM", "rad/s", 3.141592653589793),
    ],
)  # fmt: skip
def test_quantity_in_si(text, expected, value):
    """In the spellings of rigs and data sheets, too."""
    assert units.parse_quantity(text, expected) == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize(
    ("value", "expected", "words"),
    [
        (10, "m", ["without a unit", "10 mm"]), ("10", "m", ["without a unit", 'write "10 mm"']),
        (0.5, "1", ["without a unit", "%"]), (True, "m", ["a quantity", "true"]), ("mm", "m", ["not a quantity", "mm"]),
        ("10,5 mm", "m", ["not a quantity", "decimal point"]), ("10 kg", "m", ["does not fit", "kg", "a length"]),
        ("10 deg", "1", ["does not fit", "a ratio"]),
        ("10 N m", "N*m/rad", ["does not fit", "a torsional stiffness"]), ("10 dB", "1", ["unknown unit", "dB"]),
        ("10 mm + 3 mm", "m", ["unknown unit"]), ("10 mm^9^9^9", "m", ["unknown unit"]),
        ("1e999 m", "m", ["too large"]), ("1 mil", "rad", ["two ways", "thou"]),
        ("1 mils", "rad", ["two ways", "mrad"]), ("1 grad", "m", ["two ways", "gon"]),
    ],
)  # fmt: skip
def test_what_is_no_quantity_is_refused(value, expected, words):
    with pytest.raises(UnitError) as caught:
        units.parse_quantity(value, expected)
    assert all(word in str(caught.value) for word in words), str(caught.value)


@given(st.text(max_size=60))
def test_any_text_is_a_unit_or_a_unit_error(text):
    try:
        scale = units.si_factor(text, "N/m")
    except UnitError:
        return
    assert math.isfinite(scale)


FIELD = """m mm cm um µm in inch inches ft thou rad mrad deg ° gon grade arcmin s ms sec min h Hz kHz rpm 1/s
N kN mN MN daN dyn kgf gf tf lbf kip ozf N*m N*mm kN*m lbf*in lbf*ft kgf*m N/m N/mm kN/mm lbf/in
kip/in kgf/mm N*m/rad N*m/deg lbf*in/deg Pa kPa MPa GPa bar mbar psi ksi atm N/mm^2 kgf/cm^2 m/s mm/s mm/min in/s mph
km/h knot rad/s deg/s g kg t lb oz slug % ppm V mV A mA W kW hp J Wh ohm K m/s^2 l"""


def test_units_of_the_field_are_as_large_as_in_the_whole_list_of_pint():
    whole = pint.UnitRegistry(cache_folder=None)
    for text in FIELD.split():
        one = whole.Quantity(1.0, text).to_base_units()
        scale, base = units._resolve(text)
        assert (scale, base) == (pytest.approx(one.magnitude, rel=1e-14), str(one.units)), text


@pytest.mark.parametrize(
    ("value", "digits", "shown"),
    [
        (3.294e4, 4, "32940"), (32943.0, 2, "33000"), (-1e-9, 2, "-1e-9"), (1.0949e8, 3, "1.09e8"), (9.9999, 3, "10"),
        (-0.0, 3, "0"), (math.nan, 3, "nan"),
    ],
)  # fmt: skip
def test_numbers_that_people_read(value, digits, shown):
    assert units.number(value, digits) == shown


@pytest.mark.parametrize(
    ("values", "digits", "least", "shown"),
    [
        ((1.4509, 1.4488, 1.453), 5, 0, ["1.4509", "1.4488", "1.4530"]), ((0.3, -4.54e-6), 4, 0, ["0.3000", "0"]),
        ((14.6, 14.33, 14.9), 4, 0, ["14.60", "14.33", "14.90"]), ((0.0, 12.34), 3, 0, ["0", "12.3"]),
        ((370.0, 0.0213, 6.2e6, 3e9), 2, 2, ["370", "0.021", "6200000", "3e9"]),
    ],
)  # fmt: skip
def test_numbers_that_stand_together_end_alike(values, digits, least, shown):
    assert units.format_aligned(values, digits, least) == shown
