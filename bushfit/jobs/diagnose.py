"""diagnose: the discrepancy workflow on one campaign; run: every fit, what the model lacks, and the prediction."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Required

from typing_extensions import Doc, TypedDict

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.document import DiagnosisFile
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.workflow import diagnose
from bushfit.errors import FitError, quote_path
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import NEXT, TwoStep, fit_two_step
from bushfit.jobs.fits import (
    Fit,
    FitStatic,
    Fitted,
    campaign_document,
    contents_of_tests,
    document_of,
    kinds_of_test,
    options_typed,
)
from bushfit.jobs.predict import Predict, Predicted
from bushfit.model.document import ModelFile
from bushfit.model.model import FIVE, Model
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
        if not (self.settings.adopt or data.free(tuple(model.parameters))):
            raise FitError(
                "there is nothing to fit, and so nothing to diagnose",
                file=data.campaign.path,
                place="[fit]",
                found="every parameter is held with vary = false",
                hint="bushfit fit says how well the values given meet the tests; free one to diagnose",
            )
        found, path = diagnose(data, self.model, self.settings), data.campaign.path
        if found.verdict == "ambiguous" and (sets := look_alikes(found)) and path.suffix == ".toml":
            there = Path(path.name) if path.is_absolute() else path  # results keep no path of a machine
            command = f"bushfit plan {quote_path(there)} --rivals {','.join(sets[0])}"
            found = replace(found, next_test=f"{found.next_test}; {command} chooses tests that tell them apart")
        if not (found.changed or self.model or self.settings.adopt):  # then the model to use is that of `fit`
            joint = (self.joint or Fit().run(data)).result
            asked = replace(joint, warnings=tuple(words.removesuffix(NEXT) for words in joint.warnings))
            found = replace(found, result=found.odds.averaged(asked))
        mine, usual = self.settings, Settings()
        sizes = ((key, getattr(mine, key), getattr(usual, key)) for key in ("max_effects", "tolerance"))
        changed = {key: f"{size:g}" for key, size, default in sizes if size != default}
        start = "MODEL.json" if self.model else None
        options = options_typed(model=start, adopt=mine.adopt, without=mine.without, **changed)
        return Diagnosed(campaign_document(data, "diagnose", options), found)


class RunDocument(TypedDict, total=False):
    """What the whole chain found."""

    static: Annotated[ModelFile, Doc("the fit of the loops; where there are loops.")]
    dynamic: Annotated[ModelFile, Doc("the paper's two steps; where there are loops and sweeps.")]
    joint: Annotated[ModelFile, Doc("the joint fit; where the model to use is another.")]
    model: Required[
        Annotated[ModelFile, Doc("the model to use: the joint fit, or the model with what diagnose added.")]
    ]
    diagnosis: Annotated[DiagnosisFile, Doc("where model and tests disagree; where a parameter is free.")]
    warnings: Annotated[list[str], Doc("what a user must know of the model to use and of what it predicts.")]


@dataclass(frozen=True, eq=False, repr=False)
class Ran:
    """The outcome of the whole chain.

    There is no static fit, the first step of the paper's procedure, without loops, no `two_step` where the procedure
    was passed over (`no_two_step` says why), and nothing diagnosed where no parameter is free.
    """

    data: Data
    static: Fitted | None
    two_step: TwoStep | None
    no_two_step: str
    joint: Fitted
    diagnosed: Diagnosed | None
    predicted: Predicted

    def __repr__(self) -> str:
        return "\n".join(repr(found) for found in (self.diagnosed, self.result) if found)

    @property
    def result(self) -> Result:
        """The model to use: the joint fit, or the model with what diagnose added."""
        return self.predicted.result

    @property
    def added(self) -> bool:
        """Whether the model to use holds more than the joint fit."""
        return bool(self.diagnosed and self.diagnosed.diagnosis.added)

    @property
    def document(self) -> Mapping[str, Any]:
        return {**self._files, "warnings": self.predicted.warnings}

    @cached_property
    def _files(self) -> Mapping[str, Any]:
        """The documents that are files of their own."""
        results = {"static": self.static and self.static.result, "dynamic": self.two_step and self.two_step.result}
        results |= {"joint": self.joint.result if self.added else None, "model": self.result}
        campaign = campaign_document(self.data, "run")
        beside = {**campaign, "logo": None}  # one of the files is enough
        found = {name: result for name, result in results.items() if result}
        documents = {
            name: document_of(result, campaign if name == "model" else beside) for name, result in found.items()
        }
        return {**documents, "diagnosis": self.diagnosed.document} if self.diagnosed else documents

    @property
    def contents(self) -> Contents:
        campaign, found = self.data.campaign, self.diagnosed
        of_tests = contents_of_tests(self.data, self.result, kinds_of_test(campaign, campaign.fit.effects))
        of_gap = diagnosis_contents(found.diagnosis, campaign.name) if found else Contents()
        return (Contents(self._files) | of_tests | of_gap | self.predicted.contents).paged(report=report_page)


@dataclass(frozen=True)
class Run:
    """The whole chain: the paper's two steps, all parameters together, what is missing, and the prediction."""

    def kinds(self, campaign: Campaign) -> Kinds:
        steps = (("static",) if campaign.loops else ()) + (("dynamic",) if campaign.loops and campaign.sweeps else ())
        found = Kinds((*steps, "joint")) + Diagnose().kinds(campaign)
        return found + Kinds.shown(kinds_of_test(campaign, campaign.fit.effects)) + Predict().kinds(None, campaign)

    def run(self, data: Data) -> Ran:
        static = FitStatic().run(data) if data.loops else None
        two_step, why_not = _two_step(data)
        joint = Fit().run(data)
        diagnosed = Diagnose(joint=joint).run(data) if joint.result.fitted else None
        found = (diagnosed or joint).result
        notes = diagnosed.diagnosis.notes if diagnosed else ()
        return Ran(data, static, two_step, why_not, joint, diagnosed, Predict().run(found, data.campaign, notes))


def _two_step(data: Data) -> tuple[TwoStep | None, str]:
    """The paper's procedure, or why it is passed over."""
    if not (data.loops and data.sweeps):
        return None, f"no {'sweeps' if data.loops else 'loops'}"
    if not data.free(FIVE):
        return None, "every parameter is held"
    try:
        return fit_two_step(data), ""
    except FitError as error:
        return None, error.problem
