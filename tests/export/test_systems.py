"""Unit systems: four units that fit together, in any order; all else is refused with what is wrong."""

from __future__ import annotations

import pytest

from bushfit.errors import UnitError
from bushfit.export.contract import UnitSystem
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION

#: In SI.
INCH, POUND = 0.0254, 4.4482216152605


@pytest.mark.parametrize(
    ("text", "stiffness", "torsion", "stress", "frequency"),
    [  # 1 N/m, 1 N m/rad, 1 Pa and 1 Hz in each
        ("m kg s N", 1.0, 1.0, 1.0, 1.0),
        ("mm t s N", 1e-3, 1e3, 1e-6, 1.0),
        ("N, s, t, mm", 1e-3, 1e3, 1e-6, 1.0),
        ("mm kg ms kN", 1e-6, 1.0, 1e-9, 1e-3),
        ("in lbf*s^2/in s lbf", INCH / POUND, 1 / INCH / POUND, INCH**2 / POUND, 1.0),
    ],
)
def test_factors(text: str, stiffness: float, torsion: float, stress: float, frequency: float) -> None:
    system = UnitSystem.parse(text)
    assert system.display(TRANSLATION).stiffness.factor == pytest.approx(stiffness, rel=1e-9)
    assert system.display(ROTATION).stiffness.factor == pytest.approx(torsion, rel=1e-9)
    assert system.display(STRAINING).stiffness.factor == pytest.approx(stress, rel=1e-9)
    assert system.frequency.factor == pytest.approx(frequency)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("mm kg s N", "kg times mm/s^2 is 0.001 N, and not one N"),
        ("mm t s", "a unit is missing"),
        ("mm m s N", '"mm" and "m" measure the same'),
        ("mm t s MPa", '"MPa" is none of the four units'),
        ("mm t s __import__('os')", "is none of the four units"),
    ],
)
def test_what_does_not_fit_together_is_refused(text: str, says: str) -> None:
    with pytest.raises(UnitError) as refused:
        UnitSystem.parse(text)
    assert says in str(refused.value)
