"""Tables of a campaign file with all their keys; pydantic checks them and converts quantities to SI."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import ConfigDict, Field

from bushfit.campaign.bodies import BushingSettings, SeveralBushings, SpecimenSettings, specimens_of
from bushfit.campaign.quantities import Compound, EffectsSettings, ReportSettings, convert_setting
from bushfit.campaign.simulated import SimulateSettings
from bushfit.effects import is_parameter, library_parameters
from bushfit.reading.stated import LoopFile, SweepFile, ValidationFile, with_places
from bushfit.validation import (
    Angle,
    Flag,
    Frequencies,
    Frequency,
    Length,
    Name,
    ParameterValue,
    Several,
    Share,
    Strain,
    Text,
    converter,
    inline_keys,
    known_keys,
    si,
    table,
    tables,
    unknown_key,
)

#: Residuals of a sweep: differences of real and imaginary part, or of |K| and loss factor.
Residuals = Literal["complex", "magnitude_loss_factor"]
#: Loss function of the residuals: squares, or soft_l1 with outliers left out.
Loss = Literal["linear", "soft_l1"]


def _fit_table(raw: dict[str, Any]) -> dict[str, Any]:
    """Move the parameter tables of [fit], such as [fit.mu] or [fit."inertia.mass"], below the key "parameters"."""
    if "parameters" in raw:
        raise unknown_key("parameters", known_keys(FitSettings))
    settings = {key: value for key, value in raw.items() if not is_parameter(key)}
    return {**settings, "parameters": {key: value for key, value in raw.items() if key not in settings}}


#: Validator that replaces the name of a direction or specimen in each test of [simulate] by the object.
_SIMULATED_PLACES = converter(
    lambda raw, info: with_places(raw, specimens_of(info.data.get("bushings", ()), info.data.get("specimens", ())))
)


@dataclass(frozen=True)
class ParameterSetting:
    """[fit.<parameter>]: start value and bounds [SI]; None for the default.

    Args:
        value: start value of the fit, or fixed value.
        min, max: smallest and largest value.
        vary: false keeps the parameter fixed.
        equal: name of a parameter that this one is equal to.
        expression: expression of other parameters in SI units that gives the value, such as "0.5 * mu".
        prior: earlier knowledge, as value and standard deviation such as "0.24 +- 0.03", or the model file of an
            earlier fit to other tests.
    """

    value: ParameterValue | None = None
    min: ParameterValue | None = None
    max: ParameterValue | None = None
    vary: Flag = True
    equal: Text | None = None
    expression: Text | None = None
    prior: Text | None = None

    @property
    def tie(self) -> str | None:
        """Expression of other parameters that gives the value of this one; None if it is not tied."""
        return self.equal or self.expression


@dataclass(frozen=True)
class RigSettings:
    """[rig]: accuracy class and limits of the test machine; None if not stated.

    Args:
        gain_error, displacement_error: relative standard deviation of the calibration of force and of displacement,
            which all repeats of a test may share.
        phase_error: standard deviation of the phase [rad], which all repeats of a test may share.
        compliance_error: standard deviation of a compliance [m/N] in series with the bushing, which all tests share.
        max_force, max_moment: largest zero-to-peak force or moment [N, N m].
        max_displacement, max_rotation: largest zero-to-peak displacement or rotation [m, rad].
        max_frequency: largest frequency [Hz].
        max_velocity: largest zero-to-peak velocity [m/s].
        minutes_per_point: time for a point of a sweep, with settling, such as "0.5 min" [s].
        minutes_per_setup: time to mount the bushing in another direction, such as "30 min" [s].
    """

    gain_error: Share | None = None
    phase_error: Annotated[float, si("rad"), Field(ge=0)] | None = None
    displacement_error: Share | None = None
    compliance_error: Annotated[float, si("m/N"), Field(ge=0)] | None = None
    max_force: Annotated[float, si("N"), Field(gt=0)] | None = None
    max_moment: Annotated[float, si("N*m"), Field(gt=0)] | None = None
    max_displacement: Length | None = None
    max_rotation: Angle | None = None
    max_frequency: Frequency | None = None
    max_velocity: Annotated[float, si("m/s"), Field(gt=0)] | None = None
    minutes_per_point: Annotated[float, si("s"), Field(gt=0)] | None = None
    minutes_per_setup: Annotated[float, si("s"), Field(ge=0)] | None = None

    @property
    def stiffness_errors(self) -> tuple[float | None, float | None]:
        """Standard deviations of the stiffness in gain [1] and phase [rad]; None if the campaign does not state them.

        The gain error of K = F/x combines the calibrations of force and displacement.
        """
        gains = [error for error in (self.gain_error, self.displacement_error) if error is not None]
        return float(np.linalg.norm(gains)) if gains else None, self.phase_error


#: Settings of a rig if the campaign states nothing.
UNSTATED = RigSettings()


@dataclass(frozen=True)
class FitSettings:
    """Table [fit] of a campaign: settings of the fit.

    Args:
        dynamic_amplitudes: amplitudes [m or rad] that fit-dynamic uses; empty for the smallest.
        residuals: residuals of real and imaginary part, or of |K| and loss factor.
        loss: "linear" for least squares; "soft_l1" reduces the weight of distant points and leaves outliers out.
        effects: effects added to the paper's model, such as "stiffness_factor.mount".
        prior: model file of an earlier fit to other tests, whose values and covariance are a prior of all parameters
            that both fits have.
    """

    dynamic_amplitudes: Annotated[tuple[Annotated[float, si("m", "rad"), Field(gt=0)], ...], Field(fail_fast=True)] = ()
    residuals: Residuals = "complex"
    loss: Loss = "linear"
    effects: tuple[Text, ...] = ()
    prior: Text | None = None
    parameters: Annotated[Mapping[str, ParameterSetting], tables(convert_setting)] = field(
        default_factory=dict, metadata=inline_keys(library_parameters)
    )


@dataclass(frozen=True)
class PredictSettings:
    """[predict]: grid and directions of the prediction; None for the default.

    Args:
        frequencies: frequencies [Hz].
        amplitudes, torsion_amplitudes, strain_amplitudes: zero-to-peak displacements [m], rotations [rad], strains [1].
        directions: directions of the bushing, or names of specimens.
    """

    frequencies: Frequencies | None = None
    amplitudes: Several[Length] | None = None
    torsion_amplitudes: Several[Angle] | None = None
    directions: Several[Name] | None = None
    strain_amplitudes: Several[Strain] | None = None


@dataclass(frozen=True)
class CampaignFile:
    """A whole campaign file: a bushing, or specimens of a compound, and their tests. Quantities are texts with a unit.

    Args:
        bushing: geometry of the bushing.
        name: name of the campaign and its results folder; default the name of the bushing.
        bushings: several bushings of one compound, in place of `bushing`.
        specimens: other bodies of the same compound.
        loops: hysteresis loops.
        sweeps: stepped sines.
        validation: records of displacement and force under any motion, which are compared with the model and never
            fitted.
        simulate: tests and errors of the virtual rig, used only by bushfit simulate.
        rig: accuracy and limits of the test machine.
        compound: rubber of a bushing that was not tested yet.
        fit: settings of the fit.
        predict: grid and directions of the prediction.
        report: texts and logo in the head of the report.
        effects: an effect of the user's own.
    """

    __pydantic_config__ = ConfigDict(extra="forbid")

    bushing: BushingSettings | None = None
    name: Name | None = None
    bushings: tuple[SeveralBushings, ...] = ()
    specimens: tuple[SpecimenSettings, ...] = ()
    loops: tuple[LoopFile, ...] = ()
    sweeps: tuple[SweepFile, ...] = ()
    validation: tuple[ValidationFile, ...] = ()
    rig: RigSettings = field(default_factory=RigSettings)
    compound: Compound | None = None
    fit: Annotated[FitSettings, table(_fit_table)] = field(default_factory=FitSettings)
    predict: PredictSettings = field(default_factory=PredictSettings)
    simulate: Annotated[SimulateSettings | None, _SIMULATED_PLACES] = None
    report: ReportSettings = field(default_factory=ReportSettings)
    effects: EffectsSettings | None = None
