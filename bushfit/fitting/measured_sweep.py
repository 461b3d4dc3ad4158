"""One measured sweep with its noise: dynamic stiffness over frequency and amplitude."""

from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from bushfit.campaign.schema import Residuals
from bushfit.caveat import Caveat
from bushfit.effects.contract import Array, RubberConditions, Values
from bushfit.fitting.measured_test import MeasuredBase
from bushfit.fitting.noise import SweepNoise
from bushfit.fitting.outliers import contradictions, outlying_points
from bushfit.fitting.repeats import FLOOR
from bushfit.fitting.shared_errors import SharedErrors
from bushfit.model.model import Model
from bushfit.model.result import Outlier
from bushfit.reading.measurement import Sweep
from bushfit.units import number

#: Largest number of pairs of rows that a sentence lists.
_MOST_LISTED = 4
#: Magnitudes are reported as rounded if there are at most this many distinct ones per point, with a median relative
#: step of at least the second value.
_FEW_SIZES, _COARSE = 0.4, 0.01
#: Number of decimals of ln|K| at which two magnitudes are equal.
_DIGITS = 9
#: Conditions of the rubber that repeats of a point share: a model that depends on no others has one response for them.
_SAME_IN_REPEATS = {"temperature", "preload"}


@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredSweep(MeasuredBase):
    """Measured sweep: dynamic stiffness at n points, with residuals in gain and phase.

    `MeasuredBase` documents the methods of every test. A run (block) is one recording at a constant amplitude or
    frequency, and a level is the set of all runs (repeats) with the same constant value. Points are sorted by constant
    value, repeat and step. The residual ln(K/K_meas) of model K has the gain error in its real and the phase error in
    its imaginary part.

    Args:
        test: measured data.
        noise: noise of the campaign's sweeps.
        residuals: definition of the residuals: "complex", or magnitude and loss factor.
        weights: weight of each point, 0 to 1, (n,) in `order`, or (1,) for all points alike.
        part: indices of the rows of the sweep that are used, (n,) in `order`; None for all rows.
        order: index of the row of each of the n used points in the sweep, (n,).
        frequency, amplitude, measured: frequency [Hz], zero-to-peak amplitude [m or rad] and complex stiffness [N/m or
            N m/rad] of each point, (n,) each.
        run_level: quantity that is constant in the run of each point, (n,): amplitude [m or rad], frequency [Hz] or
            number of the run.
        step: value that changes from point to point of the run, (n,): frequency [Hz] or amplitude [m or rad].
        repeat: number of the repeat of each point, (n,).

    Notes:
        Within a run of points with random noise s_i and a shared error t the covariance is V = diag(s_i^2) + t^2 1 1^T.
        All runs of a level may also share an error, u^2 1 1^T over the level. A deviation is whitened by dividing it by
        s_i and removing the error shared by its block; then the error shared by its level is removed in the same way. A
        point of weight w has s_i^2 = s^2/w; a point of weight 0 has no effect, not even on shared errors.
    """

    test: Sweep
    noise: SweepNoise
    residuals: Residuals = "complex"
    weights: Array = field(default_factory=lambda: np.ones(1))
    part: Array | None = None
    order: Array = field(init=False, repr=False)
    frequency: Array = field(init=False, repr=False)
    amplitude: Array = field(init=False, repr=False)
    run_level: Array = field(init=False, repr=False)
    step: Array = field(init=False, repr=False)
    repeat: Array = field(init=False, repr=False)
    measured: Array = field(init=False, repr=False)
    kind = "sweep"
    components = ("storage", "loss")

    def __post_init__(self) -> None:
        sweep = self.test
        order = np.lexsort((sweep.step, sweep.repeat, sweep.run_level)) if self.part is None else self.part
        arrays = sweep.frequency, sweep.amplitude, sweep.run_level, sweep.step, sweep.repeat, sweep.stiffness
        names = "frequency", "amplitude", "run_level", "step", "repeat", "measured"
        for name, array in zip(names, arrays, strict=True):
            object.__setattr__(self, name, array[order])
        object.__setattr__(self, "order", order)
        object.__setattr__(self, "weights", np.broadcast_to(self.weights, order.shape))

    @cached_property
    def notes(self) -> list[Caveat]:
        """Warnings on the file, repeats that differ, contradictory tests, and rounded values."""
        file = self.source.file if self.source else self.name
        notes = [*self.source.notes] if self.source else []
        points = np.unique([self.frequency, self.amplitude], axis=1, return_inverse=True)[1]
        if pairs := contradictions(self.measured, points):
            rows = [f"{one} and {second}" for _, *pair in pairs for one, second in [sorted(self.order[pair] + 1)]]
            more = f" and {len(rows) - _MOST_LISTED} more pairs" if len(rows) > _MOST_LISTED else ""
            difference = f"repeats of the same points differ by up to {number(100.0 * pairs[0][0], 2)} %"
            listed = f"rows {', '.join(rows[:_MOST_LISTED])}{more}"
            notes.append(Caveat("points_differ", f"{difference}, {listed}").about(file))
        if self.contradiction:
            notes.append(self.contradiction)
        sizes = np.unique(np.log(np.abs(self.measured)).round(_DIGITS))
        step = float(np.median(np.diff(sizes))) if sizes.size > 2 else 0.0
        if sizes.size <= _FEW_SIZES * self.measured.size and step >= _COARSE:
            coarse = f"{sizes.size} magnitudes at {self.measured.size} points, {number(100.0 * step, 2)} % apart"
            rounded = "they are rounded, and the rounding error is included in the noise; save more digits"
            notes.append(Caveat("rounded", f"{coarse}: {rounded}").about(file))
        return [*notes, *filter(None, [self.noise.excess_warnings.get(self.name)])]

    @property
    def temperature(self) -> Array:
        """Temperature of the rubber at each point of the sweep [K], (n,); nan if unknown."""
        kelvin = np.nan if self.test.temperature is None else self.test.temperature
        return np.broadcast_to(kelvin, self.test.frequency.size)[self.order]

    @property
    def size(self) -> int:
        """Number of residuals of the sweep: gain and phase of each of the n points."""
        return 2 * int(self.order.size)

    @property
    def residual_count(self) -> int:
        """Number of residuals of points with weight, for degrees of freedom."""
        return 2 * int(np.count_nonzero(self.weights))

    @property
    def independent_count(self) -> float:
        """Number of independent residuals, which determines the uncertainty of a mean over the sweep."""
        return float(self.residual_count)

    @property
    def relative_noise(self) -> float:
        """Standard deviation of the random error of a point, relative to |K|: RMS over gain and phase of all sweeps."""
        return float(np.sqrt(np.mean(np.square(list(self.noise.random.values())))))

    def without(self, points: Array) -> Self:
        """Return the sweep with weight 0 at the points with the given indices."""
        return self.weighted(np.isin(np.arange(self.frequency.size), points, invert=True)) if points.size else self

    def select(self, points: Array) -> Self:
        """Return the sweep with only the points for which the mask `points`, (n,), is True."""
        return replace(self, weights=self.weights[points], part=self.order[points])

    def with_weight(self) -> Self:
        """Return the sweep with only those points that have weight."""
        weighed = self.weights > 0.0
        return self if weighed.all() else self.select(weighed)

    def noise_free(self, model: Model) -> Self:
        """Return the sweep with the stiffness of a model in place of the measured stiffness."""
        stiffness = self.test.stiffness.copy()
        stiffness[self.order] = self.response(model)
        return replace(self, test=replace(self.test, stiffness=stiffness))

    @cached_property
    def conditions(self) -> RubberConditions:
        """Temperature of the rubber and its earlier strains at each of the n points."""
        return self.test_conditions.select(self.order)

    @cached_property
    def block_starts(self) -> Array:
        """Index of the first point of each run (one recording at a constant amplitude or frequency), (runs,)."""
        label = np.stack((self.run_level, self.repeat.astype(float)))
        return np.concatenate(([0], 1 + np.flatnonzero(np.any(np.diff(label), axis=0))))

    @cached_property
    def reached(self) -> Array:
        """Zero-to-peak amplitude that the rig reached at each point [m or rad], (n,), where models are evaluated."""
        return self.test.amplitude_reached[self.order]

    @cached_property
    def _distinct_points(self) -> tuple[Array, RubberConditions, Array]:
        """Operating points without repeats.

        Returns:
            Index of one point for each distinct frequency, amplitude and temperature, (m,); their conditions; and, for
            each point of the sweep, the position of its equal among these, (n,).
        """
        temperature = 0.0 if self.conditions.temperature is None else self.conditions.temperature
        keys = np.stack(np.broadcast_arrays(self.frequency, self.reached, temperature))
        _, points, repeats = np.unique(keys, axis=1, return_index=True, return_inverse=True)
        return points, self.conditions.select(points), repeats.ravel()

    def response(self, model: Model, values: Values | None = None) -> Array:
        """Return the stiffness of a model at the n points, (..., n) [N/m or N m/rad]; see `MeasuredBase`."""
        if values is None and (stiffness := self.recall("response", model)) is not None:
            return stiffness
        every = np.arange(self.order.size)
        repeated = model.depends_on <= _SAME_IN_REPEATS
        points, conditions, repeats = self._distinct_points if repeated else (every, self.conditions, every)
        stack = model.stack(self.direction, "sweep", conditions, values)
        stiffness = stack(2.0 * np.pi * self.frequency[points], self.reached[points])[..., repeats]
        return stiffness if values is not None else self.keep("response", model, stiffness)

    def residual_of(self, response: Array) -> Array:
        """Whitened residuals of a modelled stiffness, (..., 2 n); see `MeasuredBase`."""
        return self.whiten(self.deviation(response))

    def residual_change(self, change: Array, model: Model, added: Array | float = 0.0) -> Array:
        """Change of the whitened residuals due to a change of the stiffness; see `MeasuredBase`.

        Args:
            change, added: change of the stiffness, and added stiffness, at each point, complex (..., n).
            model: model whose stiffness changes.

        Returns:
            Changes, (..., 2 n): of n gains, then of n phases.
        """
        stiffness = self.response(model) + added
        relative = change / stiffness
        if self.residuals == "complex":
            return self.whiten(relative)
        gain = np.abs(stiffness / self.measured) * relative.real
        loss = relative.imag * (np.abs(stiffness) / stiffness.real) ** 2
        return self.whiten(gain + 1j * loss * self._phase_per_loss)

    def deviation(self, stiffness: Array) -> Array:
        """Difference between a stiffness and the measured stiffness, before whitening.

        Args:
            stiffness: stiffness at the points of the sweep, complex (..., n) [N/m or N m/rad].

        Returns:
            Stiffness minus measurement, complex (..., n): relative difference in |K| + i difference in phase [rad].
        """
        with np.errstate(divide="ignore", invalid="ignore"):  # the stiffness is zero within free play
            if self.residuals == "complex":
                ratio = stiffness / self.measured
                return np.log(np.abs(ratio)) + 1j * np.angle(ratio)  # five times as fast as a complex log
            gain = np.abs(stiffness / self.measured) - 1.0
            loss = stiffness.imag / stiffness.real - self.measured.imag / self.measured.real
            return gain + 1j * loss * self._phase_per_loss

    @cached_property
    def _phase_per_loss(self) -> Array:
        """Derivative of the phase with respect to the loss factor eta at each point, 1/(1 + eta^2), (n,)."""
        return (self.measured.real / np.abs(self.measured)) ** 2

    @cached_property
    def random_noise(self) -> Array:
        """Standard deviation of the random error of each point in relative gain and in phase [rad], (2, n)."""
        if self.test.relative_error is not None and self.test.noise is None:
            return np.maximum(np.tile(self.test.relative_error[self.order], (2, 1)), FLOOR)
        return self.noise.random_noise(self.name, self.run_level, self.step)

    @cached_property
    def per_noise(self) -> Array:
        """Square root of the weight over the random noise, of n gains, then of n phases [1/rad], (2 n,)."""
        return (np.sqrt(self.weights) / self.random_noise).ravel()

    @cached_property
    def _run(self) -> Array:
        """Number of the run of each gain, then of each phase, plus the number of runs for phases, (2 n,)."""
        starts = self.block_starts
        run = np.repeat(np.arange(starts.size), np.diff(starts, append=self.order.size))
        return np.concatenate((run, run + starts.size))

    @cached_property
    def run_errors(self) -> SharedErrors:
        """Gain and phase error of each run, as correlated errors of the deviations in units of random noise, (2 n,)."""
        return SharedErrors.of_groups(self._run[: self.order.size], self.per_noise, self.noise.shared)

    def _level_errors(self, per_noise: Array) -> SharedErrors:
        """Gain and phase error of each level, as correlated errors of the deviations multiplied by `per_noise`."""
        return SharedErrors.of_groups(np.unique(self.run_level, return_inverse=True)[1], per_noise, self.noise.level)

    @cached_property
    def level_errors(self) -> SharedErrors:
        """Gain and phase error of each level, as correlated errors of deviations whitened by `run_errors`, (2 n,)."""
        return self._level_errors(self.per_noise / np.hypot(1.0, self.run_errors.deviations)[self._run])

    @cached_property
    def unit_model_error(self) -> SharedErrors:
        """Error of the model of 100 % of |K| in phase and in quadrature, shared by repeats of a point, to be scaled."""
        points = np.unique(self.frequency + 1j * self.amplitude, return_inverse=True)[1]
        return SharedErrors.of_groups(points, self.per_noise, (1.0, 1.0))

    def whiten(self, difference: Array) -> Array:
        """Divide deviations by their noise and remove the correlation that errors shared by points cause.

        With a model error, the errors shared by runs and levels are not part of this noise: the model error is larger
        and differs between levels too, so the rig's smaller error must not reduce the weight of a level.

        Args:
            difference: relative differences in magnitude + i differences in phase [rad], complex (..., n).

        Returns:
            Whitened residuals in units of noise, (..., 2 n): n gains, then n phases.
        """
        with np.errstate(invalid="ignore"):
            rows = np.concatenate((difference.real, difference.imag), axis=-1) * self.per_noise
            if self.model_error:
                return self.model_errors.whiten(rows)
            return self.level_errors.whiten(self.run_errors.whiten(rows))

    def noise_sensitivity(self, influence: Array) -> dict[Hashable, Array]:
        """Change of the weights of the residuals in k estimates by an error of the noise; see `MeasuredBase`.

        Returns:
            Changes of `influence`, (k, 2 n), by identifier of the noise variance.

        Notes:
            Within a run the derivatives of V are I with respect to s^2 and 1 1^T with respect to t^2; whitened, W^2
            and (W 1)(W 1)^T. The estimate of t^2 is a mean of `freedom` squares with expectation t^2 + s^2/n; its error
            is limited to t^2. The same applies to errors shared by levels.
        """
        runs, levels, noise, reactions = self.run_errors, self.level_errors, self.noise, dict[str, Array]()
        rows = levels.whiten(influence)
        if noise.random_freedom:
            reactions["scatter"] = levels.whiten(runs.whiten(runs.whiten(rows))) * np.sqrt(2.0 / noise.random_freedom)
        if noise.freedom:
            variance = np.square(runs.deviations)
            _, first, counts = np.unique(self._run, return_index=True, return_counts=True)
            scatter = np.bincount(self._run, np.square(self.per_noise)) * np.square(self.random_noise.ravel()[first])
            error = np.minimum((variance + scatter / counts) * np.sqrt(2.0 / noise.freedom), variance)
            reactions["shared"] = levels.whiten(runs.multiply(rows, error / (1.0 + variance)))
        if noise.level_freedom:
            variance = np.square(levels.deviations)
            error = np.minimum((variance + 1.0) * np.sqrt(2.0 / noise.level_freedom), variance)
            reactions["level"] = levels.multiply(rows, error / np.hypot(1.0, levels.deviations))
        is_gain = np.arange(self.size) < self.order.size
        return {
            (id(noise), kind, part): reaction * only
            for kind, reaction in reactions.items()
            for part, only in enumerate((is_gain, ~is_gain))
        }

    def extra_covariance(self, influence: Array) -> Array:
        """Covariance to add to that of k parameter estimates, for errors that the weights of the fit lack, (k, k).

        If the fit assumes a model error, errors shared by runs and levels are added; the independent model error is
        subtracted, because a smooth error of the model, which the fit adds separately, contains it.

        Args:
            influence: change of each estimate per unit of each of the 2 n whitened residuals of this sweep, (k, 2 n).
        """
        whitened = self.model_errors.whiten(influence)
        added = self.run_errors.covariance(whitened) + self._level_errors(self.per_noise).covariance(whitened)
        return np.asarray(added - self.model_errors.covariance(whitened))

    def with_independent_noise(self) -> Self:
        """Return the sweep with random noise alone, without model error and errors that runs and levels share."""
        return replace(self, noise=replace(self.noise, shared=(0.0, 0.0), level=(0.0, 0.0)), model_error=0.0)

    @property
    def response_size(self) -> Array:
        """Magnitude of the measured stiffness of each point, (n,) [N/m or N m/rad]."""
        return np.abs(self.measured)

    def relative_difference(self, model: Model) -> Array:
        """Model minus measured stiffness relative to the measured |K|: real and imaginary part, (2, n)."""
        difference = (self.response(model) - self.measured) / self.response_size
        return np.stack((difference.real, difference.imag))

    def normalise(self, deviation: Array, *, shared: bool = True) -> Array:
        """Divide the deviations in gain and phase by the random noise of each point, without whitening.

        Args:
            deviation: relative differences in magnitude + i differences in phase [rad], complex (n,).
            shared: True to subtract the likeliest error that all points of a run share.

        Returns:
            Gain and phase of each point in units of the random noise, (2, n).
        """
        rows = np.concatenate((deviation.real, deviation.imag))
        if shared:
            squares = np.square(self.per_noise)
            sums, weights = (np.bincount(self._run, values) for values in (rows * squares, squares))
            variance = np.repeat(np.square(self.noise.shared) + np.square(self.noise.level), weights.size // 2)
            rows = rows - (sums * variance / (1.0 + variance * weights))[self._run]
        return rows.reshape(2, -1) / self.random_noise

    def distance(self, model: Model) -> Array:
        """Distance of each point from the model in units of noise, (n,): RMS of gain and phase, less shared errors."""
        return np.hypot(*self.normalise(self.deviation(self.response(model)))) / np.sqrt(2.0)

    def displayed_residual(self, model: Model) -> Array:
        """Whitened residuals for charts, (2 n,); points without weight are divided by their random noise only."""
        deviation = self.deviation(self.response(model))
        return np.where(np.tile(self.weights > 0.0, 2), self.whiten(deviation), self.normalise(deviation).ravel())

    def outlier_indices(self, model: Model) -> Array:
        """Indices of the outliers, (k,): points far from the model and their neighbours; see `outlying_points`."""
        points, freedom = np.stack((self.frequency, self.amplitude)), self.noise.random_freedom or np.inf
        deviation = self.deviation(self.response(model))
        return outlying_points(deviation, self.normalise, self.block_starts, points, freedom)

    def outliers(self, points: Array, model: Model) -> Iterator[Outlier]:
        """Yield file, row and distance from the model [units of noise] of the points with the indices `points`."""
        file = str(self.source.file) if self.source else None
        distance = self.distance(model)[points].tolist()
        for row, noise_units in sorted(zip((self.order[points] + 1).tolist(), distance, strict=True)):
            yield Outlier(self.name, file, row, "stiffness", noise_units)

    def shared_error_columns(self, chosen: Array) -> list[Array]:
        """Change of the whitened residuals due to a gain error of 100 % and to a phase error of 1 rad, (2 n,) each.

        Args:
            chosen: mask of the points that have the error, (n,).
        """
        return [self.whiten(unit * chosen.astype(complex)) for unit in (1.0, 1.0j)]
