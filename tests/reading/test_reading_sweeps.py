"""Sweeps from files: every pair of columns gives the same stiffness, and every kind of damage has its one error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from texts import SWEEP, SWEEP_HEADER, SWEEP_ROWS, sweep_from, with_line

from bushfit.errors import BushfitError


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
    ("frequency unit", SWEEP.replace("[Hz]", "[rad]"), ["line 1", "does not fit", "a frequency"]),
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
