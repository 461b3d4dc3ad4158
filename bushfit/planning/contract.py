"""Records of a plan: the knowledge before it, its aim, and the expected results of tests.

A test is one run of the rig: a stepped sine that holds one amplitude or one frequency (`SimulatedSweep`), or a loop
(`SimulatedLoop`). A repeated test is listed again: the points of each run share their own errors. Standard errors
are of relative changes of parameters, as `fitting.information` counts them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bushfit.campaign.schema import RigSettings, SimulatedLoop, SimulatedSweep
from bushfit.effects.contract import Array
from bushfit.fitting.rig_class import ASSUMED
from bushfit.geometry import Place, Specimen
from bushfit.model.model import Model
from bushfit.model.result import Result

#: What a plan is for.
Aim = Literal["parameters", "predictions", "rivals", "targets"]
#: One run of the rig: a sweep has one amplitude and several frequencies, or one frequency and several amplitudes.
Test = SimulatedLoop | SimulatedSweep


def operating_points(test: Test) -> tuple[Array, Array]:
    """Frequency [Hz] and amplitude, zero-to-peak [m or rad, or strain], of each point of a run, (n,) each."""
    if isinstance(test, SimulatedLoop):
        frequency, amplitude = np.array(test.parts).T
        return frequency, amplitude
    frequency, amplitude = test.points
    return frequency.ravel(), amplitude.ravel()


def motions(test: Test) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Amplitudes [m or rad, or strain] and frequencies [Hz] of a test."""
    if isinstance(test, SimulatedLoop):
        return (test.amplitude,), (test.frequency,)
    return test.amplitudes, test.frequencies


@dataclass(frozen=True)
class Noise:
    """How well the rig measures, standard deviations; gain and phase [rad] are those of ln K.

    Args:
        scatter: of a sweep's point, (gain, phase).
        shared: of all points of one run, (gain, phase).
        level: of all runs of one test, and the gain of a loop's record, (gain, phase): the class of the rig. In a fit
            [rig] states it, so that loops and repeated sweeps count it as noise.
        force: of a row of a loop, over half the force range; there are 1000 rows a cycle, as `simulate` has them.
            Chosen: that of most force sensors.
        rows_as_one: so many rows of a loop tell as much as an independent one. Chosen: an amplifier that passes sixteen
            harmonics of the cycle, as loops are smoothed; rows taken as independent promise more than most rigs keep.
    """

    scatter: tuple[float, float] = (ASSUMED[0], ASSUMED[0])
    shared: tuple[float, float] = ASSUMED
    level: tuple[float, float] = ASSUMED
    force: float = 5e-3
    rows_as_one: float = 20.0


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Knowledge before the tests.

    Args:
        model: the likeliest values.
        names: of its k parameters that the tests are to determine.
        covariance: of their relative changes and those of the bounded parameters, (k + b, k + b).
        noise: of the rig.
        source: origin of the knowledge, as a phrase.
        rivals: knowledge for each model that may be the right one, this model first; empty if there is no doubt.
        probability: of this model among its rivals.
        strain: largest equivalent strain amplitude measured so far; None where nothing was.
        specimens: bodies of the compound that can be tested in place of the bushing.
        tests: of the campaign so far.
        bounded: its b parameters at rest on a bound, off which noise takes a fit half of the times; in typical sizes.
        warnings: of the fit.
        result: the fit itself; None of a guess.
    """

    model: Model
    names: tuple[str, ...]
    covariance: Array
    source: str
    noise: Noise = field(default_factory=Noise)
    rivals: tuple[Knowledge, ...] = ()
    probability: float = 1.0
    strain: float | None = None
    specimens: tuple[Specimen, ...] = ()
    tests: tuple[Test, ...] = ()
    bounded: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    result: Result | None = None

    @property
    def errors(self) -> Array:
        """Standard error of each parameter's relative change, (k,)."""
        return np.sqrt(np.diag(self.covariance))[: len(self.names)]

    @property
    def precision(self) -> Array:
        """Information of the knowledge, with a prior of each parameter within a factor of 20, (k + b, k + b).

        Notes: what tests leave open has errors of a thousand times its size, which rounds all else away.
        """
        size = np.sqrt(np.diag(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(size, size))
        scaled = vectors / size[:, None]
        return (scaled / np.maximum(values, 1e-14)) @ scaled.T + np.eye(size.size) / 3.0**2  # e^3 is 20


@dataclass(frozen=True, eq=False)
class Points:
    """Operating points of one direction whose stiffness is wanted.

    Args:
        frequency: [Hz], (n,).
        amplitude: zero-to-peak [m or rad, or strain], (n,).
    """

    place: Place
    frequency: Array
    amplitude: Array


@dataclass(frozen=True)
class Target:
    """An interval that is to be reached.

    Args:
        quantity: a parameter by its name, or "stiffness" or "loss_factor".
        half: of its 95 % interval at most, over its value; of a predicted one at every point that is wanted.
        place: of a predicted one; None of a parameter.
    """

    quantity: str
    half: float
    place: Place | None = None

    def __str__(self) -> str:
        return self.quantity if self.place is None else f"{self.quantity}.{self.place}"


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """Aim of a plan, with the hours and limits of the rig.

    Args:
        aim: quantity whose errors the plan minimises, or "rivals" to separate models.
        hours: largest duration on the rig [h].
        rig: limits of the rig, and its time for a point and for a set-up.
        places: directions or specimens that the rig can test.
        points: points at which the stiffness is wanted; the plan reports its errors there whatever the aim.
        parameters: names whose errors count, of aim "parameters".
        targets: of aim "targets": no further test is planned once they are met.
    """

    aim: Aim
    hours: float
    rig: RigSettings
    places: tuple[Place, ...]
    points: tuple[Points, ...]
    parameters: tuple[str, ...] = ()
    targets: tuple[Target, ...] = ()


@dataclass(frozen=True)
class DetectableAmount:
    """Smallest amount of an effect that a programme detects in 90 % of the cases, by a test at the 5 % level.

    Args:
        effect: name of an effect that the model lacks.
        parameter: name of the parameter that the amount is of.
        unit: SI unit of the amount.
        amount: in that unit.
    """

    effect: str
    parameter: str
    unit: str
    amount: float


@dataclass(frozen=True, eq=False)
class Programme:
    """Tests in their order, with their expected results beside the knowledge before them.

    Args:
        tests: runs of the rig, in the order in which they are made.
        minutes: that each test takes, with the change of direction before it, (tests,).
        errors: standard error of each parameter's relative change, (k,).
        alone: the errors by these tests alone, (k,).
        stiffness: standard error of |K| at the points wanted, relative, all points of all directions, (n,).
        loss: the same of the loss factor, in loss factor, (n,).
        rival_chi_square: expected chi-square between the two nearest rivals that can be separated, after the best
            refit of either; None without rivals.
        halves: half of the 95 % interval of each target over its value, the widest of all points.
        detectable: smallest detectable amount of each effect that the standard programme can show.
        drift: largest shift of a parameter, over its standard error, by a drift of the gain of 1 % over the session.
    """

    tests: tuple[Test, ...]
    minutes: Array
    errors: Array
    alone: Array
    stiffness: Array
    loss: Array
    rival_chi_square: float | None
    halves: tuple[float, ...]
    detectable: tuple[DetectableAmount, ...]
    drift: float

    @property
    def hours(self) -> float:
        """Duration of the tests [h]."""
        return float(np.sum(self.minutes)) / 60.0


@dataclass(frozen=True, eq=False)
class Plan:
    """Tests chosen for an aim, and the standard programme of as many hours beside them.

    Args:
        before: a programme without tests.
        planned: the tests chosen.
        standard: the paper's tests, as often as the same hours allow.
        knowledge: before the tests.
        request: aim of the plan.
        purposes: sentence on the loss without a test and all its repeats, by test.
        missed: reason why the planned tests miss each target; None where they meet it.
        enough: reason why hours stay free; None if they are used.
        notes: warnings and limits of the plan.
    """

    knowledge: Knowledge
    request: PlanRequest
    before: Programme
    planned: Programme
    standard: Programme
    purposes: Mapping[Test, str]
    missed: tuple[str | None, ...] = ()
    enough: str | None = None
    notes: tuple[str, ...] = ()
