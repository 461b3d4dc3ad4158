"""Hysteretic loss: a loss that is independent of rate and amplitude."""

from functools import partial

from bushfit.effects.contract import Array, Values, harmonic_stress


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of a loss that is constant over frequency and amplitude (structural damping).

    Args:
        p: parameter values by name: eta [1], constant loss modulus over mu, and static shear modulus mu [Pa].
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = i eta mu (R. E. D. Bishop, J. R. Aeronaut. Soc. 59 (1955) 738), which no causal law in time has.

    >>> modulus({"mu": 1e6, "eta": 0.02}, 100.0, 0.01)
    20000j
    """
    return 1j * p["eta"] * p["mu"]


stress = partial(harmonic_stress, modulus)
