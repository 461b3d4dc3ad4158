"""Strain scale: one direction of the bushing, or one specimen, is strained more or less than its formula says."""

from __future__ import annotations

from functools import lru_cache, partial

from bushfit.effects.contract import (
    Array,
    Family,
    ForceBelow,
    Layer,
    Level,
    Parameter,
    Setting,
    StiffnessBelow,
    Values,
    only_at,
)
from bushfit.effects.history import History
from bushfit.geometry import Direction


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K at the amplitude scale X [N/m]."""
    return below(omega, p["scale"] * amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F of scale times the motion, over scale [N]: the stiffness is as it was, at another strain."""
    return below(history.with_value(p["scale"] * history.value)) / p["scale"]


@lru_cache
def strain_scale(place: str) -> Layer:
    """The effect of one place: a direction of the bushing, or a specimen by its name."""
    return Layer(
        name=f"strain_scale.{place}",
        sentence=f"The strain of {place} is off its formula by one factor: its stiffness is that of another amplitude.",
        equation=f"K at scale X, {place} only",
        level=Level.COMPONENT,
        parameters=(Parameter("scale", "1", (0.2, 5.0), 1.0, 0.2, meaning=f"strain of {place} over its formula's"),),
        source="one strain stands for an uneven field; Eq. 8 of Garcia Tarrago et al. 2007 is of an infinite tube",
        confirmed_by="a finite element solution of the strains; a stiffness_factor of the same place shifts all levels "
        "alike, this one only where stiffness changes with amplitude",
        frees=("peak_to_peak", "zero_to_peak"),
        stiffness=partial(only_at, place, stiffness),
        force=partial(only_at, place, force),
    )


FAMILY = Family("strain_scale", strain_scale)
EFFECT = strain_scale(Direction.RADIAL.value)
