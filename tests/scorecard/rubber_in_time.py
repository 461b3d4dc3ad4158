"""Building blocks of rubber models in the time domain, independent of the package.

A law maps strain histories onto stress histories. All operating points are computed together: a history is an array
(n, samples), one row per operating point. Stresses and moduli are in Pa, strains are dimensionless.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import fftconvolve

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StrainHistory:
    """Strain over time at n operating points.

    Args:
        strain: equivalent strain, (n, samples).
        step: time between samples [s], (n, 1).
        periodic: True if the samples are one cycle of a steady oscillation; False if the motion starts from rest.
    """

    strain: Array
    step: Array
    periodic: bool

    @property
    def rate(self) -> Array:
        """Strain rate [1/s], (n, samples)."""
        if self.periodic:
            return (np.roll(self.strain, -1, axis=1) - np.roll(self.strain, 1, axis=1)) / (2.0 * self.step)
        return np.gradient(self.strain, axis=1) / self.step

    @property
    def largest(self) -> Array:
        """Largest magnitude of the strain so far, (n, samples); of the whole cycle if periodic."""
        magnitude = np.abs(self.strain)
        if self.periodic:
            return np.broadcast_to(magnitude.max(axis=1, keepdims=True), magnitude.shape)
        return np.maximum.accumulate(magnitude, axis=1)


#: A material: strain history -> stress [Pa], (n, samples).
StressLaw = Callable[[StrainHistory], Array]


def fractional_derivative(history: StrainHistory, order: float) -> Array:
    """Fractional derivative of the strain.

    Args:
        history: strain over time.
        order: order of the derivative, between 0 and 1.

    Returns:
        D^order of the strain [s^-order], (n, samples).

    Notes:
        (i k omega)^order for harmonic k of a steady cycle. From rest, the Gruenwald-Letnikov sum
        step^-order sum_j w_j e_(n-j), w_j = w_(j-1) (j - 1 - order)/j (Podlubny 1999, Fractional Differential
        Equations, ch. 7).
    """
    count = history.strain.shape[1]
    if history.periodic:
        omega = 2.0 * np.pi * np.arange(count // 2 + 1) / (count * history.step)
        return np.fft.irfft((1j * omega) ** order * np.fft.rfft(history.strain), count)
    number = np.arange(1, count)
    weights = np.concatenate([[1.0], np.cumprod((number - 1.0 - order) / number)])
    return fftconvolve(history.strain, weights[None, :], axes=1)[:, :count] / history.step**order


def relax(history: StrainHistory, source: Array, rate: Array, start: float = 0.0) -> Array:
    """Solution of dy/dt = source - rate * y.

    Args:
        history: gives the time step, and whether the solution is periodic.
        source: (n, samples), per second.
        rate: (n, samples) [1/s], positive.
        start: initial value of a motion from rest.

    Returns:
        y, (n, samples).
    """

    def per_step(values: Array) -> Array:
        before = np.roll(values, 1, axis=1) if history.periodic else np.hstack([values[:, :1], values[:, :-1]])
        return 0.5 * (before + values) * history.step

    return relax_in_steps(per_step(source), per_step(rate), periodic=history.periodic, start=start)


def relax_in_steps(gain: Array, decay: Array, *, periodic: bool, start: float = 0.0) -> Array:
    """Solution of dy = gain - decay * y, both given per step, (n, samples).

    The periodic solution is exact: the decay over one cycle determines the initial value.
    """
    kept = np.exp(-decay)
    added = gain * -np.expm1(-decay) / decay
    value = np.full(gain.shape[0], 0.0 if periodic else start)
    solution = np.empty_like(gain)
    for sample in range(gain.shape[1]):
        value = value * kept[:, sample] + added[:, sample]
        solution[:, sample] = value
    if periodic:
        exponent = np.cumsum(decay, axis=1)
        first = solution[:, -1] / -np.expm1(-exponent[:, -1])
        solution += np.exp(-exponent) * first[:, None]
    return solution


def sliders(history: StrainHistory, modulus: Array, yield_strain: Array, factor: Array | None = None) -> Array:
    """Stress of springs in series with dry sliders, in parallel (Jenkins elements).

    Args:
        history: strain over time.
        modulus: stress per strain of each spring [Pa], (elements,).
        yield_strain: strain at which each slider yields, (elements,).
        factor: of the yield stresses over time, (n, samples); None for constant yield stresses.

    Returns:
        Stress [Pa], (n, samples).

    Notes:
        Iwan 1967, J. Appl. Mech. 34, 612. A slider remembers at most one cycle, so two cycles from rest are steady.
    """
    strain = history.strain
    change = np.diff(strain, axis=1, prepend=strain[:, -1:] if history.periodic else np.zeros((strain.shape[0], 1)))
    factor = np.ones_like(strain) if factor is None else factor
    elastic = np.zeros((strain.shape[0], modulus.size))
    stress = np.empty_like(strain)
    for _ in range(2 if history.periodic else 1):
        for sample in range(strain.shape[1]):
            limit = factor[:, sample, None] * yield_strain
            elastic = np.clip(elastic + change[:, sample, None], -limit, limit)
            stress[:, sample] = elastic @ modulus
    return stress


def log_normal_elements(modulus: float, median: float, width: float, count: int = 40) -> tuple[Array, Array]:
    """Moduli and yield strains of sliders whose yield strains are distributed log-normally.

    Args:
        modulus: sum of the moduli [Pa].
        median: median yield strain.
        width: standard deviation of the logarithm of the yield strain.
        count: of sliders.

    Returns:
        Moduli [Pa] and yield strains, (count,) each.
    """
    position = np.linspace(-3.0, 3.0, count)
    share = np.exp(-0.5 * position**2)
    return modulus * share / share.sum(), median * np.exp(width * position)
