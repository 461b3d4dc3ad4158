"""Viscous branch: a Newtonian dashpot, loss that grows in proportion to frequency."""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, Branch, History, Parameter, Values, linear_stress


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """mu^ = i omega eta [Pa]."""
    return 1j * np.asarray(omega) * p["eta"]


def stress(p: Values, history: History) -> Array:
    """s = 2 eta de/dt [Pa]; exact in every harmonic of a steady cycle, central differences from rest."""
    return linear_stress(modulus, p, history) if history.periodic else 2.0 * p["eta"] * history.rate


EFFECT = Branch(
    name="viscous",
    sentence="Plain viscous damping of the rubber: the loss stiffness grows in proportion to frequency.",
    equation="i omega eta",
    parameters=(Parameter("eta", "Pa*s", (0.0, 1e6), 0.0, 100.0, meaning="viscosity"),),
    source="Kelvin-Voigt model; J. D. Ferry, Viscoelastic Properties of Polymers, 3rd ed., 1980, ch. 1",
    confirmed_by="sweep from 0.05 to 5 Hz: a plain dashpot has nothing left to add there",
    size="eta",
    modulus=modulus,
    stress=stress,
)
