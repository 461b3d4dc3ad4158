"""CSV files: every way to write a table reads the same, and every kind of damage has its one error."""

from __future__ import annotations

import contextlib
import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bushfit.errors import BushfitError, MeasurementError
from bushfit.geometry import Direction
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep, rebuild_time
from bushfit.reading.parallel import CHUNK
from bushfit.reading.sweeps import read_sweep

TIME = np.arange(40) * 0.1
LOOP_ROWS = [f"{t:.1f},{np.sin(3 * t):.4f},{100 * np.sin(3 * t + 0.1):.3f}" for t in TIME]
LOOP = "\n".join(["time [s],displacement [mm],force [N]", *LOOP_ROWS]) + "\n"
SWEEP_HEADER = "frequency [Hz],amplitude [mm],stiffness [N/mm],loss factor [-]"
SWEEP_ROWS = [f"{f},{a},{500 + f},0.1" for a in (0.1, 0.2) for f in (5, 15, 25, 35)]
SWEEP = "\n".join([SWEEP_HEADER, *SWEEP_ROWS]) + "\n"


def loop_from(text: str | bytes, folder: Path, **options: Any) -> Loop:
    file = folder / "loop.csv"
    file.write_bytes(text.encode() if isinstance(text, str) else text)
    return read_loop(file, options.pop("direction", Direction.AXIAL), **options)


def sweep_from(text: str, folder: Path, **options: Any) -> Sweep:
    file = folder / "sweep.csv"
    file.write_text(text)
    return read_sweep(file, options.pop("direction", Direction.AXIAL), **options)


def with_line(text: str, number: int, line: str) -> str:
    lines = text.splitlines()
    lines[number - 1] = line
    return "\n".join(lines)


@pytest.mark.parametrize(
    "text",
    [
        LOOP,
        LOOP.rstrip("\n"),
        LOOP.replace(",", ";"),
        LOOP.replace(",", "\t"),
        LOOP.replace("\n", "\r\n"),
        LOOP.replace("\n", "\n\n"),
        "\ufeff" + LOOP,
        "\ufeff\r\n# rig 3\r\n\n" + LOOP,
        LOOP.replace("force [N]", "force (N)"),
        LOOP.replace("force [N]", "Force_N").replace("displacement [mm]", "DISPLACEMENT_mm"),
        LOOP.replace("force [N]", "load [N]").replace("time [s]", "t [s]"),
        LOOP.replace("time [s],displacement [mm],force [N]", "time,displacement,force\ns,mm,N"),
        LOOP.replace("time [s],displacement [mm],force [N]", "time [s],displacement,force\n,mm,N"),
        LOOP.replace("\n", ",ok\n").replace("force [N],ok", "force [N],remark"),
        "\n".join(",".join(f'"{cell}"' for cell in line.split(",")) for line in LOOP.splitlines()),
        "\n".join(",".join(reversed(line.split(","))) for line in LOOP.splitlines()),
    ],
)
def test_loops_in_every_dialect(text: str, tmp_path: Path) -> None:
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


@pytest.mark.parametrize("waveform", ["sine", "triangle"])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_time_rebuilt_from_frequency(waveform: Any, noise: float) -> None:
    time = np.sort(np.random.default_rng(1).uniform(0.0, 30.0, 3000))
    sine = np.sin(2 * np.pi * 0.1 * (time - time[0]))
    displacement = sine if waveform == "sine" else 2 / np.pi * np.arcsin(sine)
    displacement += noise * np.random.default_rng(2).standard_normal(time.size)
    rebuilt = rebuild_time(displacement, frequency=0.1, waveform=waveform)
    assert np.all(np.diff(rebuilt) > 0)
    np.testing.assert_allclose(rebuilt, time - time[0], atol=0.02 if noise == 0 else 0.2)


def test_time_rebuilt_from_rate(tmp_path: Path) -> None:
    text = "\n".join(["displacement [mm],force [N]", *(f"{x},{x}" for x in [0, 1, 2, 2, 1, 0, -1, -2, -1, 0])])
    loop = loop_from(text, tmp_path, rate=1e-3)
    assert loop.time[-1] == pytest.approx(8.0)
    assert np.all(np.diff(loop.time) > 0)


@given(arrays(float, st.integers(2, 60), elements=st.integers(-5, 5).map(float)).filter(lambda x: np.ptp(x) > 0))
def test_rebuilt_time_always_increases(displacement: Any) -> None:
    for waveform in ("sine", "triangle"):
        assert np.all(np.diff(rebuild_time(displacement, frequency=1.0, waveform=waveform)) > 0)


@pytest.mark.parametrize(
    ("columns", "second"),
    [
        ("stiffness [N/mm],loss factor [-]", "{k},{eta}"),
        ("stiffness [kN/m],tan_delta", "{k},{eta}"),
        ("Stiffness [N/mm],Loss-Factor [%]", "{k},{eta_percent}"),
        ("dynamic_stiffness_N/mm,phase_deg", "{k},{phase}"),
        ("storage stiffness [N/mm],loss stiffness [N/mm]", "{real},{imaginary}"),
    ],
)
def test_sweeps_in_every_pair(columns: str, second: str, tmp_path: Path) -> None:
    stiffness = np.array([600.0, 610.0, 620.0, 630.0]) * np.exp(0.1j)
    rows = [
        f"{5 + 10 * i},0.1,"
        + second.format(
            k=abs(k), eta=k.imag / k.real, eta_percent=100 * k.imag / k.real,
            phase=np.degrees(np.angle(k)), real=k.real, imaginary=k.imag,
        )
        for i, k in enumerate(stiffness)
    ]  # fmt: skip
    sweep = sweep_from("\n".join([f"frequency [Hz],amplitude [mm],{columns}", *rows]), tmp_path)
    np.testing.assert_allclose(sweep.stiffness, stiffness * 1e3, rtol=1e-12)
    np.testing.assert_allclose(sweep.frequency, [5, 15, 25, 35])


def test_repeats_are_numbered(tmp_path: Path) -> None:
    doubled = "\n".join([SWEEP_HEADER, *SWEEP_ROWS, *SWEEP_ROWS])
    assert sweep_from(doubled, tmp_path).repeat.tolist() == [1] * 8 + [2] * 8
    stated = "\n".join([SWEEP_HEADER + ",repeat", *(f"{row},3" for row in SWEEP_ROWS)])
    assert set(sweep_from(stated, tmp_path).repeat) == {3}


def test_peak_to_peak_is_halved(tmp_path: Path) -> None:
    assert sweep_from(SWEEP, tmp_path, amplitude="peak-to-peak").amplitude[0] == pytest.approx(0.05e-3)


@pytest.mark.parametrize("lead", ["", "# rig 3\n\n", 'Operator "A"\n', "\ufeff", "Prüfstand 3\n"])
def test_a_large_file_reads_like_a_small_one(lead: str, tmp_path: Path) -> None:
    """5 MB, which pandas reads on all cores; an error late in the file still has its line."""
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


@pytest.mark.parametrize("row", [CHUNK - 1, CHUNK, CHUNK + 1])
def test_time_that_stands_still_is_found_wherever_blocks_meet(row: int, tmp_path: Path) -> None:
    rows = [f"{i - (i == row)},{i % 7}.5,{i % 7}.25" for i in range(CHUNK + 9)]
    text = "\n".join(["time [s],displacement [mm],force [kN]", *rows])
    with pytest.raises(MeasurementError, match=rf'line {row + 2}, column "time \[s\]"'):
        loop_from(text, tmp_path)


NEVER = [f"{i},{i},7" for i in range(20)]
BAD_LOOPS: list[tuple[str, str | bytes, list[str]]] = [
    ("empty", "", ["empty"]),
    ("blank", " \n\r\n", ["empty"]),
    ("zeros", LOOP.encode().replace(b"0.3,", b"0.3\0,"), ["line 5", "not text", "0x00"]),
    ("binary", bytes(range(256)) * 10, ["line 1", "not text", "0x00"]),
    ("half UTF-16", LOOP.encode("utf-16")[:-1], ["UTF-16"]),
    ("no table", "just text\nmore\n", ["line 1", "only one column", "just text"]),
    ("no header", "\n".join(LOOP_ROWS), ["line 1", "no header", "time [s]"]),
    ("long header", "x" * 200_000 + ",b\n1,2\n", ["line 1", "no column for the displacement", "xxx..."]),
    ("no force", LOOP.replace("force [N]", "y [N]"), ["line 1", "no column for the force", "y [N]", "columns ="]),
    ("no time", LOOP.replace("time [s]", "x [s]"), ["no column for the time", "rate", "waveform"]),
    ("two forces", LOOP.replace("time [s]", "force [kN]"), ["line 1", "more than one", "force [kN], force [N]"]),
    ("no unit", LOOP.replace("force [N]", "force"), ["line 1", "the force has no unit", "force [N]", "units ="]),
    ("unknown unit", LOOP.replace("[N]", "[foo]"), ["line 1", "force [foo]", "unknown unit"]),
    ("wrong unit", LOOP.replace("[N]", "[bar]"), ["line 1", "force [bar]", "does not fit", "a force"]),
    ("angle", LOOP.replace("[mm]", "[deg]"), ["line 1", "does not fit", "a length"]),
    ("swapped", LOOP.replace("[N]", "[x]").replace("[mm]", "[N]").replace("[x]", "[mm]"), ["swapped", "columns ="]),
    ("two units", LOOP.replace("force [N]\n", "force [N]\ns,mm,kN\n"), ["two units", "N and kN"]),
    ("text", with_line(LOOP, 5, "0.3,abc,3"), ["line 5", '"displacement [mm]"', '"abc"', "no finite number"]),
    ("empty cell", with_line(LOOP, 5, "0.3,,3"), ["line 5", '"displacement [mm]"', "empty"]),
    ("nan", with_line(LOOP, 5, "0.3,nan,3"), ["line 5", '"nan"']),
    ("inf", with_line(LOOP, 5, "0.3,3,-inf"), ["line 5", '"-inf"']),
    ("huge", with_line(LOOP, 5, "0.3,3,1e300"), ["line 5", '"1e300"']),
    ("overflow", with_line(LOOP, 5, "0.3,3,1e999"), ["line 5", '"1e999"']),
    ("decimal comma", with_line(LOOP.replace(",", ";"), 5, "0.3;0,5;3"), ["line 5", '"0,5"', "decimal point"]),
    ("short row", with_line(LOOP, 5, "0.3,1"), ["line 5", "2 cells", "3 cells"]),
    ("long row", with_line(LOOP, 5, "0.3,1,2,3"), ["line 5", "4 cells", "3 cells"]),
    ("long rows", LOOP.replace("\n", ",1\n").replace("[N],1", "[N]"), ["line 2", "4 cells", "3 cells"]),
    ("open quote", with_line(LOOP, 5, '"0.3,1,2'), ["1 cell"]),
    ("endless cell", with_line(LOOP, 5, f'0.3,"{"9" * 200_000}",2'), ["cannot be read", "field limit"]),
    ("endless line", LOOP + "1," * 1_000_000, ["cannot be read", "a line of 2000000 characters, line 42"]),
    ("endless header", "time [s]" + " " * 300_000 + "force [N]\n1 2\n", ["line 1", "only one column"]),
    ("endless blanks", LOOP.replace("0.3,", " " * 100_000 + "0.3,", 1) + "x,1,2", ["line 42", "x"]),
    ("endless number", with_line(LOOP, 5, "0.3," + "1" * 100_000 + ",2"), ["line 5", "no finite number", "111..."]),
    ("many columns", ",".join(["time [s]"] * 100_000) + "\n1,2\n", ["line 1", "more than one column"]),
    ("nothing but quotes", '"' * 1_000_000, ["only one column"]),
    ("after blanks", with_line("\n# x\n\n" + LOOP, 8, "0.3,abc,3"), ["line 8", '"abc"']),
    ("time back", with_line(LOOP, 5, "0.1,1,2"), ["line 5", '"time [s]"', "does not increase", '"0.1"']),
    ("few rows", "\n".join(LOOP.splitlines()[:5]), ["too few rows", "4", "10"]),
    ("no rows", LOOP.splitlines()[0], ["too few rows", "0"]),
    ("standstill", "time [s],displacement [mm],force [N]\n" + "\n".join(f"{i},7,{i}" for i in range(20)),
     ["displacement never changes"]),
    ("no force", "time [s],displacement [mm],force [N]\n" + "\n".join(NEVER), ["force never changes"]),
    ("sign", "time [s],displacement [mm],force [N]\n" + "\n".join(f"{i},{i},{-i}" for i in range(20)),
     ["force falls", "force_sign = -1"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "words"), [case[1:] for case in BAD_LOOPS], ids=[case[0] for case in BAD_LOOPS])
def test_spoiled_loops_have_one_clear_error(text: str | bytes, words: list[str], tmp_path: Path) -> None:
    with pytest.raises(BushfitError) as caught:
        loop_from(text, tmp_path)
    message = str(caught.value)
    assert all(word in message for word in ["loop.csv", *words]), message


#: |K|, loss factor, phase, K' and K'' of the same stiffness, rounded as files are.
ALL_PAIRS = "\n".join(
    [
        f"{SWEEP_HEADER},phase [deg],K' [N/mm],K'' [N/mm]",
        *(
            f"{5 + 10 * i},0.1,{abs(k):.1f},{k.imag / k.real:.3f},"
            f"{np.degrees(np.angle(k)):.1f},{k.real:.0f},{k.imag:.0f}"
            for i, k in enumerate(np.array([600.0, 610.0, 620.0, 630.0]) * np.exp(0.11j))
        ),
    ]
)


def test_columns_that_say_the_same_may_be_rounded_or_count_a_phase_the_other_way(tmp_path: Path) -> None:
    stiffness = sweep_from(ALL_PAIRS, tmp_path).stiffness
    np.testing.assert_allclose(stiffness, 1e3 * np.array([600.0, 610.0, 620.0, 630.0]) * np.exp(0.11j), rtol=1e-3)
    assert np.array_equal(sweep_from(ALL_PAIRS.replace(",6.", ",-6."), tmp_path).stiffness, stiffness)


def test_noise_about_no_loss_is_no_loss_the_other_way(tmp_path: Path) -> None:
    assert np.median(sweep_from(SWEEP.replace("0.1\n", "-0.002\n"), tmp_path).stiffness.imag) < 0.0


BAD_SWEEPS = [
    ("no pair", SWEEP.replace("loss factor [-]", "x"), ["line 1", "no pair", "storage stiffness"]),
    ("frequency unit", SWEEP.replace("[Hz]", "[rad/s]"), ["line 1", "does not fit", "a frequency"]),
    ("phase unit", SWEEP.replace("loss factor [-]", "phase"), ["line 1", "the phase has no unit", "phase [deg]"]),
    ("decibel", SWEEP.replace("[-]", "[dB]"), ["line 1", "unknown unit", "dB"]),
    ("frequency", with_line(SWEEP, 3, "-15,0.1,600,0.1"), ["line 3", "frequency is not positive", '"-15"']),
    ("amplitude", with_line(SWEEP, 3, "15,0,600,0.1"), ["line 3", "amplitude is not positive", '"0"']),
    ("stiffness", with_line(SWEEP, 3, "15,0.1,-600,0.1"), ["line 3", "stiffness is not positive", '"-600"']),
    ("negative loss", with_line(SWEEP, 3, "15,0.1,600,-0.9"), ["line 3", "loss factor", "-0.5 to 5", '"-0.9"']),
    ("percent as ratio", with_line(SWEEP, 3, "15,0.1,600,11"), ["line 3", "%", '"11"']),
    ("phase over 90", with_line(SWEEP.replace("loss factor [-]", "phase [deg]"), 3, "15,0.1,600,95"), ["line 3", "95"]),
    (
        "tiny storage",
        with_line(
            SWEEP.replace("loss factor [-]", "loss stiffness [N/mm]").replace(
                "stiffness [N/mm],l", "storage stiffness [N/mm],l"
            ),
            3,
            "15,0.1,1e-320,600",
        ),
        ["line 3", "loss"],
    ),
    (
        "phase the other way",
        SWEEP.replace("loss factor [-]", "phase [deg]").replace("0.1\n", "-6.5\n"),
        ["the loss counts the other way", '"phase [deg]"', "8 of 8 rows", "turn the sign"],
    ),
    ("ratio as percent", SWEEP.replace("[-]", "[%]"), ['"loss factor [%]"', "0.1 % at most", "0.5 %", '"[-]"']),
    (
        "pairs that contradict",
        with_line(ALL_PAIRS, 4, ALL_PAIRS.splitlines()[3].replace(",6.", ",9.")),
        ["line 4", "contradict", '"phase [deg]"', '"loss factor [-]"'],
    ),
    ("another stiffness", ALL_PAIRS.replace("K' [N/mm]", "K' [kN/mm]"), ["line 2", "contradict", "K' [kN/mm]"]),
    ("repeat", SWEEP.replace("0.1\n", "0.1,1.5\n").replace("[-]", "[-],repeat"), ["line 2", "no repeat", '"1.5"']),
    ("few rows", "\n".join(SWEEP.splitlines()[:3]), ["too few rows", "2", "3"]),
]


@pytest.mark.parametrize(("text", "words"), [case[1:] for case in BAD_SWEEPS], ids=[case[0] for case in BAD_SWEEPS])
def test_spoiled_sweeps_have_one_clear_error(text: str, words: list[str], tmp_path: Path) -> None:
    with pytest.raises(BushfitError) as caught:
        sweep_from(text, tmp_path)
    message = str(caught.value)
    assert all(word in message for word in ["sweep.csv", *words]), message


def test_missing_column_of_the_campaign_suggests_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(MeasurementError, match=r'no column "forse"[\s\S]*did you mean "force \[N\]"'):
        loop_from(LOOP, tmp_path, columns={"force": "forse"})


@pytest.mark.parametrize(
    ("name", "words"), [("", "a folder"), ("lop.csv", 'did you mean "loop.csv"'), ("a/b", "no such")]
)
def test_what_is_no_file(name: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "loop.csv").touch()
    with pytest.raises(MeasurementError, match=words):
        read_loop(tmp_path / name, Direction.AXIAL)


@given(st.binary(max_size=300) | st.text(alphabet='timeforcdsplan[]mN,;"\t\n\r#._0123-e', max_size=300).map(str.encode))
def test_any_bytes_are_a_loop_or_a_clear_error(tmp_path_factory: pytest.TempPathFactory, data: bytes) -> None:
    for content in (data, LOOP.encode() + data):
        with contextlib.suppress(BushfitError):
            loop_from(content, tmp_path_factory.getbasetemp())
