"""Rig compliance of one direction: the fixture of that direction alone gives way in series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from bushfit.effects import rig_compliance
from bushfit.effects.contract import Family
from bushfit.geometry import Direction


def _along_lines(places: Sequence[str]) -> Sequence[str]:
    """Axial and radial, where both are tested: with one of them alone this is the rig's own compliance."""
    both = [place for place in places if place in (Direction.AXIAL, Direction.RADIAL)]
    return both if len(both) > 1 else []


(_COMPLIANCE,) = rig_compliance.EFFECT.parameters
FAMILY = Family(
    replace(
        rig_compliance.EFFECT,
        sentence="The fixture of the {place} tests alone gives way in series: they are too soft, most where stiffest.",
        equation="1/K' = 1/K + compliance, {place} only",
        parameters=(replace(_COMPLIANCE, meaning="give of the {place} fixture per force"),),
        confirmed_by="put a steel dummy in place of the bushing, in the {place} direction; a stiffness_factor keeps "
        "the loss factor, this one lowers it, most where stiffness is highest",
        twins=(),
    ),
    _along_lines,
)
