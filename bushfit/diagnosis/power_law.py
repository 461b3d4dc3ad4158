"""Power law of frequency and amplitude nearest to a gap that no known effect explains.

Notes:
    The power law is a stiffness A e^(i phi) (f/f0)^p (X/X0)^q that is added to the model (a term) and fitted together
    with all parameters. For each pair of powers p and q on a grid, the residuals are linearised in its parts in phase
    and in quadrature, around the parameters of the most probable pair. The evidence of each pair and its amounts form
    the posterior from which phase and powers are drawn. A law is likely if its evidence exceeds that of smooth curves.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise, product
from math import log
from typing import Literal

import numpy as np
from scipy.special import logsumexp, softmax

from bushfit.campaign.schema import RigSettings
from bushfit.diagnosis.explanations import Signature
from bushfit.diagnosis.linear_model import LinearModel
from bushfit.diagnosis.priors import DECISIVE_CHI_SQUARE
from bushfit.diagnosis.projected_columns import SignatureSet
from bushfit.diagnosis.rig_errors import RigErrors, in_scatter_units, rig_errors
from bushfit.diagnosis.smooth_deviations import unnamed_curves
from bushfit.effects.contract import Array
from bushfit.fitting.coordinates import Bounds, Coordinates, coordinate_bounds
from bushfit.fitting.preparation import MeasuredSweep, MeasuredTest, log_slopes
from bushfit.fitting.problem import FitResult
from bushfit.geometry import STRAINING
from bushfit.model.covariance import Z95
from bushfit.model.model import Model
from bushfit.model.sensitivity import difference_quotients, stepped_values
from bushfit.units import number

#: Unit of the added stiffness: N/m or N m/rad over displacement, Pa over strain, or a share of the model's stiffness.
Quantity = Literal["stiffness", "modulus", "gain"]
#: A value and the ends of its 95 % interval.
Interval = tuple[float, float, float]

#: Natural log of the odds below the best at which a noise case is left out (a twentieth); for time.
_NEAR = 3.0
#: Largest power, of either sign; chosen: beyond, a term acts at one end of the tests only.
_LARGEST_POWER = 4.0
#: Number of powers along each axis of the grid, and half width of the grid about the likeliest pair [standard errors].
_GRID, _REACH = 13, 4.0
#: Largest number of iterations, and the change of a power, in standard errors, at which they have converged.
_ROUNDS, _RESTS = 20, 0.1
#: Longest step of a parameter in one iteration, and its least distance from its limits, in fitting coordinates.
_LONGEST, _INSIDE = 1.0, 1e-6
#: Dampings of a step, relative to the information on a parameter; usual for such methods.
_DAMPINGS = (0.0, 0.03, 0.1, 0.3, 1.0, 3.0)
#: Draws of the posterior; chosen: they determine the ends of an interval within a fiftieth of its length.
_DRAWS = 10_000
#: Half width of an interval beyond which a power, or the phase [deg], is not determined.
_POWER_WIDTH, _PHASE_WIDTH = 0.75, 60.0
#: Standard errors within which a known law may lie for the term to act like it, in phase and powers each.
_LIKE = 2.5
#: Known laws: phase [deg], power of frequency, power of amplitude, quantities, text.
_LAWS: tuple[tuple[float, float, float, tuple[Quantity, ...], str], ...] = (
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
_QUANTITIES: dict[Quantity, str] = {
    "stiffness": "equal in N/mm in every direction",
    "modulus": "equal as a modulus over strain",
    "gain": "equal in % of |K| in every direction",
}
_PHASES = {0: "adds stiffness", 90: "adds loss", 180: "lowers stiffness", -180: "lowers stiffness", -90: "lowers loss"}


@dataclass(frozen=True, eq=False)
class PowerLaw:
    """Power law A e^(i phi) (f/f0)^p (X/X0)^q of the stiffness that a model lacks, with 95 % intervals.

    Args:
        quantity: quantity that the law adds, with the highest evidence: "stiffness" (equal in N/m in every direction),
            "modulus" (equal in Pa over strain) or "gain" (equal as a share of the model's stiffness).
        alternatives: other quantities that fit nearly as well; the intervals average over all of them by probability.
        phase_deg: phase phi [deg], with the ends of its interval.
        frequency_power: power p of frequency, with the ends of its interval.
        amplitude_power: power q of amplitude, with the ends of its interval.
        is_likely: True if the evidence of the power law exceeds that of a smooth curve of any form.
        of_one_place: True if only one direction or specimen was tested, so that the quantities cannot be distinguished.
    """

    quantity: Quantity
    alternatives: tuple[Quantity, ...]
    phase_deg: Interval
    frequency_power: Interval
    amplitude_power: Interval
    is_likely: bool
    of_one_place: bool = False

    @property
    def are_determined(self) -> list[bool]:
        """Three flags: True if the tests determine the phase, the power of frequency and the power of amplitude."""
        widths = (_PHASE_WIDTH, _POWER_WIDTH, _POWER_WIDTH)
        intervals = (self.phase_deg, self.frequency_power, self.amplitude_power)
        return [high - low < 2.0 * width for (_, low, high), width in zip(intervals, widths, strict=True)]

    @property
    def sentence(self) -> str:
        """Text on the power law, such as "the correction acts like a damper: adds loss, independent of amplitude".

        A phase, power or unit that the tests do not determine is left out.
        """
        phase, low, high = self.phase_deg
        near = next((text for quarter, text in _PHASES.items() if low <= quarter <= high), "")
        turned = np.exp(1j * np.radians(phase))
        stiffness, loss = ("adds" if part > 0.0 else "lowers" for part in (turned.real, turned.imag))
        parts = [near or f"{stiffness} stiffness and {loss} loss"] * self.are_determined[0]
        powers = ((self.frequency_power, "frequency"), (self.amplitude_power, "amplitude"))
        for determined, ((value, low, high), axis) in zip(self.are_determined[1:], powers, strict=True):
            if determined and low <= 0.0 <= high:
                parts.append(f"independent of {axis}")
            elif determined:
                parts.append(f"{'grows' if value > 0 else 'falls'} with {axis} to the power {number(value, 2)}")
        quantities = (self.quantity, *self.alternatives)
        if not self.of_one_place and len(quantities) < len(_QUANTITIES):
            parts.append(" or ".join(_QUANTITIES[quantity] for quantity in quantities))
        like = self._known_law() if all(self.are_determined) else ""
        form = ", ".join(parts) or "has a form that these tests do not determine"
        return f"the correction acts like {like}: {form}" if like else f"the correction {form}"

    def _known_law(self) -> str:
        """Name of the element (spring, damper, ...) with nearly the phase and powers of this law; "" without one."""
        ends = np.array([self.phase_deg, self.frequency_power, self.amplitude_power])[:, 1:]
        errors = np.maximum(np.ptp(ends, axis=1) / 2.0 / Z95, 1e-9)
        distances = {}
        for *law, quantities, text in _LAWS:
            if {self.quantity, *self.alternatives} & {*quantities}:
                deviation = ends.mean(axis=1) - law
                deviation[0] = (deviation[0] + 180.0) % 360.0 - 180.0
                distances[text] = float(np.max(np.abs(deviation) / errors))
        nearest = min(distances.values())
        return " or ".join(text for text in distances if distances[text] == nearest) if nearest < _LIKE else ""


@dataclass(frozen=True, eq=False)
class Term:
    """Complex stiffness that a model lacks at p operating points, in one of three quantities, to fit by a power law.

    The points are those of all tests except tests of coupons. In the methods, `value` is the added stiffness, modulus
    or share of the stiffness at the points, complex (p,): an amount times a shape.

    Args:
        fit: the fitted model and the tests.
        quantity: "stiffness" [N/m or N m/rad], "modulus" [Pa] or "gain" (share of the model's stiffness).
    """

    fit: FitResult
    quantity: Quantity

    @cached_property
    def tests(self) -> list[tuple[MeasuredTest, slice]]:
        """Tests to which the stiffness is added, each with the slice of its operating points among all points."""
        tests = [test for test in self.fit.data_sets if test.direction.motion is not STRAINING]
        ends = np.cumsum([0, *(test.frequency.size for test in tests)]).tolist()
        return [(test, slice(*pair)) for test, pair in zip(tests, pairwise(ends), strict=True)]

    @cached_property
    def points(self) -> Array:
        """Centred natural logs of frequency and motion (displacement, rotation or strain) at each point, (p, 2)."""
        strain = self.fit.model.unit_strain if self.quantity != "stiffness" else lambda _: 1.0
        axes = [(test.frequency, test.amplitude * strain(test.direction)) for test, _ in self.tests]
        points = np.log(np.concatenate(axes, axis=-1).T)
        return points - points.mean(axis=0)

    def stiffness(self, model: Model) -> Array:
        """Complex stiffness of a model at each of the p operating points, (p,) [N/m or N m/rad]."""
        return np.concatenate(
            [model.stiffness(test.direction, test.frequency, test.amplitude, kind=test.kind) for test, _ in self.tests]
        )

    def unit(self, model: Model) -> Array:
        """Stiffness that one unit of `quantity` adds at each of the p operating points, (p,) [N/m or N m/rad]."""
        if self.quantity == "gain":
            return self.stiffness(model)
        per_unit = model.stiffness_per_modulus if self.quantity == "modulus" else lambda _: 1.0
        return np.concatenate([np.full(test.frequency.size, per_unit(test.direction)) for test, _ in self.tests])

    def scale_shapes(self, shapes: Array, model: Model) -> Array:
        """Scale c shapes of the added stiffness, (c, p), so that each changes the model's |K| by at most 100 %."""
        return shapes / np.abs(shapes * self.unit(model) / self.stiffness(model)).max(axis=-1)[:, None]

    def residual(self, value: Array, model: Model) -> Array:
        """Return whitened residuals, (n,), of tests and priors if `value`, (p,), is added to a model's stiffness."""
        residuals, added = self.fit.problem.residual(model), value * self.unit(model)
        for test, points in self.tests:
            rows = self.fit.residual_rows[test]
            if isinstance(test, MeasuredSweep):
                residuals[rows] = test.whiten(test.deviation(test.response(model) + added[points]))
            else:
                residuals[rows] += test.residual_change(added[points], model)
        return residuals

    def linearise(self, model: Model, value: Array, shapes: Array) -> tuple[Array, Array, Array]:
        """Linearise the whitened residuals around a model with the added stiffness.

        Args:
            model: model at its current parameters.
            value: added stiffness at the operating points, (p,).
            shapes: c shapes of the added stiffness, (c, p).

        Returns:
            Residuals extrapolated to no added stiffness, (n,); derivatives with respect to the coordinates of the
            parameters, (k, n); and with respect to the amounts of each shape in phase and in quadrature, (c, 2, n).
        """
        names, place = self.fit.coordinates.names, self.fit.residual_rows
        added, changes = value * self.unit(model), np.concatenate((shapes, 1j * shapes)) * self.unit(model)
        residuals, rows = self.residual(value, model), self.fit.problem.linearise(model)[1]
        slopes = Coordinates.of_parameters(model, names).slopes(model.values)[:, None]
        columns = np.zeros((len(changes), residuals.size))
        for test, points in self.tests:
            columns[:, place[test]] = test.residual_change(changes[:, points], model, added[points])
            residuals[place[test]] -= test.residual_change(added[points], model, added[points])
            share = added[points] if self.quantity == "gain" else 0.0  # which stays proportional to the stiffness
            if isinstance(test, MeasuredSweep):
                stepped, steps = stepped_values(model, names, test.direction)
                stiffness, change = difference_quotients(test.response(model, stepped), steps)
                change = (1.0 + share / stiffness) * change
                rows[:, place[test]] = slopes * test.residual_change(change, model, added[points])
            else:
                change = share * log_slopes(model, test, names)
                rows[:, place[test]] += slopes * test.residual_change(change, model)
        return residuals, rows, columns.reshape(2, len(shapes), -1).swapaxes(0, 1)


def nearest_power_law(
    fitted: FitResult, rig: RigSettings, start: Mapping[str, float], bounds: Bounds
) -> PowerLaw | None:
    """Estimate the power law nearest to the gap of a fitted model.

    Args:
        fitted: the fitted model and the tests.
        rig: stated accuracy class of the rig (gain and phase errors).
        start: starting values estimated from the data, because the gap may distort the fitted values.
        bounds: limits of parameters inside their general limits.

    Returns:
        The law, with intervals; None if the tests show none.
    """
    fit, model = in_scatter_units(fitted), fitted.model
    begun = model.with_values({name: value for name, value in start.items() if name in model.values})
    rows, errors = fit.jacobian, rig_errors(fit, rig)
    curves = SignatureSet.split([curve.signature for curve in unnamed_curves(fit)], errors)
    cases = LinearModel(fit.residual, rows, np.zeros(len(rows)), errors).likely_cases(curves, _NEAR)
    motions = {test.direction.motion for test in fitted.data_sets} - {STRAINING}
    quantities = [quantity for quantity in _QUANTITIES if motions and (quantity != "stiffness" or len(motions) == 1)]
    terms = [Term(fit, quantity) for quantity in quantities]  # one unit: of translation only, or of rotation only
    settled = (_settled_grid(fitted, term, errors, cases, begun, bounds) for term in terms)
    grids = sorted(filter(None, settled), key=lambda grid: -grid.log_evidence)
    if not grids or grids[0].log_evidence < logsumexp(grids[0].linear.project(cases).base):
        return None
    of_curves = grids[0].linear.explanation_evidence(curves, cases)  # around the same parameters and term
    log_ratios = np.array([grid.log_evidence - grids[0].log_evidence for grid in grids])
    likely = log_ratios > -0.5 * DECISIVE_CHI_SQUARE
    likeliest, *alternatives = [grid.quantity for grid, is_likely in zip(grids, likely, strict=True) if is_likely]
    counts = np.round(_DRAWS * np.exp(log_ratios)).astype(int).tolist()
    draws = np.concatenate([grid.draws(count) for grid, count in zip(grids, counts, strict=True)], axis=-1)
    middle = np.angle(np.exp(1j * draws[0]).mean())
    draws[0] = np.degrees(middle + np.angle(np.exp(1j * (draws[0] - middle))))
    phase, p, q = (tuple(quantiles) for quantiles in np.quantile(draws, (0.5, 0.025, 0.975), axis=-1).T.tolist())
    law = logsumexp(log_ratios) + grids[0].log_evidence - log(len(grids))
    smooth = logsumexp([evidence.log_evidence for evidence in of_curves]) - log(len(of_curves))
    of_one_place = len({test.direction for test in fitted.data_sets}) == 1
    return PowerLaw(likeliest, tuple(alternatives), phase, p, q, bool(law > smooth), of_one_place)


@dataclass(frozen=True, eq=False)
class _Grid:
    """Grid of g pairs of powers of frequency and amplitude, with the evidence for each pair as the missing stiffness.

    Args:
        quantity: quantity that the law adds: "stiffness", "modulus" or "gain" (share of the stiffness).
        linear: residuals linearised around the model without the added stiffness.
        signatures: for each pair of powers, changes of the residuals by a law of unit amount, in phase and in
            quadrature.
        cases: indices of the noise cases (assumed sizes of the rig's errors) to average over, (c,).
        powers: powers of frequency and amplitude, (g, 2).
        step: spacing of the grid along each axis, (2,); 0 along an axis on which the tests do not differ.
    """

    quantity: Quantity
    linear: LinearModel
    signatures: SignatureSet
    cases: Array
    powers: Array
    step: Array

    @cached_property
    def log_evidences(self) -> Array:
        """Natural log of the tests' evidence for each pair of powers of frequency and amplitude, (g,)."""
        return np.array([x.log_evidence for x in self.linear.explanation_evidence([self.signatures], self.cases)])

    @property
    def log_evidence(self) -> float:
        """Natural log of the evidence of the tests, averaged over all pairs of powers with equal prior probability."""
        share = np.where(self.step > 0.0, self.step / (2.0 * _LARGEST_POWER), 1.0)
        return float(logsumexp(self.log_evidences) + np.log(share).sum())

    def draws(self, count: int) -> Array:
        """Draw phase [rad], frequency power and amplitude power from the posterior, (3, count)."""
        random = np.random.default_rng(0)
        chosen = random.choice(len(self.powers), count, p=softmax(self.log_evidences))
        width = np.where(self.step > 0.0, self.step, 2.0 * _LARGEST_POWER)  # an axis without a change is unknown
        powers = self.powers[chosen] + width * (random.random((count, 2)) - 0.5)
        parts, (means, covariances) = np.empty((count, 2)), self.linear.posterior_amounts(self.signatures, self.cases)
        for pair in np.unique(chosen):
            mask = chosen == pair
            parts[mask] = random.multivariate_normal(means[pair], covariances[pair], mask.sum(), method="eigh")
        return np.stack((np.arctan2(parts[:, 1], parts[:, 0]), *powers.T))


def _settled_grid(
    fitted: FitResult, term: Term, rig: RigErrors, cases: Array, model: Model, bounds: Bounds
) -> _Grid | None:
    """Find the powers of frequency and amplitude that fit a gap best, on a grid that narrows about the likeliest pair.

    Args:
        fitted: the fitted model and the tests.
        term: complex stiffness that is added to the model, with its unit.
        rig: errors of the rig.
        cases: indices of the noise cases (assumed sizes of the rig's errors) to average over.
        model: model at its starting parameters.
        bounds: limits of parameters inside their general limits.

    Returns:
        The last grid, linearised around the refitted model and law; None without convergence.
    """
    # at first around the measured stiffness, by which a term of any size is linear
    value = np.concatenate([test.measured - test.noise_free(model).measured for test, _ in term.tests])
    value = value / term.unit(model)
    ends = limits = np.outer((-_LARGEST_POWER, _LARGEST_POWER), np.ptp(term.points, axis=0) > 0.0)
    middle = np.full(2, np.inf)
    for _ in range(_ROUNDS):
        powers = np.array(list(product(*map(np.unique, np.linspace(ends[0], ends[1], _GRID).T))))
        step = np.ptp(ends, axis=0) / (_GRID - 1)
        shapes = term.scale_shapes(np.exp(powers @ term.points.T), model)
        residuals, rows, columns = term.linearise(model, value, shapes)
        signatures = [Signature(pair, np.ones((2, 1)), act_together=True) for pair in columns]
        linear = LinearModel(residuals, rows, np.zeros(len(rows)), rig)
        grid = _Grid(term.quantity, linear, SignatureSet(signatures, rig), cases, powers, step)
        share = softmax(grid.log_evidences)
        before, middle = middle, share @ powers
        spread = np.sqrt(share @ np.square(powers - middle))
        shift = np.abs(middle - before)
        if (shift <= _RESTS * spread).all() and (step <= spread).all():
            return grid
        reach = _REACH * spread + step + np.where(np.isfinite(shift), shift, 0.0)
        ends = np.clip(np.stack((middle - reach, middle + reach)), *limits)
        shape, fitted_term = np.exp(middle @ term.points.T)[None], Term(fitted, term.quantity)
        model, value = _gauss_newton_step(fitted_term, model, value, shape, bounds)
    return None


def _gauss_newton_step(term: Term, model: Model, value: Array, shape: Array, bounds: Bounds) -> tuple[Model, Array]:
    """Take one damped Gauss-Newton step of a model's parameters and of the complex amount of an added stiffness.

    The added stiffness is amount x shape. Of six dampings of the parameters, increased from 0 as long as the misfit
    falls, the one with the smallest misfit is used.

    Args:
        term: added stiffness, with its quantity.
        model: model at its current parameters.
        value: added stiffness at the p points before the step, in the quantity of the term, complex (p,).
        shape: power law of frequency and amplitude at the points, (1, p).
        bounds: limits of parameters inside their general limits.

    Returns:
        The model, and the added stiffness at the points after the step, complex (p,).
    """
    shape = term.scale_shapes(shape, model)
    residuals, rows, columns = term.linearise(model, value, shape)
    design, coordinates = np.concatenate((rows, columns[0])), term.fit.coordinates
    low, high = coordinate_bounds(coordinates, bounds)
    misfit, best = np.inf, (model, value)
    for damping in _DAMPINGS:
        damped = damping * np.diag(np.linalg.norm(design, axis=1))[: len(rows)]
        step = -np.linalg.lstsq(np.vstack((design.T, damped)), np.pad(residuals, (0, len(rows))), rcond=None)[0]
        point = coordinates.point(model.values) + np.clip(step[:-2], -_LONGEST, _LONGEST)
        candidate = model.with_values(coordinates.values(np.clip(point, low + _INSIDE, high - _INSIDE)))
        candidate_value = (step[-2] + 1j * step[-1]) * shape[0]
        norm = float(np.linalg.norm(term.residual(candidate_value, candidate)))
        if norm >= misfit:
            break
        misfit, best = norm, (candidate, candidate_value)
    return best
