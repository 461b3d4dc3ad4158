"""What a file's name says is held against what it holds, and what the user states goes into the campaign."""

from __future__ import annotations

from pathlib import Path

import pytest
from looking import look, without

from bushfit.reading.measurement import Loop, Sweep


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("loop_axial_1mm_0.1Hz.csv", ()),
        ("loop axial 1,0 mm 10mm_min.csv", ()),
        ("axial_18mm_bushing_1mm.csv", ()),
        ("loop_axial_2mm.csv", ("the name says 2 mm, the amplitude is 1 mm zero-to-peak: the name may count p",)),
        ("loop_axial_0p5mm_0.2Hz.csv", ("the name says 0.5 mm, the amplitude", "the name says 0.2 Hz, the frequency")),
    ],
)
def test_labels_are_held_against_the_content(loop: Loop, tmp_path: Path, name: str, said: tuple[str, ...]) -> None:
    odd = look(tmp_path, loop, name).odd
    assert len(odd) == len(said)
    assert all(sentence.startswith(start) for sentence, start in zip(odd, said, strict=True))


def test_label_of_a_sweep(sweep: Sweep, tmp_path: Path) -> None:
    one = without(sweep, sweep.amplitude != 2e-4)
    assert look(tmp_path, one, "sweep_axial_0.2mm.csv").odd == ()
    (said,) = look(tmp_path, one, "sweep_axial_0.4mm.csv").odd
    assert "the amplitude is 0.2 mm zero-to-peak: the name may count peak-to-peak" in said
    assert look(tmp_path, one, "sweep_axial_0.4mm_pp.csv").odd == ()
