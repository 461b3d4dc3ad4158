"""One measured loop with its noise: force against time, the measured displacement driving the model."""

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.contract import Array, RubberConditions, Values
from bushfit.effects.history import History
from bushfit.fitting.loop_harmonics import GRID, SMOOTH_HARMONICS, OutlierRows, driving_motion
from bushfit.fitting.measured_test import MeasuredBase
from bushfit.fitting.row_noise import RowNoise
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.model.model import Model
from bushfit.model.result import Outlier
from bushfit.reading.measurement import Loop
from bushfit.reduction.harmonics import as_complex, basis, least_squares

#: Number of harmonics of the model error of a loop, and their sizes relative to that of the whole force, (25,): equal
#: up to the last smooth one, then falling as 1/h. Their mean square is that of the whole.
_ERROR_HARMONICS = 25
_ERROR_SIZES = 1.0 / np.maximum(np.arange(1.0, _ERROR_HARMONICS + 1.0), SMOOTH_HARMONICS)
_ERROR_SIZES /= np.linalg.norm(_ERROR_SIZES)


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredLoop(MeasuredBase):
    """Measured loop, made by `prepare_loop`: force at n rows, or bins of phase, driven by the measured displacement.

    Rows that are left out have no weight, as at the turning points of the motion, but are kept, because the response is
    computed in time.

    Args:
        test: measured loop, reduced to its steady cycles.
        frequency: frequency of the displacement [Hz], (1,).
        cycles: number of cycles in the loop, including fractions.
        from_rest: True if the record begins at rest, False if the loop is settled.
        phase: position of each row [cycles from the first row], (n,).
        measured_force: measured force per row, or per bin of phase if the loop is long [N or N m], (n,).
        noise: standard deviation of one row's force [N or N m].
        coefficients: complex harmonics of the displacement, mean first [m or rad].
        half_range: half of the range of the measured force without outliers [N or N m].
        datum: mean force [N or N m] that the fit subtracts; None if it uses the force itself. It is subtracted if the
            motion is not about zero or starts from rest at another position, if the force has a preload, or if other
            cycles precede the loop: the zero of the sensor, a preload and the rubber's memory cannot then be
            distinguished.
        record_notes: warnings on parts of the record that were left out, and on times that do not agree with the rows.
        faulty_rows: by column, indices of faulty rows and their distances from the harmonics in units of noise.
        first_row: index of the loop's first row in the whole record.
        row_noise: correlation of the noise of a row with that of the rows before.
        fundamental_only: True to use only the first harmonic of the residuals, so that the loop is one operating point
            with two residuals. This is needed if a stiffness is added that is known only at the loop's frequency.
        gain_error: standard deviation of the relative gain error of the whole record, from the accuracy class of its
            rig; also of the offset of its force, relative to half the force range.
        gain_weighs: True if the gain error, as for a class stated in [rig], is part of the noise by which residuals are
            weighted. If False, the gain error only widens the errors of fitted parameters.
        first_harmonic_errs: True if the model error includes the first harmonic of the force. If False, a smooth error
            replaces it, and the gain error of the rig, stated or assumed, takes its place.
        histories: histories of the motion by their extent, once computed; copies of the loop share them.

    Notes:
        The model error is independent between harmonics h, and beyond the fifth proportional to 1/h.
    """

    test: Loop
    frequency: Array
    cycles: float
    from_rest: bool
    phase: Array
    measured_force: Array
    noise: float
    coefficients: Array
    half_range: float
    datum: float | None = None
    record_notes: tuple[Caveat, ...] = ()
    faulty_rows: Mapping[str, OutlierRows] = field(default_factory=dict)
    first_row: int = 0
    row_noise: RowNoise = field(default_factory=RowNoise)
    fundamental_only: bool = False
    gain_error: float = 0.0
    gain_weighs: bool = False
    first_harmonic_errs: bool = True
    histories: dict[tuple[bool, bool], History] = field(default_factory=dict, repr=False)
    kind = "loop"
    components = ("force",)

    @property
    def notes(self) -> Sequence[Caveat]:
        """Warnings on left-out parts of the record, a preload, or a contradiction with an earlier loop."""
        return [*self.record_notes, *([self.contradiction] if self.contradiction else [])]

    @property
    def temperature(self) -> float:
        """Temperature of the rubber in the loop [K]; nan if unknown."""
        return self.test.temperature or np.nan

    @property
    def amplitude(self) -> Array:
        """Zero-to-peak amplitude of the loop's motion, (1,) [m or rad]."""
        return self.history(is_transient=False).amplitude

    @property
    def conditions(self) -> RubberConditions:
        """Temperature of the rubber in the loop, and its earlier strains."""
        return self.test_conditions

    @cached_property
    def measured(self) -> Array:
        """Complex stiffness of the loop's first harmonic, (1,) [N/m or N m/rad]."""
        root = np.sqrt(self.weights)
        _, force = as_complex(least_squares(basis(self.phase, 1) * root[:, None], self.measured_force * root))
        return np.array([force / self.coefficients[1]])

    @property
    def has_predecessor(self) -> bool:
        """True if the record has earlier rows before the loop; the rubber remembers their deformation."""
        return self.test.part is not None and self.test.part.first_row > 0

    def history(self, is_transient: bool) -> History:
        """Displacement without noise that drives the model: one settled cycle of 1024 samples, or the whole record.

        Args:
            is_transient: True if the response of the model changes over the first cycles of a settled motion.

        Returns:
            The whole record if it begins at rest, or if `is_transient` and no other cycles precede the loop; else one
            settled cycle.
        """
        is_whole = is_transient and not (self.from_rest or self.has_predecessor)
        extent = self.from_rest, is_whole
        if extent not in self.histories:
            half_row = 0.5 * self.cycles / self.test.time.size
            settled = math.ceil(self.cycles - half_row) if is_whole else 1
            cycles, frequency = self.cycles if self.from_rest else settled, float(self.frequency[0])
            self.histories[extent] = driving_motion(self.coefficients, frequency, cycles, from_rest=self.from_rest)
        return self.histories[extent]

    def interpolate_at_rows(self, response: Array) -> Array:
        """Interpolate a model response at the samples of `history`, (..., samples), to the measured rows.

        The mean is subtracted if the fit uses the loop about its mean (`datum`).

        Returns:
            Response at the rows, (..., n).
        """
        length = response.shape[-1]
        if self.datum is not None and not self.from_rest:
            response = response - response.mean(axis=-1, keepdims=True)
        position = self.phase * GRID
        index = position.astype(np.intp)
        ahead, part = np.minimum(index + 1, length - 1) if self.from_rest else (index + 1) % length, position - index
        rows = response.take(index % length, axis=-1)
        rows *= 1.0 - part
        rows += response.take(ahead, axis=-1) * part
        if self.datum is not None and self.from_rest:
            rows = rows - np.average(rows, axis=-1, weights=self.weights)[..., None]
        return rows

    @property
    def size(self) -> int:
        """Number of residuals: the rows of the loop or its bins of phase, or 2 if only the first harmonic is used."""
        return 2 if self.fundamental_only else int(self.measured_force.size)

    @cached_property
    def residual_count(self) -> int:
        """Number of residuals with weight, for degrees of freedom; if noise is correlated, the equivalent number."""
        if self.fundamental_only:
            return 2
        return round(self.row_noise.observed_share * np.count_nonzero(self._usable_rows))

    @property
    def independent_count(self) -> float:
        """Number of independent residuals, which determines the uncertainty of a mean over the loop."""
        return self.residual_count / (1.0 if self.fundamental_only else self.row_noise.rows_as_one)

    @property
    def response_size(self) -> Array:
        """Half the range of the measured force without outliers [N or N m]."""
        return np.array(self.half_range)

    @property
    def relative_noise(self) -> float:
        """Standard deviation of the noise of one row, relative to half the force range."""
        return self.noise / self.half_range

    def fundamental(self) -> Self:
        """Return the loop compared by the first harmonic of its force only."""
        return replace(self, fundamental_only=True)

    def with_independent_noise(self) -> Self:
        """Return the loop without model error and errors of the rig that all rows share."""
        return replace(self, gain_error=0.0, model_error=0.0)

    def noise_free(self, model: Model) -> Self:
        """Return the test with the response of a model in place of the measured response."""
        force = self.response(model)
        return replace(self, measured_force=force, half_range=float(np.ptp(force)) / 2.0)

    def response(self, model: Model, values: Values | None = None) -> Array:
        """Force of a model at the n rows, (..., n) [N or N m]; see `MeasuredBase`."""
        if values is None and (force := self.recall("response", model)) is not None:
            return force
        stack = model.stack(self.direction, "loop", self.conditions, values)
        force = self.interpolate_at_rows(stack.force(self.history(model.is_transient))) + (self.datum or 0.0)
        return force if values is not None else self.keep("response", model, force)

    def residual_of(self, response: Array) -> Array:
        """Whitened residuals of a modelled force, (..., size); see `MeasuredBase`."""
        return self.whiten((response - self.measured_force) * self._per_noise)

    def residual_change(self, change: Array, model: Model, added: Array | float = 0.0) -> Array:
        """Change of the whitened residuals, (..., size), due to a change of the stiffness; see `MeasuredBase`.

        Args:
            change: change of the stiffness in the first harmonic, complex (..., 1) [N/m or N m/rad].
            model, added: not used for a loop.
        """
        return np.concatenate((change.real, change.imag), axis=-1) @ self._stiffness_changes

    @cached_property
    def _stiffness_changes(self) -> Array:
        """Changes of the whitened residuals due to a stiffness of 1 and of i [N/m or N m/rad], (2, size)."""
        wave = self.coefficients[1] * np.exp(2j * np.pi * self.phase)
        return self.whiten(np.array([wave.real, -wave.imag]) * self._per_noise)

    def relative_difference(self, model: Model) -> Array:
        """Model minus measured force at each row, relative to half the measured force range, (1, n)."""
        return (self._difference(model) / self.response_size)[None]

    def misfit(self, model: Model) -> Array:
        """Model minus measured force at each row, in units of the row's noise, (n,); 0 at rows without weight."""
        return self._difference(model) * self._per_noise

    def distance(self, model: Model) -> Array:
        """Absolute difference between model and measured force at each row, in units of noise, (n,)."""
        return np.abs(self.misfit(model))

    def displayed_residual(self, model: Model) -> Array:
        """Residuals for charts, model minus measured in units of noise, (size,), including points without weight."""
        return np.where(self.weights > 0.0, self.misfit(model), self._difference(model) / self.noise)

    def _difference(self, model: Model) -> Array:
        """Model minus measured force [N or N m], (n,), minus its mean, because the zero of a load cell is unknown."""
        difference = self.response(model) - self.measured_force
        return difference - np.mean(difference[self.weights > 0.0])

    def outlier_indices(self, model: Model) -> Array:
        """Indices of the rows whose force is far from the harmonics fitted to the loop, (k,); `model` is not used."""
        return self.faulty_rows["force"].rows

    def outliers(self, points: Array, model: Model) -> Iterator[Outlier]:
        """Yield file, row and distance [units of noise] of all rows that are far from the loop's harmonics.

        Args:
            points: not used for a loop; for a sweep, indices of the outliers.
            model: not used for a loop.
        """
        file = str(self.source.file) if self.source else None
        before = self.first_row + (self.test.part.first_row if self.test.part else 0)
        for column, (rows, distance) in self.faulty_rows.items():
            for row, noise_units in zip(rows.tolist(), distance.tolist(), strict=True):
                yield Outlier(self.name, file, row + before + 1, column, noise_units)

    def smooth_changes(self) -> Array:
        """Changes of the whitened residuals due to 11 smooth changes of the force by half its range, (11, size).

        The changes are a constant, and a cosine and a sine of each of five harmonics. With `fundamental_only`, all but
        the first harmonic are 0.
        """
        rows = self.force_changes(basis(self.phase, SMOOTH_HARMONICS).T)
        if self.fundamental_only:
            rows[np.delete(np.arange(len(rows)), [1, SMOOTH_HARMONICS + 1])] = 0.0
        return rows

    def gain_and_offset(self) -> Array:
        """Change of the whitened residuals due to a gain error of 100 % and an offset of half the range, (2, size)."""
        return self.shared_errors.whiten(self._unit_gain_and_offset)

    @cached_property
    def _usable_rows(self) -> Array:
        """Mask of the whitened rows that have weight and whose noise depends only on rows with weight, (n,)."""
        return self.row_noise.usable_rows(self.weights)

    @cached_property
    def _per_noise(self) -> Array:
        """Reciprocal of the standard deviation of each row's force, (n,) [1/N or 1/(N m)]; 0 for unused rows."""
        return np.sqrt(self.weights) / (self.noise * self.row_noise.row_scale)

    def _whiten_rows(self, rows: Array) -> Array:
        """Remove the autocorrelation of the noise from rows of force in units of noise, (..., n); unused rows become 0.

        If only the first harmonic is used, the result is the two components along the first harmonic, (..., 2).
        """
        white = self.row_noise.whiten(rows)
        white *= self._usable_rows
        return white @ self._fundamental if self.fundamental_only else white

    def force_changes(self, waves: Array) -> Array:
        """Changes of the whitened residuals, (c, size), by changes of the force in units of half its range, (c, n)."""
        return self.whiten(waves * (self._per_noise * self.half_range))

    def whiten(self, difference: Array) -> Array:
        """Whiten changes of the force at the rows, in units of noise, (..., n); return residuals, (..., size)."""
        return self.shared_errors.whiten(self._whiten_rows(difference))

    @cached_property
    def _fundamental(self) -> Array:
        """Orthonormal basis of the changes of the n whitened rows by the first harmonic of the force, (n, 2)."""
        waves = self.row_noise.whiten(basis(self.phase, 1).T[1:] * self._per_noise)
        return np.linalg.qr((waves * self._usable_rows).T)[0]

    @cached_property
    def _unit_gain_and_offset(self) -> Array:
        """Changes of the whitened rows due to a gain error of 100 % and an offset of half the force range, (2, size).

        Notes: the gain error acts on the force without its noise. With noise, a fit would attribute noise to the gain,
        and bias the model towards small forces (Peelle's puzzle: R. Fruehwirth, D. Neudecker, H. Leeb, EPJ Web of
        Conferences 27 (2012) 00008).
        """
        waves, weighed = basis(self.phase, SMOOTH_HARMONICS), self.weights > 0.0
        smooth = waves @ np.linalg.lstsq(waves[weighed], self.measured_force[weighed], rcond=None)[0]
        return self._whiten_rows(np.array([smooth, np.full_like(smooth, self.half_range)]) * self._per_noise)

    @cached_property
    def shared_errors(self) -> SharedErrors:
        """Errors that all rows of the loop share: the model error, or without one the errors of the rig.

        The zero of a load cell is uncertain by the class of its gain, relative to half the force range. A gain error
        that the weights of the residuals exclude is left out.
        """
        if self.model_error:
            return self.model_errors
        return SharedErrors.from_columns(self.gain_error * self._unit_gain_and_offset[::-1][: 1 + self.gain_weighs])

    @cached_property
    def unit_model_error(self) -> SharedErrors:
        """Error of the model's force with a standard deviation of 100 % of half the force range, to be scaled.

        It is a sum of independent errors: cosine and sine of harmonics 1 to 25, of equal size up to the fifth and
        falling as 1/h above, and an offset; for a loop from rest, also the same harmonics in the first cycle alone, and
        a drift.
        """
        phase = self.phase
        waves = basis(phase, _ERROR_HARMONICS).T[1:] * np.tile(_ERROR_SIZES, 2)[:, None]
        if self.from_rest:  # the first cycle has its error and a drift
            order = np.arange(2.0 * np.ceil(self.cycles))[:, None]
            drift = np.cos(np.pi * order * phase / self.cycles) / (1.0 + order)
            waves = np.concatenate((waves, waves * (phase < 1.0), drift))
        rows = self._whiten_rows(waves * (self._per_noise * self.half_range))
        return SharedErrors.from_columns(np.concatenate((rows, _ERROR_SIZES[:1, None] * self._unit_gain_and_offset[1])))

    @cached_property
    def model_errors(self) -> SharedErrors:
        """Error of the model with the standard deviation `model_error`, as correlated errors of the residuals.

        Without `first_harmonic_errs`, the rig's gain error replaces the first harmonic of the force.
        """
        errors = replace(self.unit_model_error, deviations=self.model_error * self.unit_model_error.deviations)
        if self.first_harmonic_errs:
            return errors
        waves = basis(self.phase, 1).T[1:] * (self._per_noise * self.half_range)
        first = errors.components(self.model_error * _ERROR_SIZES[0] * self._whiten_rows(waves))
        gain = errors.components(self.gain_error * self._unit_gain_and_offset[0])
        covariance = np.diag(np.square(errors.deviations)) - first.T @ first + np.outer(gain, gain)
        variance, rotation = np.linalg.eigh(covariance)  # along the same directions, which are large
        return replace(errors, deviations=np.sqrt(np.maximum(variance, 0.0)), rotation=rotation)

    def noise_sensitivity(self, influence: Array) -> dict[Hashable, Array]:
        """Change of the weights of the residuals in k estimates by an error of the noise; see `MeasuredBase`."""
        reaction = self.shared_errors.whiten(influence)
        parts = self.row_noise.noise_sensitivity(reaction)
        if not parts and self.test.noise is None:
            rows = round(self.row_noise.observed_share * np.count_nonzero(self._usable_rows))
            parts = [np.sqrt(2.0 / rows) * reaction]
        return {(self.name, index): self.shared_errors.whiten(part) for index, part in enumerate(parts)}

    def extra_covariance(self, influence: Array) -> Array:
        """Covariance to add to that of k parameter estimates, for errors that the weights of the fit lack, (k, k).

        The gain error is added. The model error of the first harmonic is subtracted, because a smooth error of the
        model, which the fit adds separately, contains it.

        Args:
            influence: change of each estimate per unit of each of the n whitened residuals of this loop, (k, n).
        """
        first = self.model_error * _ERROR_SIZES[0] * self.force_changes(basis(self.phase, 1).T[1:])
        both = influence @ np.vstack((first, self.gain_error * self.gain_and_offset()[0])).T
        return np.asarray(both * (-1.0, -1.0, 1.0) @ both.T)
