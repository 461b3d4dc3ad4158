"""What a file's name says is held against what it holds, and what the user states goes into the campaign."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest
from looking import look, without

from bushfit.inspection.draft import file_text
from bushfit.inspection.opening import inspect
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.rawtable import raw_loop_table
from bushfit.reading.tablefile import to_csv


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


def test_what_the_user_states_goes_into_the_text(loop: Loop, tmp_path: Path) -> None:
    table = raw_loop_table(loop).drop(columns="time [s]").set_axis(["Weg X", "Zelle 2"], axis=1)
    (tmp_path / "loop.csv").write_bytes(to_csv(table))
    kept: dict[str, object] = {"direction": "radial", "units": {"displacement": "mm", "force": "N"}}
    kept |= {"frequency": "0.1 Hz", "waveform": "sine"}
    columns = {"displacement": "Weg X", "force": "Zelle 2"}
    needless = {"columns": {**columns, "stiffness": "k"}, "amplitude": "peak-to-peak"}
    seen = inspect(tmp_path / "loop.csv", {**kept, **needless})
    (written,) = tomllib.loads(file_text(seen, tmp_path))["loops"]
    assert written == {"file": "loop.csv", "columns": columns, **kept}
    assert seen.facts["frequency"].startswith("0.1")
