"""Clearance: play between the bushing and its drive."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values
from bushfit.effects.dead_zone import dead_zone, first_harmonic

#: Samples per cycle for the first harmonic of the distorted waveform; chosen: more samples change no digit that a test
#: resolves.
SAMPLES = 64
#: Factors of the samples in the complex first harmonic of a cycle that starts at the top of the motion.
FIRST = 2.0 / SAMPLES * np.exp(-2j * np.pi * np.arange(SAMPLES) / SAMPLES)


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with play between the bushing and its drive.

    Args:
        p: parameter values by name: delta [m], play in each sense.
        below: complex stiffness K without this effect, as a function of omega and amplitude.
        omega, amplitude: angular frequency [rad/s] and displacement amplitude X [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Complex stiffness with the effect [N/m or N m/rad], (..., n).

    Notes:
        K(omega, X - delta) N(delta/X) + correction of friction for the distorted waveform; 0 within the play.

        The motion of the bushing is the excess of a sine over the play, with peak X - delta and first harmonic X N,
        where N is the describing function of a dead zone (`dead_zone.first_harmonic`; A. Gelb, W. E. Vander Velde,
        Multiple-Input Describing Functions, 1968, app. B). The first term is exact if the bushing is linear. Friction
        depends on the path, not on its first harmonic (0.5 to 3 % of K at delta/X = 0.2). The second term is this
        difference: the first harmonic of one steady cycle minus the first term computed from the same samples.
    """
    delta = p["delta"]
    if not np.any(delta):
        return below(omega, amplitude)
    reach = np.maximum(amplitude - delta, 0.0)
    share = first_harmonic(amplitude, delta)
    wave = np.cos(2.0 * np.pi * np.arange(SAMPLES) / SAMPLES)
    bent = dead_zone(amplitude[..., None] * wave, np.asarray(delta)[..., None])
    crossed = reach > 0.0
    each_twice = np.tile(np.arange(omega.shape[-1]), 2)
    motions = np.concatenate((reach[..., None] * wave, bent), axis=-2)
    answers = below.cycle(omega[..., each_twice], motions, (..., each_twice)) @ FIRST
    sine, path = np.split(answers, 2, axis=-1)
    sine, path = sine / np.where(crossed, reach, 1.0), path / np.where(crossed, amplitude, 1.0)
    return below(omega, reach) * share + (path - share * sine) * crossed


def force(p: Values, below: ForceBelow, history: History, setting: Setting) -> Array:
    """Force with play between the bushing and its drive.

    Args:
        p: parameter values by name: delta [m], play in each sense.
        below: force F without this effect, as a function of the displacement history.
        history: displacement over time [m or rad], (..., n).
        setting: the test: bushing, direction and kind (sweep or loop).

    Returns:
        Force with the effect at each sample [N or N m], (..., n).

    Notes:
        F of the bushing's displacement: the excess of the imposed displacement over +-delta, 0 within the play.

    >>> motion = History.steady(np.array([0.2, 1.0, -1.0]), 1.0)
    >>> force({"delta": 0.25}, lambda history: 2.0 * history.value, motion, loop)
    array([ 0. ,  1.5, -1.5])
    """
    return below(history.with_value(dead_zone(history.value, p["delta"])))
