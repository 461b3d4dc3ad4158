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

from bushfit.effects import Level, effect_named
from bushfit.effects.contract import Array, Circumstances
from bushfit.errors import ModelError
from bushfit.fitting.data_sets import SweepData
from bushfit.geometry import TRANSLATION, Bushing, Direction, Place
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import stiffness_jacobian
from bushfit.reading.runs import nominal
from bushfit.reduction.resonance import response
from bushfit.units import number

#: Beyond the fitted range by more than this, relative to its end, a prediction is an extrapolation: rigs miss their
#: set points by less.
MARGIN = 0.01
#: Share by which a finite bulk modulus lowers the radial stiffness, from which that is said: that of the other errors.
_NOTED_LOWERING = 0.01
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
    sweeps: Sequence[SweepData] | None = None,
    temperature: float | None = None,
) -> Prediction:
    """Dynamic stiffness on a grid, with 95 % bands from the covariance of the fit (delta method).

    Frequencies are in Hz, amplitudes zero-to-peak in m or rad. With `rig` its effects are kept, as in the tests;
    `sweeps` are what was measured, to stand beside. A temperature [K] is for a model with an effect of it, which
    stands at its reference otherwise.

    Raises:
        ModelError: a frequency or amplitude that is not positive.
    """
    for name, given in (("frequency", frequencies), ("amplitude", amplitudes)):
        if not (np.size(given) and np.all(np.isfinite(given)) and np.min(given) > 0):
            raise ModelError(f"impossible {name} to predict at", found=str(np.asarray(given)), expected="above zero")
    amplitude, frequency = (
        axis.ravel() for axis in np.meshgrid(np.unique(amplitudes), np.unique(frequencies), indexing="ij")
    )
    models = [result.model] if rig else _readings(result)
    first, *others = (_predicted(result, model, direction, frequency, amplitude, temperature) for model in models)
    measured = None if sweeps is None else _measured(direction, frequency, amplitude, sweeps)
    found = replace(first, if_rigs=others[-1] if others else None, measured=measured)
    every = (first, *others)
    bands: dict[str, Any] = {name: _spanned([getattr(each, name) for each in every]) for name in _BANDS}
    told = (
        *_unfitted(result, direction),
        *_extrapolations(result, direction, frequency, amplitude),
        *_circumstances(models[0], temperature),
    )
    return replace(found, **bands, warnings=(*told, *([] if rig else _left_out(result, found))))


def _readings(result: Result) -> list[Model]:
    """The models that the car may have: without the rig's effects, and of those that are unresolved with all first,
    with none last."""
    bare = result.model.without(Level.INSTRUMENT)
    count = range(len(result.unresolved) + 1)
    return [bare.without(*left) for size in count for left in combinations(result.unresolved, size)]


def _predicted(
    result: Result, model: Model, direction: Place, frequency: Array, amplitude: Array, temperature: float | None
) -> Prediction:
    """The prediction of one model at operating points, each (n,), with the uncertainty of the fit."""
    under = Circumstances(temperature)
    stiffness = model.stiffness(direction, frequency, amplitude, under=under)
    names = [name for name in result.covariance.names if name in model.values]
    covariance = result.covariance.restricted(names)
    slopes = (
        stiffness_jacobian(model, direction, frequency, amplitude, names, under=under)
        if names
        else np.zeros((0, *stiffness.shape))
    )

    open_to, beyond = _open_to(model, direction, frequency, amplitude, stiffness)
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
    model: Model, direction: Place, frequency: Array, amplitude: Array, stiffness: Array
) -> tuple[Array, Array]:
    """What a standard deviation of each part of what has no name does to the stiffness, (0 or 2, n), and the share of
    the parameters' errors that counts beside it, (n,): among its nodes it mends what bent them."""
    if model.unnamed is None:
        return np.zeros((0, frequency.size)), np.ones(frequency.size)
    share, off, stands = model.unnamed.at(model.setting(direction), 2.0 * np.pi * frequency, amplitude)
    return np.array([[1.0], [1.0j]]) * off * stiffness / (1.0 + share), np.sqrt(1.0 - np.square(stands))


def _spanned(bands: Sequence[Band]) -> Band:
    """The first band, from the least to the largest of all."""
    low, high = (np.array([getattr(band, end) for band in bands]) for end in ("low", "high"))
    return replace(bands[0], low=low.min(axis=0), high=high.max(axis=0))


def _measured(direction: Place, frequency: Array, amplitude: Array, sweeps: Sequence[SweepData]) -> Array:
    """Complex stiffness measured at operating points, each (n,): the mean of the repeats, nan where there is none."""
    mine = [sweep.standing() for sweep in sweeps if sweep.direction == direction]
    f, x, stiffness = (
        np.concatenate([np.empty(0), *(getattr(sweep, name) for sweep in mine)])
        for name in ("frequency", "amplitude", "measured")
    )
    far = np.minimum(*(np.abs(reached / amplitude[:, None] - 1.0) for reached in (x, nominal(x))))
    near = (np.abs(f / frequency[:, None] - 1.0) <= MARGIN) & (far <= MARGIN)
    count = near.sum(axis=1)
    return np.where(count > 0, near @ stiffness / np.maximum(count, 1), np.nan)


def _left_out(result: Result, found: Prediction) -> Iterator[str]:
    """By how much the prediction differs from the measurement for want of the rig, and if what is unresolved is its."""
    place, stiffness = found.direction, found.stiffness.value
    rig, measured = rig_effects(result), found.measured
    if rig and measured is not None and not np.isnan(measured).all():
        off = percent_off(stiffness / np.abs(measured))
        yield f"{place}: without {' and '.join(rig)} the predicted stiffness is {off} against what was measured"
    if found.if_rigs:
        for name in result.unresolved:
            twins = " or ".join(effect_named(name).twins)
            yield f"{name} is taken as the bushing's, but these tests cannot tell it from {twins}"
        off = percent_off(found.if_rigs.stiffness.value / stiffness)
        yield f"{place}: stiffness {off} if {' and '.join(result.unresolved)} is the rig's; low and high span both"


def percent_off(ratio: Array) -> str:
    """How far ratios are off 1, in words: "+1.2 to +3.4 %"."""
    ends = [number(100.0 * end - 100.0, 2, "+") for end in (np.nanmin(ratio), np.nanmax(ratio))]
    return f"{' to '.join(dict.fromkeys(ends))} %"


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
    bushings, *others = _readings(result)
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
    told = [*_unfitted(result, place), *_extrapolations(result, place, frequency[near], found.amplitude[near], what)]
    if if_rigs:
        there, largest = (number(each, 4) for each in if_rigs.peak)
        told.append(f"{what}: at {there} Hz, |T| {largest}, if {' and '.join(result.unresolved)} is the rig's")
    return replace(found, warnings=tuple(told), if_rigs=if_rigs)


def caveats(result: Result) -> list[str]:
    """Sentences on what holds of a model's prediction in every direction."""
    lines = []
    if "springpot" not in result.model.effects:
        lines.append("the model has no springpot: its stiffness does not depend on frequency")
    if unnamed := result.model.unnamed:
        lines.append(
            "what has no name is corrected as it was measured, by no law: outside the measured range the correction "
            f"fades, and the band opens by up to {number(100.0 * Z95 * unnamed.beyond, 2)} % either way"
        )
        lines.append(
            "what has no name counts as the bushing's, but these tests cannot tell it from the rig's: if it is the "
            f"rig's, the car lacks the correction, up to {number(100.0 * unnamed.largest, 2)} % of |K|"
        )
    if result.measured is None:
        lines.append("the model was not fitted here: no uncertainty, and no fitted range to compare with")
    if rig := rig_effects(result):
        lines.append(
            f"left out of the prediction, because they belong to the rig and not to the bushing: {', '.join(rig)}"
        )
    return lines


def rig_effects(result: Result) -> list[str]:
    """Effects of a model that belong to the rig."""
    return [name for name in result.model.effects if effect_named(name).level is Level.INSTRUMENT]


def _unfitted(result: Result, direction: Place) -> Iterator[str]:
    """Warnings where a direction was not fitted: its band lacks the error of the formula that leads there.

    Where the radial direction was fitted by a formula that is off, the parameters carry its error.
    """
    fitted = result.measured.directions if result.measured else ()
    if not fitted:
        return
    corrected = {effect.corrects for effect in result.model.without(Level.INSTRUMENT).records}
    if str(direction) in fitted:
        shape = result.model.bushing
        if direction is Direction.RADIAL and shape and shape.shape == "paper" and direction not in corrected:
            formula = f"the paper's formula, {_radial_error(shape)}"
            yield f"{direction}: fitted with {formula}; the parameters carry that error"
            yield from _compressible(result, shape)
        return
    of_bushing = direction is Direction.AXIAL and not set(Direction).isdisjoint(fitted)
    if not (of_bushing or direction in (Direction.RADIAL, Direction.TORSION)):
        if str(direction) not in corrected:
            tests = " and ".join(fitted)
            yield (
                f"{direction}: not fitted; its band holds the scatter of the {tests} tests, not by how much two bodies "
                "of one compound differ, nor the error of their dimensions"
            )
        return
    radially = direction is Direction.RADIAL or (Direction.AXIAL not in fitted and Direction.RADIAL in fitted)
    formula, compared = Direction.TORSION, "which was not compared with finite elements"
    bushing = result.model.bushing
    if radially and bushing:
        formula, compared = Direction.RADIAL, _radial_error(bushing)
    if formula in corrected:
        return
    band = f"its band holds the scatter of the {' and '.join(fitted)} tests, not" if result.fitted else "no band holds"
    yield f"{direction}: not fitted; {band} the error of the {formula} formula, {compared}"
    if radially and bushing:
        yield from _compressible(result, bushing)


def _compressible(result: Result, bushing: Bushing) -> Iterator[str]:
    """A warning where a bulk modulus of 2 GPa would change the radial stiffness."""
    lowering = bushing.correction.lowering(result.model.values.get("mu", 0.0)) if bushing.correction else 0.0
    if lowering > _NOTED_LOWERING:
        lower = f"would lower the radial stiffness of this shape by {number(100.0 * lowering, 2)} %"
        yield f"{Direction.RADIAL}: the rubber counts as incompressible; a bulk modulus of 2 GPa {lower}"


def _radial_error(bushing: Bushing) -> str:
    """How far the bushing's radial formulas lie off finite elements of its shape."""
    if bushing.correction is None:
        return "which no finite elements back for this shape"
    if bushing.shape == "calibrated":
        return "up to 1 % in stiffness and 3 % in strain against finite elements"
    stiffness, strain = (number(100.0 / factor - 100.0, 2, "+") for factor in bushing.correction[:2])
    off = f"for this shape {stiffness} % in stiffness and {strain} % in strain against finite elements"
    return f'{off}, by which shape = "calibrated" goes'


def _circumstances(model: Model, temperature: float | None) -> Iterator[str]:
    """What is taken of the circumstances that the model depends on, where they are not asked for."""
    known = set() if temperature is None else {"temperature"}
    yield from (effect.taken for effect in model.records if effect.taken and not known & {*effect.under})


def _extrapolations(
    result: Result, direction: Place, frequency: Array, amplitude: Array, what: str | None = None
) -> Iterator[str]:
    """A warning for the frequencies and one for the strains of what is predicted where they leave what was fitted."""
    if result.measured is None:
        return
    axes = (
        ("frequencies", "Hz", frequency, result.measured.frequency),
        ("strains", "%", amplitude * result.model.unit_strain(direction), result.measured.strain),
    )
    for axis, unit, asked, (low, high) in axes:
        if asked.min() < low * (1 - MARGIN) or asked.max() > high * (1 + MARGIN):
            here, there = _span(asked.min(), asked.max(), unit), _span(low, high, unit)
            said = f"predicted at {axis} of {here}, but fitted at {there} only: extrapolated beyond"
            yield f"{what or direction}: {said}"


def _span(low: float, high: float, unit: str) -> str:
    """A range in words: "5 to 155 Hz", or one number where both ends read alike."""
    ends = [number(100 * end, 2) if unit == "%" else number(end, 3) for end in (low, high)]
    return f"{' to '.join(dict.fromkeys(ends))} {unit}"
