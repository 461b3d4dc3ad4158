"""Loops from files: every way to write a table reads the same, and every kind of damage has its one error."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from texts import LOOP, LOOP_ROWS, TIME, loop_from, refused, with_line

from bushfit.errors import BushfitError, MeasurementError
from bushfit.geometry import Direction, Specimen


@pytest.mark.parametrize(
    "text",
    [
        LOOP,
        LOOP.replace("\n", "\n\n"),
        "\ufeff\r\n# rig 3\r\n\n" + LOOP,
        LOOP.replace("force [N]", "Force_N").replace("displacement [mm]", "DISPLACEMENT_mm"),
        LOOP.replace("time [s],displacement [mm],force [N]", "t [s],displacement,load\n,mm,N"),
        LOOP.replace("\n", ",ok\n").replace("force [N],ok", "force [N],remark"),
    ],
)
def test_loops_in_forms_that_the_dialects_lack(text: str, tmp_path: Path) -> None:
    loop = loop_from(text, tmp_path, noise=0.01)
    np.testing.assert_allclose(loop.time, TIME, rtol=1e-12)
    np.testing.assert_allclose(loop.displacement, 1e-3 * np.sin(3 * TIME), atol=1e-7)
    np.testing.assert_allclose(loop.force, 100 * np.sin(3 * TIME + 0.1), atol=1e-3)
    assert loop.noise == 0.01
    assert loop.source is not None
    assert loop.source.sha256 == hashlib.sha256(text.encode()).hexdigest()


@pytest.mark.parametrize(("first", "last"), [('"rerun', '"ok'), ('5" rig', '"x'), ('"rerun', "")])
def test_a_quote_left_open_in_a_remark_takes_no_rows(first: str, last: str, tmp_path: Path) -> None:
    """A library would read everything up to the next quote as one cell, lines and all."""
    remarks = {5: first, 30: last}
    lines = [f"{line},{remarks.get(number, '')}" for number, line in enumerate(LOOP.splitlines())]
    loop = loop_from("\n".join([LOOP.splitlines()[0] + ",remark", *lines[1:]]), tmp_path)
    assert np.array_equal(loop.force, loop_from(LOOP, tmp_path).force)


def test_names_and_units_from_the_campaign(tmp_path: Path) -> None:
    text = LOOP.replace("force [N]", "Kraft").replace("displacement [mm]", "Weg [mm]")
    columns = {"force": "Kraft", "displacement": "weg"}
    loop = loop_from(text, tmp_path, columns=columns, units={"force": "kN"}, force_sign=1)
    assert loop.force.max() == pytest.approx(99.96e3, rel=1e-3)


def test_force_sign_turns_the_force(tmp_path: Path) -> None:
    rows = (row.split(",") for row in LOOP_ROWS)
    turned = "\n".join([LOOP.splitlines()[0], *(f"{t},{x},{-float(f):.3f}" for t, x, f in rows)])
    assert np.array_equal(loop_from(turned, tmp_path, force_sign=-1).force, loop_from(LOOP, tmp_path).force)


def test_torsion_counts_in_rad(tmp_path: Path) -> None:
    text = LOOP.replace("displacement [mm]", "angle [deg]").replace("force [N]", "torque [Nm]")
    loop = loop_from(text, tmp_path, direction=Direction.TORSION)
    assert loop.displacement.max() == pytest.approx(np.radians(1.0), rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("lead", ["# rig 3\n\n", "", 'Operator "A"\n', "\ufeff", "Prüfstand 3\n"])
def test_a_large_file_reads_like_a_small_one(lead: str, tmp_path: Path) -> None:
    """5 MB; an error late in the file still has its line."""
    count = 300_000
    numbers = np.column_stack((np.arange(count), np.arange(count) % 7 + 0.125, np.arange(count) % 7 - 0.25))
    rows = [f"{t},{x},{f}" for t, x, f in zip(*numbers.T.tolist(), strict=True)]
    text = lead + "\n".join(["time [s],displacement [mm],force [kN]", *rows]) + "\n"
    assert len(text) > 1 << 22
    loop = loop_from(text, tmp_path)
    assert np.array_equal(loop.time, numbers[:, 0])
    assert np.array_equal(loop.displacement, numbers[:, 1] * 1e-3)
    assert np.array_equal(loop.force, numbers[:, 2] * 1e3)
    assert loop.source is not None
    assert loop.source.sha256 == hashlib.sha256(text.encode()).hexdigest()
    last = lead.count("\n") + 1 + count
    with pytest.raises(MeasurementError, match=rf'line {last}, column "force \[kN\]"[\s\S]*"abc"'):
        loop_from(text.rsplit(",", 1)[0] + ",abc\n", tmp_path)


#: What is wrong, and what the error says besides what tests/cli/spoiled_tables.py has.
BAD_LOOPS: list[tuple[str | bytes, list[str]]] = [
    ("x" * 200_000 + ",b\n1,2\n", ["line 1", "no column for the displacement", "xxx ..."]),
    (LOOP.replace("time [s]", "force [kN]"), ["line 1", "more than one", "force [kN], force [N]"]),
    (LOOP.replace("[mm]", "[deg]"), ["line 1", "does not fit", "a length"]),
    (LOOP.replace("[N]", "[x]").replace("[mm]", "[N]").replace("[x]", "[mm]"), ["swapped", "columns ="]),
    (LOOP.replace("force [N]\n", "force [N]\ns,mm,kN\n"), ["two units", "N and kN"]),
    *((with_line(LOOP, 5, f"0.3,3,{cell}"), ["line 5", f'"{cell}"']) for cell in ("nan", "-inf", "1e300", "1e999")),
    (with_line(LOOP.replace(",", ";"), 5, "0.3;0,5;3"), ["line 5", '"0,5"', "decimal point"]),
    (LOOP.replace("\n", ",1\n").replace("[N],1", "[N]"), ["line 2", "4 cells", "3 cells"]),
    (with_line(LOOP, 5, '"0.3,1,2'), ["1 cell"]),
    (LOOP + "\n".join(LOOP_ROWS * 12) + f'\n0.3,"{"9" * 200_000}",2', ["cannot be read", "field limit", "line 522"]),
    (LOOP + "1," * 1_000_000, ["cannot be read", "a line of 2000000 characters, line 42"]),
    ("time [s]" + " " * 300_000 + "force [N]\n1 2\n", ["line 1", "only one column"]),
    (LOOP.replace("0.3,", " " * 100_000 + "0.3,", 1) + "x,1,2", ["line 42", "x"]),
    (with_line(LOOP, 5, "0.3," + "1" * 100_000 + ",2"), ["line 5", "no finite number", "111 ..."]),
    (",".join(["time [s]"] * 100_000) + "\n1,2\n", ["line 1", "more than one column"]),
    ('"' * 1_000_000, ["only one column"]),
    (with_line("\n# x\n\n" + LOOP, 8, "0.3,abc,3"), ["line 8", '"abc"']),
    (with_line(LOOP, 5, "0.1,1,2"), ["line 5", '"time [s]"', "does not increase", '"0.1"']),
]


@pytest.mark.parametrize(("text", "words"), BAD_LOOPS, ids=[words[-1] for _, words in BAD_LOOPS])
def test_spoiled_loops_have_one_clear_error(text: str | bytes, words: list[str], tmp_path: Path) -> None:
    with refused("loop.csv", *words):
        loop_from(text, tmp_path)


@given(st.binary(max_size=300) | st.text(alphabet='timeforcdsplan[]mN,;"\t\n\r#._0123-e', max_size=300).map(str.encode))
def test_any_bytes_are_a_loop_or_a_clear_error(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    for content in (data, LOOP.encode() + data):
        with contextlib.suppress(BushfitError):
            loop_from(content, tmp_path_factory.getbasetemp())


def test_a_loop_of_a_coupon_has_strain_and_stress(tmp_path: Path) -> None:
    text = LOOP.replace("displacement [mm]", "shear strain [%]").replace("force [N]", "Schubspannung [kPa]")
    loop = loop_from(text, tmp_path, direction=Specimen("DMA", "modulus"))
    plain = loop_from(LOOP, tmp_path)
    np.testing.assert_allclose(loop.displacement, 10.0 * plain.displacement)
    np.testing.assert_allclose(loop.force, 1e3 * plain.force)
    doubled = loop_from(text, tmp_path, direction=Specimen("DMA", "modulus", strain="tensor"))
    np.testing.assert_allclose(doubled.displacement, 2.0 * loop.displacement)
    with pytest.raises(BushfitError, match=r"test of strain and modulus[\s\S]*specimen = "):
        loop_from(text, tmp_path)
    with pytest.raises(BushfitError, match="test of displacement and force"):
        loop_from(LOOP, tmp_path, direction=Specimen("DMA", "modulus"))
