"""Comparison of two fitted results: differences of parameters, stiffness and loss factor, and their significance.

The errors of the two results are taken as independent. Errors that both share, such as the gain of one transducer, make
the intervals of the differences too wide as a rule.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.special import fdtrc, stdtr

from bushfit.effects import Parameter
from bushfit.effects.contract import Array
from bushfit.geometry import Place
from bushfit.model.covariance import Z95, Covariance
from bushfit.model.result import Result
from bushfit.prediction.bands import Band
from bushfit.prediction.stiffness import Prediction, predict
from bushfit.reading.preload import Preload
from bushfit.units import format_aligned, format_range, number

#: Probability that chance alone causes a reported difference.
CHANCE = 0.05
#: Number of random draws of the largest of many correlated errors; chosen: its 95 % quantile is then accurate to 1 %.
_DRAWS = 20_000
#: Eigenvalue of a correlation matrix, relative to the largest, below which it is rounding.
_LEAST_EIGENVALUE = 1e-10
#: Smallest value of a parameter, relative to its typical value, in the derivative of its logarithm.
_NOTHING = 1e-9
#: Largest number of digits of a difference, however small its error.
_MOST_DIGITS = 4
#: Largest logarithm of the ratio of two quantities: no parameter has bounds further apart.
_FURTHEST = float(np.log(1e10))
#: Largest number of decimals of a difference without an error: further decimals are rounding errors.
_MOST_DECIMALS = 6
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
        return self.reference.direction


@dataclass(frozen=True, eq=False)
class Comparison:
    """Comparison of a fitted result with a reference result.

    Args:
        parameters: comparisons of the parameters that both results have.
        joint: probability by chance of the differences of all parameters together, and the number of differences; None
            if no parameter is tested.
        contrasts: differences of the dynamic stiffness, one for each direction or specimen.
        shared: names of the files to which both results were fitted.
    """

    parameters: tuple[ParameterContrast, ...]
    joint: tuple[float, int] | None
    contrasts: tuple[Contrast, ...]
    shared: tuple[str, ...]

    @cached_property
    def widening(self) -> float:
        """Factor, at least 1, that turns the pointwise 95 % bands of all contrasts into simultaneous 95 % bands.

        Notes: the 95 % quantile of the largest of all standardised errors, whose correlations are known (T. Hothorn, F.
        Bretz, P. Westfall, Biometrical J. 50 (2008) 346), over the quantile of a single one. Random draws, fixed seed.
        """
        columns = [band.root for contrast in self.contrasts for band in (contrast.stiffness, contrast.loss_factor)]
        if not columns or not len(columns[0]):
            return 1.0
        errors = np.concatenate(columns, axis=1)
        size = np.linalg.norm(errors, axis=0)
        errors = errors[:, size > 0.0] / size[size > 0.0]
        drawn = np.random.default_rng(0).standard_normal((_DRAWS, len(errors)))
        largest = np.zeros(_DRAWS)
        for column in errors.T:
            np.maximum(largest, np.abs(drawn @ column), out=largest)
        return max(float(np.quantile(largest, 1.0 - CHANCE)) / Z95, 1.0)

    def widened(self, band: Band) -> Band:
        """Widen a pointwise 95 % band to a simultaneous one, which contains all points together with 95 % probability.

        Args:
            band: difference of one contrast with its pointwise band.
        """
        low, high = (band.value + self.widening * (end - band.value) for end in (band.low, band.high))
        return replace(band, low=low, high=high)

    def significant(self, band: Band) -> Array:
        """Return True at the points where a difference is significant for all points together, (n,)."""
        wide = self.widened(band)
        return bool(len(band.root)) & ((wide.low > 0.0) | (wide.high < 0.0))

    @property
    def differing(self) -> list[str]:
        """Stiffnesses and loss factors with a significant difference, such as "axial stiffness"."""
        return [
            f"{contrast.place} {name}"
            for contrast in self.contrasts
            for name, band in (
                (contrast.place.motion.words[2], contrast.stiffness),
                ("loss factor", contrast.loss_factor),
            )
            if self.significant(band).any()
        ]

    def sentences(self) -> list[str]:
        """Write sentences on the relative differences of |K| and the absolute differences of the loss factor.

        Returns:
            One sentence per direction: differences beyond chance, and an upper limit of the difference elsewhere.
        """
        sentences = []
        for contrast in self.contrasts:
            stiffness, loss = self.widened(contrast.stiffness), self.widened(contrast.loss_factor)
            percent = replace(stiffness, **{end: 100.0 * relative_difference(getattr(stiffness, end)) for end in _ENDS})
            quantity, label = contrast.place.motion.words[2], contrast.reference.label
            differences = _describe_difference(percent, " %", contrast)
            losses = _describe_difference(loss, "", contrast)
            sentences.append(f"{label}: {quantity} {differences}; loss factor {losses}")
        return sentences


#: Arrays of a band.
_ENDS = ("value", "low", "high")


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
        preloads: preload of each pair, where None selects the tested preload nearest to zero; by default, so for all.

    Returns:
        Comparison over the common parameters and the grids.
    """
    frequencies = np.concatenate([frequency for frequency, _ in grids])
    middle = float(np.sqrt(frequencies.min() * frequencies.max()))
    parameters, joint = compare_parameters(reference, compared, middle)
    contrasts = []
    for (place, compared_place), grid, preload in zip(places, grids, preloads or [None] * len(places), strict=True):
        one = predict(reference, place, *grid, preload=preload)
        two = predict(compared, compared_place, *grid, preload=preload)
        stiffness = two.stiffness.logarithm().minus(one.stiffness.logarithm())
        contrasts.append(Contrast(one, two, stiffness, two.loss_factor.minus(one.loss_factor)))
    files = {source.sha256 for source in compared.inputs}
    shared = tuple(str(source.file) for source in reference.inputs if source.sha256 in files)
    return Comparison(parameters, joint, tuple(contrasts), shared)


def with_holm(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """Adjust the probabilities of all parameters of several comparisons for their number, see `holm`.

    Args:
        comparisons: comparisons with the same reference.

    Returns:
        The comparisons, with the attribute `holm` of each tested parameter.
    """
    adjusted = iter(holm([row.p for comparison in comparisons for row in comparison.parameters if row.p is not None]))
    return [
        replace(
            comparison,
            parameters=tuple(
                row if row.p is None else replace(row, holm=next(adjusted)) for row in comparison.parameters
            ),
        )
        for comparison in comparisons
    ]


def holm(probabilities: Sequence[float]) -> list[float]:
    """Adjust the p-values of several tests for their number (Holm 1979); the order is unchanged."""
    order = np.argsort(probabilities)
    steps = np.asarray(probabilities)[order] * np.arange(len(order), 0, -1)
    adjusted = np.empty(len(order))
    adjusted[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return adjusted.tolist()


def relative_difference(logarithm: Array) -> Array:
    """Convert natural logarithms of ratios, limited to +-ln(1e10), to relative differences: exp(logarithm) - 1."""
    return np.expm1(np.clip(logarithm, -_FURTHEST, _FURTHEST))


def compare_parameters(
    reference: Result, compared: Result, frequency: float
) -> tuple[tuple[ParameterContrast, ...], tuple[float, int] | None]:
    """Compare the parameters that both results have, one by one and all together.

    Args:
        reference, compared: fitted results.
        frequency: frequency [Hz] at which parameters like m [Pa s^alpha] are also compared as the modulus
            m (2 pi f)^alpha.

    Returns:
        Comparison of each parameter, and the probability by chance of all differences together with their number, or
        None if no parameter is tested.

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
    return tuple(contrasts), joint_p_value(difference[tested], matrix[np.ix_(tested, tested)], freedom[tested])


def exponent_of(name: str, parameter: Parameter) -> str | None:
    """Name of the parameter that is the exponent in a parameter's unit, such as alpha for m [Pa s^alpha]; or None."""
    match = _EXPONENT.search(parameter.unit)
    return match and "".join(name.rpartition(".")[:2]) + match[1]


def quantities_of(result: Result, rows: Sequence[tuple[str, str | None]], omega: float) -> tuple[Array, Array]:
    """Compute the quantities of a result to compare (parameters, or moduli at a frequency) and their derivatives.

    Args:
        result: fitted result.
        rows: for each of r quantities, the name of its parameter and of the parameter's exponent; None for the
            parameter itself.
        omega: angular frequency of the modulus of a parameter with an exponent [rad/s].

    Returns:
        Quantities, or their logarithms if they are positive, (r,), and their derivatives by the k parameters of the
        covariance, (r, k).
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


def joint_p_value(difference: Array, matrix: Array, freedom: Array) -> tuple[float, int] | None:
    """Compute the probability that chance alone causes several differences together.

    Args:
        difference: differences, (k,).
        matrix: covariance of the differences, (k, k).
        freedom: degrees of freedom of each difference, (k,).

    Returns:
        Probability, and the number of independent differences; None without differences.

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
    return float(fdtrc(count, denominator, square * denominator / (fewest * count))), count


def _describe_difference(band: Band, unit: str, contrast: Contrast) -> str:
    """Phrase on the differences beyond chance with their points, and on an upper limit at the other points.

    Args:
        band: relative differences of |K| [%], or differences of the loss factor, with simultaneous 95 % bands, (n,).
        unit: "%" for relative differences of |K|; "" for differences of the loss factor.
        contrast: the compared stiffness, with its operating points.
    """

    def figures(i: int, word: str) -> str:
        value, ends = abs(band.value[i]), sorted((abs(band.low[i]), abs(band.high[i])))
        digits = int(np.clip(np.floor(np.log10(value)) - np.floor(np.log10(ends[1] - ends[0])) + 1, 2, _MOST_DIGITS))
        texts = format_aligned([value, *ends], digits)
        return f"{texts[0]}{unit} ({texts[1]} to {texts[2]}) {word}"

    if not len(band.root):
        ends = (number(round(end, _MOST_DECIMALS), 3, "+") for end in (band.value.min(), band.value.max()))
        return f"{' to '.join(dict.fromkeys(ends))}{unit} by value, of unknown error"
    parts = []
    for sure, word in ((band.low > 0.0, "higher"), (band.high < 0.0, "lower")):
        if sure.any():
            size = np.where(sure, np.abs(band.value), np.nan)
            top, bottom = int(np.nanargmax(size)), int(np.nanargmin(size))
            alike_all = sure.all() and min(abs(band.low[top]), abs(band.high[top])) <= size[bottom]
            parts.append(f"{figures(top, word)} {'throughout' if alike_all else f'at {_format_point(contrast, top)}'}")
            if 1 < (count := int(sure.sum())) < sure.size:
                parts[-1] += f" ({word} at {count} of {sure.size} points)"
            if sure.all() and not alike_all:
                parts.append(f"at least {figures(bottom, word)}, at {_format_point(contrast, bottom)}")
    none = (band.low <= 0.0) & (band.high >= 0.0)
    if none.any():
        largest = number(float(np.maximum(-band.low, band.high)[none].max()), 2)
        parts.append(f"{'elsewhere ' if parts else ''}no difference detected, and none above {largest}{unit}")
    return ", ".join(parts)


def _format_point(contrast: Contrast, i: int) -> str:
    """Format the frequency and amplitude of the operating point with index `i`."""
    unit, factor = contrast.place.display.displacement
    frequency, amplitude = contrast.reference.frequency[i], factor * contrast.reference.amplitude[i]
    return f"{format_range('Hz', frequency)}, {format_range(unit, amplitude)}"
