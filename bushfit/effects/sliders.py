"""Sliders: springs that slip one after the other, in place of the friction branch.

Notes:
    Each slider has the same largest stress s and its own slip strain e_y. The slip strains are distributed uniformly in
    ln e_y from e_s/exp(spread) to e_s exp(spread), so that the response is smooth; means over the sliders are integrals
    over ln e_y.
"""

import numpy as np

from bushfit.effects.contract import Array, History, Value, Values

#: Number of sliders in motions other than a steady cycle with two turning points; chosen: over a decade of slip strains
#: the error is 1e-4 of the modulus.
_COUNT = 100
#: Largest number of strokes times elements whose stresses are computed at a time; chosen: they take some 50 MB.
_BLOCK = 1 << 19
#: Logarithm of the slip strain of each slider relative to e_s, in units of the spread (-1 to 1).
_PLACES = (2.0 * np.arange(_COUNT) + 1.0) / _COUNT - 1.0


def _ends(p: Values) -> tuple[Array, Array]:
    """Smallest and largest slip strain of the sliders [1]: e_s/exp(spread) and e_s exp(spread), of any shape."""
    middle, factor = np.atleast_1d(p["e_s"]), np.exp(np.asarray(p["spread"]))
    return middle / factor, middle * factor


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of springs in series with dry sliders, whose slip strains are log-uniform.

    Args:
        p: parameter values by name: largest stress sigma [Pa] of all sliders, slip strain e_s [1] of the middle slider,
            and spread [1], natural log of the largest over the middle slip strain.
        omega, strain: angular frequency [rad/s] and amplitude e0 of the tensor shear strain e = gamma/2 [1], (..., n).

    Returns:
        Complex modulus of the first harmonic [Pa], (..., n).

    Notes:
        mu^ = (A + iB)/(2 e0), with the in-phase and quadrature amplitudes A and B of the stress in the steady loop (L.
        Prandtl 1928, W. D. Iwan 1966).

        A slider of largest stress s that slips at the strain e_y, with r = e_y/e0 < 1 and cos t = 1 - 2r, has
        A = s (t - sin(2t)/2)/(pi r) and B = 4 s (1 - r)/pi; one that does not slip has A = s/r. The integrals of these,
        divided by s e0, over ln e_y are (4 (t + sin t) - (t - sin(2t)/2)/r + 4i (ln r - r))/(pi e0) and -1/e_y.

    >>> modulus({"sigma": 2e4, "e_s": 0.01, "spread": 1.0}, 1.0, np.array([1e-3, 0.01, 0.1])).round(-3)
    array([1175000.     +0.j,  826000.+234000.j,   54000.+112000.j])
    """
    low, high = _ends(p)
    strain = np.maximum(strain, np.finfo(float).tiny)

    def slipping_integral(end: Array) -> Array:
        """Integral of (A + iB) e0/s over ln e_y up to the slip strain `end`, for the sliders that slip (`end` < e0)."""
        r = np.minimum(end / strain, 1.0)
        t = np.arccos(1.0 - 2.0 * r)
        turned = 4.0 * (t + np.sin(t)) - (t - 0.5 * np.sin(2.0 * t)) / r
        return (turned + 4.0j * (np.log(r) - r)) / np.pi

    stuck = 1.0 / np.clip(strain, low, high) - 1.0 / high
    whole = (slipping_integral(high) - slipping_integral(low)) / strain + stuck
    return 0.5 * p["sigma"] / np.log(high / low) * whole


def _first_loading(strain: Array, low: Value, high: Value) -> Array:
    """Stress of the sliders on first loading from rest, over their largest stress: mean of min(strain/e_y, 1).

    Args:
        strain: tensor shear strain reached from rest [1], (..., n).
        low, high: smallest and largest slip strain e_y [1]; ln e_y is uniform between them.
    """
    slipped = np.clip(strain, low, high)
    return (np.log(slipped / low) + strain * (1.0 / slipped - 1.0 / high)) / np.log(high / low)


def stress(p: Values, history: History) -> Array:
    """Stress of springs in series with dry sliders, whose slip strains are log-uniform.

    Args:
        p: parameter values by name: largest stress sigma [Pa] of all sliders, slip strain e_s [1] of the middle slider,
            and spread [1], natural log of the largest over the middle slip strain.
        history: tensor shear strain e = gamma/2 over time [1], (..., n).

    Returns:
        Stress at each sample [Pa], (..., n).

    Notes:
        Mean of the sliders' stresses, which are elastic up to the slip strain and constant beyond.

        In a steady cycle with two turning points, each half of the loop is the first loading at twice its size (G.
        Masing, Proc. 2nd Int. Congr. Appl. Mech., 1926). For other motions 100 sliders represent the distribution.
    """
    turning = history.strokes
    if history.periodic and turning.strides.shape[-1] == 2:  # to and fro
        low, high = _ends(p)
        sense = turning.at_samples(np.sign(turning.strides))
        extension = 2.0 * _first_loading(np.abs(turning.travel) / 2.0, low, high) - _first_loading(
            history.amplitude, low, high
        )
        return p["sigma"] * sense * extension
    slip = np.atleast_1d(p["e_s"])[..., None] * np.exp(np.asarray(p["spread"])[..., None] * _PLACES)
    return p["sigma"] * parallel_elements(history, slip, np.full(slip.shape, 1.0 / _COUNT))


def parallel_elements(history: History, yield_strain: Array, weights: Array) -> Array:
    """Weighted sum of the stresses of Jenkins elements (spring and slider in series), relative to their yield stress.

    Args:
        history: tensor shear strain e = gamma/2 over time [1], (..., n).
        yield_strain: strain at which each element yields, (..., 1, elements).
        weights: weights of the elements, same shape as yield_strain.

    Returns:
        Sum over the elements of weight times a stress between -1 and 1, (..., n).

    Notes:
        Between two turning points the sum is piecewise linear in the travel, with a knot where an element yields.
    """
    turning = history.strokes
    strides, travel = turning.strides[..., None], np.abs(turning.travel)
    longest = max(float(travel.max()), np.finfo(float).tiny)
    leading = np.broadcast_shapes(strides.shape[:-2], yield_strain.shape[:-2])
    shape = np.broadcast_shapes((*leading, 1), travel.shape)
    travels, pieces = (np.broadcast_to(row, shape).reshape(-1, shape[-1]) for row in (travel, turning.piece))
    stress = np.empty(travels.shape)
    state = np.minimum(history.amplitude / yield_strain[..., 0, :], 1.0) if history.periodic else 0.0
    count = max(1, _BLOCK // (int(np.prod(leading)) * yield_strain.shape[-1]))
    for first in range(0, strides.shape[-2], count):
        block = strides[..., first : first + count, :]
        start = np.empty((*leading, block.shape[-2], yield_strain.shape[-1]))
        for piece in range(block.shape[-2]):
            start[..., piece, :] = state
            state = np.clip(state + block[..., piece, :] / yield_strain[..., 0, :], -1.0, 1.0)
        sense = np.sign(block)
        yields_at = np.minimum(yield_strain * (1.0 - sense * start), longest)
        order = np.argsort(yields_at, axis=-1)
        yields_at = np.take_along_axis(yields_at, order, axis=-1)
        stiffness = np.take_along_axis(np.broadcast_to(weights / yield_strain, order.shape), order, axis=-1)
        elastic = stiffness[..., ::-1].cumsum(axis=-1)[..., ::-1]
        rise = np.cumsum(elastic * np.diff(yields_at, axis=-1, prepend=0.0), axis=-1)
        nothing, whole = np.zeros((*order.shape[:-1], 1)), np.full((*order.shape[:-1], 1), longest)
        knots = np.concatenate((nothing, yields_at, whole), axis=-1)
        stresses = np.sum(weights * start, axis=-1, keepdims=True) + sense * np.concatenate(
            (nothing, rise, rise[..., -1:]), axis=-1
        )
        # pieces one behind the other, so that one search finds the piece and the knot
        knots += 2.0 * longest * np.arange(order.shape[-2])[:, None]
        tables = (
            np.broadcast_to(array, (*shape[:-1], *array.shape[-2:])).reshape(len(travels), -1)
            for array in (knots, stresses)
        )
        for row, xp, fp in zip(range(len(travels)), *tables, strict=True):
            mask = (pieces[row] >= first) & (pieces[row] < first + count)
            position = travels[row, mask] + 2.0 * longest * (pieces[row, mask] - first)
            stress[row, mask] = np.interp(position, xp, fp)
    return stress.reshape(shape)


def in_place_of(p: Values) -> list[dict[str, float]]:
    """Derive start values of two fits from the friction branch: a wide and a narrow range of slip strains.

    One start may lead to a local minimum in which the range extends beyond the tested strains.

    Args:
        p: parameter values by name, with sigma_fmax [Pa] and eps_half [1] of the friction branch.

    Returns:
        One dictionary of sigma [Pa], e_s [1] and spread [1] for each start.
    """
    return [
        {"sigma": p["sigma_fmax"], "e_s": 2.0 * p["eps_half"], "spread": 1.5},
        {"sigma": p["sigma_fmax"], "e_s": p["eps_half"], "spread": 0.75},
    ]
