"""Comparison of the parameters of two fitted results: differences, and their significance singly and together.

The errors of the two results are assumed to be independent.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate

import numpy as np
from scipy.special import fdtrc, stdtr

from bushfit.effects import Parameter
from bushfit.effects.contract import Array
from bushfit.model.covariance import Covariance
from bushfit.model.result import Result
from bushfit.units import number
from bushfit.validation import Number

#: Eigenvalue of a correlation matrix, relative to the largest, below which it is rounding.
_LEAST_EIGENVALUE = 1e-10
#: Smallest value of a parameter, relative to its typical value, in the derivative of its logarithm.
_NOTHING = 1e-9
#: Largest logarithm of the ratio of two quantities: no parameter has bounds further apart.
_FURTHEST = float(np.log(1e10))
#: Name of the parameter that is an exponent in the unit of another parameter: alpha in Pa*s^alpha.
_EXPONENT = re.compile(r"\^([a-z]\w*)$")


@dataclass(frozen=True)
class ParameterContrast:
    """Comparison of one parameter, or of a quantity computed from parameters, between two results.

    Args:
        name: name of the parameter, or of the quantity with its frequency.
        unit: SI unit of both values, and of a difference that is not relative.
        reference, other: value in the reference and in the other result.
        relative: True if the difference is relative to the reference; False if it is in the unit.
        difference: other value minus reference value; None if not tested.
        interval: lower and upper end of the 95 % interval of the difference; None if not tested.
        p: probability of a difference at least as large by chance; None if not tested.
        holm: p adjusted for all parameters tested together (Holm, Scand. J. Statist. 6 (1979) 65).
        note: reason why the difference is not tested; "" if it is tested.
    """

    name: str
    unit: str
    reference: float
    other: float
    relative: bool
    difference: float | None = None
    interval: tuple[float, float] | None = None
    p: float | None = None
    holm: float | None = None
    note: str = ""


@dataclass(frozen=True)
class JointContrast:
    """Test of all parameters of two results together for a difference, with their correlations.

    Args:
        p: probability that chance alone causes such differences.
        parameters: number of independent differences of parameters.
    """

    p: Number
    parameters: int


def compare_parameters(
    reference: Result, compared: Result, frequency: float
) -> tuple[tuple[ParameterContrast, ...], JointContrast | None]:
    """Compare the parameters that both results have, one by one and all together.

    Args:
        reference, compared: fitted results.
        frequency: frequency [Hz] at which parameters like m [Pa s^alpha] are also compared as the modulus
            m (2 pi f)^alpha.

    Returns:
        Comparison of each parameter, and the test of all together, which is None if no parameter is tested.

    Notes: strictly positive parameters are compared by their logarithm. The unit of m depends on alpha, so m itself is
    comparable only at equal alpha; the modulus is comparable at any alpha.
    """
    results, rows = (reference, compared), list[tuple[str, str | None]]()
    for name, parameter in reference.model.parameters.items():
        if name in compared.model.parameters:
            rows.append((name, None))
            exponent = exponent_of(name, parameter)
            if exponent and (
                any(result.covariance.stderr(exponent) for result in results)
                or len({result.model.values[exponent] for result in results}) > 1
            ):
                rows.append((name, exponent))
    sides = [quantities_of(result, rows, 2.0 * np.pi * frequency) for result in results]
    (one, slopes), (two, compared_slopes) = sides
    pairs = (slopes, reference.covariance), (compared_slopes, compared.covariance)
    matrix = np.sum([part @ covariance.matrix @ part.T for part, covariance in pairs], axis=0)
    spread = tuple(part @ group @ part.T for part, covariance in pairs for group in covariance.spread)
    covariance = Covariance(tuple(map(str, range(len(rows)))), matrix, spread)
    difference, error = two - one, np.sqrt(np.diag(matrix))
    half, freedom = covariance.half_width(np.eye(len(rows))), covariance.freedom(np.eye(len(rows)))
    contrasts, tested = list[ParameterContrast](), list[int]()
    for i, (name, exponent) in enumerate(rows):
        parameter = reference.model.parameters[name]
        of_ratio = parameter.log or exponent is not None
        bounds = dict.fromkeys(result.at_bound[name] for result in results if name in result.at_bound)
        note = f"at its {' and '.join(bounds)}" if bounds else ""
        if not note and not np.isfinite(difference[i]):
            note = "zero in one"
        if not note and not error[i]:
            note = "fixed in both"
        if not note and exponent is None:
            tested.append(i)
            if rows[i + 1 : i + 2] == [(name, exponent_of(name, parameter))]:
                note = f"comparable only at equal {exponent_of(name, parameter)}"
        label = f"{name} at {number(frequency, 3)} Hz" if exponent else name
        unit = _EXPONENT.sub("", parameter.unit).removesuffix("*s") if exponent else parameter.unit
        values = [float(np.exp(value) if of_ratio else value) for value in (one[i], two[i])]
        row = ParameterContrast(label, unit, values[0], values[1], of_ratio, note=note)
        if not note:
            ends = difference[i] - half[i], difference[i], difference[i] + half[i]
            low, value, high = (float(relative_difference(end) if of_ratio else end) for end in ends)
            p = 2.0 * float(stdtr(freedom[i], -abs(difference[i]) / error[i]))
            row = replace(row, difference=value, interval=(low, high), p=p)
        contrasts.append(row)
    return tuple(contrasts), joint_contrast(difference[tested], matrix[np.ix_(tested, tested)], freedom[tested])


def exponent_of(name: str, parameter: Parameter) -> str | None:
    """Name of the parameter that is an exponent in the unit of `name`: "alpha" for m [Pa s^alpha]; None without one."""
    match = _EXPONENT.search(parameter.unit)
    return match and "".join(name.rpartition(".")[:2]) + match[1]


def quantities_of(result: Result, rows: Sequence[tuple[str, str | None]], omega: float) -> tuple[Array, Array]:
    """Compute the quantities of a result that are compared: parameters, and moduli such as m omega^alpha.

    Args:
        result: fitted result.
        rows: names of two parameters for each of r quantities: m and its exponent alpha for the modulus m omega^alpha;
            a parameter and None for the parameter itself.
        omega: angular frequency of the moduli [rad/s].

    Returns:
        Quantities, or their logarithms if they are positive, (r,), and their derivatives with respect to the k
        parameters of the covariance, (r, k).
    """
    values, names = result.model.values, list(result.covariance.names)
    quantities, slopes = np.empty(len(rows)), np.zeros((len(rows), len(names)))
    for i, (name, exponent) in enumerate(rows):
        parameter = result.model.parameters[name]
        logarithmic = parameter.log or exponent is not None
        with np.errstate(divide="ignore"):
            quantities[i] = np.log(values[name]) if logarithmic else values[name]
        if name in names:
            floor = max(parameter.bounds[0], _NOTHING * parameter.typical)
            slopes[i, names.index(name)] = 1.0 / max(values[name], floor) if logarithmic else 1.0
        if exponent:
            quantities[i] += values[exponent] * np.log(omega)
            if exponent in names:
                slopes[i, names.index(exponent)] = np.log(omega)
    return quantities, slopes


def joint_contrast(difference: Array, matrix: Array, freedom: Array) -> JointContrast | None:
    """Test whether chance alone causes several differences together.

    Args:
        difference: differences, (k,).
        matrix: covariance of the differences, (k, k).
        freedom: degrees of freedom of each difference, (k,).

    Returns:
        Probability and number of independent differences; None without differences.

    Notes: Hotelling's T^2 with the smallest of the degrees of freedom; chi-square if they are infinite.
    """
    if not difference.size:
        return None
    size = np.sqrt(np.diag(matrix))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    significant = values > _LEAST_EIGENVALUE * values.max()
    square = float(np.sum(np.square(vectors[:, significant].T @ (difference / size)) / values[significant]))
    count, fewest = int(significant.sum()), float(freedom.min())
    denominator = max(fewest - count + 1.0, 1.0)
    p = float(fdtrc(count, denominator, square * denominator / (fewest * count)))
    return JointContrast(p, count)


def holm(probabilities: Sequence[float | None]) -> list[float | None]:
    """Adjust p-values for the number of tests by Holm's method (Scand. J. Statist. 6 (1979) 65); None is no test."""
    tested = sorted((p, index) for index, p in enumerate(probabilities) if p is not None)
    limited = (min(p * (len(tested) - rank), 1.0) for rank, (p, _) in enumerate(tested))
    adjusted = dict(zip((index for _, index in tested), accumulate(limited, max), strict=True))
    return [adjusted.get(index) for index in range(len(probabilities))]


def relative_difference(logarithm: Array) -> Array:
    """Relative differences, exp(logarithm) - 1, (...), of natural logs of ratios, (...), limited to +-ln(1e10)."""
    return np.expm1(np.clip(logarithm, -_FURTHEST, _FURTHEST))
