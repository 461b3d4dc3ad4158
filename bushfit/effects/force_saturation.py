"""Force saturation: the force channel of the sweeps reads too little above a force level.

Slow loops are recorded with another range, and a loop that exceeds this range is visibly clipped.
"""

import numpy as np

from bushfit.effects.clearance import FIRST, SAMPLES
from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values
from bushfit.effects.dead_zone import dead_zone, first_harmonic

#: Amplitude of the force's first harmonic, over the level, below which no waveform of rubber reaches it; chosen.
_NEAR = 0.5


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with a saturating force channel.

    Args:
        p: parameter values by name: level [N] above which the channel saturates, and share [1] of the excess force that
            is lost; 1 if the force is clipped.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K - share (K N(level/(|K| X)) + correction for the distorted waveform of the force).

        N is the describing function of a dead zone (`dead_zone.first_harmonic`; A. Gelb, W. E. Vander Velde,
        Multiple-Input Describing Functions, 1968, app. B), exact for a sinusoidal force. The correction is the first
        harmonic of the excess over the level in one steady cycle, minus the first term from the same samples. K is
        unchanged in loops.
    """
    inside = below(omega, amplitude)
    if setting.kind != "sweep" or not np.any(p["share"]):
        return inside
    level, wave = np.asarray(p["level"])[..., None], np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES)
    inside, motion = inside + np.zeros_like(amplitude), amplitude[..., None]
    first = np.abs(inside) * amplitude
    above = first > _NEAR * p["level"]
    near = above.any(axis=tuple(range(above.ndim - 1)))
    if not near.any():
        return inside
    sine = dead_zone((inside[..., near, None] * motion[..., near, :] * wave).real, level)
    excess = dead_zone(below.cycle(omega[..., near], motion[..., near, :] * wave.real, near), level)
    bent = (excess - sine) @ FIRST
    rest = np.zeros((*bent.shape[:-1], first.shape[-1]), dtype=complex)
    rest[..., near] = bent
    return inside - p["share"] * (
        inside * first_harmonic(first, p["level"]) + rest / np.maximum(amplitude, np.finfo(float).tiny)
    )


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with a saturating force channel.

    Args:
        p: parameter values by name: level [N] above which the channel saturates, and share [1] of the excess force that
            is lost; 1 if the force is clipped.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F minus the share of its excess over +-level in sweeps, F in loops; not in torsion, which has a torque cell.

    >>> motion = History.steady(np.array([1.0, -3.0]), 1.0)
    >>> force({"level": 2.0, "share": 1.0}, lambda history: history.value, motion, sweep)
    array([ 1., -2.])
    """
    felt = below(history)
    return felt - p["share"] * dead_zone(felt, p["level"]) if setting.kind == "sweep" else felt
