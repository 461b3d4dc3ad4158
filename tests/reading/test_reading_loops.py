"""Loops from files: every way to write a table reads the same, time is rebuilt, and damage has its one error."""

import hashlib
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from texts import LOOP, LOOP_ROWS, loop_from, refused, with_line

from bushfit.errors import BushfitError
from bushfit.geometry import Direction, Specimen
from bushfit.reading.measurement import Loop, rebuild_time


@pytest.mark.parametrize(("first", "last"), [('"rerun', '"ok'), ('5" rig', '"x'), ('"rerun', "")])
def test_a_quote_left_open_in_a_remark_takes_no_rows(first, last, tmp_path):
    """A library would read everything up to the next quote as one cell, lines and all."""
    remarks = {5: first, 30: last}
    lines = [f"{line},{remarks.get(number, '')}" for number, line in enumerate(LOOP.splitlines())]
    loop = loop_from("\n".join([LOOP.splitlines()[0] + ",remark", *lines[1:]]), tmp_path)
    assert np.array_equal(loop.force, loop_from(LOOP, tmp_path).force)


def test_a_force_of_the_other_sign_is_turned(tmp_path):
    loop = loop_from(LOOP, tmp_path)
    turned = loop_from(
        re.sub(r",(-?)([\d.]+)(?=\n|$)", lambda m: f",{'' if m[1] else '-'}{m[2]}", LOOP), tmp_path, force_sign=-1
    )
    assert np.array_equal(turned.force, loop.force)
    with pytest.raises(BushfitError, match="the force falls where the displacement rises"):
        loop_from(LOOP, tmp_path, force_sign=-1)


@pytest.mark.parametrize("count", [24, 30])
def test_rates_count_steps_and_not_rows(count, tmp_path):
    """Of few rows: a rate from n rows in n - 1 steps would be 4 % off, beyond the agreement with a stated rate."""
    time = np.arange(count) / 20.0
    rows = "\n".join(f"{t:.9g},{np.sin(12 * t):.6f},{100 * np.sin(12 * t + 0.1):.6f}" for t in time)
    loop = loop_from(f"Sampling rate: 20 Hz\ntime,displacement [mm],force [N]\n{rows}\n", tmp_path)
    np.testing.assert_allclose(loop.time, time, atol=1e-9)
    rounded = "\n".join(
        f"{np.floor(10 * t) / 10:.1f},{np.sin(12 * t):.6f},{100 * np.sin(12 * t + 0.1):.6f}" for t in time
    )
    loop = loop_from(f"time [s],displacement [mm],force [N]\n{rounded}\n", tmp_path)
    assert "at 20 Hz" in loop.source.notes[-1].text


@pytest.mark.parametrize("lead", ["# rig 3\n\n", '\ufeffOperator "A"\nPrüfstand 3\n'])
def test_a_file_of_many_chunks_reads_like_a_small_one(lead, tmp_path, monkeypatch):
    """A row that is left out late in the file still has its line."""
    for module in ("files", "source"):
        monkeypatch.setattr(f"bushfit.reading.{module}.CHUNK_BYTES", 1 << 12)
    count = 2_000
    numbers = np.column_stack((np.arange(count), np.arange(count) % 7 + 0.125, np.arange(count) % 7 - 0.25))
    rows = [f"{t},{x},{f}" for t, x, f in zip(*numbers.T.tolist(), strict=True)]
    text = lead + "\n".join(["time [s],displacement [mm],force [kN]", *rows]) + "\n"
    assert len(text) > 5 << 12
    loop = loop_from(text, tmp_path)
    assert np.array_equal(loop.time, numbers[:, 0])
    assert np.array_equal(loop.displacement, numbers[:, 1] * 1e-3)
    assert np.array_equal(loop.force, numbers[:, 2] * 1e3)
    assert loop.source.sha256 == hashlib.sha256(text.encode()).hexdigest()
    last = lead.count("\n") + 1 + count
    spoiled = loop_from(text.rsplit(",", 1)[0] + ",abc\n", tmp_path)
    assert spoiled.source.notes[0].text.startswith(f"1 row left out, not data of this test: line {last} ({count - 1}")
    assert np.array_equal(spoiled.force, loop.force[:-1])


#: Texts that are too long for tests/files/spoiled/tables.toml or no text, and what the error says.
BAD_LOOPS: list[tuple[str | bytes, list[str]]] = [
    (b"a\0b\0\0c", ["this is not text"]),
    (LOOP.encode("utf-16")[:-1], ["this is not UTF-16 text"]),
    ("x" * 200_000 + ",b\n1,2\n", ["line 1", "no column for the displacement", "xxx ..."]),
    (LOOP + "1," * 1_000_000, ["line 42", "cannot be read", "a line of 2000"]),
    ("time [s]" + " " * 300_000 + "force [N]\n1 2\n", ["line 1", "only one column"]),
    (",".join(["time [s]"] * 100_000) + "\n1,2\n", ["line 1", "more than one column"]),
    ('"' * 1_000_000, ["only one column"]),
]


@pytest.mark.parametrize(("text", "words"), BAD_LOOPS, ids=[words[-1] for _, words in BAD_LOOPS])
def test_spoiled_loops_have_one_clear_error(text, words, tmp_path):
    with refused("loop.csv", *words):
        loop_from(text, tmp_path)


@pytest.mark.parametrize("cell", ["nan", "-inf", "#N/A", "", "abc", "1" * 100_000])
def test_rows_without_a_number_are_left_out_and_listed(cell, tmp_path):
    loop = loop_from(with_line("\n# x\n\n" + LOOP, 8, f"0.3,{cell},3"), tmp_path)
    assert loop.force.size == len(LOOP_ROWS) - 1
    assert loop.source.notes[0].text.startswith("1 row left out, not data of this test: line 8 (0.3")


def test_a_loop_of_a_coupon_has_strain_and_stress_and_one_in_torsion_radians(tmp_path):
    text = LOOP.replace("displacement [mm]", "shear strain [%]").replace("force [N]", "Schubspannung [kPa]")
    loop = loop_from(text, tmp_path, direction=Specimen("DMA", "modulus"))
    plain = loop_from(LOOP, tmp_path)
    np.testing.assert_allclose(loop.displacement, 10.0 * plain.displacement)
    np.testing.assert_allclose(loop.force, 1e3 * plain.force)
    turned = LOOP.replace("displacement [mm]", "angle [deg]").replace("force [N]", "torque [Nm]")
    turned = loop_from(turned, tmp_path, direction=Direction.TORSION)
    np.testing.assert_allclose(turned.displacement, np.radians(1e3 * plain.displacement))
    doubled = loop_from(text, tmp_path, direction=Specimen("DMA", "modulus", strain="tensor"))
    np.testing.assert_allclose(doubled.displacement, 2.0 * loop.displacement)
    with pytest.raises(BushfitError, match=r"test of strain and modulus[\s\S]*specimen = "):
        loop_from(text, tmp_path)
    with pytest.raises(BushfitError, match="test of displacement and force"):
        loop_from(LOOP, tmp_path, direction=Specimen("DMA", "modulus"))


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_time_rebuilt_from_frequency(waveform, noise):
    time = np.sort(np.random.default_rng(1).uniform(0.0, 30.0, 3000))
    sine = np.sin(2 * np.pi * 0.1 * (time - time[0]))
    displacement = sine if waveform == "sine" else 2 / np.pi * np.arcsin(sine)
    displacement += noise * np.random.default_rng(2).standard_normal(time.size)
    rebuilt = rebuild_time(displacement, frequency=0.1, waveform=waveform)
    assert np.all(np.diff(rebuilt) > 0)
    np.testing.assert_allclose(rebuilt, time - time[0], atol=0.02 if noise == 0 else 0.2)


def test_time_rebuilt_from_rate_and_columns_of_one_length(tmp_path):
    text = "\n".join(["displacement [mm],force [N]", *(f"{x},{x}" for x in [0, 1, 2, 2, 1, 0, -1, -2, -1, 0])])
    loop = loop_from(text, tmp_path, rate=1e-3)
    assert loop.time[-1] == pytest.approx(8.0)
    assert np.all(np.diff(loop.time) > 0)
    with refused("the columns of slow differ in shape", "(3,)", "(2,)"):
        Loop("slow", Direction.AXIAL, np.zeros(3), np.zeros(3), np.zeros(2))


@given(arrays(float, st.integers(2, 60), elements=st.integers(-5, 5).map(float)).filter(lambda x: np.ptp(x) > 0))
def test_rebuilt_time_always_increases(displacement):
    for waveform in ("sine", "triangle"):
        assert np.all(np.diff(rebuild_time(displacement, frequency=1.0, waveform=waveform)) > 0)
