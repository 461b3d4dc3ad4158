"""The uncertainty of a fit and how well it meets the data: covariance, quality, range measured, lack of fit.

Warnings name tests that no rubber could have given, tests at different temperatures, and tests that a fit left out.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np

from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.coordinates import Coordinates, jacobian, residual
from bushfit.fitting.preparation import (
    MeasuredLoop,
    MeasuredTest,
    operating_conditions,
    repeats_of,
    rows_of,
    split_by_kind,
)
from bushfit.geometry import Bushing, Direction, stiffness_per_modulus, unit_strain
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import Quality, Range
from bushfit.units import CELSIUS, format_range, number

#: Distance of the reduced chi-square from 1 beyond which noise alone is no explanation, in standard deviations.
_LACK_OF_FIT = 5.0
#: Standard error given to a combination of parameters that the data leave open, in coordinates, which are of order
#: one: beyond all bounds, and small enough to cancel where a quantity does not depend on the combination.
_LARGEST_ERROR = 1e3
#: Shear moduli of rubber [Pa], with room: from the softest gel of a mount to the hardest compound at small strain.
_SOFTEST, _HARDEST = 5e4, 1e8
#: Modulus of the fastest and smallest test over that of the slowest and largest, at most, for any rubber.
_MOST_STIFFENING = 20.0
#: [K] Range of temperatures that the tests of one fit may have; chosen: filled rubber softens by up to 1 % a kelvin,
#: and a test chamber keeps its temperature within less.
_ONE_TEMPERATURE = 3.0
#: Strain amplitude that no filled rubber bears for long; chosen: tests reach a third, a wrong prefix is 1000 times.
_MOST_STRAIN = 3.0
_CHECK = "check the units of displacement and force, and the dimensions of what was tested"


@dataclass(frozen=True, eq=False)
class Process:
    """A Gaussian process of the relative error of a model, as a part of the covariance of its residuals.

    Args:
        shapes: one standard deviation of each amount at the operating points of all tests, complex (q, p).
        freedom: degrees of freedom that determine its size.
    """

    shapes: Array
    freedom: float

    def moves(self, model: Model, data_sets: Sequence[MeasuredTest], influence: Array) -> Array:
        """Covariance of parameters that it makes, (k, k), by the influence of whitened residuals on them, (k, n).

        Args:
            model: fitted model.
            data_sets: tests.
            influence: of whitened residuals on the parameters, (k, n).

        Returns:
            Covariance in the coordinates of `influence`, (k, k).
        """
        first, changes = 0, np.zeros((len(influence), len(self.shapes)))
        for data_set, rows in zip(data_sets, rows_of(data_sets), strict=True):
            shapes = self.shapes[:, first : first + data_set.frequency.size]
            first += data_set.frequency.size
            changes += (
                influence[:, rows] @ data_set.residual_change(shapes * data_set.noise_free(model).measured, model).T
            )
        return np.asarray(changes @ changes.T)


@dataclass(frozen=True, eq=False)
class FitStage:
    """One fit of a procedure: the parameters it moved, the data it saw, and how the model misses them, if it does."""

    names: tuple[str, ...]
    data_sets: Sequence[MeasuredTest]
    process: Process | None = None


def covariance(model: Model, stages: Sequence[FitStage], fixed: Covariance | None = None) -> Covariance:
    """Covariance of all parameters that a procedure estimated, each stage holding what the others found.

    Args:
        model: fitted model.
        stages: fits of the procedure, in order.
        fixed: covariance of parameters that all stages held.

    Returns:
        By parameter value. Where the residuals of a stage, or of one test of it, exceed its noise, the share of each
        test is inflated by the larger of the two reduced chi-squares. What the error of an estimated noise adds is
        counted as Kenward and Roger (1997) do, and how far the covariance may be off for it goes along as `spread`.

    Notes:
        Each stage solves J_own (J_own^T d_own + J_rest^T d_rest + noise) = 0 for its own parameters while the rest
        carry their own errors. With J_own^T = Q R this is Q^T J^T d = b, cov(b) = 1, which never squares the Jacobian.
        Stacked over the stages it is M d = b, so that cov(d) = (M^-1 B) (M^-1 B)^T with cov(b) = B B^T. Singular values
        of M below 1/_LARGEST_ERROR are lifted to it.
    """
    fixed, stages = fixed or Covariance(), [stage for stage in stages if stage.names]
    names = (*fixed.names, *(name for stage in stages for name in stage.names))
    slopes = Coordinates.of_parameters(model, names).slopes(model.values)
    system, root = np.eye(len(names)), np.zeros((len(names), len(names)))
    begin = len(fixed.names)
    root[:begin, :begin] = fixed.root / slopes[:begin, None]
    bases = []
    for stage in stages:
        equations = slice(begin, begin + len(stage.names))
        slope = jacobian(model, stage.data_sets, names)
        basis = np.linalg.qr(slope[equations].T)[0]
        system[equations] = basis.T @ slope.T
        excess = [1.0] * len(stage.data_sets) if stage.process else _excess(model, stage)
        inflation = np.repeat(excess, [data_set.size for data_set in stage.data_sets])
        share = basis.T * np.sqrt(inflation)
        root[equations, equations] = np.linalg.qr(share.T)[1].T
        bases.append((equations, share))
        begin = equations.stop
    reaction = _inverse(system)
    answer = reaction @ root
    by_value, reaction = answer * slopes[:, None], reaction * slopes[:, None]
    carried = reaction[:, : len(fixed.names)] / slopes[: len(fixed.names)]
    spread = [carried @ part @ carried.T for part in fixed.spread]
    influences = [reaction[:, equations] @ basis for equations, basis in bases]
    matrix = by_value @ by_value.T
    for stage, influence in zip(stages, influences, strict=True):
        if stage.process:
            added = stage.process.moves(model, stage.data_sets, influence)
            blocks = zip(stage.data_sets, rows_of(stage.data_sets), strict=True)
            matrix = matrix + added + sum(data_set.uncounted(influence[:, rows]) for data_set, rows in blocks)
            spread.append(added * np.sqrt(2.0 / stage.process.freedom))
        else:
            matrix = matrix + _of_gains(stage, influence)
    without_process = [not stage.process for stage in stages]  # of the others the noise is the least part
    counted = [
        list(compress(values, without_process)) for values in (stages, influences, [basis for _, basis in bases])
    ]
    for part, lost in _unsure(*counted):
        spread.append(part)
        matrix = matrix + 2.0 * _positive(lost, np.sqrt(np.diag(matrix)))
    return Covariance(names, matrix, tuple(spread))


def _of_gains(stage: FitStage, influence: Array) -> Array:
    """Covariance, (k, k), by gain errors that have no part in the weights, from the influence of residuals, (k, n)."""
    added = np.zeros((len(influence), len(influence)))
    for data_set, rows in zip(stage.data_sets, rows_of(stage.data_sets), strict=True):
        if isinstance(data_set, MeasuredLoop) and not data_set.gain_weighs:
            change = data_set.gain_error * (influence[:, rows] @ data_set.gain_and_offset()[0])
            added += np.outer(change, change)
    return added


def _excess(model: Model, stage: FitStage) -> list[float]:
    """Factor of each test's variance: reduced chi-square where a test, or all together, exceed the noise; else 1."""
    together = lack_of_fit(model, stage.data_sets, len(stage.names)) or 1.0
    return [max(together, single or 1.0) for single in missed(model, stage.data_sets)]


def _positive(matrix: Array, sizes: Array) -> Array:
    """A symmetric matrix without the directions in which it is below zero, those of parameters of these sizes."""
    scale = np.outer(sizes, sizes) + np.finfo(float).tiny
    values, vectors = np.linalg.eigh(matrix / scale)
    return (vectors * np.maximum(values, 0.0)) @ vectors.T * scale


def _inverse(system: Array) -> Array:
    """Inverse of a square matrix, what is open limited to _LARGEST_ERROR."""
    left_vectors, values, right_vectors = np.linalg.svd(system)
    return (right_vectors.T / np.maximum(values, 1.0 / _LARGEST_ERROR)) @ left_vectors.T


def linear_errors(slope: Array) -> Array:
    """Standard errors of parameters in coordinates, (k,), from the derivatives of whitened residuals, (k, n).

    The noise is assumed known and the model correct; `covariance` adds the errors that this leaves out.
    """
    return np.linalg.norm(_inverse(np.linalg.qr(slope.T)[1]), axis=1)


def _unsure(
    stages: Sequence[FitStage], influences: Sequence[Array], bases: Sequence[Array]
) -> list[tuple[Array, Array]]:
    """How far the error of each estimated variance moves the covariance, and what it adds by wrong weights, (k, k).

    Args:
        influences: of each residual of a stage on the parameters, (k, n).
        bases: of the stage's own equations, (own, n).
    """
    parts: dict[Hashable, tuple[Array, Array]] = {}
    for stage, influence, basis in zip(stages, influences, bases, strict=True):
        unit, reactions = basis / np.linalg.norm(basis[0]), dict[Hashable, list[Array]]()
        for data_set, rows in zip(stage.data_sets, rows_of(stage.data_sets), strict=True):
            influence_rows = influence[:, rows]
            for variance, move in data_set.unsure(influence_rows).items():
                products = [move @ influence_rows.T, move @ move.T, move @ unit[:, rows].T]
                so_far = reactions.get(variance, [0.0] * 3)
                reactions[variance] = [one + previous for one, previous in zip(products, so_far, strict=True)]
        for variance, (first_order, squared, absorbed) in reactions.items():
            spread, lost = parts.get(variance, (0.0, 0.0))
            parts[variance] = spread + first_order, lost + squared - absorbed @ absorbed.T
    return list(parts.values())


def reduced(model: Model, data_sets: Sequence[MeasuredTest], parameters: int) -> tuple[float, int]:
    """Reduced chi-square and its degrees of freedom.

    Args:
        model: model to compare.
        data_sets: tests.
        parameters: number of fitted parameters.
    """
    return _over_freedom(residual(model, data_sets), data_sets, parameters)


def _over_freedom(residuals: Array, data_sets: Sequence[MeasuredTest], parameters: int) -> tuple[float, int]:
    """Sum of squares of residuals, (n,), over their degrees of freedom, and these."""
    freedom = max(sum(data_set.counted for data_set in data_sets) - parameters, 1)
    return float(residuals @ residuals) / freedom, freedom


def quality(model: Model, data_sets: Sequence[MeasuredTest], parameters: int) -> Quality:
    """How well a model meets data sets: NRMSE, reduced chi-square, number of residuals, relative noise.

    Args:
        model: fitted model.
        data_sets: tests.
        parameters: number of fitted parameters.

    Returns:
        Figures of the fit over all tests.
    """
    relative = np.concatenate([data_set.relative(model) for data_set in data_sets])
    noise = np.repeat([data_set.relative_noise for data_set in data_sets], [data_set.counted for data_set in data_sets])
    loops, _ = split_by_kind(data_sets)
    repeats = np.count_nonzero(repeats_of(loops), axis=1)
    return Quality(
        nrmse=float(np.sqrt(np.mean(relative**2))),
        reduced_chi_square=reduced(model, data_sets, parameters)[0],
        points=sum(data_set.counted for data_set in data_sets),
        noise=float(np.sqrt(np.mean(noise**2))),
        loop_gain_error=float(np.max([loop.gain_error for loop in loops] / np.sqrt(repeats))) if loops else None,
    )


def measured_range(model: Model, data_sets: Sequence[MeasuredTest]) -> Range:
    """Frequencies [Hz], equivalent strains, directions and temperatures [K] that the data sets reach."""
    found = [str(data_set.direction) for data_set in data_sets]
    directions = tuple(dict.fromkeys([*(str(direction) for direction in Direction if direction in found), *found]))
    kelvin = [np.ravel(data_set.test.temperature) for data_set in data_sets if data_set.test.temperature is not None]
    axes = [*operating_conditions(model.bushing, data_sets), *([np.concatenate(kelvin)] if kelvin else [])]
    ends = [(float(axis.min()), float(axis.max())) for axis in axes]
    return Range(ends[0], ends[1], directions, *ends[2:])


def lack_of_fit(model: Model, data_sets: Sequence[MeasuredTest], parameters: int) -> float | None:
    """Reduced chi-square where the model misses the data by more than their noise, else None.

    Args:
        model: fitted model.
        data_sets: tests.
        parameters: number of fitted parameters.
    """
    return beyond_noise(*reduced(model, data_sets, parameters))


def missed(model: Model, data_sets: Sequence[MeasuredTest]) -> list[float | None]:
    """Reduced chi-square of each test that the model misses by more than its noise; else None."""
    residuals, parts = residual(model, data_sets), zip(rows_of(data_sets), data_sets, strict=True)
    return [beyond_noise(*_over_freedom(residuals[rows], [data_set], 0)) for rows, data_set in parts]


def beyond_noise(chi_square: float, freedom: int) -> float | None:
    """A reduced chi-square that noise is no explanation of, else None."""
    return chi_square if chi_square > 1.0 + _LACK_OF_FIT * np.sqrt(2.0 / freedom) else None


def misfit(model: Model, data_sets: Sequence[MeasuredTest], parameters: int, advice: str = "") -> list[str]:
    """A sentence, with advice, where the model misses all data, or one test, by more than the noise; else none.

    Args:
        model: fitted model.
        data_sets: tests.
        parameters: number of fitted parameters.
        advice: end of the sentence.

    Returns:
        The sentence, or an empty list.
    """
    together = lack_of_fit(model, data_sets, parameters)
    named = zip(data_sets, missed(model, data_sets), strict=True)
    by_test = {data_set.name: chi_square for data_set, chi_square in named if chi_square is not None}
    if together is None and not by_test:
        return []
    worst, all_tests = (
        max(by_test, key=lambda name: by_test[name], default=""),
        reduced(model, data_sets, parameters)[0],
    )
    worst_words = f", {number(by_test[worst], 2)} in {worst}" if len(data_sets) > 1 and worst else ""
    return [
        f"the model misses the data by more than their noise (reduced chi-square {number(all_tests, 2)}{worst_words}): "
        f"intervals are invalid, though standard errors are scaled up{advice}"
    ]


def implausible(bushing: Bushing | None, data_sets: Sequence[MeasuredTest]) -> list[str]:
    """Sentences on moduli that no rubber has, and on tests too far apart to be of one bushing: most often a unit.

    Returns:
        At most one sentence.
    """
    moduli = {
        data_set.name: float(np.median(np.abs(data_set.measured))) / stiffness_per_modulus(bushing, data_set.direction)
        for data_set in data_sets
    }
    softest, hardest = (pick(moduli, key=moduli.__getitem__) for pick in (min, max))
    ratio = moduli[hardest] / moduli[softest]
    if ratio > _MOST_STIFFENING:
        return [f"{hardest} shows {number(ratio, 2)} times the modulus of {softest}, which no rubber does: {_CHECK}"]
    sentence = f"a shear modulus of {format_range('Pa', moduli[hardest])} is that of no rubber: {_CHECK}"
    return [] if _SOFTEST < moduli[hardest] < _HARDEST else [sentence]


def refuse_strain(bushing: Bushing | None, data_sets: Sequence[MeasuredTest]) -> None:
    """Raise a FitError where a test strains its rubber by more than any bears: a unit, or a size, is wrong."""
    for data_set in data_sets:
        largest = float(np.max(data_set.amplitude))
        if (strain := largest * unit_strain(bushing, data_set.direction)) > _MOST_STRAIN:
            amplitude = format_range(data_set.direction.motion.displacement_unit, largest)
            raise FitError(
                "no rubber bears the amplitude of this test",
                place=data_set.name,
                found=f"{amplitude}, {data_set.direction}: a strain of {number(100 * strain, 2)} %",
                expected=f"a strain below {100 * _MOST_STRAIN:g} %",
                hint=_CHECK,
            )


def apart_in_temperature(model: Model, data_sets: Sequence[MeasuredTest]) -> list[str]:
    """A sentence on tests whose temperatures, where they are known, lie too far apart for one model.

    Returns:
        At most one sentence.
    """
    degrees = [(data_set.name, data_set.test.temperature) for data_set in data_sets]
    temperatures = sorted((float(np.mean(kelvin)) - CELSIUS, name) for name, kelvin in degrees if kelvin is not None)
    if (
        not temperatures
        or temperatures[-1][0] - temperatures[0][0] <= _ONE_TEMPERATURE
        or "temperature" in model.effects
    ):
        return []
    (low, coldest), (high, warmest) = temperatures[0], temperatures[-1]
    tested = f"{warmest} was tested at {number(high, 3)} degC and {coldest} at {number(low, 3)} degC"
    return [
        f"{tested}, {number(high - low, 3)} degC apart: this model has no effect of temperature, and another "
        "named effect may be one; fit the tests of each temperature separately, or with --effect temperature"
    ]


def mixed_conditions(data_sets: Sequence[MeasuredTest]) -> list[str]:
    """Warn of tests of the bushing that were made on several specimens, or under several preloads, and fitted as one.

    Args:
        data_sets: tests of a campaign.

    Returns:
        One sentence for each condition that differs.
    """
    sentences = []
    for key, words in (("specimen_number", "of specimens"), ("preload", "under preloads of")):
        by_value: dict[str, str] = {}
        for data_set in data_sets:
            conditions = data_set.source.conditions if data_set.source else {}
            if key in conditions and isinstance(data_set.direction, Direction):
                by_value.setdefault(str(conditions[key]), data_set.name)
        if len(by_value) > 1:
            listed = ", ".join(f"{value} ({name})" for value, name in by_value.items())
            sentences.append(
                f"the tests were made {words} {listed}, and one model is fitted to all: fit each group in a "
                "campaign of its own"
            )
    return sentences


def unfitted(model: Model, data_sets: Sequence[MeasuredTest], advice: str) -> list[str]:
    """A sentence on the tests of each place that a model was not fitted to and misses by more than their noise.

    Args:
        model: fitted model.
        data_sets: tests that were not fitted.
        advice: end of each sentence.
    """
    misses: dict[str, list[tuple[float, float, str]]] = {}
    for data_set in data_sets:
        if (misfit := lack_of_fit(model, [data_set], 0)) is not None:
            share = 100.0 * quality(model, [data_set], 0).nrmse
            misses.setdefault(str(data_set.direction), []).append((float(np.sqrt(misfit)), share, data_set.name))
    return [_missed_at(place, found) + advice for place, found in misses.items()]


def _missed_at(place: str, found: Sequence[tuple[float, float, str]]) -> str:
    """Sentence on the tests of a place that are missed, from times the noise, per cent and name of each."""
    noises, share, worst = max(found)
    times = f"{number(noises, 2)} times its noise"
    if len(found) == 1:
        return f"{worst}, {place}, was not fitted, and the model misses it by {number(share, 2)} % (NRMSE), {times}"
    smallest, largest = (number(end(share for _, share, _ in found), 2) for end in (min, max))
    return (
        f"{len(found)} tests, {place}, were not fitted, and the model misses them by {smallest} to {largest} % "
        f"(NRMSE), {worst} by {times}"
    )
