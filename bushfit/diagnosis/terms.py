"""Additional stiffness terms over frequency and amplitude, and their derivatives in the residuals."""

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import Coordinates, jacobian, residual
from bushfit.fitting.preparation import MeasuredTest
from bushfit.geometry import STRAINING
from bushfit.model.model import Model

#: What a term counts in: N/m (or N m/rad) over displacement, Pa over strain, or shares of the stiffness over strain.
Measure = Literal["stiffness", "modulus", "gain"]


@dataclass(frozen=True, eq=False)
class Terms:
    """Operating points of the tests that a term acts on: tests of the bushing and specimens, without moduli of coupons.

    Args:
        evidence: the fitted model and the tests.
        measure: unit of the term.
    """

    evidence: Evidence
    measure: Measure

    @cached_property
    def data_sets(self) -> list[MeasuredTest]:
        """Tests that the term acts on."""
        return [data_set for data_set in self.evidence.data_sets if data_set.direction.motion is not STRAINING]

    @property
    def sensible(self) -> bool:
        """True if the term has one meaning: one stiffness cannot be added to displacement and to rotation."""
        motions = {data_set.direction.motion for data_set in self.data_sets}
        return len(motions) == 1 if self.measure == "stiffness" else bool(motions)

    @cached_property
    def place(self) -> list[slice]:
        """Slice of the points of each test."""
        ends = np.cumsum([data_set.frequency.size for data_set in self.data_sets]).tolist()
        return [slice(end - data_set.frequency.size, end) for end, data_set in zip(ends, self.data_sets, strict=True)]

    @cached_property
    def directions(self) -> Array:
        """Name of the direction of each point, (p,)."""
        return np.concatenate([[str(data_set.direction)] * data_set.frequency.size for data_set in self.data_sets])

    @cached_property
    def points(self) -> Array:
        """Logarithms of frequency [Hz] and motion [m, rad or 1] of each point, (p, 2)."""
        model = self.evidence.model
        per = [
            1.0 if self.measure == "stiffness" else model.unit_strain(data_set.direction) for data_set in self.data_sets
        ]
        axes = [
            (data_set.frequency, data_set.amplitude * factor)
            for data_set, factor in zip(self.data_sets, per, strict=True)
        ]
        return np.log(np.concatenate(axes, axis=-1).T)

    def stiffness(self, model: Model) -> Array:
        """Complex stiffness of a model at each point, (p,) [N/m or N m/rad]."""
        return np.concatenate(
            [
                model.stiffness(data_set.direction, data_set.frequency, data_set.amplitude, kind=data_set.kind)
                for data_set in self.data_sets
            ]
        )

    def unit(self, model: Model) -> Array:
        """Stiffness of one unit of the term at each point.

        Args:
            model: predicts the stiffness, for a term in shares of it.

        Returns:
            Stiffness [N/m or N m/rad], (p,).
        """
        match self.measure:
            case "gain":
                return self.stiffness(model)
            case "modulus":
                per = [model.stiffness_per_modulus(data_set.direction) for data_set in self.data_sets]
                return np.repeat(per, [data_set.frequency.size for data_set in self.data_sets])
        return np.ones(len(self.points))

    def of_size_one(self, shapes: Array, model: Model) -> Array:
        """Scale shapes of the term, (c, p), so that the largest change of |K| is 100 %."""
        return shapes / np.abs(shapes * self.unit(model) / self.stiffness(model)).max(axis=-1)[:, None]

    def measured_value(self, model: Model) -> Array:
        """Value of the term with which a model meets the measured stiffness at every point, complex, (p,)."""
        differences = [data_set.measured - data_set.noise_free(model).measured for data_set in self.data_sets]
        return np.concatenate(differences) / self.unit(model)

    def columns(self, values: Array, model: Model, base_value: Array | float = 0.0) -> Array:
        """Derivatives of the whitened residuals by small values of the term.

        Args:
            values: of the term at the points, complex (c, p).
            model: at its parameters.
            base_value: value that the term has already, (p,).

        Returns:
            Changes of the residuals, (c, n).
        """
        residual_changes, unit = np.zeros((len(values), self.evidence.residual.size)), self.unit(model)
        change, base_stiffness = values * unit, base_value * unit
        for data_set, place in zip(self.data_sets, self.place, strict=True):
            residual_changes[:, self.evidence.place[data_set]] = data_set.residual_change(
                change[:, place], model, base_stiffness[place]
            )
        return residual_changes

    def residual(self, value: Array, model: Model) -> Array:
        """Whitened residuals of a model with the term of a value at the points, complex (p,), exact, (n,)."""
        residuals, added = residual(model, self.evidence.data_sets), value * self.unit(model)
        for data_set, place in zip(self.data_sets, self.place, strict=True):
            residuals[self.evidence.place[data_set]] = data_set.residual_with(added[place], model)
        return residuals

    def jacobian(self, value: Array, model: Model) -> Array:
        """Derivatives of the residuals with the term by the fit coordinates of the model.

        Args:
            value: of the term at the points, complex (p,).
            model: at its parameters.

        Returns:
            Derivatives, (k, n).
        """
        names, added = self.evidence.solution.coordinates.names, value * self.unit(model)
        rows, slopes = (
            jacobian(model, self.evidence.data_sets, names),
            Coordinates.of_parameters(model, names).slopes(model.values),
        )
        for data_set, place in zip(self.data_sets, self.place, strict=True):
            derivatives = data_set.jacobian_with(added[place], model, names, as_share=self.measure == "gain")
            rows[:, self.evidence.place[data_set]] = slopes[:, None] * derivatives
        return rows
