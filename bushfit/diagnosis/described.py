"""What has no name, described: a smooth correction where it stands, and the power law that it is like."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.correction import Correction, correct
from bushfit.diagnosis.currency import Ledger
from bushfit.diagnosis.document import Description
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations import unnamed
from bushfit.diagnosis.fingerprint import Fingerprint, fingerprint
from bushfit.diagnosis.locate import locate
from bushfit.diagnosis.rig_errors import rig_errors, scattering_alone
from bushfit.effects.unnamed import NAME
from bushfit.errors import FitError
from bushfit.fitting.coordinates import Bounds, jacobian, residual
from bushfit.fitting.data_sets import parted
from bushfit.fitting.design import fit_from
from bushfit.model.covariance import Z95
from bushfit.units import number

#: Evaluations of the model in its refit at most: a correction is of what the best parameters leave, so it has to end.
_EVALUATIONS = 400
#: Logarithm of odds below which a size of the rig's errors does not count; chosen for time: a twentieth of the best.
_NEAR = 3.0


@dataclass(frozen=True, eq=False)
class Described:
    """A gap without a name.

    Args:
        after: the model with its correction, and the tests as far as it can answer them.
        fingerprint: the nearest power law; None where these tests show none.
        words: how large the gap is and what it is like, for people.
        evidence: where the correction may be trusted, for people.
    """

    after: Evidence
    correction: Correction
    fingerprint: Fingerprint | None
    words: str
    evidence: str

    @property
    def description(self) -> Description | None:
        """The power law, where the gap is one."""
        found = self.fingerprint
        if found is None or not found.is_power_law or not any(found.told):
            return None
        return Description(found.phase_deg, found.frequency_power, found.amplitude_power, found.words)


def describe(
    evidence: Evidence, rig: RigSettings, start: Mapping[str, float], held: Sequence[str], bounds: Bounds
) -> Described | None:
    """A smooth correction of a fitted model and its fingerprint; None where the tests are no likelier with it.

    The parameters are fitted again with each loop standing on its first harmonic, because nothing is known of the law
    in time of what has no name.

    Args:
        start: values of the model's parameters read off the data, for a model that the gap has bent too far.
        held, bounds: parameters that do not move, and limits of the others inside their own.
    """
    if NAME in evidence.model.effects:
        return None
    try:
        base = _refitted(evidence, held, bounds)
        base = _refitted(base, (*held, *base.solution.at_bound), bounds)
    except FitError:  # too few points are left for the parameters
        return None
    bare, plain = weighed(base, rig)
    correction = correct(base, bare, plain)
    if correction is None:
        return None
    effects = (*base.model.effects, NAME)
    model, names = replace(base.model, effects=effects, unnamed=correction.data), base.solution.coordinates.names
    left, rows = residual(model, base.data_sets), jacobian(model, base.data_sets, names)
    after = Evidence(replace(base.solution, model=model, residual=left, jacobian=rows), base.data_sets)
    like = fingerprint(base, bare, plain, start, bounds)
    whole = Evidence(replace(after.solution, residual=residual(model, evidence.data_sets)), evidence.data_sets)
    return Described(after, correction, like, _words(correction, like), _trusted(correction, whole))


def weighed(fitted: Evidence, rig: RigSettings) -> tuple[Evidence, Ledger]:
    """The fit with residuals in units of what scatters from point to point, and what anything smooth beside it is worth
    at the sizes of the rig's errors that matter."""
    bare = scattering_alone(fitted)
    rows, curves = bare.solution.jacobian, [each.group for each in unnamed(bare) if each.group]
    plain = Ledger(bare.residual, rows, np.zeros(len(rows)), rig_errors(bare, rig), curves)
    return bare, replace(plain, at=plain.likely(_NEAR))


def _refitted(evidence: Evidence, held: Sequence[str], bounds: Bounds) -> Evidence:
    """The model fitted to each sweep and to the first harmonic of each loop, to the end."""
    data_sets = tuple(data_set.fundamental() for data_set in evidence.data_sets)
    return Evidence(fit_from(evidence.model, data_sets, held, bounds).finished(_EVALUATIONS).solution, data_sets)


def _words(correction: Correction, like: Fingerprint | None) -> str:
    """How large it is and what it is like."""
    largest, band = (number(100.0 * share, 2) for share in (correction.data.largest, Z95 * correction.band))
    said = [f"up to {largest} % of |K|, known within {band} % of itself"]
    if like is None or not any(like.told):
        said.append("nothing is told of its form")
    elif like.is_power_law:
        said.append(like.words)
    else:
        said.append(
            "it is no power law of frequency and amplitude" + (f"; nearest: {like.words}" if all(like.told) else "")
        )
    if correction.data.peak:
        middle, width = (number(each, 2) for each in correction.data.peak)
        said.append(f"with a peak, as of a resonance, at {middle} Hz, {width} Hz wide")
    return "; ".join(said)


def _trusted(correction: Correction, whole: Evidence) -> str:
    """Where it may be trusted, and by how much the form of the worst loop stays off, all harmonics counted."""
    patches = [
        f"{', '.join(patch.directions)} {_span(patch.frequency_Hz)} Hz, {_span(patch.strain, 100.0)} % strain"
        for patch in correction.data.patches
    ]
    off = max((where.excess for where in locate(whole) if where.kind == "loop"), default=0.0)
    stays = f" (their form stays off by {number(off, 2)} times the noise)" if off else ""
    loops = f", of loops the first harmonic only{stays}" if parted(whole.data_sets)[0] else ""
    return f"to be trusted between these tests alone ({'; '.join(patches)}){loops}, and of this bushing"


def _span(values: Sequence[float], factor: float = 1.0) -> str:
    """The least and the largest value."""
    return " to ".join(number(factor * end, 2) for end in (min(values), max(values)))
