"""What a prediction cannot say: sentences on what was not fitted, what is extrapolated, and what a model leaves out."""

from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from bushfit.effects import Level, get_effect
from bushfit.effects.contract import Array
from bushfit.geometry import Bushing, Direction, Place
from bushfit.model.covariance import Z95
from bushfit.model.result import Result
from bushfit.reading.measurement import SAME_TEMPERATURE
from bushfit.units import CELSIUS, format_range, number

#: Beyond the fitted range by more than this, relative to its end, a prediction is an extrapolation: rigs miss their
#: set points by less.
MARGIN = 0.01
#: What is said of a prediction outside of the tests.
BEYOND = "extrapolated beyond"
#: Share by which a finite bulk modulus lowers the radial stiffness, from which that is said: that of the other errors.
_NOTED_LOWERING = 0.01
#: Relative difference of two stiffnesses that is none.
_SAME = 1e-6


def warnings_of(result: Result, found: Iterable[Iterable[str]] = (), notes: Iterable[str] = ()) -> list[str]:
    """All that a reader of a result's numbers must know: notes, the fit's, of predictions, of the result; each once."""
    return list(dict.fromkeys((*notes, *result.warnings, *chain.from_iterable(found), *caveats(result))))


def caveats(result: Result) -> list[str]:
    """Sentences on what holds of a result itself, whatever is predicted with it."""
    fitted = result.measured.directions if result.measured else ()
    own = {*Direction, *(specimen.name for specimen in result.specimens)}  # a compound was fitted on other bodies
    lines = [line for name in fitted if name in own for line in unfitted(result, result.place(name))]
    for name in result.unresolved:
        twins = " or ".join(get_effect(name).twins)
        lines.append(f"{name} is taken as the bushing's, but these tests cannot tell it from {twins}")
    lines += result.undecided
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
    return [name for name in result.model.effects if get_effect(name).level is Level.INSTRUMENT]


def unfitted(result: Result, direction: Place) -> Iterator[str]:
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


def of_points(
    result: Result, place: Place, at: Array, if_rigs: Array | None, measured: Array | None, temperature: float | None
) -> Iterator[str]:
    """Warnings of |K| at operating points, (3, n): frequency [Hz], amplitude, |K| [SI], which may be the rig's in part,
    or was measured otherwise, (n,)."""
    frequency, amplitude, stiffness = at
    yield from result.undecided
    yield from unfitted(result, place)
    yield from extrapolations(result, place, frequency, amplitude, temperature)
    known = set() if temperature is None else {"temperature"}
    effects = result.model.without(Level.INSTRUMENT).records
    yield from (effect.assumption for effect in effects if effect.assumption and not known & {*effect.under})
    rig = rig_effects(result)
    if rig and measured is not None and not np.isnan(measured).all():
        off = percent_off(stiffness / np.abs(measured))
        yield f"{place}: without {' and '.join(rig)} the predicted stiffness is {off} against what was measured"
    if if_rigs is not None:
        ratio, if_so = if_rigs / stiffness, f"if {' and '.join(result.unresolved)} is the rig's"
        off = f"{percent_off(ratio)} {if_so}; low and high span both"
        yield f"{place}: stiffness {f'the same {if_so}' if np.allclose(ratio, 1.0, atol=_SAME) else off}"


def percent_off(ratio: Array) -> str:
    """How far ratios are off 1, in words: "+1.2 to +3.4 %"."""
    ends = [number(100.0 * end - 100.0, 2, "+") for end in (np.nanmin(ratio), np.nanmax(ratio))]
    return f"{' to '.join(dict.fromkeys(ends))} %"


def extrapolations(
    result: Result,
    direction: Place,
    frequency: Array,
    amplitude: Array,
    temperature: float | None = None,
    what: str | None = None,
) -> Iterator[str]:
    """A warning each for frequencies, strains and the temperature [K] of a prediction that leave what was fitted."""
    if result.measured is None:
        return
    percent = 100.0 * result.model.unit_strain(direction)
    axes = (
        ("frequencies", "Hz", 3, frequency, result.measured.frequency),
        ("strains", "%", 2, percent * amplitude, [100.0 * end for end in result.measured.strain]),
    )
    if temperature and (tested := result.measured.temperature):
        asked_for, *ends = (number(kelvin - CELSIUS, 3) for kelvin in (temperature, *tested))
        if not tested[0] - SAME_TEMPERATURE <= temperature <= tested[1] + SAME_TEMPERATURE:
            there = f"predicted at {asked_for} degC, but fitted at {' to '.join(dict.fromkeys(ends))} degC only"
            yield f"{what or direction}: {there}: extrapolated by the law of Williams, Landel and Ferry"
    for axis, unit, digits, asked, (low, high) in axes:
        if asked.min() < low * (1 - MARGIN) or asked.max() > high * (1 + MARGIN):
            here, there = (
                format_range(unit, *ends, digits=digits) for ends in ((asked.min(), asked.max()), (low, high))
            )
            said = f"predicted at {axis} of {here}, but fitted at {there} only: {BEYOND}"
            yield f"{what or direction}: {said}"
