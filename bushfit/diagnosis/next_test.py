"""The measurement that would decide: of a menu, the entry that tells most of several explanations per effort."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array, Level
from bushfit.fitting.data_sets import DataSet, parted
from bushfit.geometry import Direction, Place
from bushfit.model.model import Model

#: Relative noise of one point of a test that does not exist yet: that of a good servo-hydraulic rig.
_NOISE = 5e-3
#: Odds of an explanation, relative to the likeliest, below which it counts as if it had these.
_LEAST_ODDS = 1e-6
#: Information below which a test tells nothing [nats].
_TELLS_SOMETHING = 1e-6


@dataclass(frozen=True)
class MenuEntry:
    """A test a lab can do.

    Args:
        effort: in units of one more sweep.
        frequencies: [Hz], or multiples of the campaign's highest where `beyond`; None for those of the campaign.
        beyond: whether the frequencies count from the campaign's highest.
        amplitudes: relative to the campaign's largest; None for its own.
        without_rig: True where the test removes or knows what belongs to the rig.
    """

    words: str
    effort: float
    direction: Place | None = None
    frequencies: tuple[float, ...] | None = None
    beyond: bool = False
    amplitudes: tuple[float, ...] | None = None
    without_rig: bool = False


MENU = (
    MenuEntry("run the empty fixture, or add a known mass, at the same frequencies", 0.5, without_rig=True),
    MenuEntry(
        "put a steel dummy in place of the bushing: it shows the rig's compliance, delay and gain",
        0.5,
        without_rig=True,
    ),
    MenuEntry("sweep from 0.05 to 5 Hz at the same amplitudes", 1.5, frequencies=(0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)),
    MenuEntry("sweep to twice the highest frequency", 1.0, frequencies=(1.1, 1.4, 1.7, 2.0), beyond=True),
    MenuEntry("sweep at a fifth and a tenth of the smallest amplitude", 1.0, amplitudes=(-0.1, -0.2)),
    MenuEntry("sweep at one and a half and twice the largest amplitude", 1.0, amplitudes=(1.5, 2.0)),
    MenuEntry("sweep in the radial direction at the same amplitudes", 1.0, direction=Direction.RADIAL),
    MenuEntry("sweep in the axial direction at the same amplitudes", 1.0, direction=Direction.AXIAL),
    MenuEntry("sweep in torsion", 2.0, direction=Direction.TORSION, amplitudes=(1.0,)),
)


def deciding_test(models: Sequence[Model], odds: Sequence[float], data_sets: Sequence[DataSet]) -> str:
    """The entry that is expected to tell most of which model is true, per effort; "" where none tells anything.

    Args:
        models: that explain the tests so far, each with its probability in `odds`.

    A distance is that of complex stiffness over the test's points, in units of noise.
    """
    if len(models) < 2:
        return ""
    swept = {sweep.direction for sweep in parted(data_sets)[1]}
    menu = [entry for entry in MENU if entry.direction not in swept]
    nothing = entropy_left(odds, np.zeros((len(models), len(models))))
    told = [float(nothing - entropy_left(odds, _distances(entry, models, data_sets))) for entry in menu]
    best = max(range(len(menu)), key=lambda place: told[place] / menu[place].effort)
    return menu[best].words if told[best] > _TELLS_SOMETHING else ""


def entropy_left(odds: Sequence[float] | Array, distances: Array) -> Array:
    """How open it is, at the most, which of several explanations is right once tests are done [nats], (...).

    Args:
        odds: of each explanation before, in any unit, (r,).
        distances: chi-square between what any two expect of the tests, (..., r, r).

    Notes: of mixtures of normal distributions the tests tell at least -sum_i p_i ln sum_j p_j exp(-d_ij/8)
        (Kolchinsky and Tracey, 2017) of the entropy of the odds; this is the rest.
    """
    p = np.maximum(odds, _LEAST_ODDS * np.max(odds))
    p = p / p.sum()
    others = np.exp(-distances / 8.0) * (1.0 - np.eye(p.size))  # by themselves: next to 1 they would be rounded away
    return np.asarray(np.log1p(others @ p / p) @ p)


def _distances(entry: MenuEntry, models: Sequence[Model], data_sets: Sequence[DataSet]) -> Array:
    """Between the responses of any two models to a test, squared, in units of noise, (models, models)."""
    frequency, amplitude, direction = _points(entry, data_sets)
    if entry.without_rig:
        frequency, amplitude, direction = _points(MenuEntry("", 1.0), data_sets)
        responses = [_rig_share(model, direction, frequency, amplitude) for model in models]
    else:
        responses = [np.log(model.stiffness(direction, frequency, amplitude)) for model in models]
    each = np.array(responses)
    return np.sum(np.square(np.abs(each[:, None] - each)), axis=-1) / _NOISE**2


def _rig_share(model: Model, direction: Place, frequency: Array, amplitude: Array) -> Array:
    bare = model.without(Level.INSTRUMENT)
    return np.log(model.stiffness(direction, frequency, amplitude) / bare.stiffness(direction, frequency, amplitude))


def _points(entry: MenuEntry, data_sets: Sequence[DataSet]) -> tuple[Array, Array, Place]:
    direction = entry.direction or data_sets[-1].direction
    same = [data_set for data_set in data_sets if data_set.direction == direction] or list(data_sets)
    amplitudes = np.unique(np.concatenate([data_set.amplitude for data_set in same]))
    if direction.is_rotation and not same[0].direction.is_rotation:
        amplitudes = np.array([0.02])
    if entry.amplitudes:
        amplitudes = np.array([amplitudes.min() * -x if x < 0 else amplitudes.max() * x for x in entry.amplitudes])
    measured = np.unique(np.concatenate([data_set.frequency for data_set in data_sets]))
    frequencies = np.array(entry.frequencies) if entry.frequencies else measured
    f, x = np.meshgrid(frequencies * (measured.max() if entry.beyond else 1.0), amplitudes)
    return f.ravel(), x.ravel(), direction
