"""Strain scale: one direction of the bushing, or one specimen, is strained more or less than its formula says."""

from __future__ import annotations

from bushfit.effects.contract import Array, Family, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Values
from bushfit.effects.history import History


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K at the amplitude scale X [N/m]."""
    return below(omega, p["scale"] * amplitude)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F of scale times the motion, over scale [N]: the stiffness is as it was, at another strain."""
    return below(history.with_value(p["scale"] * history.value)) / p["scale"]


FAMILY = Family(
    Layer(
        name="strain_scale",
        sentence="The strain of {place} is off its formula by one factor: its stiffness is that of another amplitude.",
        equation="K at scale X, {place} only",
        level=Level.COMPONENT,
        parameters=(Parameter("scale", "1", (0.2, 5.0), 1.0, 0.2, meaning="strain of {place} over its formula's"),),
        source="one strain stands for an uneven field; Eq. 8 of Garcia Tarrago et al. 2007 is of an infinite tube",
        confirmed_by="a finite element solution of the strains; a stiffness_factor of the same place shifts all levels "
        "alike, this one only where stiffness changes with amplitude",
        frees=("peak_to_peak", "zero_to_peak"),
        stiffness=stiffness,
        force=force,
    )
)
