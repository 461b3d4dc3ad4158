"""Clearance: play between the bushing and what moves it."""

import numpy as np

from bushfit.effects.contract import Array, ForceBelow, History, Setting, StiffnessBelow, Values
from bushfit.effects.dead_zone import dead_zone, first_harmonic

#: Samples of the cycle from which the first harmonic of the bent waveform is taken: chosen, more change no digit that
#: a test resolves.
SAMPLES = 64
#: Factors of the samples in the complex first harmonic of a cycle that starts at the top of the motion.
FIRST = 2.0 / SAMPLES * np.exp(-2j * np.pi * np.arange(SAMPLES) / SAMPLES)


def stiffness(p: Values, below: StiffnessBelow, omega: Array, amplitude: Array, setting: Setting) -> Array:
    """Complex stiffness with play between the bushing and its drive.

    Args:
        p: values of delta [m].
        below, omega, amplitude, setting: see `contract.Layer`.

    Returns:
        (..., n) [N/m or N m/rad].

    Notes:
        K(omega, X - delta) N(delta/X) + what friction makes of the bent waveform; 0 within the play.

        The bushing is moved by what a sine reaches beyond the play, a motion of first harmonic X N (N of
        `dead_zone.first_harmonic`) and peak X - delta. The first term is exact where the bushing is linear. Friction
        answers to the path, not to its first harmonic (0.5 to 3 % of K at delta/X = 0.2). The second term is that
        difference: the first harmonic of one steady cycle, less the first term from the same samples.
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
        p: values of delta [m].
        below, history, setting: see `contract.Layer`.

    Returns:
        (..., n) [N or N m].

    Notes:
        The force of the bushing moved by what exceeds +-delta.

    >>> motion = History.steady(np.array([0.2, 1.0, -1.0]), 1.0)
    >>> force({"delta": 0.25}, lambda history: 2.0 * history.value, motion, loop)
    array([ 0. ,  1.5, -1.5])
    """
    return below(history.with_value(dead_zone(history.value, p["delta"])))
