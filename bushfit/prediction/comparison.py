"""Two fitted results side by side: how far parameters, stiffness and loss factor are apart, and whether by chance.

The errors of the two count as independent. What they share, such as the tests, or the gain of one transducer, makes the
intervals of their difference too wide as a rule.
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
from bushfit.prediction.stiffness import Band, Prediction, predict
from bushfit.units import format_aligned, format_range, number

#: Probability with which chance alone makes a difference somewhere that is said to be one.
CHANCE = 0.05
#: Draws of the largest of many correlated errors; chosen: its 95 % quantile is then good to a hundredth.
_DRAWS = 20_000
#: Eigenvalue of a correlation matrix, relative to the largest, below which it is rounding.
_LEAST_EIGENVALUE = 1e-10
#: Size of a parameter over its typical one, below which its logarithm tells no differences any more.
_NOTHING = 1e-9
#: Digits of a difference at most, however small its error.
_MOST_DIGITS = 4
#: Logarithm of the ratio of two quantities beyond which nothing is known of it: no parameter has bounds further apart.
_FURTHEST = float(np.log(1e10))
#: Decimals of a difference without an error at most: those that follow are rounding.
_MOST_DECIMALS = 6
#: The parameter that the unit of another has as its exponent: alpha in Pa*s^alpha.
_EXPONENT = re.compile(r"\^([a-z]\w*)$")


@dataclass(frozen=True)
class ParameterContrast:
    """One parameter of both results, or a quantity that they make together.

    Args:
        name: of the parameter, or of the quantity at a frequency.
        unit: SI, of both values and of a difference that is not relative.
        reference, other: its value in each.
        relative: whether the difference is relative to the reference, or in the unit.
        difference: of the other less the reference, ; None where it is not tested.
        interval: of the difference, low and high with 95 %; None as of it.
        p: probability of so large a difference, or a larger one, by chance; None where it is not tested.
        holm: the same over all that are tested together (Holm, Scand. J. Statist. 6 (1979) 65).
        note: why it is not tested.
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
    """Dynamic stiffness of two results at the same operating points of a place.

    Args:
        stiffness: ln |K| of the other less that of the reference, with its 95 % band at each point.
        loss_factor: that of the other less that of the reference.
    """

    reference: Prediction
    other: Prediction
    stiffness: Band
    loss_factor: Band

    @property
    def place(self) -> Place:
        return self.reference.direction

    @classmethod
    def of(cls, reference: Prediction, other: Prediction) -> Contrast:
        """The difference of two predictions at the same points.

        Notes: an end of the band is as far from the difference as the root sum of squares of the ends of the two bands
        on that side (G. Zou, A. Donner, Stat. Med. 27 (2008) 1693).
        """
        one, two = (_logarithm(each.stiffness) for each in (reference, other))
        return cls(reference, other, _less(two, one), _less(other.loss_factor, reference.loss_factor))


@dataclass(frozen=True, eq=False)
class Comparison:
    """A result against the reference.

    Args:
        joint: probability by chance of differences as these of all parameters together, correlations counted, and how
            many they are; None where none is tested.
        shared: files that both were fitted to.
    """

    parameters: tuple[ParameterContrast, ...]
    joint: tuple[float, int] | None
    contrasts: tuple[Contrast, ...]
    shared: tuple[str, ...]

    @cached_property
    def widening(self) -> float:
        """Factor on the bands of the contrasts with which they hold everywhere at once with 95 %.

        Notes: the 95 % quantile of the largest of all standardised errors, whose correlations are known (T. Hothorn, F.
        Bretz, P. Westfall, Biometrical J. 50 (2008) 346), over that of one. Drawn from a fixed seed.
        """
        columns = [band.root for each in self.contrasts for band in (each.stiffness, each.loss_factor)]
        if not columns or not len(columns[0]):
            return 1.0
        every = np.concatenate(columns, axis=1)
        size = np.linalg.norm(every, axis=0)
        every = every[:, size > 0.0] / size[size > 0.0]
        drawn = np.random.default_rng(0).standard_normal((_DRAWS, len(every)))
        largest = np.zeros(_DRAWS)
        for column in every.T:
            np.maximum(largest, np.abs(drawn @ column), out=largest)
        return max(float(np.quantile(largest, 1.0 - CHANCE)) / Z95, 1.0)

    def widened(self, band: Band) -> Band:
        """A band of the contrasts that holds with all others at once."""
        low, high = (band.value + self.widening * (end - band.value) for end in (band.low, band.high))
        return replace(band, low=low, high=high)

    def words(self) -> list[str]:
        """A sentence a place on what differs by more than chance, and how much may differ where nothing is seen."""
        said = []
        for each in self.contrasts:
            stiffness, loss = self.widened(each.stiffness), self.widened(each.loss_factor)
            percent = replace(stiffness, **{end: 100.0 * relative(getattr(stiffness, end)) for end in _ENDS})
            resisted = each.place.motion.words[2]
            said.append(f"{each.place}: {resisted} {_told(percent, ' %', each)}; loss factor {_told(loss, '', each)}")
        return said


#: What a band has at each point.
_ENDS = ("value", "low", "high")


def compare(
    reference: Result, other: Result, places: Sequence[tuple[Place, Place]], grids: Sequence[tuple[Array, Array]]
) -> Comparison:
    """Compare a result with a reference: parameters that both have, and stiffness over operating points.

    Args:
        places: each as the reference and as the other has it, of one kind of motion.
        grids: frequencies [Hz] and amplitudes [m, rad or 1] of each place.
    """
    frequencies = np.concatenate([frequency for frequency, _ in grids])
    middle = float(np.sqrt(frequencies.min() * frequencies.max()))
    parameters, joint = _parameters(reference, other, middle)
    contrasts = tuple(
        Contrast.of(predict(reference, one, *grid), predict(other, two, *grid))
        for (one, two), grid in zip(places, grids, strict=True)
    )
    files = {source.sha256 for source in other.inputs}
    shared = tuple(str(source.file) for source in reference.inputs if source.sha256 in files)
    return Comparison(parameters, joint, contrasts, shared)


def with_holm(comparisons: Sequence[Comparison]) -> list[Comparison]:
    """The comparisons with the probabilities of all their parameters taken together."""
    found = iter(holm([row.p for each in comparisons for row in each.parameters if row.p is not None]))

    def counted(row: ParameterContrast) -> ParameterContrast:
        return row if row.p is None else replace(row, holm=next(found))

    return [replace(each, parameters=tuple(map(counted, each.parameters))) for each in comparisons]


def holm(probabilities: Sequence[float]) -> list[float]:
    """Probabilities of several tests as they count together (Holm 1979), in the same order."""
    order = np.argsort(probabilities)
    steps = np.asarray(probabilities)[order] * np.arange(len(order), 0, -1)
    together = np.empty(len(order))
    together[order] = np.minimum(np.maximum.accumulate(steps), 1.0)
    return together.tolist()


def _logarithm(band: Band) -> Band:
    """ln of a positive quantity, its ends and root relative to its value."""
    ends = {end: np.log(band.value) + getattr(band, end) / band.value - 1.0 for end in ("low", "high")}
    return Band(np.log(band.value), **ends, root=band.root / band.value)


def relative(logarithm: Array) -> Array:
    """How far a quantity is off another, relative, from the logarithm of their ratio, which is cut where it is open."""
    return np.expm1(np.clip(logarithm, -_FURTHEST, _FURTHEST))


def _less(one: Band, other: Band) -> Band:
    """One quantity less another whose errors are independent."""
    value = one.value - other.value
    low = value - np.hypot(one.value - one.low, other.high - other.value)
    high = value + np.hypot(one.high - one.value, other.value - other.low)
    return Band(value, low, high, np.concatenate((one.root, -other.root)))


def _parameters(
    reference: Result, other: Result, frequency: float
) -> tuple[tuple[ParameterContrast, ...], tuple[float, int] | None]:
    """All parameters that both have, and all together; a constant whose unit has an exponent also at a frequency [Hz].

    Notes: a strictly positive parameter counts by its logarithm. m [Pa s^alpha] and alpha make the modulus m (2 pi
    f)^alpha, which compares whatever alpha is.
    """
    rows, known = list[tuple[str, str | None]](), other.model.parameters
    for name, parameter in reference.model.parameters.items():
        if name in known:
            exponent = _exponent(name, parameter)
            varies = exponent is not None and not _equally_held(exponent, reference, other)
            rows += [(name, None), (name, exponent)] if varies else [(name, None)]
    (one, slopes), (two, others) = (_side(result, rows, 2.0 * np.pi * frequency) for result in (reference, other))
    covariance = _of_difference((slopes, reference.covariance), (others, other.covariance))
    difference, error = two - one, np.sqrt(np.diag(covariance.matrix))
    half, freedom = covariance.half_width(np.eye(len(rows))), covariance.freedom(np.eye(len(rows)))
    found, tested = list[ParameterContrast](), list[int]()
    for i, (name, exponent) in enumerate(rows):
        parameter = reference.model.parameters[name]
        of_ratio = parameter.log or exponent is not None
        bounds = dict.fromkeys(result.at_bound[name] for result in (reference, other) if name in result.at_bound)
        note = f"at its {' and '.join(bounds)}" if bounds else ""
        if not note and not np.isfinite(difference[i]):
            note = "zero in one"
        if not note and not error[i]:
            note = "held in both"
        if not note and exponent is None:
            tested.append(i)
        if not note and exponent is None and rows[i + 1 : i + 2] == [(name, _exponent(name, parameter))]:
            note = f"only at equal {_exponent(name, parameter)}"
        shown = f"{name} at {number(frequency, 3)} Hz" if exponent else name
        unit = _EXPONENT.sub("", parameter.unit).removesuffix("*s") if exponent else parameter.unit
        values = [float(np.exp(value) if of_ratio else value) for value in (one[i], two[i])]
        row = ParameterContrast(shown, unit, values[0], values[1], of_ratio, note=note)
        if not note:
            ends = difference[i] - half[i], difference[i], difference[i] + half[i]
            low, value, high = (float(relative(end) if of_ratio else end) for end in ends)
            p = 2.0 * float(stdtr(freedom[i], -abs(difference[i]) / error[i]))
            row = replace(row, difference=value, interval=(low, high), p=p)
        found.append(row)
    return tuple(found), _joint(difference[tested], covariance.matrix[np.ix_(tested, tested)], freedom[tested])


def _exponent(name: str, parameter: Parameter) -> str | None:
    """The name of the parameter that stands as an exponent in the unit of another; None where none does."""
    found = _EXPONENT.search(parameter.unit)
    return found and "".join(name.rpartition(".")[:2]) + found[1]


def _equally_held(name: str, *results: Result) -> bool:
    """Return True if a parameter was held at one value in all results."""
    free = any(result.covariance.stderr(name) for result in results)
    return not free and len({result.model.values[name] for result in results}) == 1


def _side(result: Result, rows: Sequence[tuple[str, str | None]], omega: float) -> tuple[Array, Array]:
    """The quantities of some rows, (r,), and their derivatives by the parameters of the covariance, (r, k)."""
    values, names = result.model.values, list(result.covariance.names)
    quantities, slopes = np.empty(len(rows)), np.zeros((len(rows), len(names)))
    for i, (name, exponent) in enumerate(rows):
        parameter = result.model.parameters[name]
        logarithmic = parameter.log or exponent is not None
        with np.errstate(divide="ignore"):
            quantities[i] = np.log(values[name]) if logarithmic else values[name]
        if name in names:
            least = max(parameter.bounds[0], _NOTHING * parameter.typical)
            slopes[i, names.index(name)] = 1.0 / max(values[name], least) if logarithmic else 1.0
        if exponent:
            quantities[i] += values[exponent] * np.log(omega)
            if exponent in names:
                slopes[i, names.index(exponent)] = np.log(omega)
    return quantities, slopes


def _of_difference(*sides: tuple[Array, Covariance]) -> Covariance:
    """The covariance of differences of r quantities by their slopes, (r, k) each, of independent results."""
    rows = range(len(sides[0][0]))
    matrix = sum((slopes @ own.matrix @ slopes.T for slopes, own in sides), start=np.zeros((len(rows), len(rows))))
    spread = [slopes @ part @ slopes.T for slopes, own in sides for part in own.spread]
    return Covariance(tuple(map(str, rows)), matrix, tuple(spread))


def _joint(difference: Array, matrix: Array, freedom: Array) -> tuple[float, int] | None:
    """Probability by chance of differences with a covariance, (k,) and (k, k), and how many count.

    Notes: Hotelling's T^2 with the fewest degrees of freedom of any; infinitely many make it chi-square.
    """
    if not difference.size:
        return None
    size = np.sqrt(np.diag(matrix))
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    kept = values > _LEAST_EIGENVALUE * values.max()
    square = float(np.sum(np.square(vectors[:, kept].T @ (difference / size)) / values[kept]))
    count, least = int(kept.sum()), float(freedom.min())
    left = max(least - count + 1.0, 1.0)
    return float(fdtrc(count, left, square * left / (least * count))), count


def _told(band: Band, unit: str, at: Contrast) -> str:
    """What of a difference is sure at some operating point, and how large it may be where none is."""

    def figures(i: int, word: str) -> str:
        value, ends = abs(band.value[i]), sorted((abs(band.low[i]), abs(band.high[i])))
        digits = int(np.clip(np.floor(np.log10(value)) - np.floor(np.log10(ends[1] - ends[0])) + 1, 2, _MOST_DIGITS))
        shown = format_aligned([value, *ends], digits)
        return f"{shown[0]}{unit} ({shown[1]} to {shown[2]}) {word}"

    if not len(band.root):
        ends = (number(round(end, _MOST_DECIMALS), 3, "+") for end in (band.value.min(), band.value.max()))
        return f"{' to '.join(dict.fromkeys(ends))}{unit} by value, of unknown error"
    parts = []
    for sure, word in ((band.low > 0.0, "higher"), (band.high < 0.0, "lower")):
        if sure.any():
            size = np.where(sure, np.abs(band.value), np.nan)
            most, least = int(np.nanargmax(size)), int(np.nanargmin(size))
            alike_all = sure.all() and min(abs(band.low[most]), abs(band.high[most])) <= size[least]
            parts.append(f"{figures(most, word)} {'throughout' if alike_all else f'at {_point(at, most)}'}")
            if sure.all() and not alike_all:
                parts.append(f"at least {figures(least, word)}, at {_point(at, least)}")
    none = (band.low <= 0.0) & (band.high >= 0.0)
    if none.any():
        largest = number(float(np.maximum(-band.low, band.high)[none].max()), 2)
        parts.append(f"{'elsewhere ' if parts else ''}no difference shown, none above {largest}{unit}")
    return ", ".join(parts)


def _point(at: Contrast, i: int) -> str:
    """An operating point in words."""
    unit, factor = at.place.display.displacement
    return f"{format_range('Hz', at.reference.frequency[i])}, {format_range(unit, factor * at.reference.amplitude[i])}"
