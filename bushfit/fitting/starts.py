"""Start values of a fit, estimated from the tests: secant slope, loop area, slope over log f.

Start values need only have the right order of magnitude: from values up to ten times too small or too large, 94 of 100
fits end at the same minimum. The other 6 start far too stiff and lose a branch, which a warning reports.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from bushfit.effects import get_parameter
from bushfit.effects.contract import Array
from bushfit.effects.friction import harmonic_shape
from bushfit.errors import FitError
from bushfit.fitting.assess import implausible_modulus
from bushfit.fitting.preparation import MeasuredTest, operating_conditions
from bushfit.geometry import Bushing, stiffness_per_modulus

#: Assumed ratio of the largest strain amplitude to eps_half for the start value of eps_half; chosen.
_SCALED_STRAIN = 3.0
#: Smallest share of a modulus, or of a loss, that the start values assign to a branch.
_LEAST_SHARE = 0.1
#: Smallest loss modulus relative to |K|, and smallest growth of K' with ln omega relative to mu, for start values.
_LEAST = 1e-3
#: Largest frequency of a slow test, relative to the lowest frequency of all tests.
_SLOW = 1.5
#: Largest strain of a point at the smallest level of the sweeps, relative to their smallest strain: rigs reach an
#: amplitude within some per cent.
_SMALLEST = 1.2
#: Smallest range of ln omega that determines a slope.
_LEAST_RANGE = 0.1
#: Ratio m/mu, and alpha, of a typical filled rubber: start values if the data do not determine a slope.
_USUAL = (0.2, 0.25)
#: Smallest and largest start value of alpha: slopes of filled rubbers.
_ALPHA_RANGE = (0.1, 0.6)


def start_values(
    bushing: Bushing | None, data_sets: Sequence[MeasuredTest], fixed: Mapping[str, float]
) -> dict[str, float]:
    """Determine start values of mu, m, alpha, sigma_fmax and eps_half from tests.

    Values beyond the bounds of a parameter are moved to the bound.

    Args:
        bushing: geometry of the bushing; None if all tests are of specimens.
        data_sets: tests.
        fixed: known values by parameter name, included unchanged [SI].

    Returns:
        Values by parameter name [SI].

    Raises:
        FitError: a value is beyond the bounds, and the tests have a shear modulus that no rubber has.

    Notes:
        - eps_half from the largest strain reached;
        - sigma_fmax from the loss of the slowest test, by the area of a loop, W = pi X^2 K'';
        - mu from the slope (secant of a loop's fundamental) of the slowest test, minus the part of friction;
        - alpha from the slope of ln K'' over ln f, m from the growth of K' over ln f.
    """
    frequency, strain = operating_conditions(bushing, data_sets)
    modulus = np.concatenate(
        [data_set.measured / stiffness_per_modulus(bushing, data_set.direction) for data_set in data_sets]
    )
    slow = frequency <= _SLOW * frequency.min()
    largest = int(np.argmax(np.where(slow, strain, 0.0)))
    eps_half = fixed.get("eps_half", float(strain.max()) / _SCALED_STRAIN)
    shape = harmonic_shape(strain / eps_half)
    loss = max(modulus[largest].imag, _LEAST * abs(modulus[largest]))
    sigma_fmax = fixed.get("sigma_fmax", loss * eps_half / shape[largest].imag)
    friction = sigma_fmax / eps_half * shape
    mu = fixed.get("mu", max(modulus[largest].real - friction[largest].real, _LEAST_SHARE * abs(modulus[largest])))
    m, alpha = _USUAL[0] * mu, _USUAL[1]
    smallest = strain <= _SMALLEST * strain[~slow].min(initial=np.inf)
    log_omega = np.log(2.0 * np.pi * frequency[smallest])
    if not slow.all() and np.ptp(log_omega) >= _LEAST_RANGE:
        least_loss = _LEAST_SHARE * modulus.imag.clip(min=0.0) + 1e-9 * mu  # positive, because its logarithm is needed
        viscous_loss = np.maximum(modulus.imag - friction.imag, least_loss)
        alpha = float(np.clip(_slope(log_omega, np.log(viscous_loss[smallest])), *_ALPHA_RANGE))
        middle = float(np.exp(log_omega.mean()))
        growth = max(_slope(log_omega, modulus.real[smallest]), _LEAST * mu)
        m = 2.0 * growth / (alpha * middle**alpha * np.cos(np.pi * alpha / 2.0))
    found = {"mu": mu, "m": m, "alpha": alpha, "sigma_fmax": sigma_fmax, "eps_half": eps_half}
    found = {name: value for name, value in found.items() if name not in fixed}
    inside = {name: float(np.clip(value, *get_parameter(name).bounds)) for name, value in found.items()}
    if inside != found and (reasons := implausible_modulus(bushing, data_sets)):
        raise FitError(
            "the moduli of these tests are impossible for rubber",
            found=reasons[0].text,
            hint="bushfit diagnose finds a wrong unit; if units and dimensions are right, give start values in [fit]",
        )
    return {**inside, **fixed}


def _slope(x: Array, y: Array) -> float:
    """Slope of the straight line fitted to points x and y, (n,) each."""
    centred = x - x.mean()
    return float(centred @ y / (centred @ centred))
