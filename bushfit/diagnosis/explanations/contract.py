"""Explanation of a gap: a name, a prior probability, and columns with a prior."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from bushfit.diagnosis.linear_model import Group
from bushfit.diagnosis.propose import Proposal
from bushfit.effects.contract import Array
from bushfit.geometry import Place


@dataclass(frozen=True, eq=False)
class Explanation:
    """One explanation of a gap.

    Args:
        kind: "effect", "place", "unnamed" or "record"; each kind has a prior probability.
        family: group that shares the prior probability: an effect in all places, or a kind of place.
        name: name of the explanation.
        group: its columns in the residuals; None for an effect that replaces a branch, which has to be refitted.
    """

    kind: str
    family: str
    name: str
    group: Group | None


@dataclass(frozen=True, eq=False)
class MissingEffect(Explanation):
    """An effect of the library with its score before any refit."""

    proposal: Proposal


@dataclass(frozen=True, eq=False)
class FaultyPlace(Explanation):
    """Points of the tests that deviate together.

    Args:
        direction: direction of the first test.
        frequency: lowest and highest [Hz].
        amplitude: lowest and highest, zero-to-peak [m or rad].
        extreme: True for the smallest or largest level of its direction, where a law of amplitude does the same.
    """

    direction: Place
    frequency: tuple[float, float]
    amplitude: tuple[float, float]
    extreme: bool = field(default=False, kw_only=True)

    @property
    def columns(self) -> Array:
        """Whitened residuals that a unit deviation of each kind makes, (c, n)."""
        assert self.group is not None
        return self.group.whole

    @property
    def freely(self) -> "FaultyPlace":
        """The place with an independent error of every point, for faults other than a shift or a slope."""
        if self.family == "loop":
            return self
        size = np.abs(self.columns).max(axis=0)
        rows = np.flatnonzero(size)
        columns = np.zeros((rows.size, size.size))
        columns[np.arange(rows.size), rows] = size[rows]
        return replace(self, group=Group(columns, np.eye(rows.size), together=True))

    def distance(self, residual: Array) -> float:
        """Root mean square deviation along the columns of the place, in units of noise, from residuals (n,)."""
        columns = self.columns
        amounts = columns @ residual / np.maximum(np.linalg.norm(columns, axis=1), 1e-300)
        return float(np.sqrt(np.mean(amounts**2)))


def is_pattern(places: Sequence[FaultyPlace]) -> bool:
    """True if places together may be physics: several frequencies, as of a resonance or a ripple, or a level at an end
    of the range, as of a contact or a law of amplitude."""
    return sum(place.family == "frequency" for place in places) > 1 or any(place.extreme for place in places)
