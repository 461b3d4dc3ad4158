"""Sleeve compliance of one direction: a sleeve flexes under load in that direction alone, as one that turns oval."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import rig_compliance_of_direction as of_rig
from bushfit.effects.contract import Family, Level

(_COMPLIANCE,) = of_rig.FAMILY.record.parameters
FAMILY = Family(
    replace(
        of_rig.FAMILY.record,
        name="sleeve_compliance",
        sentence="A sleeve flexes under {place} load alone: these tests are too soft, most where stiffest.",
        level=Level.COMPONENT,
        parameters=(replace(_COMPLIANCE, meaning="give of the sleeve per {place} force"),),
        twins=("rig_compliance.{place}",),
    ),
    of_rig.FAMILY.places,
)
