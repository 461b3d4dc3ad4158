"""Sliders: springs that slip one after the other, in place of the friction branch."""

import numpy as np

from bushfit.effects.contract import Array, Values
from bushfit.effects.history import History

#: Sliders in parallel; chosen: over a decade of slip strains their steps are 0.2 % of the modulus.
_COUNT = 24
#: Where each slips, from -1 to 1 of the spread in the logarithm of strain.
_PLACES = (2.0 * np.arange(_COUNT) + 1.0) / _COUNT - 1.0


def _slips(p: Values) -> Array:
    """Strains at which the sliders slip, (..., 1, sliders)."""
    spread = np.asarray(p["spread"])[..., None] * _PLACES
    return np.atleast_1d(p["e_s"])[..., None] * np.exp(spread)


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """(A + iB)/(2 e0): each slider of stress s and slip strain e_y gives, with cos t = 1 - 2 e_y/e0 beyond e_y,
    A = s/e_y e0 (t - sin(2 t)/2)/pi, B = 4 s/pi (1 - e_y/e0) [Pa]."""
    slip = _slips(p)
    share = np.minimum(slip / np.maximum(np.asarray(strain)[..., None], np.finfo(float).tiny), 1.0)
    turn = np.arccos(1.0 - 2.0 * share)
    shape = (turn - 0.5 * np.sin(2.0 * turn)) / np.pi + 4.0j / np.pi * share * (1.0 - share)
    return 0.5 * p["sigma"] * np.mean(shape / slip, axis=-1)


def stress(p: Values, history: History) -> Array:
    """Sum of the sliders' stresses, elastic up to their slip strain and constant beyond, from rest or steady [Pa].

    On a steady cycle the motion begins at its top, where every slider has the stress of half the range, or slips.
    """
    turning, slip = history.turning, _slips(p)
    strides = turning.strides[..., None] / slip
    top = np.minimum(history.amplitude[..., None] / slip, 1.0) if history.periodic else np.zeros((1, 1))
    held = np.empty_like(strides)
    held[..., 0, :] = top[..., 0, :]
    for piece in range(1, strides.shape[-2]):
        held[..., piece, :] = np.clip(held[..., piece - 1, :] + strides[..., piece - 1, :], -1.0, 1.0)
    start = np.moveaxis(turning.at_samples(np.moveaxis(held, -1, 0)), 0, -1)
    return p["sigma"] * np.clip(start + turning.travel[..., None] / slip, -1.0, 1.0).mean(axis=-1)


def in_place_of(p: Values) -> dict[str, float]:
    """Where a fit begins that had friction before: the same stress, and half of it at the same strain."""
    return {"sigma": p["sigma_fmax"], "e_s": 2.0 * p["eps_half"], "spread": 1.5}
