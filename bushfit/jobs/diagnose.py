"""diagnose: the discrepancy workflow on one campaign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.workflow import diagnose
from bushfit.errors import FitError
from bushfit.model.file import to_document
from bushfit.model.model import Model
from bushfit.report.artifacts import diagnosis_contents
from bushfit.report.contents import Contents, Kinds

if TYPE_CHECKING:
    from bushfit.campaign.campaign import Campaign
    from bushfit.fitting.data import Data
    from bushfit.model.result import Result


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosed:
    """The outcome of a diagnosis of a campaign of that name."""

    name: str
    diagnosis: Diagnosis

    def __repr__(self) -> str:
        return f"{self.name}: {self.diagnosis.verdict}\n  {self.diagnosis.summary}"

    @property
    def result(self) -> Result:
        return self.diagnosis.result

    @cached_property
    def document(self) -> Mapping[str, Any]:
        return self.diagnosis.to_document()

    @property
    def contents(self) -> Contents:
        documents = {"diagnosis": self.document, "model": to_document(self.result)}
        return Contents(documents) | diagnosis_contents(self.diagnosis, self.name)


@dataclass(frozen=True)
class Diagnose:
    """Where model and tests disagree, and what is missing; starts from the effects of `model` where one is given."""

    settings: Settings = field(default_factory=Settings)
    model: Model | None = None

    def kinds(self, campaign: Campaign) -> Kinds:
        return Kinds(("diagnosis", "model"), ("gap", "candidates"), ("gap",))

    def run(self, data: Data) -> Diagnosed:
        model = self.model or Model.started(data.campaign.bushing, data.effects, {})
        parameters = tuple(model.parameters)
        if not (self.settings.adopt or data.free(parameters)):
            raise FitError(
                "there is nothing to fit, and so nothing to diagnose",
                file=data.campaign.path,
                place="[fit]",
                found="every parameter is held with vary = false",
                hint="bushfit fit says how well the values given meet the tests; free one to diagnose",
            )
        return Diagnosed(data.campaign.name, diagnose(data, self.model, self.settings))
