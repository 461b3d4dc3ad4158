"""Sleeve compliance of one direction: a sleeve flexes under load in that direction alone, as one that turns oval."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from bushfit.effects import rig_compliance_of_direction as of_rig
from bushfit.effects.contract import Effect, Level
from bushfit.geometry import Direction


@lru_cache
def compliance_of(place: str) -> Effect:
    """The effect of one direction along a line; in torsion it does nothing."""
    rig = of_rig.compliance_of(place)
    (parameter,) = rig.parameters
    return replace(
        rig,
        name=f"sleeve_compliance.{place}",
        sentence=f"A sleeve flexes under {place} load alone: these tests are too soft, most where stiffest.",
        level=Level.COMPONENT,
        parameters=(replace(parameter, meaning=f"give of the sleeve per {place} force"),),
        twins=(rig.name,),
    )


FAMILY = replace(of_rig.FAMILY, name="sleeve_compliance", of_place=compliance_of)
EFFECT = compliance_of(Direction.RADIAL.value)
