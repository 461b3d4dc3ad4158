"""Tests as recorded or with one corrected mistake, and explanations of a gap that do not depend on effects."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.explanations import Explanation, Signature
from bushfit.diagnosis.faulty_parts import FaultyPart, find_faulty_parts
from bushfit.diagnosis.projected_columns import CompoundDeviation, SignatureSet
from bushfit.diagnosis.recording_mistakes import RecordingMistake
from bushfit.diagnosis.rig_errors import RigErrors, in_scatter_units, rig_errors
from bushfit.diagnosis.smooth_deviations import (
    POWER_LAW,
    compound_signature,
    power_laws,
    residual_changes,
    unnamed_curves,
)
from bushfit.effects.contract import Array
from bushfit.effects.mistakes import USUAL_MODULUS
from bushfit.fitting.problem import FitResult
from bushfit.geometry import stiffness_per_modulus

#: Attributes of a test that a record determines at each point.
_RECORDED = ("measured", "amplitude", "frequency")


@dataclass(frozen=True, eq=False)
class RecordedTests:
    """Tests as recorded or with one recording mistake corrected, with the starting model fitted to them.

    Args:
        base: fit of the starting model; its residuals are whitened by scatter and by errors that points share.
        unwhitened: this fit with residuals divided by the random noise alone, to compare hypotheses on errors that
            points share.
        rig: stated accuracy class of the rig (gain and phase errors).
        errors: errors of the rig that points share.
        deviation: changes of the residuals if the rubber deviates smoothly from the model's laws; None if the tests
            cannot show any.
        log_odds: natural log of the prior odds of the corrected mistake; 0 for the tests as recorded.
        mistake: mistake that is corrected; None for the tests as recorded.
        change: relative change of the recorded quantities due to the correction; 0 for the tests as recorded.
    """

    base: FitResult
    unwhitened: FitResult
    rig: RigSettings
    errors: RigErrors
    deviation: Signature | None
    log_odds: float = 0.0
    mistake: RecordingMistake | None = None
    change: float = 0.0

    @classmethod
    def of_fit(cls, base: FitResult, rig: RigSettings) -> RecordedTests:
        """Build the tests from a fit of the starting model.

        Args:
            base: fit of the starting model to the tests, as recorded or with a mistake corrected.
            rig: accuracy class of the rig: its stated gain and phase errors.
        """
        fit = in_scatter_units(base)
        return cls(base, fit, rig, rig_errors(fit, rig), compound_signature(fit))

    @cached_property
    def columns(self) -> ExplanationColumns:
        """Residual changes by faulty parts of the tests, smooth curves and a smooth deviation of the rubber."""
        return ExplanationColumns(self, self.errors)

    @cached_property
    def explanations(self) -> list[Explanation]:
        """Explanations of a gap other than effects: faulty parts of the tests, and smooth curves."""
        fit = self.unwhitened
        return [*find_faulty_parts(fit), *unnamed_curves(fit), *power_laws(fit)]

    @cached_property
    def compound_in_fits(self) -> Signature | None:
        """Changes of the whitened residuals of a fit by a smooth deviation of the rubber; None without tests.

        `deviation` has the same changes of residuals divided by random noise alone.
        """
        return compound_signature(self.base)

    @cached_property
    def faulty_parts_in_fits(self) -> dict[str, FaultyPart]:
        """Faulty parts of the tests by name, with changes of the whitened residuals of a fit."""
        return {part.name: part for part in find_faulty_parts(self.base)}

    def factor_column(self, fit: FitResult) -> Array:
        """Change of the residuals of a fit if the estimated factor of a mistake grows by 100 %, (1, n); else (0, n)."""
        if self.mistake is None or not self.mistake.kind.is_estimated:
            return np.empty((0, fit.residual.size))
        tests = [fit.data_sets[index] for index in self.mistake.tests]
        return residual_changes(fit, tests, np.ones((1, sum(test.frequency.size for test in tests))))


@dataclass(frozen=True, eq=False)
class ExplanationColumns:
    """Residual changes by faulty parts of the tests, by smooth curves and by the rubber's smooth deviation.

    Args:
        tests: tests whose gap is explained.
        errors: errors of the rig, perhaps with additional independent errors of some points.
    """

    tests: RecordedTests
    errors: RigErrors

    @cached_property
    def compound(self) -> CompoundDeviation | None:
        """Smooth deviation of the rubber from the model's laws, under the rig's errors; None if `tests` has none."""
        return CompoundDeviation(self.tests.deviation, self.errors) if self.tests.deviation else None

    @cached_property
    def sets(self) -> list[SignatureSet]:
        """Signatures (residual changes) of all `explanations` of the tests, in sets that change the same residuals."""
        return SignatureSet.split([e.signature for e in self.tests.explanations], self.errors)

    @cached_property
    def curves(self) -> list[SignatureSet]:
        """Signatures of smooth curves: stiffness changes of unknown cause, in sets that change the same residuals.

        Power laws are not included.
        """
        curves = [e for e in self.tests.explanations if e.kind == "unnamed" and e.family != POWER_LAW]
        return SignatureSet.split([curve.signature for curve in curves], self.errors)

    def with_variance(self, variance: Array) -> ExplanationColumns:
        """Return the columns with an additional independent error of each residual, of the given variances, (n,)."""
        return replace(self, errors=replace(self.errors, variance=variance))


def modulus_deviation(fit: FitResult) -> float:
    """Deviation of ln(median shear modulus of the tests) from that of bushing rubber, in standard deviations."""
    moduli = [
        np.median(np.abs(test.measured)) / stiffness_per_modulus(fit.model.bushing, test.direction)
        for test in fit.data_sets
    ]
    typical, spread = USUAL_MODULUS
    return float(np.log(np.median(moduli) / typical)) / spread


def record_change(base: FitResult, corrected: FitResult) -> float:
    """Largest relative change of a complex stiffness, amplitude or frequency by the correction of a recording mistake.

    The value is 1 if the dimensions of the bushing or the direction of a test are corrected.

    Args:
        base: fit to the tests as recorded.
        corrected: fit to the corrected tests.

    Returns:
        Largest of |after/before - 1| over all values.
    """
    pairs = list(zip(base.data_sets, corrected.data_sets, strict=True))
    if base.model.bushing != corrected.model.bushing or any(
        before.direction != after.direction for before, after in pairs
    ):
        return 1.0
    recorded = [(getattr(before, name), getattr(after, name)) for before, after in pairs for name in _RECORDED]
    return max(float(np.max(np.abs(after / before - 1.0))) for before, after in recorded)
