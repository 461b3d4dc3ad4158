"""Sliders: springs that slip one after the other, in place of the friction branch."""

from itertools import pairwise

import numpy as np

from bushfit.effects.contract import Array, History, Values

#: Sliders in parallel; chosen: over a decade of slip strains their steps are 0.2 % of the modulus.
_COUNT = 24
#: Where each slips, from -1 to 1 of the spread in the logarithm of strain.
_PLACES = (2.0 * np.arange(_COUNT) + 1.0) / _COUNT - 1.0


def _slips(p: Values) -> Array:
    """Strains at which the sliders slip, (..., 1, sliders)."""
    spread = np.asarray(p["spread"])[..., None] * _PLACES
    return np.asarray(p["e_s"])[..., None] * np.exp(spread)


def modulus(p: Values, omega: Array, strain: Array) -> Array:
    """(A + iB)/(2 e0): each slider of stress s and slip strain e_y gives, with cos t = 1 - 2 e_y/e0 beyond e_y,
    A = s/e_y e0 (t - sin(2 t)/2)/pi, B = 4 s/pi (1 - e_y/e0) [Pa]."""
    slip = _slips(p)
    share = np.minimum(slip / np.maximum(np.asarray(strain)[..., None], np.finfo(float).tiny), 1.0)
    turn = np.arccos(1.0 - 2.0 * share)
    shape = (turn - 0.5 * np.sin(2.0 * turn)) / np.pi + 4.0j / np.pi * share * (1.0 - share)
    return 0.5 * p["sigma"] * np.mean(shape / slip, axis=-1)


def _followed(path: Array, turns: Array, periodic: bool, slip: Array) -> Array:
    """Mean stress of the sliders over theirs along one path that turns at some samples, (n,); `slip` is (sliders,).

    On a steady cycle the path begins at its top, where every slider has the stress of half the range, or slips.
    """
    held = np.minimum(np.ptp(path) / (2.0 * slip), 1.0) if periodic else np.zeros(slip.size)
    pieces = [held.mean(keepdims=True)]
    for begin, end in pairwise([0, *turns.tolist(), path.size - 1]):
        along = np.clip(held + (path[begin + 1 : end + 1, None] - path[begin]) / slip, -1.0, 1.0)
        pieces.append(along.mean(axis=1))
        held = along[-1] if len(along) else held
    return np.concatenate(pieces)


def stress(p: Values, history: History) -> Array:
    """Sum of the sliders' stresses, elastic up to their slip strain and constant beyond, from rest or steady [Pa]."""
    turning, count = history.turning, history.value.shape[-1]
    slip = _slips(p)
    lead = np.broadcast_shapes(history.value.shape[:-1], slip.shape[:-2])
    rows = np.broadcast_to(np.arange(turning.label.size).reshape(history.value.shape[:-1]), lead).ravel()
    slips = np.broadcast_to(slip, (*lead, 1, _COUNT)).reshape(-1, _COUNT)
    mean = np.empty((rows.size, count))
    for place, (row, own) in enumerate(zip(rows, slips, strict=True)):
        path = _followed(turning.path[row], turning.turns[turning.label[row]], history.periodic, own)
        mean[place] = turning.at_samples(path[None], np.array([row]))[0]
    return p["sigma"] * mean.reshape(*lead, count)


def in_place_of(p: Values) -> dict[str, float]:
    """Where a fit begins that had friction before: the same stress, and half of it at the same strain."""
    return {"sigma": p["sigma_fmax"], "e_s": 2.0 * p["eps_half"], "spread": 1.5}
