"""A fit that goes step by step: so that several can go side by side, and one that cannot win is left on its way.

Levenberg-Marquardt, damped as Nielsen does (Damping parameter in Marquardt's method, IMM-REP-1999-05, Lyngby 1999),
bounds as walls: what a step would carry beyond one stays there, and the others go on without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.fitting.data_sets import DataSet
from bushfit.fitting.solve import (
    Bounds,
    Coordinates,
    Solution,
    at_bound,
    jacobian,
    no_finite_response,
    opening,
    residual,
)
from bushfit.model.model import Model

#: Share of the curvature that damps the first step, and by how much less it damps the next at best.
_DAMPING, _EASED = 1e-3, 1.0 / 3.0
#: Most that one step may change the logarithm of a parameter: further out no linear model is worth a trial.
_LONGEST = 2.0
#: Share of the promised fall of chi-square that a step must bring.
_WORTH = 1e-4
#: Curvature below this, relative to the largest, is the noise of the derivatives.
_FLAT = 1e-10
#: A step that promises less than this, in units of the misfit's variance, is the last: a tenth of a standard error.
_SETTLED = 0.01
#: A parameter that moves the residuals by less than the root of this is not seen there, such as the shape of an effect
#: of no amount.
_SEEN = 1e-6
#: How far inside a bound a wall stands, relative to the room: the way there and back rounds.
_INSIDE = 1e-12


@dataclass(frozen=True, eq=False)
class Descent:
    """A fit on its way: where it is, how cautious it goes, and whether it has settled.

    Args:
        model: the best so far.
        data_sets: the data.
        coordinates: in which it moves.
        low, high: walls, (k,) each.
        point: where the model lies, (k,).
        residual: there, (n,).
        jacobian: derivatives of the residual by coordinate there, (k, n).
        evaluations: of the model so far.
        settled: whether it is at its end.
        damping: of the next step, relative to the curvature.
        growth: of the damping, should that step fail.
    """

    model: Model
    data_sets: Sequence[DataSet]
    coordinates: Coordinates
    low: Array
    high: Array
    point: Array
    residual: Array
    jacobian: Array
    evaluations: int = 1
    settled: bool = False
    damping: float = _DAMPING
    growth: float = 2.0

    @classmethod
    def start(cls, model: Model, data_sets: Sequence[DataSet], names: Sequence[str], bounds: Bounds) -> Descent:
        """A fit of the named parameters, the others held, at the model's own values.

        Raises:
            FitError: fewer data than parameters, or no finite response.
            ModelError: no response.
        """
        coordinates, point, low, high = opening(model, data_sets, names, bounds)
        inside = _INSIDE * (high - low)
        low, high = low + inside, high - inside
        point = np.clip(point, low, high)
        model = model.with_values(coordinates.values(point))
        begun, slopes = residual(model, data_sets), jacobian(model, data_sets, names)
        if not np.all(np.isfinite(begun)) or not np.all(np.isfinite(slopes)):
            raise no_finite_response(model)
        return cls(model, data_sets, coordinates, low, high, point, begun, slopes)

    @property
    def chi_square(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def promise(self) -> float:
        """How far chi-square would yet fall were the model linear."""
        return max(self._way(0.0)[1], 0.0)

    @property
    def solution(self) -> Solution:
        ends = at_bound(self.coordinates.names, self.point, self.low, self.high)
        return Solution(
            self.model, self.coordinates, self.residual, self.jacobian, self.evaluations, ends, not self.settled
        )

    def stepped(self) -> Descent:
        """One step on: further where it brings a fair share of what it promises, else more cautious where it was."""
        damping = self.damping
        step, promise = self._way(damping)
        while promise < 0.0:  # so far out between the walls that only caution leads down
            damping *= 2.0
            step, promise = self._way(damping)
        point = np.clip(self.point + step, self.low, self.high)
        evaluations, settled = self.evaluations + 1, promise < _SETTLED * self._variance
        cautious = replace(
            self, evaluations=evaluations, settled=settled, damping=damping * self.growth, growth=2.0 * self.growth
        )
        try:
            model = self.model.with_values(self.coordinates.values(point))
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                reached = residual(model, self.data_sets)
                fall = self.chi_square - float(reached @ reached)
                if not fall > _WORTH * promise:
                    return cautious
                # what is left of a last step is too short for the derivatives to change
                slopes = self.jacobian if settled else jacobian(model, self.data_sets, self.coordinates.names)
        except ModelError:  # no response there
            return cautious
        if not np.all(np.isfinite(slopes)):
            return cautious
        eased = damping * max(_EASED, 1.0 - (2.0 * fall / promise - 1.0) ** 3)
        return replace(
            self,
            model=model,
            point=point,
            residual=reached,
            jacobian=slopes,
            evaluations=evaluations,
            settled=settled,
            damping=eased,
            growth=2.0,
        )

    def finished(self, evaluations: int) -> Descent:
        """At its end, or where so many evaluations of the model have led."""
        here = self
        while not here.settled and here.evaluations < evaluations:
            here = here.stepped()
        return here

    @cached_property
    def _logs(self) -> Array:
        return np.array([parameter.log for parameter in self.coordinates.parameters], dtype=bool)

    @property
    def _variance(self) -> float:
        """Mean square residual, at least that of noise alone."""
        return max(self.chi_square / self.residual.size, 1.0)

    @cached_property
    def _normal(self) -> tuple[Array, Array]:
        return self.jacobian @ self.jacobian.T, self.jacobian @ self.residual

    def _way(self, damping: float) -> tuple[Array, float]:
        """The damped step between the walls, and the fall of chi-square that it promises."""
        curvature, slope = self._normal
        size = np.diag(curvature)
        longest = np.where(self._logs, _LONGEST, np.inf)
        low, high = np.maximum(self.low, self.point - longest), np.minimum(self.high, self.point + longest)
        damped = curvature + np.diag(damping * size)
        outward = ((self.point <= self.low) & (slope >= 0.0)) | ((self.point >= self.high) & (slope <= 0.0))
        free, step = (size > _SEEN) & ~outward, np.zeros_like(slope)
        while free.any():
            scale = np.sqrt(size[free])
            own = damped[np.ix_(free, free)] / np.outer(scale, scale)
            pull = slope[free] + damped[np.ix_(free, ~free)] @ step[~free]
            step[free] = -np.linalg.lstsq(own, pull / scale, rcond=_FLAT)[0] / scale
            aim = self.point + step
            beyond = free & ((aim < low) | (aim > high))
            if not beyond.any():
                break
            step[beyond] = (np.clip(aim, low, high) - self.point)[beyond]
            free &= ~beyond
        return step, float(-(2.0 * slope + curvature @ step) @ step)
