"""Sleeve compliance: a sleeve of the bushing flexes in series with the rubber, as a rig would that gives way."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import rig_compliance
from bushfit.effects.contract import Level, Parameter

EFFECT = replace(
    rig_compliance.EFFECT,
    name="sleeve_compliance",
    sentence="A sleeve flexes in series with the rubber: the stiffer the direction, the softer it seems.",
    level=Level.COMPONENT,
    parameters=(Parameter("compliance", "m/N", (0.0, 1e-5), 0.0, 2e-8, meaning="give of the sleeve per force"),),
    source="springs in series",
    confirmed_by="put a steel dummy in place of the bushing: what still gives way is the rig",
    twins=("rig_compliance",),
)
