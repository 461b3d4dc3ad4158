"""Grids of a prediction: requested, measured, or that of Garcia Tarrago et al. 2007 within the measured range."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, TypedDict

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import PredictSettings
from bushfit.effects.contract import Array
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Direction, Place, bushing_at
from bushfit.model.result import Result
from bushfit.prediction.caveats import MARGIN
from bushfit.reading.measurement import Sweep
from bushfit.reading.runs import nominal_amplitudes
from bushfit.simulation.exact import PAPER_AMPLITUDES as PAPER_AMPLITUDES
from bushfit.simulation.exact import PAPER_FREQUENCIES as PAPER_FREQUENCIES

#: Frequencies, amplitudes or other numbers of a grid.
Numbers = Sequence[float] | Array
#: Amplitudes of each kind of motion where none were measured: those of torsion [rad], which the paper did not measure,
#: and of the material's strain [1] are chosen so that strains are like the paper's.
_AMPLITUDES_OF = {
    TRANSLATION: PAPER_AMPLITUDES,
    ROTATION: tuple(float(np.radians(x)) for x in (0.5, 1.0, 2.0)),
    STRAINING: (0.01, 0.02, 0.05),
}
#: Keys of [predict] that have the amplitudes of each motion.
_AMPLITUDE_KEYS = {TRANSLATION: "amplitudes", ROTATION: "torsion_amplitudes", STRAINING: "strain_amplitudes"}
#: Number of frequencies of a grid if the measured range excludes the paper's frequencies.
_FREQUENCIES = 9
#: Number of amplitudes of a grid if the measured range excludes the paper's amplitudes.
_AMPLITUDES = 3
#: Largest number of grid values over a range that the test did not control: tables stay readable, and curves smooth.
_MOST_STEPS = 10


class GridOptions(TypedDict, total=False):
    """Directions and operating points of a prediction; a missing key, or None, selects the default.

    Args:
        directions: directions or specimens by name.
        frequencies: frequencies [Hz].
        amplitudes: zero-to-peak displacements [m].
        torsion_amplitudes: zero-to-peak rotations [rad].
        strain_amplitudes: zero-to-peak strains of specimens that give a modulus.
    """

    directions: Sequence[str] | None
    frequencies: Numbers | None
    amplitudes: Numbers | None
    torsion_amplitudes: Numbers | None
    strain_amplitudes: Numbers | None


def requested_grid(default: tuple[Array, Array], requested: PredictSettings, place: Place) -> tuple[Array, Array]:
    """Choose the frequencies and amplitudes of a prediction: those requested, or the default for what is not requested.

    Args:
        default: default frequencies [Hz] and zero-to-peak amplitudes [m, rad or 1].
        requested: settings of a command, or table [predict] of a campaign.
        place: direction or specimen.

    Returns:
        Frequencies [Hz], (j,), and zero-to-peak amplitudes [m, rad or 1], (k,); the grid has all combinations.
    """
    frequencies = requested.frequencies or default[0]
    amplitudes = getattr(requested, _AMPLITUDE_KEYS[place.motion]) or default[1]
    return np.array(frequencies), np.array(amplitudes)


def static_reach(result: Result, place: Place, amplitudes: Array, requested: PredictSettings) -> float:
    """Choose the largest displacement of a static curve [m, rad or 1]: of the grid, or of the tested loops if larger.

    Args:
        result: fitted result, whose campaign lists the loops.
        place: direction or specimen.
        amplitudes: zero-to-peak amplitudes of the grid [m, rad or 1], (n,).
        requested: settings of the prediction; amplitudes that it states have priority over the loops.
    """
    tests = result.campaign.tests if result.campaign else ()
    loops = [test.amplitude[-1] for test in tests if test.kind == "loop" and test.place == str(place)]
    is_requested = getattr(requested, _AMPLITUDE_KEYS[place.motion])
    return max(float(amplitudes.max()), *(() if is_requested else loops), 0.0)


def grid_settings(options: Mapping[str, object], campaign: Campaign | None = None) -> PredictSettings:
    """Settings of a prediction: the given options, else the [predict] table of a campaign, else None for the default.

    Args:
        options: directions and operating points by the keys of `GridOptions`, such as {"frequencies": [20.0, 50.0]}.
        campaign: campaign; None without one.

    Returns:
        Settings, in which an empty value stands for the default.
    """
    requested: dict[str, Any] = {
        key: tuple(value if isinstance(value, str) else float(value) for value in values)
        for key, values in options.items()
        if isinstance(values, Iterable)
    }
    settings = campaign.predict if campaign else PredictSettings()
    return replace(settings, **{key: values for key, values in requested.items() if values})


def default_grid(result: Result, direction: Place, sweeps: Sequence[Sweep] = ()) -> tuple[Array, Array]:
    """Choose the frequencies and amplitudes of a prediction for which the user requests none.

    The first available of: the operating points of the sweeps (one value per level, and at most ten values over a range
    without levels); the points of the tests in the model file; the grid of Garcia Tarrago et al. 2007 (5 to 155 Hz;
    0.1, 0.2 and 0.5 mm, or similar strains) within the measured range; a few values over the measured range.

    Args:
        result: fitted result.
        direction: direction or specimen.
        sweeps: measured sweeps; sweeps of other directions are ignored.

    Returns:
        Frequencies [Hz] and zero-to-peak amplitudes [m, rad or 1], increasing.
    """
    mine = [sweep for sweep in sweeps if sweep.direction == direction]
    if mine:
        return measured_levels(mine, "frequency"), measured_levels(mine, "amplitude")
    if result.campaign and (tests := [test for test in result.campaign.tests if test.place == str(direction)]):
        frequency, amplitude = (
            np.hstack([getattr(test, key) for test in tests]) for key in ("frequencies_Hz", "amplitudes")
        )
        if frequency.size and amplitude.size:
            return _distinct(frequency), _distinct(amplitude)
    frequencies, amplitudes = np.array(PAPER_FREQUENCIES), np.array(_AMPLITUDES_OF[direction.motion])
    if result.measured is None:
        return frequencies, amplitudes
    frequencies = _limit(frequencies, [result.measured.frequency], _FREQUENCIES)
    if direction.is_rotation:
        return frequencies, amplitudes
    tube = bushing_at(result.model.bushing, direction)
    per_displacement = tube.unit_strain(Direction.AXIAL) if tube else result.model.unit_strain(direction)
    return frequencies, _limit(amplitudes, [np.array(result.measured.strain) / per_displacement], _AMPLITUDES)


def common_grid(
    results: Sequence[Result], places: Sequence[Place], sweeps: Sequence[Sweep] = ()
) -> tuple[Array, Array]:
    """Choose the grid for the comparison of several results in one direction.

    The grid is the default grid of the first result within the range to which all results were fitted, or an even grid
    over that range if it contains fewer than two values. Without a common range, it is the default grid.

    Args:
        results: fitted results.
        places: direction or specimen of each result.
        sweeps: measured sweeps.

    Returns:
        Frequencies [Hz] and zero-to-peak amplitudes [m, rad or 1], increasing.
    """
    ranges = [
        (measured.frequency, np.array(measured.strain) / result.model.unit_strain(place))
        for result, place in zip(results, places, strict=True)
        if (measured := result.measured)
    ]
    frequency, amplitude = default_grid(results[0], places[0], sweeps)
    if not ranges:
        return frequency, amplitude
    frequencies, amplitudes = zip(*ranges, strict=True)
    return _limit(frequency, frequencies, _FREQUENCIES), _limit(amplitude, amplitudes, _AMPLITUDES)


def _limit(values: Array, ranges: Sequence[Any], count: int) -> Array:
    """Limit the frequencies or amplitudes of a grid to ranges that were tested.

    Args:
        values: frequencies [Hz] or amplitudes [m, rad or 1], (n,).
        ranges: pairs of lowest and highest value, one per tested result.
        count: number of values to make if fewer than two of the values are within all ranges.

    Returns:
        Values within all ranges; or `count` values in equal ratios over the common range; or, without a common range,
        all values.
    """
    low, high = max(low for low, _ in ranges), min(high for _, high in ranges)
    if low > high * (1 + MARGIN):
        return values
    inside = values[(values >= low * (1 - MARGIN)) & (values <= high * (1 + MARGIN))]  # rigs miss their set points
    return inside if inside.size > 1 else _distinct(np.geomspace(low, high, count), digits=3)


def measured_levels(sweeps: Sequence[Sweep], axis: Literal["frequency", "amplitude"]) -> Array:
    """List the distinct frequencies or amplitudes at which the sweeps of one direction were measured.

    Args:
        sweeps: sweeps of one direction or specimen.
        axis: "frequency" or "amplitude".

    Returns:
        Values [Hz, m, rad or 1], increasing. A quantity that the tests did not hold at levels is represented by at most
        ten values over its range.
    """
    set_values, free_values = [np.empty(0)], [np.empty(0)]
    levels: dict[float, float] = {}
    if axis == "amplitude":  # amplitudes of one level, as each sweep has it, are the same
        controlled = [np.stack((sweep.amplitude, sweep.frequency)) for sweep in sweeps if sweep.stepped]
        points = np.unique(np.hstack([np.empty((2, 0)), *controlled]), axis=1)  # once, however often it was repeated
        levels = dict(zip(points[0].tolist(), nominal_amplitudes(points[0]).tolist(), strict=True))
    for sweep in sweeps:
        values = getattr(sweep, axis)
        if sweep.stepped:
            values = np.array([levels.get(value, value) for value in values.tolist()])
        is_free = sweep.stepped is None or sweep.stepped == axis == "amplitude"
        (free_values if is_free else set_values).append(values)
    spanned = _distinct(np.concatenate(free_values))
    if spanned.size > _MOST_STEPS:
        spanned = _distinct(np.geomspace(spanned[0], spanned[-1], _MOST_STEPS), digits=3)
    return _distinct(np.concatenate([_distinct(np.concatenate(set_values)), spanned]))


def _distinct(values: Array, digits: int = 17) -> Array:
    """Sort values, and omit those up to 1 % above the one before: the rig reaches a set point only approximately.

    Args:
        values: frequencies or amplitudes, (n,), in any order.
        digits: significant digits to which the values are rounded first; by default they are unchanged.

    Returns:
        The remaining values, ascending, (k,).
    """
    distinct: list[float] = []
    for value in np.unique([float(f"{value:.{digits}g}") for value in values]).tolist():
        if not distinct or value > distinct[-1] * (1.0 + MARGIN):
            distinct.append(value)
    return np.array(distinct)
