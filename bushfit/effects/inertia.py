"""Inertia: the mass that moves between the bushing and the load cell."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, Layer, Level, Parameter, Setting, StiffnessBelow, Values
from bushfit.effects.history import History


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """K - M omega^2 [N/m]; a mass that is moved, not turned, does not act in torsion."""
    return below(omega, amplitude) - p["mass"] * np.asarray(omega) ** 2


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """F + M d2x/dt2 [N]; exact in every harmonic of a steady cycle, second differences from rest."""
    if history.periodic:
        return below(history) + history.response(lambda omega: -p["mass"] * omega**2)
    return below(history) + p["mass"] * history.acceleration


EFFECT = Layer(
    name="inertia",
    sentence="Moving mass between bushing and load cell: storage stiffness falls with the square of frequency.",
    equation="K - mass omega^2",
    level=Level.INSTRUMENT,
    parameters=(Parameter("mass", "kg", (0.0, 100.0), 0.0, 0.05, meaning="moving mass"),),
    source="ISO 10846-2:2008 (inertia between the test object and the force transducer)",
    confirmed_by="add a known mass between bushing and load cell, or run the empty fixture",
    turns=False,
    stiffness=stiffness,
    force=force,
)
