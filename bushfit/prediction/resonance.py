"""Resonance of a mass on the bushing, whose stiffness depends on the amplitude of the resonance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from bushfit.caveat import Caveat, join_names
from bushfit.effects.contract import UNKNOWN, Array, RubberConditions
from bushfit.errors import ModelError
from bushfit.geometry import TRANSLATION, Place
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.bands import agreeing_models
from bushfit.prediction.caveats import extrapolations, unfitted_warnings
from bushfit.prediction.conditions import OperatingPoints, PredictedPlace, rubber_conditions
from bushfit.reading.preload import Preload
from bushfit.reduction.resonance import shaken_response
from bushfit.units import number

#: Strain at which the resonance of a mass is looked for first; chosen: small for any rubber.
_SMALL_STRAIN = 1e-4
#: Lowest and highest frequency about a resonance over that of small strain.
_DECADE = (0.2, 4.0)
#: Frequencies of this range; chosen: 0.5 % apart, the accuracy to which tests determine a peak.
_RESONANCE_POINTS = 600
#: Transmissibility from which a point counts as near the peak; chosen: about 0.6 to 1.3 of the peak's frequency, where
#: the mount decides how far the mass moves.
_NEAR_PEAK = 1.5


@dataclass(frozen=True, eq=False)
class PredictedResonance(PredictedPlace):
    """Predicted response of a mass on a bushing whose base is shaken with a sine of constant acceleration.

    Args:
        direction: direction or specimen.
        mass: mass on the bushing [kg].
        base_acceleration: zero-to-peak acceleration of the base [m/s^2].
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak deformation of the bushing [m], (n,).
        transmissibility: complex ratio of the accelerations of mass and base [-], (n,).
        stiffness: complex stiffness of the bushing at each frequency and amplitude [N/m], (n,).
        warnings: warnings on a direction that was not fitted, on frequencies and strains near the peak outside the
            fitted range, and on unresolved effects.
        if_in_rig: response if the unresolved effects, which may belong to the bushing or to the rig, belong to the rig;
            None without such effects.
        conditions: temperature [K] and preload of the rubber; None for a condition that the model does not depend on.
    """

    direction: Place
    mass: float
    base_acceleration: float
    frequency: Array
    amplitude: Array
    transmissibility: Array
    stiffness: Array
    warnings: tuple[Caveat, ...] = ()
    if_in_rig: PredictedResonance | None = None
    conditions: RubberConditions = UNKNOWN

    @property
    def peak(self) -> tuple[float, float]:
        """Frequency of the largest transmissibility [Hz], and its magnitude |T| [-]."""
        index = int(np.argmax(np.abs(self.transmissibility)))
        return float(self.frequency[index]), float(abs(self.transmissibility[index]))


def predict_resonance(
    result: Result,
    place: Place,
    mass: float,
    base_acceleration: float,
    frequencies: Sequence[float] | Array | None,
    *,
    temperature: float | None = None,
    preload: Preload | None = None,
) -> PredictedResonance:
    """Predict the response of a mass on the bushing or specimen, whose stiffness depends on amplitude.

    Args:
        result: fitted result.
        place: direction of translation, or specimen with a displacement.
        mass: mass on the bushing [kg].
        base_acceleration: zero-to-peak acceleration of the base [m/s^2].
        frequencies: frequencies [Hz]; None for a range about the resonance.
        temperature: temperature of the rubber [K]; None for the reference temperature.
        preload: preload within the tested range; None for the tested preload nearest to zero.

    Returns:
        Transmissibility and amplitude at the frequencies.

    Raises:
        ModelError: the direction has no displacement and force, such as torsion.
    """
    if place.motion is not TRANSLATION:
        raise ModelError("a mass needs a translation", found=str(place), expected="axial, radial or a mount")
    models = agreeing_models(result)
    bushings, *rig_models = (model for source, model in models if source is result)
    conditions = rubber_conditions(result, place, temperature, preload)
    if frequencies is None:
        small = bushings.stiffness(place, 1.0, _SMALL_STRAIN / bushings.unit_strain(place), conditions=conditions)
        resonance = float(np.sqrt(np.abs(small) / mass)) / (2.0 * np.pi)
        frequencies = resonance * np.geomspace(_DECADE[0], _DECADE[1], _RESONANCE_POINTS)
    frequency = np.asarray(frequencies, dtype=float)
    base = base_acceleration / (2.0 * np.pi * frequency) ** 2

    def response_of(model: Model) -> PredictedResonance:
        """Response of the mass to the shaken base, predicted with one model; warnings are added later."""
        stiffness_at = partial(model.stiffness, place, frequency, conditions=conditions)
        amplitude, ratio = shaken_response(stiffness_at, mass, frequency, base)
        stiffness = stiffness_at(amplitude)
        return PredictedResonance(place, mass, base_acceleration, frequency, amplitude, ratio, stiffness)

    predicted, if_in_rig = response_of(bushings), response_of(rig_models[-1]) if rig_models else None
    near = np.abs(predicted.transmissibility) >= min(_NEAR_PEAK, predicted.peak[1])
    subject = f"{place}, resonance of {number(mass, 3)} kg"
    points = OperatingPoints(place, frequency[near], predicted.amplitude[near], conditions)
    warnings = [*unfitted_warnings(result, place), *extrapolations(result, points, subject)]
    if result.alternatives:
        peaks = np.array([response_of(model).peak for source, model in models if source is not result])
        (low, smallest), (high, largest) = peaks.min(axis=0), peaks.max(axis=0)
        span = f"{number(low, 4)} to {number(high, 4)} Hz, |T| {number(smallest, 4)} to {number(largest, 4)}"
        spread = Caveat("resonance_range", f"{span}, for all models that agree with the tests")
        warnings += [*result.rival_warnings, spread.about(subject)]
    if if_in_rig:
        peak, ratio = (number(value, 4) for value in if_in_rig.peak)
        sentence = f"at {peak} Hz, |T| {ratio}, with {join_names(result.unresolved)} in the rig"
        warnings.append(Caveat("resonance_if_rig", sentence).about(subject))
    return replace(predicted, warnings=tuple(warnings), if_in_rig=if_in_rig, conditions=conditions)
