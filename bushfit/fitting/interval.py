"""The search for the ends of a profile-likelihood interval, by lmfit."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import lmfit
import numpy as np

#: Where the best value stands, in steps: lmfit's tolerance is relative to what it finds, and so a small part of a step.
_ORIGIN = 2.0
_MOST_STEPS = 200
#: What lmfit takes for the probability at which an interval ends.
_END = 0.95


class _Others(lmfit.Minimizer):  # type: ignore[misc]  # lmfit has no types
    """A minimizer that has one parameter held, for its search, and fits the others in its own way."""

    def __init__(self, share: Callable[[float], float], parameters: lmfit.Parameters) -> None:
        super().__init__(lambda _: 0.0, parameters)
        self._share = share

    def leastsq(self, *_: Any, **__: Any) -> float:
        return self._share(self.params["held"].value - _ORIGIN)


def ends(share: Callable[[float], float], least: float, most: float) -> tuple[float | None, float | None]:
    """Where a profile ends to either side of the best value, by `lmfit.conf_interval`: it goes out in steps, and then
    looks between the last two.

    Args:
        share: of the distance from the best value, in first steps, to the root of the rise of chi-square over what is
            allowed, the others fitted anew.
        least: distance of the lower bound, and
        most: of the upper one, in first steps.

    Returns:
        Distances; None where the profile is open to that side, up to the bound or as far as so many steps reach.
    """
    parameters = lmfit.Parameters()
    parameters.add("held", value=_ORIGIN, min=_ORIGIN + least, max=_ORIGIN + most)
    parameters.add("others", value=0.0)  # lmfit asks for two
    parameters["held"].stderr = 1.0
    with warnings.catch_warnings(), np.errstate():  # which lmfit leaves changed where a fit fails
        warnings.simplefilter("ignore", UserWarning)  # its word for an open side
        (_, low), _, (_, high) = lmfit.conf_interval(
            _Others(share, parameters),
            SimpleNamespace(params=parameters, chisqr=0.0),
            p_names=["held"],
            sigmas=[_END],
            maxiter=_MOST_STEPS,
            prob_func=lambda _, reached: _END * reached,
            min_rel_change=-np.inf,
        )["held"]
    return _distance(low), _distance(high)


def _distance(end: float) -> float | None:
    return float(end) - _ORIGIN if np.isfinite(end) else None
