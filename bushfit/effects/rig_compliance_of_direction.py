"""Rig compliance of one direction: the fixture of that direction alone gives way in series."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache, partial

from bushfit.effects import rig_compliance
from bushfit.effects.contract import Family, Layer, only_at
from bushfit.geometry import Direction


def _along_lines(places: Sequence[str]) -> Sequence[str]:
    """Axial and radial, where both are tested: with one of them alone this is the rig's own compliance."""
    both = [place for place in places if place in (Direction.AXIAL, Direction.RADIAL)]
    return both if len(both) > 1 else []


@lru_cache
def compliance_of(place: str) -> Layer:
    """The effect of one direction along a line; in torsion it does nothing."""
    (parameter,) = rig_compliance.EFFECT.parameters
    return replace(
        rig_compliance.EFFECT,
        name=f"rig_compliance.{place}",
        sentence=f"The fixture of the {place} tests alone gives way in series: they are too soft, most where stiffest.",
        equation=f"1/K' = 1/K + compliance, {place} only",
        parameters=(replace(parameter, meaning=f"give of the {place} fixture per force"),),
        confirmed_by=f"put a steel dummy in place of the bushing, in the {place} direction; a stiffness_factor keeps "
        "the loss factor, this one lowers it, most where stiffness is highest",
        stiffness=partial(only_at, place, rig_compliance.stiffness),
        force=partial(only_at, place, rig_compliance.force),
        twins=(),
    )


FAMILY = Family("rig_compliance", compliance_of, _along_lines)
EFFECT = compliance_of(Direction.RADIAL.value)
