"""Fits as most tests need them: of a campaign, and of a least-squares problem."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bushfit.campaign.campaign import Campaign
from bushfit.effects.contract import Array
from bushfit.fitting.descent import EVALUATIONS, TOLERANCE, Descent
from bushfit.fitting.preparation import MeasuredTest
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.problem import FitProblem, FitResult
from bushfit.fitting.procedures import fit_joint
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.stiffness import Prediction


def joint_fit(campaign: Campaign, **options: Any) -> Result:
    """The five parameters, or those of the campaign's effects, fitted to its tests at once."""
    return fit_joint(PreparedCampaign.from_campaign(campaign), **options)


def held_by_bands(found: Prediction, true: Array) -> list[Array]:
    """Whether the bands of stiffness, loss factor, storage and loss hold a true complex stiffness, at each point."""
    pairs = (
        (found.stiffness, np.abs(true)),
        (found.loss_factor, true.imag / true.real),
        (found.storage_stiffness, true.real),
        (found.loss_stiffness, true.imag),
    )
    return [(band.low <= exact) & (exact <= band.high) for band, exact in pairs]


def solve(problem: FitProblem, *, evaluations: int = EVALUATIONS, tolerance: float = TOLERANCE) -> FitResult:
    """A least-squares problem fitted to its end."""
    return Descent.start(problem, tolerance).run(evaluations).solution


def residual(model: Model, tests: Sequence[MeasuredTest]) -> Array:
    """Whitened residuals of all tests in order, and of the priors of the model."""
    return FitProblem(model, tests, ()).residual(model)


def jacobian(model: Model, tests: Sequence[MeasuredTest], names: Sequence[str]) -> Array:
    """Their derivatives by the coordinates of the named parameters."""
    return FitProblem(model, tests, names).linearise(model)[1]
