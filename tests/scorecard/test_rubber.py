"""Simulated rubber of other laws: its building blocks against closed forms, its files, and what its card counts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rubber_campaign import RUBBERS, Rig, simulate_campaign, stiffness, write_campaign
from rubber_card import campaigns, evaluate, format_table, judge
from rubber_in_time import StrainHistory, fractional_derivative, relax, sliders
from time_rig import AXIAL, first_harmonic

PHASE = 2.0 * np.pi * np.arange(512) / 512


def steady(frequency: float, amplitude: float = 1.0) -> StrainHistory:
    return StrainHistory(amplitude * np.sin(PHASE)[None, :], np.array([[1.0 / (512 * frequency)]]), periodic=True)


def test_relaxation_is_that_of_a_maxwell_element() -> None:
    history = steady(2.0)
    stress = relax(history, history.rate, np.full_like(history.rate, 1.0 / 0.05))
    z = 2j * np.pi * 2.0 * 0.05
    assert first_harmonic(stress) / first_harmonic(history.strain) == pytest.approx(z / (1.0 + z), rel=1e-3)


def test_fractional_derivative_from_rest_becomes_the_steady_one() -> None:
    from_rest = StrainHistory(np.tile(np.sin(PHASE), 12)[None, :], np.array([[1.0 / 512]]), periodic=False)
    last = fractional_derivative(from_rest, 0.3)[:, -512:]
    assert first_harmonic(last) / -1j == pytest.approx((2j * np.pi) ** 0.3, rel=1e-2)


def test_a_slider_loses_four_times_its_yield_force_times_its_slip() -> None:
    history = steady(1.0, amplitude=0.05)
    stress = sliders(history, np.array([1e6]), np.array([0.01]))[0]
    loss = np.sum(0.5 * (stress + np.roll(stress, 1)) * np.diff(history.strain[0], prepend=history.strain[0, -1]))
    assert loss == pytest.approx(4.0 * 1e4 * (0.05 - 0.01), rel=2e-3)


@pytest.mark.parametrize("rubber", RUBBERS)
def test_every_rubber_is_stiffer_when_fast_and_softer_when_far(rubber: str) -> None:
    law = RUBBERS[rubber](np.random.default_rng(3))
    slow, fast, far = stiffness(law, Rig(), AXIAL, np.array([5.0, 100.0, 5.0]), np.array([1e-4, 1e-4, 5e-4]))
    assert abs(far) < abs(slow) < abs(fast)
    for value in (slow, fast, far):
        assert 0.02 < value.imag / value.real < 0.3


def test_faults_change_the_stiffness_by_their_equation() -> None:
    law = RUBBERS["two_springpots"](np.random.default_rng(3))
    frequency, amplitude = np.array([20.0, 120.0]), np.array([1e-4, 3e-4])
    omega = 2.0 * np.pi * frequency
    clean = stiffness(law, Rig(), AXIAL, frequency, amplitude)
    delayed = stiffness(law, Rig(delay=1e-4), AXIAL, frequency, amplitude)
    heavy = stiffness(law, Rig(mass=0.05), AXIAL, frequency, amplitude)
    yielding = stiffness(law, Rig(compliance=1e-7), AXIAL, frequency, amplitude)
    assert delayed == pytest.approx(clean * np.exp(-1e-4j * omega), rel=1e-3)
    assert heavy == pytest.approx(clean - 0.05 * omega**2, rel=1e-3)
    assert yielding == pytest.approx(1.0 / (1.0 / clean + 1e-7), rel=5e-3)  # friction at a smaller amplitude


def test_the_same_seed_writes_the_same_files(tmp_path: Path) -> None:
    for name in "ab":
        write_campaign(simulate_campaign("log_normal_sliders", "delay", 3), tmp_path / name)
    for file in (tmp_path / "a").iterdir():
        assert file.read_bytes() == (tmp_path / "b" / file.name).read_bytes()


@pytest.mark.parametrize(
    ("verdict", "name", "level", "alternatives", "found", "wrong"),
    [
        ("named", "delay", "instrument", [], True, ()),
        ("partly", "bump_stop", "component", [], False, ("bump_stop",)),
        ("ambiguous", "bump_stop", "component", ["kraus + delay"], True, ()),
        ("ambiguous", "bump_stop", "component", [], False, ("bump_stop",)),
        ("named", "kraus", "material", [], False, ()),
    ],
)
def test_what_is_found_and_what_is_wrong(
    verdict: str, name: str, level: str, alternatives: list[str], found: bool, wrong: tuple[str, ...]
) -> None:
    effects = [{"name": name, "level": level, "twins": [], "alternatives": alternatives}]
    judged = judge("delay", {"verdict": verdict, "effects": effects, "gap": {"heldout": {"after": 1.1}}})
    assert (judged["fault_found"], judged["wrong_names"]) == (found, wrong)


def test_a_campaign_is_evaluated_as_by_its_user() -> None:
    rubber, fault, seed = next(campaigns("working", 1, with_faults=True))
    outcome = evaluate(simulate_campaign(rubber, fault, seed), seed)
    assert not outcome.error
    assert outcome.misfit >= 0.999 * outcome.least_misfit > 0.003
    assert "rig faults found" in format_table([outcome])
