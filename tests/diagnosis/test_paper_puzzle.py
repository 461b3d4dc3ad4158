"""The paper's puzzle: the radial loss factor at 0.5 mm is off, and its authors blame the amplitude measured.

Both that and its rival, a radial strain that Eq. 8 has wrong, are simulated on the paper's bushing by the rig.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from tries import some

from bushfit.campaign.campaign import load_campaign, model_of
from bushfit.campaign.schema import SimulateSettings
from bushfit.diagnosis.record import Diagnosis
from bushfit.diagnosis.workflow import diagnose
from bushfit.fitting.data import Data
from bushfit.model import rig
from bushfit.model.model import Model
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import Undisturbed, undisturbed

#: Time steps in a cycle of the rig.
STEPS = 1024
PLAN = SimulateSettings(noise=5e-3, force_noise=3e-3, repeats=3, gain_error=4e-3, phase_error=float(np.radians(0.2)))
#: The rival's name.
SCALE = "strain_scale.radial"


@pytest.fixture(scope="module")
def truth(root: Path) -> Model:
    return model_of(load_campaign(root / "configs/table_1.toml"))


@pytest.fixture(scope="module")
def clean(truth: Model) -> Undisturbed:
    return undisturbed(truth, PLAN, steps_per_cycle=STEPS)


def misread(clean: Undisturbed, reached: float, seen: float = 1.0) -> Undisturbed:
    """The radial level of 0.5 mm was moved by another amplitude than its label says, and K divided by what was seen."""
    (axial, radial), kept = (test for test, _ in clean.sweeps), [stiffness.copy() for _, stiffness in clean.sweeps]
    frequency = np.array(radial.frequencies)
    amplitude = np.full(frequency.size, reached * radial.amplitudes[2])
    kept[1][2] = rig.dynamic_stiffness(clean.truth, radial.direction, frequency, amplitude, steps_per_cycle=STEPS)
    kept[1][2] *= reached / seen
    return replace(clean, sweeps=((axial, kept[0]), (radial, kept[1])))


def asked(tests: Undisturbed) -> list[Diagnosis]:
    return [diagnose(Data.of(measure(tests, replace(PLAN, seed=seed)).campaign())) for seed in (1, 2, 3)]


@pytest.mark.slow
@pytest.mark.parametrize(("reached", "seen"), [(0.9, 1.0), (1.1, 1.0), (0.3, 0.3)])
def test_a_level_of_another_amplitude_is_to_be_measured_again(clean: Undisturbed, reached: float, seen: float) -> None:
    """Moved by 10 % less or more than was read; and run at 0.15 mm, read rightly and filed under 0.5 mm."""
    for diagnosis in asked(misread(clean, reached, seen)):
        assert diagnosis.verdict in ("unexplained", "ambiguous")
        assert "the radial level 0.5 mm" in diagnosis.next_test
        assert all(diagnosis.verdict == "ambiguous" and named.alternatives for named in diagnosis.effects)


@pytest.mark.slow
@pytest.mark.parametrize("scale", [0.6, 0.74])
def test_a_wrong_strain_scale_is_named(truth: Model, scale: float) -> None:
    """0.74: what finite elements of this shape say of Eq. 8."""
    found = asked(undisturbed(truth.with_effect(SCALE, {SCALE: scale}), PLAN, steps_per_cycle=STEPS))
    seen = [diagnosis for diagnosis in found if diagnosis.effects]
    assert 2 * len(seen) >= len(found)
    for diagnosis in seen:
        (named,) = diagnosis.effects
        assert SCALE in (named.name, *named.alternatives)
        assert "level" not in diagnosis.summary
        if diagnosis.verdict == "named":
            low, high = diagnosis.result.interval(SCALE) or (np.inf, 0.0)
            assert low - 0.02 <= scale <= high + 0.02


@pytest.mark.parametrize("label", some(("level", "scale"), {"level"}))
def test_what_is_too_small_to_show_is_left_alone(truth: Model, clean: Undisturbed, label: str) -> None:
    """A level off by 20 % in amplitude alone, and a strain scale off by 10 %, change these tests by less than 1 %."""
    small = misread(clean, 0.8, 0.8)
    if label == "scale":
        small = undisturbed(truth.with_effect(SCALE, {SCALE: 0.9}), PLAN, steps_per_cycle=STEPS)
    assert {diagnosis.verdict for diagnosis in asked(small)} == {"consistent"}
