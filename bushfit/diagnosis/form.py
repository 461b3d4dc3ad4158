"""Has what was named the form of its law? Each effect grows with frequency and amplitude in a way of its own.

Notes:
    What an effect does to the stiffness, D, is let bend by small amounts a: D (1 + a1 i + (a2 + a3 i) ln f/f0 +
    (a4 + a5 i) ln X/X0 + a6 in the first direction). That is the start of another phase, of other powers of frequency
    and amplitude, and of other shares of the directions. So few amounts show what drowns among all that is smooth: a
    square root of the rate in place of the rate.
"""

from collections.abc import Sequence

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.score_test import PATTERN_LEFT, ScoreTest
from bushfit.diagnosis.search import SAME
from bushfit.diagnosis.terms import Terms
from bushfit.effects.contract import Array


def other_form(evidence: Evidence, names: Sequence[str], level: float) -> str | None:
    """The effect, of those named, that the tests show with another form than its law has; None where none is.

    Args:
        evidence: a fitted model with these effects.
        level: probability with which noise alone bends none so far; to take a name back, the gain has to lie above
            that by as much as one candidate above another.
    """
    shapes = {name: columns for name in names if len(columns := _columns(evidence, name))}
    if not shapes:
        return None
    ends = np.cumsum([len(columns) for columns in shapes.values()])
    groups = [np.arange(end - len(columns), end) for end, columns in zip(ends, shapes.values(), strict=True)]
    test = ScoreTest(evidence, np.concatenate(list(shapes.values())), groups, PATTERN_LEFT)
    doubted = test.largest_by_chance(level) + SAME
    bent = [(gain, name) for gain, name in zip(test.gains(), shapes, strict=True) if gain > doubted]
    return max(bent)[1] if bent else None


def _columns(evidence: Evidence, name: str) -> Array:
    """What bending an effect does to the whitened residuals, (c, n)."""
    terms = Terms(evidence, "gain")
    if not terms.sensible:
        return np.empty((0, evidence.residual.size))
    without = evidence.model.without(name)
    plain = np.concatenate([data_set.noise_free(without).measured for data_set in terms.data_sets])
    share = (terms.stiffness - plain) / terms.unit(evidence.model)
    frequency, motion = (terms.points - terms.points.mean(axis=0)).T
    first = (terms.directions == terms.directions[0]).astype(float)
    weights = np.array([1j + 0.0 * frequency, frequency, 1j * frequency, motion, 1j * motion, first])
    return terms.columns(share * weights, evidence.model)
