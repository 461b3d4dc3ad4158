"""High-pass: the charge amplifier of a piezoelectric load cell lets a slow force leak away.

Sweeps are measured with such a cell. Loops, which are as slow as the leak, are measured with a cell that keeps its
signal.
"""

from functools import partial

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Value, Values
from bushfit.effects.maxwell import relax


def _leak(p: Values, omega: Array) -> Value:
    """Relative change [1] of the force due to the leak: -1/(1 + i omega T), 1/T = 2 pi corner; 0 at corner 0 Hz."""
    rate = 2.0 * np.pi * p["corner"] + 0j
    total = rate + 1j * np.asarray(omega)
    return -rate / np.where(total == 0.0, 1.0, total)


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a leaking charge amplifier.

    Args:
        p: parameter values by name: corner [Hz], frequency at which half of the power is lost.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K i omega T/(1 + i omega T), T = 1/(2 pi corner), in sweeps, K in loops: first-order high-pass (G. Gautschi,
        Piezoelectric Sensorics, 2002, ch. 11).

    >>> round(abs(stiffness({"corner": 1.0}, spring, 2.0 * np.pi, 1e-4, sweep)))
    353553
    """
    return below(omega, amplitude) * (1.0 + (_leak(p, omega) if setting.kind == "sweep" else 0.0))


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a leaking charge amplifier.

    Args:
        p: parameter values by name: corner [Hz], frequency at which half of the power is lost.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        Solution y of T dy/dt + y = T dF/dt, T = 1/(2 pi corner), in sweeps, F in loops. Exact for a steady cycle; from
        rest, F is linear between samples.

    >>> held = History.sampled(np.full(4, 1e-4), 0.1)
    >>> force({"corner": 1.0}, lambda history: 1e6 * history.value, held, sweep).round(1)
    array([74.2, 39.6, 21.1, 11.3])
    """
    felt = below(history)
    if setting.kind != "sweep":
        return felt
    if history.periodic:
        return felt + history.with_value(felt).response(partial(_leak, p))
    return relax(2.0 * np.pi * p["corner"], felt, history.step) if np.any(p["corner"]) else felt
