"""Prony series of the compound: relative moduli and relaxation times at one strain amplitude, also as a table.

The relaxation modulus is G(t) = G_inf + sum_i G_i exp(-t/tau_i), with g_i = G_i/G_0 and the instantaneous modulus
G_0 = G_inf + sum_i G_i. All terms are positive, and the g_i sum to less than 1.

Source: Abaqus Analysis User's Guide, "Time domain viscoelasticity": g_R(t) = 1 - sum_i g_i (1 - exp(-t/tau_i)).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pandas as pd

from bushfit.caveat import Caveat
from bushfit.effects import Level
from bushfit.effects.contract import Array
from bushfit.errors import ModelError
from bushfit.export.contract import ExportedFiles, ExportRequest
from bushfit.geometry import Specimen
from bushfit.model.arms import Arms, fitted_arms, values_under
from bushfit.prediction.caveats import format_deviation
from bushfit.reading.tablefile import to_csv
from bushfit.units import number

#: Name of the parameter for the long-term shear modulus [Pa].
LONG_TERM = "mu"
#: Specimen whose stiffness is the shear modulus of the material, over engineering shear strain.
COMPOUND = Specimen("compound", "modulus")
#: Factor by which relaxation times may lie outside the band: further away, a term would be a spring or a dashpot, and
#: the instantaneous modulus without meaning.
_BEYOND = 10.0
#: Number of frequencies at which series of several amplitudes are compared.
_FINE = 200


@dataclass(frozen=True, eq=False)
class PronySeries:
    """Prony series of the shear modulus at one strain amplitude.

    Args:
        amplitude: zero-to-peak amplitude of the first exported direction or specimen [m, rad or 1].
        strain: engineering shear strain amplitude at which the series holds.
        long_term: modulus at rest G_inf [Pa].
        arms: the terms, as Maxwell arms in parallel with G_inf.
        exact: complex modulus of the model at frequencies over the band [Pa], (n,).
        instantaneous: instantaneous modulus G_0 [Pa], the sum of the moduli of all terms and G_inf.
        relative_moduli: modulus of each of the k terms relative to G_0, g_i, (k,).
    """

    amplitude: float
    strain: float
    long_term: float
    arms: Arms
    exact: Array
    instantaneous: float
    relative_moduli: Array

    @property
    def loss_errors(self) -> Array:
        """Loss factor of the series minus that of the model, at the frequencies of `exact`, (n,)."""
        turned = 2j * np.pi * np.outer(np.geomspace(*self.arms.band, _FINE), self.arms.time)
        modulus = self.long_term + (turned / (1.0 + turned)) @ self.arms.modulus
        return modulus.imag / modulus.real - self.exact.imag / self.exact.real


@lru_cache(maxsize=1)
def prony_series(request: ExportRequest) -> list[PronySeries]:
    """Fit a Prony series at each amplitude of the first direction or specimen, over the frequencies of the grid.

    Args:
        request: model, predictions and settings.

    Returns:
        Series by ascending amplitude, each with the fewest terms that reach the accuracy. If no number of terms reaches
        the accuracy, the closest series: positive terms cannot represent friction, whose modulus is independent of
        frequency.

    Raises:
        ModelError: the model has no long-term modulus.
    """
    model, prediction = request.result.model.without(Level.INSTRUMENT), request.predictions[0]
    if LONG_TERM not in (values := values_under(model, request.conditions)):
        raise ModelError("a Prony series needs a long-term modulus", expected="a model with an elastic branch")
    long_term = values[LONG_TERM]
    band = float(prediction.frequency.min()), float(prediction.frequency.max())
    frequency, series = np.geomspace(*band, _FINE), list[PronySeries]()
    for amplitude in np.unique(prediction.amplitude):
        strain = 2.0 * amplitude * model.unit_strain(request.places[0])  # engineering shear strain

        def relaxing_modulus(omega: Array, strain: float = strain) -> Array:
            """Complex modulus minus the long-term modulus [Pa], by angular frequency [rad/s] and strain amplitude."""
            return model.stiffness(COMPOUND, omega / (2.0 * np.pi), strain, conditions=request.conditions) - long_term

        arms = fitted_arms(
            relaxing_modulus, band, request.accuracy, spring=long_term, overhang_factor=_BEYOND, closest=True
        )
        exact = long_term + relaxing_modulus(2.0 * np.pi * frequency)
        total = long_term + float(arms.modulus.sum())
        series.append(PronySeries(float(amplitude), strain, long_term, arms, exact, total, arms.modulus / total))
    return series


def prony_omissions(series: Sequence[PronySeries]) -> Iterator[Caveat]:
    """Yield warnings on the accuracy and the validity of Prony series.

    Args:
        series: Prony series at increasing strain amplitudes.

    Yields:
        Error and frequency band, strain amplitude of each series, and the approximation of friction.
    """
    low, high = (number(end, 3) for end in series[0].arms.band)
    worst = number(100.0 * max(one.arms.error for one in series), 2)
    losses = np.concatenate([one.loss_errors for one in series])
    loss_range = " to ".join(number(end, 2, "+") for end in (losses.min(), losses.max()))
    yield Caveat(
        "format_error",
        f"compound: the Prony series is valid only from {low} to {high} Hz, with errors of up to {worst} % in the "
        f"modulus and {loss_range} in the loss factor, because positive terms cannot follow friction exactly",
    )
    if len(series) > 1:
        middle = series[(len(series) - 1) // 2]
        ratios = np.concatenate([np.abs(middle.exact / one.exact) for one in series])
        strain, *ends = (number(100.0 * one.strain, 3) for one in (middle, series[0], series[-1]))
        errors = f"errors of {format_deviation(ratios)} in |G| at {' to '.join(ends)} %"
        sentence = f"compound: each series is valid at one strain amplitude. The series for {strain} % has {errors}"
        yield Caveat("format_error", sentence)
    sentence = "compound: friction is a viscous loss at that amplitude, without a force at rest"
    yield Caveat("format_omission", sentence)


def export(request: ExportRequest) -> ExportedFiles:
    """Write the Prony series of the compound as a table, a row per term.

    Args:
        request: model, predictions and settings.

    Returns:
        File prony.csv, and sentences on properties that the format cannot represent.
    """
    series, place = prony_series(request), request.places[0]
    stress, to_stress = request.units.stress if request.units else ("MPa", 1e-6)
    length, to_length = place.display.displacement
    rows = [
        {
            f"{place} amplitude [{length}]": to_length * one.amplitude,
            "shear strain amplitude [%]": 100.0 * one.strain,
            "term": term,
            "g_i [-]": relative,
            "relaxation time [s]": time,
            f"long-term modulus [{stress}]": to_stress * one.long_term,
            f"instantaneous modulus [{stress}]": to_stress * one.instantaneous,
            "lowest frequency [Hz]": one.arms.band[0],
            "highest frequency [Hz]": one.arms.band[1],
            "largest error of the modulus [%]": 100.0 * one.arms.error,
        }
        for one in series
        for term, (relative, time) in enumerate(zip(one.relative_moduli, one.arms.time, strict=True), start=1)
    ]
    table = to_csv(pd.DataFrame(rows), decimal_comma=request.decimal_comma)
    return ExportedFiles({"prony.csv": table}, tuple(prony_omissions(series)))
