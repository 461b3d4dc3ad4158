"""Compare a model with measurements: its misfit in each test and run, and its expected error in each direction.

Each test and each run has its own values, so that the thousands of rows of a loop do not hide a sweep that is missed.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.fitting.assess import covariance
from bushfit.fitting.coordinates import Coordinates, prior_covariance
from bushfit.fitting.descent import repeat_fit
from bushfit.fitting.preparation import MeasuredSweep, MeasuredTest, log_slopes, residual_slices
from bushfit.fitting.problem import FitResult
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.model import Model
from bushfit.model.result import ExpectedError, Misfit, PriorUse
from bushfit.reading.measurement import loss_factor
from bushfit.units import number

#: Largest factor by which the variance of a parameter may grow if rows are held out. If it grows more, the other rows
#: do not determine the parameter, and the held-out rows are not predicted.
_LARGEST_GROWTH = 100.0
#: Singular value of the Jacobian, relative to the largest, below which it is rounding error.
_LEAST_SEEN = 1e-7
#: Longest Gauss-Newton step of a parameter, in its coordinate (mostly ln value), that predicts a refit; chosen: about a
#: third of the value.
_LONGEST_STEP = 0.3
#: Share of the points whose error is below the expected error: 95 %, as for all intervals.
_SHARE = 0.95
#: Smallest share of the points of a direction that must be predicted for the expected error to use these alone.
_ENOUGH = 0.5
#: Fewest points whose expected error is stated if all are fitted: the five parameters can pass through fewer points.
_FEWEST_FITTED = 5
#: Constant quantity of a test that is not a run at a constant amplitude or frequency.
_NO_RUN: dict[str, Any] = {"held": None, "value": None, "unit": None}


@dataclass(frozen=True, eq=False)
class LeaveOut:
    """Linearised fit that predicts how its parameters and residuals would change if some residuals were left out.

    A row is one of the n whitened residuals. The change is one Gauss-Newton step, which is exact for a linear model.

    Args:
        basis: orthonormal basis of the column space of the Jacobian of the whitened residuals, (n, m).
        coordinate_steps: change of the k parameter coordinates per unit step along each basis vector, (k, m).
        components: components of the residuals along the basis, (m,).
        residual: whitened residuals of the fit, (n,).
    """

    basis: Array
    coordinate_steps: Array
    components: Array
    residual: Array

    @classmethod
    def from_fit(cls, jacobian: Array, residual: Array) -> "LeaveOut":
        """Build the linearised fit from its whitened residuals, (n,), and their derivatives by fit coordinate, (k, n).

        Combinations of parameters that all rows together do not determine keep their values.
        """
        basis, size, directions = np.linalg.svd(jacobian.T, full_matrices=False)
        determined = size > _LEAST_SEEN * size.max(initial=0.0)
        basis = basis[:, determined]
        return cls(basis, directions[determined].T / size[determined], basis.T @ residual, residual)

    def undetermined(self, rows: Array) -> Array:
        """Mask of the parameters, (k,), whose variance grows 100-fold if `rows` (indices or mask) are left out."""
        size, vectors = np.linalg.eigh(self._information(rows))
        without = np.square(self.coordinate_steps @ vectors) @ (1.0 / np.maximum(size, _LEAST_SEEN**2))
        return without > _LARGEST_GROWTH * np.sum(np.square(self.coordinate_steps), axis=1)

    def parameter_step(self, rows: Array) -> Array | None:
        """Change of the k fitted parameters in their coordinates, (k,), if `rows` (indices or mask) are left out.

        None if a coordinate (mostly ln value) would change by more than 0.3, too far to predict a refit, or if the
        remaining rows do not determine a parameter.
        """
        if self.undetermined(rows).any():
            return None
        change = self.coordinate_steps @ self._basis_step(rows)
        return None if np.abs(change).max(initial=0.0) > _LONGEST_STEP else change

    def predicted_residual(self, rows: Array, *, stepped: bool = True) -> Array:
        """Residuals of held-out rows in units of noise, (h,), predicted by the fit to the other rows.

        Args:
            rows: mask of the h held-out rows among all n rows, (n,); the other rows must determine all parameters.
            stepped: True to apply the parameter step of leaving the rows out; False for the residuals of the fit.
        """
        return self.residual[rows] + self.basis[rows] @ self._basis_step(rows) * stepped

    def noise_gradient(self, rows: Array, predicted: Array) -> Array:
        """Derivatives of half the sum of squared predicted residuals with respect to the error of each row.

        The error of a held-out row acts directly; that of any other row acts through the parameters.

        Args:
            rows: mask of the h held-out rows among all n rows, (n,).
            predicted: predicted residuals of the held-out rows, in units of noise, (h,).

        Returns:
            Derivatives, (n,).
        """
        gradient = -(self.basis @ np.linalg.solve(self._information(rows), self.basis[rows].T @ predicted))
        gradient[rows] = predicted
        return gradient

    def _information(self, rows: Array) -> Array:
        """Fisher information of a fit without the rows `rows` (indices or mask), along the basis vectors, (m, m)."""
        return np.eye(self.components.size) - self.basis[rows].T @ self.basis[rows]

    def _basis_step(self, rows: Array) -> Array:
        """Gauss-Newton step of a fit without the rows `rows` (indices or mask), in components along the basis, (m,)."""
        return -np.linalg.solve(self._information(rows), self.components - self.basis[rows].T @ self.residual[rows])


def misfits(model: Model, fitted: Sequence[MeasuredTest], unfitted: Sequence[MeasuredTest] = ()) -> tuple[Misfit, ...]:
    """Misfits (NRMSE, reduced chi-square, mean gain error) of a model in each test and in each run of a sweep.

    Args:
        model: fitted model.
        fitted: tests that the model was fitted to.
        unfitted: tests that were not fitted.

    Returns:
        One `Misfit` for each test, and one for each run of a test with several runs.
    """
    found = []
    for index, whole in enumerate([*fitted, *unfitted]):
        test = whole.with_weight()
        relative, gain = test.relative_distance(model), 1.0 - np.abs(test.noise_free(model).measured / test.measured)
        squares = np.square(test.residual(model)).reshape(test.residuals_per_point, -1).sum(axis=0)
        runs = list(_runs(test))
        for label, points in ((_NO_RUN, slice(None)), *(runs if len(runs) > 1 else ())):
            of_run = relative[points]
            counted = test.residual_count * of_run.size / relative.size * test.test.weight
            misfit = Misfit(
                test=test.name,
                place=str(test.direction),
                fitted=index < len(fitted),
                **label,
                points=of_run.size,
                nrmse=float(np.sqrt(np.mean(of_run**2))),
                reduced_chi_square=float(squares[points].sum()) / counted,
                gain=float(gain[points].mean()),
            )
            found.append(misfit)
    return tuple(found)


def expected_errors(
    model: Model, fitted: Sequence[MeasuredTest], unfitted: Sequence[MeasuredTest] = (), fit: FitResult | None = None
) -> tuple[ExpectedError, ...]:
    """Expected errors of a fitted model in stiffness and loss factor: 95 % of a direction's points have smaller errors.

    Each run of a fitted test is held out and predicted by a fit to the other runs, if the other runs determine all
    parameters and change no parameter by much. Tests that were not fitted are predictions already. If fewer than half
    the points of a direction can be predicted, the errors of the fit at all its points are used. A direction with very
    few points is left out.

    Args:
        model: fitted model.
        fitted: tests that the model was fitted to.
        unfitted: tests that were not fitted.
        fit: result of the fit; None to hold out no run.

    Returns:
        For each direction or specimen, the 95 % quantiles of the absolute relative difference of |K| and of the
        absolute difference of the loss factor.
    """
    parts = list[tuple[str, Array, bool]]()
    if fit:
        whole = LeaveOut.from_fit(fit.jacobian[fit.inner_indices], fit.residual)
        per_coordinate = fit.coordinates.slopes(model.values)[:, None]
    for test, rows in zip(fitted, residual_slices(fitted), strict=True):
        modelled = test.noise_free(model).measured
        if not fit:
            parts.append((str(test.direction), _absolute_difference(modelled, test.measured), False))
            continue
        slopes = (log_slopes(model, test, fit.names) * per_coordinate)[fit.inner_indices]
        for _, points in _runs(test):
            residuals = np.broadcast_to(points, (test.residuals_per_point, test.size // test.residuals_per_point))
            step = whole.parameter_step(rows.start + np.flatnonzero(residuals))
            predicted = modelled if step is None else modelled * np.exp(step @ slopes)
            counted = points & (test.weights > 0.0 if isinstance(test, MeasuredSweep) else True)
            difference = _absolute_difference(predicted[counted], test.measured[counted])
            parts.append((str(test.direction), difference, step is not None))
    for test in unfitted:
        difference = _absolute_difference(test.noise_free(model).measured, test.measured)
        parts.append((str(test.direction), difference, True))
    return _errors_by_direction(parts)


def prior_uses(steps: Sequence[FitResult], fixed: Covariance | None) -> dict[str, PriorUse]:
    """Share of each prior in a fit's estimate, and its distance from the tests' estimate in standard deviations.

    Let P be the mean of the prior, T the estimate of the tests and the other priors, from fits that are repeated with
    this prior weakened, and v_P and v_T their variances. The share of the prior is v_T/(v_T + v_P), and the distance is
    (T - P)/sqrt(v_T + v_P).

    Args:
        steps: fits of a procedure, in order.
        fixed: covariance of parameters that all fits kept fixed; None if these are exact.

    Returns:
        By name of the parameter, the share of the information (1/variance) that comes from the prior, and the distance
        between the tests and the prior in standard deviations. Parameters that end at a bound without their prior are
        omitted.
    """
    model, uses = steps[-1].model, dict[str, PriorUse]()
    for prior in model.constraints.priors:
        weak = replace(model, constraints=model.constraints.weaken(prior))
        alone = [repeat_fit(step, replace(step.model, constraints=weak.constraints)) for step in steps]
        last, stages = alone[-1], [step.stage(step.at_bound) for step in alone]
        known = covariance(last.model, stages, fixed, last.smooth_error)
        estimated = {name: step.model.values[name] for step in alone for name in step.names}
        values = weak.with_values(estimated).values
        names = [name for name in prior.names if name in known.names and name in {*estimated, *model.tied_names}]
        coordinates = Coordinates.of_parameters(model, names)
        mean = dict(zip(prior.names, prior.mean.tolist(), strict=True))
        deviation = dict(zip(prior.names, np.sqrt(np.diag(prior.covariance)).tolist(), strict=True))
        of_prior = np.diag(prior_covariance(prior, coordinates))
        of_tests = np.square([known.stderr(name) for name in names] / coordinates.slopes(values))
        distance = (coordinates.point(values) - coordinates.point(mean)) / np.sqrt(of_tests + of_prior)
        share = of_tests / (of_tests + of_prior)
        for i, name in enumerate(names):
            uses[name] = PriorUse(prior.source, mean[name], deviation[name], float(share[i]), float(distance[i]))
    return uses


def prior_warnings(uses: Mapping[str, PriorUse]) -> list[Caveat]:
    """Return a warning for each prior that the tests contradict at a significance level of 5 %."""
    return [
        Caveat(
            "prior_contradicted",
            f"the tests contradict the prior of {name} ({use.source}) by {number(abs(use.distance), 2)} standard "
            "deviations (95 % of correct priors: at most 1.96). Check the prior, or leave it out",
        )
        for name, use in uses.items()
        if abs(use.distance) > Z95
    ]


def _errors_by_direction(parts: Sequence[tuple[str, Array, bool]]) -> tuple[ExpectedError, ...]:
    """Expected error of each direction, from its predicted points if they are at least half, else from all its points.

    Args:
        parts: name of a direction or specimen; absolute relative difference of |K| and absolute difference of the loss
            factor of n points, (2, n); and True if the points are predicted from other runs.
    """
    found = []
    for place in dict.fromkeys(place for place, _, _ in parts):
        differences = np.concatenate([difference for name, difference, _ in parts if name == place], axis=1)
        held_out = [difference for name, difference, predicted in parts if name == place and predicted]
        predicted = np.concatenate([np.empty((2, 0)), *held_out], axis=1)
        enough = predicted.shape[1] >= _ENOUGH * differences.shape[1]
        compared = predicted if enough else differences
        if not enough and compared.shape[1] < _FEWEST_FITTED:
            continue
        stiffness, loss = np.quantile(compared, _SHARE, axis=1, method="higher").tolist()
        found.append(ExpectedError(place, stiffness, loss, compared.shape[1], enough))
    return tuple(found)


def _absolute_difference(modelled: Array, measured: Array) -> Array:
    """Absolute relative difference of |K| and absolute difference of loss factors, from complex stiffnesses, (2, n)."""
    return np.abs([np.abs(modelled / measured) - 1.0, loss_factor(modelled) - loss_factor(measured)])


def _runs(test: MeasuredTest) -> Iterator[tuple[dict[str, Any], Array]]:
    """Yield the runs of a test: the points of a sweep at each constant amplitude or frequency.

    Yields:
        Constant quantity of the run, as a dict with the keys "held" (name of the quantity), "value" and "unit"; and the
        mask of the points of the run, (n,). A loop, and a sweep without a constant quantity, are one run with an empty
        dict.
    """
    if not isinstance(test, MeasuredSweep) or test.test.stepped is None:
        yield _NO_RUN, np.ones(test.frequency.size, dtype=bool)
        return
    quantity = "amplitude" if test.test.stepped == "frequency" else "frequency"
    unit = test.direction.motion.displacement_unit if quantity == "amplitude" else "Hz"
    for value in np.unique(test.run_level):
        yield {"held": quantity, "value": float(value), "unit": unit}, test.run_level == value
