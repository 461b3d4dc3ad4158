"""Friction branch: friction between filler particles, independent of rate, as a function of strain since the last turn.

Source: Garcia Tarrago et al. 2007, Eq. 5; M. Berg, Vehicle System Dynamics 30 (1998) 197-212.

Notes:
    With u = s_f / sigma_fmax, sgn = sign(de/dt) and d = |e - e_s| / eps_half counted from the last turning point
    (e_s, u_s), Eq. (5) reads u = u_s + sgn d v / (v + d), v = 1 - sgn u_s. Only d holds eps_half, and sigma_fmax is a
    factor. So u is computed from one turning point to the next.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bushfit.effects.contract import Array, History, Values

#: Below this z = 2x/(1 + y), Im h of `harmonic_shape` is taken from a series: the logarithm loses digits there.
_SERIES_BELOW = 0.05
#: Least x at which the logarithm is evaluated: smaller ones use the series, and must not divide by 0 meanwhile.
_LEAST_X = 0.01
#: Maximum number of Newton iterations for a steady loop; chosen: many more than are needed.
_ROUNDS = 50
#: Change of u, which is at most 1, below which Newton's method has converged: rounding.
_SETTLED = 1e-14
#: T(z) = (ln(1 + z) - z + z^2/2)/z^3 as a power series in z: enough terms for all digits below _SERIES_BELOW.
_SERIES = np.array([(-1.0) ** k / (k + 3.0) for k in range(12)])


def harmonic_shape(x: Array) -> Array:
    """Complex first harmonic h of the steady friction loop over its strain amplitude, dimensionless.

    Args:
        x: strain amplitude over eps_half, not negative, any shape.

    Returns:
        h, same shape; the friction modulus is (A + iB)/(2 e0) = sigma_fmax/eps_half h(x).

    Notes:
        h(0) = 1/2, and h -> 0 for large x. Differences of nearly equal terms are rearranged, so that h keeps ten digits
        from x = 1e-8 to 1e6.

            y = 2x/D, D = s + x + 1, s = sqrt(x^2 + 6x + 1)       friction amplitude over sigma_fmax
            p = 1 + y, q = sqrt(p (p + 2x)), z = 2x/p
            Re h = p^2 / ((x + p + q) q)
            Im h = (2 - p^2/x ln(1 + z)) / (pi x)
                 = (2 (D - 2)/D - 8x/p T(z)) / pi,  T = 1/3 - z/4 + z^2/5 - ...   (small z)

    >>> harmonic_shape(np.array([0.0, 1.0, 100.0])).round(4)
    array([0.5   +0.j    , 0.1974+0.0755j, 0.0016+0.0058j])
    """
    s = np.sqrt(x * (x + 6.0) + 1.0)
    big = s + x + 1.0
    p = 1.0 + 2.0 * x / big
    q, z = np.sqrt(p * (p + 2.0 * x)), 2.0 * x / p
    shape = np.empty(x.shape, dtype=complex)
    square = p * p
    shape.real = square / ((x + p + q) * q)
    far = np.maximum(x, _LEAST_X)
    shape.imag = (2.0 - square / far * np.log1p(z)) / (np.pi * far)
    small = z < _SERIES_BELOW
    if small.any():
        x, s, big, p, z = x[small], s[small], big[small], p[small], z[small]
        series = np.polynomial.polynomial.polyval(z, _SERIES)
        big_less_2 = x * (x + 6.0) / (s + 1.0) + x
        shape.imag[small] = (2.0 * big_less_2 / big - 8.0 * x / p * series) / np.pi
    return shape


def mean_stress_decay(x: Array) -> Array:
    """Decay per cycle of the mean friction stress from the start of a motion: ln(stress before/stress after).

    Args:
        x: strain amplitude over eps_half, e0/eps_half, any shape.

    Notes: each of the two strokes multiplies the stress by 1 - (z/(1 + z))^2, with z of `harmonic_shape`.

    >>> mean_stress_decay(np.array([0.01, 1.0])).round(4)
    array([8.000e-04, 8.406e-01])
    """
    z = 2.0 * x / (1.0 + 2.0 * x / (np.sqrt(x * (x + 6.0) + 1.0) + x + 1.0))
    return -2.0 * np.log1p(-np.square(z / (1.0 + z)))


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the filler friction, which falls with the strain amplitude and is independent of frequency.

    Args:
        p: parameter values by name: largest friction stress sigma_fmax [Pa], strain eps_half [1] that develops half.
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = (A + iB)/(2 e0) = sigma_fmax/eps_half h(e0/eps_half), with the in-phase and quadrature amplitudes A and B
        of the stress in the steady loop, and h of `harmonic_shape` (Garcia Tarrago et al. 2007, Eq. 5; Berg 1998).

    >>> modulus({"sigma_fmax": 2e4, "eps_half": 0.01}, 1.0, np.array([0.0, 0.01])).round()
    array([1000000.     +0.j,  394736.+151040.j])
    """
    return p["sigma_fmax"] / p["eps_half"] * harmonic_shape(strain / p["eps_half"])


def _stroke(start: Any, sign: Any, distance: Any) -> Any:
    """Friction stress u, relative to sigma_fmax, along one stroke, the motion between two turning points.

    Args:
        start: relative stress u_s at the turning point where the stroke begins.
        sign: +1 or -1, direction of the stroke.
        distance: strain d since the turning point, relative to eps_half, not negative.

    Notes:
        u = u_s + sign d v/(v + d), v = 1 - sign u_s, Eq. 5 of Garcia Tarrago et al. (2007).
    """
    room = 1.0 - sign * start
    return start + sign * distance * room / (room + distance)


def _strokes(senses: Sequence[Any], distances: Sequence[Any], u: Any) -> list[tuple[Any, Any]]:
    """Compute the friction stress u, relative to sigma_fmax, at the k + 1 turning points of k strokes.

    Args:
        senses: +1 or -1, direction of each stroke, (k,).
        distances: length of each stroke, relative to eps_half, (k,).
        u: relative stress at the first turning point.

    Returns:
        For each turning point: u, and its derivative with respect to the stress at the first turning point.

    Notes:
        du/du_s = 1 - (d/(v + d))^2 along a stroke, with d and v of `_stroke`.
    """
    path = [(u, 1.0 + 0.0 * u)]
    for sense, distance in zip(senses, distances, strict=True):
        start, memory = path[-1]
        share = distance / (1.0 - sense * start + distance)
        path.append((_stroke(start, sense, distance), (1.0 - share**2) * memory))
    return path


def _stress_at_turning_points(strides: Array, periodic: bool, eps_half: Array) -> Array:
    """Friction stress over sigma_fmax, u, at the start of each of k strokes, (..., k).

    Args:
        strides: signed change of strain in each stroke (see `Strokes`) [1], (..., k).
        periodic: True for a steady cycle, False for a motion from rest.
        eps_half: strain at which the friction stress is half of sigma_fmax [1], (..., 1).

    Notes:
        In a cycle of two strokes of length 2 e0, |u| = 2 x/(1 + x + sqrt(x^2 + 6 x + 1)) with x = e0/eps_half. With
        more strokes, Newton's method finds the u to which one cycle returns. A single motion uses floats, which are ten
        times as fast as arrays of one element.
    """
    scaled = strides / eps_half
    if strides.shape[-1] == 1 and periodic:  # at rest
        return np.zeros_like(scaled)
    if strides.shape[-1] == 2 and periodic:
        x = np.abs(scaled) / 2.0
        return -np.sign(scaled) * 2.0 * x / (np.sqrt(x * (x + 6.0) + 1.0) + x + 1.0)  # leads away from its start
    single = scaled.size == scaled.shape[-1]
    pieces = scaled.ravel() if single else np.moveaxis(scaled, -1, 0)
    signs, paths = (list[Any](value.tolist() if single else value) for value in (np.sign(pieces), np.abs(pieces)))
    u: Any = 0.0 if single else np.zeros_like(pieces[0])
    path = _strokes(signs, paths, u)
    for _ in range(_ROUNDS if periodic else 0):
        end, memory = path[-1]
        closer = np.clip(u + (end - u) / (1.0 - memory + (memory >= 1.0)), -1.0, 1.0)  # one at rest keeps all
        if np.all(np.abs(closer - u) < _SETTLED):
            break
        u = closer.item() if single else closer
        path = _strokes(signs, paths, u)
    return np.stack([u for u, _ in path[:-1]], axis=-1).reshape(scaled.shape)


def stress(p: Values, history: History) -> Array:
    """Stress of the friction branch.

    Args:
        p: parameter values by name: largest friction stress sigma_fmax [Pa], strain eps_half [1] that develops half.
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        u = u_s + sgn d v/(v + d), v = 1 - sgn u_s, with the stress u over sigma_fmax, its value u_s at the last turning
        point, the direction sgn of the motion, and the strain d since this point over eps_half (Garcia Tarrago et al.
        2007, Eq. 5; Berg 1998). From rest, or on the steady loop.

    >>> stress({"sigma_fmax": 2e4, "eps_half": 0.01}, History(np.array([0.01, 0.0, 0.01]), 1.0, False, 1.0)).round()
    array([10000., -2000.,  8476.])
    """
    turning, eps_half = history.strokes, np.atleast_1d(np.asarray(p["eps_half"], dtype=float))
    start = _stress_at_turning_points(turning.strides, history.periodic, eps_half)
    distance = np.abs(turning.travel) / eps_half
    return p["sigma_fmax"] * _stroke(turning.at_samples(start), np.sign(turning.travel), distance)
