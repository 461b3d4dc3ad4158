"""A least-squares fit that goes step by step: several can go side by side, and one that cannot win be stopped.

Every fit is made so but those of the paper's own procedure, which lmfit makes, see `solve`.

Notes:
    Levenberg-Marquardt, damped as Nielsen does (Damping parameter in Marquardt's method, IMM-REP-1999-05, Lyngby
    1999), with bounds: what a step would carry beyond one stays there, and the others go on without it.

    Parameters that trade off make chi-square a narrow valley with a bend, in which straight steps creep. So a step that
    goes on as the last one went follows the bend which the derivatives showed over that one: geodesic acceleration
    (M. K. Transtrum, J. P. Sethna, arXiv:1201.5885, 2012), at no evaluation more. On four campaigns with gaps that no
    effect closes, it took 4 to 29 % off all evaluations of the diagnosis.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError, ModelError
from bushfit.fitting.coordinates import (
    ROUNDING,
    Bounds,
    Coordinates,
    Solution,
    at_bound,
    jacobian,
    residual,
    starting_point,
)
from bushfit.fitting.preparation import MeasuredTest
from bushfit.model.model import Model

#: Damping of the first step, relative to the curvature: next to none, the starts are good (usual for such methods).
_FIRST_DAMPING = 1e-3
#: Factor on the damping after a step that brought all it promised (Nielsen).
_LEAST_DAMPING_RATIO = 1.0 / 3.0
#: Factor on the damping after a step that failed; it doubles with each failure in a row (Nielsen).
_FIRST_GROWTH = 2.0
#: Longest step of a parameter's logarithm: further out no linear model is worth a trial.
_LONGEST_STEP = 2.0
#: Least fall of chi-square with which a step is taken, relative to the fall expected (usual for such methods).
_LEAST_GAIN_RATIO = 1e-4
#: Cosine between a step and the last one, in units of noise, from which it goes on as that one went: chosen.
_SAME_WAY = 0.8
#: Share of a step's length that its bend may have, both in units of noise; chosen: further on the way bends otherwise,
#: and nearly all steps fail.
_MOST_BENT = 0.2
#: A step that is expected to lower chi-square by less is the last, unless told otherwise: a tenth of a standard error,
#: however large the misfit, as it is in units of noise that models are compared.
_LEAST_FALL = 0.01
#: Least squared norm of a parameter's derivatives, in units of noise, with which it moves: the shape of an effect of
#: no amount stays.
_LEAST_SENSITIVITY = 1e-6
#: Distance of the point from a bound at the least, relative to the room between the bounds: the way between values and
#: coordinates rounds.
_INSIDE = 1e-12


@dataclass(frozen=True, eq=False)
class Descent:
    """A fit under way, which never climbs; its model is the best so far.

    Args:
        low, high: bounds, (k,) each.
        point: where the model lies, (k,).
        residual: whitened, of that model, (n,).
        jacobian: its derivatives by coordinate, (k, n).
        tolerance: relative fall of chi-square, a step that is expected to bring less is the last; None for one that
            models are compared by.
        damping: of the next step, relative to the curvature.
        growth: factor on the damping should that step fail.
        last: the step that led here, (k,), and the second derivative of the residuals along it, (n,); None at first.
    """

    model: Model
    data_sets: Sequence[MeasuredTest]
    coordinates: Coordinates
    low: Array
    high: Array
    point: Array
    residual: Array
    jacobian: Array
    tolerance: float | None = None
    evaluations: int = 1
    converged: bool = False
    damping: float = _FIRST_DAMPING
    growth: float = _FIRST_GROWTH
    last: tuple[Array, Array] | None = None

    @classmethod
    def start(
        cls,
        model: Model,
        data_sets: Sequence[MeasuredTest],
        names: Sequence[str],
        bounds: Bounds,
        tolerance: float | None = None,
    ) -> "Descent":
        """A fit of the named parameters, the others held, that has not yet left the model's own values.

        Args:
            model: model with the start values.
            data_sets: tests.
            names: parameters to fit.
            bounds: limits inside the parameters' own [SI].
            tolerance: relative fall of chi-square at which the fit ends; None for models that are compared.

        Returns:
            The fit before its first step.

        Raises:
            FitError: fewer data than parameters, or no finite response.
            ModelError: no response.
        """
        coordinates, point, low, high = starting_point(model, data_sets, names, bounds)
        inside = _INSIDE * (high - low)
        low, high = low + inside, high - inside
        point = np.clip(point, low, high)
        model = model.with_values(coordinates.values(point))
        slopes = jacobian(model, data_sets, names)
        misfit = residual(model, data_sets)  # which mostly came with the derivatives
        if not np.all(np.isfinite(misfit)) or not np.all(np.isfinite(slopes)):
            raise FitError(
                "the model has no finite response to these tests",
                found=", ".join(f"{name} = {value:.4g}" for name, value in model.values.items()),
                hint="give start values or bounds in [fit] of the campaign",
            )
        return cls(model, data_sets, coordinates, low, high, point, misfit, slopes, tolerance)

    @property
    def chi_square(self) -> float:
        return float(self.residual @ self.residual)

    @property
    def expected_fall(self) -> float:
        """Fall of chi-square that is left if the model is linear."""
        return max(self._step(0.0)[1], 0.0)

    @property
    def solution(self) -> Solution:
        """State of the fit as a solution."""
        ends = at_bound(self.coordinates.names, self.point, self.low, self.high)
        return Solution(
            self.model, self.coordinates, self.residual, self.jacobian, self.evaluations, ends, not self.converged
        )

    def stepped(self) -> "Descent":
        """The fit one evaluation on: at a lower chi-square with less damping, or where it was with more.

        Returns:
            The fit after one more evaluation of the model.
        """
        damping = self.damping
        step, expected = self._step(damping)
        smallest_fall = _LEAST_FALL if self.tolerance is None else self.tolerance * self.chi_square
        evaluations, converged = self.evaluations + 1, 0.0 <= expected < smallest_fall
        bend = self._bend(step, damping)
        # so far out between the bounds, or on a way that bends so much, that only caution leads down
        while expected < 0.0 or self._length(bend) > _MOST_BENT * self._length(step):
            damping *= 2.0
            step, expected = self._step(damping)
            bend = self._bend(step, damping)
        point = np.clip(self.point + step + bend, *self._reach)
        change = point - self.point
        cautious = replace(
            self, evaluations=evaluations, converged=converged, damping=damping * self.growth, growth=2.0 * self.growth
        )
        names = self.coordinates.names
        try:
            model = self.model.with_values(self.coordinates.values(point))
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                # derivatives bring the response along; after a step that failed the response is asked for alone first,
                # and what is left of a last step is too short for them to change
                slopes = None if converged or self.growth > _FIRST_GROWTH else jacobian(model, self.data_sets, names)
                reached = residual(model, self.data_sets)
                fall = self.chi_square - float(reached @ reached)
                if expected <= 0.0 or not fall > _LEAST_GAIN_RATIO * expected:
                    return cautious
                if slopes is None:
                    slopes = self.jacobian if converged else jacobian(model, self.data_sets, names)
        except ModelError:  # no response there
            return cautious
        if not np.all(np.isfinite(slopes)):
            return cautious
        return replace(
            self,
            model=model,
            point=point,
            residual=reached,
            jacobian=slopes,
            evaluations=evaluations,
            converged=converged,
            damping=damping * max(_LEAST_DAMPING_RATIO, 1.0 - (2.0 * fall / expected - 1.0) ** 3),
            growth=_FIRST_GROWTH,
            last=(change, change @ (slopes - self.jacobian)),
        )

    def finished(self, evaluations: int) -> "Descent":
        """The fit at its end, or after so many evaluations of the model."""
        current = self
        while not current.converged and current.evaluations < evaluations:
            current = current.stepped()
        return current

    @cached_property
    def _normal(self) -> tuple[Array, Array]:
        """Curvature, (k, k), and slope, (k,), of half of chi-square by coordinate."""
        return self.jacobian @ self.jacobian.T, self.jacobian @ self.residual

    @cached_property
    def _reach(self) -> tuple[Array, Array]:
        """Least and largest coordinates that one step may reach, (k,) each."""
        longest = np.array([_LONGEST_STEP if parameter.log else np.inf for parameter in self.coordinates.parameters])
        return np.maximum(self.low, self.point - longest), np.minimum(self.high, self.point + longest)

    def _step(self, damping: float) -> tuple[Array, float]:
        """The damped step within the bounds, (k,), and the fall of chi-square that it is expected to bring.

        What would pass a bound stays on it, and the others are solved for again; what rests on a bound and is drawn
        outwards, and what the data do not see, does not move.
        """
        curvature, slope = self._normal
        size = np.diag(curvature)
        low, high = self._reach
        damped = curvature + np.diag(damping * size)
        outward = ((self.point <= self.low) & (slope >= 0.0)) | ((self.point >= self.high) & (slope <= 0.0))
        free, step = (size > _LEAST_SENSITIVITY) & ~outward, np.zeros_like(slope)
        while free.any():
            step[free] = -_solved(damped, slope + damped[:, ~free] @ step[~free], free)
            aim = self.point + step
            outside = free & ((aim < low) | (aim > high))
            if not outside.any():
                break
            step[outside] = (np.clip(aim, low, high) - self.point)[outside]
            free &= ~outside
        return step, float(-(2.0 * slope + curvature @ step) @ step)

    def _bend(self, step: Array, damping: float) -> Array:
        """Correction that bends a damped step along the valley, (k,); 0 where the last step led another way."""
        if self.last is None:
            return np.zeros_like(step)
        before, second = self.last
        curvature, _ = self._normal
        size = np.diag(curvature)
        lengths = self._length(step), self._length(before)
        if step @ (size * before) <= _SAME_WAY * lengths[0] * lengths[1]:
            return np.zeros_like(step)
        free, bend = (size > _LEAST_SENSITIVITY) & (step != 0.0), np.zeros_like(step)
        pull = self.jacobian @ second * (lengths[0] / lengths[1]) ** 2
        bend[free] = -0.5 * _solved(curvature + np.diag(damping * size), pull, free)
        return bend

    def _length(self, step: Array) -> float:
        """Length of a step in units of noise, each parameter by itself."""
        return float(np.sqrt(np.diag(self._normal[0]) @ np.square(step)))


def _solved(curvature: Array, pull: Array, free: Array) -> Array:
    """The free parameters at which a curvature, (k, k), meets a pull, (k,), none along what rounding decides."""
    scale = np.sqrt(np.diag(curvature)[free])
    scaled = curvature[np.ix_(free, free)] / np.outer(scale, scale)
    return np.linalg.lstsq(scaled, pull[free] / scale, rcond=ROUNDING)[0] / scale
