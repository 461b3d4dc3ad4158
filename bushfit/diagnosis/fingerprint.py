"""The fingerprint of what has no name: one power law of frequency and amplitude beside all parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import numpy as np
from scipy.special import ndtri

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.holdout import HoldOut
from bushfit.diagnosis.priors import TELLS
from bushfit.diagnosis.score_test import PATTERN_LEFT, ScoreTest
from bushfit.diagnosis.terms import Measure, Terms, end_parts, halves, inner_parts, predicted
from bushfit.effects.contract import Array
from bushfit.fitting.solve import Bounds, Solution, coordinate_bounds, jacobian, residual
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.units import number

#: Chi-square behind the best at which a measure is left on its way.
_EXCLUDED = 60.0
#: Powers at which the search for the best begins; rubber, rigs and their mistakes have powers from -1 to 2.
_POWERS = np.arange(-2.0, 3.01, 0.5)
#: Least and largest share of the stiffness in phase and in quadrature, and power of frequency and of amplitude.
_LEAST = np.array([-np.inf, -np.inf, -4.0, -4.0])
#: The same at the most: beyond these powers, a term acts at one end of the tests only.
_MOST = -_LEAST
#: How far inside the bounds a fit starts, relative to the room between them.
_INSIDE = 1e-6
#: Evaluations of the model in one fit at most, and before a measure that fits far worse than the best is left.
_EVALUATIONS, _FIRST_EVALUATIONS = 120, 60
#: A fit ends where chi-square falls by less, in units of the misfit's variance: a tenth of a standard error.
_LEAST_FALL = 0.01
#: Reduced chi-square beyond which a gap has bent the parameters too far for a fit to start from them.
_BENT = 1.5
#: Points of a normal distribution from which the quantiles of a mixture of some are taken.
_QUANTILES = 400
#: Variance, relative to the largest, below which a direction is rounding.
_ROUNDING = 1e-12
#: Starts that are refitted per measure; chosen for time: the best score is nearly always the way to the best fit.
_STARTS = 1
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
    (0, 0, 0, ("gain",), "a gain that is too low in the model"),
    (180, 0, 0, ("gain",), "a gain that is too high in the model"),
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
    """A e^(i phi) (f/f0)^p (X/X0)^q, with 95 % intervals.

    Args:
        measure: what it counts in: the one that fits best.
        alike: others that fit as well, by BIC; the intervals hold them by their likelihood.
        size: A [N/m, Pa or 1].
        middle: f0 [Hz] and X0 [m, rad or 1]: where the tests see most of it.
        after: what is left with it, all parameters refitted; its amounts and powers stand last in the derivatives.
        held: what was held out, inside the range and at its ends, predicted without and with it.
        is_power_law: whether nothing smooth is left beside it, and it stands where it was not fitted.
    """

    measure: Measure
    alike: tuple[Measure, ...]
    size: Interval
    phase_deg: Interval
    frequency_power: Interval
    amplitude_power: Interval
    middle: tuple[float, float]
    after: Evidence
    held: HoldOut
    is_power_law: bool

    @property
    def words(self) -> str:
        """The term for people: "in quadrature, grows as f^0.8, independent of amplitude: acts like a damper"."""
        measures = " or ".join(_IN_WORDS[each] for each in (self.measure, *self.alike))
        said = (
            f"{_phase_words(self.phase_deg)}, {_power_words(self.frequency_power, 'f', 'frequency')}, "
            f"{_power_words(self.amplitude_power, 'X', 'amplitude')}, as {measures}"
        )
        like = self._like()
        return f"{said}: acts like {like}" if like else said

    def _like(self) -> str | None:
        """The known laws that lie nearest to the middle of the intervals, where that is near enough in all three."""
        found = np.array([self.phase_deg, self.frequency_power, self.amplitude_power])
        middle, errors = found[:, 1:].mean(axis=1), np.maximum(np.ptp(found[:, 1:], axis=1) / 2.0 / Z95, 1e-9)
        if not (errors * Z95 < (_PHASE_TOLD, _TOLD, _TOLD)).all():
            return None
        distances = {}
        for *law, measures, words in _LAWS:
            if {self.measure, *self.alike} & {*measures}:
                off = middle - law
                off[0] = (off[0] + 180.0) % 360.0 - 180.0
                distances[words] = float(np.max(np.abs(off) / errors))
        nearest = min(distances.values())
        return " or ".join(words for words in distances if distances[words] == nearest) if nearest < _LIKE else None


def fingerprint(
    evidence: Evidence, smooth: Array, chance_level: float, start: Mapping[str, float], bounds: Bounds
) -> Fingerprint | None:
    """The power law that closes most of the gap that a fitted model leaves; None where the tests show none.

    Args:
        smooth: whitened columns of all that is smooth, (c, n); what of them is left decides whether it is a power law.
        chance_level: probability with which noise alone stays below the threshold of what is left.
        start: values of the model's parameters read off the data, for a model that the gap has bent too far.
        bounds: limits of parameters inside their own.
    """
    begun = evidence if evidence.reduced < _BENT else _at(evidence, start)
    terms = [Terms(begun, measure) for measure in _IN_WORDS]
    sensible = [each for each in terms if each.sensible]
    fits = [_refitted(each, bounds, powers, _FIRST_EVALUATIONS) for each in sensible for powers in _starts(each)]
    if not fits:
        return None
    nearest = min((fit.after for fit in fits), key=lambda after: after.chi_square)
    goal = nearest.chi_square + _EXCLUDED * max(nearest.reduced, 1.0)
    fits = [fit.to_its_end(bounds) for fit in fits if fit.after.chi_square < goal]
    by_measure = {fit.terms.measure: fit for fit in sorted(fits, key=lambda fit: -fit.after.chi_square)}
    best, *others = sorted(by_measure.values(), key=lambda fit: fit.after.chi_square)
    left = ScoreTest(best.after, smooth, [np.arange(len(smooth))], PATTERN_LEFT)
    held = _held_out(evidence, best.after)
    return _read(best, others, held, is_all=left.gains()[0] < left.largest_by_chance(chance_level))


def _held_out(before: Evidence, after: Evidence) -> HoldOut:
    """Inside the range and at its ends, predicted without the term and with it."""
    told = {}
    for part in (*inner_parts(after.data_sets), *end_parts(after.data_sets)):
        rows, pair = part.rows(after.data_sets), []
        for evidence in (before, after):
            own = evidence.solution.jacobian
            left, variance = predicted(evidence.residual, own, np.zeros(len(own)), rows)
            pair.append((left, left / np.sqrt(variance)))
        told[part.name] = np.array(pair)
    return HoldOut.of(told)


def _at(evidence: Evidence, values: Mapping[str, float]) -> Evidence:
    """The same tests and parameters at other values."""
    coordinates, model = evidence.solution.coordinates, evidence.model.with_values(values)
    left, rows = residual(model, evidence.data_sets), jacobian(model, evidence.data_sets, coordinates.names)
    return replace(evidence, solution=replace(evidence.solution, model=model, residual=left, jacobian=rows))


def _starts(terms: Terms) -> Sequence[tuple[float, float]]:
    """Powers of frequency and amplitude of the best scores; an axis along which nothing changes has the power 0."""
    axes = [_POWERS if spread > 0.0 else np.zeros(1) for spread in np.ptp(terms.points, axis=0)]
    powers = list(product(*axes))
    shapes = np.exp((terms.points - terms.points.mean(axis=0)) @ np.array(powers).T).T
    columns = terms.columns(np.concatenate((shapes, 1j * shapes)), terms.evidence.model)
    groups = [np.array([i, i + len(powers)]) for i in range(len(powers))]
    gains = ScoreTest(terms.evidence, columns, groups, PATTERN_LEFT).gains()
    return [powers[i] for i in np.argsort(gains)[::-1][:_STARTS]]


@dataclass(frozen=True, eq=False)
class _Fit:
    """The term refitted with all parameters: its size, phase [rad] and powers, and their errors, (4,) each.

    Args:
        begun: the powers from which it was fitted.
        point: where the fit ended, the parameters' coordinates and those of the term, (k + 4,).
    """

    terms: Terms
    begun: tuple[float, float]
    point: Array
    middle: Array
    value: Array
    error: Array
    after: Evidence

    def to_its_end(self, bounds: Bounds) -> "_Fit":
        """The same fit, taken up again where it was stopped before its end."""
        if not self.after.solution.stopped:
            return self
        return _refitted(self.terms, bounds, self.begun, _EVALUATIONS - _FIRST_EVALUATIONS, self)


def _refitted(
    terms: Terms, bounds: Bounds, powers: tuple[float, float], evaluations: int, before: _Fit | None = None
) -> _Fit:
    """The term and all parameters refitted together from these powers, or from where a fit from them was stopped.

    A term in shares of the stiffness multiplies that of the model without it.
    """
    from scipy.optimize import least_squares

    base, data_sets = terms.evidence.solution, terms.evidence.data_sets
    coordinates = base.coordinates
    middle = terms.centre(np.exp((terms.points - terms.points.mean(axis=0)) @ powers))
    about, (low, high) = terms.points - middle, coordinate_bounds(coordinates, bounds)
    changes = np.ptp(about, axis=0) > 0.0
    scale = float(np.mean(np.abs(terms.unit(base.model)) ** -1 * np.abs(terms.stiffness)))

    @lru_cache(maxsize=2)
    def at(point: tuple[float, ...]) -> tuple[Model, Array, Array]:
        model = base.model.with_values(coordinates.values(np.array(point[:-4])))
        shape = scale * np.exp(about @ point[-2:])
        value = (point[-4] + 1j * point[-3]) * shape
        return model, value, np.stack((shape, 1j * shape, *(value * (about * changes).T)))

    def misfit(point: Array) -> Array:
        model, value, _ = at(tuple(point.tolist()))
        return terms.residual(value, model)

    def slopes(point: Array) -> Array:
        model, value, own = at(tuple(point.tolist()))
        return np.concatenate((terms.jacobian(value, model, coordinates.names), terms.columns(own, model, value))).T

    ends = np.append(low, _LEAST), np.append(high, _MOST)
    if before:
        start = before.point
    else:
        start = np.append(coordinates.point(base.model.values), (0.0, 0.0, *powers))
        linear = slopes(start)[:, :-2]
        start[-4:-2] = -np.linalg.lstsq(linear, base.residual, rcond=None)[0][-2:]
    room = _INSIDE * np.minimum(ends[1] - ends[0], 1.0)
    inside = np.clip(start, ends[0] + room, ends[1] - room)
    least = _LEAST_FALL / base.residual.size
    found = least_squares(misfit, inside, slopes, ends, ftol=least, x_scale="jac", max_nfev=evaluations)
    model, stopped = at(tuple(found.x.tolist()))[0], found.status == 0
    taken = found.nfev + (before.after.solution.evaluations if before else 0)
    solution = Solution(model, coordinates, found.fun, slopes(found.x).T, taken, {}, stopped)
    after = Evidence(solution, data_sets)
    a, b, p, q = found.x[-4:]
    size = float(np.hypot(a, b))
    turn = np.eye(4)
    turn[:2, :2] = np.array([[a, b], [-b / size, a / size]]) / size
    covariance = turn @ _covariance(solution.jacobian)[-4:, -4:] @ turn.T * max(after.reduced, 1.0)
    error = np.sqrt(np.diag(covariance))
    error[2:][~changes] = np.inf
    value = np.array([size, np.arctan2(b, a), p, q])
    return _Fit(terms, powers, found.x, middle, value * [scale, 1, 1, 1], error * [scale, 1, 1, 1], after)


def _covariance(rows: Array) -> Array:
    """Covariance of amounts whose unit moves the whitened residuals so, (c, n) -> (c, c)."""
    length = np.maximum(np.linalg.norm(rows, axis=1), np.finfo(float).tiny)
    unit = rows / length[:, None]
    return np.linalg.pinv(unit @ unit.T, rcond=_ROUNDING, hermitian=True) / np.outer(length, length)


def _read(best: _Fit, others: Sequence[_Fit], held: HoldOut, *, is_all: bool) -> Fingerprint:
    """Size, phase and powers of the best fit; their intervals hold the other measures by their likelihood."""
    apart = [fit.after.chi_square - best.after.chi_square for fit in others]
    weights = np.exp(-0.5 * np.array([0.0, *apart]) / max(best.after.reduced, 1.0))
    values, errors = (np.array([getattr(fit, which) for fit in (best, *others)]) for which in ("value", "error"))
    values[:, 1] = best.value[1] + (values[:, 1] - best.value[1] + np.pi) % (2.0 * np.pi) - np.pi
    values[1:, 0], errors[1:, 0] = best.value[0], best.error[0]  # sizes of other measures have other units
    scales = np.array([1.0, np.degrees(1.0), 1.0, 1.0])
    ends = [_interval(*each, weights) for each in zip((values * scales).T, (errors * scales).T, strict=True)]
    size, phase, p, q = [(float(value), *pair) for value, pair in zip(best.value * scales, ends, strict=True)]
    alike = tuple(fit.terms.measure for fit, off in zip(others, apart, strict=True) if off < TELLS)
    middle = float(np.exp(best.middle[0])), float(np.exp(best.middle[1]))
    is_power_law = is_all and halves(held)
    return Fingerprint(best.terms.measure, alike, size, phase, p, q, middle, best.after, held, is_power_law)


def _interval(values: Array, errors: Array, weights: Array) -> tuple[float, float]:
    """The middle 95 % of normal distributions that count by their weights."""
    if not np.isfinite(errors).all():
        return -np.inf, np.inf
    spread = ndtri((np.arange(_QUANTILES) + 0.5) / _QUANTILES)
    drawn = (values[:, None] + errors[:, None] * spread).ravel()
    order = np.argsort(drawn)
    share = np.cumsum(np.repeat(weights, _QUANTILES)[order])
    low, high = np.interp([0.025 * share[-1], 0.975 * share[-1]], share, drawn[order])
    return float(low), float(high)


def _phase_words(phase: Interval) -> str:
    """The phase in words, where a quarter of a turn lies in its interval; else its value."""
    quarters = {0.0: "in phase", 90.0: "in quadrature", 180.0: "in antiphase", -180.0: "in antiphase"}
    quarters[-90.0] = "in negative quadrature"
    if phase[2] - phase[1] > 2.0 * _PHASE_TOLD:
        return "at a phase that these tests do not tell"
    near = [words for quarter, words in quarters.items() if phase[1] <= quarter <= phase[2]]
    return near[0] if near else f"{number(phase[0], 2)} deg ahead of the displacement"


def _power_words(power: Interval, symbol: str, axis: str) -> str:
    value, low, high = power
    if not high - low < 2.0 * _TOLD:
        return f"how it changes with {axis} is not told"
    if low <= 0.0 <= high:
        return f"independent of {axis}"
    return f"{'grows' if value > 0 else 'falls'} as {symbol}^{number(value, 2)}"
