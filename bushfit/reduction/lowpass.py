"""Noise of a measured displacement: its size, the frequencies of the motion, and a low-pass filter."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

#: Largest number of samples of a segment of the spectrum, share of the record, and ratio of the density to that of the
#: noise above which a frequency has motion; chosen: eight segments or more do not reach this ratio by chance.
_SEGMENT, _SHARE, _ABOVE = 4096, 8, 4.0
#: Order of the filter: at half of the cut-off frequency, it changes the motion by 0.4 %.
_ORDER = 4
#: Standard deviation of the fourth difference of white noise over that of the noise, and of a normal distribution over
#: its median magnitude.
_FOURTH, _NORMAL = np.sqrt(70.0), 1.4826
#: Cycles of the cut-off frequency by which the filter extends a record, point-symmetric about its ends.
_EXTENSION = 3.0


def noise_and_highest_frequency(value: NDArray[Any], step: float) -> tuple[float, float]:
    """Estimate the white noise of a displacement, and the highest frequency of the motion above it.

    Args:
        value: displacement in any unit, evenly sampled, (n,).
        step: time between samples [s].

    Returns:
        Standard deviation of the noise, in the unit of the displacement, and the frequency [Hz].

    Notes:
        The fourth difference of a finely sampled motion is small compared with that of noise; its median magnitude
        excludes jumps of the motion.
    """
    from scipy.signal import welch  # slow to import, and few results have histories

    noise = _NORMAL * float(np.median(np.abs(np.diff(value, n=4)))) / _FOURTH
    frequency, density = welch(value, 1.0 / step, nperseg=min(_SEGMENT, max(value.size // _SHARE, 8)))
    return noise, float(frequency[density > _ABOVE * 2.0 * noise**2 * step].max(initial=frequency[1]))


def low_pass(value: NDArray[Any], step: float, frequency: float, *, periodic: bool) -> NDArray[Any]:
    """Filter a displacement by a Butterworth low-pass of fourth order, forward and backward, so without delay.

    Args:
        value: displacement in any unit, evenly sampled, (n,).
        step: time between samples [s].
        frequency: cut-off frequency [Hz], at which half of the amplitude remains; below half of the sampling rate.
        periodic: True if the samples are repeated endlessly.

    Returns:
        Displacement without higher frequencies, (n,).
    """
    from scipy.signal import butter, sosfiltfilt

    sections = butter(_ORDER, frequency, fs=1.0 / step, output="sos")
    if periodic:
        return np.asarray(sosfiltfilt(sections, np.tile(value, 3))[value.size : 2 * value.size])
    extension = min(value.size - 1, round(_EXTENSION / (frequency * step)))
    return np.asarray(sosfiltfilt(sections, value, padlen=extension))
