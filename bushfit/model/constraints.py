"""Constraints of a model's parameters that do not come from its tests: priors from earlier knowledge."""

from collections.abc import Sequence
from dataclasses import dataclass

from bushfit.effects.contract import Array


@dataclass(frozen=True, eq=False)
class Prior:
    """Normal distribution of parameters known before the tests, such as from an earlier campaign.

    Args:
        names: names of the k parameters.
        mean: values [SI] by the earlier knowledge, (k,).
        covariance: covariance of the errors of these values [SI], (k, k), positive definite.
        source: earlier knowledge as the user stated it, such as "0.24 +- 0.03".
    """

    names: tuple[str, ...]
    mean: Array
    covariance: Array
    source: str


@dataclass(frozen=True, eq=False)
class Constraints:
    """Constraints that hold in every fit of a model.

    Args:
        priors: independent priors of parameters; a prior applies to those of its parameters that a model has.
    """

    priors: Sequence[Prior] = ()


#: Constraints of a model that only its tests determine.
UNCONSTRAINED = Constraints()
