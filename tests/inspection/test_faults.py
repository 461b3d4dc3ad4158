"""Loops and sweeps looked at: what is recognised, each fault told with its figures, names held against content."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from looking import look, without

from bushfit.campaign.schema import SimulatedLoop, SimulateSettings
from bushfit.errors import FitError
from bushfit.geometry import Direction
from bushfit.inspection.loops import look_at_loop
from bushfit.inspection.opening import inspect
from bushfit.model.model import Model
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop, Sweep
from bushfit.reading.names import Labels
from bushfit.reading.rawtable import raw_sweep_table
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import undisturbed

CHANNELS = ("time", "displacement", "force")


def test_a_loop_is_described(loop: Loop, tmp_path: Path) -> None:
    seen = look(tmp_path, replace(loop, force=loop.force + 20.0), "loop_axial_1mm_0.1Hz.csv")
    assert (seen.kind, seen.direction) == ("loop", Direction.AXIAL)
    assert [(column.role, column.unit) for column in seen.columns] == [
        ("time", "s"), ("displacement", "mm"), ("force", "N"),
    ]  # fmt: skip
    assert seen.columns[1].high == pytest.approx(1.0, abs=2e-3)
    facts = seen.facts
    assert facts["cycles"].startswith("3")
    assert facts["frequency"] == "0.1 Hz, a sine"
    assert facts["sampling"] == "even, every 0.01 s, 1000 rows a cycle"
    assert facts["amplitude"] == "1 mm zero-to-peak"
    assert facts["mean force"].startswith("20")
    assert facts["noise"].startswith("0.3 %")
    assert seen.odd == ()


def test_a_triangle_and_torsion_are_recognised(paper_model: Model, tmp_path: Path) -> None:
    test = SimulatedLoop(Direction.TORSION, 0.02, 0.1, cycles=2, waveform="triangle")
    made = measure(undisturbed(paper_model, SimulateSettings(loops=(test,))), SimulateSettings(force_noise=1e-3))
    seen = look(tmp_path, made.loops[0], "x.csv")
    assert seen.direction.is_rotation
    assert seen.facts["frequency"] == "0.1 Hz, a triangle"
    assert seen.facts["amplitude"].endswith("deg zero-to-peak")
    assert seen.odd == ()


def less(loop: Loop, rows: slice) -> Loop:
    """Without some rows."""
    return replace(loop, **{key: np.delete(getattr(loop, key), rows) for key in CHANNELS})


def jumping(loop: Loop, *rows: int) -> Loop:
    """With a force that jumps in some rows."""
    return replace(loop, force=loop.force + np.where(np.isin(np.arange(loop.force.size), rows), 90.0, 0.0))


def stuck(loop: Loop) -> Loop:
    """With 30 rows that repeat one."""
    rows = np.r_[0:400, [400] * 30, 430 : loop.time.size]
    return replace(loop, displacement=loop.displacement[rows], force=loop.force[rows])


LOOP_FAULTS: dict[str, Callable[[Loop], Loop]] = {
    "the force is cut off at its top": lambda x: replace(x, force=np.minimum(x.force, 0.8 * x.force.max())),
    "the displacement is cut off at its bottom": lambda x: replace(
        x, displacement=np.maximum(x.displacement, 0.9 * x.displacement.min())
    ),
    "one cycle takes 170 min, as hardly any test does, unless axial.csv ran 60 times faster than stated": (
        lambda x: replace(x, time=1000.0 * x.time)
    ),
    "the force drifts: its mean goes from": lambda x: replace(x, force=x.force + 3.0 * x.time / x.time[-1]),
    "the displacement drifts": lambda x: replace(x, displacement=x.displacement + 2e-5 * x.time / x.time[-1]),
    "the cycles are still settling: the force amplitude goes from": lambda x: replace(
        x, force=x.force * (1.0 + 0.1 * np.exp(-x.time / 20.0))
    ),
    "the force has an outlier at data row 701": lambda x: jumping(x, 700),
    " and 1 more": lambda x: jumping(x, 100, 700, 1300, 1900),
    "1 gap in time, the first after data row 300: 0.31 s without a row": lambda x: less(x, slice(300, 330)),
    "30 rows from data row 401 on repeat one displacement and force": stuck,
    "before its steady cycles are left out": lambda x: replace(
        x, displacement=x.displacement * np.where(x.time < 9.9, 0.6, 1.0)
    ),
    "the motion is off zero by 0.03 mm, 3 % of its amplitude": lambda x: replace(x, displacement=x.displacement + 3e-5),
    "recorded about a mean displacement of 0.1 mm; the model knows no preload": lambda x: replace(
        x, displacement=x.displacement + 1e-4
    ),
    "recorded about a mean force of 820 N; the model knows no preload": lambda x: replace(x, force=x.force + 820.0),
    "the campaign needs force_sign = -1": lambda x: replace(x, force=-x.force),
}


@pytest.mark.parametrize("said", LOOP_FAULTS)
def test_each_fault_of_a_loop_is_told(loop: Loop, tmp_path: Path, said: str) -> None:
    odd = look(tmp_path, LOOP_FAULTS[said](loop)).odd
    assert any(said in sentence for sentence in odd), odd
    assert len(odd) <= 2


def test_gaps_and_an_uneven_clock_are_described(loop: Loop, tmp_path: Path) -> None:
    uneven = less(loop, slice(5, None, 10))
    assert look(tmp_path, uneven).facts["sampling"].startswith("uneven, every 0.01 to 0.02 s, mostly 0.01 s")
    seen = look(tmp_path, less(loop, slice(600, 1600)))
    facts, odd = seen.facts, seen.odd
    assert float(facts["amplitude"].split()[0]) == pytest.approx(1.0, rel=0.01)
    assert abs(float(facts["mean displacement"].split()[0])) < 0.01
    assert any("1 gap in time" in sentence for sentence in odd)
    assert facts["frequency"] == "0.1 Hz, a sine"
    assert any("rows are missing; of 30 s only 16 to 30 s are used" in sentence for sentence in odd)


def test_a_loop_the_wrong_way_round_is_refused(loop: Loop, tmp_path: Path) -> None:
    with pytest.raises(FitError, match="gives energy"):
        look(tmp_path, replace(loop, force=np.roll(loop.force, 60)))


def test_rows_of_a_sine_do_not_pass_for_a_triangle(root: Path, tmp_path: Path) -> None:
    """A sine's file without time, of which a rate was stated."""
    lines = (root / "data/arm_bushing/loop_axial_1.csv").read_text(encoding="utf-8").splitlines()
    file = tmp_path / "loop.csv"
    file.write_text("\n".join(line.partition(",")[2] for line in lines), encoding="utf-8")
    _, wrong = look_at_loop(read_loop(file, Direction.AXIAL, rate=1.2e-4), Labels())
    _, right = look_at_loop(read_loop(file, Direction.AXIAL, frequency=0.1, waveform="sine"), Labels())
    assert any("as those of a sine" in line for line in wrong)
    assert not any("as those of" in line for line in right)


def spoiled(sweep: Sweep, rows: np.ndarray, factor: complex) -> Sweep:
    return replace(sweep, stiffness=np.where(rows, factor, 1.0) * sweep.stiffness)


def copied(sweep: Sweep) -> Sweep:
    """The second repeat of the smallest level is the first one once more."""
    first, second = ((sweep.amplitude == 1e-4) & (sweep.repeat == number) for number in (1, 2))
    stiffness = sweep.stiffness.copy()
    stiffness[second] = stiffness[first]
    return replace(sweep, stiffness=stiffness)


SWEEP_FAULTS: dict[str, Callable[[Sweep], Sweep]] = {
    "16 rows repeat others digit by digit, the first of them at 5 Hz (data row 1)": copied,
    "0.2 mm, repeat 1, lacks 45, 55 Hz, which most others have": lambda x: without(
        x, (x.amplitude == 2e-4) & np.isin(x.frequency, (45.0, 55.0))
    ),
    "data row 21 (45 Hz, 0.1 mm, repeat 2) is +1": lambda x: spoiled(x, np.arange(x.repeat.size) == 20, 1.15),
    "0.5 mm, repeat 3 lies +": lambda x: spoiled(x, (x.amplitude == 5e-4) & (x.repeat == 3), 1.08),
    "|K| drifts by -4": lambda x: replace(x, stiffness=x.stiffness * (1.0 - 0.02 * x.repeat)),
    "9 points with a loss factor below zero, the first at 155 Hz, 0.1 mm: is the force channel late?": (
        lambda x: spoiled(x, x.frequency == 155.0, np.exp(-0.4j))
    ),
    "unless the phases of axial.csv are radians, not degrees (then, in the campaign: [[sweeps]] of axial": (
        lambda x: replace(x, stiffness=np.abs(x.stiffness) * np.exp(1j * np.radians(np.angle(x.stiffness))))
    ),
    "unless the phases of axial.csv are 90 deg less the loss angle (then, in the campaign: [[sweeps]] of axial": (
        lambda x: replace(x, stiffness=1j * np.conj(x.stiffness * np.exp(0.2j)))
    ),
}


@pytest.mark.parametrize("said", SWEEP_FAULTS)
def test_each_fault_of_a_sweep_is_told(sweep: Sweep, tmp_path: Path, said: str) -> None:
    odd = look(tmp_path, SWEEP_FAULTS[said](sweep)).odd
    assert any(said in sentence for sentence in odd), odd


@pytest.mark.parametrize("order", ["by amplitude", "shuffled"])
def test_repeats_that_nothing_tells_are_asked_for(sweep: Sweep, tmp_path: Path, order: str) -> None:
    """A repeat lost and levels missed by up to 12 %: no rule groups them."""
    table = raw_sweep_table(sweep).drop(columns="repeat").iloc[1:]
    table["amplitude [mm]"] *= 1.0 + 0.12 * np.random.default_rng(1).uniform(-1.0, 1.0, len(table))
    by_amplitude = table.sort_values(["frequency [Hz]", "amplitude [mm]"])
    table = by_amplitude if order == "by amplitude" else table.sample(frac=1.0, random_state=1)
    table.to_csv(tmp_path / "axial.csv", index=False)
    odd = inspect(tmp_path / "axial.csv", {}).odd
    assert any("if they are repeats, a column repeat with their numbers tells so" in sentence for sentence in odd)


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
