"""High-pass: the charge amplifier of a piezoelectric load cell lets a slow force leak away.

Such a cell serves the sweeps; the loops, as slow as the leak, go by one that holds its force.
"""

from functools import partial

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Value, Values
from bushfit.effects.maxwell import relax


def _leak(p: Values, omega: Array) -> Value:
    """Relative loss of the force, -1/(1 + i omega T), 1/T = 2 pi corner; -1 for the mean, unless the corner is 0."""
    rate = 2.0 * np.pi * p["corner"] + 0j
    total = rate + 1j * np.asarray(omega)
    return -rate / np.where(total == 0.0, 1.0, total)


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a leaking charge amplifier.

    Args:
        p: values of corner [Hz].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K i omega T/(1 + i omega T) of a sweep.

    >>> round(abs(stiffness({"corner": 1.0}, spring, 2.0 * np.pi, 1e-4, sweep)))
    353553
    """
    return below(omega, amplitude) * (1.0 + (_leak(p, omega) if setting.kind == "sweep" else 0.0))


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a leaking charge amplifier.

    Args:
        p: values of corner [Hz].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        y of T dy/dt + y = T dF/dt: exact in every harmonic of a steady cycle, for straight lines from rest.
    """
    felt = below(history)
    if setting.kind != "sweep":
        return felt
    if history.periodic:
        return felt + history.with_value(felt).response(partial(_leak, p))
    return relax(2.0 * np.pi * p["corner"], felt, history.step) if np.any(p["corner"]) else felt
