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

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import chdtrc, log_ndtr

from bushfit.diagnosis.explanations import Group
from bushfit.diagnosis.priors import SIZES
from bushfit.diagnosis.projected_columns import CompoundDeviation, GroupSet, RigRows
from bushfit.diagnosis.rig_errors import RigErrors
from bushfit.effects.contract import Array

#: Information added to each parameter, relative to its own, so that undetermined parameters leave it an inverse.
_ROUNDING = 1e-9
#: Posterior weight of a noise case below which it changes no mean: rounding.
_NEGLIGIBLE = 1e-15


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
    with_compound: GroupEvidence | None = None

    @property
    def total(self) -> float:
        """Natural log of the marginal likelihood, summed over compounds with and without a deviation."""
        if self.with_compound is None:
            return self.log_evidence
        return float(np.logaddexp(self.log_evidence, self.with_compound.log_evidence))


#: Largest prior size of an amount over a standard deviation that is nearly flat; it changes the amount by a permille.
_SMALL = 0.03


@dataclass(frozen=True, eq=False)
class Products:
    """Evidence without a further explanation, and inner products with P, in each noise case.

    P projects out the parameters and the compound's deviation, and whitens by the rig's errors. A block is a set of
    columns that act together; blocks are collected by their number of columns (width) for array operations.

    Args:
        base: natural log of the prior weight of the case times the evidence without a further explanation, (cases,).
        misfit: r^T P r of the residuals r, (cases,).
        deviation: posterior mean of the amounts of the q modes of the compound's deviation, (cases, q).
        projections: U^T P r of the blocks U, an array (cases, blocks, width) for each width.
        grams: U^T P U of the blocks U, an array (cases, blocks, width, width) for each width.
    """

    base: Array
    misfit: Array
    deviation: Array
    projections: list[Array]
    grams: list[Array]


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Linearised residuals of a fitted model, from which the evidence for each further explanation is computed.

    All log evidences are natural logs of the marginal likelihood, averaged over noise cases and up to a common
    constant. A noise case is one assumption on the sizes of the rig's errors and of the compound's deviation.

    Args:
        residual: residuals in units of the scatter from point to point, (n,).
        jacobian: derivatives of the residuals with respect to the parameters and the deviations of faulty parts, (k,
            n).
        precision: prior precision of each row of the Jacobian, 0 for a flat prior, (k,).
        rig: errors of the rig. Each of its noise cases assumes a size of these errors and of the compound's deviation
            from the model's laws.
        groups: candidate explanations; None without any.
        chosen_cases: indices of the noise cases to average over; None for all cases.
        compound: deviation of the compound, part of every hypothesis; None without a deviation.
    """

    residual: Array
    jacobian: Array
    precision: Array
    rig: RigErrors
    groups: GroupSet | None = None
    chosen_cases: Array | None = None
    compound: CompoundDeviation | None = None

    @cached_property
    def cases(self) -> Array:
        """Indices of the noise cases to average over; without `compound`, only cases without a deviation."""
        chosen = np.arange(len(self.rig.cases)) if self.chosen_cases is None else self.chosen_cases
        return np.array([n for n in chosen.tolist() if self.compound or not self.rig.cases[n].compound], dtype=int)

    @cached_property
    def deviations(self) -> Array:
        """Standard deviation of the compound's deviation from the model in each case, relative to |K|, (cases,)."""
        return np.array([self.rig.cases[n].compound for n in self.cases])

    @cached_property
    def combinations(self) -> Array:
        """Index of the combination of sizes of the rig's errors in each case, (cases,)."""
        return self.rig.combinations[1][self.cases]

    @cached_property
    def products(self) -> Products:
        """Evidence without a further explanation, and inner products, in each noise case."""
        rig, groups, has_prior = self.rig, self.groups, self.precision > 0.0
        first = RigRows(np.concatenate([self.residual[None], self.jacobian]), rig)
        none = Group(np.zeros((0, self.residual.size)), np.zeros((0, 1)), act_together=True)
        compound = self.compound or CompoundDeviation(none, rig)
        used, index = np.unique(self.combinations, return_inverse=True)
        gram, modes = first.inner(first, used), compound.inner(first, used)
        if groups:
            gram = np.concatenate((gram, first.inner(groups.rows, used)), axis=-1)
            modes = np.concatenate((modes, groups.with_modes(compound, used)), axis=-1)
        flat, modes = slice(1, len(first.rows)), modes[index]
        variance = np.square(self.deviations)[:, None]
        grown = 1.0 + variance * compound.modes[0][self.combinations]
        shrinkage = variance / grown  # of the products with each mode
        gram = gram[index] - (modes[..., : flat.stop] * shrinkage[..., None]).swapaxes(1, 2) @ modes
        scale, information = _scale_information(gram[:, flat, flat], self.jacobian, self.precision)
        root, others = np.linalg.cholesky(information), np.delete(gram, flat, axis=-1)  # of the residuals and groups
        free = np.linalg.solve(root, others[:, flat] / scale[:, None])
        residual = others[:, 0] - np.einsum("nk,nkc->nc", free[..., 0], free)
        parameters = np.linalg.solve(information, others[:, flat, :1] / scale[:, None])[..., 0] / scale
        deviation = shrinkage * (modes[..., 0] - np.einsum("nqk,nk->nq", modes[..., flat], parameters))
        log_det = rig.roots[1][self.combinations] + np.sum(np.log(grown), axis=1)
        log_det += 2.0 * np.sum(np.log(np.einsum("nkk->nk", root) * scale), axis=1)
        log_det -= np.sum(np.log(self.precision[has_prior]))
        projections, projected = [], []
        for (_, columns), products in zip(groups.blocks, groups.within(used), strict=True) if groups else ():
            absorbed = np.moveaxis(free[..., 1 + columns], 1, -1)  # (cases, blocks, width, k)
            smooth = np.moveaxis(modes[..., flat.stop + columns], 1, -1)
            products = products[index] - (smooth * shrinkage[:, None, None]) @ smooth.swapaxes(-1, -2)
            projected.append(products - absorbed @ absorbed.swapaxes(-1, -2))
            projections.append(residual[:, 1 + columns])
        base = np.array([rig.cases[n].log_weight for n in self.cases]) - 0.5 * (residual[:, 0] + log_det)
        return Products(base, residual[:, 0], deviation, projections, projected)

    @cached_property
    def _is_plain(self) -> Array:
        """Mask of the noise cases with rig errors within the stated accuracy and without compound deviation."""
        return np.array([not self.rig.cases[n].wide for n in self.cases]) & (self.deviations == 0.0)

    @cached_property
    def _gains(self) -> list[tuple[Array, Array]]:
        """Gain in log evidence and squared relative change of |K| of each group, for each prior size of its amounts.

        Returns:
            For each group, gain and squared change, (cases, blocks, sizes) each; a block is a set of columns that act
            together.
        """
        groups, blocks = (self.groups.groups, self.groups.blocks) if self.groups else ((), [])
        gains: list[list[tuple[Array, Array]]] = [[] for _ in groups]
        products = self.products
        for (numbers, _), projections, gram in zip(blocks, products.projections, products.grams, strict=True):
            units = [groups[number].unit if groups[number].act_together else np.eye(1) for number in numbers]
            senses = np.array([groups[number].sign for number in numbers])
            for number, gain, changes in zip(numbers, *_block_gains(gram, projections, units, senses), strict=True):
                gains[number].append((gain, changes))
        stacked = (zip(*blocks, strict=True) for blocks in gains)
        return [(np.stack(gain, axis=1), np.stack(changes, axis=1)) for gain, changes in stacked]

    @cached_property
    def group_evidence(self) -> list[GroupEvidence]:
        """Evidence of the tests for each explanation in `groups`, with rig errors within the stated accuracy."""
        deviates = self.deviations > 0.0
        return [
            self._over_cases(gains, self._is_plain, self._over_cases(gains, deviates) if deviates.any() else None)
            for gains in self._gains
        ]

    def _over_cases(
        self, gains: tuple[Array, Array], chosen: Array, with_compound: GroupEvidence | None = None
    ) -> GroupEvidence:
        """Average the evidence for one explanation over some noise cases.

        Args:
            gains: gain in log evidence, and squared relative change of |K|, (cases, blocks, sizes) each, see `_gains`.
            chosen: mask of the noise cases, (cases,).
            with_compound: evidence together with a compound deviation, copied to the result; None without it.
        """
        log_evidence = (self.products.base[:, None, None] + gains[0])[chosen]
        if not log_evidence.size:
            return GroupEvidence(-np.inf, 0.0, float(SIZES[0]), with_compound)
        total = _log_sum(log_evidence)
        share = np.exp(log_evidence - total)
        size = float(np.sqrt(np.sum(share * gains[1][chosen])))
        likeliest = float(SIZES[int(np.argmax(share.sum(axis=(0, 1))))])
        return GroupEvidence(total - float(np.log(log_evidence[0].size)), size, likeliest, with_compound)

    def group_evidence_of(self, sets: Sequence[GroupSet]) -> list[GroupEvidence]:
        """Evidence of the tests for the explanations in several sets, in the same order."""
        return [evidence for groups in sets for evidence in replace(self, groups=groups).group_evidence]

    @cached_property
    def evidence(self) -> GroupEvidence:
        """Evidence of the tests without a further explanation, with rig errors within the stated accuracy.

        With a deviation of the compound, `size` and `likeliest` are those of the deviation, relative to |K|.
        """
        base, deviates, with_compound = self.products.base, self.deviations > 0.0, None
        if self.compound and deviates.any():
            log_evidence, sizes = _log_sum(base[deviates]), self.deviations[deviates]
            share = np.exp(base[deviates] - log_evidence)
            likeliest = max(np.unique(sizes), key=lambda size: share[sizes == size].sum())
            likely = np.flatnonzero(share > _NEGLIGIBLE)
            amounts, combinations = (x[deviates][likely] for x in (self.products.deviation, self.combinations))
            size = float(np.sqrt(share[likely] @ self.compound.largest_changes(amounts, combinations)))
            with_compound = GroupEvidence(log_evidence, size, float(likeliest))
        return GroupEvidence(_log_sum(base[self._is_plain]), 0.0, 0.0, with_compound)

    @property
    def log_evidence_with_level_errors(self) -> float:
        """Natural log of the evidence if only rig errors of levels, see `priors.LEVELS`, exceed the stated accuracy."""
        return _log_sum(self.products.base[~self._is_plain & (self.deviations == 0.0)])

    def likely_cases(self, far: float) -> Array:
        """Select the noise cases (assumed sizes of rig errors and of the compound's deviation) with a high evidence.

        Args:
            far: difference in log evidence from the best case beyond which a case is left out.

        Returns:
            Indices of the cases within `far` of the best case. A case without a deviation is also selected if a case
            with the same rig errors and a deviation, or the case with one of `groups` added, is within `far` of the
            best.
        """
        plain, index = self._is_plain, self.combinations
        base = np.where(plain | (self.deviations > 0.0), self.products.base, -np.inf)
        best = np.full(index.max() + 1, -np.inf)
        np.maximum.at(best, index, base)
        near = (base > base.max() - far) | (plain & (base > base[plain].max() - far))
        with_group = np.max([base, *(self.products.base + gains.max(axis=(1, 2)) for gains, _ in self._gains)], axis=0)
        led = (best[index] > best.max() - far) | (with_group > with_group[plain].max() - far)
        return self.cases[near | (plain & led)]

    def p_value(self, *, compound_deviates: bool = False) -> float:
        """Probability that tests of a complete model would have a larger misfit r^T P r than these tests.

        Args:
            compound_deviates: True to average over noise cases with a deviation of the compound; False without one.

        Notes: a posterior predictive check (Gelman, Meng and Stern, 1996), averaged over noise cases by probability. r
        are the whitened residuals, and P projects out the parameters.
        """
        base = np.where(self.deviations > 0.0 if compound_deviates else self._is_plain, self.products.base, -np.inf)
        freedom = max(self.residual.size - int(np.count_nonzero(self.precision == 0.0)), 1)
        return float(np.exp(base - _log_sum(base)) @ chdtrc(freedom, self.products.misfit))

    def parameters(self, relaxation: Array) -> tuple[Array, Array]:
        """Posterior of the changes of the k rows of the Jacobian from the fit, averaged over the noise cases.

        Args:
            relaxation: change of the n residuals by a relaxation that is faster than the tests, (n,). A compound that
                deviates may have one, of any size in `priors.SIZES`.

        Returns:
            Mean, (k,), and covariance within and between the noise cases, (k, k).

        Notes: the amount of the relaxation has a nearly flat prior first. A prior of variance v^2 then multiplies the
        evidence by N(a; 0, c + v^2)/N(a; 0, c), where a is its estimate and c the variance of a (Savage and Dickey).
        """
        rows = np.concatenate((self.jacobian, relaxation[None]))
        groups = GroupSet((Group(rows, np.eye(len(rows)), act_together=True),), self.rig)
        alone = replace(self, jacobian=self.jacobian[:0], precision=self.precision[:0], groups=groups).products
        wide = np.append(self.precision, np.square(_SMALL / SIZES[-1]))
        scale, information = _scale_information(alone.grams[0][:, 0], rows, wide)
        covariance = np.linalg.inv(information) / np.outer(scale, scale)
        shift = np.einsum("nij,nj->ni", covariance, alone.projections[0][:, 0])
        amount, variance, along = shift[:, -1:], covariance[:, -1, -1:], covariance[:, :, -1]
        total = variance + np.square(SIZES) * (self.deviations > 0.0)[:, None]  # (cases, sizes)
        base = np.where(self._is_plain | (self.deviations > 0.0), self.products.base, -np.inf)
        gain = 0.5 * (np.log(variance / total) + np.square(amount) * (1.0 / variance - 1.0 / total))
        share = np.exp(base[:, None] + gain - _log_sum(base[:, None] + gain))
        means = shift[:, None] - along[:, None] * (amount / total)[..., None]
        mean = np.einsum("ns,nsi->i", share, means)
        matrix = np.einsum("n,nij->ij", share.sum(axis=1), covariance)
        matrix -= np.einsum("n,ni,nj->ij", np.sum(share / total, axis=1), along, along)
        matrix += np.einsum("ns,nsi,nsj->ij", share, means - mean, means - mean)
        return -mean[:-1], matrix[:-1, :-1]

    def amounts(self, number: int) -> tuple[Array, Array]:
        """Posterior mean and covariance of the amounts of a group whose g columns act together.

        Args:
            number: index of the group in `groups`.

        Returns:
            Mean, (g,), and covariance, (g, g), averaged over all sizes of the amounts and of the rig's errors.
        """
        width, block = next(
            (width, int(np.flatnonzero(numbers == number)[0]))
            for width, (numbers, _) in enumerate(self.groups.blocks if self.groups else ())
            if number in numbers
        )
        chosen, products = self._is_plain, self.products
        gain, means, variances, vectors = _posterior(
            products.grams[width][chosen, block], products.projections[width][chosen, block]
        )
        gain = gain + products.base[chosen, None]
        share = np.exp(gain - _log_sum(gain))
        mean = np.einsum("ns,nsi->i", share, means)
        spread = np.einsum("nij,nj,nkj->ik", vectors, np.einsum("ns,nsj->nj", share, variances), vectors)
        return mean, spread + np.einsum("ns,nsi,nsj->ij", share, means - mean, means - mean)


def _scale_information(grams: Array, rows: Array, precision: Array) -> tuple[Array, Array]:
    """Scale the information on k parameters to a diagonal near 1, and make it invertible.

    Args:
        grams: inner products of the rows in each noise case, (cases, k, k).
        rows: derivatives of the residuals with respect to the parameters, (k, n).
        precision: prior precision of each parameter, (k,).

    Returns:
        Scale of each parameter, (k,), and the scaled information, (cases, k, k).
    """
    scale = np.sqrt(np.maximum(np.einsum("kn,kn->k", rows, rows) + precision, np.finfo(float).tiny))
    return scale, (grams + np.diag(precision)) / np.outer(scale, scale) + _ROUNDING * np.eye(scale.size)


def _log_sum(values: Array) -> float:
    """Natural log of the sum of exp(values); far faster than `scipy.special.logsumexp` for short arrays."""
    peak = values.max()
    return float(peak + np.log(np.sum(np.exp(values - peak))))


def _posterior(gram: Array, projections: Array) -> tuple[Array, Array, Array, Array]:
    """Posterior of the amounts of columns that act together, for each prior size in `priors.SIZES`.

    Args:
        gram: inner products U^T P U of the columns, (..., width, width).
        projections: inner products U^T P r with the residuals, (..., width).

    Returns:
        Gain in log evidence, (..., sizes); mean amounts, (..., sizes, width); variances along the eigenvectors of
        `gram`, (..., sizes, width); and these eigenvectors, (..., width, width).
    """
    values, vectors = (gram[..., 0], np.ones_like(gram)) if gram.shape[-1] == 1 else np.linalg.eigh(gram)
    projections = np.einsum("...ij,...i->...j", vectors, projections)[..., None, :]
    prior_variance = np.square(SIZES)[:, None]
    grown = 1.0 + prior_variance * np.maximum(values, 0.0)[..., None, :]
    variances = prior_variance / grown
    gain = 0.5 * np.sum(prior_variance * projections**2 / grown - np.log(grown), axis=-1)
    return gain, -(prior_variance * projections / grown) @ vectors.swapaxes(-1, -2), variances, vectors


def _block_gains(gram: Array, projections: Array, units: Sequence[Array], senses: Array) -> tuple[Array, Array]:
    """Gains in log evidence and squared relative changes of |K| for blocks of columns that act together.

    Args:
        gram: inner products U^T P U within the blocks, (cases, blocks, width, width).
        projections: inner products U^T P r with the residuals, (cases, blocks, width).
        units: relative change of |K| per unit amount at p operating points, (width, p) for each block.
        senses: +1 for a block of one column whose amount must be positive, else 0, (blocks,).

    Returns:
        Gains and squared changes for each of `priors.SIZES`, (blocks, cases, sizes) each.
    """
    gain, amounts, variances, _ = _posterior(gram, projections)
    if senses.any():
        standardised = senses[:, None] * (amounts / np.sqrt(variances))[..., 0]
        gain = np.where(senses[:, None] != 0, gain + np.log(2.0) + log_ndtr(standardised), gain)
    if gram.shape[-1] == 1:
        changes = np.square(amounts[..., 0] * np.array([np.abs(unit).max() for unit in units])[:, None])
    else:
        changes = np.stack(
            [np.square(np.abs(amounts[:, block] @ unit)).max(axis=-1) for block, unit in enumerate(units)], axis=1
        )
    return gain.swapaxes(0, 1), changes.swapaxes(0, 1)
