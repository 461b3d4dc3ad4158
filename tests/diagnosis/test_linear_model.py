"""The evidence of signatures of columns is that of integrals done outright."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from rigged import SHARED
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, norm

from bushfit.diagnosis.explanations import Signature
from bushfit.diagnosis.linear_model import LinearModel
from bushfit.diagnosis.priors import SIZES
from bushfit.diagnosis.projected_columns import CompoundDeviation, SignatureSet
from bushfit.diagnosis.record import DiagnosisSettings
from bushfit.diagnosis.rig_errors import Block, NoiseCase, RigErrors
from bushfit.diagnosis.search import Search
from bushfit.effects import get_effect
from bushfit.effects.contract import Array
from bushfit.fitting.prepared_campaign import PreparedCampaign

#: Two errors of the rig within its class, and one of levels beyond it.
CASES = (
    NoiseCase(1.0, (0.5, 0.4), np.log(0.5)),
    NoiseCase(1.4, (2.0, 0.0), np.log(0.3)),
    NoiseCase(0.8, (1.0, 2.5), np.log(0.2), wide=True),
)


def ledger(seed: int, *, flat: int = 2, known: int = 1, rows: int = 10) -> tuple[LinearModel, SignatureSet]:
    """Random numbers of everything: two blocks of which one scatters, rows in none, rows with a variance of their own,
    and a signature of each sort."""
    random = np.random.default_rng(seed)
    blocks = (
        Block(np.array([6, 0, 3]), random.normal(size=(3, 3)), np.array([0, 1, 1]), scatters=True),
        Block(np.array([1, 4, 7, 5]), random.normal(size=(1, 4)), np.array([0]), scatters=False),
    )
    columns = 10.0 * random.normal(size=(9, rows))
    share = random.uniform(0.2, 2.0, size=9)
    made = (
        Signature(columns[:2], np.eye(2), act_together=True),
        Signature(columns[2:4], np.eye(2), act_together=True),
        Signature(columns[4:7], share[4:7], act_together=False),
        Signature(columns[7:9], share[7:9], act_together=False, sign=1),
        Signature(columns[:3], np.eye(3), act_together=True),
    )
    precision = np.repeat([0.0, 0.5], [flat, known])
    jacobian = random.normal(size=(flat + known, rows))
    rig = RigErrors(blocks, CASES, np.where(np.arange(rows) % 3, 0.0, 0.7))
    return LinearModel(3.0 * random.normal(size=rows), jacobian, precision, rig), SignatureSet(made, rig)


def covariance(of: LinearModel, node: NoiseCase) -> Array:
    """Of the residuals by noise, errors of the rig and parameters that are known, in full, (n, n)."""
    variance = np.ones(of.residual.size)
    whole = np.zeros((variance.size, variance.size))
    for block in of.rig.blocks:
        variance[block.rows] = node.scatter**2 if block.scatters else 1.0
        sized = np.array(node.errors)[block.kinds, None] * block.columns
        whole[np.ix_(block.rows, block.rows)] += sized.T @ sized
    known = of.precision > 0.0
    return (
        np.diag(variance + of.rig.variance) + whole + (of.jacobian[known].T / of.precision[known]) @ of.jacobian[known]
    )


def restricted(of: LinearModel, whole: Array) -> float:
    """Logarithm of the restricted likelihood of the residuals with this covariance, but for its power of 2 pi."""
    own = of.jacobian[of.precision == 0.0]
    inverse = np.linalg.inv(whole)
    information = own @ inverse @ own.T
    p = inverse - inverse @ own.T @ np.linalg.inv(information) @ own @ inverse
    sizes = np.linalg.slogdet(whole)[1] + np.linalg.slogdet(information)[1]
    return float(-0.5 * (of.residual @ p @ of.residual + sizes))


def over_nodes(of: LinearModel, values: Sequence[float], *, wide: bool = False) -> float:
    own = [node.log_weight + value for node, value in zip(of.rig.cases, values, strict=True) if node.wide is wide]
    return float(logsumexp(own))


@pytest.mark.parametrize("seed", range(3))
def test_worth_is_that_of_the_covariance_in_full(seed):
    """Of the rig and the parameters; and beside them of columns that move together, and of those of which one is
    chosen, over all sizes and nodes."""
    of, signatures = ledger(seed)
    plain = [restricted(of, covariance(of, node)) for node in of.rig.cases]
    assert of.evidence.log_evidence == pytest.approx(over_nodes(of, plain), abs=1e-6)
    assert of.log_evidence_with_level_errors == pytest.approx(over_nodes(of, plain, wide=True), abs=1e-6)
    for signature, worth in zip(signatures.signatures, of.explanation_evidence([signatures]), strict=True):
        if signature.sign:
            continue
        parts = (
            [signature.columns]
            if signature.act_together
            else [row[None] / unit for row, unit in zip(signature.columns, signature.stiffness_change, strict=True)]
        )
        cases = [size * part for size in SIZES for part in parts]
        by_node = [
            logsumexp([restricted(of, covariance(of, node) + each.T @ each) for each in cases]) for node in of.rig.cases
        ]
        assert worth.log_evidence == pytest.approx(over_nodes(of, by_node) - np.log(len(cases)), abs=1e-6)


@pytest.mark.parametrize("sense", [1, -1, 0])
def test_an_amount_is_integrated_over_its_sense(sense):
    """Numerically, and the free parameter with it: where an effect is missing, the model stays below the tests."""
    of, signatures = ledger(4, flat=1, known=0)
    column, unit, own = signatures.signatures[0].columns[0], 0.7, of.jacobian[0]
    signature = Signature(column[None], np.array([unit]), act_together=False, sign=sense)
    (evidence,) = of.explanation_evidence([SignatureSet((signature,), of.rig)], np.array([0]))
    noise, spreads = multivariate_normal(cov=covariance(of, CASES[0])), SIZES / unit
    low, high = {1: (0.0, 1.0), -1: (-1.0, 0.0), 0: (-1.0, 1.0)}[sense]
    x, weight = np.polynomial.legendre.leggauss(300)
    parameter, whole = 15.0 * x, 0.0
    for spread in spreads:
        reach = min(7.0 * spread, 4.0)  # beyond it the likelihood is none
        amounts = reach * (0.5 * (high - low) * x + 0.5 * (high + low))
        shifted = of.residual + amounts[:, None, None] * column - parameter[:, None] * own
        density = noise.pdf(shifted) @ (15.0 * weight) * norm.pdf(amounts, scale=spread) * (2.0 if sense else 1.0)
        whole += 0.5 * reach * (high - low) * weight @ density / spreads.size
    power = 0.5 * (of.residual.size - 1) * np.log(2.0 * np.pi)
    assert evidence.log_evidence == pytest.approx(np.log(whole) + power + CASES[0].log_weight, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "truth", "typical"),
    [("inertia", 0.0, 0.05), ("inertia", 0.006, 0.05), ("inertia", 0.006, 5.0), ("viscous", 10.0, 100.0)],
)
def test_a_refit_gives_the_evidence_of_the_column_in_any_unit(measured, fitted, monkeypatch, name, truth, typical):
    """The prior of an amount is counted once, and is the same in a refit of all parameters as in the linear model."""
    amount = get_effect(name).amount
    monkeypatch.setitem(vars(amount), "typical", typical)
    base = fitted(campaign := measured({name: {amount.name: truth}}, SHARED))
    search = Search(PreparedCampaign.from_campaign(campaign), base, lambda _: base, DiagnosisSettings(), {}, ())
    (effect,) = (proposal for proposal in search.proposals if proposal.name == name)
    (by_column,) = search.root.weigh(SignatureSet.split([effect.signature], search.root.columns.errors))
    refitted, *_ = search._with_effects(search.root, [effect])
    gain = refitted.log_weight - search._log_odds("effect", name) - search.root.log_weight
    assert gain + refitted.linear.evidence.total == pytest.approx(by_column.total, abs=0.1)


@pytest.mark.parametrize("seed", range(3))
def test_a_deviation_of_the_compound_is_part_of_the_covariance(seed):
    """At every node of some size, beside nothing more and beside a signature; at the others there is none."""
    plain, signatures = ledger(seed)
    columns = np.random.default_rng(seed).normal(size=(2, plain.residual.size))
    sizes = (0.0, 0.3, 0.7)
    nodes = [replace(node, compound=size) for node in CASES[:2] for size in sizes]
    rig = replace(plain.rig, cases=nodes)
    compound = CompoundDeviation(Signature(columns, np.eye(2), act_together=True), rig)
    of = replace(plain, rig=rig, compound=compound)
    signature, size = signatures.signatures[0].columns, SIZES[:, None, None]

    def evidence(bent: bool, added: Array) -> float:
        own = [node for node in nodes if (node.compound > 0.0) is bent]
        whole = [covariance(of, node) + node.compound**2 * columns.T @ columns + added for node in own]
        return float(logsumexp([restricted(of, each) + node.log_weight for node, each in zip(own, whole, strict=True)]))

    nothing = np.zeros((of.residual.size, of.residual.size))
    assert of.evidence.log_evidence == pytest.approx(evidence(False, nothing), abs=1e-6)
    assert of.evidence.with_compound.log_evidence == pytest.approx(evidence(True, nothing), abs=1e-6)
    added = size**2 * (signature.T @ signature)
    worth = of.explanation_evidence([SignatureSet(signatures.signatures, rig)])[0]
    for bent, found in (
        (False, worth.log_evidence),
        (True, worth.with_compound.log_evidence if worth.with_compound else 0.0),
    ):
        over_sizes = logsumexp([evidence(bent, each) for each in added]) - np.log(SIZES.size)
        assert found == pytest.approx(over_sizes, abs=1e-6)


def test_evidence_does_not_depend_on_a_triangle_on_which_lapack_fails(monkeypatch):
    linear, signatures = ledger(3)
    expected, decompose = linear.explanation_evidence([signatures])[0].log_evidence, np.linalg.eigh

    def fails(matrix: Array, UPLO: str = "L") -> tuple[Array, Array]:
        if matrix.ndim == 4 and UPLO == "L":
            raise np.linalg.LinAlgError("Eigenvalues did not converge")
        return decompose(matrix, UPLO)

    monkeypatch.setattr(np.linalg, "eigh", fails)
    assert linear.explanation_evidence([signatures])[0].log_evidence == pytest.approx(expected, rel=1e-12)
