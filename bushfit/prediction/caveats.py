"""Warnings of a prediction, on directions not fitted, extrapolation and omitted effects."""

from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from bushfit.caveat import Caveat, join_names
from bushfit.effects import Level, get_effect
from bushfit.effects.contract import Array
from bushfit.geometry import Bushing, Direction, Place, bushing_at
from bushfit.model.covariance import Z95
from bushfit.model.result import Result
from bushfit.prediction.conditions import OperatingPoints
from bushfit.reading.measurement import SAME_TEMPERATURE
from bushfit.units import CELSIUS, format_range, number

#: Largest relative distance beyond the fitted range that is no extrapolation: rigs miss their set points by less.
MARGIN = 0.01
#: End of the warning of a prediction outside the tested range.
BEYOND = "extrapolated outside this range"
#: Relative decrease of the radial stiffness by a finite bulk modulus above which a warning is due: as large as the
#: other errors.
_NOTED_LOWERING = 0.01


#: Reduced chi-square of a sweep that was not fitted, up to which it agrees within its noise; chosen: 95 % of the values
#: of 20 points are below.
_AGREEMENT = 1.4


def warnings_of(
    result: Result, predicted: Iterable[Iterable[Caveat]] = (), notes: Iterable[Caveat] = ()
) -> list[Caveat]:
    """Collect all warnings for a reader of a result and its predictions, each once.

    Args:
        result: fitted result.
        predicted: warnings of each prediction in the report.
        notes: further warnings, which come first.

    Returns:
        Warnings without repetition.
    """
    return list(dict.fromkeys((*notes, *result.warnings, *chain.from_iterable(predicted), *caveats(result))))


def caveats(result: Result) -> Iterator[Caveat]:
    """Generate the warnings about a fitted result that apply to every prediction.

    Args:
        result: fitted result.

    Yields:
        Warnings on directions that were not fitted, on effects that may belong to the bushing or to the rig, and on the
        limits of the model.
    """
    for place in result.fitted_places:
        yield from unfitted_warnings(result, place)
    for name in result.unresolved:
        twins = " or ".join(get_effect(name).twins)
        sentence = f"{name} is assigned to the bushing, but these tests cannot distinguish it from {twins}"
        yield Caveat("effect_may_be_rig", sentence)
    yield from result.rival_warnings
    if "springpot" not in result.model.effects:
        yield Caveat("no_springpot", "the model has no springpot: its stiffness does not depend on frequency")
    if unnamed := result.model.unnamed:
        sentence = "the smooth correction follows the measurement, not a law. Outside the measured range, it fades"
        widening = number(100.0 * Z95 * unnamed.far_deviation, 2)
        yield Caveat("correction_fades", f"{sentence} and the band widens by up to ±{widening} %")
        size = f"|K| of the bushing in the car differs by up to {number(100.0 * unnamed.largest, 2)} %"
        sentence = f"the smooth correction is assigned to the bushing. If it belongs to the rig, {size}"
        yield Caveat("correction_may_be_rig", sentence)
    if result.measured is None:
        yield Caveat("not_fitted", "the model was not fitted: it has no uncertainty and no fitted range")
    if rig := rig_effects(result):
        sentence = "the prediction leaves out effects that belong to the rig and not to the bushing"
        yield Caveat("rig_effects_excluded", f"{sentence}: {', '.join(rig)}")


def rig_effects(result: Result) -> list[str]:
    """Names of the effects of a fitted model that belong to the rig and not to the bushing."""
    return [name for name in result.model.effects if get_effect(name).level is Level.INSTRUMENT]


def agrees_within_noise(result: Result, direction: Place) -> bool:
    """True if a direction has sweeps that were not fitted, each with a reduced chi-square of at most 1.4."""
    misfits = [test for test in result.tests if test.place == str(direction) and test.held is None and not test.fitted]
    return bool(misfits) and all(test.reduced_chi_square <= _AGREEMENT for test in misfits)


def unfitted_warnings(result: Result, direction: Place) -> Iterator[Caveat]:
    """Generate warnings on a predicted direction that was not fitted, or whose formula deviates from finite elements.

    Args:
        result: fitted result.
        direction: direction or specimen of the prediction.

    Yields:
        Warnings on the tests that the prediction is made from, the error of the formula, and compressibility.
    """
    fitted = result.measured.directions if result.measured else ()
    corrected = {effect.corrects for effect in result.model.without(Level.INSTRUMENT).records}
    bushing = bushing_at(result.model.bushing, direction)
    tests = join_names(fitted)
    axes = {place.axis for place in result.fitted_places}
    if str(direction) in fitted or not result.measured:
        is_radial = direction.axis is Direction.RADIAL and corrected.isdisjoint(direction.labels)
        if is_radial and bushing and bushing.shape == "paper":
            use, kind = ("fitted with", "formula_error") if fitted else ("computed by", "formula_used")
            sentence = f"{use} the paper's formula, {_radial_error(bushing)}"
            sentence += ". The parameters contain this error" * bool(fitted)
            yield Caveat(kind, sentence).about(direction)
            yield from _compressibility_warning(result, bushing, direction)
        return
    of_bushing = direction.axis is Direction.AXIAL and Direction.AXIAL not in axes and not axes.isdisjoint(Direction)
    if not fitted:  # an older file does not state the directions
        return
    if not (of_bushing or direction.axis in (Direction.RADIAL, Direction.TORSION)):
        if corrected.isdisjoint(direction.labels):
            sentence = (
                f"not fitted, predicted from the {tests} tests. The band excludes errors of the "
                "dimensions, and differences between two bodies of one compound"
            )
            yield Caveat("direction_not_fitted", sentence).about(direction)
        return
    radially = direction.axis is Direction.RADIAL or (Direction.AXIAL not in axes and Direction.RADIAL in axes)
    formula, error = Direction.TORSION, "because the formula replaces the uneven strain by one value"
    if radially and bushing:
        formula, error = Direction.RADIAL, _radial_error(bushing)
    if formula in corrected:
        return
    band = f"{'The band excludes' if result.fitted else 'No band includes'} the error of the {formula} formula"
    kind, agreement = "direction_not_fitted", ""
    if any(test.place == str(direction) for test in result.tests):
        kind, agreement = "direction_not_confirmed", "; the measured sweep differs by more than its noise"
        if agrees_within_noise(result, direction):
            kind, agreement = "direction_confirmed", "; the measured sweep agrees within its noise"
    sentence = f"not fitted, predicted from the {tests} tests{agreement}. {band}, {error}"
    yield Caveat(kind, sentence).about(direction)
    if radially and bushing:
        yield from _compressibility_warning(result, bushing, direction)


def _compressibility_warning(result: Result, bushing: Bushing, direction: Place) -> Iterator[Caveat]:
    """Yield a warning if a bulk modulus of 2 GPa would lower the radial stiffness by more than 1 %."""
    place = direction if direction.axis is Direction.RADIAL else Direction.RADIAL
    decrease = bushing.correction.stiffness_decrease(result.model.values.get("mu", 0.0)) if bushing.correction else 0.0
    if decrease > _NOTED_LOWERING:
        lowered = f"would lower the radial stiffness of this shape by {number(100.0 * decrease, 2)} %"
        sentence = f"the model assumes incompressible rubber; a bulk modulus of 2 GPa {lowered}"
        yield Caveat("incompressible", sentence).about(place)


def _radial_error(bushing: Bushing) -> str:
    """Phrase on the relative deviation of the bushing's radial stiffness and strain formulas from finite elements."""
    if bushing.correction is None:
        return "which was not compared with finite elements of this shape"
    if bushing.shape == "calibrated":
        return "up to 1 % in stiffness and 3 % in strain compared with finite elements"
    stiffness, strain = (number(100.0 / factor - 100.0, 2, "+") for factor in bushing.correction[:2])
    error = f"for this shape {stiffness} % in stiffness and {strain} % in strain compared with finite elements"
    return f'{error}; shape = "calibrated" in the campaign corrects it'


def format_deviation(ratios: Array) -> str:
    """Format the smallest and largest value of ratio - 1 in percent, such as "+1.2 to +3.4 %".

    Args:
        ratios: ratios of two stiffnesses at the same points, such as model over measurement, (n,).
    """
    ends = [number(round(100.0 * end - 100.0, 9), 2, "+") for end in (np.nanmin(ratios), np.nanmax(ratios))]
    return f"{' to '.join(dict.fromkeys(ends))} %"


def extrapolations(result: Result, points: OperatingPoints, subject: str | None = None) -> Iterator[Caveat]:
    """Generate warnings for frequencies, strains and a temperature outside of the fitted range.

    Args:
        result: fitted result.
        points: operating points of the prediction, with its temperature if the model depends on the temperature.
        subject: beginning of the warnings; None for the name of the direction.

    Yields:
        A warning for each quantity outside its range; none for a model without fitted tests.
    """
    if result.measured is None:
        return
    subject = subject or str(points.place)
    if (kelvin := points.conditions.temperature) is not None and (tested := result.measured.temperature):
        predicted, *ends = (number(float(end) - CELSIUS, 3) for end in (kelvin, *tested))
        if not tested[0] - SAME_TEMPERATURE <= kelvin <= tested[1] + SAME_TEMPERATURE:
            fitted = f"predicted at {predicted} degC, but fitted at {' to '.join(dict.fromkeys(ends))} degC only"
            sentence = f"{fitted}: extrapolated by the law of Williams, Landel and Ferry"
            yield Caveat("extrapolated_temperature", sentence).about(subject)
    strain_percent = 100.0 * result.model.unit_strain(points.place) * points.amplitude
    fitted_percent = [100.0 * end for end in result.measured.strain]
    for kind, axis, unit, digits, values, (low, high) in (
        ("extrapolated_frequency", "frequencies", "Hz", 3, points.frequency, result.measured.frequency),
        ("extrapolated_strain", "strains", "%", 2, strain_percent, fitted_percent),
    ):
        if values.min() < low * (1 - MARGIN) or values.max() > high * (1 + MARGIN):
            predicted, fitted = (
                format_range(unit, *ends, digits=digits) for ends in ((values.min(), values.max()), (low, high))
            )
            sentence = f"predicted at {axis} of {predicted}, but fitted at {fitted} only: {BEYOND}"
            yield Caveat(kind, sentence).about(subject)
