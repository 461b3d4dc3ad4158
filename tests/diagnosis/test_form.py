"""An effect that is named has to grow with frequency and amplitude as its law does.

The data are the virtual rig's; made-up laws are added to their stiffness in the frequency domain.
"""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from asking import asked
from rigged import LEVELS, Effects, Fitted, Measured
from scipy.stats import binomtest
from test_schemas import complaints

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.form import other_form
from bushfit.report.folder import to_json

CHANCE = 0.998
#: Campaigns with a true effect.
TRUE = 100


def with_damper(campaign: Campaign, p: float, q: float, size: float = 0.06) -> Campaign:
    """A damper whose share of the stiffness is its size at 155 Hz and the middle level, and grows as f^p and X^q."""
    sweeps = [
        replace(
            sweep,
            stiffness=sweep.stiffness
            * (1.0 + 1j * size * (sweep.frequency / 155.0) ** p * (sweep.amplitude / LEVELS[1]) ** q),
        )
        for sweep in campaign.sweeps
    ]
    return replace(campaign, sweeps=tuple(sweeps), loops=())


@pytest.mark.parametrize(("p", "q"), [(0.5, -0.5), (1.6, 0.5), (1.0, 0.5)])
def test_another_dependence_is_seen(p: float, q: float, measured: Measured, fitted: Fitted) -> None:
    """A root damper, one above a threshold, and one that grows with amplitude are no delay."""
    assert other_form(fitted(with_damper(measured(), p, q), "delay"), ["delay"], CHANCE) == "delay"


def test_it_is_described_and_not_named(measured: Measured) -> None:
    """A damper above a threshold of the rate; viscous, which comes near, is no more than a lead."""
    found = asked(with_damper(measured(), 1.6, 0.5))
    document = found.to_document()
    assert found.verdict == "described"
    assert found.summary.startswith("a real gap stays")
    assert "to be trusted between these tests alone (axial 5 to 150 Hz, 0.62 to 3.1 %" in found.effects[0].evidence
    assert [effect["level"] for effect in document["effects"]] == ["unresolved"]
    assert document["usable"]["held_out"] is False
    assert complaints("diagnosis", json.loads(to_json(document)), whole=True) == []


@pytest.mark.slow
def test_true_effects_keep_their_names(measured: Measured, fitted: Fitted) -> None:
    """By chance 1 in 500 is bent; of effects of many kinds and sizes, none of much more."""
    kinds: list[Effects] = [
        {"delay": {"tau": 1e-4}},
        {"viscous": {"eta": 1500.0}},
        {"inertia": {"mass": 0.06}},
        {"interface_slip": {"force": 6.0}},
        {"strain_stiffening": {"c3": 20.0}},
        {"sliders": {}},
    ]
    bent = []
    for number in range(TRUE):
        truth = kinds[number % len(kinds)]
        bent.append(other_form(fitted(measured(truth, seed=number), *truth), list(truth), CHANCE) is not None)
    ends = binomtest(sum(bent), TRUE).proportion_ci()
    print(f"true effects called bent: {sum(bent)} of {TRUE}, {100 * ends.low:.1f} to {100 * ends.high:.1f} %")
    assert sum(bent) <= 1
