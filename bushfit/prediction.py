"""Dynamic stiffness with 95 % bands at any frequency and amplitude, of the bushing as the car will have it.

Material and component effects are kept, instrument effects are left out: the car does not have the rig's faults.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bushfit.effects import Level, effect_named
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Bushing, Direction, Place, Specimen
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import stiffness_jacobian
from bushfit.reading.measurement import Sweep
from bushfit.reading.runs import nominal
from bushfit.reduction.resonance import response
from bushfit.units import number

#: Frequencies of the paper's tables [Hz].
PAPER_FREQUENCIES = tuple(float(f) for f in range(5, 156, 10))
#: Amplitudes of the paper's tables [m].
PAPER_AMPLITUDES = (1e-4, 2e-4, 5e-4)
#: Amplitudes of each kind of motion where none were measured: those of torsion [rad], which the paper did not measure,
#: and of the material's strain [1] are chosen so that strains are like the paper's.
_AMPLITUDES_OF = {
    TRANSLATION: PAPER_AMPLITUDES,
    ROTATION: tuple(float(np.radians(x)) for x in (0.5, 1.0, 2.0)),
    STRAINING: (0.01, 0.02, 0.05),
}
#: Beyond the fitted range by more than this, relative to its end, a prediction is an extrapolation: rigs miss their
#: set points by less.
_MARGIN = 0.01
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
#: Frequencies of a grid where the paper's were not measured.
_FREQUENCIES = 9
#: Amplitudes of a grid where the paper's were not measured.
_AMPLITUDES = 3
#: Values of a grid at most of what was stepped through as it came: tables stay readable, and lines smooth.
_MOST_STEPS = 10


@dataclass(frozen=True, eq=False)
class Band:
    """A predicted quantity with its 95 % band, each (n,)."""

    value: Array
    low: Array
    high: Array


@dataclass(frozen=True, eq=False)
class Prediction:
    """Dynamic stiffness over operating points, sorted by amplitude, then frequency: |K|, K''/K', K' and K''.

    Args:
        frequency: [Hz], (n,).
        amplitude: zero-to-peak [m or rad], (n,).
        stiffness, storage_stiffness, loss_stiffness: [N/m or N m/rad].
        warnings: sentences on directions, frequencies and strains that were not fitted.
    """

    direction: Place
    frequency: Array
    amplitude: Array
    stiffness: Band
    loss_factor: Band
    storage_stiffness: Band
    loss_stiffness: Band
    warnings: tuple[str, ...]


def default_grid(result: Result, direction: Place, sweeps: Sequence[Sweep] = ()) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes [m or rad] to predict at where none are asked for, rising.

    They are those of the sweeps at this place, so that prediction and measurement stand side by side, a level that
    several sweeps reached more or less counting once; of amplitudes that were stepped, and of what swings free, at most
    ten over their range. Without any sweep they are the paper's as far as they lie in the measured range, or an even
    grid over that range where fewer than two do.
    """
    mine = [sweep for sweep in sweeps if sweep.direction == direction]
    if mine:
        return _measured(mine, "frequency"), _measured(_levelled(mine), "amplitude")
    amplitudes = np.array(_AMPLITUDES_OF[direction.motion])
    frequencies = np.array(PAPER_FREQUENCIES)
    if result.measured is None:
        return frequencies, amplitudes
    low, high = result.measured.frequency
    inside = frequencies[(frequencies >= low * (1 - _MARGIN)) & (frequencies <= high * (1 + _MARGIN))]
    if inside.size < 2:
        inside = _distinct(np.geomspace(low, high, _FREQUENCIES))
    if direction.is_rotation:
        return inside, amplitudes
    per_displacement = result.model.unit_strain(direction if isinstance(direction, Specimen) else Direction.AXIAL)
    least, most = (strain / per_displacement for strain in result.measured.strain)
    reached = amplitudes[(amplitudes >= least * (1 - _MARGIN)) & (amplitudes <= most * (1 + _MARGIN))]
    if reached.size < 2:
        reached = _even(least, most, _AMPLITUDES)
    return inside, reached


def _levelled(sweeps: Sequence[Sweep]) -> list[Sweep]:
    """Sweeps of one place in which amplitudes of one level, as each sweep has it, are the same."""
    held = [sweep for sweep in sweeps if sweep.stepped]
    points = np.hstack([np.empty((2, 0)), *(np.stack((sweep.amplitude, sweep.frequency)) for sweep in held)])
    amplitude = np.unique(points, axis=1)[0]  # each point once, however often it was repeated
    level = dict(zip(amplitude, nominal(amplitude), strict=True))
    changed = (replace(sweep, amplitude=np.array([level[each] for each in sweep.amplitude])) for sweep in held)
    return [*changed, *(sweep for sweep in sweeps if not sweep.stepped)]


def _measured(sweeps: Sequence[Sweep], axis: Literal["frequency", "amplitude"]) -> Array:
    """The values of some sweeps, rising; in place of many that were taken as they came, some that span them."""
    parts: tuple[list[Array], list[Array]] = [], []
    for sweep in sweeps:
        as_it_came = sweep.stepped is None or sweep.stepped == axis == "amplitude"
        parts[as_it_came].append(getattr(sweep, axis))
    planned, came = (_distinct(np.concatenate([np.empty(0), *part])) for part in parts)
    spanned = came if came.size <= _MOST_STEPS else _even(came[0], came[-1], _MOST_STEPS)
    return _distinct(np.concatenate([planned, spanned]))


def _even(least: float, most: float, count: int) -> Array:
    """So many values of three digits, in equal ratios from the least to the most."""
    return _distinct(np.array([float(f"{x:.3g}") for x in np.geomspace(least, most, count)]))


def _distinct(values: Array) -> Array:
    """The values, rising, each further above the last than a rig that misses its set point would be."""
    kept: list[float] = []
    for value in np.unique(values):
        if not kept or value > kept[-1] * (1.0 + _MARGIN):
            kept.append(float(value))
    return np.array(kept)


def predict(
    result: Result,
    direction: Place,
    frequencies: Sequence[float] | Array,
    amplitudes: Sequence[float] | Array,
    *,
    rig: bool = False,
) -> Prediction:
    """Dynamic stiffness on a grid, with 95 % bands from the covariance of the fit (delta method).

    Frequencies are in Hz, amplitudes zero-to-peak in m or rad. With `rig` its effects are kept, as in the tests.

    Raises:
        ModelError: a frequency or amplitude that is not positive.
    """
    for name, given in (("frequency", frequencies), ("amplitude", amplitudes)):
        if not (np.size(given) and np.all(np.isfinite(given)) and np.min(given) > 0):
            raise ModelError(f"impossible {name} to predict at", found=str(np.asarray(given)), expected="above zero")
    model = result.model if rig else result.model.without(Level.INSTRUMENT)
    amplitude, frequency = (
        axis.ravel() for axis in np.meshgrid(np.unique(amplitudes), np.unique(frequencies), indexing="ij")
    )
    stiffness = model.stiffness(direction, frequency, amplitude)
    names = [name for name in result.covariance.names if name in model.values]
    covariance = result.covariance.restricted(names)
    slopes = (
        stiffness_jacobian(model, direction, frequency, amplitude, names) if names else np.zeros((0, *stiffness.shape))
    )

    def band(value: Array, slope: Array) -> Band:
        half = covariance.half_width(slope)
        return Band(value, value - half, value + half)

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
        warnings=(*_unfitted(result, direction), *_extrapolations(result, direction, frequency, amplitude)),
    )


@dataclass(frozen=True, eq=False)
class PredictedResonance:
    """A mass [kg] on a mount whose base is shaken with a sine of constant acceleration [m/s^2], as the model has it.

    Args:
        frequency: [Hz], (n,).
        amplitude: of the mount's deformation, zero-to-peak [m], (n,).
        transmissibility: complex, acceleration of the mass over that of the base [-], (n,).
        stiffness: complex, of the mount at that frequency and amplitude [N/m], (n,).
        warnings: sentences on a place, and on frequencies and strains near the peak, that were not fitted.
    """

    place: Place
    mass: float
    base_acceleration: float
    frequency: Array
    amplitude: Array
    transmissibility: Array
    stiffness: Array
    warnings: tuple[str, ...]

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency of the largest transmissibility [Hz], and this |T|."""
        place = int(np.argmax(np.abs(self.transmissibility)))
        return float(self.frequency[place]), float(abs(self.transmissibility[place]))


def predict_resonance(
    result: Result, place: Place, mass: float, base_acceleration: float, frequencies: Sequence[float] | Array | None
) -> PredictedResonance:
    """Transmissibility and amplitude of a mass [kg] on the bushing or specimen, whose stiffness depends on amplitude.

    The base is shaken at an amplitude in m/s^2; without frequencies [Hz] these are a decade about the resonance.

    Raises:
        ModelError: a place that does not count displacement and force.
    """
    if place.motion is not TRANSLATION:
        raise ModelError("no mass stands on this", found=str(place), expected="a direction or mount with a stiffness")
    model = result.model.without(Level.INSTRUMENT)
    if frequencies is None:
        small = model.stiffness(place, 1.0, _SMALL_STRAIN / model.unit_strain(place))
        about = float(np.sqrt(np.abs(small) / mass)) / (2.0 * np.pi)
        frequencies = about * np.geomspace(_DECADE[0], _DECADE[1], _RESONANCE_POINTS)
    frequency = np.asarray(frequencies, dtype=float)
    base = base_acceleration / (2.0 * np.pi * frequency) ** 2
    amplitude, ratio = response(lambda reached: model.stiffness(place, frequency, reached), mass, frequency, base)
    stiffness = model.stiffness(place, frequency, amplitude)
    near = np.abs(ratio) >= min(_NEAR_PEAK, float(np.abs(ratio).max()))
    what = f"{place}, resonance of {number(mass, 3)} kg"
    warnings = (*_unfitted(result, place), *_extrapolations(result, place, frequency[near], amplitude[near], what))
    return PredictedResonance(place, mass, base_acceleration, frequency, amplitude, ratio, stiffness, warnings)


def carried(result: Result, bushing: Bushing) -> tuple[Result, str]:
    """The compound of a fitted model in another bushing, and a sentence on what stayed behind.

    What belongs to the material is kept, and the factors of specimens of it.
    """
    names = [specimen.name for specimen in result.specimens]
    records = result.model.records
    kept = [effect.name for effect in records if effect.level is Level.MATERIAL or effect.corrects in names]
    model = Model.started(bushing, kept, result.model.values)
    left = ", ".join(effect.name for effect in records if effect.name not in kept)
    said = f"{bushing.name}: the compound of {result.name}, of which no bushing of this shape was tested"
    said += f"; left out, because they belong to {result.name} or its rig: {left}" if left else ""
    measured = result.measured
    if measured:
        of_specimens = tuple(name for name in measured.directions if name in names)
        measured = replace(measured, directions=of_specimens or (result.name,))
    there = [name for name in result.covariance.names if name in model.values]
    fitted = tuple(name for name in result.fitted if name in model.values)
    covariance = result.covariance.restricted(there)
    return Result(model, fitted, covariance, None, measured, inputs=result.inputs, specimens=result.specimens), said


def caveats(result: Result) -> list[str]:
    """Sentences on what holds of a model's prediction in every direction."""
    lines = []
    if "springpot" not in result.model.effects:
        lines.append("the model has no springpot: its stiffness does not depend on frequency")
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
    if str(direction) in fitted:
        shape = result.model.bushing
        corrected = any(effect_named(name).corrects == Direction.RADIAL for name in result.model.effects)
        if direction is Direction.RADIAL and shape and shape.shape == "paper" and not corrected:
            formula = f"the paper's formula, {_radial_error(shape)}"
            yield f"{direction}: fitted with {formula}; the parameters carry that error"
            yield from _compressible(result, shape)
        return
    of_bushing = direction is Direction.AXIAL and not set(Direction).isdisjoint(fitted)
    if not (of_bushing or direction in (Direction.RADIAL, Direction.TORSION)):
        if not any(effect_named(name).corrects == str(direction) for name in result.model.effects):
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
    if any(effect_named(name).corrects == formula for name in result.model.effects):
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
        if asked.min() < low * (1 - _MARGIN) or asked.max() > high * (1 + _MARGIN):
            here, there = _span(asked.min(), asked.max(), unit), _span(low, high, unit)
            said = f"predicted at {axis} of {here}, but fitted at {there} only: extrapolated beyond"
            yield f"{what or direction}: {said}"


def _span(low: float, high: float, unit: str) -> str:
    """A range in words: "5 to 155 Hz", or one number where both ends read alike."""
    ends = [number(100 * end, 2) if unit == "%" else number(end, 3) for end in (low, high)]
    return f"{' to '.join(dict.fromkeys(ends))} {unit}"
