"""Marginal likelihood of the tests under each explanation of a gap.

Notes:
    Around a fitted model the whitened residuals are r = noise + W e + J p + D d + U a: errors e of the rig, independent
    and of unit variance times a size that is not known; parameters p, with a flat prior or one of known precision; a
    deviation d of the compound from the model's laws, of size s; and amounts a of what may be missing. With S the
    covariance of noise and rig and the parameters projected out, P = S^-1 - S^-1 J (J^T S^-1 J)^-1 J^T S^-1, the
    logarithm of the restricted likelihood is -(r^T P r + ln|S| + ln|J^T S^-1 J|)/2 but for a constant (Patterson and
    Thompson, 1971). Amounts of variance v^2 along columns U add, with the eigenvalues l of U^T P U and the components b
    of U^T P r along its eigenvectors, sum (v^2 b^2/(1 + v^2 l) - ln(1 + v^2 l))/2. One decomposition of D^T P D gives
    the same for every size s of the deviation. Sizes of the rig's errors, of the deviation and of amounts are summed
    over cases with weights of a prior. Only inner products of rows enter; errors of the rig stay within blocks of rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtrc, softmax

from bushfit.diagnosis.evidence import Evidence, block_gains, largest_gain, mean_evidence, posterior
from bushfit.diagnosis.explanations import Signature
from bushfit.diagnosis.projected_columns import Batch, CompoundDeviation, RigRows, SignatureSet
from bushfit.diagnosis.rig_errors import RigErrors
from bushfit.effects.contract import Array

#: Information added to each parameter, relative to its own, so that undetermined parameters leave it an inverse.
_ROUNDING = 1e-9
#: Posterior weight of a noise case below which it changes no mean: rounding.
_NEGLIGIBLE = 1e-15


@dataclass(frozen=True, eq=False)
class Projection:
    """Residuals from which changes by parameters and by the rubber's smooth deviation are removed, for c noise cases.

    A noise case is one combination of assumed sizes of the rig's errors and of the deviation. P is the inverse
    covariance of the residuals in a noise case with the parameters projected out, see the notes of the module.

    Args:
        rows: the residual, then its derivatives with respect to the k parameters, (1 + k, n).
        compound: smooth deviation of the rubber from the model's laws, with q modes.
        cases: indices of the noise cases among those of the rig, (c,).
        base: natural log of the prior weight of each case times the marginal likelihood of the tests if nothing
            further is missing, (c,).
        misfit: squared norm r^T P r of the residuals r that remain, (c,).
        deviation: posterior mean of the amounts of the q modes of the compound's deviation, (c, q).
        modes: inner products of the modes with the rows, (c, q, 1 + k), each times the square root of the posterior
            variance of the mode's amount without parameters; and this root, (c, q).
        root: Cholesky factor of the scaled information on the parameters, (c, k, k), and the scale, (k,).
        free: components of the residual along the parameters, (c, k).
    """

    rows: RigRows
    compound: CompoundDeviation
    cases: Array
    base: Array
    misfit: Array
    deviation: Array
    modes: tuple[Array, Array]
    root: tuple[Array, Array]
    free: Array

    def products(self, signatures: SignatureSet) -> Iterator[tuple[Batch, Array, Array]]:
        """Yield inner products U^T P r and U^T P U of the residuals r and the residual changes U of explanations.

        Args:
            signatures: residual changes per unit amount of several explanations, in blocks that act together.

        Yields:
            For each batch of blocks (sets of `width` columns that act together): the batch; U^T P r, (c, blocks,
            width); and U^T P U, (c, blocks, width, width).
        """
        used, index = np.unique(self.rows.rig.combinations[1][self.cases], return_inverse=True)
        (modes, spread), (root, scale) = self.modes, self.root
        smooth = spread[..., None] * signatures.with_modes(self.compound, used)[index]
        products = self.rows.inner(signatures.rows, used)[index] - modes.swapaxes(1, 2) @ smooth
        free = np.linalg.solve(root, products[:, 1:] / scale[:, None])
        projections = products[:, 0] - np.einsum("ck,ckg->cg", self.free, free)
        absorbed = np.concatenate((smooth, free), axis=1).swapaxes(1, 2)  # (c, columns, q + k)
        for batch, in_block in zip(signatures.batches, signatures.within(used), strict=True):
            of_blocks = absorbed[:, batch.columns]
            gram = in_block[index] - of_blocks @ of_blocks.swapaxes(-1, -2)
            yield batch, projections[:, batch.columns], gram


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Linearised residuals of a fitted model, from which the evidence for each further explanation is computed.

    A log evidence is the natural log of the marginal likelihood, up to a common constant, averaged over noise cases:
    combinations of assumed sizes of the rig's errors and of the rubber's smooth deviation from the model's laws.

    Args:
        residual: residuals in units of the scatter from point to point, (n,).
        jacobian: derivatives of the residuals with respect to the parameters and the deviations of faulty parts, (k,
            n).
        precision: prior precision of each row of the Jacobian, 0 for a flat prior, (k,).
        rig: errors of the rig. Each of its noise cases assumes a size of these errors and of the compound's deviation
            from the model's laws.
        compound: deviation of the compound, part of every hypothesis; None without a deviation.
    """

    residual: Array
    jacobian: Array
    precision: Array
    rig: RigErrors
    compound: CompoundDeviation | None = None

    @cached_property
    def rows(self) -> RigRows:
        """Residual, then its derivatives with respect to the k parameters, (1 + k, n)."""
        return RigRows(np.concatenate([self.residual[None], self.jacobian]), self.rig)

    @cached_property
    def cases(self) -> Array:
        """Indices of the c noise cases (assumed sizes of the errors of rig and rubber) that apply here, (c,)."""
        return np.flatnonzero((self.rig.deviation == 0.0) | (self.compound is not None))

    def project(self, cases: Array) -> Projection:
        """Project the parameters and the rubber's deviation out of the residuals.

        Args:
            cases: indices of c noise cases (assumed sizes of the errors of rig and rubber), (c,).

        Returns:
            Log evidence without a further explanation in each case, and the projected residuals, to test explanations.
        """
        rig, rows, deviates = self.rig, self.rows, bool(self.rig.deviation[cases].any())
        none = Signature(np.zeros((0, self.residual.size)), np.zeros((0, 1)), act_together=True)
        compound = self.compound if self.compound and deviates else CompoundDeviation(none, rig)
        combinations = rig.combinations[1][cases]
        used, index = np.unique(combinations, return_inverse=True)
        variance = np.square(rig.deviation[cases])[:, None]
        grown = 1.0 + variance * compound.modes[0][combinations]
        spread = np.sqrt(variance / grown)
        modes = spread[..., None] * compound.inner(rows, used)[index]
        gram = rows.inner(rows, used)[index] - modes.swapaxes(1, 2) @ modes
        # scaled to a diagonal of nearly 1, and invertible
        squares = np.einsum("kn,kn->k", self.jacobian, self.jacobian) + self.precision
        scale = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
        information = (gram[:, 1:, 1:] + np.diag(self.precision)) / np.outer(scale, scale)
        root = np.linalg.cholesky(information + _ROUNDING * np.eye(scale.size))
        free = np.linalg.solve(root, gram[:, 1:, :1] / scale[:, None])
        misfit = gram[:, 0, 0] - np.sum(np.square(free[..., 0]), axis=1)
        parameters = np.linalg.solve(root.swapaxes(1, 2), free) / scale[:, None]
        deviation = spread * (modes[..., 0] - (modes[..., 1:] @ parameters)[..., 0])
        log_det = rig.kernels[1][combinations] + np.sum(np.log(grown), axis=1)
        log_det += 2.0 * np.sum(np.log(np.einsum("ckk->ck", root) * scale), axis=1)
        log_det -= np.sum(np.log(self.precision[self.precision > 0.0]))
        base = rig.log_weight[cases] - 0.5 * (misfit + log_det)
        of_modes, factor = (modes, spread), (root, scale)
        return Projection(rows, compound, cases, base, misfit, deviation, of_modes, factor, free[..., 0])

    @cached_property
    def evidence_by_case(self) -> tuple[Array, Array, Array]:
        """Evidence of the tests for the fitted model with nothing further missing, in each of c noise cases.

        Returns:
            Natural log of the prior weight of the case times the marginal likelihood, (c,); squared norm of the
            projected residuals, (c,); and posterior mean amounts of the q modes of the rubber's deviation, (c, q).
        """
        projection = self.project(self.cases)
        return projection.base, projection.misfit, projection.deviation

    def explanation_evidence(self, sets: Sequence[SignatureSet], cases: Array | None = None) -> list[Evidence]:
        """Evidence of the tests for each of several explanations, with rig errors within the stated accuracy.

        Args:
            sets: signatures (residual changes) of the explanations, in sets that change the same residuals.
            cases: indices of the noise cases (assumed sizes of the errors of rig and rubber) to average over; None for
                all.

        Returns:
            Evidence of each explanation of the first set, then of the second, and so on.
        """
        projection = self.project(self.cases if cases is None else cases)
        plain, deviates = self.rig.is_plain[projection.cases], self.rig.deviation[projection.cases] > 0.0
        evidence = list[Evidence]()
        for signatures in sets:
            by_signature = dict[int, Evidence]()
            for batch, projections, gram in projection.products(signatures):
                gain, changes = block_gains(batch, projections, gram)
                sums, owners = projection.base[:, None, None] + gain, batch.signatures
                alone, bent = (mean_evidence(owners, sums[mask], changes[mask]) for mask in (plain, deviates))
                deviating = bent if deviates.any() else dict.fromkeys(alone)
                by_signature |= {n: replace(x, with_compound=deviating[n]) for n, x in alone.items()}
            evidence += [by_signature[number] for number in range(len(signatures.signatures))]
        return evidence

    @cached_property
    def evidence(self) -> Evidence:
        """Evidence of the tests without a further explanation, with rig errors within the stated accuracy.

        If the rubber may deviate from the model, `size` and `likeliest` are those of the deviation, relative to |K|.
        """
        (base, _, amounts), deviation, with_compound = self.evidence_by_case, self.rig.deviation[self.cases], None
        if self.compound and (deviates := deviation > 0.0).any():
            log_evidence, sizes = float(np.logaddexp.reduce(base[deviates])), deviation[deviates]
            share = np.exp(base[deviates] - log_evidence)
            likeliest = max(np.unique(sizes), key=lambda size: share[sizes == size].sum())
            likely = np.flatnonzero(share > _NEGLIGIBLE)
            combinations = self.rig.combinations[1][self.cases][deviates]
            changes = self.compound.squared_changes(amounts[deviates][likely], combinations[likely])
            with_compound = Evidence(log_evidence, float(np.sqrt(share[likely] @ changes)), float(likeliest))
        plain = np.logaddexp.reduce(base[self.rig.is_plain[self.cases]])
        return Evidence(float(plain), 0.0, 0.0, with_compound)

    @property
    def log_evidence_with_level_errors(self) -> float:
        """Natural log of the tests' evidence if the rig's errors of whole levels may exceed its accuracy class.

        A level is the set of all points of a sweep at one constant amplitude or frequency.
        """
        wide = ~self.rig.is_plain & (self.rig.deviation == 0.0)
        return float(np.logaddexp.reduce(self.evidence_by_case[0][wide[self.cases]]))

    def likely_cases(self, curves: Sequence[SignatureSet], far: float) -> Array:
        """Select the noise cases (assumed sizes of the errors of rig and rubber) with a high evidence.

        Args:
            curves: residual changes of smooth curves, one of which may explain a gap.
            far: difference in log evidence from the best case beyond which a case is left out.

        Returns:
            Indices of the cases within `far` of the best case. A case without a deviation is also selected if a case
            with the same rig errors and a deviation, or the case with one of the curves, is within `far` of the best.
        """
        plain, index = self.rig.is_plain[self.cases], self.rig.combinations[1][self.cases]
        base = np.where(plain | (self.rig.deviation[self.cases] > 0.0), self.evidence_by_case[0], -np.inf)
        best = np.full(index.max() + 1, -np.inf)
        np.maximum.at(best, index, base)
        near = (base > base.max() - far) | (plain & (base > base[plain].max() - far))
        near |= plain & (best[index] > best.max() - far)
        if curves:
            projection = self.project(self.cases[plain])
            gains = [largest_gain(gram, b).max(axis=1) for curve in curves for _, b, gram in projection.products(curve)]
            with_curve = projection.base + np.max([np.zeros(len(projection.base)), *gains], axis=0)
            near[plain] |= with_curve > with_curve.max() - far
        return self.cases[near]

    def p_value(self, *, compound_deviates: bool = False) -> float:
        """Probability that tests of a complete model would have a larger misfit r^T P r than these tests.

        Args:
            compound_deviates: True to average over noise cases (sizes of the rig's errors) with a smooth deviation of
                the rubber; False over those without.

        Notes: a posterior predictive check (Gelman, Meng and Stern, 1996), averaged over noise cases by probability. r
        are the whitened residuals, and P projects out the parameters.
        """
        chosen = self.rig.deviation > 0.0 if compound_deviates else self.rig.is_plain
        base = np.where(chosen[self.cases], self.evidence_by_case[0], -np.inf)
        freedom = max(self.residual.size - int(np.count_nonzero(self.precision == 0.0)), 1)
        return float(np.exp(base - np.logaddexp.reduce(base)) @ chdtrc(freedom, self.evidence_by_case[1]))

    def posterior_parameters(self) -> tuple[Array, Array]:
        """Posterior of the changes of the k parameters from their fitted values, averaged over noise cases.

        Returns:
            Mean, (k,), and covariance within and between the noise cases, (k, k).
        """
        projection = self.project(self.cases)
        root, scale = projection.root
        inverse = np.linalg.inv(root) / scale
        is_possible = self.rig.is_plain[self.cases] | (self.rig.deviation[self.cases] > 0.0)
        share = softmax(np.where(is_possible, projection.base, -np.inf))
        means = np.einsum("cij,ci->cj", inverse, projection.free)
        mean = share @ means
        matrix = np.einsum("c,cji,cjk->ik", share, inverse, inverse)
        return -mean, matrix + np.einsum("c,ci,cj->ij", share, means - mean, means - mean)

    def posterior_amounts(self, signatures: SignatureSet, cases: Array) -> tuple[Array, Array]:
        """Posterior mean and covariance of the amounts (coefficients) of the g columns of each of b explanations.

        Args:
            signatures: residual changes of the explanations, each with g columns that act together.
            cases: indices of the noise cases, with rig errors within the stated accuracy.

        Returns:
            Mean, (b, g), and covariance, (b, g, g), averaged over all sizes of the amounts and of the rig's errors.
        """
        projection = self.project(cases)
        ((_, projections, gram),) = projection.products(signatures)
        gain, means, variances, vectors = posterior(gram, projections)
        share = softmax(gain + projection.base[:, None, None], axis=(0, 2))
        mean = np.einsum("nbs,nbsi->bi", share, means)
        spread = np.einsum("nbij,nbj,nbkj->bik", vectors, np.einsum("nbs,nbsj->nbj", share, variances), vectors)
        return mean, spread + np.einsum("nbs,nbsi,nbsj->bij", share, means - mean[:, None], means - mean[:, None])
