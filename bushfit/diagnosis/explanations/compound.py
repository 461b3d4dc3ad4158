"""A smooth deviation of the compound from every law of the model: over frequency and strain, shared by all tests.

No rubber follows a few parameters exactly. What it does otherwise is a smooth function of frequency and strain, the
same in every direction and on every specimen; what a rig does differs between them. So the deviation is part of every
hypothesis, at sizes that `priors.COMPOUND` weighs, and nothing is named for what it explains as well.
"""

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations.unnamed import harmonics
from bushfit.diagnosis.linear_model import Group
from bushfit.fitting.preparation import group_repeats, split_by_kind
from bushfit.gaussian_process import coordinates, in_lengths, patterns

#: Lengths in ln frequency and ln strain: what relaxes does so over decades of frequency, and what breaks over more than
#: one of strain.
_LENGTHS = (8.0, 3.0)
#: Patterns of the process that count; on plans of three to five levels more gain nothing.
_PATTERNS = 12
#: First of the rows of `MeasuredLoop.contrasts` that the stiffness at the loop's frequency does not make.
_OVERTONES = 3


def compound(evidence: Evidence) -> Group | None:
    """Whitened residuals of a smooth relative deviation of the compound's modulus, by independent amounts of its
    features.

    Args:
        evidence: fitted model and tests.

    Returns:
        Columns (c, n) and relative changes of |K| (c, points), where the deviation has unit variance at each operating
        point; the h-th harmonic of a loop has 1/h of it. None without an operating point.

    Notes: a Gaussian process over ln f and ln strain (Kennedy and O'Hagan, 2001).
    """
    model, data_sets = evidence.model, evidence.data_sets
    if not data_sets:
        return None
    points = [coordinates(test.frequency, test.amplitude * model.unit_strain(test.direction)) for test in data_sets]
    ends = np.cumsum([0, *map(len, points)])
    _, shapes = patterns(in_lengths(np.concatenate(points), _LENGTHS), count=_PATTERNS)
    share = shapes[:, None] * np.array([[1.0], [1.0j]])
    share = share.reshape(-1, share.shape[-1])
    columns = np.zeros((len(share), evidence.residual.size))
    for test, first, last in zip(data_sets, ends[:-1], ends[1:], strict=True):
        stiffness = model.stiffness(test.direction, test.frequency, test.amplitude, kind=test.kind)
        columns[:, evidence.place[test]] = test.residual_change(share[:, first:last] * stiffness, model)
    for loops in group_repeats(split_by_kind(data_sets)[0]):
        overtones = harmonics(evidence, loops)[_OVERTONES:]
        order = 2 + np.arange(len(overtones)) // 2
        columns = np.concatenate((columns, overtones / order[:, None]))
    unit = np.zeros((len(columns), share.shape[-1]), dtype=complex)
    unit[: len(share)] = share
    return Group(columns, unit, together=True)
