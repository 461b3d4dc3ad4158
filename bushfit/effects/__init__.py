"""The library of effects: one physics a file, one line here."""

from __future__ import annotations

import difflib

from bushfit.effects import (
    amplitude_rolloff,
    asymmetry,
    bump_stop,
    clearance,
    coupled_breakdown,
    delay,
    elastic,
    fixture_resonance,
    force_gain,
    force_offset,
    friction,
    inertia,
    interface_slip,
    maxwell,
    mullins_softening,
    radial_factor,
    rate_dependent_friction,
    rig_compliance,
    second_friction,
    self_heating,
    springpot,
    strain_stiffening,
    viscous,
)
from bushfit.effects.contract import Branch, Effect, Layer, Level, Modifier, Parameter, Setting
from bushfit.effects.history import History
from bushfit.errors import ModelError

__all__ = [
    "BASE",
    "LIBRARY",
    "Branch",
    "Effect",
    "History",
    "Layer",
    "Level",
    "Modifier",
    "Parameter",
    "Setting",
    "effect_named",
    "qualified",
]

#: Every effect by name, the paper's three branches first. Within a level this is the order from the rubber outward.
LIBRARY: dict[str, Effect] = {
    module.EFFECT.name: module.EFFECT
    for module in (
        elastic,
        springpot,
        friction,
        viscous,
        maxwell,
        strain_stiffening,
        asymmetry,
        second_friction,
        mullins_softening,
        rate_dependent_friction,
        coupled_breakdown,
        self_heating,
        clearance,
        interface_slip,
        bump_stop,
        radial_factor,
        rig_compliance,
        inertia,
        fixture_resonance,
        delay,
        amplitude_rolloff,
        force_gain,
        force_offset,
    )
}

#: The paper's model.
BASE = ("elastic", "springpot", "friction")


def effect_named(name: str) -> Effect:
    """The effect of that name.

    Raises:
        ModelError: there is none; the nearest name is suggested.
    """
    if name in LIBRARY:
        return LIBRARY[name]
    near = difflib.get_close_matches(name, LIBRARY, n=1)
    raise ModelError(
        "unknown effect",
        found=name,
        expected="one of " + ", ".join(LIBRARY),
        hint=f"did you mean {near[0]}?" if near else None,
    )


def qualified(effect: Effect, parameter: Parameter) -> str:
    """Name of a parameter in files and reports: plain for the paper's three, `<effect>.<name>` for the rest."""
    return parameter.name if effect.name in BASE else f"{effect.name}.{parameter.name}"
