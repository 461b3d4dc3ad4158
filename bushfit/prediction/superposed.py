"""Stiffness of a small harmonic superposed on a slow large motion or a static offset, from the law in time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects import Level
from bushfit.effects.contract import Array
from bushfit.effects.history import History
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.errors import ModelError
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.model.sensitivity import force_and_slopes
from bushfit.prediction.bands import agreeing_models
from bushfit.prediction.conditions import OperatingPoints
from bushfit.units import format_range, number

#: Samples per cycle of the small harmonic: friction, which turns at samples, has an error of 0.01 %.
_SAMPLES = 64
#: Smallest and largest ratio of the two frequencies.
_SLOW, _SLOWEST = 3.0, 10_000.0


@dataclass(frozen=True)
class LargeMotion:
    """Slow large motion, or static offset, under a small harmonic.

    Args:
        displacement: zero-to-peak amplitude of the motion, or the offset [m, rad or 1].
        unit: SI unit of the displacement.
        frequency: frequency of the motion [Hz]; 0 for an offset.
    """

    displacement: float
    unit: str
    frequency: float = 0.0

    def describe(self, place: Place) -> str:
        """Format the motion, such as "0.5 Hz 1 mm"."""
        size = place.display.displacement.text(self.displacement)
        return f"{number(self.frequency, 3)} Hz {size}" if self.frequency else size

    def stiffness_and_slopes(self, model: Model, points: OperatingPoints, names: Sequence[str]) -> tuple[Array, Array]:
        """Complex stiffness of a small harmonic on this motion, and its derivatives with respect to parameters.

        Args:
            model: model; the derivatives are taken at its parameter values.
            points: frequencies and amplitudes of the small harmonic.
            names: names of k parameters.

        Returns:
            Complex stiffness [N/m or N m/rad], (n,), and its derivatives per SI unit of each parameter, (k, n).

        Raises:
            ModelError: the motion is of another kind than the direction, or it is not slow compared with the small
                harmonic.

        Notes:
            The stiffness belongs to the force component at the frequency of the small harmonic in the steady state, a
            mean over the slow cycle. The slow frequency is adjusted until two slow cycles contain an odd number of
            cycles of the harmonic; then no overtone of the slow motion coincides with the harmonic. An unnamed
            correction is applied as if there were no slow motion.
        """
        place, frequency = points.place, points.frequency
        if place.motion.displacement_unit != self.unit:
            expected = f"a motion in {place.display.displacement.name}"
            raise ModelError("not a motion of this direction", place=str(place), found=self.unit, expected=expected)
        low, high = _SLOW * self.frequency, _SLOWEST * self.frequency
        if self.frequency and not (low <= frequency.min() and frequency.max() <= high):
            raise ModelError(
                "the small vibration is not fast compared with the slow motion",
                place=str(place),
                found=format_range("Hz", float(frequency.min()), float(frequency.max())),
                expected=f"{_SLOW:g} to {_SLOWEST:g} times {number(self.frequency, 3)} Hz",
                hint="choose others with --frequencies",
            )
        named, columns = model.without(UNNAMED), []
        for hertz, size in zip(frequency.tolist(), points.amplitude.tolist(), strict=True):
            cycles = 2 * round(hertz / self.frequency - 0.5) + 1 if self.frequency else 1
            phase = 2.0 * np.pi * np.arange(cycles * _SAMPLES) / _SAMPLES
            slow = np.sin(2.0 * phase / cycles) if self.frequency else 1.0
            history = History.steady(self.displacement * slow + size * np.sin(phase), hertz, cycles)
            force, slopes = force_and_slopes(named, place, history, names, points.conditions)
            spectrum = np.fft.rfft(np.concatenate((history.value[None], force[None], slopes)))[:, cycles]
            columns.append(spectrum[1:] / spectrum[0])
        response = np.array(columns).T
        if model.unnamed:
            response *= correction_factor(model, points)
        return response[0], response[1:]


def correction_factor(model: Model, points: OperatingPoints) -> Array:
    """Complex ratio of the stiffness of a model with and without its smooth unnamed correction, at n points, (n,)."""
    place, frequency, amplitude, conditions = points
    models = model, model.without(UNNAMED)
    corrected, without = (one.stiffness(place, frequency, amplitude, conditions=conditions) for one in models)
    return np.asarray(corrected / without)


def untimed_effects(model: Model) -> list[str]:
    """Names of the bushing's effects in a model for which the force over time cannot be computed.

    A smooth correction is not listed.
    """
    return model.without(Level.INSTRUMENT, UNNAMED).without_time_law


def models_with_time_law(
    result: Result, subject: str, *, rig: bool = False
) -> tuple[list[tuple[Result, Model]], list[Caveat]]:
    """List the models that agree with the tests and have laws in time: the fitted model, then its alternatives.

    Args:
        result: fitted result.
        subject: beginning of the warning on alternatives, such as the direction.
        rig: True to include the effects of the rig, as in the tests.

    Returns:
        Pairs of the result that contains the errors and the model; and a list with a warning on the alternatives that
        are left out, empty if there are none.

    Raises:
        ModelError: an effect of the fitted model has no law in time.
    """
    result.model.without(Level.INSTRUMENT, UNNAMED).require_time_law()
    models = agreeing_models(result, rig=rig)
    untimed = sorted({name for _, model in models for name in untimed_effects(model)})
    sentence = f"the band excludes the alternative with {' or '.join(untimed)}, which has no law in time"
    warnings = [Caveat("alternative_without_law", sentence).about(subject)] if untimed else []
    return [(source, model) for source, model in models if not untimed_effects(model)], warnings
