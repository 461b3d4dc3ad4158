"""Smooth correction of a model for a gap that no effect explains, and the nearest power law."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.document import Description
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import unnamed
from bushfit.diagnosis.fingerprint import Fingerprint, fingerprint
from bushfit.diagnosis.holdout import HoldOut, HoldOutPart
from bushfit.diagnosis.linear_model import LinearModel
from bushfit.diagnosis.locate import locate
from bushfit.diagnosis.rig_errors import rig_errors, scattering_alone
from bushfit.effects.contract import Array
from bushfit.effects.unnamed import NAME, Unnamed
from bushfit.errors import FitError
from bushfit.fitting.agreement import LeaveOut
from bushfit.fitting.coordinates import Bounds
from bushfit.fitting.design import fit_from
from bushfit.fitting.model_error import with_model_error
from bushfit.fitting.preparation import MeasuredTest, split_by_kind
from bushfit.fitting.problem import FitResult
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.units import number

#: Evaluations of the model at most in the refit that the power law stands beside: it has to end.
_EVALUATIONS = 400
#: Logarithm of odds below which a size of the rig's errors does not count; chosen for time: a twentieth of the best.
_NEAR = 3.0


@dataclass(frozen=True, eq=False)
class GapDescription:
    """Gap without a name.

    Args:
        after: the model with its correction, and the tests in the form that the correction can predict.
        fitted: fit of the parameters with the correction as an error of the model.
        held: hold-out of whole runs inside the range, without and with the correction; for information only.
        fingerprint: nearest power law; None if the tests show none.
        words: size of the gap and its form.
        evidence: range in which the correction is valid.
    """

    after: Evidence
    fitted: FitResult
    held: HoldOut
    fingerprint: Fingerprint | None
    words: str
    evidence: str

    @property
    def description(self) -> Description | None:
        """Power law of the gap; None if the gap does not follow one."""
        found = self.fingerprint
        if found is None or not found.is_power_law or not any(found.determined):
            return None
        return Description(found.phase_deg, found.frequency_power, found.amplitude_power, found.words)


def describe(
    evidence: Evidence, rig: RigSettings, start: Mapping[str, float], fixed: Sequence[str], bounds: Bounds
) -> GapDescription | None:
    """Describe the gap of a fitted model by a smooth correction and the nearest power law.

    The law of the gap in time is unknown: loops are represented by their first harmonic.

    Args:
        evidence: the fitted model and the tests.
        rig: stated class of the rig.
        start: starting values read from the data, for a model whose parameters the gap has distorted.
        fixed: names of parameters that are not fitted.
        bounds: limits of parameters inside their general limits.

    Returns:
        The description; None if the correction does not raise the likelihood, or if its error is larger than the gap.
    """
    if NAME in evidence.model.effects:
        return None
    fitted, correction = with_model_error(evidence.estimate, bounds, smooth=True)
    if correction is None or correction.uncertainty >= 1.0:
        return None
    harmonic = tuple(data_set.fundamental() for data_set in evidence.data_sets)
    try:
        base = _refitted(evidence.model, harmonic, fixed, bounds)
        base = _refitted(base.model, harmonic, (*fixed, *base.solution.at_bound), bounds)
    except FitError:  # too few points are left for the parameters
        return None
    model = replace(fitted.model, effects=(*evidence.model.effects, NAME), unnamed=correction)
    after = Evidence(fitted.moved_to(model, harmonic), harmonic)
    whole = Evidence(fitted.moved_to(model, evidence.data_sets), evidence.data_sets)
    like = fingerprint(base, *weighed(base, rig), start, bounds)
    texts = _words(correction, like), _trusted(correction, whole)
    return GapDescription(after, fitted, _held_out(evidence, fitted), like, *texts)


def weighed(fitted: Evidence, rig: RigSettings) -> tuple[Evidence, LinearModel]:
    """Prepare the linear model that weighs smooth curves beside a fitted model.

    Args:
        fitted: the fitted model and the tests.
        rig: stated class of the rig.

    Returns:
        The fit with residuals in units of the scatter from point to point, and the linear model at the probable
        sizes of the rig's errors.
    """
    bare = scattering_alone(fitted)
    rows, curves = bare.solution.jacobian, [explanation.group for explanation in unnamed(bare) if explanation.group]
    plain = LinearModel(bare.residual, rows, np.zeros(len(rows)), rig_errors(bare, rig), curves)
    return bare, replace(plain, chosen_nodes=plain.likely(_NEAR))


def _refitted(model: Model, data_sets: Sequence[MeasuredTest], fixed: Sequence[str], bounds: Bounds) -> Evidence:
    return Evidence(fit_from(model, data_sets, fixed, bounds).finished(_EVALUATIONS).solution, tuple(data_sets))


def _held_out(before: Evidence, fitted: FitResult) -> HoldOut:
    """Whole runs inside the range, in turn predicted from the others, without the correction and with it."""
    solution = before.solution
    both = (
        LeaveOut.from_fit(solution.jacobian[solution.moving], solution.residual),
        LeaveOut.from_fit(fitted.jacobian[fitted.moving], fitted.residual),
    )
    residuals = dict[str, Array]()
    for part in _inside(before.data_sets):
        rows = part.rows(before.data_sets)
        masks = [np.pad(rows, (0, leave_out.residual.size - rows.size)) for leave_out in both]
        if any(leave_out.open(chosen).any() for leave_out, chosen in zip(both, masks, strict=True)):
            continue  # the rest does not tell the model
        pairs = [
            leave_out.predicted(chosen, np.arange(chosen.size)) for leave_out, chosen in zip(both, masks, strict=True)
        ]
        residuals[part.name] = np.array(pairs)
    return HoldOut.from_residuals(residuals)


def _inside(data_sets: Sequence[MeasuredTest]) -> Iterator[HoldOutPart]:
    """Whole runs inside the range: every third frequency of each, the middle level, a repeat."""
    chosen: dict[str, dict[MeasuredTest, Array]] = {}
    for sweep in split_by_kind(data_sets)[1]:
        rank = np.unique(sweep.step, return_inverse=True)[1]
        levels, level = np.unique(sweep.held, return_inverse=True)
        several = np.ptp(sweep.repeat) > 0
        for name, points in (
            (f"every third {sweep.sweep.stepped or 'point'}", (rank % 3 == 1) & (rank < rank.max())),
            ("the middle of the held-out part", (level == levels.size // 2) & (levels.size > 2)),
            ("the last repeat", (sweep.repeat == sweep.repeat.max()) & several),
        ):
            if points.any():
                chosen.setdefault(name, {})[sweep] = points
    for name, points_by_sweep in chosen.items():
        yield HoldOutPart(
            name, [points_by_sweep.get(data, np.zeros(data.size // data.parts, dtype=bool)) for data in data_sets]
        )


def _words(correction: Unnamed, like: Fingerprint | None) -> str:
    """Sentence on the size and the form of the gap."""
    largest, band = (number(100.0 * share, 2) for share in (correction.largest, Z95 * correction.uncertainty))
    sentences = [f"up to {largest} % of |K|, uncertain by {band} % of itself"]
    if like is None or not any(like.determined):
        sentences.append("its form is unknown")
    elif like.is_power_law:
        sentences.append(like.words)
    else:
        sentences.append(
            "it is not a power law of frequency and amplitude"
            + (f"; nearest: {like.words}" if all(like.determined) else "")
        )
    return "; ".join(sentences)


def _trusted(correction: Unnamed, whole: Evidence) -> str:
    """Sentence on the range in which the correction is valid, and on the misfit that stays in the worst loop."""
    patches = [
        f"{', '.join(patch.directions)} {_span(patch.frequency_Hz)} Hz, {_span(patch.strain, 100.0)} % strain"
        for patch in correction.patches
    ]
    misfit = max((region.excess for region in locate(whole) if region.kind == "loop"), default=0.0)
    stays = f" (their form still differs by {number(misfit, 2)} times the noise)" if misfit else ""
    loops = f", of loops the first harmonic only{stays}" if split_by_kind(whole.data_sets)[0] else ""
    return f"valid only between these tests ({'; '.join(patches)}){loops}, and of this bushing"


def _span(values: Sequence[float], factor: float = 1.0) -> str:
    """The least and the largest value."""
    return " to ".join(number(factor * end, 2) for end in (min(values), max(values)))
