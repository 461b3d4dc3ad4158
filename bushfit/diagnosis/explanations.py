"""Explanations of a gap between model and tests, each with the residual changes that it would cause."""

from dataclasses import dataclass

import numpy as np

from bushfit.effects.contract import Array

#: Relative change of |K| per unit amount below which the tests do not show a column.
_UNSEEN = 1e-9


@dataclass(frozen=True, eq=False)
class Signature:
    """Signature of an explanation: the changes of the residuals that it would cause, per unit of unknown amounts.

    Args:
        columns: change of the n whitened residuals per unit of each of c amounts (coefficients), (c, n).
        stiffness_change: relative change of the stiffness per unit amount of each column: the largest magnitude over
            the tests, (c,); if `act_together`, the complex change at p operating points, (c, p).
        act_together: True if all columns act at once, with independent amounts of the same prior standard deviation;
            False if only one column acts, each with equal probability.
        sign: +1 if only positive amounts are possible (only without `act_together`); else 0.
        covered_rows: slice of the residuals that `columns` changes, and the number of all residuals; None if `columns`
            has all.
    """

    columns: Array
    stiffness_change: Array
    act_together: bool
    sign: int = 0
    covered_rows: tuple[slice, int] | None = None

    @property
    def rows(self) -> slice:
        """Slice of the residuals that `columns` changes."""
        return self.covered_rows[0] if self.covered_rows else slice(0, self.columns.shape[1])

    @property
    def whole(self) -> Array:
        """Columns over all n residuals, (c, n): `columns` in the covered rows, and 0 in the other rows."""
        if self.covered_rows is None:
            return self.columns
        rows, count = self.covered_rows
        whole = np.zeros((len(self.columns), count))
        whole[:, rows] = self.columns
        return whole

    @property
    def scaled(self) -> Array:
        """Changes of the residuals in `rows` by each column, scaled so that one prior suits all amounts, (c, rows).

        If only one of the columns acts, each is divided by its relative change of |K|: an amount of 1 then changes |K|
        by 100 %. A column that does not change |K| becomes zero. Columns that act together are not scaled.
        """
        if self.act_together:
            return self.columns
        visible = self.stiffness_change > _UNSEEN
        return self.columns * np.where(visible, 1.0 / np.where(visible, self.stiffness_change, 1.0), 0.0)[:, None]


@dataclass(frozen=True, eq=False)
class Explanation:
    """Possible explanation of a gap between model and tests, with the changes of the residuals that it would cause.

    Args:
        kind: "effect", "part" (faulty part of the tests), "unnamed" (smooth curve) or "record" (recording mistake).
            Each kind has a prior probability, which is divided among its families.
        family: name common to explanations that share one prior probability: an effect (whatever its direction), or a
            kind of faulty part.
        name: name of the explanation.
        signature: changes of the residuals that the explanation would cause; None for an effect that replaces a branch
            of the model and therefore needs a refit.
    """

    kind: str
    family: str
    name: str
    signature: Signature | None
