"""The direction of a test from the words of its file, in four languages."""

from __future__ import annotations

from pathlib import Path

import pytest

from bushfit.geometry import Direction
from bushfit.reading.names import direction_of_file, named_direction


@pytest.mark.parametrize(
    ("name", "direction"),
    [
        ("sweep_axial_2", Direction.AXIAL),
        ("Essais radiaux", Direction.RADIAL),
        ("Verdrehung-3", Direction.TORSION),
        ("TORSIÓN", Direction.TORSION),
        ("axial_and_radial", None),
        ("coaxial", None),
        ("loop", None),
    ],
)
def test_one_word_settles_it(name: str, direction: Direction | None) -> None:
    assert named_direction([name]) is direction


def test_the_name_goes_before_the_headers_and_angles_before_both() -> None:
    headers = ["Radialweg [mm]", "Kraft [N]"]
    assert direction_of_file(Path("radial/axial_1.csv"), headers, turns=False) is Direction.AXIAL
    assert direction_of_file(Path("axial/loop_1.csv"), headers, turns=False) is Direction.RADIAL
    assert direction_of_file(Path("axial_1.csv"), headers, turns=True) is Direction.TORSION
    assert direction_of_file(Path("loop_1.csv"), ["Weg [mm]"], turns=False) is None
