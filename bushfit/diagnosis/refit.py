"""The best proposals fitted together with all parameters of the model, side by side, losers left on their way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from bushfit.diagnosis.evidence import EVALUATIONS, Evidence, begun
from bushfit.diagnosis.propose import Proposal, stroke
from bushfit.effects import LIBRARY, qualified
from bushfit.errors import FitError, ModelError
from bushfit.fitting.data_sets import DataSet
from bushfit.fitting.descent import Descent
from bushfit.fitting.solve import Bounds

#: Rivals farther than this from the data than the best are excluded without asking what the test could tell.
PLAIN = 60.0
#: A fit may fall by this many times what a linear model yet promises.
_HOPE = 4.0
#: It is not left before its first evaluations, and before its early ones are over only if it claimed too little.
_FIRST, _EARLY = 4, 12


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect refitted together with everything else.

    Args:
        name: the effect.
        evidence: where its fit ended, or was left.
        gain: what it took off chi-square.
        left: whether it was left on its way, far behind the best.
    """

    name: str
    evidence: Evidence
    gain: float
    left: bool = False


def race(
    evidence: Evidence,
    proposed: Sequence[Proposal],
    known: Sequence[Candidate],
    start: Mapping[str, float],
    held: Sequence[str],
    bounds: Bounds,
) -> list[Candidate]:
    """Proposals fitted until they settle or cannot come near the best, beside candidates known already; best first.

    All begin at no amount of the effect, where the model stands but for the values given to start from.
    """
    runners: dict[str, Descent] = {}
    for proposal in proposed:
        limits = {**_within_stroke(evidence.data_sets, proposal.name), **bounds}
        with suppress(FitError, ModelError):  # no response with this effect: no candidate
            runners[proposal.name] = begun(proposal.model.with_values(start), evidence.data_sets, held, limits)
    claimed = {proposal.name: evidence.chi_square - proposal.score for proposal in proposed}
    least = min((candidate.evidence.chi_square for candidate in known), default=np.inf)
    running = list(runners)
    while running:
        for name in running:
            runners[name] = runners[name].stepped()
        least = min(least, *(runners[name].chi_square for name in running))
        running = [name for name in running if hopeful(runners[name], least + PLAIN, claimed[name])]
    fitted = [
        Candidate(
            name,
            Evidence(runner.solution, evidence.data_sets),
            evidence.chi_square - runner.chi_square,
            left=not runner.settled and runner.evaluations < EVALUATIONS,
        )
        for name, runner in runners.items()
    ]
    return sorted([*known, *fitted], key=lambda candidate: candidate.evidence.bic)


def hopeful(descent: Descent, goal: float, claimed: float = np.inf) -> bool:
    """Whether a fit may yet bring chi-square below a goal; early on what was claimed for it counts too."""
    if descent.settled or descent.evaluations >= EVALUATIONS:
        return False
    early = descent.evaluations < _EARLY and claimed < goal
    return early or descent.evaluations < _FIRST or descent.chi_square - _HOPE * descent.promise < goal


def _within_stroke(data_sets: Sequence[DataSet], name: str) -> Bounds:
    """Limits of an effect's displacements to what the tests can show: a stop that is always met is no stop."""
    effect = LIBRARY[name]
    scaled = [parameter for parameter in effect.parameters if parameter.scale == "displacement"]
    return {qualified(effect, parameter): stroke(data_sets) for parameter in scaled}
