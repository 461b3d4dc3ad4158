"""Fixture resonance: the moving mass is on a fixture that has a resonance."""

from functools import partial

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values
from bushfit.effects.maxwell import recursion

#: Largest damping ratio in time: at 1 both poles of the mode are one, which has another solution.
_UNDER = 1.0 - 1e-9


def fixture(p: Values, omega: Array) -> Array:
    """Stiffness [N/m] that a resonant fixture adds: -M omega^2 wr^2/(wr^2 - omega^2 + 2 i zeta omega wr), wr = 2 pi f.

    Args:
        p: parameter values by name: mass M [kg], frequency f [Hz] and damping ratio zeta [1] of the mode.
        omega: angular frequency [rad/s], any shape.

    >>> mode = {"mass": 0.1, "frequency": 300.0, "damping": 0.0}
    >>> fixture(mode, 2.0 * np.pi * np.array([100.0, 200.0])).real.round()
    array([ -44413., -284245.])
    """
    ratio = np.asarray(omega) / (2.0 * np.pi * p["frequency"])
    return -p["mass"] * np.asarray(omega) ** 2 / (1.0 - ratio**2 + 2j * p["damping"] * ratio)


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a resonant fixture between bushing and load cell.

    Args:
        p: parameter values by name: mass M [kg], frequency f [Hz] and damping ratio zeta [1] of the fixture's mode.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K - M omega^2 wr^2/(wr^2 - omega^2 + 2 i zeta omega wr), wr = 2 pi f: one mode, driven at its base (D. J. Ewins,
        Modal Testing, 2nd ed., 2000, ch. 2). Does not act in torsion.
    """
    return below(omega, amplitude) + fixture(p, omega)


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a resonant fixture between bushing and load cell.

    Args:
        p: parameter values by name: mass M [kg], frequency f [Hz] and damping ratio zeta [1] of the fixture's mode.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F + y, where y'' + 2 zeta wr y' + wr^2 y = wr^2 M x'', wr = 2 pi f, for the displacement x.

        From rest the free vibration decays to 37 % within 1/(2 pi zeta f) seconds.
    """
    if history.periodic:
        return below(history) + history.response(partial(fixture, p))
    row_by_row = np.vectorize(_mode, signature="(),(),(n),()->(n)")
    frequency, damping, step = (np.atleast_1d(value)[..., 0] for value in (p["frequency"], p["damping"], history.step))
    return below(history) + p["mass"] * row_by_row(2.0 * np.pi * frequency, damping, history.acceleration, step)


def _mode(omega: float, damping: float, push: Array, step: float) -> Array:
    """Solve y'' + 2 zeta w y' + w^2 y = w^2 push from rest, exactly if the push is linear between samples.

    Args:
        omega: natural angular frequency w of the fixture [rad/s].
        damping: damping ratio zeta [1].
        push: acceleration of the motion [m/s^2], (n,).
        step: time between samples [s].

    Returns:
        y, in the unit of the push, (n,).

    Notes: y = w^2/Im(p) Im z with z' = p z + push and the pole p above the real axis.
    """
    damping = min(damping, _UNDER)
    pole = omega * complex(-damping, np.sqrt(1.0 - damping**2))
    turn = pole * step
    mean = np.expm1(turn) / turn  # of exp(p t) over a step, and weighted by the push at its end
    at_end = (mean - 1.0) / turn
    before = np.concatenate(([0.0], push[:-1]))
    z = recursion(np.exp(turn), step * ((mean - at_end) * before + at_end * push))
    return np.asarray(omega**2 / pole.imag * z.imag)
