"""Master curve: sweeps at several temperatures shifted to 23 degC over reduced frequency, and their shift factors."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array, RubberConditions
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.reading.measurement import Sweep

#: Tolerance of the fit of a sweep's individual shift factor, far below its error.
_ACCURACY = 1e-12
#: Step of the shift parameter for its slope, in standard errors.
_APART = 1e-3
#: Frequencies from which on a sweep can be shifted along them.
_FREQUENCIES = 3
#: The parameter that shifts the time scale.
SHIFT = "temperature.shift"


@dataclass(frozen=True, eq=False)
class ShiftedSweep:
    """A sweep shifted to the reference temperature of 23 degC.

    Args:
        sweep: sweep as fitted, at its own temperature.
        temperature: mean temperature of its points [K].
        shift: natural log of the shift factor a_T of the fitted law, and its standard error; nan if unknown.
        best_shift: ln a_T that fits this sweep best with all other parameters as fitted, and its standard error.
        reduced_frequency: frequency times a_T of each point [Hz], (n,).
        reduced_stiffness: measured stiffness reduced to 23 degC, complex [N/m or N m/rad], (n,): the measured value
            times the model's stiffness at 23 degC and f a_T, divided by the model's stiffness at the conditions of the
            point.
    """

    sweep: MeasuredSweep
    temperature: float
    shift: tuple[float, float]
    best_shift: tuple[float, float]
    reduced_frequency: Array
    reduced_stiffness: Array


def master_curve(result: Result, sweeps: Sequence[MeasuredSweep]) -> tuple[ShiftedSweep, ...]:
    """Shift sweeps at several temperatures to 23 degC, by a fitted model with an effect of temperature.

    Args:
        result: result of the fit.
        sweeps: sweeps; those over frequency whose temperature is known are shifted.

    Returns:
        The shifted sweeps, coldest first.
    """
    model, curves = result.model, []
    for sweep in sweeps:
        if can_shift(sweep.test):
            pace = np.broadcast_to(model.shift_factor(sweep.conditions), sweep.frequency.shape)
            at_reference = model.stiffness(sweep.direction, sweep.frequency * pace, sweep.amplitude)
            reduced = sweep.measured * at_reference / sweep.response(model)
            temperature = float(np.mean(sweep.temperature))
            law, stderr = model.values[SHIFT], result.covariance.stderr(SHIFT)
            near = (model.with_values({SHIFT: law + share * (stderr or 0.0)}) for share in (-_APART, 0.0, _APART))
            low, shift, high = (float(np.log(one.shift_factor(RubberConditions(temperature)))) for one in near)
            error = abs(high - low) / (2.0 * _APART) if stderr else np.nan
            further, unsure = _further_shift(model, sweep)
            laws = (shift, error), (shift + further, unsure)
            curves.append(ShiftedSweep(sweep, temperature, *laws, sweep.frequency * pace, reduced))
    return tuple(sorted(curves, key=lambda curve: curve.temperature))


def can_shift(sweep: Sweep) -> bool:
    """True if a sweep can be part of a master curve: it is over frequency, and its temperature is known."""
    return sweep.temperature is not None and np.unique(sweep.frequency).size >= _FREQUENCIES


def _further_shift(model: Model, sweep: MeasuredSweep) -> tuple[float, float]:
    """Fit the remaining shift of a sweep along ln frequency relative to the model.

    Returns:
        Addition to the model's ln a_T, and its standard error; nan if the stiffness does not change with frequency.

    Notes: least squares with equal weights, because the residuals are mostly not noise.
    """
    from scipy.optimize import least_squares  # slow to import

    place, conditions = sweep.direction, sweep.conditions

    def difference(shift: Array) -> Array:
        """Difference between shifted model and measurement relative to the measurement, real then imaginary parts."""
        frequency = sweep.frequency * np.exp(shift)
        ratio = model.stiffness(place, frequency, sweep.amplitude, conditions=conditions) / sweep.measured
        return np.concatenate((ratio.real - 1.0, ratio.imag))

    fit = least_squares(difference, 0.0, xtol=_ACCURACY, ftol=_ACCURACY, gtol=_ACCURACY)
    if not (size := float(np.linalg.norm(np.asarray(fit.jac)))):
        return np.nan, np.nan
    return float(fit.x.item()), float(np.linalg.norm(fit.fun) / np.sqrt(fit.fun.size - 1.0) / size)
