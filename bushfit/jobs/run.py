"""run: every fit of one campaign, what the model lacks, and the prediction from the model to use."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Required

from typing_extensions import Doc, TypedDict

from bushfit.campaign.campaign import Campaign
from bushfit.diagnosis.document import DiagnosisFile
from bushfit.errors import FitError
from bushfit.fitting.data import Data
from bushfit.fitting.procedures import TwoStep, fit_two_step
from bushfit.jobs.diagnose import Diagnose, Diagnosed
from bushfit.jobs.fits import Fit, FitStatic, Fitted, contents_of_tests, kinds_of_test
from bushfit.jobs.predict import Predict, Predicted
from bushfit.jobs.provenance import campaign_document, document_of
from bushfit.model.document import ModelFile
from bushfit.model.model import FIVE
from bushfit.model.result import Result
from bushfit.report.artifacts import diagnosis_contents
from bushfit.report.contents import Contents, Kinds
from bushfit.report.page import report_page


class RunDocument(TypedDict, total=False):
    """What the whole chain found."""

    static: Annotated[ModelFile, Doc("the fit of the loops; where there are loops.")]
    dynamic: Annotated[ModelFile, Doc("the paper's two steps; where there are loops and sweeps.")]
    joint: Annotated[ModelFile, Doc("the joint fit; where the model to use is another.")]
    model: Required[
        Annotated[
            ModelFile,
            Doc("the model to use: the joint fit, or the model with what diagnose added."),
        ]
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
