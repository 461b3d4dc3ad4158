"""Compare the parts of a batch with each other: outlying parts, and process capability (Cp, Cpk)."""

import math
from collections.abc import Mapping

import numpy as np
from scipy.special import chdtri, stdtr, stdtrit

from bushfit.effects.contract import Array
from bushfit.model.covariance import Z95

#: Minimum number of parts from which outliers are determined.
FEWEST = 5
#: Probability that any part of a batch of equal parts is reported as an outlier.
_LEVEL = 0.05
#: Number of parts for each part that may be an outlier: two of eight do not hide each other.
_PARTS_PER_OUTLIER = 4


def find_outliers(quantities: Mapping[str, tuple[Array, Array]]) -> tuple[dict[str, Array], dict[str, Array]]:
    """Find the parts that differ from the others beyond chance, with the quantities in which they differ.

    Args:
        quantities: values and standard errors of the n parts by name of the quantity, (n,) each; NaN where not known.

    Returns:
        Two mappings by name of the quantity, (n,) each: deviation from the mean of the reference parts (outliers in no
        quantity), in their standard deviations, NaN where not known; and a mask of the outliers.

    Notes:
        Generalised extreme studentised deviate procedure (Rosner, Technometrics 25 (1983) 165) for up to a quarter of
        the parts, with Bonferroni's correction for the number of quantities. Each value is compared with the mean of
        the other values, so that the deviation has n - 2 degrees of freedom and the limit is `smallest_deviation`. A
        value with a larger standard error than the others may deviate more. Outliers of one quantity are then compared
        in all quantities with the reference parts, so that they do not hide each other.
    """
    deviations, outliers = dict[str, Array](), dict[str, Array]()
    for name, (values, errors) in quantities.items():
        reference = np.isfinite(values)
        removed, outlier_count = list[int](), 0
        for step in range(int(reference.sum()) // _PARTS_PER_OUTLIER):
            z = _studentised_deviations(values, errors, reference)
            if not np.isfinite(z[reference]).any():  # the others agree to the digit
                break
            worst = int(np.nanargmax(np.where(reference, np.abs(z), np.nan)))
            p_value = 2.0 * float(stdtr(reference.sum() - 2.0, -abs(z[worst]))) * reference.sum() * len(quantities)
            reference[worst] = False
            removed.append(worst)
            outlier_count = step + 1 if p_value < _LEVEL else outlier_count
        outliers[name] = np.isin(np.arange(values.size), removed[:outlier_count])
    outlying_parts = np.any([*outliers.values()], axis=0)
    for name, (values, errors) in quantities.items():
        reference = reference_parts(values, name, outliers)
        deviations[name] = _studentised_deviations(values, errors, reference)
        limit = smallest_deviation(int(reference.sum()) + 1, len(quantities)) or math.inf
        outliers[name] |= outlying_parts & (np.abs(deviations[name]) > limit)
    return deviations, outliers


def reference_parts(values: Array, name: str, outliers: Mapping[str, Array]) -> Array:
    """Select the reference parts, with which all parts are compared in one quantity: outliers in no quantity.

    Args:
        values: values of the quantity, (n,); NaN if unknown.
        name: name of the quantity.
        outliers: masks of outliers by name of the quantity, (n,) each.

    Returns:
        Mask of the reference parts, (n,); if fewer than four remain, of the parts that are not outliers in this
        quantity.
    """
    finite = np.isfinite(values)
    reference = finite & ~np.any([*outliers.values()], axis=0)
    return reference if reference.sum() >= FEWEST - 1 else finite & ~outliers[name]


def _studentised_deviations(values: Array, errors: Array, reference: Array) -> Array:
    """Deviation of each value from the mean of the other reference values, in their standard deviations, (n,).

    Args:
        values: values of one quantity of the n parts, (n,).
        errors: standard error of each value, (n,).
        reference: mask of the reference parts, (n,).
    """
    count, other_count = reference.sum(), reference.sum() - reference  # (n,): reference values without this one
    if count < FEWEST - 1:
        return np.full(values.size, np.nan)
    center = values[reference].mean()  # taken off first, for the digits of the sums
    shifted, deviation = values - center, np.where(reference, values - center, 0.0)
    mean = (shifted[reference].sum() - deviation) / other_count
    variance = ((shifted[reference] ** 2).sum() - deviation**2 - other_count * mean**2) / (other_count - 1)
    square = errors**2
    if np.isfinite(square[reference]).any():
        typical = float(np.nanmean(square[reference]))
        variance = variance + np.maximum(np.where(np.isfinite(square), square, typical) - typical, 0.0)
    spread = np.sqrt(np.maximum(variance, 0.0) * (1.0 + 1.0 / other_count))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(spread > 1e-9 * (np.abs(center) + np.abs(shifted)), (shifted - mean) / spread, np.nan)


def smallest_deviation(parts: int, quantities: int) -> float | None:
    """Smallest deviation, in standard deviations, that makes a part an outlier; None for fewer than five parts.

    In 5 % of batches of equal parts, any part deviates as much in any quantity.

    Args:
        parts: number of parts in the batch.
        quantities: number of compared quantities.
    """
    if parts < FEWEST or quantities < 1:
        return None
    return float(stdtrit(parts - 2.0, 1.0 - _LEVEL / (2.0 * parts * quantities)))


def capability(
    values: Array, low: float, high: float
) -> tuple[tuple[float, float, float] | None, tuple[float, float, float] | None]:
    """Compute Cp and Cpk with their 95 % intervals.

    Args:
        values: values of one quantity of the parts, (n,), without NaN.
        low, high: lower and upper limit in the unit of the values; either may be infinite.

    Returns:
        Cp and Cpk, each as value and low and high end of the interval; None if a limit or scatter is missing.

    Notes:
        ISO 22514-2 for normal scatter, from the standard deviation of all parts, so that a process that drifts shows
        in it. Intervals: chi-square for Cp; Bissell, Applied Statistics 39 (1990) 331, for Cpk.
    """
    if values.size < 2 or not (math.isfinite(low) or math.isfinite(high)) or np.ptp(values) == 0.0:
        return None, None
    count, mean, sigma = values.size, float(values.mean()), float(values.std(ddof=1))
    nearest = min(high - mean, mean - low) / (3.0 * sigma)
    half = Z95 * math.sqrt(1.0 / (9.0 * count) + nearest**2 / (2.0 * (count - 1)))
    cpk = nearest, nearest - half, nearest + half
    width = (high - low) / (6.0 * sigma)
    if not math.isfinite(width):
        return None, cpk
    lower, upper = (width * math.sqrt(float(chdtri(count - 1, p)) / (count - 1)) for p in (0.975, 0.025))
    return (width, lower, upper), cpk
