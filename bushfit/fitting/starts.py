"""Start values read off the data: secant slope, loop area, slope over log f.

They need only be of the right order; the fits end at one minimum from anywhere within two decades.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from bushfit.effects.friction import harmonic_shape
from bushfit.fitting.data_sets import DataSet
from bushfit.geometry import Bushing

#: The strain amplitude of the largest test over eps_half, before anything is known.
_SCALED_STRAIN = 3.0
#: Share of the smallest loss that a start leaves to a branch, whatever the other branches claim.
_LEAST_SHARE = 0.1


def start_values(bushing: Bushing, data_sets: Sequence[DataSet], known: Mapping[str, float]) -> dict[str, float]:
    """Values of mu, m, alpha, sigma_fmax, eps_half to start from; `known` ones are kept and allowed for.

    - eps_half from the largest strain reached;
    - sigma_fmax from the loss of the slowest test, which is a loop's area: W = pi X^2 K'';
    - mu from the slope (secant of a loop's fundamental) of the slowest test, less what friction adds;
    - alpha from the slope of ln K'' over ln f, m from the growth of K' over ln f.
    """
    strain, frequency, modulus = _points(bushing, data_sets)
    slowest = frequency <= 1.5 * frequency.min()
    largest = int(np.argmax(np.where(slowest, strain, 0.0)))
    eps_half = known.get("eps_half", float(strain.max()) / _SCALED_STRAIN)
    shape = harmonic_shape(strain / eps_half)
    loss = max(modulus[largest].imag, 1e-3 * abs(modulus[largest]))
    sigma_fmax = known.get("sigma_fmax", loss * eps_half / shape[largest].imag)
    friction = sigma_fmax / eps_half * shape
    mu = known.get("mu", max(modulus[largest].real - friction[largest].real, _LEAST_SHARE * abs(modulus[largest])))
    swept = ~slowest
    smallest = strain <= 1.01 * strain[swept].min(initial=np.inf)
    log_omega = np.log(2.0 * np.pi * frequency[smallest])
    if not swept.any() or np.ptp(log_omega) < 0.1:
        return {"mu": mu, "m": 0.2 * mu, "alpha": 0.25, "sigma_fmax": sigma_fmax, "eps_half": eps_half, **known}
    viscous_loss = np.maximum(modulus.imag - friction.imag, _LEAST_SHARE * modulus.imag.clip(min=0.0) + 1e-9 * mu)
    alpha = float(np.clip(_slope(log_omega, np.log(viscous_loss[smallest])), 0.1, 0.6))
    middle = float(np.exp(log_omega.mean()))
    growth = max(_slope(log_omega, modulus.real[smallest]), 1e-3 * mu)
    m = 2.0 * growth / (alpha * middle**alpha * np.cos(np.pi * alpha / 2.0))
    return {"mu": mu, "m": m, "alpha": alpha, "sigma_fmax": sigma_fmax, "eps_half": eps_half, **known}


def _slope(x: np.ndarray, y: np.ndarray) -> float:
    """Slope of the straight line through points."""
    apart = x - x.mean()
    return float(apart @ y / (apart @ apart))


def _points(bushing: Bushing, data_sets: Sequence[DataSet]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Strain amplitude, frequency [Hz] and complex modulus [Pa] of every operating point, loops included."""
    factors = [bushing.stiffness_per_modulus(data_set.direction) for data_set in data_sets]
    return (
        np.concatenate([data_set.amplitude * bushing.unit_strain(data_set.direction) for data_set in data_sets]),
        np.concatenate([data_set.frequency for data_set in data_sets]),
        np.concatenate([data_set.measured / factor for data_set, factor in zip(data_sets, factors, strict=True)]),
    )
