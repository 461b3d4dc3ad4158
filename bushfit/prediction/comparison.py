"""Comparison of two fitted results: differences of parameters, stiffness and loss factor, and their significance.

The errors of the two results are assumed to be independent. If the results share errors, such as the gain of one
transducer, the intervals of the differences are usually too wide.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from bushfit.effects.contract import Array
from bushfit.gaussian_process import coordinates, in_lengths, patterns
from bushfit.geometry import Place
from bushfit.model.covariance import Z95
from bushfit.model.result import Result
from bushfit.prediction.bands import Band
from bushfit.prediction.parameter_comparison import (
    JointContrast,
    ParameterContrast,
    compare_parameters,
    holm,
    relative_difference,
)
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.reading.preload import Preload
from bushfit.units import format_aligned, format_range, number

#: Probability that chance alone causes a reported difference of equal bushings.
CHANCE = 0.05
#: Number of random draws of the largest of many correlated errors; chosen: its 95 % quantile is then accurate to 1 %.
_DRAWS = 20_000
#: Largest number of digits of a difference, however small its error.
_MOST_DIGITS = 4
#: Largest number of decimals of a difference without an error: further decimals are rounding errors.
_MOST_DECIMALS = 6


@dataclass(frozen=True, eq=False)
class Contrast:
    """Difference of the dynamic stiffness of two results at the same operating points of one direction.

    Args:
        reference, other: predictions of the two results.
        stiffness: ln |K| of the other result minus ln |K| of the reference, with its 95 % band at each point.
        loss_factor: loss factor of the other result minus that of the reference, with its 95 % band at each point.
    """

    reference: Prediction
    other: Prediction
    stiffness: Band
    loss_factor: Band

    @property
    def place(self) -> Place:
        """Direction or specimen of the reference."""
        return self.reference.direction


@dataclass(frozen=True, eq=False)
class Comparison:
    """Comparison of a fitted result with a reference result.

    Args:
        parameters: comparisons of the parameters that both results have.
        joint: test of all parameters together; None if no parameter is tested.
        contrasts: differences of the dynamic stiffness, one for each direction or specimen.
        shared: names of the files to which both results were fitted.
    """

    parameters: tuple[ParameterContrast, ...]
    joint: JointContrast | None
    contrasts: tuple[Contrast, ...]
    shared: tuple[str, ...]

    @cached_property
    def bands(self) -> dict[str, Band]:
        """Differences of stiffness and loss factor with pointwise 95 % bands, by names such as "axial stiffness"."""
        bands = {}
        for contrast in self.contrasts:
            bands[f"{contrast.place} {contrast.place.motion.words[2]}"] = contrast.stiffness
            bands[f"{contrast.place} loss factor"] = contrast.loss_factor
        return bands

    @cached_property
    def largest_errors(self) -> Array:
        """Largest error over all points in each of d random draws (fixed seed), in half widths of the 95 % band, (d,).

        Notes: the correlations of the errors are known (T. Hothorn, F. Bretz, P. Westfall, Biometrical J. 50 (2008)
        346). If no error is known, a single draw of 0.
        """
        roots = [band.root for band in self.bands.values()]
        if not roots or not len(roots[0]):
            return np.zeros(1)
        errors = np.concatenate(roots, axis=1)
        size = np.linalg.norm(errors, axis=0)
        errors = errors[:, size > 0.0] / size[size > 0.0]
        drawn = np.random.default_rng(0).standard_normal((_DRAWS, len(errors)))
        largest = np.zeros(_DRAWS)
        for column in errors.T:
            np.maximum(largest, np.abs(drawn @ column), out=largest)
        return largest / Z95

    @cached_property
    def widening(self) -> float:
        """Factor, at least 1, on pointwise 95 % bands, so that all points together are inside in 95 % of cases."""
        return max(float(np.quantile(self.largest_errors, 1.0 - CHANCE)), 1.0)

    def widened(self, band: Band) -> Band:
        """Widen a pointwise 95 % band by the factor `widening`, so that it contains all points together at 95 %.

        Args:
            band: difference in stiffness or loss factor between the two results, with its pointwise band.
        """
        low, high = (band.value + self.widening * (end - band.value) for end in (band.low, band.high))
        return replace(band, low=low, high=high)

    def significant(self, band: Band) -> Array:
        """Return True at the points where a difference is significant for all points together, (n,)."""
        return bool(len(band.root)) & (_distance_from_zero(band) > self.widening)

    @property
    def significant_differences(self) -> list[str]:
        """Names of the stiffnesses, loss factors and parameters that differ between the two results beyond chance.

        The probability of any name if the results are equal is at most 5 %.

        Notes: Hochberg's procedure (Biometrika 75 (1988) 800) for two hypothesis tests, one of stiffness and loss
        factor at all points, one of all parameters: both are significant if both are at 5 %, or either at 2.5 %.
        """
        stiffness, joint = 1.0, self.joint.p if self.joint else 1.0
        if distances := [_distance_from_zero(band).max() for band in self.bands.values() if len(band.root)]:
            stiffness = float(np.mean(self.largest_errors >= max(distances)))
        limit = CHANCE if max(stiffness, joint) < CHANCE else CHANCE / 2.0
        names = [name for name, band in self.bands.items() if stiffness < limit and self.significant(band).any()]
        if joint < limit:
            parameters = [row.name for row in self.parameters if row.holm is not None and row.holm < CHANCE]
            names += parameters or ["the parameters taken together"]
        return names

    def sentences(self) -> list[str]:
        """Write sentences on the relative differences of |K| and the absolute differences of the loss factor.

        Returns:
            One sentence per direction: differences beyond chance, and an upper limit of the difference elsewhere.
        """
        sentences = []
        for contrast in self.contrasts:
            stiffness, loss = self.widened(contrast.stiffness), self.widened(contrast.loss_factor)
            value, low, high = 100.0 * relative_difference(stiffness.ends)
            percent = Band(value, low, high, stiffness.root)
            quantity, label = contrast.place.motion.words[2], contrast.reference.label
            differences = _describe_difference(percent, " %", contrast)
            losses = _describe_difference(loss, "", contrast)
            sentences.append(f"{label}: {quantity} {differences}; loss factor {losses}")
        return sentences


def compare(
    reference: Result,
    compared: Result,
    places: Sequence[tuple[Place, Place]],
    grids: Sequence[tuple[Array, Array]],
    preloads: Sequence[Preload | None] | None = None,
) -> Comparison:
    """Compare a result with a reference: parameters that both have, and stiffness over operating points.

    Args:
        reference, compared: fitted results.
        places: pairs of directions or specimens to compare: of the reference, and of the compared result. Both have the
            same kind of motion.
        grids: frequencies [Hz] and zero-to-peak amplitudes [m, rad or 1] of each pair.
        preloads: preload of each pair; None for the tested preload nearest to zero, which is the default for all pairs.

    Returns:
        Comparison over the common parameters and the grids.
    """
    frequencies = np.concatenate([frequency for frequency, _ in grids])
    middle = float(np.sqrt(frequencies.min() * frequencies.max()))
    parameters, joint = compare_parameters(reference, compared, middle)
    sides, points = [], list(zip(places, grids, preloads or [None] * len(places), strict=True))
    without_expected_error = (replace(result, usable=()) for result in (reference, compared))  # both results share it
    for side, result in enumerate(without_expected_error):
        predictions = [predict(result, pair[side], *grid, preload=preload) for pair, grid, preload in points]
        sides.append(with_model_patterns(result, predictions))
    contrasts = []
    for one, two in zip(*sides, strict=True):
        stiffness = two.stiffness.logarithm().minus(one.stiffness.logarithm())
        contrasts.append(Contrast(one, two, stiffness, two.loss_factor.minus(one.loss_factor)))
    shared = tuple(file for file, sha256 in reference.files.items() if sha256 in compared.files.values())
    return Comparison(parameters, joint, tuple(contrasts), shared)


def with_model_patterns(result: Result, predictions: Sequence[Prediction]) -> list[Prediction]:
    """Let the model error of predictions vary smoothly over frequency and strain, for a test of all points together.

    A prediction assumes one model error for all its points. Here the real and the imaginary part of the error are sums
    of random patterns over frequency and strain (see `gaussian_process.patterns`), independent between directions.

    Args:
        result: fitted result.
        predictions: predictions of the result, one per direction or specimen.

    Returns:
        Predictions with these errors in `stiffness` and `loss_factor`; unchanged without an error of the model.
    """
    process, shapes = result.model.unnamed or result.model_error, list[Array]()
    if not process:
        return list(predictions)
    for prediction in predictions:
        strain = prediction.amplitude * result.model.unit_strain(prediction.direction)
        shape = patterns(in_lengths(coordinates(prediction.frequency, strain), process.lengths))[1]
        shapes.append(shape / np.linalg.norm(shape, axis=0))
    ends = np.cumsum([prediction.frequency.size for prediction in predictions])[:-1]
    varied = []
    for prediction, shape in zip(predictions, np.split(block_diag(*shapes), ends, axis=1), strict=True):
        bands = dict[str, Any]()
        for name in ("stiffness", "loss_factor"):
            band = getattr(prediction, name)
            errors = (shape[:, None] * band.root[-2:]).reshape(-1, shape.shape[1])
            bands[name] = replace(band, root=np.concatenate((band.root[:-2], errors)))
        varied.append(replace(prediction, **bands))
    return varied


def _distance_from_zero(band: Band) -> Array:
    """Distance of each value from zero, divided by the half width of its band on the side of zero, (n,)."""
    half = np.where(band.value > 0.0, band.value - band.low, band.high - band.value)
    with np.errstate(divide="ignore"):
        return np.abs(band.value) / np.where(band.value == 0.0, 1.0, half)


def with_holm(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Adjust the p-values of all parameters of several comparisons for their number, by Holm's method.

    Args:
        comparisons: comparisons of several results with one reference.

    Returns:
        The comparisons, with the adjusted p-value in the attribute `holm` of each tested parameter.
    """
    adjusted = iter(holm([row.p for comparison in comparisons for row in comparison.parameters]))
    return [
        replace(comparison, parameters=tuple(replace(row, holm=next(adjusted)) for row in comparison.parameters))
        for comparison in comparisons
    ]


def _describe_difference(band: Band, unit: str, contrast: Contrast) -> str:
    """Phrase on significant differences with their operating points, and on an upper limit at the other points.

    Args:
        band: relative differences of |K| [%], or differences of the loss factor, with simultaneous 95 % bands, (n,).
        unit: " %" for relative differences of |K|; "" for differences of the loss factor.
        contrast: the compared stiffness, with its operating points.
    """

    def describe(i: int, word: str) -> tuple[str, str]:
        """Return texts on point `i`, as "1.2 % (0.8 to 1.6) higher" and "5 Hz, 0.1 mm"; `word` is higher or lower."""
        value, ends = abs(band.value[i]), sorted((abs(band.low[i]), abs(band.high[i])))
        digits = int(np.clip(np.floor(np.log10(value)) - np.floor(np.log10(ends[1] - ends[0])) + 1, 2, _MOST_DIGITS))
        texts = format_aligned([value, *ends], digits)
        amplitude = contrast.place.display.displacement.text(contrast.reference.amplitude[i])
        point = f"{format_range('Hz', contrast.reference.frequency[i])}, {amplitude}"
        return f"{texts[0]}{unit} ({texts[1]} to {texts[2]}) {word}", point

    if not len(band.root):
        ends = (number(round(end, _MOST_DECIMALS), 3, "+") for end in (band.value.min(), band.value.max()))
        return f"{' to '.join(dict.fromkeys(ends))}{unit} (error unknown)"
    parts = []
    for sure, word in ((band.low > 0.0, "higher"), (band.high < 0.0, "lower")):
        if sure.any():
            size = np.where(sure, np.abs(band.value), np.nan)
            top, bottom = int(np.nanargmax(size)), int(np.nanargmin(size))
            alike_all = sure.all() and min(abs(band.low[top]), abs(band.high[top])) <= size[bottom]
            difference, point = describe(top, word)
            parts.append(f"{difference} {'throughout' if alike_all else f'at {point}'}")
            if 1 < (count := int(sure.sum())) < sure.size:
                parts[-1] += f" ({word} at {count} of {sure.size} points)"
            if sure.all() and not alike_all:
                parts[-1] = f"{' at '.join(describe(bottom, word))}, up to {parts[-1]}"
    none = (band.low <= 0.0) & (band.high >= 0.0)
    if none.any():
        largest = number(float(np.maximum(-band.low, band.high)[none].max()), 2)
        parts.append(f"{'elsewhere ' if parts else ''}no difference detected (up to {largest}{unit} is possible)")
    return ", ".join(parts)
