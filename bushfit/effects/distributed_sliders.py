"""Sliders with log-normally distributed yield strains, in place of the friction branch.

Notes:
    Springs of equal stiffness, each in series with a dry slider (Jenkins elements), act in parallel (W. D. Iwan,
    J. Appl. Mech. 34 (1967) 612). A share Phi(z) of the springs yields below the strain e, where
    z = ln(e/e_s)/spread and Phi is the normal distribution function. The modulus of all springs is delta.
"""

import numpy as np
from scipy.special import ndtr

from bushfit.effects.contract import Array, History, Value, Values
from bushfit.effects.sliders import parallel_elements

#: Nodes of the Gauss-Chebyshev rule: the storage modulus is exact to 1e-6 at the smallest spread.
_NODES = 120
#: Number of elements that represent the distribution in motions other than a steady cycle with two turning points.
_ELEMENTS = 120
#: Range of the distribution that the elements cover, in standard deviations to either side.
_COVERED = 4.5

_ANGLES = np.pi * np.arange(1, _NODES + 1) / (_NODES + 1)
#: Weight of each node, and the strain there over the strain amplitude.
_WEIGHTS, _STRAINS = 2.0 / (_NODES + 1) * np.sin(_ANGLES) ** 2, np.sin(0.5 * _ANGLES) ** 2


def _standard_strain(strain: Value, e_s: Value, spread: Value) -> Array:
    """Return z = ln(strain/e_s)/spread: a share Phi(z) of the elements yields below this strain, (..., n).

    Args:
        strain: tensor shear strain [1], (..., n); its ratio to e_s is raised to at least 1e-30.
        e_s: median yield strain [1].
        spread: standard deviation of the natural log of the yield strains [1].
    """
    return np.log(np.maximum(strain / e_s, 1e-30)) / spread


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of equal springs, each in series with a dry slider, whose yield strains are log-normal.

    Args:
        p: parameter values by name: modulus delta [Pa] of all springs at rest, median yield strain e_s [1], and spread
            [1], the standard deviation of the natural log of the yield strain.
        omega: not used, because the branch does not depend on the rate.
        strain: amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        Jenkins elements in parallel (W. D. Iwan, J. Appl. Mech. 34 (1967) 612), with the normal distribution function
        Phi and z(e) = ln(e/e_s)/spread. The tangent modulus of the first loading is delta Phi(-z), so Masing's loop has
        the storage modulus delta (2/pi) int_0^pi sin^2(t) Phi(-z(e0 sin^2(t/2))) dt, here by a Gauss-Chebyshev rule of
        the second kind. An element of stiffness k that yields at y < e0 loses 4 k y (e0 - y) per cycle; the mean over
        the distribution is a loss modulus (4 delta/pi) (g1 - g2), g_j = (e_s/e0)^j exp(j^2 spread^2/2) Phi(z(e0) -
        j spread).

    >>> modulus({"delta": 1e6, "e_s": 0.01, "spread": 1.0}, 1.0, np.array([1e-4, 0.01, 1.0])).round(-3)
    array([1000000.     +0.j,  762000.+119000.j,    5000. +20000.j])
    """
    spread = np.atleast_1d(p["spread"])
    ratio = np.maximum(strain / np.atleast_1d(p["e_s"]), 1e-30)
    # many points have the same strain, and many models the same spread: one integral for each distinct pair
    pairs, index = np.unique(ratio + 1j * spread, return_inverse=True)
    nodes = _standard_strain(pairs.real[:, None] * _STRAINS, 1.0, pairs.imag[:, None])
    storage = (ndtr(-nodes) @ _WEIGHTS)[index.reshape(np.broadcast_shapes(ratio.shape, spread.shape))]
    z = _standard_strain(ratio, 1.0, spread)
    first, second = (ratio**-j * np.exp(0.5 * (j * spread) ** 2) * ndtr(z - j * spread) for j in (1, 2))
    return p["delta"] * (storage + 4.0j / np.pi * (first - second))


def _first_loading(strain: Array, e_s: Value, spread: Value) -> Array:
    """Mean elastic strain of all elements, whose yield strains are log-normal, on first loading from rest.

    Args:
        strain: tensor shear strain reached from rest [1], (..., n).
        e_s: median yield strain [1].
        spread: standard deviation of the natural log of the yield strains [1].

    Returns:
        Mean elastic strain, the stress divided by 2 delta [1], (..., n).
    """
    z = _standard_strain(strain, e_s, spread)
    return strain * ndtr(-z) + e_s * np.exp(0.5 * spread**2) * ndtr(z - spread)


def stress(p: Values, history: History) -> Array:
    """Stress of equal springs, each in series with a dry slider, whose yield strains are log-normal.

    Args:
        p: parameter values by name: modulus delta [Pa] of all springs at rest, median yield strain e_s [1], and spread
            [1], the standard deviation of the natural log of the yield strain.
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        In a steady cycle with two turning points, each half of the loop is the first loading at twice its size (G.
        Masing, Proc. 2nd Int. Congr. Appl. Mech., 1926). For other motions 120 elements represent the distribution.
    """
    e_s, spread = np.atleast_1d(p["e_s"]), np.asarray(p["spread"])
    turning = history.strokes
    if history.periodic and turning.strides.shape[-1] == 2:
        sense = turning.at_samples(np.sign(turning.strides))
        branch = 2.0 * _first_loading(np.abs(turning.travel) / 2.0, e_s, spread)
        return 2.0 * p["delta"] * sense * (branch - _first_loading(history.amplitude, e_s, spread))
    edges = (np.arange(_ELEMENTS) + 0.5) / _ELEMENTS
    z = -_COVERED + (2.0 * _COVERED) * edges
    share = np.exp(-0.5 * z**2)
    yield_strain = e_s[..., None] * np.exp(spread[..., None] * z)
    mean_strain = parallel_elements(history, yield_strain, yield_strain * (share / share.sum()))
    return 2.0 * p["delta"] * mean_strain


def in_place_of(p: Values) -> list[dict[str, float]]:
    """Derive start values from the friction branch: equal modulus at zero strain and equal largest stress.

    Args:
        p: parameter values by name, with sigma_fmax [Pa] and eps_half [1] of the friction branch.

    Returns:
        One dictionary of delta [Pa], e_s [1] and spread [1] for each start.
    """
    at_rest = p["sigma_fmax"] / (2.0 * p["eps_half"])
    return [{"delta": at_rest, "e_s": p["eps_half"] * np.exp(-0.5 * width**2), "spread": width} for width in (1.0, 1.5)]
