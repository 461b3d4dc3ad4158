"""The smooth correction of what has no name: a Gaussian process beside all parameters.

Notes:
    The correction c has values w = R z at nodes, R R^T the correlation of the nodes, and is orthogonal to what the
    parameters can do in the fit: of all z only those count whose residuals are (Plumlee and Joseph, 2018, Orthogonal
    Gaussian process models of deterministic computer experiments). So the parameters stay where the plain fit put them.
    Lengths and tilt, and a peak, as of a resonance, are those of most evidence in the currency; size and errors of the
    rig are summed over.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import log

import numpy as np
from scipy.special import logsumexp

from bushfit.diagnosis.currency import Group, Ledger
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.holdout import HoldOut, Part
from bushfit.diagnosis.terms import Terms
from bushfit.effects.contract import Array
from bushfit.effects.unnamed import Patch, Unnamed, basis, in_lengths, peak_at
from bushfit.fitting.agreement import LeaveOut
from bushfit.fitting.data_sets import DataSet, parted

#: Lengths tried, in ln frequency and ln motion: from next points apart to the same everywhere.
_LENGTHS = (0.4, 0.9, 2.0, 4.5)
#: Tilts tried, of ln frequency by ln motion: what goes by the rate of strain moves so, and a time that strain changes.
_TILTS = (-1.0, -0.5, 0.0, 0.5, 1.0)
#: Frequencies of the sweeps between which a peak is looked for, at least; chosen.
_FEWEST = 6
#: Peaks tried along each axis, and times that they are tried anew, closer about the best; chosen: to 1 % of the middle.
_PEAKS, _CLOSER = 15, 3
#: Least width over the distance of the frequencies about it, below which one frequency alone shows it: a fault may too.
_NARROW = 0.3

#: Middle and width [Hz] of a peak; None without one.
Peak = tuple[float, float] | None


@dataclass(frozen=True, eq=False)
class Correction:
    """A smooth correction.

    Args:
        data: of the effect `unnamed`.
        held: whole runs inside the range, predicted without and with it; tells, and decides nothing.
        band: its standard deviation over the gap, both as root mean squares over the points.
    """

    data: Unnamed
    held: HoldOut
    band: float


def correct(fitted: Evidence, bare: Evidence, plain: Ledger) -> Correction | None:
    """The correction of a fitted model that has most evidence, common to the directions or of each its own; None where
    corrections have no more than none, or its error is larger than the gap.

    Args:
        bare: the same fit with residuals in units of what scatters from point to point.
        plain: of these, at the sizes of the rig's errors that matter.
    """
    both = Terms(fitted, "gain"), Terms(bare, "gain")
    if not both[0].sensible:
        return None
    likeliest = replace(plain, groups=(), at=plain.likeliest)
    names = tuple(dict.fromkeys(map(str, both[0].directions)))
    shared: list[Sequence[tuple[str, ...]]] = [[names], [(name,) for name in names]]
    found, worth = _of_most_evidence(both, likeliest, shared[: len(names)])
    if (peak := _peak(both[1], likeliest)) is not None:
        peaked, worth_of_it = _of_most_evidence(both, likeliest, [found.directions], peak)
        if worth_of_it - log(_PEAKS**2) > worth:  # as likely beforehand as all peaks that are tried
            found, worth = peaked, worth_of_it
    if worth < likeliest.log_evidence:
        return None
    return replace(found, ledger=replace(plain, groups=())).correction()


def _of_most_evidence(
    both: tuple[Terms, Terms], ledger: Ledger, shared: Sequence[Sequence[tuple[str, ...]]], peak: Peak = None
) -> tuple[_Process, float]:
    """The process of the lengths, then of the tilt, of most evidence, and the logarithm of that of all lengths."""
    every = [_Process(both, ledger, each, pair, 0.0, peak) for each in shared for pair in product(_LENGTHS, _LENGTHS)]
    whole = logsumexp([process.log_evidence for process in every]) - log(len(every))
    straight = max(every, key=lambda process: process.log_evidence)
    tilted = [replace(straight, tilt=tilt) for tilt in _TILTS]
    return max(tilted, key=lambda process: process.log_evidence), float(whole)


def _peak(terms: Terms, ledger: Ledger) -> Peak:
    """Middle and width [Hz] of the peak, linear in ln motion, that has most evidence; None where sweeps have too few
    frequencies for one, or it is too narrow for them, wider than a peak, or not between them."""
    steps = np.unique(np.concatenate([np.empty(0), *(sweep.frequency for sweep in parted(terms.data_sets)[1])]))
    if steps.size < _FEWEST:
        return None
    model, ends = terms.evidence.model, np.log(((steps[0], 0.01), (steps[-1], 1.0)))
    for _ in range(1 + _CLOSER):
        tried = np.array(list(product(*np.linspace(ends[0], ends[1], _PEAKS).T)))
        shapes = [peak_at((np.exp(m), np.exp(m + w)), terms.points, terms.points).T for m, w in tried]
        columns = terms.columns(np.concatenate([each for shape in shapes for each in (shape, 1j * shape)]), model)
        groups = [Group(each, np.ones(len(each)), together=True) for each in np.split(columns, len(tried))]
        worths = replace(ledger, groups=groups).worths
        best = tried[int(np.argmax([worth.log_evidence for worth in worths]))]
        ends = best + np.array([[-2.0], [2.0]]) * np.ptp(ends, axis=0) / (_PEAKS - 1)
    middle, width = float(np.exp(best[0])), float(np.exp(best.sum()))
    above = int(np.searchsorted(steps, middle))
    inside = 0 < above < steps.size and _NARROW * (steps[above] - steps[above - 1]) <= width <= middle
    return (middle, width) if inside else None


@dataclass(frozen=True, eq=False)
class _Process:
    """A Gaussian process beside the parameters.

    Args:
        both: the tests with residuals as they were fitted, and as they are weighed.
        ledger: without it.
        directions: that share a patch, by name.
        lengths, tilt: of the kernel, see `in_lengths`.
        peak: its middle and width [Hz], where it has one.
    """

    both: tuple[Terms, Terms]
    ledger: Ledger
    directions: Sequence[tuple[str, ...]]
    lengths: tuple[float, float]
    tilt: float
    peak: Peak = None

    @cached_property
    def _patches(self) -> list[tuple[Array, Array]]:
        """Of each patch the points that are its nodes, all or those farthest apart, and the correction at all points by
        its amounts, those of the peak last, complex, (m,) and (p, q)."""
        terms, found = self.both[0], []
        for group in self.directions:
            inside = np.flatnonzero(np.isin(terms.directions, group))
            points = terms.points[inside]
            nodes, near = basis(in_lengths(points, self.lengths, self.tilt), points)
            own = inside[nodes]
            peak = peak_at(self.peak, terms.points[own], points)
            here = np.zeros((len(terms.points), near.shape[1] + peak.shape[1]), dtype=complex)
            here[inside] = np.concatenate((near, peak), axis=1)
            found.append((own, here))
        return found

    @cached_property
    def _free(self) -> Array:
        """Amounts in phase, then in quadrature, of which the parameters can do nothing, (2 q, r)."""
        absorbed = self._columns(0) @ self.both[0].evidence.span
        return np.linalg.qr(absorbed, mode="complete")[0][:, np.linalg.matrix_rank(absorbed) :]

    def _columns(self, which: int) -> Array:
        """Whitened residuals by the amounts, as they were fitted or as they are weighed, (2 q, n)."""
        here = np.concatenate([here for _, here in self._patches], axis=1).T
        return self.both[which].columns(np.concatenate((here, 1j * here)), self.both[which].evidence.model)

    @cached_property
    def _with_it(self) -> Ledger:
        columns = self._free.T @ self._columns(1)
        return replace(self.ledger, groups=[Group(columns, np.ones(len(columns)), together=True)])

    @property
    def log_evidence(self) -> float:
        """Of the tests with it."""
        return self._with_it.worths[0].log_evidence

    def correction(self) -> Correction | None:
        """As the tests leave it; None where its error is as large as the gap."""
        mean, covariance = self._with_it.amounts(0)
        mean, covariance = (self._free @ mean).reshape(2, -1), self._free @ covariance @ self._free.T
        here = np.concatenate([here for _, here in self._patches], axis=1)
        rows = np.array([np.concatenate((turned.real, -turned.imag), axis=1) for turned in (here, -1j * here)])
        errors = np.sqrt(np.maximum(np.sum(rows @ covariance * rows, axis=-1), 0.0))  # in phase, in quadrature, (2, p)
        error, gap = float(np.linalg.norm(errors)), float(np.linalg.norm(here @ (mean[0] + 1j * mean[1])))
        if error >= gap:
            return None
        patches, strengths = [], 2 if self.peak else 0
        own = np.split(mean, np.cumsum([each.shape[1] for _, each in self._patches])[:-1], axis=1)
        for names, (nodes, each), amounts in zip(self.directions, self._patches, own, strict=True):
            smooth, peak = np.split(amounts, [each.shape[1] - strengths], axis=1)
            values = smooth @ each[nodes, : smooth.shape[1]].real.T
            lists = (*np.exp(self.both[0].points[nodes].T), *values, *errors[:, nodes])
            strength = zip(("peak_in_phase", "peak_in_quadrature"), map(tuple, peak.tolist()), strict=True)
            patches.append(Patch(names, *(tuple(one.tolist()) for one in lists), **dict(strength)))
        size = self._with_it.worths[0].likeliest
        data = Unnamed(size, self.lengths, tuple(patches), self.tilt, self.peak)
        return Correction(data, self._held_out(size), error / gap)

    def _held_out(self, size: float) -> HoldOut:
        """Whole runs inside the range, in turn predicted from the others, without it and with it."""
        evidence, columns = self.both[0].evidence, self._free.T @ self._columns(0)
        rows, told = evidence.solution.jacobian, dict[str, Array]()
        known = np.eye(len(columns)) / size  # what is known of its amounts beforehand, as a row each
        beside = np.block([[rows, np.zeros((len(rows), len(known)))], [columns, known]])
        both = LeaveOut.of(rows, evidence.residual), LeaveOut.of(beside, np.pad(evidence.residual, (0, len(known))))
        for part in _inside(evidence.data_sets):
            chosen = part.rows(evidence.data_sets)
            held = [np.pad(chosen, (0, each.residual.size - chosen.size)) for each in both]
            pairs = [each.predicted(rows, np.arange(rows.size)) for each, rows in zip(both, held, strict=True)]
            told[part.name] = np.array(pairs)
        return HoldOut.of(told)


def _inside(data_sets: Sequence[DataSet]) -> Iterator[Part]:
    """Whole runs inside the range: every third frequency of each, the middle level, a repeat."""
    chosen: dict[str, dict[DataSet, Array]] = {}
    for sweep in parted(data_sets)[1]:
        rank = np.unique(sweep.step, return_inverse=True)[1]
        levels, level = np.unique(sweep.held, return_inverse=True)
        several = np.ptp(sweep.repeat) > 0
        for name, points in (
            (f"every third {sweep.sweep.stepped or 'point'}", (rank % 3 == 1) & (rank < rank.max())),
            ("the middle of what is held", (level == levels.size // 2) & (levels.size > 2)),
            ("the last repeat", (sweep.repeat == sweep.repeat.max()) & several),
        ):
            if points.any():
                chosen.setdefault(name, {})[sweep] = points
    for name, own in chosen.items():
        yield Part(name, [own.get(data, np.zeros(data.size // data.parts, dtype=bool)) for data in data_sets])
