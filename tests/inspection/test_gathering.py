"""Which files of a folder and sheets of a workbook hold tests, and what is said of those that hold none."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pandas as pd
import pytest

from bushfit.errors import BushfitError, NoTestError
from bushfit.geometry import Direction, Specimen
from bushfit.inspection.gathering import gather
from bushfit.inspection.opening import inspect
from bushfit.reading.measurement import Loop, Sweep
from bushfit.simulation.files import raw_loop_table, raw_sweep_table

INFO = pd.DataFrame([["Customer", "ACME"], ["Temperature", "23 degC"], ["Operator", "3"], ["Preload", "2 kN"]])


def book(file: Path, sheets: Mapping[str, pd.DataFrame]) -> Path:
    with pd.ExcelWriter(file) as writer:
        for name, table in sheets.items():
            table.to_excel(writer, sheet_name=name, index=False, header=table is not INFO)
    return file


def test_every_sheet_with_a_test_is_taken_and_the_others_are_told(loop: Loop, sweep: Sweep, tmp_path: Path) -> None:
    tables = {"Info": INFO, "axial": raw_loop_table(loop), "rad 23": raw_sweep_table(sweep), "notes": pd.DataFrame()}
    sources, left_out = gather([book(tmp_path / "7.xlsx", tables)], {})
    assert [source.sheet for source in sources] == ["axial", "rad 23"]
    assert [sentence.partition(": ")[0].rpartition(" ")[2] for sentence in left_out] == ["Info", "notes"]
    assert "the columns do not make a test" in left_out[0]
    seen = [source.inspect() for source in sources]
    assert [(one.kind, one.direction) for one in seen] == [("loop", Direction.AXIAL), ("sweep", Direction.RADIAL)]
    assert seen[0].entry == {"sheet": "axial", "temperature": "23 degC", "preload": "2 kN", "operator": "3"}
    assert seen[0].label == "7.xlsx, sheet axial"


def test_a_book_of_one_sheet_needs_no_name_of_it_and_one_without_a_test_is_refused(
    sweep: Sweep, tmp_path: Path
) -> None:
    ((source,), left_out) = gather([book(tmp_path / "axial.xlsx", {"Tabelle1": raw_sweep_table(sweep)})], {})
    assert (source.sheet, source.inspect().entry, left_out) == (None, {}, ())
    ((source,), left_out) = gather([book(tmp_path / "x.xlsx", {"Info": INFO, "more": INFO.assign(more=1)})], {})
    assert left_out == ()
    with pytest.raises(BushfitError, match="no sheet holds such a table"):
        source.inspect()


def test_a_test_with_a_fault_is_not_left_out(sweep: Sweep, tmp_path: Path) -> None:
    table = raw_sweep_table(sweep)
    faulty = table.rename(columns={"amplitude [mm]": "amplitude"})
    sources, left_out = gather([book(tmp_path / "x.xlsx", {"axial": table, "radial": faulty})], {})
    assert left_out == ()
    with pytest.raises(BushfitError, match=r'sheet "radial".*the amplitude has no unit'):
        sources[1].inspect()


def test_a_folder_is_its_tests(loop: Loop, sweep: Sweep, tmp_path: Path) -> None:
    raw_loop_table(loop).to_csv(tmp_path / "loop_axial.csv", index=False)
    raw_sweep_table(sweep).to_csv(tmp_path / "sweep_axial.txt", sep="\t", index=False)
    (tmp_path / "readme.txt").write_text("Tested on Monday.\n", encoding="utf-8")
    (tmp_path / "photo.png").write_bytes(b"\x89PNG")
    (tmp_path / "broken.xlsx").write_bytes(b"PK\x03\x04 not a workbook")
    (tmp_path / ".hidden.csv").write_text("x", encoding="utf-8")
    (tmp_path / "older").mkdir()
    sources, left_out = gather([tmp_path], {})
    assert [source.file.name for source in sources] == ["loop_axial.csv", "sweep_axial.txt"]
    told = {Path(sentence.partition(": ")[0]).name: sentence.partition(": ")[2] for sentence in left_out}
    assert set(told) == {"readme.txt", "photo.png", "broken.xlsx", "older"}
    assert told["older"] == "a folder"
    assert told["photo.png"] == "no table, by its ending"
    for test in sources:
        test.file.unlink()
    with pytest.raises(NoTestError, match=r"no file of this folder holds a test(.|\n)*photo.png: no table"):
        gather([tmp_path], {})


def held(sweep: Sweep, file: Path, level: float = 1e-4, drop: str = "amplitude [mm]") -> Path:
    table = raw_sweep_table(sweep)[sweep.amplitude == level].drop(columns=drop)
    table.to_csv(file, index=False)
    return file


@pytest.mark.parametrize(
    ("name", "stated", "entry", "amplitude"),
    [
        ("axial_A0,1mm", {}, {"at_amplitude": "0.1 mm"}, 1e-4),
        ("axial_0.2mmpp_23C", {}, {"at_amplitude": "0.1 mm", "temperature": "23 degC"}, 1e-4),
        ("axial_0.2mm", {"amplitude": "peak-to-peak"}, {"at_amplitude": "0.1 mm"}, 1e-4),
        ("axial_0.2mmpp", {"amplitude": "zero-to-peak"}, {"at_amplitude": "0.2 mm"}, 2e-4),
        ("axial_0.2mm", {"at_amplitude": "0.1 mm"}, {"at_amplitude": "0.1 mm"}, 1e-4),
    ],
)
def test_an_amplitude_without_a_column_is_read_from_the_name_unless_stated(
    sweep: Sweep, tmp_path: Path, name: str, stated: dict[str, str], entry: dict[str, str], amplitude: float
) -> None:
    seen = inspect(held(sweep, tmp_path / f"{name}.csv"), stated)
    assert seen.entry == entry
    assert seen.measured.amplitude[0] == pytest.approx(amplitude)
    assert ("from its name" in seen.facts) == ("at_amplitude" not in stated)
    assert (seen.assumed is not None) == (name == "axial_A0,1mm")
    overruled = name == "axial_0.2mm" and "at_amplitude" in stated
    assert bool(seen.odd) == overruled


def test_an_amplitude_that_nothing_says_or_that_two_numbers_may_be_is_asked_for(sweep: Sweep, tmp_path: Path) -> None:
    for name, said in (("axial", "amplitude reached|frequency"), ("axial_18mm_1mm", "18 mm and 1 mm")):
        with pytest.raises(BushfitError, match=said) as raised:
            inspect(held(sweep, tmp_path / f"{name}.csv"), {})
        assert "nothing says at which amplitude this was tested" in str(raised.value)
        assert 'at_amplitude = "' in str(raised.value)


def test_a_frequency_is_read_from_the_name_unless_a_column_has_it(sweep: Sweep, tmp_path: Path) -> None:
    rows = raw_sweep_table(sweep)[sweep.frequency == 5.0]
    rows.drop(columns="frequency [Hz]").to_csv(tmp_path / "radial_5Hz.csv", index=False)
    seen = inspect(tmp_path / "radial_5Hz.csv", {})
    assert (seen.entry, seen.facts["frequencies"]) == ({"at_frequency": "5 Hz"}, "1, at 5 Hz")
    rows.to_csv(tmp_path / "axial_0.1mm.csv", index=False)
    assert inspect(tmp_path / "axial_0.1mm.csv", {"at_amplitude": "0.3 mm"}).entry == {}


@pytest.mark.parametrize(
    ("header", "cells", "name", "strain"),
    [
        ("G' [MPa],G'' [MPa]", "{0},0.2", "shear_0.1%", "engineering"),
        ("E' [MPa],E'' [MPa]", "{0},0.2", "bar_0.1%", "tension"),
        ("Strain [%],Storage Modulus E' [MPa],tan delta [-]", "0.1,{0},0.1", "x", "tension"),
        ("Strain [%],E' [MPa],Phase angle [deg]", "0.1,{0},5.7", "x", "tension"),
        ("E* 0.1 % [MPa],E* 1 % [MPa],tan delta 0.1 %,tan delta 1 %", "{0},0.8,0.1,0.2", "x", "tension"),
        ("|G*| 0.1% [MPa],|G*| 1% [MPa],tan delta 0.1 %,tan delta 1 %", "{0},0.8,0.1,0.2", "x", "engineering"),
    ],
)
def test_moduli_are_those_of_a_specimen(header: str, cells: str, name: str, strain: str, tmp_path: Path) -> None:
    rows = "\n".join(f"{f},{cells.format(1.2 + f / 1e3)}" for f in range(5, 60, 5))
    (tmp_path / f"{name}.csv").write_text(f"frequency [Hz],{header}\n{rows}\n", encoding="utf-8")
    seen = inspect(tmp_path / f"{name}.csv", {"specimen": "DMA"})
    assert seen.direction == Specimen("DMA", "modulus", strain=strain)
    assert seen.entry == {"specimen": "DMA"} | ({"at_amplitude": "0.1 %"} if "%" in name else {})
    assert "its strain is taken as" in seen.assumed
    assert inspect(tmp_path / f"{name}.csv", {}).direction.name == ("bar" if strain == "tension" else "coupon")


def test_sizes_of_a_block_make_a_specimen_of_it(sweep: Sweep, tmp_path: Path) -> None:
    raw_sweep_table(sweep).to_csv(tmp_path / "x.csv", index=False)
    sizes = {"specimen": "mount", "area": "772 mm^2", "thickness": "6 mm", "elements": 2}
    seen = inspect(tmp_path / "x.csv", sizes)
    assert seen.direction == Specimen("mount", "shear", area=7.72e-4, thickness=6e-3, elements=2)
    assert seen.entry == {"specimen": "mount"}


@pytest.mark.parametrize("text", ["0 mm", "-0.1 mm", "0.1", "0.1 N", "wide"])
def test_an_amplitude_that_is_none_is_refused(sweep: Sweep, tmp_path: Path, text: str) -> None:
    with pytest.raises(BushfitError, match=r"axial\.csv, at_amplitude: "):
        inspect(held(sweep, tmp_path / "axial.csv"), {"at_amplitude": text})


def test_a_temperature_is_stated_for_files_with_several(tmp_path: Path) -> None:
    """Of files with one temperature in a column, with several, and without such a column."""
    rows = pd.DataFrame(
        [(f, 0.1, 600 + f, 0.1, t) for t in (10, 25) for f in range(5, 60, 5)],
        columns=["f [Hz]", "amplitude [mm]", "K* [N/mm]", "tan delta", "temperature [degC]"],
    )
    files = {"axial_several": rows, "axial_one": rows[:11], "radial_none": rows[:11].drop(columns="temperature [degC]")}
    for name, table in files.items():
        table.to_csv(tmp_path / f"{name}.csv", index=False)

    def entries() -> dict[str, object]:
        sources, _ = gather([tmp_path], {"temperature": "25 degC"})
        return {source.file.stem: source.inspect().entry for source in sources}

    # it chooses rows of another file, and tells nothing of the one without
    assert entries() == {"axial_several": {"temperature": "25 degC"}, "axial_one": {}, "radial_none": {}}
    with pytest.raises(BushfitError, match=r"several temperatures(.|\n)*temperature = "):
        inspect(tmp_path / "axial_several.csv", {})
    (tmp_path / "axial_several.csv").unlink()
    assert entries() == {"axial_one": {}, "radial_none": {"temperature": "25 degC"}}


def test_a_resonance_test_is_left_out_with_the_way_on(sweep: Sweep, root: Path, tmp_path: Path) -> None:
    measured = root / "data/measured/epdm_70/shaker_1g_573g.csv"
    (tmp_path / measured.name).write_bytes(measured.read_bytes())
    held(sweep, tmp_path / "axial_0.1mm.csv")
    sources, (told,) = gather([tmp_path], {})
    assert [source.file.stem for source in sources] == ["axial_0.1mm"]
    assert "this is a resonance test, not a sweep; bushfit reduce" in told
