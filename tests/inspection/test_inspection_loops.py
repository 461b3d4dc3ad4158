"""Loops looked at: what is recognised, and each fault told with its figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from looking import look

from bushfit.campaign.schema import SimulatedLoop, SimulateSettings
from bushfit.errors import FitError
from bushfit.geometry import Direction
from bushfit.inspection.loops import look_at_loop
from bushfit.model.model import Model
from bushfit.reading.loops import read_loop
from bushfit.reading.measurement import Loop
from bushfit.reading.names import Said
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import undisturbed


def test_a_loop_is_described(loop: Loop, tmp_path: Path) -> None:
    seen = look(tmp_path, replace(loop, force=loop.force + 20.0), "loop_axial_1mm_0.1Hz.csv")
    assert (seen.kind, seen.direction) == ("loop", Direction.AXIAL)
    assert [(column.role, column.unit) for column in seen.columns] == [
        ("time", "s"), ("displacement", "mm"), ("force", "N"),
    ]  # fmt: skip
    assert seen.columns[1].high == pytest.approx(1.0, abs=2e-3)
    facts = seen.looked.facts
    assert facts["cycles"].startswith("3")
    assert facts["frequency"] == "0.1 Hz, a sine"
    assert facts["sampling"] == "even, every 0.01 s, 1000 rows a cycle"
    assert facts["amplitude"] == "1 mm zero-to-peak"
    assert facts["mean force"].startswith("20")
    assert facts["noise"].startswith("0.3 %")
    assert seen.looked.odd == ()


def test_a_triangle_and_torsion_are_recognised(paper_model: Model, tmp_path: Path) -> None:
    test = SimulatedLoop(Direction.TORSION, 0.02, 0.1, cycles=2, waveform="triangle")
    made = measure(undisturbed(paper_model, SimulateSettings(loops=(test,))), SimulateSettings(force_noise=1e-3))
    seen = look(tmp_path, made.loops[0], "x.csv")
    assert seen.direction.is_rotation
    assert seen.looked.facts["frequency"] == "0.1 Hz, a triangle"
    assert seen.looked.facts["amplitude"].endswith("deg zero-to-peak")
    assert seen.looked.odd == ()


def cut_off(values: np.ndarray, share: float) -> np.ndarray:
    return np.minimum(values, share * values.max())


LOOP_FAULTS: dict[str, tuple[Callable[[Loop], Loop], str]] = {
    "saturated force": (lambda x: replace(x, force=cut_off(x.force, 0.8)), "the force is cut off at its top"),
    "saturated displacement": (
        lambda x: replace(x, displacement=np.maximum(x.displacement, 0.9 * x.displacement.min())),
        "the displacement is cut off at its bottom",
    ),
    "time of 1000 times": (
        lambda x: replace(x, time=1000.0 * x.time),
        "one cycle takes 170 min, as hardly any test does, unless axial.csv ran 60 times faster than stated",
    ),
    "drifting force": (
        lambda x: replace(x, force=x.force + 3.0 * x.time / x.time[-1]),
        "the force drifts: its mean goes from",
    ),
    "drifting displacement": (
        lambda x: replace(x, displacement=x.displacement + 2e-5 * x.time / x.time[-1]),
        "the displacement drifts",
    ),
    "still settling": (
        lambda x: replace(x, force=x.force * (1.0 + 0.1 * np.exp(-x.time / 20.0))),
        "the cycles are still settling: the force amplitude goes from",
    ),
    "outlier row": (
        lambda x: replace(x, force=x.force + np.where(np.arange(x.force.size) == 700, 90.0, 0.0)),
        "the force has an outlier at data row 701",
    ),
    "gap": (
        lambda x: replace(x, **{key: np.delete(getattr(x, key), slice(300, 330)) for key in CHANNELS}),
        "1 gap in time, the first after data row 300: 0.31 s without a row",
    ),
    "stuck": (
        lambda x: replace(
            x,
            displacement=np.where(STUCK(x), x.displacement[400], x.displacement),
            force=np.where(STUCK(x), x.force[400], x.force),
        ),
        "30 rows from data row 401 on repeat one displacement and force",
    ),
    "run-in": (
        lambda x: replace(x, displacement=x.displacement * np.where(x.time < 9.9, 0.6, 1.0)),
        "before its steady cycles are left out",
    ),
    "off zero": (
        lambda x: replace(x, displacement=x.displacement + 3e-5),
        "the motion is off zero by 0.03 mm, 3 % of its amplitude",
    ),
    "mean displacement": (
        lambda x: replace(x, displacement=x.displacement + 1e-4),
        "recorded about a mean displacement of 0.1 mm; the model knows no preload",
    ),
    "mean force": (
        lambda x: replace(x, force=x.force + 820.0),
        "recorded about a mean force of 820 N; the model knows no preload",
    ),
    "turned force": (lambda x: replace(x, force=-x.force), "the campaign needs force_sign = -1"),
}


CHANNELS = ("time", "displacement", "force")


def STUCK(x: Loop) -> np.ndarray:  # noqa: N802
    return (np.arange(x.time.size) >= 400) & (np.arange(x.time.size) < 430)


@pytest.mark.parametrize("fault", LOOP_FAULTS)
def test_each_fault_of_a_loop_is_told(loop: Loop, tmp_path: Path, fault: str) -> None:
    spoil, said = LOOP_FAULTS[fault]
    odd = look(tmp_path, spoil(loop)).looked.odd
    print("; ".join(odd))
    assert any(said in sentence for sentence in odd)
    assert len(odd) <= 2


def test_of_a_loop_with_a_whole_cycle_cut_out_the_longer_part_is_described(loop: Loop, tmp_path: Path) -> None:
    seen = look(tmp_path, replace(loop, **{key: np.delete(getattr(loop, key), slice(600, 1600)) for key in CHANNELS}))
    facts, odd = seen.looked.facts, seen.looked.odd
    print(facts["amplitude"], facts["mean displacement"], odd)
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
    wrong = look_at_loop(read_loop(file, Direction.AXIAL, rate=1.2e-4), Said())
    right = look_at_loop(read_loop(file, Direction.AXIAL, frequency=0.1, waveform="sine"), Said())
    assert any("as those of a sine" in line for line in wrong.odd)
    assert not any("as those of" in line for line in right.odd)
