"""The next test: the test that separates rival explanations of a gap best per hour on the rig.

Candidates are tests of the bushing and tests of the fixture without it: empty, with a reference spring, or with a steel
dummy. Each is ranked by its information on the right explanation per hour, within the limits of the rig; `plan` ranks
its tests for rivals by the same information.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from bushfit.campaign.schema import UNSTATED, RigSettings
from bushfit.effects.contract import Array, Level
from bushfit.fitting.preparation import MeasuredTest, split_by_kind
from bushfit.geometry import TRANSLATION, Bushing, Direction, Place
from bushfit.model.model import Model

#: Relative noise of one point of a test that was not made yet: that of a good servo-hydraulic rig.
_NOISE = 5e-3
#: Smallest probability of an explanation, relative to the likeliest; smaller ones are raised to it.
_LEAST_ODDS = 1e-6
#: Information below which a test separates nothing [nats].
_LEAST_INFORMATION = 1e-6
#: Amplitude of a rotation if none was tested [rad]; chosen.
_ROTATION = 0.02
#: Stiffness of the part mounted in place of the bushing (nothing, reference spring, steel dummy), relative to the
#: bushing; and largest shear modulus that a model allows [Pa].
_EMPTY, _SPRING, _DUMMY = 1e-9, 1.0, 300.0
_LARGEST_MODULUS = 9e8

#: Start of the next test if a part of the tests is at fault.
MEASURE_AGAIN = "measure again: "


@dataclass(frozen=True)
class NextTest:
    """Candidate for the next test, of the bushing or of the fixture without the bushing.

    Args:
        sentence: instruction to the laboratory.
        hours: time on the rig, including the change of the set-up [h].
        place: direction or specimen to test; None for that of the last test.
        frequencies: frequencies [Hz], or if `beyond` multiples of the highest frequency so far; None for all
            frequencies tested so far.
        beyond: True if `frequencies` are multiples.
        amplitudes: amplitudes as multiples of the largest amplitude so far, or, if negative, of the smallest; None for
            all amplitudes tested so far.
        mounted: stiffness of the part mounted in place of the bushing, relative to the bushing; None for the bushing.
    """

    sentence: str
    hours: float
    place: Place | None = None
    frequencies: tuple[float, ...] | None = None
    beyond: bool = False
    amplitudes: tuple[float, ...] | None = None
    mounted: float | None = None


BUSHING_TESTS = (
    NextTest("sweep from 0.05 to 5 Hz at the same amplitudes", 1.5, frequencies=(0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)),
    NextTest("sweep to twice the highest frequency", 1.0, frequencies=(1.1, 1.4, 1.7, 2.0), beyond=True),
    NextTest("sweep at a fifth and a tenth of the smallest amplitude", 1.0, amplitudes=(-0.1, -0.2)),
    NextTest("sweep at one and a half and twice the largest amplitude", 1.0, amplitudes=(1.5, 2.0)),
    NextTest("sweep in the radial direction at the same amplitudes", 1.0, Direction.RADIAL),
    NextTest("sweep in the axial direction at the same amplitudes", 1.0, Direction.AXIAL),
    NextTest("sweep in torsion", 2.0, Direction.TORSION, amplitudes=(1.0,)),
)
FIXTURE_TESTS = (
    NextTest("run the empty {place} fixture, or add a known mass, at the same frequencies", 0.5, mounted=_EMPTY),
    NextTest("put a steel dummy in the {place} fixture: this measures the rig compliance", 0.5, mounted=_DUMMY),
    NextTest("put a reference spring in the {place} fixture: its stiffness and loss are known", 0.75, mounted=_SPRING),
)


def deciding_test(
    models: Sequence[Model],
    odds: Sequence[float],
    data_sets: Sequence[MeasuredTest],
    rig: RigSettings = UNSTATED,
) -> str:
    """Select the test that is expected to separate rival explanations best per hour on the rig.

    Args:
        models: one fitted model for each explanation of the tests so far.
        odds: probability of each model.
        data_sets: the tests so far.
        rig: limits of force, displacement, velocity and frequency of the rig.

    Returns:
        Instruction to the laboratory; "" if no test separates the models.
    """
    if len(models) < 2:
        return ""
    undecided = float(remaining_entropy(odds, np.zeros((len(models), len(models)))))
    best, best_rate = "", _LEAST_INFORMATION
    for test in _candidate_tests(data_sets, models[0].bushing):
        frequency, amplitude, place = _operating_points(test, data_sets)
        feasible = np.all([within_limits(model, rig, place, frequency, amplitude) for model in models], axis=0)
        if test.mounted is None and not feasible.any():
            continue
        points = (frequency[feasible], amplitude[feasible]) if test.mounted is None else (frequency, amplitude)
        distances = _chi_squares(test, models, place, *points)
        rate = (undecided - float(remaining_entropy(odds, distances))) / test.hours
        if rate > best_rate * (1.0 + 1e-9):
            best, best_rate = test.sentence, rate
    return best


def _candidate_tests(data_sets: Sequence[MeasuredTest], bushing: Bushing | None) -> Iterator[NextTest]:
    """Yield candidate tests: of the fixture without the bushing, and of the bushing at new and at tested conditions."""
    places = dict.fromkeys(data_set.direction for data_set in data_sets)
    for place, test in product(places, FIXTURE_TESTS):
        yield replace(test, place=place, sentence=test.sentence.format(place=place))
    swept = {sweep.direction for sweep in split_by_kind(data_sets)[1]}
    if bushing is None:  # several bushings, or coupons alone: which body to sweep is a choice of plan
        swept |= {*Direction}
    yield from (test for test in BUSHING_TESTS if test.place not in swept)


def within_limits(model: Model, rig: RigSettings, place: Place, frequency: Array, amplitude: Array) -> Array:
    """Mask of the operating points that are within the limits of a rig, (n,).

    Args:
        model: model that predicts the force.
        rig: limits of force, displacement, velocity and frequency; a limit that is not stated does not apply.
        place: direction or specimen.
        frequency: [Hz], (n,).
        amplitude: zero-to-peak [m or rad, or strain], (n,).

    Returns:
        True for each point that the rig can reach, (n,).
    """
    limits = [(frequency, rig.max_frequency)]
    force = np.abs(model.stiffness(place, frequency, amplitude)) * amplitude
    if place.motion is TRANSLATION:
        velocity = 2.0 * np.pi * frequency * amplitude
        limits += [(force, rig.max_force), (amplitude, rig.max_displacement), (velocity, rig.max_velocity)]
    elif place.is_rotation:
        limits += [(force, rig.max_moment), (amplitude, rig.max_rotation)]
    reachable = [values <= limit * (1.0 + 1e-9) for values, limit in limits if limit is not None]  # rounding
    return np.all([np.ones(np.shape(frequency), dtype=bool), *reachable], axis=0)


def remaining_entropy(odds: Sequence[float] | Array, distances: Array) -> Array:
    """Upper limit of the entropy over rival explanations that remains after further tests.

    Args:
        odds: probability of each of r explanations before the tests, not necessarily normalised, (r,).
        distances: chi-square between the predictions of each pair of explanations, (..., r, r).

    Returns:
        Entropy [nats] for each test, (...).

    Notes:
        For mixtures of normal distributions the tests reduce the entropy by -sum_i p_i ln sum_j p_j exp(-d_ij/8) at
        least (Kolchinsky and Tracey, 2017).
    """
    p = np.maximum(odds, _LEAST_ODDS * np.max(odds))
    p = p / p.sum()
    overlap = np.exp(-distances / 8.0) * (1.0 - np.eye(p.size))  # without the diagonal, beside which they would vanish
    return np.asarray(np.log1p(overlap @ p / p) @ p)


def _chi_squares(test: NextTest, models: Sequence[Model], place: Place, frequency: Array, amplitude: Array) -> Array:
    """Chi-square between the responses of each pair of models to a candidate test, (models, models).

    Args:
        test: candidate test.
        models: one fitted model for each explanation.
        place: direction or specimen.
        frequency: [Hz], (n,).
        amplitude: zero-to-peak [m or rad, or strain], (n,).

    Returns:
        Sums of squared differences in units of the test's noise. The empty fixture is compared by its stiffness and the
        steel dummy by its compliance, because either is nearly zero and its logarithm has no meaning.
    """
    if test.mounted is None:
        responses = np.array([model.stiffness(place, frequency, amplitude) for model in models])
    else:
        reference = np.abs(models[0].stiffness(place, frequency, amplitude)).mean()
        measured = []
        for model in models:  # with a spring in place of the bushing
            rig = [effect.name for effect in model.records if effect.level is Level.INSTRUMENT]
            modulus = min(test.mounted * reference / model.stiffness_per_modulus(place), _LARGEST_MODULUS)
            fixture = Model.with_defaults(model.bushing, ("elastic", *rig), {**model.values, "mu": modulus})
            measured.append(fixture.stiffness(place, frequency, amplitude) / reference)
        responses = np.array(measured)
    if test.mounted in (None, _SPRING):
        responses = np.log(responses + np.finfo(float).tiny)  # finite even where a model has no stiffness
    elif test.mounted == _DUMMY:
        responses = 1.0 / responses
    return np.sum(np.square(np.abs(responses[:, None] - responses)), axis=-1) / _NOISE**2


def _operating_points(test: NextTest, data_sets: Sequence[MeasuredTest]) -> tuple[Array, Array, Place]:
    """Operating points of a candidate test, as all combinations of its frequencies and amplitudes.

    Args:
        test: the candidate test.
        data_sets: the tests so far, which set the ranges.

    Returns:
        Frequency [Hz], (n,); amplitude, zero-to-peak [m or rad, or strain], (n,); and direction or specimen.
    """
    place = test.place or data_sets[-1].direction
    same_place = [data_set for data_set in data_sets if data_set.direction == place] or list(data_sets)
    amplitudes = np.unique(np.concatenate([data_set.amplitude for data_set in same_place]))
    if place.is_rotation and not same_place[0].direction.is_rotation:
        amplitudes = np.array([_ROTATION])
    if test.amplitudes:
        amplitudes = np.array([amplitudes.min() * -x if x < 0 else amplitudes.max() * x for x in test.amplitudes])
    measured = np.unique(np.concatenate([data_set.frequency for data_set in data_sets]))
    frequencies = np.array(test.frequencies) if test.frequencies else measured
    grid = np.meshgrid(frequencies * (measured.max() if test.beyond else 1.0), amplitudes)
    return grid[0].ravel(), grid[1].ravel(), place
