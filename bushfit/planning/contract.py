"""Input of a plan: the knowledge before it, and its aim.

A test is one run of the rig: a stepped sine at one amplitude or one frequency (`SimulatedSweep`), or a hysteresis loop
(`SimulatedLoop`). A repeated test is listed again. Standard errors of parameters are those of relative changes (ln of
the value). A place is a direction of the bushing or a specimen of its compound.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep
from bushfit.effects.contract import Array
from bushfit.fitting.rig_class import ASSUMED
from bushfit.geometry import Place
from bushfit.model.model import Model
from bushfit.model.result import Result

#: What a plan is for.
Aim = Literal["parameters", "predictions", "rivals", "targets"]
#: One run of the rig.
Test = SimulatedLoop | SimulatedSweep


def operating_points(test: Test) -> tuple[Array, Array]:
    """Frequency [Hz] and zero-to-peak amplitude [m, rad or strain] at each of the n points of a test, (n,) each."""
    if isinstance(test, SimulatedLoop):
        frequency, amplitude = np.array(test.parts).T
        return frequency, amplitude
    frequency, amplitude = test.points
    return frequency.ravel(), amplitude.ravel()


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the rig's measurement errors.

    Gain and phase errors [1 and rad] are the real and imaginary part of the error of ln K.

    Args:
        random: independent error of each point of a sweep, (gain, phase).
        shared: error that all points of one run have in common, (gain, phase).
        level: error that all repeats of a test have in common, (gain, phase): the accuracy class of the rig, as stated
            in [rig]. For a loop, only the gain is used.
        force: error of one recorded row of a loop over half the force range, at 1000 rows per cycle as in `simulate`.
            The default is a choice: the error of most force sensors.
        rows_as_one: number of correlated rows of a loop with the information of one independent row. The default is a
            choice: an amplifier that passes sixteen harmonics of the cycle.
    """

    random: tuple[float, float] = (ASSUMED[0], ASSUMED[0])
    shared: tuple[float, float] = ASSUMED
    level: tuple[float, float] = ASSUMED
    force: float = 5e-3
    rows_as_one: float = 20.0


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Model, covariance of its parameters and noise of the rig, as known before the planned tests.

    Args:
        result: model with its likeliest parameter values, with the range of the tests so far and the warnings of their
            fit, if there are tests; and specimens of the compound that can be tested in place of the bushing.
        names: names of the k parameters that the tests shall determine.
        covariance: covariance of the relative changes of the k parameters and of the b bounded ones, (k + b, k + b).
        source: origin of the knowledge, as a phrase.
        noise: measurement errors of the rig.
        rivals: knowledge with each rival model, this model first; empty without rivals. Rival models explain the tests
            so far equally well, each by another effect.
        probability: probability of this model among its rivals.
        tests: runs of the campaign so far.
        bounded: names of the b parameters that are at a bound in the fit; their changes are in units of typical values.
    """

    result: Result
    names: tuple[str, ...]
    covariance: Array
    source: str
    noise: Noise = field(default_factory=Noise)
    rivals: tuple[Knowledge, ...] = ()
    probability: float = 1.0
    tests: tuple[Test, ...] = ()
    bounded: tuple[str, ...] = ()

    @property
    def model(self) -> Model:
        """Model with its likeliest parameter values."""
        return self.result.model

    @property
    def strain(self) -> float | None:
        """Largest equivalent strain amplitude measured so far [1]; None if there are no tests."""
        return self.result.measured.strain[1] if self.result.measured else None

    @property
    def precision(self) -> Array:
        """Fisher information before the planned tests: inverse of `covariance`, plus that of a weak prior.

        Returns:
            Matrix for the k known parameters and the b parameters at a bound (`bounded`), (k + b, k + b).

        Notes: one standard deviation of the prior is a factor of 20. Parameters that the tests do not determine have
        errors of a thousand times their value, and rounding errors would swamp all other parameters.
        """
        size = np.sqrt(np.diag(self.covariance))
        values, vectors = np.linalg.eigh(self.covariance / np.outer(size, size))
        scaled = vectors / size[:, None]
        return (scaled / np.maximum(values, 1e-14)) @ scaled.T + np.eye(size.size) / 3.0**2  # e^3 is 20


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """Aim of a plan, with the hours and limits of the rig.

    Args:
        aim: quantity whose errors the plan minimises, or "rivals" to separate rival models.
        hours: largest duration on the rig [h].
        rig: limits of the rig, and its time for a point and for a set-up.
        places: directions or specimens that the rig can test.
        grids: frequencies [Hz] and zero-to-peak amplitudes [m, rad or strain] at which the plan reports the errors of
            the stiffness, whatever the aim, by direction or specimen.
        parameters: names of the parameters whose errors aim "parameters" minimises.
        targets: largest half width of the 95 % interval, relative to the value, by name of a parameter ("mu") or of a
            prediction ("stiffness.axial"). Aim "targets" plans no further test once the targets are met.
    """

    aim: Aim
    hours: float
    rig: RigSettings
    places: tuple[Place, ...]
    grids: Mapping[Place, tuple[Array, Array]]
    parameters: tuple[str, ...] = ()
    targets: Mapping[str, float] = field(default_factory=dict)
