"""Results of a diagnosis, and their JSON document."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from bushfit.caveat import Caveat
from bushfit.diagnosis.document import (
    Description,
    DiagnosisFile,
    EffectEntry,
    ExpectedErrorEntry,
    GapEntry,
    MisfitRegionEntry,
    SizeEntry,
    Verdict,
)
from bushfit.diagnosis.holdout import HoldOut
from bushfit.effects import effect_name_of, get_parameter
from bushfit.effects.mistakes import get_candidate, option_label
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.fitting.problem import FitResult
from bushfit.geometry import Place
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Result
from bushfit.prediction.caveats import warnings_of
from bushfit.validation import to_json_data

if TYPE_CHECKING:
    from bushfit.diagnosis.verdict import Composition

#: Probability above which no further digits are shown.
_NEARLY_ONE = 0.995
#: Probability below which other explanations are not mentioned.
_LEAST_REPORTED = 0.01


@dataclass(frozen=True)
class DiagnosisSettings:
    """Settings of a diagnosis: the options of the command diagnose.

    Args:
        max_effects: maximum number of added effects, adopted ones included; one may be added in any case.
        tolerance: gap, relative to |K| (for a loop: to half its force range), below which an explanation is neglected.
        adopt: names of effects to add and of recording mistakes to correct, whatever the evidence.
        without: names of effects (with their twins) and mistakes not to consider.
        unresolved: effects of the starting model that earlier tests could not distinguish from an effect of the rig.
    """

    max_effects: int = 3
    tolerance: float = 0.01
    adopt: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    unresolved: tuple[str, ...] = ()


@dataclass(frozen=True)
class MisfitRegion:
    """One region of frequency and amplitude in which model and measurement disagree.

    Args:
        direction: direction or specimen.
        kind: "sweep" or "loop".
        frequency: lowest and highest frequency [Hz].
        amplitude: lowest and highest amplitude, zero-to-peak [m or rad, or strain].
        component: "storage" or "loss" stiffness of sweeps, or "force" of a loop.
        excess: root mean square of the smooth misfit, measured minus model, in units of its noise.
        sentence: sentence that describes the region.
    """

    direction: Place
    kind: str
    frequency: tuple[float, float]
    amplitude: tuple[float, float]
    component: str
    excess: float
    sentence: str


@dataclass(frozen=True)
class NamedCause:
    """Effect or recording mistake that a diagnosis names, or the first of a set that the tests cannot distinguish.

    Args:
        name: name of the effect or mistake.
        evidence: reason why the effect or mistake is named.
        alternatives: explanations without this effect or mistake that these tests cannot exclude.
        test: name of the test with the mistake; None for an effect, or a mistake in [bushing].
        sentence: statement of the mistake; "" for an effect, whose own sentence is then used.
        correction: line to write into the campaign to correct the mistake; "" for an effect.
    """

    name: str
    evidence: str
    alternatives: "tuple[Composition, ...]" = ()
    test: str | None = None
    sentence: str = ""
    correction: str = ""

    @property
    def label(self) -> str:
        """Name of the effect or mistake in the form that the option --adopt accepts."""
        return option_label(self.name, self.test)


@dataclass(frozen=True)
class Odds:
    """Reported explanations of a gap between model and tests, with their probabilities and fitted models.

    Args:
        nothing: probability that nothing is missing beyond noise and tolerance.
        explanations: text and probability (if anything is missing) of each explanation, the most probable first.
        fits: fitted model of each explanation, with its covariance; None for the reported explanation, and for an
            explanation that was not fitted.
        labels: names of the effects, mistakes and faults of each explanation.
    """

    nothing: float
    explanations: tuple[tuple[str, float], ...] = ()
    fits: tuple[tuple[Model, Covariance] | None, ...] = ()
    labels: tuple[tuple[str, ...], ...] = ()

    def widen(self, result: Result) -> Result:
        """Widen the uncertainty of a result by the probability of other explanations.

        Args:
            result: the result under one explanation.

        Returns:
            The result with a larger covariance: for each other explanation, the squared difference of its parameters
            times its probability is added.

        Notes: nothing is added for parameters that are not comparable: those at a bound in the other fit, those divided
        by such a parameter, and those of a branch that an effect replaces.
        """
        cov, current = result.covariance, result.model.values
        matrix = cov.matrix.copy()
        for (_, probability), fit in zip(self.explanations, self.fits, strict=True):
            if fit is None:
                continue
            model, covariance = fit
            difference = np.array([model.values.get(name, current[name]) - current[name] for name in cov.names])
            other_law = any(effect.replaces for effect in model.records if effect.name not in result.model.effects)
            if not other_law and {*cov.names} & {*model.values} <= {*covariance.names}:
                matrix += (1.0 - self.nothing) * probability * np.outer(difference, difference)
        return replace(result, covariance=replace(cov, matrix=matrix))


@dataclass(frozen=True)
class CandidateResult:
    """Effect or mistake that a diagnosis considered, with its score, refit and probability: a row of candidates.csv.

    Args:
        name: name of the effect or mistake.
        score: decrease of chi-square expected from the linearised model.
        gain: decrease of chi-square in a refit; None without a refit.
        probability: probability that the candidate is part of the explanation.
        parameters: fitted values [SI] by parameter name.
        why: reason for adding the candidate to the model, or for leaving it out.
    """

    name: str
    score: float
    gain: float | None
    probability: float
    parameters: Mapping[str, float]
    why: str


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Result of a diagnosis: verdict, explanation, misfit before and after, next test and the model to use.

    Args:
        verdict: verdict in one word, such as "named".
        summary: verdict as a sentence.
        effects: effects or mistakes that were named; of a set that the tests cannot distinguish, the first.
        where: regions of disagreement between the starting model and the tests.
        remainder: regions of disagreement that remain with the added effects.
        holdout: errors of held-out parts of the tests, without and with the added effects.
        next_test: measurement that would decide between explanations or confirm the verdict; "" without one.
        candidates: all effects and mistakes considered, the highest score first.
        before: starting model, refitted to all tests.
        after: model with the added effects; for a recording mistake, fitted to the corrected tests.
        result: model to use, with its uncertainty: `after`, or `before` for a recording mistake.
        notes: further warnings.
        description: power law of a gap that no known effect explains; None without such a gap or law.
        odds: reported explanations with their probabilities.
        measure_again: True if a part of the tests has to be measured again first, as `next_test` states.
    """

    verdict: Verdict
    summary: str
    effects: tuple[NamedCause, ...]
    where: tuple[MisfitRegion, ...]
    remainder: tuple[MisfitRegion, ...]
    holdout: HoldOut
    next_test: str
    candidates: tuple[CandidateResult, ...]
    before: FitResult
    after: FitResult
    result: Result
    notes: tuple[Caveat, ...] = ()
    description: Description | None = None
    odds: Odds = Odds(1.0)
    measure_again: bool = False

    @property
    def is_changed(self) -> bool:
        """True if added effects or a corrected record make the final fit differ from the starting fit."""
        return self.after is not self.before

    @property
    def has_added_effects(self) -> bool:
        """True if the effects of the model to use differ from those of the starting model."""
        return self.result.model.effects != self.before.model.effects

    @property
    def calibration(self) -> tuple[float, float]:
        """Root mean square of the fitted residuals before and after the diagnosis, in units of noise."""
        return self.before.mean_square**0.5, self.after.mean_square**0.5

    @property
    def warnings(self) -> list[Caveat]:
        """Notes of the diagnosis, and warnings of the model to use."""
        return warnings_of(self.result, notes=self.notes)

    def to_document(self) -> DiagnosisFile:
        """Convert the diagnosis to the content of diagnosis.json.

        Returns:
            JSON-compatible data.
        """
        (before, after), holdout, places = self.calibration, self.holdout, self.result.usable
        gap: GapEntry = {
            "calibration": {"before": before, "after": after},
            "heldout": {"before": holdout.before, "after": holdout.after} if holdout.parts else None,
            "parts": holdout.parts,
            "skipped": holdout.skipped,
        }
        usable: ExpectedErrorEntry | None = None
        if places:
            usable = {
                "stiffness": max(place.stiffness for place in places),
                "loss_factor": max(place.loss_factor for place in places),
                "held_out": all(place.held_out for place in places),
                "places": places,
            }
        document: DiagnosisFile = {
            "schema": "bushfit/diagnosis/3",
            "verdict": self.verdict,
            "summary": self.summary,
            "nothing": self.odds.nothing,
            "odds": [{"words": words, "probability": share} for words, share in self.odds.explanations],
            "effects": [self._effect(named) for named in self.effects],
            "where": [_region_entry(region) for region in self.where],
            "remainder": [_region_entry(region) for region in self.remainder],
            "description": self.description,
            "gap": gap,
            "usable": usable,
            "next_test": self.next_test,
            "warnings": [warning.text for warning in self.warnings],
            "warning_kinds": [warning.kind for warning in self.warnings],
        }
        return to_json_data(document, DiagnosisFile)

    def _effect(self, named: NamedCause) -> EffectEntry:
        """Entry of diagnosis.json for a named effect or mistake, with its fitted parameters."""
        effect, model, covariance = get_candidate(named.name), self.result.model, self.result.covariance
        models = [model, *(fit[0] for fit in self.odds.fits if fit)]  # the model to use, or else its explanation
        values = next((fitted.values for fitted in models if named.name in fitted.effects), {})
        parameters: dict[str, SizeEntry] = {}
        for name, value in values.items():
            if effect_name_of(name) == named.name:
                interval = self.result.interval(name) if name in model.values else None
                parameters[name] = {
                    "value": value,
                    "stderr": covariance.stderr(name),
                    "ci95": None if interval is None else list(interval),
                    "unit": get_parameter(name).unit,
                }
        return {
            "name": named.name,
            "level": level_of(named.name),
            "twins": list(effect.twins),
            "replaces": effect.replaces,
            "test": named.test,
            "sentence": named.sentence or effect.sentence,
            "correction": named.correction or None,
            "parameters": parameters,
            "evidence": named.evidence,
            "alternatives": [composition.label for composition in named.alternatives],
        }


def format_probability(probability: float) -> str:
    """Format a probability as a percentage.

    >>> format_probability(0.982), format_probability(0.9999)
    ('98 %', 'above 99.5 %')
    """
    if probability > _NEARLY_ONE:
        return f"above {100 * _NEARLY_ONE:g} %"
    if probability < 1.0 - _NEARLY_ONE:
        return f"below {100 * (1.0 - _NEARLY_ONE):.1g} %"
    return f"{100 * probability:.0f} %"


def format_odds(document: Mapping[str, Any]) -> list[str]:
    """Format the probabilities of the explanations in a diagnosis as lines of text.

    Args:
        document: content of diagnosis.json.

    Returns:
        Lines of text: the explanations, the most probable first, and the probability that nothing is missing.
    """
    if document["verdict"] == "consistent":
        lines = [f"Probability that nothing is missing: {format_probability(document['nothing'])}."]
        if 1.0 - document["nothing"] > _LEAST_REPORTED:
            small = format_probability(1.0 - document["nothing"])
            lines.append(f"Probability of an effect that these tests do not establish: {small}.")
        return lines
    lines = [f"probability {format_probability(entry['probability'])}: {entry['words']}" for entry in document["odds"]]
    rest = 1.0 - sum(entry["probability"] for entry in document["odds"])
    if lines and rest > _LEAST_REPORTED:
        lines.append(f"probability {format_probability(rest)}: other explanations together")
    if lines and document["nothing"] > _LEAST_REPORTED:
        lines.append(f"Probability that nothing is missing: {format_probability(document['nothing'])}.")
    return lines


def level_of(name: str) -> str:
    """Level of an effect (material, component, instrument) or mistake (record); "unresolved" if perhaps of the rig."""
    candidate = get_candidate(name)
    return "unresolved" if candidate.twins or name == UNNAMED else str(candidate.level)


def _region_entry(region: MisfitRegion) -> MisfitRegionEntry:
    """Convert a region of disagreement to its entry in diagnosis.json, with amplitudes in display units."""
    unit, factor = region.direction.display.displacement
    entry = {
        "direction": str(region.direction),
        "kind": region.kind,
        "frequency_Hz": list(region.frequency),
        f"amplitude_{unit}": [x * factor for x in region.amplitude],
        "component": region.component,
        "excess": region.excess,
        "reading": region.sentence,
    }
    return cast(MisfitRegionEntry, entry)  # one of its keys is named after the unit
