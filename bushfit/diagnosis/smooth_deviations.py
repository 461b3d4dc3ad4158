"""Smooth deviations of the stiffness from a model: of the compound, and curves without a name.

Both are Gaussian processes over ln frequency and ln strain (Kennedy and O'Hagan, 2001). No rubber follows a few
parameters exactly. The deviation of the compound is the same function in every direction and on every specimen, while
errors of a rig differ between them. So the deviation is part of every hypothesis, with the sizes and weights of
`priors.COMPOUND`, and no effect is named for a gap that it explains. Where a compound deviates, the one strain that
stands for the uneven field of a direction is inexact too, and so is the stiffness of a direction for a modulus of 1.
The rubber may also relax faster than the tests. This relaxation changes the loss at the highest frequencies, in
proportion to frequency, more sharply than a process of the lengths `COMPOUND_LENGTHS`; a delay looks like it.
"""

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from itertools import product
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from bushfit.diagnosis.explanations import Explanation, Signature
from bushfit.effects.contract import Array
from bushfit.fitting.discrepancy import COMPOUND_LENGTHS
from bushfit.fitting.loop_harmonics import SMOOTH_HARMONICS
from bushfit.fitting.preparation import (
    MeasuredLoop,
    MeasuredSweep,
    MeasuredTest,
    group_repeats,
    split_by_kind,
)
from bushfit.fitting.problem import FitResult
from bushfit.gaussian_process import coordinates, in_lengths, matern, patterns
from bushfit.geometry import stiffness_per_modulus
from bushfit.reading.measurement import SAME_TEMPERATURE
from bushfit.reduction.harmonics import basis

#: Name of the compound's own deviation among unnamed explanations.
COMPOUND = "compound"
#: Family of the power laws without a name.
POWER_LAW = "power law"
#: Minimum variance of a pattern of the compound's deviation relative to the largest: the patterns left out are together
#: less than a tenth of the deviation (standard deviation) at each operating point.
_MINIMUM_VARIANCE = 3e-4
#: Fraction of the compound's deviation that changes over the shorter lengths of a smooth curve: yield and breakdown set
#: in within a factor of 2 or 3 of the strain.
_COMPOUND_ROUGHNESS = 0.25
#: Correlation lengths of a curve without a name in ln frequency and ln strain: smooth, and rough.
_CURVE_LENGTHS = {"smooth": (1.5, 1.2), "rough": (0.5, 0.5)}
#: Limits of a curve: number of its nodes and patterns, and least variance of a pattern relative to the largest.
_CURVE_PATTERNS = {"nodes": 150, "count": 16, "minimum": 1e-4}
#: Powers of frequency and of amplitude of a law without a name: those of dampers, masses, cubic springs, dry friction.
_POWERS = (-1, 0, 1, 2)
#: Powers of the stiffness K to which a relative change in all directions may be proportional: an added stiffness, equal
#: in N/mm, a gain and a compliance.
_COMMON_CHANGES = {"equal stiffness": -1, "equal gain": 0, "equal compliance": 1}
#: Last overtone of a compound's deviation in a steady cycle, and number of waves of its deviation in the first cycle.
_LAST_OVERTONE, _TRANSIENT_WAVES = 13, 6
#: Number of phases of a cycle at which harmonics are summed: about six per period of the highest harmonic.
_PHASES = 32
#: Error of ln strain in one direction over the deviation of the compound: 10 % beside the usual 2 %, because one strain
#: stands for an uneven field; and step of ln strain in difference quotients. With this error the 95 % interval of a
#: radial stiffness factor contained its true value in 115 of 118 simulated campaigns of 14 rubbers of other laws.
_STRAIN_ERROR, _STRAIN_STEP = 5.0, 1e-3
#: Relative error of the stiffness in one direction over the deviation of the compound: 1 % beside the usual 2 %, within
#: which formulas of a shape agree with finite elements. Without it, a stop or a preload is found in this difference.
_STIFFNESS_ERROR = 0.5


def compound_signature(fit: FitResult) -> Signature | None:
    """Changes of the residuals if the modulus of the rubber compound deviates smoothly from the model's laws.

    The relative deviation is a Gaussian process over frequency and strain, the same in all directions and specimens.

    Args:
        fit: fitted model and tests.

    Returns:
        Signature with one column for each independent pattern of the deviation (together of unit variance at each
        operating point) and for each deviation of a loop's shape; None without tests.
    """
    if not fit.data_sets:
        return None
    limits: dict[str, Any] = {"minimum": _MINIMUM_VARIANCE, "correlate": _compound_correlation}
    smooth = _smooth_changes(fit, fit.data_sets, COMPOUND_LENGTHS, **limits)
    columns, changes = map(np.concatenate, zip(smooth, _formula_changes(fit), fast_relaxation(fit), strict=True))
    for loops in group_repeats(split_by_kind(fit.data_sets)[0]):
        columns = np.concatenate((columns, _repeat_changes(fit, loops, compound_shapes)))
    stiffness_change = np.zeros((len(columns), changes.shape[-1]), dtype=complex)
    stiffness_change[: len(changes)] = changes
    return Signature(columns, stiffness_change, act_together=True)


def _formula_changes(fit: FitResult) -> tuple[Array, Array]:
    """Changes of residuals and stiffness due to errors of the formulas of strain and stiffness in each direction.

    Returns:
        Changes of the n whitened residuals, (2 d, n), and of the stiffness at all operating points, (2 d, points), due
        to the errors of strain and stiffness in d directions or specimens. With a single direction d is 0, because its
        errors only rescale the compound's parameters.
    """
    model, tests = fit.model, fit.data_sets
    directions = list(dict.fromkeys(test.direction for test in tests))
    directions = directions if len(directions) > 1 else []
    changes = list[Array]()
    for test in tests:
        stiffness, nearby = (
            model.stiffness(test.direction, test.frequency, scale * test.amplitude, kind=test.kind)
            for scale in (1.0, 1.0 + _STRAIN_STEP)
        )
        acts = np.array([direction == test.direction for direction in directions], dtype=float)
        errors = _STRAIN_ERROR * (nearby / stiffness - 1.0) / _STRAIN_STEP, np.full_like(stiffness, _STIFFNESS_ERROR)
        changes.append(np.kron(acts[:, None], errors))
    change = np.concatenate(changes, axis=-1)
    return residual_changes(fit, tests, change), change


def fast_relaxation(fit: FitResult) -> tuple[Array, Array]:
    """Changes of residuals and stiffness due to a relaxation of the rubber compound that is faster than the tests.

    Far below its own frequency, a relaxation is a loss modulus proportional to frequency, as the phase of a delay is.
    The changes are those for a loss modulus that equals the median modulus |K|/(stiffness per modulus) of the tests at
    their highest frequency.

    Returns:
        Changes of the n whitened residuals, (1, n), and relative changes of the stiffness at all operating points, (1,
        points).
    """
    model, tests = fit.model, fit.data_sets
    factors = [stiffness_per_modulus(model.bushing, test.direction) for test in tests]
    modulus = np.median(np.concatenate([np.abs(test.measured) / k for test, k in zip(tests, factors, strict=True)]))
    loss = 1j * modulus / max(float(test.frequency.max()) for test in tests)
    changes = [
        loss * factor * t.frequency / model.stiffness(t.direction, t.frequency, t.amplitude, kind=t.kind)
        for t, factor in zip(tests, factors, strict=True)
    ]
    change = np.concatenate(changes)[None]
    return residual_changes(fit, tests, change), change


def _compound_correlation(points: Array, nodes: Array) -> Array:
    """Correlation of the rubber's smooth deviation between n points, (n, 2), and m nodes, (m, 2), as a matrix (n, m).

    The columns are ln frequency and ln strain in units of the correlation lengths.

    >>> _compound_correlation(np.zeros((1, 2)), np.array([[0.0, 0.0], [0.0, 0.4]])).round(3)
    array([[1.   , 0.862]])
    """
    ratio, share = np.divide(COMPOUND_LENGTHS, _CURVE_LENGTHS["smooth"]), _COMPOUND_ROUGHNESS**2
    return (matern(points, nodes) + share * matern(points * ratio, nodes * ratio)) / (1.0 + share)


def compound_shapes(loop: MeasuredLoop) -> Array:
    """Changes of a loop's residuals by the overtones of its force, if the rubber's stiffness deviates by 100 %.

    Returns:
        Changes of the loop's n whitened residuals for c independent deviations, one standard deviation each, (c, n).

    Notes:
        An isotropic rubber is symmetric, so a steady cycle has odd overtones only. Overtone h decreases as 1/h^2,
        because the force is continuous with kinks where the motion turns back. The first cycle from rest may also
        deviate, by as much as a third overtone without this decrease.
    """
    if loop.fundamental_only:
        return np.empty((0, loop.size))
    phase, order = loop.phase, np.arange(3, _LAST_OVERTONE + 1, 2)[:, None]
    angle = 2.0 * np.pi * order * phase
    waves = np.concatenate([np.cos(angle) / order**2, np.sin(angle) / order**2])
    if loop.from_rest:
        order = np.arange(_TRANSIENT_WAVES)[:, None]
        first = np.cos(np.pi * order * phase) * (phase < 1.0)
        waves = np.concatenate([waves, first / (3.0 * (1.0 + order))])
    return loop.force_changes(waves)


def unnamed_curves(fit: FitResult) -> list[Explanation]:
    """List smooth curves over frequency and strain that can explain a gap for which the library has no effect.

    A curve is a smooth complex relative change of the stiffness that all sweeps of one direction and temperature share.

    Args:
        fit: the fitted model and the tests.

    Returns:
        A smooth and a rough curve (Gaussian process) for each direction, a rough one for all directions together, and
        one explanation for the harmonics of all loops.
    """
    loops, sweeps = split_by_kind(fit.data_sets)
    curves: dict[str, Signature] = {}
    levels: dict[tuple[str, Hashable], list[MeasuredSweep]] = defaultdict(list)  # by direction and temperature
    for sweep in sweeps:
        kelvin = sweep.test.temperature
        level = None if kelvin is None else round(float(np.mean(kelvin)) / SAME_TEMPERATURE)
        levels[str(sweep.direction), level].append(sweep)
    directions: dict[str, list[Array]] = defaultdict(list)  # masks of operating points
    for (direction, _), chosen in levels.items():
        points = np.concatenate([np.full(sweep.frequency.size, sweep in chosen) for sweep in sweeps])
        directions[direction].append(points)
    for roughness, lengths in _CURVE_LENGTHS.items() if sweeps else ():
        columns, changes = _smooth_changes(fit, sweeps, lengths, **_CURVE_PATTERNS)
        span = fit.row_span(sweeps), fit.residual.size
        for direction, masks in directions.items():
            of_direction = np.concatenate([changes * points for points in masks])
            of_rows = residual_changes(fit, sweeps, of_direction)[:, span[0]].copy()
            curves[f"{roughness} {direction}"] = Signature(of_rows, of_direction, act_together=True, covered_rows=span)
        if roughness == "rough" and len(directions) > 1:  # a smooth curve in all directions is the compound's
            curves["rough all"] = Signature(columns[:, span[0]].copy(), changes, act_together=True, covered_rows=span)
    if loops:
        repeats = group_repeats(loops)
        shapes = block_diag(*[basis(np.arange(_PHASES) / _PHASES, SMOOTH_HARMONICS).T] * len(repeats))
        columns = np.concatenate([_repeat_changes(fit, members, MeasuredLoop.smooth_changes) for members in repeats])
        curves["loops"] = Signature(columns, shapes, act_together=True)
    return [Explanation("unnamed", name, name, curve) for name, curve in curves.items()]


def power_laws(fit: FitResult) -> list[Explanation]:
    """List power laws of frequency and amplitude that can explain a gap for which the library has no effect.

    Most single causes act like (f/f0)^p (X/X0)^q with small whole powers: a law that the library lacks, or one that it
    has with the other sign, such as a mass for which the rig compensates too much.

    Args:
        fit: the fitted model and the tests.

    Returns:
        One explanation for each pair of powers, with any phase: for each direction alone, and if there are several for
        all together, with an added stiffness or a relative change or a compliance in common.
    """
    model, tests, explanations = fit.model, fit.data_sets, list[Explanation]()
    stiffness = np.concatenate([model.stiffness(t.direction, t.frequency, t.amplitude, kind=t.kind) for t in tests])
    points = np.concatenate([coordinates(t.frequency, t.amplitude * model.unit_strain(t.direction)) for t in tests])
    directions = np.concatenate([np.full(test.frequency.size, str(test.direction)) for test in tests])
    scopes = {str(name): (directions == name).astype(complex) for name in np.unique(directions)}
    if len(scopes) > 1:
        first = tests[0].direction.motion  # stiffness has one unit among tests with the same kind of motion
        same_unit = np.concatenate([np.full(test.frequency.size, test.direction.motion is first) for test in tests])
        scopes |= {name: stiffness**power * (same_unit | (power == 0)) for name, power in _COMMON_CHANGES.items()}
    powers = list(product(_POWERS, repeat=2))
    laws = np.exp(np.array(powers) @ (points - points.mean(axis=0)).T)
    for scope, change in scopes.items():
        shapes = laws * change
        shapes /= np.abs(shapes).max(axis=1, keepdims=True)
        columns = residual_changes(fit, tests, np.concatenate((shapes, 1j * shapes)))
        for (p, q), pair in zip(powers, columns.reshape(2, len(powers), -1).swapaxes(0, 1), strict=True):
            signature = Signature(pair, np.array([[1.0], [1.0j]]), act_together=True)
            explanations.append(Explanation("unnamed", POWER_LAW, f"f^{p} X^{q}, {scope}", signature))
    return explanations


def _smooth_changes(
    fit: FitResult, tests: Sequence[MeasuredTest], lengths: tuple[float, float], **limits: Any
) -> tuple[Array, Array]:
    """Patterns of a smooth relative change of the stiffness: a Gaussian process of unit variance over operating points.

    Args:
        fit: fitted model and all tests.
        tests: tests in which the stiffness changes.
        lengths: correlation lengths in ln frequency and ln strain.
        limits: limits of the number of patterns, passed to `gaussian_process.patterns`.

    Returns:
        Changes of the n whitened residuals due to q independent patterns in phase and in quadrature, (2 q, n), and the
        complex relative changes of stiffness of these patterns at the points of `tests`, (2 q, points).
    """
    points = [coordinates(test.frequency, test.amplitude * fit.model.unit_strain(test.direction)) for test in tests]
    _, shapes = patterns(in_lengths(np.concatenate(points), lengths), **limits)
    changes = (shapes[:, None] * np.array([[1.0], [1.0j]])).reshape(-1, shapes.shape[-1])
    return residual_changes(fit, tests, changes), changes


def residual_changes(fit: FitResult, tests: Sequence[MeasuredTest], changes: Array) -> Array:
    """Changes of the n whitened residuals due to c relative changes of the stiffness at all points of `tests`, (c, n).

    Args:
        fit: fitted model and all tests.
        tests: tests in which the stiffness changes.
        changes: complex relative changes of the stiffness at the points of `tests`, (c, points).
    """
    columns, ends = np.zeros((len(changes), fit.residual.size)), np.cumsum([test.frequency.size for test in tests])
    for test, change in zip(tests, np.split(changes, ends[:-1], axis=1), strict=True):
        stiffness = fit.model.stiffness(test.direction, test.frequency, test.amplitude, kind=test.kind)
        columns[:, fit.residual_rows[test]] = test.residual_change(change * stiffness, fit.model)
    return columns


def _repeat_changes(fit: FitResult, loops: Sequence[MeasuredLoop], changes: Callable[[MeasuredLoop], Array]) -> Array:
    """Changes of all n whitened residuals due to force errors that repeats of a loop share.

    Args:
        fit: fitted model and all tests.
        loops: repeats of a loop.
        changes: function that returns the changes of a loop's m residuals due to c force errors of unit amount, (c, m).

    Returns:
        Changes of the residuals of all tests, (c, n).
    """
    by_loop = [changes(loop) for loop in loops]
    columns = np.zeros((len(by_loop[0]), fit.residual.size))
    for loop, of_loop in zip(loops, by_loop, strict=True):
        columns[:, fit.residual_rows[loop]] = of_loop
    return columns
