"""Physics that the library lacks, and must never gain: laws over time, added to the rig's force of every test.

The laws of the library are shared with the fit, in time as in frequency; these are not, so that what is said of them is
said of what nobody thought of. Each is a stress over the history of the strain, of any size: `outside_of` brings it to
the size that a campaign asks for.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import lfilter

from bushfit.effects.contract import Array, ForceBelow, Setting
from bushfit.effects.history import History, reversals
from bushfit.geometry import Direction, Place
from bushfit.model import rig
from cards.faults import band
from cards.recipe import Around, Bench, Recipe, Rigged

#: Frequencies [Hz] at which a law is looked at, to find its largest share of |K|.
_LOOKED_AT = (5.0, 25.0, 45.0, 65.0, 85.0, 105.0, 155.0)

#: Stress of any size by the history of the strain.
Stress = Callable[[History], Array]


@dataclass(frozen=True)
class Scale:
    """What a law is made for: the middle level's strain, its rate [1/s] at a frequency in the band, and a draw."""

    strain: float
    rate: float
    frequency: float
    draw: float


def _weakening(scale: Scale) -> Stress:
    return lambda history: history.sense / (1.0 + np.abs(history.rate) / scale.rate)


def _threshold(scale: Scale) -> Stress:
    return lambda history: history.sense * np.maximum(np.abs(history.rate) - scale.rate, 0.0)


def _creep(scale: Scale) -> Stress:
    return lambda history: np.arcsinh(20.0 * history.rate / scale.rate)


def _shortening(scale: Scale) -> Stress:
    """Maxwell's arm whose relaxation time falls with the amplitude."""

    def stress(history: History) -> Array:
        time = 1.0 / (2.0 * np.pi * scale.frequency * (1.0 + (float(history.amplitude[0]) / scale.strain) ** 2))
        keep = np.exp(-history.step / time)
        return np.asarray(lfilter([1.0], [1.0, -keep], np.diff(history.value, prepend=0.0)))

    return stress


def _resonance(scale: Scale) -> Stress:
    return lambda history: band(history, scale.frequency, (0.15 + 0.25 * scale.draw) * scale.frequency)


def _strokes(history: History) -> list[tuple[Array, float]]:
    """Per stroke the strain from the turn before it on, and its sense; the first begins at rest."""
    value = history.value
    turns = [0, *np.flatnonzero(reversals(value)).tolist(), value.size]
    return [
        (value[first:last] - value[first], float(np.sign(value[last - 1] - value[first])))
        for first, last in pairwise(turns)
    ]


def _stick_slip(scale: Scale) -> Stress:
    """A slider that sticks up to a force and then slides at 60 % of it."""
    yields, slides = 0.4 * scale.strain, 0.24 * scale.strain

    def stress(history: History) -> Array:
        parts, start = [], 0.0
        for travel, sense in _strokes(history):
            held = sense * start + np.abs(travel)
            slipping = np.maximum.accumulate(held > yields)
            held[slipping] = slides
            parts.append(sense * held)
            start = float(parts[-1][-1])
        return np.concatenate(parts)

    return stress


def _quartic(_: Scale) -> Stress:
    return lambda history: np.abs(history.value) ** 3 * history.value


def _bouc_wen(scale: Scale) -> Stress:
    """dz/de = 1 - |z|^2 (0.7 sgn(z de) + 0.3), z in units of half the middle strain, by Euler's steps."""

    def stress(history: History) -> Array:
        z, found = 0.0, []
        for change in np.diff(history.value / (0.5 * scale.strain), prepend=0.0).tolist():
            z += change * (1.0 - z * z * (0.7 if z * change > 0.0 else -0.7) - 0.3 * z * z)
            found.append(z)
        return np.array(found)

    return stress


def _root_damper(_: Scale) -> Stress:
    return lambda history: history.sense * np.sqrt(np.abs(history.rate))


def _outside_of(law: Callable[[Scale], Stress]) -> Callable[[Bench], Around]:
    """A law of which the largest share of |K| that any test sees is the size of the bench."""

    def in_rig(bench: Bench) -> Around:
        model = bench.bushing
        strain = float(np.median(bench.levels())) * model.unit_strain(Direction.AXIAL)
        frequency = bench.between(20.0, 100.0)
        stress = law(Scale(strain, 2.0 * np.pi * frequency * strain, frequency, bench.random.random()))

        def force(history: History, place: Place) -> Array:
            per_displacement = model.unit_strain(place)
            unit = model.stiffness_per_modulus(place) / (2.0 * per_displacement)
            return unit * stress(history.scaled(per_displacement))

        own = model.bushing, model.effects, model.values
        alone = Rigged(*own, around=lambda _, history, setting: force(history, setting.direction))
        swept = [(f, float(x)) for f in _LOOKED_AT for x in bench.levels()]
        looped = [(test.frequency, test.amplitude) for test in bench.plan.loops]
        points = np.array([*swept, *looped]).T
        # its size alone is asked for, so that few steps and cycles are enough
        seen = rig.dynamic_stiffness(alone, Direction.AXIAL, *points, run_in=4, steps_per_cycle=256)
        scale = bench.size / float(np.max(np.abs(seen / model.stiffness(Direction.AXIAL, *points))))

        def around(below: ForceBelow, history: History, setting: Setting) -> Array:
            return below(history) + scale * force(history, setting.direction)

        return around

    return in_rig


#: Every law as a kind of campaign, by name; none may ever enter the library.
OUTSIDE_LAWS: dict[str, Recipe] = {
    name: Recipe(sentence, rig=_outside_of(law))
    for name, (sentence, law) in {
        "velocity_weakening_slip": ("A slip whose force falls with its speed.", _weakening),
        "rate_threshold": ("A damper that acts above a strain rate only.", _threshold),
        "logarithmic_creep": ("A stress that grows with the logarithm of the strain rate (Eyring).", _creep),
        "shortening_relaxation": ("A Maxwell arm whose relaxation time falls with the amplitude.", _shortening),
        "resonance_in_the_band": ("A mode inside the rubber, inside the band.", _resonance),
        "stick_slip": ("A slider whose sticking force is higher than its sliding force.", _stick_slip),
        "quartic_stiffening": ("A stress that grows with |e|^3 e.", _quartic),
        "bouc_wen": ("The hysteresis of Bouc (1967) and Wen (1976).", _bouc_wen),
        "root_damper": ("A damper whose stress grows with the square root of the strain rate.", _root_damper),
    }.items()
}
