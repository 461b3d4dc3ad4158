"""Groups of residual changes that one explanation of a gap would cause, and the evidence of the tests for them."""

from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array

#: Relative change of |K| per unit amount below which the tests do not show a column.
_UNSEEN = 1e-9


@dataclass(frozen=True, eq=False)
class Group:
    """Changes of the residuals that one explanation of a gap would cause: c columns with Gaussian amounts.

    Args:
        columns: change of the n whitened residuals per unit amount of each column, (c, n).
        unit: relative change of |K| per unit amount of each column, (c,); complex, at p operating points, (c, p), if
            `act_together`.
        act_together: True if all columns act at once with independent amounts of one prior size; False if exactly one
            column acts, each with equal probability.
        sign: +1 if only positive amounts are possible (only without `act_together`); else 0.
        covered_rows: slice of the residuals that `columns` covers, and the number of all residuals; None for all.
    """

    columns: Array
    unit: Array
    act_together: bool
    sign: int = 0
    covered_rows: tuple[slice, int] | None = None

    @property
    def whole(self) -> Array:
        """Changes of all n residuals per unit amount of each column, (c, n)."""
        if self.covered_rows is None:
            return self.columns
        rows, count = self.covered_rows
        whole = np.zeros((len(self.columns), count))
        whole[:, rows] = self.columns
        return whole

    @property
    def scaled(self) -> Array:
        """Changes of all n residuals for the c columns, scaled for the prior of their amounts, (c, n).

        If the columns are alternatives, each is divided by its change of |K|, so that an amount of 1 changes |K| by
        100 %, and is zero if it does not change |K|. Columns that act together are not scaled.
        """
        if self.act_together:
            return self.whole
        visible = self.unit > _UNSEEN
        return self.whole * np.where(visible, 1.0 / np.where(visible, self.unit, 1.0), 0.0)[:, None]


@dataclass(frozen=True, eq=False)
class GroupEvidence:
    """Evidence of the tests for one explanation of a gap.

    Args:
        log_evidence: natural log of the marginal likelihood of the tests with the explanation, averaged over the sizes
            of its amounts and of the rig's errors.
        size: relative change of |K| due to the explanation, root mean square over the posterior.
        likeliest: most probable prior standard deviation of the amounts, relative to |K|, one of `priors.SIZES`.
        with_compound: evidence for the explanation together with a smooth deviation of the rubber from the model's
            laws; None if no such deviation is considered.
    """

    log_evidence: float
    size: float
    likeliest: float
    with_compound: "GroupEvidence | None" = None

    @property
    def total(self) -> float:
        """Natural log of the marginal likelihood, summed over compounds with and without a deviation."""
        if self.with_compound is None:
            return self.log_evidence
        return float(np.logaddexp(self.log_evidence, self.with_compound.log_evidence))
