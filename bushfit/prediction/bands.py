"""95 % bands of predictions: errors of parameters and model, over all models that the tests do not rule out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from bushfit.effects import Level
from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import stiffness_and_slopes
from bushfit.prediction.conditions import OperatingPoints


@dataclass(frozen=True, eq=False)
class Band:
    """Predicted quantity at n operating points or times, with its 95 % band.

    Args:
        value, low, high: prediction, and lower and upper end of its 95 % band, (n,) each.
        root: changes of the quantity due to one standard deviation of each of r independent errors, (r, n). The
            standard error of the quantity is the root of the sum of their squares. r is 0 if the uncertainty is
            unknown.
    """

    value: Array
    low: Array
    high: Array
    root: Array = field(default_factory=lambda: np.empty((0, 1)))

    @property
    def ends(self) -> Array:
        """Value, low and high end of the band in three rows, (3, n)."""
        return np.array([self.value, self.low, self.high])

    def logarithm(self) -> Band:
        """Band of the natural logarithm of the (positive) quantity."""
        low, high = (np.log(self.value) + end / self.value - 1.0 for end in (self.low, self.high))
        return Band(np.log(self.value), low, high, self.root / self.value)

    def minus(self, subtrahend: Band) -> Band:
        """Band of this quantity minus `subtrahend`, of the same unit and points, with independent errors.

        Notes: the distance from the difference to an end of its band is the root sum of squares of the distances in the
        two bands (G. Zou, A. Donner, Stat. Med. 27 (2008) 1693).
        """
        value = self.value - subtrahend.value
        low = value - np.hypot(self.value - self.low, subtrahend.high - subtrahend.value)
        high = value + np.hypot(self.high - self.value, subtrahend.value - subtrahend.low)
        return Band(value, low, high, np.concatenate((self.root, -subtrahend.root)))


def car_models(model: Model, unresolved: Sequence[str]) -> list[Model]:
    """List the models that may describe the bushing away from the test rig, as in a car.

    Effects of the rig are left out. If the tests do not show whether an effect belongs to the bushing or to the rig
    (it is unresolved), there is a model with and one without the effect.

    Args:
        model: fitted model.
        unresolved: names of effects that belong either to the bushing or to the rig.

    Returns:
        Models; the first has all unresolved effects, the last has none.
    """
    bare = model.without(Level.INSTRUMENT)
    count = range(len(unresolved) + 1)
    return [bare.without(*names) for size in count for names in combinations(unresolved, size)]


def agreeing_models(result: Result, *, rig: bool = False) -> list[tuple[Result, Model]]:
    """List the models that agree with the tests, the fitted model first; a band spans the predictions of all of them.

    Args:
        result: fitted result.
        rig: True to include the effects of the rig, as in the tests; False for the bushing alone, as in a car.

    Returns:
        Pairs of a model and, before it, the result with the errors of its parameters. First the fitted model with each
        subset of the effects that belong either to bushing or rig, with `result`; then the alternatives that a
        diagnosis could not distinguish, with results that have no model error.
    """
    models = [(result, model) for model in ([result.model] if rig else car_models(result.model, result.unresolved))]
    resolved = {*result.model.effects} - {*result.unresolved}
    for rival in result.alternatives:
        explained = replace(result, model=rival.model, model_error=None, covariance=rival.covariance)
        twins = [effect.name for effect in rival.model.records if effect.twins and effect.name not in resolved]
        models += [(explained, model) for model in ([rival.model] if rig else car_models(rival.model, twins))]
    return models


def envelope(bands: Sequence[Band]) -> Band:
    """Band of the first prediction, widened to include the bands of all other predictions."""
    low, high = (np.array([getattr(band, end) for band in bands]) for end in ("low", "high"))
    return replace(bands[0], low=low.min(axis=0), high=high.max(axis=0))


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Errors of a prediction with one model: errors of the parameters, and of the model itself.

    Args:
        covariance: covariance of the k uncertain parameters of the model.
        scale: factor for the parameter errors at each point, (n,): 1, or less within the tested range if the result has
            an error of the model, which replaces parameter errors there.
        relative: complex relative changes of the stiffness due to e independent errors of the model, (e, n).
    """

    covariance: Covariance
    scale: Array
    relative: Array

    def band(self, value: Array, slopes: Array) -> Band:
        """95 % band of a quantity at n points.

        Args:
            value: the quantity, (n,).
            slopes: derivatives with respect to the k uncertain parameters; then changes due to one standard deviation
                of each of e errors of the model, (k + e, n).
        """
        count = len(self.covariance.names)
        half = np.hypot(
            self.scale * self.covariance.half_width(slopes[:count]), Z95 * np.linalg.norm(slopes[count:], axis=0)
        )
        root = np.concatenate((self.scale * (self.covariance.root.T @ slopes[:count]), slopes[count:]))
        return Band(value, value - half, value + half, root)


def uncertainty(result: Result, model: Model, points: OperatingPoints) -> Uncertainty:
    """Collect the errors of a prediction with one model at operating points.

    Args:
        result: fitted result, which provides the covariance and the model error.
        model: the fitted model or a variant with fewer or other effects.
        points: operating points.

    Returns:
        Errors of parameters and model. An unnamed correction or a model error adds an error of the real and an error of
        the imaginary part. Within the measured range these replace the errors of the parameters, except the errors of
        effects that `model` lacks: the measured stiffness minus an effect is as uncertain as the effect. An untested
        direction of a bushing gets the model error of the tested directions at equal strain.
    """
    place, frequency, amplitude, conditions = points
    names = [name for name in result.covariance.names if name in model.values]
    covariance = result.covariance.select(names)
    correction = model.unnamed or (result.model_error and result.model_error.with_untested(place))
    if not correction:
        return Uncertainty(covariance, np.ones(frequency.size), np.empty((0, frequency.size)))
    share, error, weight = correction.evaluate(
        model.setting(place, conditions=conditions), 2.0 * np.pi * frequency, amplitude
    )
    relative = error / (1.0 + share) if model.unnamed else np.hypot(error, [share.real, share.imag])
    left_out = result.covariance.select([name for name in result.covariance.names if name not in model.values])
    stiffness, slopes = stiffness_and_slopes(
        result.model, place, frequency, amplitude, left_out.names, conditions=conditions
    )
    errors = np.concatenate((np.array([[1.0], [1.0j]]) * relative, left_out.root.T @ slopes / stiffness))
    return Uncertainty(covariance, np.sqrt(1.0 - np.square(weight)), errors)


def expected_error(result: Result, place: Place, loss_factor: Array) -> Uncertainty:
    """Expected error of a fitted result, as independent errors of the gain and the phase of the stiffness.

    Args:
        result: fitted result, which states the expected error of each tested direction.
        place: direction or specimen.
        loss_factor: predicted loss factor at each point, (n,).

    Returns:
        Errors whose 95 % bands of |K| and loss factor are the expected errors; zero in a direction that was not tested.
    """
    sizes = {error.place: (error.stiffness, error.loss_factor) for error in result.usable}
    gain, phase = sizes.get(str(place), (0.0, 0.0))
    relative = np.array([gain + 0.0 * loss_factor, 1j * phase / (1.0 + loss_factor**2)]) / Z95
    return Uncertainty(Covariance(), np.ones(loss_factor.size), relative)
