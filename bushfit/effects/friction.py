"""Friction branch: friction between filler particles, of whatever rate, which depends on where the motion last turned.

Source: Garcia Tarrago et al. 2007, Eq. 5; M. Berg, Vehicle System Dynamics 30 (1998) 197-212.

Notes:
    With u = s_f / sigma_fmax, sgn = sign(de/dt) and d = |e - e_s| / eps_half counted from the last turning point
    (e_s, u_s), Eq. (5) reads u = u_s + sgn d v / (v + d), v = 1 - sgn u_s. Only d holds eps_half, and sigma_fmax is a
    factor. So u is computed from one turning point to the next, with its derivative by eps_half in closed form.
"""

from itertools import pairwise

import numpy as np

from bushfit.effects.contract import Array, History, Values

#: Below this z = 2x/(1 + y), Im h of `harmonic_shape` is taken from a series: the logarithm loses digits there.
_SERIES_BELOW = 0.05
#: Least x at which the logarithm is evaluated: smaller ones use the series, and must not divide by 0 meanwhile.
_LEAST_X = 0.01
#: Most rounds of Newton's method for a steady loop: chosen, many more than it takes.
_ROUNDS = 50
#: Change of u at which a steady loop is found, relative to its largest value 1: rounding.
_SETTLED = 1e-14
#: T(z) = (ln(1 + z) - z + z^2/2)/z^3 as a power series in z: enough terms for all digits below _SERIES_BELOW.
_SERIES = np.array([(-1.0) ** k / (k + 3.0) for k in range(12)])
#: dT/dz as a power series in z.
_SERIES_SLOPE = np.array([(k + 1) * (-1.0) ** (k + 1) / (k + 4.0) for k in range(11)])


def harmonic_shape(x: Array) -> Array:
    """First harmonic h of the steady friction loop at the strain amplitude x = e0/eps_half, complex.

    x is not negative, of any shape; the friction modulus is (A + iB)/(2 e0) = sigma_fmax/eps_half h(x).

    Notes:
        h(0) = 1/2, and h -> 0 for large x. Differences of nearly equal terms are rearranged, so that h keeps ten digits
        from x = 1e-8 to 1e6.

            y = 2x/D, D = s + x + 1, s = sqrt(x^2 + 6x + 1)       friction amplitude over sigma_fmax
            p = 1 + y, q = sqrt(p (p + 2x)), z = 2x/p
            Re h = p^2 / ((x + p + q) q)
            Im h = (2 - p^2/x ln(1 + z)) / (pi x)
                 = (2 (D - 2)/D - 8x/p T(z)) / pi,  T = 1/3 - z/4 + z^2/5 - ...   (small z)
    """
    s, big, p, q, z = _roots(x)
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


def harmonic_slope(x: Array, shape: Array) -> Array:
    """dh/dx of `harmonic_shape`, whose value at x is `shape`."""
    s, big, p, q, z = _roots(x)
    slope = np.empty(x.shape, dtype=complex)
    slope_p = 4.0 / (s * (x + 3.0 + s))
    slope_q = (slope_p * (p + x) + p) / q
    slope.real = shape.real * (2.0 * slope_p / p - (1.0 + slope_p + slope_q) / (x + p + q) - slope_q / q)
    far = np.maximum(x, _LEAST_X)
    ratio = p * p / far
    slope_ratio = (2.0 * p * slope_p - ratio) / far
    slope_z = (2.0 - z * slope_p) / p
    slope.imag = -((slope_ratio * np.log1p(z) + ratio * slope_z / (1.0 + z)) / np.pi + shape.imag) / far
    small = z < _SERIES_BELOW
    if small.any():
        x, s, big, p, z, slope_p = x[small], s[small], big[small], p[small], z[small], slope_p[small]
        series = np.polynomial.polynomial.polyval(z, _SERIES)
        slope_series = np.polynomial.polynomial.polyval(z, _SERIES_SLOPE) * (2.0 - z * slope_p) / p
        slope_big = (x + 3.0) / s + 1.0
        bend = (1.0 - x * slope_p / p) * series + x * slope_series
        slope.imag[small] = (4.0 * slope_big / big**2 - 8.0 / p * bend) / np.pi
    return slope


def _roots(x: Array) -> tuple[Array, Array, Array, Array, Array]:
    """s, D, p, q and z of `harmonic_shape`."""
    twice = 2.0 * x
    s = np.sqrt(x * (x + 6.0) + 1.0)
    big = s + x + 1.0
    p = 1.0 + twice / big
    return s, big, p, np.sqrt(p * (p + twice)), twice / p


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """(A + iB)/(2 e0) of the steady loop of strain amplitude e0 [Pa]."""
    return p["sigma_fmax"] / p["eps_half"] * harmonic_shape(strain / p["eps_half"])


def modulus_sensitivities(p: Values, omega: Array, strain: Array) -> dict[str, Array]:
    """d/dsigma_fmax = h/eps_half and d/deps_half = -sigma_fmax/eps_half^2 (h + x h')."""
    x = strain / p["eps_half"]
    shape = harmonic_shape(x)
    return {
        "sigma_fmax": shape / p["eps_half"],
        "eps_half": -p["sigma_fmax"] / p["eps_half"] ** 2 * (shape + x * harmonic_slope(x, shape)),
    }


def _move(start: Array, sign: float, distance: Array) -> tuple[Array, Array, Array]:
    """Eq. (5) from u_s = `start` over the distance d: u, du/du_s and du/dd."""
    room = 1.0 - sign * start
    reach = room + distance
    return (
        start + sign * distance * room / reach,
        1.0 - (distance / reach) ** 2,
        sign * (room / reach) ** 2,
    )


def _follow(strain: Array, turns: Array, start: Array, slope: Array, eps_half: Array) -> tuple[Array, Array]:
    """u and du/deps_half at every sample of a motion, from their values `start` and `slope` at the first one."""
    pieces, slopes = [start], [slope]
    for begin, end in pairwise([0, *turns, strain.shape[-1] - 1]):
        travel = strain[..., begin + 1 : end + 1] - strain[..., begin : begin + 1]
        distance = np.abs(travel) / eps_half
        path, by_start, by_distance = _move(start, np.sign(travel[..., -1:]), distance)
        path_slope = by_start * slope - by_distance * distance / eps_half
        pieces.append(path)
        slopes.append(path_slope)
        start, slope = path[..., -1:], path_slope[..., -1:]
    return np.concatenate(pieces, axis=-1), np.concatenate(slopes, axis=-1)


def _steady_start(levels: Array, eps_half: Array) -> tuple[Array, Array]:
    """u and du/deps_half at the first turning point of a cycle that repeats itself.

    Args:
        levels: strain at the turning points of the cycle, the first one its top, (..., k).
        eps_half: (..., 1).

    Notes:
        With two turning points u = y of `harmonic_shape`. With more, Newton's method finds the u that one cycle leads
        back to; the slope of one cycle is the product of the du/du_s of its pieces.
    """
    if levels.shape[-1] == 2:
        x = (levels[..., :1] - levels[..., 1:]) / (2.0 * eps_half)
        s = np.sqrt(x * (x + 6.0) + 1.0)
        return 2.0 * x / (s + x + 1.0), -4.0 * x / (s * (x + 3.0 + s) * eps_half)
    travel = np.roll(levels, -1, axis=-1) - levels
    senses, distances = np.sign(travel), np.abs(travel) / eps_half
    u = np.zeros((*distances.shape[:-1], 1))
    for _ in range(_ROUNDS):
        end, contraction, forced = u, np.ones_like(u), np.zeros_like(u)
        for i in range(levels.shape[-1]):
            distance = distances[..., i : i + 1]
            end, by_start, by_distance = _move(end, senses[..., i : i + 1], distance)
            forced = by_start * forced - by_distance * distance / eps_half
            contraction = contraction * by_start
        change = (end - u) / (1.0 - contraction)
        u = np.clip(u + change, -1.0, 1.0)
        if np.all(np.abs(change) < _SETTLED):
            break
    return u, forced / (1.0 - contraction)


def _walk(strain: Array, turns: Array, periodic: bool, eps_half: Array) -> tuple[Array, Array]:
    """u = s_f/sigma_fmax and du/deps_half along histories that turn at the same samples, (..., n).

    Args:
        strain, eps_half: (..., n), (..., 1); a steady cycle begins at its top and ends with its first sample again.
        turns: the samples at which all of them turn, (k,).
        periodic: whether they are steady, or start from rest.
    """
    zero = np.zeros((*np.broadcast_shapes(strain.shape[:-1], np.shape(eps_half)[:-1]), 1))
    if not periodic:
        return _follow(strain, turns, zero, zero, eps_half)
    if turns.size == 0:
        still = zero + np.zeros(strain.shape[-1])
        return still, still
    start, slope = _steady_start(strain[..., np.concatenate(([0], turns))], eps_half)
    return _follow(strain, turns, start, slope, eps_half)


def _walk_all(eps_half: Array, history: History) -> tuple[Array, Array]:
    """`_walk` for one history and many values of eps_half, or for many histories: all that turn alike in one call."""
    eps_half = np.atleast_1d(np.asarray(eps_half, dtype=float))
    turning, count = history.turning, history.value.shape[-1]
    if history.value.ndim == 1:
        both = _walk(turning.path[0], turning.turns[0], history.periodic, eps_half)
        u, slope = (one.take(turning.place[0], axis=-1) for one in both)
        return u, slope
    lead = np.broadcast_shapes(history.value.shape[:-1], eps_half.shape[:-1])
    row = np.broadcast_to(np.arange(turning.label.size).reshape(history.value.shape[:-1]), lead).ravel()
    scale = np.broadcast_to(eps_half, (*lead, 1)).reshape(-1, 1)
    u, slope = np.empty((row.size, count)), np.empty((row.size, count))
    for label, turns in enumerate(turning.turns):
        group = np.flatnonzero(turning.label[row] == label) if len(turning.turns) > 1 else np.arange(row.size)
        both = _walk(turning.path[row[group]], turns, history.periodic, scale[group])
        u[group], slope[group] = (turning.at_samples(one, row[group]) for one in both)
    return u.reshape(*lead, count), slope.reshape(*lead, count)


def stress(p: Values, history: History) -> Array:
    """s_f along the history (Eq. 5): from (0, 0) at rest, or on the steady loop [Pa]."""
    return p["sigma_fmax"] * _walk_all(p["eps_half"], history)[0]


def stress_sensitivities(p: Values, history: History) -> dict[str, Array]:
    """d/dsigma_fmax = u and d/deps_half = sigma_fmax du/deps_half."""
    u, slope = _walk_all(p["eps_half"], history)
    return {"sigma_fmax": u, "eps_half": p["sigma_fmax"] * slope}
