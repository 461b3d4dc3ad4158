"""Operating points of a prediction, with the temperature and the preload of the rubber."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from bushfit.effects.contract import UNKNOWN, Array, RubberConditions
from bushfit.effects.temperature import REFERENCE
from bushfit.errors import ModelError
from bushfit.geometry import Place
from bushfit.model.result import Result
from bushfit.reading.preload import SAME_PRELOAD, Preload
from bushfit.units import CELSIUS, number


class OperatingPoints(NamedTuple):
    """The n operating points of a prediction for one direction or specimen.

    Args:
        place: direction or specimen.
        frequency: frequency of each point [Hz], (n,).
        amplitude: zero-to-peak amplitude of each point [m, rad or 1], (n,) or a single number.
        conditions: temperature and preload of the rubber.
    """

    place: Place
    frequency: Array
    amplitude: Array
    conditions: RubberConditions = UNKNOWN


class PredictedPlace:
    """Base class of predictions for one direction or specimen, at a temperature and a preload of the rubber.

    Attributes:
        direction: direction or specimen.
        conditions: temperature [K] and preload of the rubber; None for a condition that the model does not depend on.
    """

    direction: Place
    conditions: RubberConditions

    def add_conditions(self, text: str) -> str:
        """Add preload and temperature, if known, to a text: "axial at a preload of 500 N and 60 degC"."""
        preload, temperature = self.conditions.preload, self.conditions.temperature
        conditions = [] if preload is None else [f"a preload of {preload.text(self.direction)}"]
        conditions += [] if temperature is None else [f"{number(float(temperature) - CELSIUS, 3)} degC"]
        return f"{text} at {' and '.join(conditions)}" if conditions else text

    @property
    def label(self) -> str:
        """Direction or specimen for users, with its conditions: "axial at a preload of 500 N"."""
        return self.add_conditions(str(self.direction))


def rubber_conditions(
    result: Result, place: Place, temperature: float | None = None, preload: Preload | None = None
) -> RubberConditions:
    """Temperature [K] and preload of a prediction; None for a condition that the model does not depend on.

    Args:
        result: fitted result.
        place: direction or specimen.
        temperature: temperature [K]; None for the reference temperature.
        preload: requested preload, within the tested range; None for the tested preload nearest to zero.
    """
    kelvin = (REFERENCE if temperature is None else temperature) if "temperature" in result.model.depends_on else None
    return RubberConditions(kelvin, preload=tested_preload(result, place, preload))


def tested_preload(result: Result, place: Place, preload: Preload | None) -> Preload | None:
    """Choose the preload of a prediction: the requested one, if it is within the tested range, or the default.

    Args:
        result: fitted result.
        place: direction or specimen.
        preload: requested preload; None for the tested preload nearest to zero.

    Returns:
        The preload; None if it is not requested and the model does not depend on it in this direction.

    Raises:
        ModelError: the tests of this direction do not have several preloads, or none as small or as large.
    """
    ranges = result.measured.preloads if result.measured else ()
    tested = next((preload_range for preload_range in ranges if preload_range.place == str(place)), None)
    if preload is None:
        return Preload(float(np.clip(0.0, tested.low, tested.high)), tested.unit) if tested else None
    if result.measured is None and "preload" in result.model.depends_on:  # of a simulation: exact, without a range
        return preload
    refuse = partial(ModelError, place=str(place), found=f"a preload of {preload.text(place)}")
    if tested is None:
        raise refuse(
            "the model was not fitted to several preloads of this direction",
            expected="tests at two or more preloads",
            hint='state preload = "500 N" for each test of the campaign, "none" without preload, and fit again',
        )
    margin = SAME_PRELOAD * max(abs(tested.low), abs(tested.high))
    if preload.unit != tested.unit and preload.value:
        raise refuse("the tests state the preload in another quantity", expected=tested.text(place))
    if not tested.low - margin <= preload.value <= tested.high + margin:
        hint = "test the bushing at this preload, and fit all tests together"
        raise refuse("this preload is outside the tested range", expected=tested.text(place), hint=hint)
    return Preload(preload.value, tested.unit)
