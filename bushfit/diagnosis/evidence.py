"""Evidence of the tests for columns of residuals with unknown amounts, from their projected inner products.

The equations are in the notes of `linear_model`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_ndtr

from bushfit.diagnosis.priors import SIZES
from bushfit.diagnosis.projected_columns import Batch
from bushfit.effects.contract import Array


@dataclass(frozen=True, eq=False)
class Evidence:
    """Evidence of the tests for one explanation of a gap.

    Args:
        log_evidence: natural log of the marginal likelihood of the tests with the explanation, averaged over the sizes
            of its amounts and of the rig's errors.
        size: largest relative change of |K| due to the explanation, root mean square over the posterior.
        likeliest: most probable of seven prior standard deviations, 0.4 to 400 % of |K|, of the explanation's amounts.
        with_compound: evidence for the explanation together with a smooth deviation of the rubber from the model's
            laws; None if no such deviation is considered.
        share: posterior probability of the likeliest standard deviation.
    """

    log_evidence: float
    size: float
    likeliest: float
    with_compound: Evidence | None = None
    share: float = 1.0

    @property
    def total(self) -> float:
        """Natural log of the tests' evidence, summed over rubber with and without a smooth deviation."""
        if self.with_compound is None:
            return self.log_evidence
        return float(np.logaddexp(self.log_evidence, self.with_compound.log_evidence))


def posterior(gram: Array, projections: Array) -> tuple[Array, Array, Array, Array]:
    """Posterior of the amounts (coefficients) of residual changes that act together, for each of seven prior sizes.

    Args:
        gram: inner products U^T P U of the residual changes U per unit amount, as columns; P is the inverse covariance
            of the residuals r with the model's parameters projected out, (..., width, width).
        projections: inner products U^T P r of the columns with the residuals, (..., width).

    Returns:
        For normal amounts of each standard deviation in `priors.SIZES`, 0.4 to 400 % of |K|: increase of the log
        evidence by the columns, (..., sizes); mean amounts, (..., sizes, width); variances along the eigenvectors of
        `gram`, (..., sizes, width). Then these eigenvectors, (..., width, width).
    """
    if gram.shape[-1] == 1:
        values, vectors = gram[..., 0], np.ones_like(gram)
    else:
        try:
            values, vectors = np.linalg.eigh(gram)
        except np.linalg.LinAlgError:  # for many equal eigenvalues LAPACK may fail: use the other, equal triangle
            values, vectors = np.linalg.eigh(gram, UPLO="U")
    projections = np.einsum("...ij,...i->...j", vectors, projections)[..., None, :]
    prior_variance = np.square(SIZES)[:, None]
    grown = 1.0 + prior_variance * np.maximum(values, 0.0)[..., None, :]
    variances = prior_variance / grown
    gain = 0.5 * np.sum(prior_variance * projections**2 / grown - np.log(grown), axis=-1)
    return gain, -(prior_variance * projections / grown) @ vectors.swapaxes(-1, -2), variances, vectors


def largest_gain(gram: Array, projections: Array) -> Array:
    """Largest increase of the log evidence by residual changes that act together, over seven prior sizes of amounts.

    Args:
        gram: inner products U^T P U of the columns U, see `posterior`, (..., width, width).
        projections: inner products U^T P r with the residuals, (..., width).

    Returns:
        Largest increase over the standard deviations in `priors.SIZES`, 0.4 to 400 % of |K|, (...).

    Notes:
        The last row of the Cholesky factor of [[1 + v^2 U^T P U, v U^T P r], [., c]] has the squared norm v^2 r^T P U
        (1 + v^2 U^T P U)^-1 U^T P r. For many columns this is faster than the eigenvalues of `posterior`.
    """
    width, gains = gram.shape[-1], list[Array]()
    bordered = np.zeros((*gram.shape[:-2], width + 1, width + 1))
    for size in SIZES:
        bordered[..., :width, :width] = np.eye(width) + size**2 * gram
        bordered[..., width, :width] = size * projections  # only the lower triangle is read
        bordered[..., width, width] = 1.0 + size**2 * np.sum(np.square(projections), axis=-1)
        root = np.linalg.cholesky(bordered)
        explained = np.sum(np.square(root[..., width, :width]), axis=-1)
        diagonal = np.einsum("...ii->...i", root)[..., :width]
        gains.append(0.5 * explained - np.sum(np.log(diagonal), axis=-1))
    return np.asarray(np.max(gains, axis=0))


def block_gains(batch: Batch, projections: Array, gram: Array) -> tuple[Array, Array]:
    """Increase of log evidence, and squared relative change of |K|, by each block for each prior size of its amounts.

    Args:
        batch: blocks of columns that act together; an explanation may have several blocks, of which only one acts.
        projections: inner products U^T P r of the columns U of each block with the residuals r, (cases, blocks, width).
        gram: inner products U^T P U of the columns of each block, (cases, blocks, width, width).

    Returns:
        Increases and squared changes for each standard deviation in `priors.SIZES`, (cases, blocks, sizes) each.
    """
    gain, amounts, variances, _ = posterior(gram, projections)
    if (signs := batch.signs[:, None]).any():
        standardised = signs * (amounts / np.sqrt(variances))[..., 0]
        gain = np.where(signs != 0, gain + np.log(2.0) + log_ndtr(standardised), gain)
    return gain, np.square(np.abs(amounts @ batch.stiffness_change)).max(axis=-1)


def mean_evidence(signatures: Array, log_evidence: Array, changes: Array) -> dict[int, Evidence]:
    """Average the evidence of each explanation over noise cases, its alternative blocks and the sizes of its amounts.

    Args:
        signatures: index of the explanation of each block (columns that act together), ascending, (blocks,).
        log_evidence: natural log of prior weight times evidence, (cases, blocks, sizes).
        changes: squared relative change of |K|, (cases, blocks, sizes).

    Returns:
        Evidence by the index of the explanation.
    """
    first = np.flatnonzero(np.diff(signatures, prepend=-1))
    blocks = np.diff(first, append=len(signatures))
    highest = np.maximum.reduceat(np.max(log_evidence, axis=(0, 2), initial=-np.inf), first)
    share = np.exp(log_evidence - np.repeat(highest, blocks)[:, None])
    by_size = np.add.reduceat(share.sum(axis=0), first, axis=0)
    total = np.maximum(by_size.sum(axis=1), np.finfo(float).tiny)
    squares = np.add.reduceat(np.sum(share * changes, axis=(0, 2)), first) / total
    likeliest, share = SIZES[np.argmax(by_size, axis=1)], by_size.max(axis=1) / total
    values = (highest + np.log(total / (blocks * SIZES.size)), np.sqrt(squares), likeliest, share)
    rows = zip(signatures[first].tolist(), *(value.tolist() for value in values), strict=True)
    return {n: Evidence(log, size, likely, share=of_all) for n, log, size, likely, of_all in rows}
