"""Tests as recorded or with one corrected mistake, and explanations of a gap that do not depend on effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.claims import Claim
from bushfit.diagnosis.explanations import Explanation, Group
from bushfit.diagnosis.faulty_parts import FaultyPart, find_faulty_parts
from bushfit.diagnosis.projected_columns import CompoundDeviation, GroupSet
from bushfit.diagnosis.record import DiagnosisSettings
from bushfit.diagnosis.rig_errors import RigErrors, in_scatter_units, rig_errors
from bushfit.diagnosis.smooth_deviations import compound, unnamed_curves
from bushfit.effects.contract import Array
from bushfit.fitting.problem import FitResult


@dataclass(frozen=True, eq=False)
class ExplanationColumns:
    """Explanations of a gap that do not depend on effects, and what is part of every hypothesis.

    Changes of the residuals are in units of the scatter from point to point.

    Args:
        explanations: faulty parts of the tests, and smooth curves.
        deviation: changes of the residuals if the rubber deviates smoothly from the model's laws; None without tests.
        errors: errors of the rig.
    """

    explanations: Sequence[Explanation]
    deviation: Group | None
    errors: RigErrors

    @cached_property
    def compound(self) -> CompoundDeviation | None:
        """Deviation of the compound beside the errors of the rig; None without tests."""
        return CompoundDeviation(self.deviation, self.errors) if self.deviation else None

    @cached_property
    def sets(self) -> list[GroupSet]:
        """Columns of `explanations`."""
        return GroupSet.split([e.group for e in self.explanations if e.group], self.errors)

    @cached_property
    def curves(self) -> GroupSet | None:
        """Columns of the smooth curves among `explanations`; None without tests."""
        curves = [e.group for e in self.explanations if e.group and e.kind == "unnamed"]
        return GroupSet(curves, self.errors) if curves else None

    def with_variance(self, variance: Array) -> ExplanationColumns:
        """Add independent errors of the residuals, of the given variances, (n,)."""
        return replace(self, errors=replace(self.errors, variance=variance))


@dataclass(frozen=True, eq=False)
class RecordedTests:
    """Tests as recorded, or with one mistake in the record corrected, with the starting model fitted to them.

    Args:
        base: fit of the starting model; its residuals are whitened by scatter and by errors that points share.
        rig: stated accuracy class of the rig (gain and phase errors).
        without: names of effects not to consider.
        log_prior: natural log of the prior probability that this record is right and nothing is missing.
        claim: mistake that is corrected; None for the tests as recorded.
        change: relative change of the recorded quantities due to the correction; 0 for the tests as recorded.
        max_effects: maximum number of effects of an explanation.
    """

    base: FitResult
    rig: RigSettings
    without: Sequence[str]
    log_prior: float
    claim: Claim | None = None
    change: float = 0.0
    max_effects: int = DiagnosisSettings.max_effects

    @cached_property
    def bare(self) -> FitResult:
        """Fit of the starting model with residuals in units of the scatter from point to point, to compare hypotheses.

        Errors that points share are not part of this unit; `columns.errors` describes them.
        """
        return in_scatter_units(self.base)

    @cached_property
    def columns(self) -> ExplanationColumns:
        """Explanations that do not depend on effects, beside the compound's deviation and the errors of the rig."""
        explanations, group = [*find_faulty_parts(self.bare), *unnamed_curves(self.bare)], compound(self.bare)
        return ExplanationColumns(explanations, group, rig_errors(self.bare, self.rig))

    @cached_property
    def compound_in_fits(self) -> Group | None:
        """Changes of the residuals, whitened as in a fit, if the rubber deviates smoothly from the model's laws.

        A refit with an effect also estimates the amounts of these changes, without a prior; None without tests.
        """
        return compound(self.base)

    @cached_property
    def faulty_parts_in_fits(self) -> dict[str, FaultyPart]:
        """Faulty parts by name; their changes of the residuals are whitened as in a fit, not in units of scatter."""
        return {part.name: part for part in find_faulty_parts(self.base)}
