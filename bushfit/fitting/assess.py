"""Uncertainty and quality of a fit: covariance, agreement with the tests, measured range, lack of fit.

Warnings name tests that no rubber could produce, tests at different temperatures, and tests that a fit left out.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence

import numpy as np

from bushfit.caveat import Caveat, join_names
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.coordinates import Coordinates
from bushfit.fitting.preparation import (
    MeasuredLoop,
    MeasuredTest,
    operating_conditions,
    repeats_of,
    residual_slices,
    split_by_kind,
)
from bushfit.fitting.problem import FitProblem, SmoothError
from bushfit.geometry import TRANSLATION, Bushing, Direction, stiffness_per_modulus, unit_strain
from bushfit.model.covariance import Covariance
from bushfit.model.model import Model
from bushfit.model.result import PreloadRange, Quality, Range
from bushfit.reading.preload import distinct_preloads
from bushfit.units import CELSIUS, format_range, number

#: Largest excess of the reduced chi-square over 1 that noise alone explains, in standard deviations.
_LACK_OF_FIT = 5.0
#: Standard error, in coordinates of order one, of a combination of parameters that the data do not determine: beyond
#: all bounds, but small enough to cancel in quantities that do not depend on the combination.
_LARGEST_ERROR = 1e3
#: Shear moduli of rubber [Pa], with a margin: from the softest gel of a mount to the hardest compound at small strain.
_SOFTEST, _HARDEST = 5e4, 1e8
#: Largest ratio of the moduli of two tests of one rubber, at high frequency and small strain and the reverse.
_MOST_STIFFENING = 20.0
#: Largest temperature difference of the tests of one fit [K]; chosen: filled rubber softens by up to 1 % per kelvin,
#: and a test chamber keeps its temperature constant within less.
_ONE_TEMPERATURE = 3.0
#: Strain amplitude that no filled rubber endures; chosen: tests reach a third of it, and a wrong prefix is a factor of
#: 1000.
_MOST_STRAIN = 3.0
_CHECK = "check the units of displacement, force and stiffness, and the dimensions of what was tested"


def covariance(
    model: Model, stages: Sequence[FitProblem], fixed: Covariance | None = None, smooth_error: SmoothError | None = None
) -> Covariance:
    """Covariance of all parameters that a procedure estimated, each stage with the results of the others fixed.

    Args:
        model: fitted model.
        stages: fits of the procedure, in order, such as a static and a dynamic fit: their free parameters, and their
            tests with the weights of the fit.
        fixed: covariance of parameters that all stages kept fixed; None if these are exact.
        smooth_error: smooth error of a model that misses its tests by more than their noise; None if the model fits.

    Returns:
        Covariance of the parameter values in SI units. If the residuals of a stage, or of one of its tests, exceed the
        noise, the variance that a test contributes is multiplied by the larger of the two reduced chi-squares. The
        uncertainty of an estimated noise is added after Kenward and Roger (1997); `spread` is its effect on the
        covariance itself. The error of a compliance of the rig, which all tests share, is added as the shift that it
        causes in the parameters.

    Notes:
        Let d be the errors of all parameters. Each stage solves J_s (J_s^T d_s + J_r^T d_r + noise) = 0 for its
        parameters s, while the remaining parameters r have the errors of other stages. With J_s^T = Q R this is Q^T J^T
        d = b, cov(b) = 1, which never squares the Jacobian. Stacked over the stages it is M d = b, so that cov(d) =
        (M^-1 B) (M^-1 B)^T with cov(b) = B B^T. J has one more row per parameter, a weak prior with the standard error
        _LARGEST_ERROR, so that combinations that the data do not determine get a finite error.
    """
    fixed, stages = fixed or Covariance(), [stage for stage in stages if stage.names]
    fixed = fixed.select([name for name in fixed.names if name not in model.tied_names])
    names = (*fixed.names, *(name for stage in stages for name in stage.names))
    slopes = Coordinates.of_parameters(model, names).slopes(model.values)
    system, root = np.eye(len(names)), np.zeros((len(names), len(names)))
    begin = len(fixed.names)
    root[:begin, :begin] = fixed.root / slopes[:begin, None]
    bases = []
    for stage in stages:
        equations = slice(begin, begin + len(stage.names))
        jacobian = FitProblem(model, stage.tests, names).linearise(model)[1]
        jacobian = np.concatenate((jacobian, np.eye(len(names))[:, equations] / _LARGEST_ERROR), axis=1)
        basis = np.linalg.qr(jacobian[equations].T)[0]
        system[equations] = basis.T @ jacobian.T
        excess = np.ones(len(basis))  # 1 in the rows of priors
        blocks = list(zip(stage.tests, residual_slices(stage.tests), strict=True))
        if not smooth_error:
            of_all = lack_of_fit(model, stage.tests, len(stage.names)) or 1.0
            for test, rows in blocks:
                excess[rows] = max(of_all, lack_of_fit(model, [test], 0) or 1.0)
        share = basis.T * np.sqrt(excess)
        root[equations, equations] = np.linalg.qr(share.T)[1].T
        bases.append((equations, share, blocks))
        begin = equations.stop
    reaction = np.linalg.inv(system)
    by_value, reaction = (reaction @ root) * slopes[:, None], reaction * slopes[:, None]
    carried = reaction[:, : len(fixed.names)] / slopes[: len(fixed.names)]
    matrix, spread = by_value @ by_value.T, [carried @ part @ carried.T for part in fixed.spread]
    by_noise, by_compliance = dict[Hashable, tuple[Array, Array]](), np.zeros(len(names))
    for equations, basis, blocks in bases:
        influence = reaction[:, equations] @ basis
        for test, rows in blocks:
            if test.compliance_error and test.direction.motion is TRANSLATION:
                stiffness = model.stiffness(test.direction, test.frequency, test.amplitude, kind=test.kind)
                by_compliance += influence[:, rows] @ test.residual_change(test.compliance_error * stiffness**2, model)
        if smooth_error:  # uncertainty of the noise is negligible compared with this error
            by_error = smooth_error.project(influence) @ smooth_error.columns.T
            added = by_error @ by_error.T
            spread.append(added * np.sqrt(2.0 / smooth_error.freedom))
            matrix = matrix + added + sum(test.extra_covariance(influence[:, rows]) for test, rows in blocks)
            continue
        for test, rows in blocks:
            if isinstance(test, MeasuredLoop) and not test.gain_weighs:  # its gain error is not in the weights
                change = test.gain_error * (influence[:, rows] @ test.gain_and_offset()[0])
                matrix = matrix + np.outer(change, change)
        for variance, (change, lost) in _changes_by_noise(blocks, influence, basis).items():
            changes, losses = by_noise.get(variance, (0.0, 0.0))
            by_noise[variance] = changes + change, losses + lost
    matrix = matrix + np.outer(by_compliance, by_compliance)
    for change, lost in by_noise.values():
        size = np.sqrt(np.diag(matrix))
        scale = np.outer(size, size) + np.finfo(float).tiny
        values, vectors = np.linalg.eigh(lost / scale)  # negative eigenvalues are rounding errors
        matrix = matrix + 2.0 * (vectors * np.maximum(values, 0.0)) @ vectors.T * scale
        spread.append(change)
    mixing = np.vstack([np.eye(len(names)), model.constraints.slopes(model.values, names).T])
    with_ties = (mixing @ part @ mixing.T for part in (matrix, *spread))
    return Covariance((*names, *model.tied_names), next(with_ties), tuple(with_ties))


def _changes_by_noise(
    blocks: Sequence[tuple[MeasuredTest, slice]], influence: Array, basis: Array
) -> dict[Hashable, tuple[Array, Array]]:
    """Changes of the parameters' covariance by errors of the estimated noise variances, by name of the variance.

    Args:
        blocks: tests of one fit, with the slice of the residuals of each.
        influence: change of each of the k parameters per unit of each of the n whitened residuals, (k, n).
        basis: r orthogonal rows that span the Jacobian of the parameters of this fit, (r, n).

    Returns:
        For each noise variance: change of the covariance if the variance is larger by one standard error, and the
        covariance that the then wrong weights of the fit add, (k, k) each.
    """
    unit, sums = basis / np.linalg.norm(basis[0]), dict[Hashable, list[Array]]()
    for test, rows in blocks:
        of_test = influence[:, rows]
        for variance, move in test.noise_sensitivity(of_test).items():
            products = [move @ of_test.T, move @ move.T, move @ unit[:, rows].T]
            so_far = sums.get(variance, [0.0] * 3)
            sums[variance] = [one + previous for one, previous in zip(products, so_far, strict=True)]
    return {variance: (first, second - lost @ lost.T) for variance, (first, second, lost) in sums.items()}


def linear_errors(jacobian: Array) -> Array:
    """Standard errors of k parameters in their dimensionless coordinates (mostly ln value), (k,).

    The noise is assumed to be known and the model to be correct; `covariance` makes neither assumption.

    Args:
        jacobian: derivatives of the n whitened residuals with respect to the coordinates, (k, n).
    """
    root = np.linalg.qr(np.concatenate((jacobian.T, np.eye(len(jacobian)) / _LARGEST_ERROR)))[1]
    return np.linalg.norm(np.linalg.inv(root), axis=1)


def reduced_chi_square(model: Model, data_sets: Sequence[MeasuredTest], parameters: int) -> tuple[float, int]:
    """Reduced chi-square of a model over all tests, and its degrees of freedom.

    Args:
        model: model to compare.
        data_sets: tests.
        parameters: number of fitted parameters.

    Returns:
        Reduced chi-square, and its degrees of freedom: residuals with weight minus parameters, at least 1.
    """
    chi_square, freedom = 0.0, -parameters
    for test in data_sets:
        residuals = test.residual(model)
        chi_square += float(residuals @ residuals)
        freedom += test.residual_count
    return chi_square / max(freedom, 1), max(freedom, 1)


def lack_of_fit(model: Model, data_sets: Sequence[MeasuredTest], parameters: int) -> float | None:
    """Reduced chi-square if it exceeds 1 by more than 5 of its standard deviations (a lack of fit); else None.

    Args:
        model: fitted model.
        data_sets: tests.
        parameters: number of fitted parameters.
    """
    return excess_chi_square(*reduced_chi_square(model, data_sets, parameters))


def excess_chi_square(chi_square: float, freedom: int) -> float | None:
    """Return the reduced `chi_square` if it exceeds 1 by more than noise explains; otherwise None.

    The limit is 5 standard deviations of a reduced chi-square with `freedom` degrees of freedom.
    """
    return chi_square if chi_square > 1.0 + _LACK_OF_FIT * np.sqrt(2.0 / freedom) else None


def misfit_warnings(model: Model, data_sets: Sequence[MeasuredTest], parameters: int) -> Iterator[Caveat]:
    """Yield a warning if the model misses all tests together, or one test, by more than the noise.

    Args:
        model: fitted model.
        data_sets: tests.
        parameters: number of fitted parameters.

    Yields:
        One warning with the reduced chi-square, and the test that is missed most; none for a model that fits.
    """
    chi_square, freedom = reduced_chi_square(model, data_sets, parameters)
    by_test = {test.name: lack for test in data_sets if (lack := lack_of_fit(model, [test], 0)) is not None}
    if by_test or excess_chi_square(chi_square, freedom) is not None:
        worst = max(by_test, key=lambda name: by_test[name], default="")
        in_worst = f", {number(by_test[worst], 2)} in {worst}" if len(data_sets) > 1 and worst else ""
        tests = join_names(sorted({f"{test.kind}s" for test in data_sets}))
        missed = f"the model misses the {tests} by more than their noise (reduced chi-square {number(chi_square, 2)}"
        yield Caveat("misfit", f"{missed}{in_worst}): intervals are invalid, though standard errors are scaled up")


def quality(model: Model, data_sets: Sequence[MeasuredTest], parameters: int) -> Quality:
    """Agreement of a model with all its tests: NRMSE, reduced chi-square, number of residuals, relative noise.

    Args:
        model: fitted model.
        data_sets: tests.
        parameters: number of fitted parameters.

    Returns:
        Measures over all tests together; `loop_gain_error` is None without loops.
    """
    squares, counts = list[Array](), [test.residual_count for test in data_sets]
    for test in data_sets:
        squares.append(np.square(test.relative_distance(model)))
    loops, _ = split_by_kind(data_sets)
    repeats = np.count_nonzero(repeats_of(loops), axis=1)
    return Quality(
        nrmse=float(np.sqrt(np.mean(np.concatenate(squares)))),
        reduced_chi_square=reduced_chi_square(model, data_sets, parameters)[0],
        points=sum(counts),
        noise=float(np.sqrt(np.average(np.square([test.relative_noise for test in data_sets]), weights=counts))),
        loop_gain_error=float(np.max([loop.gain_error for loop in loops] / np.sqrt(repeats))) if loops else None,
    )


def measured_range(model: Model, data_sets: Sequence[MeasuredTest]) -> Range:
    """Ranges of the frequencies, strains, temperatures and preloads of tests, and the tested directions.

    Returns:
        Ranges of frequency [Hz], equivalent strain amplitude [1], temperature [K] and preload, and tested directions.
    """
    found = [str(data_set.direction) for data_set in data_sets]
    directions = tuple(dict.fromkeys([*(str(direction) for direction in Direction if direction in found), *found]))
    kelvin = [np.ravel(data_set.test.temperature) for data_set in data_sets if data_set.test.temperature is not None]
    axes = [*operating_conditions(model.bushing, data_sets), *([np.concatenate(kelvin)] if kelvin else [])]
    ends = [(float(axis.min()), float(axis.max())) for axis in axes]
    temperature = ends[2] if kelvin else None
    return Range(ends[0], ends[1], directions, temperature, tuple(preload_ranges(data_sets)))


def preload_ranges(data_sets: Sequence[MeasuredTest]) -> list[PreloadRange]:
    """Ranges of preload of the directions and specimens that were tested at two preloads or more.

    Returns:
        For each direction or specimen, the smallest and largest preload [m, rad, N or N m] and the number of preloads.
        A direction whose preloads are displacements in some tests and forces in others is left out.
    """
    ranges = []
    for place in dict.fromkeys(test.direction for test in data_sets):
        preloads = [test.test.preload for test in data_sets if test.direction == place and test.test.preload]
        if len(distinct := distinct_preloads(preloads)) > 1:
            low, high = distinct[0], distinct[-1]
            ranges.append(PreloadRange(str(place), low.unit, low.value, high.value, len(distinct)))
    return ranges


def implausible_modulus(bushing: Bushing | None, data_sets: Sequence[MeasuredTest]) -> list[Caveat]:
    """Warning about shear moduli that no rubber has (below 50 kPa, above 100 MPa, or 20 times apart): wrong units.

    Returns:
        At most one warning.
    """
    moduli = {
        data_set.name: float(np.median(np.abs(data_set.measured))) / stiffness_per_modulus(bushing, data_set.direction)
        for data_set in data_sets
    }
    softest, hardest = (pick(moduli, key=moduli.__getitem__) for pick in (min, max))
    ratio = moduli[hardest] / moduli[softest]
    if ratio > _MOST_STIFFENING:
        sentence = f"{hardest} shows {number(ratio, 2)} times the modulus of {softest}, impossible for rubber: {_CHECK}"
        return [Caveat("implausible_modulus", sentence)]
    sentence = f"{hardest}: a shear modulus of {format_range('Pa', moduli[hardest])} is impossible for rubber: {_CHECK}"
    return [] if _SOFTEST < moduli[hardest] < _HARDEST else [Caveat("implausible_modulus", sentence)]


def check_strain(bushing: Bushing | None, data_sets: Sequence[MeasuredTest]) -> None:
    """Raise a FitError if a test's strain amplitude exceeds 300 %, usually because of a wrong unit or dimension."""
    for data_set in data_sets:
        largest = float(np.max(data_set.amplitude))
        if (strain := largest * unit_strain(bushing, data_set.direction)) > _MOST_STRAIN:
            amplitude = format_range(data_set.direction.motion.displacement_unit, largest)
            raise FitError(
                "the strain of this test is too large for any rubber",
                place=data_set.name,
                found=f"{amplitude}, {data_set.direction}: a strain of {number(100 * strain, 2)} %",
                expected=f"a strain below {100 * _MOST_STRAIN:g} %",
                hint=_CHECK,
            )


def temperature_warning(model: Model, data_sets: Sequence[MeasuredTest]) -> list[Caveat]:
    """Warning about tests whose temperatures differ by more than 3 K, if the model has no effect of temperature.

    Returns:
        At most one warning.
    """
    degrees = [(data_set.name, data_set.test.temperature) for data_set in data_sets]
    temperatures = sorted((float(np.mean(kelvin)) - CELSIUS, name) for name, kelvin in degrees if kelvin is not None)
    if not temperatures or "temperature" in model.effects:
        return []
    (low, coldest), (high, warmest) = temperatures[0], temperatures[-1]
    if high - low <= _ONE_TEMPERATURE:
        return []
    tested = f"{warmest} was tested at {number(high, 3)} degC and {coldest} at {number(low, 3)} degC"
    sentence = (
        f"{tested}, {number(high - low, 3)} degC apart. This model has no effect of temperature, so another "
        "effect may absorb the difference: fit with --effect temperature, or fit each temperature alone"
    )
    return [Caveat("temperatures_differ", sentence)]


def mixed_condition_warnings(data_sets: Sequence[MeasuredTest]) -> Iterator[Caveat]:
    """Yield warnings on tests of different specimens or preloads, which one model does not describe.

    Args:
        data_sets: fitted tests.

    Yields:
        A warning if the tests are of several specimens, and one if they were made under several preloads.
    """
    labels = {"specimen_number": "of specimens", "preload": "under preloads of"}
    if preload_ranges(data_sets):  # the fit decides on an influence of the preload
        del labels["preload"]
    for key, words in labels.items():
        by_value: dict[str, str] = {}
        for data_set in data_sets:
            conditions = data_set.source.conditions if data_set.source else {}
            if key in conditions and data_set.direction.axis:
                by_value.setdefault(str(conditions[key]), data_set.name)
        if len(by_value) > 1:
            listed = ", ".join(f"{value} ({name})" for value, name in by_value.items())
            sentence = f"the tests are {words} {listed}, and one model is fitted to all"
            yield Caveat("mixed_conditions", f"{sentence}: fit each group in a separate campaign")


def unfitted_warnings(model: Model, data_sets: Sequence[MeasuredTest]) -> Iterator[Caveat]:
    """Yield warnings on tests that were not fitted.

    Args:
        model: fitted model.
        data_sets: tests that were not fitted.

    Yields:
        A warning for each direction in which the model misses tests by more than their noise.
    """
    misses = dict[str, list[tuple[float, float, str]]]()
    for test in data_sets:
        if (chi_square := lack_of_fit(model, [test], 0)) is not None:
            share = 100.0 * float(np.sqrt(np.mean(np.square(test.relative_distance(model)))))
            misses.setdefault(str(test.direction), []).append((float(np.sqrt(chi_square)), share, test.name))
    for place, found in misses.items():
        noises, share, worst = max(found)
        missed = f"was not fitted, and the model misses it by {number(share, 2)} % (NRMSE),"
        if len(found) > 1:
            smallest, largest = (number(end(share for _, share, _ in found), 2) for end in (min, max))
            missed = f"were not fitted, and the model misses them by {smallest} to {largest} % (NRMSE), {worst} by"
        subject = f"{worst}, {place}," if len(found) == 1 else f"{len(found)} tests, {place},"
        yield Caveat("unfitted_test_missed", f"{subject} {missed} {number(noises, 2)} times its noise")
