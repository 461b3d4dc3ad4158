"""Friction branch: rate-independent filler friction between turning points (Berg's element).

With u = s_f / sigma_fmax, sgn = sign(de/dt) and d = |e - e_s| / eps_half counted from the last turning
point (e_s, u_s), Eq. (5) reads u = u_s + sgn d v / (v + d), v = 1 - sgn u_s. Only d holds eps_half, and
sigma_fmax is a factor, so the walk over turning points is short and differentiates in closed form.

Source: Garcia Tarrago et al. 2007, Eq. 5; M. Berg, Vehicle System Dynamics 30 (1998) 197-212.
"""

from __future__ import annotations

import numpy as np

from bushfit.effects.contract import Array, Branch, Level, Parameter, Values
from bushfit.effects.history import History

#: Below this 2x/(1+y) the logarithm of the quadrature is replaced by its series.
_SERIES_BELOW = 0.05
_SERIES = np.array([(-1.0) ** k / (k + 3.0) for k in range(12)])
_SERIES_SLOPE = np.array([(k + 1) * (-1.0) ** (k + 1) / (k + 4.0) for k in range(11)])


def harmonic_shape(x: Array) -> tuple[Array, Array]:
    """First harmonic of the steady friction loop and its derivative, both complex, as functions of x.

    The friction modulus is (A + iB)/(2 e0) = sigma_fmax/eps_half h(x) with x = e0/eps_half;
    h(0) = 1/2 and h -> 0 for large x. Returned are h and dh/dx, with the terms that cancel in model
    form written so that h keeps ten digits from x = 1e-8 to 1e6.

        y = 2x/D, D = s + x + 1, s = sqrt(x^2 + 6x + 1)       friction amplitude over sigma_fmax
        p = 1 + y, q = sqrt(p (p + 2x)), z = 2x/p
        Re h = p^2 / ((x + p + q) q)
        Im h = (2 - p^2/x ln(1 + z)) / (pi x)
             = (2 (D - 2)/D - 8x/p T(z)) / pi,  T = 1/3 - z/4 + z^2/5 - ...   (small z)
    """
    x = np.asarray(x, dtype=float)
    s = np.sqrt(x * (x + 6.0) + 1.0)
    big = s + x + 1.0
    big_less_2 = x * (x + 6.0) / (s + 1.0) + x
    slope_big = (x + 3.0) / s + 1.0
    p = 1.0 + 2.0 * x / big
    slope_p = 4.0 / (s * (x + 3.0 + s))
    q = np.sqrt(p * (p + 2.0 * x))
    slope_q = (slope_p * (p + x) + p) / q
    total = x + p + q
    real = p * p / (total * q)
    slope_real = real * (2.0 * slope_p / p - (1.0 + slope_p + slope_q) / total - slope_q / q)

    z = 2.0 * x / p
    slope_z = (2.0 - z * slope_p) / p
    near = np.minimum(z, _SERIES_BELOW)
    series = np.polynomial.polynomial.polyval(near, _SERIES)
    slope_series = np.polynomial.polynomial.polyval(near, _SERIES_SLOPE) * slope_z
    small = 2.0 * big_less_2 / big - 8.0 * x / p * series
    slope_small = 4.0 * slope_big / big**2 - 8.0 / p * ((1.0 - x * slope_p / p) * series + x * slope_series)
    far = np.where(z > _SERIES_BELOW, x, 1.0)
    ratio, log = p * p / far, np.log1p(2.0 * far / p)
    large = (2.0 - ratio * log) / far
    slope_ratio = (2.0 * p * slope_p - ratio) / far
    slope_large = (-slope_ratio * log - ratio * slope_z / (1.0 + 2.0 * far / p) - large) / far
    is_small = z <= _SERIES_BELOW
    imag = np.where(is_small, small, large) / np.pi
    slope_imag = np.where(is_small, slope_small, slope_large) / np.pi
    return real + 1j * imag, slope_real + 1j * slope_imag


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """(A + iB)/(2 e0) of the steady loop of strain amplitude e0 [Pa]."""
    shape, _ = harmonic_shape(strain / p["eps_half"])
    return p["sigma_fmax"] / p["eps_half"] * shape


def modulus_sensitivities(p: Values, omega: Array, strain: Array) -> dict[str, Array]:
    """d/dsigma_fmax = h/eps_half and d/deps_half = -sigma_fmax/eps_half^2 (h + x h')."""
    x = strain / p["eps_half"]
    shape, slope = harmonic_shape(x)
    return {
        "sigma_fmax": shape / p["eps_half"],
        "eps_half": -p["sigma_fmax"] / p["eps_half"] ** 2 * (shape + x * slope),
    }


def turning_points(value: Array) -> Array:
    """Indices of the samples at which the motion reverses; level stretches do not count, (k,)."""
    step = np.sign(np.diff(value))
    moving = np.flatnonzero(step)
    return moving[1:][step[moving[1:]] != step[moving[:-1]]]


def _move(start: Array, sign: float, distance: Array) -> tuple[Array, Array, Array]:
    """Eq. (5) from u_s over the scaled distance d: u, du/du_s and du/dd."""
    room = 1.0 - sign * start
    reach = room + distance
    return (
        start + sign * distance * room / reach,
        1.0 - (distance / reach) ** 2,
        sign * (room / reach) ** 2,
    )


def _follow(strain: Array, reversals: Array, start: Array, slope: Array, eps_half: Array) -> tuple[Array, Array]:
    """u and du/deps_half of every sample, from the value `start` (and its slope) of the first one."""
    ends = np.concatenate((reversals, [strain.size - 1]))
    begins = np.concatenate(([0], reversals))
    pieces, slopes = [start], [slope]
    for begin, end in zip(begins, ends, strict=True):
        sign = float(np.sign(strain[end] - strain[begin]))
        distance = np.abs(strain[begin + 1 : end + 1] - strain[begin]) / eps_half
        path, by_start, by_distance = _move(start, sign, distance)
        path_slope = by_start * slope - by_distance * distance / eps_half
        pieces.append(path)
        slopes.append(path_slope)
        start, slope = path[..., -1:], path_slope[..., -1:]
    return np.concatenate(pieces, axis=-1), np.concatenate(slopes, axis=-1)


def _steady_start(levels: Array, eps_half: Array) -> tuple[Array, Array]:
    """u and du/deps_half at the first of the closed sequence of turning points, once it repeats itself.

    Newton on the map of one cycle: its slope is the product of the du/du_s of the pieces.
    """
    u = np.zeros(np.shape(eps_half))
    forced = np.zeros_like(u)
    for _ in range(50):
        end, contraction, forced = u, np.ones_like(u), np.zeros_like(u)
        for begin, stop in zip(levels, np.roll(levels, -1), strict=True):
            distance = np.abs(stop - begin) / eps_half
            end, by_start, by_distance = _move(end, float(np.sign(stop - begin)), distance)
            forced = by_start * forced - by_distance * distance / eps_half
            contraction = contraction * by_start
        change = (end - u) / (1.0 - contraction)
        u = np.clip(u + change, -1.0, 1.0)
        if np.all(np.abs(change) < 1e-14):
            break
    return u, forced / (1.0 - contraction)


def _walk(strain: Array, periodic: bool, eps_half: Array) -> tuple[Array, Array]:
    """u = s_f/sigma_fmax and du/deps_half along one history, (..., n)."""
    zero = np.zeros(np.shape(eps_half))
    if not periodic:
        with_rest = np.concatenate(([0.0], strain))
        u, slope = _follow(with_rest, turning_points(with_rest), zero, zero, eps_half)
        return u[..., 1:], slope[..., 1:]
    top = int(np.argmax(strain))
    cycle = np.roll(strain, -top)
    closed = np.append(cycle, cycle[0])
    reversals = turning_points(closed)
    if reversals.size == 0:
        return np.zeros((*np.shape(eps_half)[:-1], strain.size)), np.zeros((*np.shape(eps_half)[:-1], strain.size))
    start, slope = _steady_start(closed[np.concatenate(([0], reversals))], eps_half)
    u, slopes = _follow(closed, reversals, start, slope, eps_half)
    return np.roll(u[..., :-1], top, axis=-1), np.roll(slopes[..., :-1], top, axis=-1)


def _walk_all(eps_half: Array, history: History) -> tuple[Array, Array]:
    """The walk for one history under many values, or for a stack of histories row by row."""
    eps_half = np.atleast_1d(np.asarray(eps_half, dtype=float))
    if history.value.ndim == 1:
        return _walk(history.value, history.periodic, eps_half)
    lead = np.broadcast_shapes(history.value.shape[:-1], eps_half.shape[:-1])
    strain = np.broadcast_to(history.value, (*lead, history.value.shape[-1]))
    scale = np.broadcast_to(eps_half, (*lead, 1))
    both = np.array([_walk(strain[i], history.periodic, scale[i]) for i in np.ndindex(lead)])
    return both[:, 0].reshape(strain.shape), both[:, 1].reshape(strain.shape)


def stress(p: Values, history: History) -> Array:
    """s_f along the history (Eq. 5): from (0, 0) at rest, or on the steady loop [Pa]."""
    return p["sigma_fmax"] * _walk_all(p["eps_half"], history)[0]


def stress_sensitivities(p: Values, history: History) -> dict[str, Array]:
    u, slope = _walk_all(p["eps_half"], history)
    return {"sigma_fmax": u, "eps_half": p["sigma_fmax"] * slope}


EFFECT = Branch(
    name="friction",
    sentence="Friction between filler particles: stiffness falls with amplitude, loss does not depend on rate.",
    equation="(A + iB)/(2 e0), A and B of sigma_fmax and e0/eps_half",
    level=Level.MATERIAL,
    parameters=(
        Parameter("sigma_fmax", "Pa", (1.0, 1e8), 0.0, 1e4, log=True, meaning="largest friction stress"),
        Parameter("eps_half", "1", (1e-6, 10.0), None, 1e-2, log=True, meaning="strain at half of sigma_fmax"),
    ),
    source="Garcia Tarrago et al. 2007, Eq. 5; Berg 1998",
    modulus=modulus,
    stress=stress,
    modulus_sensitivities=modulus_sensitivities,
    stress_sensitivities=stress_sensitivities,
)
