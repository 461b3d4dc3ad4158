"""Sliders: springs that slip one after the other, in place of the friction branch.

Notes:
    Each takes the stress s at most, and slips at a strain e_y of its own. There are any number of them, as many in one
    part of a decade of e_y as in another, so that nothing jumps where one more slips: a mean over them is an integral
    over ln e_y from e_s/exp(spread) to e_s exp(spread).
"""

import numpy as np

from bushfit.effects.contract import Array, History, Value, Values

#: Sliders that stand for all of them along other motions than a steady one to and fro; chosen: over a decade of slip
#: strains their steps are 1e-4 of the modulus.
_COUNT = 100
#: Where each slips, from -1 to 1 of the spread in the logarithm of strain.
_PLACES = (2.0 * np.arange(_COUNT) + 1.0) / _COUNT - 1.0


def _ends(p: Values) -> tuple[Array, Array]:
    """Least and largest strain at which a slider slips."""
    middle, factor = np.atleast_1d(p["e_s"]), np.exp(np.asarray(p["spread"]))
    return middle / factor, middle * factor


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """Complex modulus of the springs with sliders.

    Args:
        p: values of sigma [Pa], e_s [1], spread [1].
        omega, strain: see `contract.Branch`.

    Returns:
        (..., n) [Pa].

    Notes:
        (A + iB)/(2 e0) [Pa] of the steady loop of strain amplitude e0.

        A slider that slips, r = e_y/e0 < 1 and cos t = 1 - 2r, gives A = s (t - sin(2t)/2)/(pi r) and B = 4 s (1 -
        r)/pi; one that does not gives A = s/r. Of these over e_y the integrals over ln e_y are (4 (t + sin t) - (t -
        sin(2t)/2)/r + 4i (ln r - r))/(pi e0) and -1/e_y.

    >>> modulus({"sigma": 2e4, "e_s": 0.01, "spread": 1.0}, 1.0, np.array([1e-3, 0.01, 0.1])).round(-3)
    array([1175000.     +0.j,  826000.+234000.j,   54000.+112000.j])
    """
    low, high = _ends(p)
    strain = np.maximum(strain, np.finfo(float).tiny)

    def slipping(end: Array) -> Array:
        r = np.minimum(end / strain, 1.0)
        t = np.arccos(1.0 - 2.0 * r)
        turned = 4.0 * (t + np.sin(t)) - (t - 0.5 * np.sin(2.0 * t)) / r
        return (turned + 4.0j * (np.log(r) - r)) / np.pi

    stuck = 1.0 / np.clip(strain, low, high) - 1.0 / high
    whole = (slipping(high) - slipping(low)) / strain + stuck
    return 0.5 * p["sigma"] / np.log(high / low) * whole


def _loaded(strain: Array, low: Value, high: Value) -> Array:
    """Mean of min(strain/e_y, 1): the stress of all sliders over the largest, loaded from rest."""
    slipped = np.clip(strain, low, high)
    return (np.log(slipped / low) + strain * (1.0 / slipped - 1.0 / high)) / np.log(high / low)


def stress(p: Values, history: History) -> Array:
    """Stress of the springs with sliders.

    Args:
        p: values of sigma [Pa], e_s [1], spread [1].
        history: see `contract.Branch`.

    Returns:
        (..., n) [Pa].

    Notes:
        Sum of the sliders' stresses, elastic up to their slip strain and constant beyond, from rest or steady.

        On a steady motion to and fro each branch of the loop is the first loading at twice its size (G. Masing, Proc.
        2nd Int. Congr. Appl. Mech., 1926). Along any other motion some sliders stand for all, each followed by itself.
    """
    turning = history.turning
    if history.periodic and turning.strides.shape[-1] == 2:  # to and fro
        low, high = _ends(p)
        sense = turning.at_samples(np.sign(turning.strides))
        extension = 2.0 * _loaded(np.abs(turning.travel) / 2.0, low, high) - _loaded(history.amplitude, low, high)
        return p["sigma"] * sense * extension
    slip = np.atleast_1d(p["e_s"])[..., None] * np.exp(np.asarray(p["spread"])[..., None] * _PLACES)
    return p["sigma"] * parallel_elements(history, slip, np.full(slip.shape, 1.0 / _COUNT))


def parallel_elements(history: History, yield_strain: Array, weights: Array) -> Array:
    """Weighted sum of the stresses of Jenkins elements, each over its largest.

    Args:
        history: strain over time, (..., n).
        yield_strain: strain at which each element yields, (..., 1, elements).
        weights: of the elements, same shape.

    Returns:
        Sum over the elements of weight times a stress between -1 and 1, (..., n).

    Notes:
        Along a piece between two turning points the sum is linear in the travel between the points at which an element
        yields.
    """
    turning = history.turning
    strides, travel = turning.strides[..., None], np.abs(turning.travel)
    longest = max(float(travel.max()), np.finfo(float).tiny)
    top = np.minimum(history.amplitude[..., None] / yield_strain, 1.0) if history.periodic else np.zeros((1, 1))
    start = np.empty(np.broadcast_shapes(strides.shape, yield_strain.shape))
    start[..., 0, :] = top[..., 0, :]
    for piece in range(1, strides.shape[-2]):
        extension = strides[..., piece - 1, :] / yield_strain[..., 0, :]
        start[..., piece, :] = np.clip(start[..., piece - 1, :] + extension, -1.0, 1.0)
    sense = np.sign(strides)
    yields_at = np.minimum(yield_strain * (1.0 - sense * start), longest)
    order = np.argsort(yields_at, axis=-1)
    yields_at = np.take_along_axis(yields_at, order, axis=-1)
    stiffness = np.take_along_axis(np.broadcast_to(weights / yield_strain, order.shape), order, axis=-1)
    elastic = stiffness[..., ::-1].cumsum(axis=-1)[..., ::-1]
    rise = np.cumsum(elastic * np.diff(yields_at, axis=-1, prepend=0.0), axis=-1)
    first, last = np.zeros((*order.shape[:-1], 1)), np.full((*order.shape[:-1], 1), longest)
    knots = np.concatenate((first, yields_at, last), axis=-1)
    stresses = np.sum(weights * start, axis=-1, keepdims=True) + sense * np.concatenate(
        (first, rise, rise[..., -1:]), axis=-1
    )
    # pieces one behind the other, so that one search finds the piece and the knot
    knots += 2.0 * longest * np.arange(order.shape[-2])[:, None]
    shape = np.broadcast_shapes(order.shape[:-2], travel.shape[:-1])
    position = np.broadcast_to(travel + 2.0 * longest * turning.piece, (*shape, travel.shape[-1]))
    rows = zip(
        position.reshape(-1, travel.shape[-1]),
        *(
            np.broadcast_to(array, (*shape, *array.shape[-2:])).reshape(position[..., 0].size, -1)
            for array in (knots, stresses)
        ),
        strict=True,
    )
    return np.array([np.interp(*row) for row in rows]).reshape(position.shape)


def in_place_of(p: Values) -> list[dict[str, float]]:
    """Start values from those of the friction branch: a wide range of slip strains, and a narrow one.

    A range that ends outside the tested strains has a minimum of its own.
    """
    return [
        {"sigma": p["sigma_fmax"], "e_s": 2.0 * p["eps_half"], "spread": 1.5},
        {"sigma": p["sigma_fmax"], "e_s": p["eps_half"], "spread": 0.75},
    ]
