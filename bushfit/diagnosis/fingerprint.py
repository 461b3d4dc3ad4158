"""Power law of frequency and amplitude nearest to a gap without a name, beside all parameters.

Notes:
    The term is A e^(i phi) (f/f0)^p (X/X0)^q. For each pair of powers on a grid its two parts, in phase and in
    quadrature, are a group of columns around the parameters of the most probable pair. The evidence of each pair and
    its amounts form the posterior from which phase and powers are drawn. A smooth process of any form, weighed in the
    same way, decides whether the gap is a power law at all.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from math import log

import numpy as np
from scipy.special import logsumexp

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.linear_model import Group, LinearModel
from bushfit.diagnosis.priors import TELLS
from bushfit.diagnosis.terms import Measure, Terms
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import Bounds, coordinate_bounds
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.units import number

#: Largest power, of either sign; chosen: beyond, a term acts at one end of the tests only.
_MOST = 4.0
#: Pairs of powers along an axis of the grid, and standard errors that it reaches to either side of the likeliest.
_GRID, _REACH = 13, 4.0
#: Times at most that the grid is made anew about the likeliest pair and the parameters beside it, and the step of a
#: power, in standard errors, with which both rest.
_ROUNDS, _RESTS = 20, 0.1
#: Longest step of a parameter between these, in coordinates, and how far inside its limits one stays: usual for fits.
_LONGEST, _INSIDE = 1.0, 1e-6
#: Dampings of a step, relative to what the tests tell of a parameter; usual for such methods.
_DAMPINGS = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0)
#: Draws of the posterior; chosen: they tell the ends of an interval within a fiftieth of its length.
_DRAWS = 10_000
#: Half width of a power's interval beyond which nothing is said of it.
_TOLD = 0.75
#: The same of the phase [deg].
_PHASE_TOLD = 60.0
#: Standard errors within which a known law may lie for the term to be said to act like it, in phase and powers each.
_LIKE = 2.5
#: What laws look like: phase [deg], power of frequency, power of amplitude, measures, words.
_LAWS: tuple[tuple[float, float, float, tuple[Measure, ...], str], ...] = (
    (90, 1, 0, ("stiffness", "modulus"), "a damper"),
    (180, 2, 0, ("stiffness", "modulus"), "a mass"),
    (0, 0, 2, ("stiffness", "modulus"), "a spring that stiffens with the cube of the displacement"),
    (0, 0, 0, ("stiffness", "modulus"), "a spring in parallel"),
    (180, 0, 0, ("stiffness", "modulus"), "a spring that is missing"),
    (90, 0, -1, ("stiffness", "modulus"), "dry friction"),
    (90, 0, 0, ("stiffness", "modulus", "gain"), "a loss that is the same at every frequency"),
    (90, 1, 0, ("gain",), "a delay of the displacement"),
    (-90, 1, 0, ("gain",), "a delay of the force"),
)
_IN_WORDS: dict[Measure, str] = {
    "stiffness": "the same stiffness in every direction",
    "modulus": "a modulus over strain",
    "gain": "a share of the stiffness",
}

#: A value and the ends of its 95 % interval.
Interval = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Fingerprint:
    """Power law A e^(i phi) (f/f0)^p (X/X0)^q, with 95 % intervals.

    Args:
        measure: unit of the term with the highest evidence: stiffness, modulus or share of the stiffness.
        alike: other units that the tests cannot distinguish; the intervals average over all by probability.
        phase_deg: phi [deg].
        frequency_power: p.
        amplitude_power: q.
        is_power_law: whether the evidence of the power law exceeds that of a smooth curve of any form.
    """

    measure: Measure
    alike: tuple[Measure, ...]
    phase_deg: Interval
    frequency_power: Interval
    amplitude_power: Interval
    is_power_law: bool

    @property
    def determined(self) -> list[bool]:
        """True for each of phase, frequency power and amplitude power that the tests determine."""
        found = zip(
            (self.phase_deg, self.frequency_power, self.amplitude_power), (_PHASE_TOLD, _TOLD, _TOLD), strict=True
        )
        return [high - low < 2.0 * limit for (_, low, high), limit in found]

    @property
    def words(self) -> str:
        """Text of the term, as "in quadrature, grows as f^0.8, independent of amplitude: acts like a damper"."""
        measures = " or ".join(_IN_WORDS[measure] for measure in (self.measure, *self.alike))
        powers = (
            _power_words(self.frequency_power, "f", "frequency"),
            _power_words(self.amplitude_power, "X", "amplitude"),
        )
        term = ", ".join((_phase_words(self.phase_deg), *powers, f"as {measures}"))
        like = self._like() if all(self.determined) else ""
        return f"{term}: acts like {like}" if like else term

    def _like(self) -> str:
        """Names of the nearest known laws; "" if none is near in phase and powers."""
        found = np.array([self.phase_deg, self.frequency_power, self.amplitude_power])
        middle, errors = found[:, 1:].mean(axis=1), np.maximum(np.ptp(found[:, 1:], axis=1) / 2.0 / Z95, 1e-9)
        distances = {}
        for *law, measures, words in _LAWS:
            if {self.measure, *self.alike} & {*measures}:
                deviation = middle - law
                deviation[0] = (deviation[0] + 180.0) % 360.0 - 180.0
                distances[words] = float(np.max(np.abs(deviation) / errors))
        nearest = min(distances.values())
        return " or ".join(words for words in distances if distances[words] == nearest) if nearest < _LIKE else ""


def fingerprint(
    fitted: Evidence, bare: Evidence, plain: LinearModel, start: Mapping[str, float], bounds: Bounds
) -> Fingerprint | None:
    """Estimate the power law nearest to the gap of a fitted model.

    Args:
        fitted: the fitted model and the tests.
        bare: the same fit with residuals in units of the scatter from point to point.
        plain: linear model of `bare`, with smooth curves of any form as its groups.
        start: starting values read from the data; the gap may have distorted those of the fit.
        bounds: limits of parameters inside their general limits.

    Returns:
        The power law; None if the tests show none.
    """
    begun = fitted.model.with_values(start)
    pairs = [(Terms(fitted, measure), Terms(bare, measure)) for measure in _IN_WORDS]
    found = [
        _Grid.of_the_likeliest(terms, bare_terms, plain, begun, bounds) for terms, bare_terms in pairs if terms.sensible
    ]
    grids = sorted(filter(None, found), key=lambda grid: -grid.log_evidence)
    if not grids or grids[0].log_evidence < grids[0].ledger.log_evidence:
        return None
    log_ratios = np.array([grid.log_evidence - grids[0].log_evidence for grid in grids])
    lookalikes = tuple(
        grid.terms.measure
        for grid, log_ratio in zip(grids[1:], log_ratios[1:], strict=True)
        if -log_ratio < 0.5 * TELLS
    )
    counts = np.round(_DRAWS * np.exp(log_ratios)).astype(int).tolist()
    drawn = np.concatenate([grid.drawn(count) for grid, count in zip(grids, counts, strict=True)], axis=-1)
    turn = np.exp(1j * drawn[0])
    middle = np.angle(turn.mean())
    drawn[0] = np.degrees(middle + np.angle(turn * np.exp(-1j * middle)))
    phase, p, q = (tuple(quantiles) for quantiles in np.quantile(drawn, (0.5, 0.025, 0.975), axis=-1).T.tolist())
    law = logsumexp(log_ratios) + grids[0].log_evidence - log(len(grids))
    curves = replace(grids[0].ledger, groups=plain.groups).group_evidence  # around the same parameters and term
    smooth = logsumexp([worth.log_evidence for worth in curves]) - log(len(curves))
    return Fingerprint(grids[0].terms.measure, lookalikes, phase, p, q, bool(law > smooth))


@dataclass(frozen=True, eq=False)
class _Grid:
    """Pairs of powers of frequency and amplitude with their evidence.

    Args:
        terms: the operating points, in the unit of the term.
        ledger: linear model with one group for each pair.
        powers: of the pairs, (g, 2).
        step: of the grid along each axis; 0 along an axis on which the tests do not differ, (2,).
    """

    terms: Terms
    ledger: LinearModel
    powers: Array
    step: Array

    @classmethod
    def of_the_likeliest(
        cls, fitted: Terms, bare: Terms, plain: LinearModel, model: Model, bounds: Bounds
    ) -> _Grid | None:
        """Grid about the most probable pair of powers, iterated with the parameters; None without convergence."""
        about = bare.points - bare.points.mean(axis=0)
        changes = np.ptp(about, axis=0) > 0.0
        value = bare.measured_value(
            model
        )  # at first around the measured stiffness, by which a term of any size is linear
        ends, middle = np.outer((-_MOST, _MOST), changes), np.full(2, np.inf)
        for _ in range(_ROUNDS):
            powers = np.array(list(product(*map(np.unique, np.linspace(ends[0], ends[1], _GRID).T))))
            step = np.ptp(ends, axis=0) / (_GRID - 1)
            residual, rows, columns = _linear(bare, model, value, bare.of_size_one(np.exp(powers @ about.T), model))
            groups = [Group(pair, np.ones(2), together=True) for pair in columns]
            grid = cls(bare, replace(plain, residual=residual, jacobian=rows, groups=groups), powers, step)
            before, middle = middle, grid.share @ powers
            spread = np.sqrt(grid.share @ np.square(powers - middle))
            shift = np.abs(middle - before)
            if (shift <= _RESTS * spread).all() and (step <= spread).all():
                return grid
            reach = _REACH * spread + step + np.where(np.isfinite(shift), shift, 0.0)
            ends = np.clip(np.stack((middle - reach, middle + reach)), -_MOST * changes, _MOST * changes)
            model, value = _stepped(fitted, model, value, np.exp(middle @ about.T)[None], bounds)
        return None

    @cached_property
    def _logs(self) -> Array:
        """Log evidence of each pair, (g,)."""
        return np.array([worth.log_evidence for worth in self.ledger.group_evidence])

    @cached_property
    def share(self) -> Array:
        """Probability of each pair, (g,)."""
        return np.exp(self._logs - logsumexp(self._logs))

    @property
    def log_evidence(self) -> float:
        """Log evidence of the tests averaged over all pairs, each equally probable."""
        filled = np.log(np.where(self.step > 0.0, self.step / (2.0 * _MOST), 1.0)).sum()
        return float(logsumexp(self._logs) + filled)

    def drawn(self, count: int) -> Array:
        """Phase [rad] and powers drawn from the posterior, (3, count)."""
        random = np.random.default_rng(0)
        chosen = random.choice(len(self.powers), count, p=self.share)
        wide = np.where(self.step > 0.0, self.step, 2.0 * _MOST)  # of what the tests do not change nothing is told
        powers = self.powers[chosen] + wide * (random.random((count, 2)) - 0.5)
        parts = np.empty((count, 2))
        for pair in np.unique(chosen):
            mine = chosen == pair
            parts[mine] = random.multivariate_normal(*self.ledger.amounts(int(pair)), mine.sum(), method="eigh")
        return np.stack((np.arctan2(parts[:, 1], parts[:, 0]), *powers.T))


def _linear(terms: Terms, model: Model, value: Array, shapes: Array) -> tuple[Array, Array, Array]:
    """Linearise the residuals around a term.

    Returns: residuals without the term, (n,); derivatives by the parameters, (k, n); and by terms of the given shapes,
    in phase and in quadrature, (c, 2, n).
    """
    residual = terms.residual(value, model) - terms.columns(value[None], model, value)[0]
    columns = terms.columns(np.concatenate((shapes, 1j * shapes)), model, value)
    return residual, terms.jacobian(value, model), columns.reshape(2, len(shapes), -1).swapaxes(0, 1)


def _stepped(terms: Terms, model: Model, value: Array, shape: Array, bounds: Bounds) -> tuple[Model, Array]:
    """One damped Gauss-Newton step of the parameters and of the term of a shape."""
    shape = terms.of_size_one(shape, model)
    residual, rows, columns = _linear(terms, model, value, shape)
    design, coordinates = np.concatenate((rows, columns[0])), terms.evidence.solution.coordinates
    low, high = coordinate_bounds(coordinates, bounds)
    misfit, best = np.inf, (model, value)
    for damping in _DAMPINGS:
        damped = damping * np.diag(np.linalg.norm(design, axis=1))[: len(rows)]
        step = -np.linalg.lstsq(np.vstack((design.T, damped)), np.pad(residual, (0, len(rows))), rcond=None)[0]
        point = coordinates.point(model.values) + np.clip(step[:-2], -_LONGEST, _LONGEST)
        candidate = model.with_values(coordinates.values(np.clip(point, low + _INSIDE, high - _INSIDE)))
        reached = (step[-2] + 1j * step[-1]) * shape[0]
        if (now := float(np.linalg.norm(terms.residual(reached, candidate)))) >= misfit:
            break
        misfit, best = now, (candidate, reached)
    return best


def _phase_words(phase: Interval) -> str:
    """Phase in words if its interval contains a multiple of 90 deg; else its value."""
    quarters = {0.0: "in phase", 90.0: "in quadrature", 180.0: "in antiphase", -180.0: "in antiphase"}
    quarters[-90.0] = "in negative quadrature"
    if phase[2] - phase[1] > 2.0 * _PHASE_TOLD:
        return "at a phase that these tests do not determine"
    near = [words for quarter, words in quarters.items() if phase[1] <= quarter <= phase[2]]
    return near[0] if near else f"{number(phase[0], 2)} deg ahead of the displacement"


def _power_words(power: Interval, symbol: str, axis: str) -> str:
    value, low, high = power
    if not high - low < 2.0 * _TOLD:
        return f"its change with {axis} is not determined"
    if low <= 0.0 <= high:
        return f"independent of {axis}"
    return f"{'grows' if value > 0 else 'falls'} as {symbol}^{number(value, 2)}"
