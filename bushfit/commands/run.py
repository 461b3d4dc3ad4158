"""run: every fit, the diagnosis, and the prediction of the model to use."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, Required

from pydantic import Field

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import Loss
from bushfit.caveat import WarningEntries, to_entries
from bushfit.commands.diagnose import DiagnosisOutput, diagnose
from bushfit.commands.fit import FitOutput, campaign_files, fit, fit_static, prepare_tests
from bushfit.commands.predict import predict
from bushfit.commands.predicted import PredictionOutput
from bushfit.commands.provenance import campaign_document, result_document
from bushfit.commands.respond import validation_files
from bushfit.diagnosis.document import DiagnosisFile
from bushfit.errors import FitError
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import TwoStep, fit_two_step
from bushfit.model.document import ModelFile
from bushfit.model.model import FIVE
from bushfit.model.result import Result
from bushfit.prediction.validation import Validation, validate
from bushfit.report.page.report import report_page
from bushfit.report.results import ResultFile


class RunDocument(WarningEntries, total=False):
    """JSON documents of all steps (fits, diagnosis), as `bushfit run --json` prints them.

    Args:
        static: fit of the loops, if there are loops.
        dynamic: two-step procedure, if there are loops and sweeps.
        joint: joint fit, if the model to use is another one.
        diagnosis: diagnosis, if a parameter is free.
        warnings: limits of the model to use and of its prediction.
    """

    static: ModelFile
    dynamic: ModelFile
    joint: ModelFile
    model: Required[Annotated[ModelFile, Field(description="Model to use: the joint fit, or with added effects.")]]
    diagnosis: DiagnosisFile


@dataclass(frozen=True, eq=False, repr=False)
class RunOutput:
    """Output of the command run: all fits, diagnosis, prediction, and result files.

    Args:
        data: the campaign, prepared for the fits.
        static: fit of the loops, the first of the paper's two steps; None without loops.
        two_step: results of the paper's two-step procedure; None if it was left out.
        reason_left_out: reason why the two-step procedure was left out; empty otherwise.
        joint: fit of all parameters together.
        diagnosed: the diagnosis; None if no parameter is free.
        predicted: prediction of the model to use.
        document: all documents, as `--json` prints them.
        files: documents, tables, figures and page.
        validations: comparisons of the model to use with the validation records of the campaign.
    """

    data: PreparedCampaign
    static: FitOutput | None
    two_step: TwoStep | None
    reason_left_out: str
    joint: FitOutput
    diagnosed: DiagnosisOutput | None
    predicted: PredictionOutput
    document: Mapping[str, Any]
    files: Sequence[ResultFile]
    validations: Sequence[Validation] = ()

    def __repr__(self) -> str:
        return "\n".join(repr(output) for output in (self.diagnosed, self.result) if output)

    @property
    def result(self) -> Result:
        """Fitted model to use: the joint fit, or the model with the effects that the diagnosis added."""
        return self.predicted.result

    @property
    def has_added_effects(self) -> bool:
        """True if the diagnosis added an effect to the model to use."""
        return bool(self.diagnosed and self.diagnosed.diagnosis.has_added_effects)


def run(campaign: Campaign | PreparedCampaign, *, loss: Loss | None = None) -> RunOutput:
    """Fit a campaign in every way, diagnose it, and predict from the model to use.

    Args:
        campaign: the campaign, or a campaign prepared by `prepare_tests`.
        loss: "soft_l1" or "linear"; default the campaign's.

    Returns:
        Static, two-step and joint fits, diagnosis and prediction, with the result files.
    """
    data = prepare_tests(campaign, loss)
    static = fit_static(data) if data.loops else None
    two_step, reason = None, ""
    if not (data.loops and data.sweeps):
        reason = f"no {'sweeps' if data.loops else 'loops'}"
    elif not data.free_names(FIVE):
        reason = "every parameter is fixed"
    else:
        try:
            two_step = fit_two_step(data)
        except FitError as error:
            reason = error.problem
    joint = fit(data)
    diagnosed = diagnose(data, joint=joint) if joint.result.fitted else None
    notes = diagnosed.diagnosis.notes if diagnosed else ()
    predicted = predict((diagnosed or joint).result, data.campaign, notes=notes)
    added = bool(diagnosed and diagnosed.diagnosis.has_added_effects)
    results = {
        "static": static and static.result,
        "dynamic": two_step and two_step.result,
        "joint": joint.result if added else None,
        "model": predicted.result,
    }
    origin = campaign_document(data, "run")
    documents: dict[str, Mapping[str, Any]] = {
        name: result_document(result, origin if name == "model" else {**origin, "logo": None})
        for name, result in results.items()
        if result
    }
    files = [ResultFile(name, "json", document) for name, document in documents.items()]
    files += campaign_files(data, predicted.result)
    files += [file for file in predicted.files if file.name != "measured"]
    if diagnosed:
        documents["diagnosis"], validations = diagnosed.document, diagnosed.validations
        files += [file for file in diagnosed.files if file.name not in ("model", "report")]
    else:
        validations = validate(predicted.result, data.campaign.validation)
        files += validation_files(validations, data.campaign.name)
    files.append(ResultFile("report", "page", partial(report_page, files)))
    document = {**documents, **to_entries(predicted.warnings)}
    return RunOutput(data, static, two_step, reason, joint, diagnosed, predicted, document, files, validations)
