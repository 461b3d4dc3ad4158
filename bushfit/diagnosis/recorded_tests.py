"""Tests as recorded or with one corrected mistake, and explanations of a gap that do not depend on effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.claims import Claim
from bushfit.diagnosis.explanations import Explanation, Group
from bushfit.diagnosis.faulty_parts import FaultyPart, find_faulty_parts
from bushfit.diagnosis.projected_columns import CompoundDeviation, GroupSet
from bushfit.diagnosis.record import DiagnosisSettings
from bushfit.diagnosis.rig_errors import RigErrors, in_scatter_units, rig_errors
from bushfit.diagnosis.smooth_deviations import compound, unnamed_curves
from bushfit.fitting.problem import FitResult


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

        Errors that points share are not part of this unit; `errors` describes them.
        """
        return in_scatter_units(self.base)

    @cached_property
    def errors(self) -> RigErrors:
        """Rig errors that points share, as changes of the residuals in units of the scatter from point to point."""
        return rig_errors(self.bare, self.rig)

    @cached_property
    def compound(self) -> CompoundDeviation | None:
        """Changes of the residuals, in units of the scatter, if the rubber deviates smoothly from the model's laws.

        Hypotheses are compared with these changes. None without tests.
        """
        group = compound(self.bare)
        return CompoundDeviation(group, self.errors) if group else None

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

    @cached_property
    def explanations(self) -> list[Explanation]:
        """Explanations of the gap that are independent of the model's effects: faulty test parts, and smooth curves."""
        return [*find_faulty_parts(self.bare), *unnamed_curves(self.bare)]

    @cached_property
    def explanation_sets(self) -> list[GroupSet]:
        """Columns of `explanations`."""
        return GroupSet.split([e.group for e in self.explanations if e.group], self.errors)

    @cached_property
    def curves(self) -> GroupSet | None:
        """Columns of the smooth curves among `explanations`; None without tests."""
        curves = [e.group for e in self.explanations if e.group and e.kind == "unnamed"]
        return GroupSet(curves, self.errors) if curves else None
