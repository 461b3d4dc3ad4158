"""What every explanation of a gap has: a name, a share of the odds, and columns with a prior."""

from dataclasses import dataclass

from bushfit.diagnosis.currency import Group
from bushfit.diagnosis.propose import Proposal
from bushfit.effects.contract import Array
from bushfit.fitting.data_set import Suspect


@dataclass(frozen=True, eq=False)
class Explanation:
    """One thing that may be missing.

    Args:
        kind: "effect", "place", "unnamed" or "record", by which it has odds.
        family: within which it shares them: an effect without its place, a kind of place.
        name: its own.
        group: what it does to the residuals; of an effect that replaces a branch none, its refit tells.
        proposal: of an effect.
        suspect: of a place.
    """

    kind: str
    family: str
    name: str
    group: Group | None
    proposal: Proposal | None = None
    suspect: Suspect | None = None

    @property
    def columns(self) -> Array:
        """Of its group."""
        if self.group is None:
            raise ValueError(f"{self.name} has no columns")
        return self.group.columns
