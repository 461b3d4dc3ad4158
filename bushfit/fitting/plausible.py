"""Sentences on tests that no rubber could have given, or not at one temperature, and on tests that a fit left out."""

from collections.abc import Sequence

import numpy as np

from bushfit.effects import temperature
from bushfit.fitting.assess import lack_of_fit, quality
from bushfit.fitting.data_sets import DataSet
from bushfit.geometry import Bushing, stiffness_per_modulus
from bushfit.model.model import Model
from bushfit.units import CELSIUS, number, told

#: Least shear modulus of a rubber [Pa]: that of the softest gel of a mount, with room.
_SOFTEST = 5e4
#: Largest shear modulus of a rubber [Pa]: that of the hardest compound at small strain, with room.
_HARDEST = 1e8
#: Modulus of the fastest and smallest test over that of the slowest and largest, at most, for any rubber.
_MOST_STIFFENING = 20.0
#: [K] Range of temperatures that the tests of one fit may have; chosen: filled rubber softens by up to 1 % a kelvin,
#: and a test chamber keeps its temperature within less.
_ONE_TEMPERATURE = 3.0
_CHECK = "check the units of displacement and force, and the dimensions of what was tested"


def implausible(bushing: Bushing | None, data_sets: Sequence[DataSet]) -> list[str]:
    """Sentences on moduli that no rubber has, and on tests too far apart to be of one bushing: most often a unit."""
    moduli = {
        data_set.name: float(np.median(np.abs(data_set.measured))) / stiffness_per_modulus(bushing, data_set.direction)
        for data_set in data_sets
    }
    softest, hardest = (pick(moduli, key=moduli.__getitem__) for pick in (min, max))
    ratio = moduli[hardest] / moduli[softest]
    if ratio > _MOST_STIFFENING:
        return [f"{hardest} shows {number(ratio, 2)} times the modulus of {softest}, which no rubber does: {_CHECK}"]
    said = f"a shear modulus of {told('Pa', moduli[hardest])} is that of no rubber: {_CHECK}"
    return [] if _SOFTEST < moduli[hardest] < _HARDEST else [said]


def apart_in_temperature(model: Model, data_sets: Sequence[DataSet]) -> list[str]:
    """A sentence on tests whose temperatures, where they are known, lie too far apart for one model."""
    degrees = [(data_set.name, data_set.test.temperature) for data_set in data_sets]
    known = sorted((float(np.mean(kelvin)) - CELSIUS, name) for name, kelvin in degrees if kelvin is not None)
    if not known:
        return []
    (low, coldest), (high, warmest) = known[0], known[-1]
    tested = f"{warmest} was tested at {number(high, 3)} degC and {coldest} at {number(low, 3)} degC"
    if "temperature" in model.effects:
        reference = temperature.REFERENCE - CELSIUS
        beyond = max(high - reference, reference - low) > temperature.REACH
        law = f"the effect of temperature holds within {temperature.REACH:g} K of {number(reference, 3)} degC"
        return [f"{tested}: {law}, beyond which a rubber keeps no single alpha"] if beyond else []
    if high - low <= _ONE_TEMPERATURE:
        return []
    return [
        f"{tested}, {number(high - low, 3)} degC apart: this model has no effect of temperature, and another that is "
        "named may be one; fit the tests of each temperature by themselves, or with --effect temperature"
    ]


def unfitted(model: Model, data_sets: Sequence[DataSet], advice: str) -> list[str]:
    """Sentences on tests that a model was not fitted to and misses by more than their noise."""
    return [
        f"{data_set.name}, {data_set.direction}, was not fitted, and the model misses it by "
        f"{number(100 * quality(model, [data_set], 0).nrmse, 2)} % (NRMSE), "
        f"{number(np.sqrt(misfit), 2)} times its noise{advice}"
        for data_set in data_sets
        if (misfit := lack_of_fit(model, [data_set], 0)) is not None
    ]
