"""diagnose: find where model and tests disagree, and which effect is missing."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

from bushfit.campaign.campaign import Campaign
from bushfit.campaign.schema import Loss
from bushfit.commands.fit import FitOutput, fit, prepare_tests
from bushfit.commands.loading import HasResult, as_result
from bushfit.commands.provenance import campaign_document, option_words, result_document
from bushfit.commands.respond import validation_files
from bushfit.diagnosis import workflow
from bushfit.diagnosis.document import DiagnosisFile
from bushfit.diagnosis.record import Diagnosis, DiagnosisSettings, level_of
from bushfit.effects.mistakes import get_mistake
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.errors import FitError
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import NEXT
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.planning.knowledge import undecided_effects
from bushfit.prediction.validation import Validation, validate
from bushfit.report import diagnosed, plots
from bushfit.report.page.report import report_page
from bushfit.report.results import ResultFile


@dataclass(frozen=True, eq=False, repr=False)
class DiagnosisOutput:
    """Output of the command diagnose: verdict, model to use, and result files.

    Args:
        data: the campaign, prepared for a fit.
        diagnosis: the diagnosis.
        document: content of diagnosis.json.
        files: documents, tables, figure and page.
        validations: comparisons of the model to use with the validation records of the campaign.
        rivals: effects that the tests cannot distinguish, between which a plan of this campaign decides; may be empty.
    """

    data: PreparedCampaign
    diagnosis: Diagnosis
    document: DiagnosisFile
    files: Sequence[ResultFile]
    validations: Sequence[Validation] = ()
    rivals: Sequence[str] = ()

    def __repr__(self) -> str:
        return f"{self.data.campaign.name}: {self.headline}\n  {self.diagnosis.summary}"

    @property
    def headline(self) -> str:
        """Verdict of the diagnosis as a sentence, with the parameters whose 95 % half width is at least their value."""
        unknown = self.result.covariance.describe_unknown(self.result.model.values)
        return "; ".join(filter(None, (self.diagnosis.verdict, unknown)))

    @property
    def adoptable_names(self) -> list[str]:
        """Names of the effects and mistakes that --adopt may add to the model, if further tests confirm them.

        Empty if the named effects are certain and in the model already, or if a part of the tests has to be measured
        again first.
        """
        causes = [entry for entry in self.diagnosis.effects if entry.name != UNNAMED]
        is_open = any(level_of(entry.name) in ("record", "unresolved") for entry in causes)
        if self.diagnosis.measure_again or (self.diagnosis.verdict == "named" and not is_open):
            return []
        return [entry.label for entry in causes if not ((kind := get_mistake(entry.name)) and kind.is_estimated)]

    @property
    def result(self) -> Result:
        """Fitted model to use: the joint fit, or the model with the effects that the diagnosis added."""
        return self.diagnosis.result


def diagnose(
    campaign: Campaign | PreparedCampaign,
    *,
    model: Result | HasResult | None = None,
    adopt: Sequence[str] = (),
    without: Sequence[str] = (),
    max_effects: int = DiagnosisSettings.max_effects,
    tolerance: float = DiagnosisSettings.tolerance,
    loss: Loss | None = None,
    joint: FitOutput | None = None,
) -> DiagnosisOutput:
    """Find where model and tests disagree, name the missing effect, and add it to the model.

    Args:
        campaign: the campaign, or a campaign prepared by `prepare_tests`.
        model: result, or output with a result, whose effects the diagnosis starts from; default the paper's three.
        adopt: effects that are added, and mistakes that are corrected, whatever the evidence.
        without: effects and mistakes that are not considered.
        max_effects: largest number of effects that are added.
        tolerance: gap between model and tests, relative to the stiffness magnitude, below which they agree.
        loss: "soft_l1" or "linear"; default the campaign's.
        joint: joint fit of the campaign, if already computed, to save time.

    Returns:
        Verdict, gap, candidates and the model to use, with the result files.

    Raises:
        BushfitError: tests or settings that cannot support the diagnosis.
    """
    data, start = prepare_tests(campaign, loss), as_result(model) if model else None
    unresolved = [name for name in start.unresolved if name not in adopt] if start else []
    settings = DiagnosisSettings(max_effects, tolerance, tuple(adopt), tuple(without), tuple(unresolved))
    parameters = (start.model if start else Model.with_defaults(data.campaign.bushing, data.effects, {})).parameters
    if not (adopt or data.free_names(tuple(parameters))):
        raise FitError(
            "there is nothing to fit, and so nothing to diagnose",
            file=data.campaign.path,
            place="[fit]",
            found="every parameter is fixed by vary = false",
            hint="bushfit fit shows how well the given values meet the tests; to diagnose, free a parameter",
        )
    numbers = {"max_effects": max_effects, "tolerance": tolerance}
    changed = {key: f"{number:g}" for key, number in numbers.items() if number != getattr(DiagnosisSettings, key)}
    options = option_words(model="MODEL.json" if start else None, adopt=adopt, without=without, **changed)
    diagnosis = workflow.diagnose(data, start.model if start else None, settings)
    if not (diagnosis.is_changed or start or adopt):  # the model to use is that of fit
        plain = (joint or fit(data)).result
        warnings = (replace(warning, text=warning.text.removesuffix(NEXT)) for warning in plain.warnings)
        plain = replace(plain, warnings=tuple(warnings))
        diagnosis = replace(diagnosis, result=diagnosis.odds.widen(plain))
    document = diagnosis.to_document()
    origin = campaign_document(data, "diagnose", options)
    records = data.campaign.validation
    validations = validate(diagnosis.result, records)
    if records and diagnosis.has_added_effects:
        pairs = zip(validations, validate((joint or fit(data)).result, records), strict=True)
        validations = [replace(validation, nrmse_before=plain.entry["nrmse"]) for validation, plain in pairs]
    if validations:
        document["validation"] = [validation.entry for validation in validations]
    title, gap = data.campaign.name, ResultFile("gap", "table", partial(diagnosed.gap_table, diagnosis))
    files = [
        ResultFile("diagnosis", "json", document),
        ResultFile("model", "json", result_document(diagnosis.result, origin)),
        gap,
        ResultFile("gap", "figure", lambda: plots.gap.gap_figure(gap.content(), diagnosis.result, document, title)),
        ResultFile("candidates", "table", partial(diagnosed.candidates_table, diagnosis)),
    ]
    files += validation_files(validations, title)
    files.append(ResultFile("report", "page", partial(report_page, files)))
    rivals = () if start or adopt else next(iter(undecided_effects(diagnosis)), ())
    return DiagnosisOutput(data, diagnosis, document, files, validations, rivals)
