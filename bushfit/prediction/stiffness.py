"""Dynamic stiffness with 95 % bands at any frequency and amplitude, of the bushing as the car will have it.

Material and component effects are kept, instrument effects are left out: the car does not have the rig's faults. What
may be either's, an effect with a twin that these tests cannot tell from it, gives two readings; the bands span both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations
from typing import Any

import numpy as np

from bushfit.effects import Level
from bushfit.effects.contract import Array, Circumstances, Setting
from bushfit.errors import ModelError
from bushfit.fitting.preparation import MeasuredSweep
from bushfit.geometry import TRANSLATION, Place
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import stiffness_and_slopes
from bushfit.prediction.caveats import MARGIN, extrapolations, of_points, unfitted
from bushfit.reading.runs import nominal
from bushfit.reduction.resonance import response
from bushfit.units import number

#: Strain at which the resonance of a mass is looked for first; chosen: small for any rubber.
_SMALL_STRAIN = 1e-4
#: Lowest and highest frequency about a resonance over that of small strain.
_DECADE = (0.2, 4.0)
#: Frequencies there; chosen: 0.5 % apart, which is as near as tests tell a peak.
_RESONANCE_POINTS = 600
#: Transmissibility from which a point counts as near the peak; chosen: about 0.6 to 1.3 of the peak's frequency, where
#: the mount decides how far the mass moves.
_NEAR_PEAK = 1.5
#: What is predicted, each with its band.
_BANDS = ("stiffness", "loss_factor", "storage_stiffness", "loss_stiffness")


@dataclass(frozen=True, eq=False)
class Band:
    """A predicted quantity with its 95 % band, each (n,).

    Args:
        root: what independent errors of one standard deviation each do to the quantity, (r, n): their root sum of
            squares is its standard error; none where it has no uncertainty.
    """

    value: Array
    low: Array
    high: Array
    root: Array = field(default_factory=lambda: np.empty((0, 1)))


@dataclass(frozen=True, eq=False)
class Prediction:
    """Dynamic stiffness over operating points, sorted by amplitude, then frequency: |K|, K''/K', K' and K''.

    Args:
        frequency: [Hz], (n,).
        amplitude: zero-to-peak [m or rad], (n,).
        stiffness, storage_stiffness, loss_stiffness: [N/m or N m/rad].
        warnings: sentences on directions, frequencies and strains that were not fitted, on what differs from the
            measurement because it is left out, and on what may be the rig's.
        if_rigs: the same if what is unresolved is the rig's, which all bands here then span; None where nothing is.
        measured: complex, of the sweeps at these points, mean of the repeats, nan where there is none [N/m or N m/rad],
            (n,); None where no sweeps are known.
    """

    direction: Place
    frequency: Array
    amplitude: Array
    stiffness: Band
    loss_factor: Band
    storage_stiffness: Band
    loss_stiffness: Band
    warnings: tuple[str, ...] = ()
    if_rigs: Prediction | None = None
    measured: Array | None = None


def predict(
    result: Result,
    direction: Place,
    frequencies: Sequence[float] | Array,
    amplitudes: Sequence[float] | Array,
    *,
    rig: bool = False,
    sweeps: Sequence[MeasuredSweep] | None = None,
    temperature: float | None = None,
) -> Prediction:
    """Dynamic stiffness on a grid, with 95 % bands from the covariance of the fit (delta method).

    Frequencies are in Hz, amplitudes zero-to-peak in m or rad. With `rig` its effects are kept, as in the tests;
    `sweeps` are what was measured, to stand beside. A temperature [K] is for a model with an effect of it, which
    stands at its reference otherwise. The bands hold every model that the tests leave possible: with and without what
    may be the rig's, and with each of the effects that they cannot tell apart.

    Raises:
        ModelError: a frequency or amplitude that is not positive.
    """
    for name, given in (("frequency", frequencies), ("amplitude", amplitudes)):
        if not (np.size(given) and np.all(np.isfinite(given)) and np.min(given) > 0):
            raise ModelError(f"impossible {name} to predict at", found=str(np.asarray(given)), expected="above zero")
    amplitude, frequency = (
        axis.ravel() for axis in np.meshgrid(np.unique(amplitudes), np.unique(frequencies), indexing="ij")
    )
    at = direction, frequency, amplitude, temperature
    models = [result.model] if rig else _readings(result.model, result.unresolved)
    first, *others = (_predicted(result, model, *at) for model in models)
    explained = replace(result, model_error=None)
    alternatives = [_predicted(explained, model, *at) for model in _alternatives(result, rig=rig)]
    measured = None if sweeps is None else _measured(direction, frequency, amplitude, sweeps)
    found = replace(first, if_rigs=others[-1] if others else None, measured=measured)
    every = (first, *others, *alternatives)
    bands: dict[str, Any] = {}
    for name in _BANDS:  # from the least to the largest of all
        each_band = [getattr(each, name) for each in every]
        low, high = (np.array([getattr(band, end) for band in each_band]) for end in ("low", "high"))
        bands[name] = replace(each_band[0], low=low.min(axis=0), high=high.max(axis=0))
    points = np.array((frequency, amplitude, first.stiffness.value))
    if_rigs = others[-1].stiffness.value if others else None
    told = of_points(result, direction, points, if_rigs, None if rig else measured, temperature)
    return replace(found, **bands, warnings=tuple(told))


def _readings(model: Model, unresolved: Sequence[str]) -> list[Model]:
    """The models that the car may have: without the rig's effects, and of those that are unresolved with all first,
    with none last."""
    bare = model.without(Level.INSTRUMENT)
    count = range(len(unresolved) + 1)
    return [bare.without(*left) for size in count for left in combinations(unresolved, size)]


def _alternatives(result: Result, *, rig: bool) -> Iterator[Model]:
    """The models that may be right instead, each as the rig has it, or in all its readings."""
    for each in result.alternatives:
        known = {*result.model.effects} - {*result.unresolved}
        twins = [effect.name for effect in each.model.records if effect.twins and effect.name not in known]
        yield from [each.model] if rig else _readings(each.model, twins)


def _predicted(
    result: Result, model: Model, direction: Place, frequency: Array, amplitude: Array, temperature: float | None
) -> Prediction:
    """The prediction of one model at operating points, each (n,), with the uncertainty of the fit."""
    under = Circumstances(temperature)
    names = [name for name in result.covariance.names if name in model.values]
    covariance = result.covariance.restricted(names)
    stiffness, slopes = stiffness_and_slopes(model, direction, frequency, amplitude, names, under=under)
    open_to, beyond = _open_to(result, model, model.setting(direction, under=under), frequency, amplitude, stiffness)
    count, slopes = len(names), np.concatenate((slopes, open_to))

    def band(value: Array, slope: Array) -> Band:
        half = np.hypot(beyond * covariance.half_width(slope[:count]), Z95 * np.linalg.norm(slope[count:], axis=0))
        root = np.concatenate((beyond * (covariance.root.T @ slope[:count]), slope[count:]))
        return Band(value, value - half, value + half, root)

    relative = slopes / stiffness
    loss_factor = stiffness.imag / stiffness.real
    return Prediction(
        direction,
        frequency,
        amplitude,
        stiffness=band(np.abs(stiffness), np.abs(stiffness) * relative.real),
        loss_factor=band(loss_factor, (1.0 + loss_factor**2) * relative.imag),
        storage_stiffness=band(stiffness.real, slopes.real),
        loss_stiffness=band(stiffness.imag, slopes.imag),
    )


def _open_to(
    result: Result, model: Model, setting: Setting, frequency: Array, amplitude: Array, stiffness: Array
) -> tuple[Array, Array]:
    """What a standard deviation of each part of what has no name does to the stiffness, (0 or 2, n), and the share of
    the parameters' errors that counts beside it, (n,): among its nodes, where errors are of both together, none of
    them. A model error is told and not mended, so that it counts itself."""
    found = model.unnamed or result.model_error
    if found is None:
        return np.zeros((0, frequency.size)), np.ones(frequency.size)
    share, off, stands = found.evaluate(setting, 2.0 * np.pi * frequency, amplitude)
    parts = np.array([[1.0], [1.0j]])
    if model.unnamed:
        return parts * off * stiffness / (1.0 + share), np.sqrt(1.0 - np.square(stands))
    return parts * np.hypot(off, [share.real, share.imag]) * stiffness, np.sqrt(1.0 - np.square(stands))


def _measured(direction: Place, frequency: Array, amplitude: Array, sweeps: Sequence[MeasuredSweep]) -> Array:
    """Complex stiffness measured at operating points, each (n,): the mean of the repeats, nan where there is none."""
    mine = [sweep.with_weight() for sweep in sweeps if sweep.direction == direction]
    f, x, stiffness = (
        np.concatenate([np.empty(0), *(getattr(sweep, name) for sweep in mine)])
        for name in ("frequency", "amplitude", "measured")
    )
    far = np.minimum(*(np.abs(reached / amplitude[:, None] - 1.0) for reached in (x, nominal(x))))
    near = (np.abs(f / frequency[:, None] - 1.0) <= MARGIN) & (far <= MARGIN)
    count = near.sum(axis=1)
    return np.where(count > 0, near @ stiffness / np.maximum(count, 1), np.nan)


@dataclass(frozen=True, eq=False)
class PredictedResonance:
    """A mass [kg] on a mount whose base is shaken with a sine of constant acceleration [m/s^2], as the model has it.

    Args:
        frequency: [Hz], (n,).
        amplitude: of the mount's deformation, zero-to-peak [m], (n,).
        transmissibility: complex, acceleration of the mass over that of the base [-], (n,).
        stiffness: complex, of the mount at that frequency and amplitude [N/m], (n,).
        warnings: sentences on a place, and on frequencies and strains near the peak, that were not fitted, and on what
            may be the rig's.
        if_rigs: the same at these frequencies if what is unresolved is the rig's; None where nothing is.
    """

    place: Place
    mass: float
    base_acceleration: float
    frequency: Array
    amplitude: Array
    transmissibility: Array
    stiffness: Array
    warnings: tuple[str, ...] = ()
    if_rigs: PredictedResonance | None = None

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency of the largest transmissibility [Hz], and this |T|."""
        place = int(np.argmax(np.abs(self.transmissibility)))
        return float(self.frequency[place]), float(abs(self.transmissibility[place]))


def predict_resonance(
    result: Result,
    place: Place,
    mass: float,
    base_acceleration: float,
    frequencies: Sequence[float] | Array | None,
    *,
    temperature: float | None = None,
) -> PredictedResonance:
    """Transmissibility and amplitude of a mass [kg] on the bushing or specimen, whose stiffness depends on amplitude.

    The base is shaken at an amplitude in m/s^2; without frequencies [Hz] these are a decade about the resonance.

    Raises:
        ModelError: a place that does not count displacement and force.
    """
    if place.motion is not TRANSLATION:
        raise ModelError("no mass stands on this", found=str(place), expected="a direction or mount with a stiffness")
    bushings, *others = _readings(result.model, result.unresolved)
    under = Circumstances(temperature)
    if frequencies is None:
        small = bushings.stiffness(place, 1.0, _SMALL_STRAIN / bushings.unit_strain(place), under=under)
        about = float(np.sqrt(np.abs(small) / mass)) / (2.0 * np.pi)
        frequencies = about * np.geomspace(_DECADE[0], _DECADE[1], _RESONANCE_POINTS)
    frequency = np.asarray(frequencies, dtype=float)
    base = base_acceleration / (2.0 * np.pi * frequency) ** 2

    def shaken(model: Model) -> PredictedResonance:
        stiffness_at = partial(model.stiffness, place, frequency, under=under)
        amplitude, ratio = response(stiffness_at, mass, frequency, base)
        stiffness = stiffness_at(amplitude)
        return PredictedResonance(place, mass, base_acceleration, frequency, amplitude, ratio, stiffness)

    found, if_rigs = shaken(bushings), shaken(others[-1]) if others else None
    near = np.abs(found.transmissibility) >= min(_NEAR_PEAK, found.peak[1])
    what = f"{place}, resonance of {number(mass, 3)} kg"
    told = [
        *unfitted(result, place),
        *extrapolations(result, place, frequency[near], found.amplitude[near], temperature, what),
    ]
    if result.alternatives:
        peaks = np.array([shaken(each).peak for each in _alternatives(result, rig=False)])
        (low, least), (high, most) = peaks.min(axis=0), peaks.max(axis=0)
        span = f"{number(low, 4)} to {number(high, 4)} Hz, |T| {number(least, 4)} to {number(most, 4)}"
        told += [*result.undecided, f"{what}: {span}, by the models that the tests leave possible"]
    if if_rigs:
        there, largest = (number(each, 4) for each in if_rigs.peak)
        told.append(f"{what}: at {there} Hz, |T| {largest}, if {' and '.join(result.unresolved)} is the rig's")
    return replace(found, warnings=tuple(told), if_rigs=if_rigs)
