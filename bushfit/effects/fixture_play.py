"""Fixture play: the fixture that holds the bushing is loose, which moves it less than the rig imposes."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import clearance
from bushfit.effects.contract import Level, Parameter

EFFECT = replace(
    clearance.EFFECT,
    name="fixture_play",
    sentence="Play in the fixture: the bushing is moved less than the rig imposes, most so at the smallest amplitude.",
    level=Level.INSTRUMENT,
    parameters=(Parameter("delta", "m", (0.0, 1e-2), 0.0, 1e-5, meaning="play of the fixture, each way"),),
    confirmed_by="put a steel dummy in place of the bushing: play shows as a step in a slow loop",
    harmonic_error=1.2e-2,  # with slip at the sleeve below, which stands still while the play is crossed
    twins=(),
)
