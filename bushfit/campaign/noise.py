"""The noise that a simulated rig is planned to have: of loops, of runs, and of the amplitudes that it reaches."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bushfit.campaign.schema import SimulatedSweep, SimulateSettings
from bushfit.effects.contract import Array

if TYPE_CHECKING:
    from numpy.random import Generator


def filtered_noise(rows: int, plan: SimulateSettings, random: Generator) -> Array:
    """Stationary noise of unit variance, (rows,), each row's correlated with the next as planned."""
    noise = random.standard_normal(rows)
    if not plan.force_correlation:
        return noise
    from scipy.signal import lfilter

    noise[1:] *= np.sqrt(1.0 - plan.force_correlation**2)
    return lfilter([1.0], [1.0, -plan.force_correlation], noise)


def with_noise(clean: Array, plan: SimulateSettings, random: Generator) -> Array:
    """Runs with noise, (runs, steps): scatter of each point, gain and phase error of each run."""
    runs = (clean.shape[0], 1)
    gain = plan.gain_error * random.standard_normal(runs)
    phase = plan.phase_error * random.standard_normal(runs)
    scatter = plan.noise * (random.standard_normal(clean.shape) + 1j * random.standard_normal(clean.shape))
    return clean * (1.0 + gain) * np.exp(1j * phase) * (1.0 + scatter)


def of_levels(held: int, plan: SimulateSettings, random: Generator) -> Array:
    """What all repeats of each level of a sweep are multiplied with, (held, 1, 1): the errors that they share."""
    if not (plan.level_gain_error or plan.level_phase_error):
        return np.ones((held, 1, 1))
    gain, phase = random.standard_normal((2, held, 1, 1))
    return (1.0 + plan.level_gain_error * gain) * np.exp(1j * plan.level_phase_error * phase)


def reached_over_asked(test: SimulatedSweep, plan: SimulateSettings, random: Generator) -> Array:
    """Amplitude reached over that asked for, (held x repeats x steps,): off by as much at each frequency as at each
    point; lognormal, so that it stays above zero."""
    at_frequency = random.standard_normal(len(test.frequencies))
    at_frequency = at_frequency if test.stepped == "frequency" else at_frequency[:, None, None]
    at_point = random.standard_normal((len(test.held), plan.repeats, len(test.steps)))
    return np.exp(test.reached * np.sqrt(0.5) * (at_frequency + at_point)).ravel()
