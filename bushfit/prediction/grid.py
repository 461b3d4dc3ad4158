"""The grid of a prediction where none is asked for: that of the sweeps, or the paper's as far as it was measured."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import PredictSettings
from bushfit.effects.contract import Array
from bushfit.geometry import ROTATION, STRAINING, TRANSLATION, Direction, Place, Specimen
from bushfit.model.result import Result
from bushfit.prediction.caveats import MARGIN
from bushfit.reading.measurement import Sweep
from bushfit.reading.runs import nominal
from bushfit.simulation.undisturbed import PAPER_AMPLITUDES as PAPER_AMPLITUDES
from bushfit.simulation.undisturbed import PAPER_FREQUENCIES as PAPER_FREQUENCIES

#: Amplitudes of each kind of motion where none were measured: those of torsion [rad], which the paper did not measure,
#: and of the material's strain [1] are chosen so that strains are like the paper's.
_AMPLITUDES_OF = {
    TRANSLATION: PAPER_AMPLITUDES,
    ROTATION: tuple(float(np.radians(x)) for x in (0.5, 1.0, 2.0)),
    STRAINING: (0.01, 0.02, 0.05),
}
#: Keys of [predict] that have the amplitudes of each motion.
_AMPLITUDE_KEYS = {TRANSLATION: "amplitudes", ROTATION: "torsion_amplitudes", STRAINING: "strain_amplitudes"}
#: Frequencies of a grid where the paper's were not measured.
_FREQUENCIES = 9
#: Amplitudes of a grid where the paper's were not measured.
_AMPLITUDES = 3
#: Values of a grid at most of what was stepped through as it came: tables stay readable, and lines smooth.
_MOST_STEPS = 10


def asked_or(usual: tuple[Array, Array], asked: PredictSettings, place: Place) -> tuple[Array, Array]:
    """Frequencies and amplitudes at a place as they are asked for, else the usual ones."""
    every = asked.frequencies, getattr(asked, _AMPLITUDE_KEYS[place.motion])
    frequencies, amplitudes = (np.array(stated or own) for stated, own in zip(every, usual, strict=True))
    return frequencies, amplitudes


def grid_settings(asked: PredictSettings, campaign: Campaign | None) -> PredictSettings:
    """Settings asked for, completed by the [predict] of a campaign."""
    given = {key: value for key, value in vars(asked).items() if value is not None}
    return replace(campaign.predict if campaign else PredictSettings(), **given)


def default_grid(result: Result, direction: Place, sweeps: Sequence[Sweep] = ()) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes [m or rad] to predict at where none are asked for, rising.

    They are those of the sweeps at this place, so that prediction and measurement stand side by side, a level that
    several sweeps reached more or less counting once; of amplitudes that were stepped, and of what swings free, at most
    ten over their range. Without sweeps they are those that the model file lists. Without any they are the paper's as
    far as they lie in the measured range, or an even grid over that range where fewer than two do.
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
    amplitudes = np.array(_AMPLITUDES_OF[direction.motion])
    frequencies = np.array(PAPER_FREQUENCIES)
    if result.measured is None:
        return frequencies, amplitudes
    inside = _inside(frequencies, [result.measured.frequency])
    if inside.size < 2:
        inside = _distinct(np.geomspace(*result.measured.frequency, _FREQUENCIES))
    if direction.is_rotation:
        return inside, amplitudes
    per_displacement = result.model.unit_strain(direction if isinstance(direction, Specimen) else Direction.AXIAL)
    return inside, _within(amplitudes, [np.array(result.measured.strain) / per_displacement], _AMPLITUDES)


def common_grid(
    results: Sequence[Result], places: Sequence[Place], sweeps: Sequence[Sweep] = ()
) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes [m, rad or 1] at which several results compare at one place, rising.

    It is the default grid of the first, as far as all were fitted there, so that differences are stated where something
    was measured; an even grid over the common range where fewer than two of its values are. Where the ranges have
    nothing in common, or are not known, it is that of the first.

    Args:
        places: the place as each result has it.
    """
    known = [(result.measured, place, result) for result, place in zip(results, places, strict=True) if result.measured]
    frequency, amplitude = default_grid(results[0], places[0], sweeps)
    if not known:
        return frequency, amplitude
    frequencies = [measured.frequency for measured, _, _ in known]
    strains = [(np.array(measured.strain) / result.model.unit_strain(place)) for measured, place, result in known]
    return _within(frequency, frequencies, _FREQUENCIES), _within(amplitude, strains, _AMPLITUDES)


def _within(values: Array, ranges: Sequence[Any], count: int) -> Array:
    """The values within all ranges, or so many evenly over what these have in common; all where that is nothing."""
    inside, low, high = _inside(values, ranges), max(low for low, _ in ranges), min(high for _, high in ranges)
    if low > high * (1 + MARGIN):
        return values
    return inside if inside.size > 1 else _even(low, high, count)


def _inside(values: Array, ranges: Sequence[Any]) -> Array:
    """The values within all ranges."""
    return values[np.all([(values >= a * (1 - MARGIN)) & (values <= b * (1 + MARGIN)) for a, b in ranges], axis=0)]


def _levelled(sweeps: Sequence[Sweep]) -> list[Sweep]:
    """Sweeps of one place in which amplitudes of one level, as each sweep has it, are the same."""
    held = [sweep for sweep in sweeps if sweep.stepped]
    points = np.hstack([np.empty((2, 0)), *(np.stack((sweep.amplitude, sweep.frequency)) for sweep in held)])
    amplitude = np.unique(points, axis=1)[0]  # each point once, however often it was repeated
    level = dict(zip(amplitude, nominal(amplitude), strict=True))
    changed = (replace(sweep, amplitude=np.array([level[each] for each in sweep.amplitude])) for sweep in held)
    return [*changed, *(sweep for sweep in sweeps if not sweep.stepped)]


def measured_levels(sweeps: Sequence[Sweep], axis: Literal["frequency", "amplitude"]) -> Array:
    """The values of some sweeps of one place, rising; in place of many that were taken as they came, some that span
    them."""
    sweeps = _levelled(sweeps) if axis == "amplitude" else sweeps
    parts: tuple[list[Array], list[Array]] = [], []
    for sweep in sweeps:
        as_it_came = sweep.stepped is None or sweep.stepped == axis == "amplitude"
        parts[as_it_came].append(getattr(sweep, axis))
    planned, came = (_distinct(np.concatenate([np.empty(0), *part])) for part in parts)
    spanned = came if came.size <= _MOST_STEPS else _even(came[0], came[-1], _MOST_STEPS)
    return _distinct(np.concatenate([planned, spanned]))


def _even(least: float, most: float, count: int) -> Array:
    """Values of three digits in equal ratios between two ends."""
    return _distinct(np.array([float(f"{x:.3g}") for x in np.geomspace(least, most, count)]))


def _distinct(values: Array) -> Array:
    """The values, rising, each further above the last than a rig that misses its set point would be."""
    kept: list[float] = []
    for value in np.unique(values):
        if not kept or value > kept[-1] * (1.0 + MARGIN):
            kept.append(float(value))
    return np.array(kept)
