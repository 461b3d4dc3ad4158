"""The smooth correction of what has no name: a Gaussian process beside all parameters, held out before it is kept.

Where a peak, as of a resonance, makes it likelier by more than the price of having looked for one, it has a peak too.

Notes:
    The correction c has values w at nodes, w = s R z with z standard normal and R R^T the correlation of the nodes, and
    is orthogonal to what the parameters can do: of all such z only those count whose residuals are (Plumlee and Joseph,
    2018, Orthogonal Gaussian process models of deterministic computer experiments). So the parameters stay where the
    plain fit put them. Beside them r = -E y + noise with y ~ N(0, s^2 I), and with the eigenvalues l of E E^T and the
    amounts a of E r along its eigenvectors the marginal likelihood over that of no correction is
    ln L = sum (s^2 a^2/(1 + s^2 l) - ln(1 + s^2 l))/2 (Rasmussen and Williams, 2006, Eq. 2.30).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product

import numpy as np
from scipy.linalg import block_diag

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.holdout import HoldOut
from bushfit.diagnosis.score_test import ScoreTest
from bushfit.diagnosis.terms import Terms, halves, inner_parts, log_score, predicted
from bushfit.effects.contract import Array
from bushfit.effects.unnamed import Unnamed, correlation, in_lengths, kernel, nodes_among, patches_of, peak_at

#: Nodes of a patch at most; chosen: all points of the paper's plan, and little time.
_MOST_NODES = 100
#: Lengths tried, in ln frequency and ln motion: from next points apart to the same everywhere.
_LENGTHS = 2.0 ** np.arange(-2, 4)
#: Tilts tried, of ln frequency by ln motion: what goes by the rate of strain moves so, and a time that strain changes.
_TILTS = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
#: The axes of what is tried, and what is tried first.
_AXES, _FIRST = (_LENGTHS, _LENGTHS, _TILTS), (1.0, 2.0, 0.0)
#: Sizes tried, over that of the gap; chosen: the best is a few times the root mean square of what it corrects.
_SIZES = np.geomspace(0.1, 30.0, 26)
#: Frequencies of the sweeps that a peak is looked for in, at least; chosen.
_FEWEST = 6
#: Steps of ln of the middle of the peaks that are tried first; chosen, half of the least width but one.
_STEP = 0.1
#: Their widths over the middle; chosen: nothing wider is called a peak, and what one frequency shows is narrower still.
_WIDTHS = (0.01, 0.03, 0.1, 0.2, 0.4, 0.8)
#: Width over the distance of the frequencies on either side, below which one frequency alone shows it: a fault may too.
_NARROW = 0.3
#: Steps of ln of the middle in the finer trials about the best.
_FINER = (0.05, 0.02, 0.01)
#: Peaks of each of these trials, in such steps of ln of the middle and of the width, which the data tell less well.
_ABOUT = tuple(product((-1, 0, 1), (-6, -3, 0, 3, 6)))
#: What a peak has to add to the logarithm of the likelihood: that of the number of peaks that are tried.
_PRICE = 5.0
#: Share of a peak that the parameters must leave.
_PEAK_LEFT = 1e-3
#: Variance of a pattern over the nodes, relative to the largest, that no correction is made of.
_NEXT_TO_NOTHING = 1e-6
#: Length in units of which values between nodes are those of a smooth curve.
_BETWEEN = 1.0
#: Digits of the logarithms of points that tell them apart.
_DIGITS = 6
#: Peaks times residuals that are looked at together; chosen: a few hundred megabytes.
_TOGETHER = 2_000_000
#: Width of the band over that of one that would hold the gap, at the most: a correction that only widens its band has
#: explained nothing.
_HALF = 0.5


@dataclass(frozen=True, eq=False)
class Correction:
    """A smooth correction, and whether it stands where it was not fitted.

    Args:
        data: of the effect `unnamed`.
        held: whole runs inside the range, predicted without and with it.
        log_score: mean logarithm of the density it gave to what was held out, less that of the model without it.
        band: its standard deviation over the gap, both as root mean squares over the points.
    """

    data: Unnamed
    held: HoldOut
    log_score: float
    band: float

    @property
    def kept(self) -> bool:
        """Whether the gap at least halves where it was not fitted, by a band that is narrower than the gap."""
        return halves(self.held) and self.log_score > 0.0 and self.band <= _HALF


def correct(evidence: Evidence) -> Correction | None:
    """The likeliest smooth correction of a fitted model, common to the directions or of each its own; None where none
    is likelier than none."""
    terms = Terms(evidence, "gain")
    names = tuple(dict.fromkeys(map(str, terms.directions))) if terms.sensible else ()
    groups: list[list[tuple[str, ...]]] = [[names], [(name,) for name in names]]
    peaks = dict.fromkeys((None, _peak(terms, np.ones_like(evidence.residual))))
    designs = [_Design.of(terms, each, peak) for each in groups[: len(names)] for peak in peaks]
    found = [process for design in designs if (process := _likeliest(design))]
    best = max(found, key=lambda process: process.likelihood - _PRICE * bool(process.design.peak), default=None)
    return best.held_out() if best else None


def _peak(terms: Terms, weight: Array) -> tuple[float, float] | None:
    """Middle and width [Hz] of the peak of any phase, linear in ln motion, that takes most off chi-square; None where
    sweeps have too few frequencies for one, or it is too narrow for them, wider than a peak, or not between them.

    Args:
        weight: of each residual, 1 or 0, (n,).
    """
    swept = [each.frequency for each in terms.data_sets if each.kind == "sweep"]
    steps = np.log(np.unique(np.concatenate([np.empty(0), *swept])))
    if steps.size < _FEWEST:
        return None
    solution = terms.evidence.solution
    weighted = replace(solution, residual=solution.residual * weight, jacobian=solution.jacobian * weight)
    evidence = replace(terms.evidence, solution=weighted)
    logs = np.array(list(product(np.arange(steps[0], steps[-1], _STEP), np.log(_WIDTHS))))

    def gains(peaks: Array) -> list[float]:
        shapes = [peak_at((np.exp(m), np.exp(m + w)), terms.points, terms.points).T for m, w in peaks]
        values = np.concatenate([part for shape in shapes for part in (shape, 1j * shape)])
        groups = list(np.arange(len(values)).reshape(len(peaks), -1))
        return ScoreTest(evidence, terms.columns(values, evidence.model) * weight, groups, _PEAK_LEFT).gains()

    for finer in (*_FINER, 0.0):
        parts = np.array_split(logs, min(len(logs), 1 + len(logs) * weight.size // _TOGETHER))
        best = logs[int(np.argmax(np.concatenate([gains(part) for part in parts])))]
        logs = best + finer * np.array(_ABOUT)
    middle, width = float(np.exp(best[0])), float(np.exp(best.sum()))
    above = int(np.searchsorted(steps, best[0]))
    if not 0 < above < steps.size:
        return None
    step = float(np.ptp(np.exp(steps[above - 1 : above + 1])))
    return (middle, width) if _NARROW * step <= width <= middle else None


@dataclass(frozen=True, eq=False)
class _Design:
    """What a correction by values at nodes does to the residuals.

    Args:
        directions: that share a patch, by name.
        nodes: logarithms of frequency and motion of each patch's nodes, (m, 2) each.
        at_points, at_nodes: the correction at the points and the nodes by the values at a patch's nodes and the
            strengths of its peak, patch by patch, complex (p, m) and (nodes, m).
        columns: whitened residuals by these values, all storage, then all loss, (2 m, n).
        weight: of each residual in what is estimated, 1 or 0.
        peak: middle and width [Hz] of the peak; None without one.
    """

    terms: Terms
    directions: Sequence[tuple[str, ...]]
    nodes: Sequence[Array]
    at_points: Array
    at_nodes: Array
    columns: Array
    weight: Array
    peak: tuple[float, float] | None

    @classmethod
    def of(cls, terms: Terms, directions: Sequence[tuple[str, ...]], peak: tuple[float, float] | None) -> _Design:
        """Nodes at the points, or at some that lie farthest apart, and what their values do."""
        nodes, blocks, known = [], [], []
        for group in directions:
            inside = np.isin(terms.directions, group)
            distinct = np.unique(terms.points[inside].round(_DIGITS), axis=0)
            own = distinct[nodes_among(distinct, _MOST_NODES)]
            nodes.append(own)
            near = kernel(terms.points / _BETWEEN, own / _BETWEEN) @ np.linalg.inv(correlation(own / _BETWEEN))
            blocks.append(np.concatenate((near, peak_at(peak, own, terms.points)), axis=1) * inside[:, None])
            known.append(np.concatenate((np.eye(len(own)), peak_at(peak, own, own)), axis=1))
        at_points = np.concatenate(blocks, axis=1)
        values = np.concatenate((at_points.T, 1j * at_points.T))
        columns = terms.columns(values, terms.evidence.model)
        weight = np.ones(columns.shape[1])
        return cls(terms, directions, nodes, at_points, block_diag(*known), columns, weight, peak)

    def without(self, rows: Array) -> _Design:
        """The same without some residuals, (n,) bool, with the peak that the others show."""
        weight = np.where(rows, 0.0, 1.0)
        own = _Design.of(self.terms, self.directions, _peak(self.terms, weight)) if self.peak else self
        return replace(own, weight=weight)

    @property
    def strengths(self) -> int:
        """Strengths of the peak in a patch."""
        return 2 if self.peak else 0

    @cached_property
    def gram(self) -> Array:
        """Inner products of the columns, (2 m, 2 m)."""
        return (self.columns * self.weight) @ self.columns.T

    @cached_property
    def along(self) -> Array:
        """Of the columns and the residuals, (2 m,)."""
        return self.columns @ (self.weight * self.terms.evidence.residual)

    @cached_property
    def absorbed(self) -> Array:
        """What the parameters can do of each column, (2 m, k)."""
        return self.columns @ self.terms.evidence.span


@dataclass(frozen=True, eq=False)
class _Process:
    """A Gaussian process on a design.

    Args:
        lengths, tilt: of the kernel, see `in_lengths`.
        root: values at the nodes by standard normal amounts, orthogonal to the parameters, (2 m, q).
        size: standard deviation of the correction.
        likelihood: logarithm of the marginal likelihood over that of no correction.
    """

    design: _Design
    lengths: tuple[float, float]
    tilt: float
    root: Array
    size: float
    likelihood: float

    @property
    def columns(self) -> Array:
        """Whitened residuals by the amounts, (q, n)."""
        return self.root.T @ self.design.columns

    def held_out(self) -> Correction:
        """The correction, and how it fares on whole runs that were held out: inside the range, and in turn.

        Lengths, tilt, size and peak are estimated anew without each part; whether it has a peak, and whether directions
        share the correction, is not.
        """
        evidence, told, scores = self.design.terms.evidence, dict[str, Array](), []
        own = evidence.solution.jacobian
        for part in inner_parts(evidence.data_sets):
            rows = part.rows(evidence.data_sets)
            design = self.design.without(rows)
            anew = _likeliest(design, (*self.lengths, self.tilt))
            root, size = (anew.root, anew.size) if anew else (np.zeros((len(design.columns), 0)), 1.0)
            pair = [
                predicted(evidence.residual, *_beside(own, root[:, :amounts].T @ design.columns, size), rows)
                for amounts in (0, root.shape[1])
            ]
            told[part.name] = np.array([(left, left / np.sqrt(variance)) for left, variance in pair])
            scores.append(log_score(*pair[1]) - log_score(*pair[0]))
        mean, covariance = self._posterior()
        errors = np.sqrt(np.maximum(_variances(self.design.at_nodes, covariance), 0.0))
        design = self.design
        patches = patches_of(design.directions, design.nodes, design.strengths, mean.reshape(2, -1), errors)
        data = Unnamed(self.size, self.lengths, patches, self.tilt, self.design.peak)
        score = float(np.mean(scores)) if scores else 0.0
        return Correction(data, HoldOut.of(told), score, self._band(mean, covariance))

    def _posterior(self) -> tuple[Array, Array]:
        """Values at the nodes and their covariance, (2 m,) and (2 m, 2 m)."""
        prior = np.eye(self.root.shape[1]) / self.size**2
        inverse = np.linalg.inv(self.root.T @ self.design.gram @ self.root + prior)
        return (-self.root @ inverse @ self.root.T @ self.design.along, self.root @ inverse @ self.root.T)

    def _band(self, mean: Array, covariance: Array) -> float:
        """Standard deviation over the gap, root mean squares over the points."""
        points, (in_phase, in_quadrature) = self.design.at_points, mean.reshape(2, -1)
        gap = np.mean(np.square(np.abs(points @ (in_phase + 1j * in_quadrature))))
        return float(np.sqrt(_variances(points, covariance).sum(axis=0).mean() / gap))


def _variances(points: Array, covariance: Array) -> Array:
    """Variances of the two parts of a correction, (2, p), by what it is of its values, complex (p, m), and these."""
    rows = np.array([np.concatenate((turned.real, -turned.imag), axis=-1) for turned in (points, -1j * points)])
    return np.sum(rows @ covariance * rows, axis=-1)


def _beside(own: Array, columns: Array, size: float) -> tuple[Array, Array]:
    """Columns beside the parameters', (k, n), and what is known of each amount beforehand, inverse variances, (k,)."""
    return np.concatenate((own, columns)), np.repeat([0.0, size**-2], [len(own), len(columns)])


def _likeliest(design: _Design, first: Sequence[float] = _FIRST) -> _Process | None:
    """The process of the likeliest lengths, tilt and size, uphill from the first; None where none is likelier than no
    correction."""
    known: dict[tuple[int, ...], _Process | None] = {}

    def at(place: tuple[int, ...]) -> float:
        if place not in known:
            known[place] = _process(design, *(float(axis[i]) for axis, i in zip(_AXES, place, strict=True)))
        process = known[place]
        return process.likelihood if process else 0.0

    best = tuple(int(np.searchsorted(axis, value)) for axis, value in zip(_AXES, first, strict=True))
    while True:
        steps = [(*best[:k], best[k] + step, *best[k + 1 :]) for k in range(len(_AXES)) for step in (1, -1)]
        inside = [place for place in steps if all(0 <= i < axis.size for i, axis in zip(place, _AXES, strict=True))]
        next_best = max(inside, key=at)
        if at(next_best) <= at(best):
            return known[best]
        best = next_best


def _root(matrix: Array) -> Array:
    """A root of a matrix without what of it is next to nothing, (m, r)."""
    values, vectors = np.linalg.eigh(matrix)
    kept = values > _NEXT_TO_NOTHING * values.max()
    return vectors[:, kept] * np.sqrt(values[kept])


def _process(design: _Design, of_frequency: float, of_motion: float, tilt: float) -> _Process | None:
    """The process of these lengths and this tilt, of its likeliest size."""
    lengths = of_frequency, of_motion
    roots = [_root(correlation(in_lengths(own, lengths, tilt))) for own in design.nodes]
    corner = block_diag(*(block for each in roots for block in (each, np.eye(design.strengths))))
    root = block_diag(corner, corner)
    bound = root.T @ design.absorbed
    basis = np.linalg.qr(bound, mode="complete")[0][:, np.linalg.matrix_rank(bound) :]
    root = root @ basis
    strength, vectors = np.linalg.eigh(root.T @ design.gram @ root)
    along = np.square(vectors.T @ (root.T @ design.along))
    sizes = _SIZES * np.sqrt(max(along.sum(), np.finfo(float).tiny)) / max(strength.max(), np.finfo(float).tiny)
    grown = 1.0 + np.square(sizes)[:, None] * np.maximum(strength, 0.0)
    gain = 0.5 * np.sum(np.square(sizes)[:, None] * along / grown - np.log(grown), axis=1)
    best = int(np.argmax(gain))
    if gain[best] <= 0.0:
        return None
    return _Process(design, lengths, tilt, root, float(sizes[best]), float(gain[best]))
