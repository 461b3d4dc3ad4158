"""diagnose: the discrepancy workflow on one campaign."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.workflow import diagnose
from bushfit.errors import FitError, typed
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import NEXT
from bushfit.jobs.fits import Fit, Fitted
from bushfit.jobs.provenance import campaign_document, document_of, options_typed
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.planning.knowledge import look_alikes
from bushfit.report.artifacts import diagnosis_contents
from bushfit.report.contents import Contents, Kinds
from bushfit.report.page import report_page


@dataclass(frozen=True, eq=False, repr=False)
class Diagnosed:
    """The outcome of a diagnosis; `campaign` is what its documents say of the campaign."""

    campaign: Mapping[str, Any]
    diagnosis: Diagnosis

    def __repr__(self) -> str:
        return f"{self.campaign['name']}: {self.headline}\n  {self.diagnosis.summary}"

    @property
    def headline(self) -> str:
        """The verdict, and which parameters are unknown by 100 %."""
        return "; ".join(filter(None, (self.diagnosis.verdict, self.result.left_open)))

    @property
    def result(self) -> Result:
        return self.diagnosis.result

    @cached_property
    def document(self) -> Mapping[str, Any]:
        return self.diagnosis.to_document()

    @property
    def contents(self) -> Contents:
        found = Contents({"diagnosis": self.document, "model": document_of(self.result, self.campaign)})
        return (found | diagnosis_contents(self.diagnosis, self.campaign["name"])).paged(report=report_page)


@dataclass(frozen=True)
class Diagnose:
    """Where model and tests disagree, and what is missing, from the effects of `model`, with the plain fit `joint`."""

    settings: Settings = field(default_factory=Settings)
    model: Model | None = None
    joint: Fitted | None = None

    def kinds(self, campaign: Campaign) -> Kinds:
        return Kinds(("diagnosis", "model"), ("gap", "candidates"), ("gap",), ("report",))

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
        found = with_plan(diagnose(data, self.model, self.settings), data.campaign.path)
        if not (found.changed or self.model or self.settings.adopt):  # then the model to use is that of `fit`
            joint = (self.joint or Fit().run(data)).result
            asked = replace(joint, warnings=tuple(words.removesuffix(NEXT) for words in joint.warnings))
            found = replace(found, result=found.odds.averaged(asked))
        return Diagnosed(campaign_document(data, "diagnose", self._options()), found)

    def _options(self) -> tuple[str, ...]:
        """What was asked for, as it is typed."""
        mine, usual = self.settings, Settings()
        model, sizes = "MODEL.json" if self.model else None, ("max_effects", "tolerance")
        changed = {key: f"{getattr(mine, key):g}" for key in sizes if getattr(mine, key) != getattr(usual, key)}
        return options_typed(model=model, adopt=mine.adopt, without=mine.without, **changed)


def with_plan(found: Diagnosis, path: Path) -> Diagnosis:
    """The diagnosis with the command that plans tests to tell look-alikes apart, where there are some."""
    sets = look_alikes(found)
    if found.verdict != "ambiguous" or not sets or path.suffix != ".toml":
        return found
    there = Path(path.name) if path.is_absolute() else path  # results keep no path of a machine
    command = f"bushfit plan {typed(there)} --rivals {','.join(sets[0])}"
    return replace(found, next_test=f"{found.next_test}; {command} chooses tests that tell them apart")
