"""Covariance of fitted parameters, and the widths of their confidence intervals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.special import chdtri, stdtrit

from bushfit.effects.contract import Array

#: Half width of a 95 % interval [standard deviations] of a normal quantity whose standard deviation is known.
Z95 = 1.959963984540054
#: Maximum degrees of freedom: here Student's t equals the normal distribution to a millionth.
_MOST_FREEDOM = 1e6
#: Minimum degrees of freedom: with fewer, Student's t has no variance and the interval is useless.
_LEAST_FREEDOM = 2.0


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance matrix of parameter values in their SI units, and the uncertainty of the matrix.

    Args:
        names: names of the k parameters.
        matrix: covariance matrix, (k, k).
        spread: changes of the matrix if an estimated noise variance rises by its standard error, one (k, k) matrix per
            variance.

    >>> known = Covariance(("mu", "m"), np.array([[4.0, 3.0], [3.0, 9.0]]))
    >>> known.stderr("m"), known.correlations(), round(known.half_widths["mu"], 2)
    (3.0, [('mu', 'm', 0.5)], 3.92)
    """

    names: tuple[str, ...] = ()
    matrix: Array = field(default_factory=lambda: np.empty((0, 0)))
    spread: tuple[Array, ...] = ()

    def stderr(self, name: str) -> float | None:
        """Standard error of a parameter [its SI unit]; None if the parameter was fixed at an exact value."""
        if name not in self.names:
            return None
        i = self.names.index(name)
        return float(np.sqrt(self.matrix[i, i]))

    @cached_property
    def root(self) -> Array:
        """Square root of the covariance: matrix B with B B^T equal to the covariance, (k, k).

        Notes: |B^T slope| is the standard error of a quantity whose derivatives with respect to the parameters are
        `slope`, (k,). Unlike sqrt(slope^T C slope), it is never the root of a negative number for an ill-conditioned
        covariance C.
        """
        sigma = np.sqrt(np.diag(self.matrix))
        safe = np.where(sigma > 0.0, sigma, 1.0)
        values, vectors = np.linalg.eigh(self.matrix / np.outer(safe, safe))
        return sigma[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))

    def half_width(self, slopes: Array) -> Array:
        """Half widths of the 95 % intervals of n quantities, (n,), by Student's t.

        Args:
            slopes: derivatives of each quantity with respect to each parameter, (k, n).
        """
        return stdtrit(self.freedom(slopes), 0.975) * np.linalg.norm(self.root.T @ slopes, axis=0)

    @cached_property
    def half_widths(self) -> dict[str, float]:
        """Half width of the 95 % interval of each parameter [its SI unit], by name."""
        return dict(zip(self.names, self.half_width(np.eye(len(self.names))).tolist(), strict=True))

    def describe_unknown(self, values: Mapping[str, float]) -> str:
        """Sentence that names the parameters whose 95 % half-width is at least their value; "" if there are none.

        Parameters of the effect `preload` are coefficients of one curve and have no meaning alone. The effect is named
        if all of them may be zero.
        """
        curve = {name: values[name] for name in self.names if name.startswith("preload.")}
        names = [name for name in self.names if name not in curve and self.half_widths[name] >= abs(values[name])]
        names += ["preload"] * (bool(curve) and self.may_be_zero(curve))
        unknown = ", ".join(names)
        return unknown and f"the tests do not determine {unknown} (95 % interval of ±100 % or more)"

    def may_be_zero(self, values: Mapping[str, float]) -> bool:
        """True if the estimates of some parameters [SI] do not differ from zero together, by Wald's test at 95 %."""
        part = self.select([*values])
        deviations = np.linalg.lstsq(part.root, np.array([values[name] for name in part.names]))[0]
        return bool(deviations @ deviations <= chdtri(len(part.names), 0.05))

    def freedom(self, slopes: Array) -> Array:
        """Effective degrees of freedom of the variances of n quantities, (n,), for Student's t.

        Args:
            slopes: derivatives of each quantity with respect to each parameter, (k, n).

        Notes: by Satterthwaite (1946), 2 v^2/var(v), where v is the variance of the quantity and var(v) the variance of
        the estimated v: the sum of the squared changes of v over the matrices in `spread`.
        """
        variance = np.sum(np.square(self.root.T @ slopes), axis=0)
        changes = [np.sum(slopes * (part @ slopes), axis=0) for part in self.spread]
        unsure = np.sqrt(np.sum(np.square(changes), axis=0)) if changes else np.zeros_like(variance)
        smallest = np.sqrt(2.0 / _MOST_FREEDOM)
        share = np.divide(unsure, variance, out=np.zeros_like(variance), where=variance > 0.0)
        return np.maximum(2.0 / np.square(np.maximum(share, smallest)), _LEAST_FREEDOM)

    def correlations(self) -> list[tuple[str, str, float]]:
        """Names and correlation (-1 to 1) of every pair of parameters, the largest magnitude first."""
        sigma = np.sqrt(np.diag(self.matrix))
        pairs = [
            (self.names[i], self.names[j], float(self.matrix[i, j] / (sigma[i] * sigma[j])))
            for i, j in combinations(np.flatnonzero(sigma), 2)
        ]
        return sorted(pairs, key=lambda pair: -abs(pair[2]))

    def with_independent(self, names: tuple[str, ...], deviation: float) -> "Covariance":
        """Add parameters with equal standard deviation [their SI unit] that are independent of all others."""
        variance, padding = np.diag([0.0] * len(self.names) + [deviation**2] * len(names)), (0, len(names))
        spread = tuple(np.pad(part, padding) for part in self.spread)
        return Covariance((*self.names, *names), np.pad(self.matrix, padding) + variance, spread)

    def select(self, names: Sequence[str]) -> "Covariance":
        """Covariance of the named parameters only, in the order of this covariance; unknown names are ignored."""
        indices = [i for i, name in enumerate(self.names) if name in names]
        square = np.ix_(indices, indices)
        names = tuple(self.names[i] for i in indices)
        return Covariance(names, self.matrix[square], tuple(part[square] for part in self.spread))
