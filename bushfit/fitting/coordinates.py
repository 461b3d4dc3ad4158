"""Dimensionless coordinates of fitted parameters, and their bounds and priors in these coordinates.

The coordinate of a strictly positive parameter is its logarithm; the coordinate of any other parameter is its value
divided by a typical value. So every coordinate is of order one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.effects import Parameter
from bushfit.effects.contract import Array
from bushfit.model.constraints import Prior
from bushfit.model.model import Model

#: Lower and upper limit of parameters [SI], by name; None for the parameter's default limit.
Bounds = Mapping[str, tuple[float | None, float | None]]

#: Smallest significant singular value of a Jacobian, or eigenvalue of a scaled information matrix, relative to the
#: largest: smaller ones are rounding errors.
ROUNDING = 1e-10
#: Smallest magnitude of a parameter, relative to its typical value, to which a change is related.
_LEAST_SIZE = 0.05


@dataclass(frozen=True)
class Coordinates:
    """Map between parameter values and the coordinates that a fit varies: ln value, or value / typical size.

    Args:
        names: names of the k parameters.
        parameters: definitions of the parameters, in the same order.
    """

    names: tuple[str, ...]
    parameters: tuple[Parameter, ...]

    @classmethod
    def of_parameters(cls, model: Model, names: Sequence[str]) -> "Coordinates":
        """Build the map between values and coordinates of some parameters of a model, given by name."""
        return cls(tuple(names), tuple(model.parameters[name] for name in names))

    def forward(self, name: str, value: float) -> float:
        """Convert the value of one parameter [SI] to its coordinate: ln value, or value / typical size."""
        parameter = self.parameters[self.names.index(name)]
        return float(np.log(value)) if parameter.log else value / parameter.typical

    def point(self, values: Mapping[str, float]) -> Array:
        """Dimensionless coordinates of the k parameters, (k,), from their values in SI units by name."""
        return np.array([self.forward(name, values[name]) for name in self.names])

    def values(self, point: Sequence[float] | Array) -> dict[str, float]:
        """Values of the k parameters in SI units by name, from their dimensionless coordinates, (k,)."""
        return {
            name: float(np.exp(u)) if parameter.log else float(u) * parameter.typical
            for name, parameter, u in zip(self.names, self.parameters, point, strict=True)
        }

    def slopes(self, values: Mapping[str, float]) -> Array:
        """Derivatives of k parameter values [SI] with respect to their coordinates, (k,), at values by name."""
        pairs = zip(self.names, self.parameters, strict=True)
        return np.array([values[name] if parameter.log else parameter.typical for name, parameter in pairs])


def coordinate_per_relative_change(model: Model, names: Sequence[str]) -> Array:
    """Derivatives of k parameter coordinates with respect to the relative change dp/p of each parameter p, (k,).

    They are 1 for the coordinate ln p, and |p|/typical size, at least 0.05, for any other.
    """
    pairs = [(model.parameters[name], abs(model.values[name])) for name in names]
    return np.array(
        [1.0 if parameter.log else max(value / parameter.typical, _LEAST_SIZE) for parameter, value in pairs]
    )


def coordinate_bounds(coordinates: Coordinates, bounds: Bounds) -> tuple[Array, Array]:
    """Lower and upper bounds of k coordinates, (k,) each: those in `bounds`, else the parameter's default limits."""
    ends = []
    for name, parameter in zip(coordinates.names, coordinates.parameters, strict=True):
        limits = zip(bounds.get(name, (None, None)), parameter.bounds, strict=True)
        ends.append(sorted(coordinates.forward(name, end if limit is None else limit) for limit, end in limits))
    low, high = np.reshape(ends, (-1, 2)).T
    return low, high


def prior_rows(model: Model, names: Sequence[str]) -> tuple[Array, Array]:
    """Whitened residuals of a model's priors, and their derivatives with respect to the parameter coordinates.

    A prior is normal in the coordinates, so a strictly positive parameter has a log-normal prior.

    Args:
        model: model with its priors.
        names: names of the parameters of the derivatives.

    Returns:
        Value minus prior mean in standard errors of the prior, (p,), and derivatives, (len(names), p). Parameters that
        the model lacks have rows of zeros, so that p is the same for all models of a campaign.
    """
    residuals, slopes = [np.empty(0)], [np.empty((len(names), 0))]
    for prior in model.constraints.priors:
        coordinates = Coordinates.of_parameters(model, [name for name in prior.names if name in model.values])
        mean = dict(zip(prior.names, prior.mean.tolist(), strict=True))
        whitening = np.linalg.inv(np.linalg.cholesky(prior_covariance(prior, coordinates)))
        absent = (0, len(prior.names) - len(coordinates.names))
        residuals.append(np.pad(whitening @ (coordinates.point(model.values) - coordinates.point(mean)), absent))
        slopes.append(np.pad(coordinate_changes(model, names, coordinates.names) @ whitening.T, ((0, 0), absent)))
    return np.concatenate(residuals), np.concatenate(slopes, axis=-1)


def prior_covariance(prior: Prior, coordinates: Coordinates) -> Array:
    """Covariance of a prior in the coordinates of those k parameters to which it applies, (k, k)."""
    indices = [prior.names.index(name) for name in coordinates.names]
    size = coordinates.slopes(dict(zip(prior.names, prior.mean.tolist(), strict=True)))
    return np.asarray(prior.covariance[np.ix_(indices, indices)] / np.outer(size, size))


def coordinate_changes(model: Model, names: Sequence[str], changed: Sequence[str]) -> Array:
    """Derivatives of parameters' coordinates with respect to those of the free parameters, for parameters with ties.

    A free parameter changes with its own coordinate only; a tied parameter changes with the parameters in its formula.

    Args:
        model: model with its ties.
        names: names of the k free parameters.
        changed: names of the c parameters whose coordinates change.

    Returns:
        Derivatives, (k, c).
    """
    sizes = Coordinates.of_parameters(model, (*names, *model.tied_names)).slopes(model.values)
    by_value = np.hstack((np.eye(len(names)), model.constraints.slopes(model.values, names)))
    by_name = dict(zip((*names, *model.tied_names), (by_value * sizes[: len(names), None] / sizes).T, strict=True))
    return np.array([by_name.get(name, np.zeros(len(names))) for name in changed]).reshape(len(changed), len(names)).T
