"""Sweeps looked at: each fault told with its figures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from looking import look, without

from bushfit.inspection.opening import inspect
from bushfit.reading.measurement import Sweep
from bushfit.reading.rawtable import raw_sweep_table


def spoiled(sweep: Sweep, rows: np.ndarray, factor: complex) -> Sweep:
    return replace(sweep, stiffness=np.where(rows, factor, 1.0) * sweep.stiffness)


def copied(sweep: Sweep) -> Sweep:
    """The second repeat of the smallest level is the first one once more."""
    first, second = ((sweep.amplitude == 1e-4) & (sweep.repeat == number) for number in (1, 2))
    stiffness = sweep.stiffness.copy()
    stiffness[second] = stiffness[first]
    return replace(sweep, stiffness=stiffness)


SWEEP_FAULTS: dict[str, tuple[Callable[[Sweep], Sweep], str]] = {
    "copied block": (copied, "16 rows repeat others digit by digit, the first of them at 5 Hz (data row 1)"),
    "missing frequencies": (
        lambda x: without(x, (x.amplitude == 2e-4) & np.isin(x.frequency, (45.0, 55.0))),
        "0.2 mm, repeat 1, lacks 45, 55 Hz, which most others have",
    ),
    "outlier point": (
        lambda x: spoiled(x, np.arange(x.repeat.size) == 20, 1.15),
        "data row 21 (45 Hz, 0.1 mm, repeat 2) is +1",
    ),
    "block off": (
        lambda x: spoiled(x, (x.amplitude == 5e-4) & (x.repeat == 3), 1.08),
        "0.5 mm, repeat 3 lies +",
    ),
    "drift over repeats": (
        lambda x: replace(x, stiffness=x.stiffness * (1.0 - 0.02 * x.repeat)),
        "|K| drifts by -4",
    ),
    "loss below zero": (
        lambda x: spoiled(x, x.frequency == 155.0, np.exp(-0.4j)),
        "9 points with a loss factor below zero, the first at 155 Hz, 0.1 mm: is the force channel late?",
    ),
    "radians read as degrees": (
        lambda x: replace(x, stiffness=np.abs(x.stiffness) * np.exp(1j * np.radians(np.angle(x.stiffness)))),
        "unless the phases of axial.csv are radians, not degrees (then, in the campaign: [[sweeps]] of axial",
    ),
    "90 deg less the phase": (
        lambda x: replace(x, stiffness=1j * np.conj(x.stiffness * np.exp(0.2j))),
        "unless the phases of axial.csv are 90 deg less the loss angle (then, in the campaign: [[sweeps]] of axial",
    ),
}


@pytest.mark.parametrize("fault", SWEEP_FAULTS)
def test_each_fault_of_a_sweep_is_told(sweep: Sweep, tmp_path: Path, fault: str) -> None:
    spoil, said = SWEEP_FAULTS[fault]
    odd = look(tmp_path, spoil(sweep)).looked.odd
    print("; ".join(odd))
    assert any(said in sentence for sentence in odd)


@pytest.mark.parametrize("order", ["by amplitude", "shuffled"])
def test_repeats_that_nothing_tells_are_asked_for(sweep: Sweep, tmp_path: Path, order: str) -> None:
    """A repeat lost and levels missed by up to 12 %: no rule groups them."""
    table = raw_sweep_table(sweep).drop(columns="repeat").iloc[1:]
    table["amplitude [mm]"] *= 1.0 + 0.12 * np.random.default_rng(1).uniform(-1.0, 1.0, len(table))
    by_amplitude = table.sort_values(["frequency [Hz]", "amplitude [mm]"])
    table = by_amplitude if order == "by amplitude" else table.sample(frac=1.0, random_state=1)
    table.to_csv(tmp_path / "axial.csv", index=False)
    odd = inspect(tmp_path / "axial.csv", {}).looked.odd
    assert any("if they are repeats, a column repeat with their numbers tells so" in sentence for sentence in odd)
