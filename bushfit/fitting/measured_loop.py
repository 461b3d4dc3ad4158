"""One measured loop with its noise: force against time, the measured displacement driving the model."""

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np

from bushfit.effects.contract import Array, RubberConditions, Values
from bushfit.fitting.loop_harmonics import SMOOTH_HARMONICS
from bushfit.fitting.measured_test import MeasuredBase
from bushfit.fitting.prepared_loop import PreparedLoop
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.model.model import Model
from bushfit.model.result import Outlier
from bushfit.model.sensitivity import force_and_slopes
from bushfit.reading.measurement import Loop
from bushfit.reduction.harmonics import basis

#: Number of harmonics of the model error of a loop, and their sizes relative to that of the whole force, (25,): equal
#: up to the last smooth one, then falling as 1/h. Their mean square is that of the whole.
_ERROR_HARMONICS = 25
_ERROR_SIZES = 1.0 / np.maximum(np.arange(1.0, _ERROR_HARMONICS + 1.0), SMOOTH_HARMONICS)
_ERROR_SIZES /= np.linalg.norm(_ERROR_SIZES)


@dataclass(frozen=True, eq=False)
class MeasuredLoop(MeasuredBase):
    """Measured loop: force at n rows, or bins of phase, driven by the measured displacement.

    Rows that are left out have no weight, see `prepare_loop`, but are kept, because the response is computed in time.

    Args:
        prepared: loop prepared as an input of the model.
        fundamental_only: True to use only the first harmonic of the residuals, so that the loop is one operating point
            with two residuals. This is needed if a stiffness is added that is known only at the loop's frequency.
        gain_error: standard deviation of the relative gain error of the whole record, from the accuracy class of its
            rig; also of the offset of its force, relative to half the force range.
        gain_weighs: True if the gain error is part of the noise by which residuals are weighted, as for a class stated
            in [rig]. An assumed gain error only widens the errors of fitted parameters.
        first_harmonic_errs: True if the model error includes the first harmonic of the force.

    Notes:
        The model error is independent between harmonics h, and beyond the fifth proportional to 1/h.
    """

    prepared: PreparedLoop
    fundamental_only: bool = False
    gain_error: float = 0.0
    gain_weighs: bool = False
    first_harmonic_errs: bool = True
    kind = "loop"
    components = ("force",)

    @property
    def test(self) -> Loop:
        """Measured loop as read from the file, reduced to its steady cycles."""
        return self.prepared.loop

    @property
    def notes(self) -> Sequence[str]:
        """Sentences for the user: left-out parts of the record, a preload, or a contradiction between loops."""
        return [*self.prepared.notes, *([self.contradiction] if self.contradiction else [])]

    @property
    def temperature(self) -> float:
        """Temperature of the rubber in the loop [K]; nan if unknown."""
        return self.test.temperature or np.nan

    @property
    def frequency(self) -> Array:
        """Frequency [Hz] of the only operating point of a loop, (1,), or of each point of a sweep, (n,)."""
        return np.array([self.prepared.frequency])

    @property
    def amplitude(self) -> Array:
        """Zero-to-peak amplitude [m or rad] of the only point of a loop, (1,), or of all sweep points, (n,)."""
        return np.array([self.prepared.amplitude])

    @property
    def conditions(self) -> RubberConditions:
        """Temperature of the rubber and its earlier strains, in a loop or at each point of a sweep."""
        return self.test_conditions

    @cached_property
    def measured(self) -> Array:
        """Complex stiffness of the loop's first harmonic [N/m or N m/rad], (1,); of a sweep, of each point, (n,)."""
        return np.array([self.prepared.first_harmonic])

    @property
    def size(self) -> int:
        """Number of residuals of the test: rows or bins of a loop, two for each point of a sweep."""
        return 2 if self.fundamental_only else int(self.prepared.force.size)

    @cached_property
    def residual_count(self) -> int:
        """Number of residuals with weight, for degrees of freedom; if the noise is correlated, the effective number."""
        if self.fundamental_only:
            return 2
        return round(self.prepared.row_noise.observed_share * np.count_nonzero(self._usable_rows))

    @property
    def independent_count(self) -> float:
        """Number of independent residuals, which sets the uncertainty of a mean over the test."""
        return self.residual_count / (1.0 if self.fundamental_only else self.prepared.row_noise.rows_as_one)

    @property
    def weights(self) -> Array:
        """Weight of each row, (n,): 1 full, 0 left out; for a long loop, the number of rows averaged in each bin."""
        return self.prepared.weight

    @property
    def relative_noise(self) -> float:
        """Standard deviation of a row's noise relative to half the force range, or of a sweep point relative to |K|."""
        return self.prepared.noise / self.prepared.half_range

    def weighted(self, weight: Array) -> Self:
        """Return the test with the weight of each of its n points multiplied by a factor, (n,)."""
        return replace(self, prepared=replace(self.prepared, weight=self.prepared.weight * weight))

    def fundamental(self) -> Self:
        """Return the loop compared by the first harmonic of its force only."""
        return replace(self, fundamental_only=True)

    def with_independent_noise(self) -> Self:
        """Return the loop without model error and errors of the rig that all rows share."""
        return replace(self, gain_error=0.0, model_error=0.0)

    def noise_free(self, model: Model) -> Self:
        """Return the test with the response of a model in place of the measured response."""
        force = self.force(model)
        return replace(self, prepared=replace(self.prepared, force=force, half_range=float(np.ptp(force)) / 2.0))

    def force(self, model: Model, values: Values | None = None) -> Array:
        """Model force at the n rows [N or N m], (..., n); `values` replace parameters of the model, (...) or scalar."""
        if values is None and (force := self._recall("force", model)) is not None:
            return force
        history = self.prepared.history(model.is_transient)
        force = model.force(self.direction, history, kind="loop", values=values, conditions=self.test_conditions)
        force = self.prepared.interpolate_at_rows(force) + (self.prepared.datum or 0.0)
        return force if values is not None else self._keep("force", model, (), force)

    def residual(self, model: Model, values: Values | None = None) -> Array:
        """Whitened residuals: model minus measured force in units of noise, (..., size); see `MeasuredBase`."""
        return self.whiten((self.force(model, values) - self.prepared.force) * self._per_noise)

    def jacobian(self, model: Model, names: Sequence[str]) -> Array:
        """Derivatives of the whitened residuals with respect to parameter values [SI]; the last result is cached.

        Returns:
            Derivatives, (len(names), size).
        """
        if (rows := self._recall("jacobian", model, tuple(names))) is not None:
            return rows
        history = self.prepared.history(model.is_transient)
        force, slopes = force_and_slopes(model, self.direction, history, names, self.test_conditions)
        self._keep("force", model, (), self.prepared.interpolate_at_rows(force) + (self.prepared.datum or 0.0))
        rows = self.whiten(self.prepared.interpolate_at_rows(slopes) * self._per_noise)
        return self._keep("jacobian", model, tuple(names), rows)

    def residual_change(self, change: Array, model: Model, added: Array | float = 0.0) -> Array:
        """Change of the whitened residuals, (..., size), due to a small change of the model's stiffness.

        Args:
            change: change of the stiffness at each operating point (one in a loop, in the first harmonic of its force),
                complex, (..., 1) [N/m or N m/rad].
            model: model whose stiffness changes.
            added: stiffness that is added to the model at the same points, complex [N/m or N m/rad]; a loop ignores it.
        """
        wave = self.prepared.coefficients[1] * np.exp(2j * np.pi * self.prepared.phase)
        per_unit = self.whiten(np.array([wave.real, -wave.imag]) * self._per_noise)
        return np.concatenate((change.real, change.imag), axis=-1) @ per_unit

    def relative_difference(self, model: Model) -> Array:
        """Model minus measured force at each row, relative to half the measured force range, (1, n)."""
        return ((self.force(model) - self.prepared.force) / self.prepared.half_range)[None]

    def relative(self, model: Model) -> Array:
        """Magnitude of the relative difference at each row, less its mean (the zero of a load cell is unknown)."""
        difference = self.relative_difference(model)[0, self.weights > 0.0]
        return np.abs(difference - np.mean(difference))

    def misfit(self, model: Model) -> Array:
        """Model minus measured force at each row, in units of the row's noise, (n,); 0 at rows without weight."""
        return (self.force(model) - self.prepared.force) * self._per_noise

    def distance(self, model: Model) -> Array:
        """Absolute difference between model and measured force at each row, in units of noise, (n,)."""
        return np.abs(self.misfit(model))

    def displayed_residual(self, model: Model) -> Array:
        """Residuals for charts, model minus measured in units of noise, (size,): also of points without weight."""
        distance = (self.force(model) - self.prepared.force) / self.prepared.noise
        return np.where(self.weights > 0.0, self.misfit(model), distance)

    def outlier_indices(self, model: Model) -> Array:
        """Indices of the rows whose force is far from the harmonics fitted to the loop, (k,); the model is not used."""
        return self.prepared.outliers["force"].rows

    def outliers(self, points: Array, model: Model) -> Iterator[Outlier]:
        """Yield all rows of the loop that are far from its harmonics, with the distance in units of noise.

        Args:
            points: not used for a loop.
            model: not used for a loop.
        """
        file = str(self.source.file) if self.source else None
        before = self.prepared.first_row + (self.test.part.first_row if self.test.part else 0)
        for column, (rows, distance) in self.prepared.outliers.items():
            for row, noise_units in zip(rows.tolist(), distance.tolist(), strict=True):
                yield Outlier(self.name, file, row + before + 1, column, noise_units)

    def smooth_changes(self) -> Array:
        """Changes of the whitened residuals due to 11 smooth force changes of half the force range, (11, size).

        These are a constant, and the columns of `basis` for five harmonics; with `fundamental_only` only the first
        harmonic is not 0.
        """
        rows = self.force_changes(basis(self.prepared.phase, SMOOTH_HARMONICS).T)
        if self.fundamental_only:
            rows[np.delete(np.arange(len(rows)), [1, SMOOTH_HARMONICS + 1])] = 0.0
        return rows

    def gain_and_offset(self) -> Array:
        """Change of the whitened residuals due to a gain error of 100 % and an offset of half the range, (2, size)."""
        return self.shared_errors.whiten(np.array([self._unit_gain, self._unit_offset]))

    @cached_property
    def _usable_rows(self) -> Array:
        """Mask of the whitened rows that have weight and whose noise depends only on rows with weight, (n,)."""
        return self.prepared.row_noise.usable_rows(self.prepared.weight)

    @cached_property
    def _per_noise(self) -> Array:
        """Reciprocal of the standard deviation of each row's force [1/N or 1/(N m)], (n,); 0 for unused rows."""
        return np.sqrt(self.prepared.weight) / (self.prepared.noise * self.prepared.row_noise.row_scale)

    def _whiten_rows(self, rows: Array) -> Array:
        """Remove the autocorrelation of the noise from rows of force in units of noise, (..., n); unused rows become 0.

        If only the first harmonic is used, the result is the two components along the first harmonic, (..., 2).
        """
        white = self.prepared.row_noise.whiten(rows)
        white *= self._usable_rows
        return white @ self._fundamental if self.fundamental_only else white

    def force_changes(self, waves: Array) -> Array:
        """Changes of the whitened residuals, (c, size), due to force changes relative to half the range, (c, n)."""
        return self.whiten(waves * (self._per_noise * self.prepared.half_range))

    def whiten(self, difference: Array) -> Array:
        """Remove the correlation of the noise of rows, and the errors that rows share.

        Args:
            difference: changes of the force at the rows, in units of noise, (..., n).

        Returns:
            Whitened residuals, (..., size), whose noise is independent with unit variance.
        """
        return self.shared_errors.whiten(self._whiten_rows(difference))

    @cached_property
    def _fundamental(self) -> Array:
        """Orthonormal basis of the whitened rows of a first harmonic, (n, 2)."""
        waves = self.prepared.row_noise.whiten(basis(self.prepared.phase, 1).T[1:] * self._per_noise)
        return np.linalg.qr((waves * self._usable_rows).T)[0]

    @cached_property
    def _unit_offset(self) -> Array:
        """Change of the whitened rows if half the force range is added to the force of every row, (size,)."""
        return self._whiten_rows(self._per_noise * self.prepared.half_range)

    @cached_property
    def _unit_gain(self) -> Array:
        """Change of the whitened rows due to a gain error of 100 %, (size,).

        Notes: computed from the force without its noise. With noise, a fit would attribute noise to the gain, and bias
        the model towards small forces (Peelle's puzzle: R. Fruehwirth, D. Neudecker, H. Leeb, EPJ Web of Conferences
        27 (2012) 00008).
        """
        waves, weighed = basis(self.prepared.phase, SMOOTH_HARMONICS), self.weights > 0.0
        smooth = waves @ np.linalg.lstsq(waves[weighed], self.prepared.force[weighed], rcond=None)[0]
        return self._whiten_rows(smooth * self._per_noise)

    @cached_property
    def shared_errors(self) -> SharedErrors:
        """Errors that all rows of the loop share: the model error, or without one the errors of the rig.

        The zero of a load cell is uncertain by the class of its gain, relative to half the force range. A gain error
        that the weights of the residuals exclude is left out.
        """
        if self.model_error:
            return self.model_errors
        errors = [self._unit_offset, *([self._unit_gain] if self.gain_weighs else [])]
        return SharedErrors.from_columns(self.gain_error * np.array(errors))

    @cached_property
    def unit_model_error(self) -> SharedErrors:
        """Model error of 100 % of half the force range, as errors that the rows share.

        The errors are the cosine and sine of each harmonic and an offset; for a loop from rest, also a deviation of the
        first cycle and a drift.
        """
        count, phase = 1 if self.fundamental_only else _ERROR_HARMONICS, self.prepared.phase
        waves = basis(phase, count).T[1:] * np.tile(_ERROR_SIZES[:count], 2)[:, None]
        if self.prepared.from_rest and not self.fundamental_only:  # the first cycle has its error and a drift
            order = np.arange(2.0 * np.ceil(self.prepared.cycles))[:, None]
            drift = np.cos(np.pi * order * phase / self.prepared.cycles) / (1.0 + order)
            waves = np.concatenate((waves, waves * (phase < 1.0), drift))
        rows = self._whiten_rows(waves * (self._per_noise * self.prepared.half_range))
        if not self.first_harmonic_errs:
            rows[[0, count]] = 0.0
        return SharedErrors.from_columns(np.concatenate((rows, _ERROR_SIZES[:1, None] * self._unit_offset)))

    def noise_sensitivity(self, influence: Array) -> dict[Hashable, Array]:
        """Sensitivity of k parameter estimates to errors of each noise variance that was itself estimated.

        Args:
            influence: change of each estimate per unit of each whitened residual, (k, size).

        Returns:
            By identifier of the variance, (k, size): the influence times the whitened derivative of the residuals'
            covariance with respect to the variance, times the standard error of the variance.
        """
        reaction = self.shared_errors.whiten(influence)
        whole = reaction @ self._fundamental.T if self.fundamental_only else reaction
        parts = self.prepared.row_noise.noise_sensitivity(whole)
        if self.fundamental_only:
            parts = [part @ self._fundamental for part in parts]
        if not parts and self.test.noise is None:
            rows = round(self.prepared.row_noise.observed_share * np.count_nonzero(self._usable_rows))
            parts = [np.sqrt(2.0 / rows) * reaction]
        return {(self.name, index): self.shared_errors.whiten(part) for index, part in enumerate(parts)}

    def extra_covariance(self, influence: Array) -> Array:
        """Covariance, (k, k), of k parameter estimates due to errors that the weights of the residuals exclude.

        The gain error is added. The model error of the first harmonic is subtracted, because a smooth error of the
        model includes it. `influence`: change of each estimate per unit of each whitened residual, (k, size).
        """
        first = self.model_error * _ERROR_SIZES[0] * self.force_changes(basis(self.prepared.phase, 1).T[1:])
        both = influence @ np.vstack((first, self.gain_error * self.gain_and_offset()[0])).T
        return np.asarray(both * (-1.0, -1.0, 1.0) @ both.T)
