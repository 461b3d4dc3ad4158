"""Effects of the library that the model lacks."""

from collections.abc import Collection, Sequence

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations.contract import MissingEffect
from bushfit.diagnosis.linear_model import Group
from bushfit.diagnosis.propose import proposals


def effects(evidence: Evidence, excluded: Collection[str], fixed: Sequence[str]) -> list[MissingEffect]:
    """List the effects that the model lacks, as explanations.

    Args:
        evidence: the fitted model and the tests.
        excluded: effects not to consider, with their twins.
        fixed: names of parameters that are not fitted.

    Returns:
        Every effect that these tests could show. An effect that replaces a branch has no columns and must be refitted.
    """
    share = np.empty(evidence.residual.size)
    for data_set, place in evidence.place.items():
        share[place] = data_set.relative_noise
    found = []
    for proposal in proposals(evidence, excluded, fixed):
        group = None
        if not proposal.together:
            unit = np.abs(proposal.columns * share).max(axis=1)
            group = Group(proposal.columns, unit, together=False, sense=proposal.sense)
        found.append(MissingEffect("effect", proposal.name.partition(".")[0], proposal.name, group, proposal))
    return found
