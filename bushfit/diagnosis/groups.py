"""Groups of residual columns with a prior, and the evidence of the tests for them."""

from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array

#: Change of |K| by a unit of an amount, below which the tests do not see it.
_UNSEEN = 1e-9


@dataclass(frozen=True, eq=False)
class Group:
    """Columns with a Gaussian prior, whose amounts are relative to |K|.

    Args:
        columns: whitened residuals of a unit of each amount, (c, n).
        unit: share of |K| that a unit changes, (c,); of columns that move together complex at some points, (c, p).
        together: True if the amounts are independent and of one size; else one column is chosen, each as likely.
        sense: +1 where only positive amounts make sense, of columns of which one is chosen.
        among: the rows that the columns have, and the number of all rows, where they have not all of them.
    """

    columns: Array
    unit: Array
    together: bool
    sense: int = 0
    among: tuple[slice, int] | None = None

    @property
    def whole(self) -> Array:
        """The columns over all rows, (c, n)."""
        if self.among is None:
            return self.columns
        rows, count = self.among
        whole = np.zeros((len(self.columns), count))
        whole[:, rows] = self.columns
        return whole

    @property
    def scaled(self) -> Array:
        """The columns over all rows, each of a unit of relative change where one of them is chosen, (c, n)."""
        if self.together:
            return self.whole
        visible = self.unit > _UNSEEN
        return self.whole * np.where(visible, 1.0 / np.where(visible, self.unit, 1.0), 0.0)[:, None]


@dataclass(frozen=True, eq=False)
class GroupEvidence:
    """Evidence of the tests for a group of columns.

    Args:
        log_evidence: of the tests with the group, over all sizes and nodes.
        size: relative change of |K| by the group, root mean square over its posterior.
        likeliest: the size at which the tests are likeliest.
        beside: the same beside a deviation of the compound; None without.
    """

    log_evidence: float
    size: float
    likeliest: float
    beside: "GroupEvidence | None" = None

    @property
    def total(self) -> float:
        """Log evidence, with a deviation of the compound and without."""
        if self.beside is None:
            return self.log_evidence
        return float(np.logaddexp(self.log_evidence, self.beside.log_evidence))
