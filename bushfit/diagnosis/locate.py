"""Regions of frequency and amplitude in which model and measurement disagree, ranked and described as sentences.

A level is the set of all points of a sweep at one constant amplitude, or at one constant frequency, over its repeats.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bushfit.diagnosis.record import MisfitRegion
from bushfit.effects.contract import Array
from bushfit.fitting.measured_test import shown_amplitude
from bushfit.fitting.preparation import MeasuredSweep, split_by_kind
from bushfit.fitting.problem import FitResult
from bushfit.fitting.repeats import to_unit_interval
from bushfit.model.model import Model
from bushfit.reading.preload import add_preload
from bushfit.units import format_range, number

#: Smallest smooth misfit (root mean square, in units of its noise) of a region that is listed.
_WORTH_A_LINE = 2.5
#: Maximum number of regions listed, the worst first.
_MOST_LINES = 6
#: Smooth misfit, relative to |K| or to half a loop's force range, below which a region is not listed.
_LEAST = 1e-3
#: Share of the strongest misfit from which a level, or a frequency, belongs to the region.
_STRONG = 0.5
#: Share of a misfit's sum of squares that a flat line may leave for it to be called flat.
_FLAT = 0.2
#: Share of the largest mean by which the means of the levels must differ to be said to rise or fall with amplitude.
_CHANGES = 0.5
#: Degree of the Legendre polynomials, in the logarithm of the stepped quantity, that represent smooth misfit.
_SMOOTH_DEGREE = 3
_PARTS = ("storage", "loss")
#: Meaning of the harmonics of a loop's misfit, by order.
_HARMONICS = {
    0: "a constant force",
    1: "its first harmonic (slope or area)",
    2: "its second harmonic (one way stiffer than the other)",
    3: "its third harmonic (a bend at the ends)",
}


@dataclass(frozen=True, eq=False)
class LevelMisfit:
    """Mean misfit over the repeats of one level of a sweep: all runs at one constant amplitude or frequency.

    Args:
        sweep: the sweep.
        rows: index of one of the sweep's points at each of the n stepped values, (n,).
        misfit: complex relative difference K_measured/K_model - 1 of each point, averaged over the repeats, (n,).
        noise: standard deviation of the relative gain and of the phase [rad] of one mean value, (2,).
    """

    sweep: MeasuredSweep
    rows: Array
    misfit: Array
    noise: Array

    @property
    def step(self) -> Array:
        """Stepped quantity at each point, (n,): frequency [Hz] at a constant amplitude, else amplitude [m or rad]."""
        return self.sweep.step[self.rows]

    @property
    def label(self) -> str:
        """Text with the constant amplitude or frequency and the preload, such as "0.1 mm"; else the test's name."""
        sweep, first = self.sweep, self.rows[0]
        constant = f"{sweep.frequency[first]:.4g} Hz" if sweep.test.stepped else sweep.name
        if sweep.test.stepped == "frequency":
            constant = shown_amplitude(sweep.direction, float(sweep.amplitude[first]))
        return add_preload(constant, sweep.test.preload, sweep.direction)

    @cached_property
    def smooth(self) -> Array:
        """Smooth part of `misfit` (K_measured/K_model - 1): a polynomial in the log of `step`, complex (n,)."""
        x = np.log(self.step)
        basis = np.polynomial.legendre.legvander(to_unit_interval(x), min(_SMOOTH_DEGREE, np.unique(x).size - 1))
        return basis @ np.linalg.lstsq(basis.astype(complex), self.misfit, rcond=None)[0]


def level_misfits(sweep: MeasuredSweep, model: Model) -> Iterator[LevelMisfit]:
    """Yield the misfit of a model at each level of a sweep: all runs at one constant amplitude or frequency.

    Yields:
        Misfit over the stepped quantity, averaged over the repeats of the level.
    """
    ratio = sweep.measured / sweep.response(model) - 1.0
    for run_level in np.unique(sweep.run_level):
        mask = sweep.run_level == run_level
        _, first, index, counts = np.unique(
            sweep.step[mask], return_index=True, return_inverse=True, return_counts=True
        )
        mean = (np.bincount(index, ratio[mask].real) + 1j * np.bincount(index, ratio[mask].imag)) / counts
        variance = np.square(sweep.noise.random[sweep.name, float(run_level)]) + np.square(sweep.noise.shared)
        noise = np.sqrt(variance / np.median(counts) + np.square(sweep.noise.level))
        yield LevelMisfit(sweep, np.flatnonzero(mask)[first], mean, noise)


def find_regions(fit: FitResult) -> tuple[MisfitRegion, ...]:
    """Find the regions of frequency and amplitude in which a fitted model and the tests disagree, the worst first."""
    found = [*_sweep_regions(fit), *_loop_regions(fit)]
    worth = [region for region in found if region.excess > _WORTH_A_LINE]
    return tuple(sorted(worth, key=lambda region: -region.excess)[:_MOST_LINES])


def _sweep_regions(fit: FitResult) -> Iterator[MisfitRegion]:
    """Yield for each direction the regions where the storage and the loss of sweeps deviate smoothly from the model."""
    _, sweeps = split_by_kind(fit.data_sets)
    levels = [level for sweep in sweeps for level in level_misfits(sweep, fit.model)]
    kinds = [(level.sweep.direction, level.sweep.test.stepped) for level in levels]
    for direction, stepped in dict.fromkeys(kinds):
        mine = [level for level, kind in zip(levels, kinds, strict=True) if kind == (direction, stepped)]
        for part, name in enumerate(_PARTS):
            pieces = [(np.real if part == 0 else np.imag)(level.smooth) for level in mine]
            sizes = [piece / level.noise[part] for piece, level in zip(pieces, mine, strict=True)]
            excess = float(np.sqrt(np.mean(np.square(np.concatenate(sizes)))))
            strongest = max(float(np.abs(size).max()) for size in sizes)
            if max(float(np.abs(piece).max()) for piece in pieces) < _LEAST:
                continue
            strong = [level.rows[np.abs(size) > _STRONG * strongest] for level, size in zip(mine, sizes, strict=True)]
            touched = [i for i, rows in enumerate(strong) if rows.size]
            band, span = (
                (min(float(values.min()) for values in points), max(float(values.max()) for values in points))
                for points in (
                    [getattr(mine[i].sweep, axis)[strong[i]] for i in touched] for axis in ("frequency", "amplitude")
                )
            )
            reading = _describe_sweep_misfit(name, mine, pieces, touched, (band, span))
            yield MisfitRegion(direction, "sweep", band, span, name, excess, reading)


def _describe_sweep_misfit(
    part: str,
    levels: Sequence[LevelMisfit],
    pieces: Sequence[Array],
    touched: Sequence[int],
    spans: tuple[tuple[float, float], tuple[float, float]],
) -> str:
    """Sentence on sign and size of a smooth misfit of sweeps, and on its trends along each level and between levels.

    Args:
        part: "storage" or "loss".
        levels: misfits at the levels (constant amplitudes or frequencies) of the sweeps of one direction.
        pieces: smooth misfit along each level, measured minus model relative to |K|, (n,) each.
        touched: indices of the levels that belong to the region.
        spans: lowest and highest frequency [Hz], and amplitude [m or rad], of the region.
    """
    quantity = "stiffness" if part == "storage" else "loss"
    labels = [level.label for level in levels]
    if len({*labels}) < len(labels):  # sweeps at several temperatures
        labels = [level.sweep.name for level in levels]
    worst = max(touched, key=lambda i: float(np.abs(pieces[i]).max()))
    largest = max(pieces[worst].tolist(), key=abs)
    sides = ("above", "below") if largest > 0 else ("below", "above")
    level, direction, stepped = levels[worst], levels[worst].sweep.direction, levels[worst].sweep.test.stepped
    fixed_axis = {"frequency": "amplitude", "amplitude": "frequency", None: "run"}[stepped]
    across = [i for i, piece in enumerate(pieces) if np.max(-np.sign(largest) * piece) > _STRONG * abs(largest)]
    agreeing = [i for i in touched if i == worst or i not in across]
    is_everywhere = len(agreeing) == len(levels)
    unit, factor = ("Hz", 1.0) if stepped != "amplitude" else direction.display.displacement

    def name_levels(indices: Sequence[int]) -> str:
        """List the amplitudes or frequencies of levels, given by their indices, without repetition."""
        return ", ".join(dict.fromkeys(labels[i] for i in indices))

    def range_on_side(indices: Sequence[int], sign: float) -> str:
        """Text with the range of the points of some levels whose misfit has the given sign and is not small."""
        steps = [levels[i].step[sign * pieces[i] > _STRONG * abs(largest)] for i in indices]
        ends = np.concatenate(steps)
        return format_range(unit, factor * float(ends.min()), factor * float(ends.max()))

    span = format_range(unit, *(factor * end for end in spans[stepped == "amplitude"]))
    if across:
        span = range_on_side(agreeing, np.sign(largest))
    level_names = f"every {fixed_axis}" if is_everywhere and len(levels) > 1 else name_levels(agreeing)
    size = number(100 * abs(largest), 2)
    sentences = [
        f"measured {direction} {quantity} is up to {size} % of |K| {sides[0]} the model ({span}, at {level_names})"
    ]
    means = [float(np.mean(piece)) for piece in pieces]
    if across:
        span = range_on_side(across, -np.sign(largest))
        sentences.append(f"It is {sides[1]} the model ({span}, at {name_levels(across)})")
    elif is_everywhere and len(means) > 1 and np.ptp(means) >= _CHANGES * max(abs(mean) for mean in means):
        sentences.append(f"The gap {_trend_verb(means[0], means[-1])} with {fixed_axis}")
    trend = _trend(stepped or "frequency", level.step, pieces[worst])
    several = len(agreeing) > 1 and stepped
    sentences.append(f"The gap is largest at {level.label}, where it {trend}" if several else f"The gap {trend}")
    return ". ".join(sentences)


def _trend(stepped: str, step: Array, misfit: Array) -> str:
    """Phrase on the trend of a misfit along a level: constant, or the power of the stepped quantity that fits best.

    Args:
        stepped: "frequency" or "amplitude".
        step: frequency [Hz] or amplitude [m or rad] of each point, (n,).
        misfit: measured minus model storage or loss stiffness, relative to |K|, (n,).
    """
    if np.var(misfit) < _FLAT * np.mean(np.square(misfit)):
        return f"is nearly constant over {stepped}"
    shapes = {
        f"with the logarithm of {stepped}": np.log(step),
        f"in proportion to {stepped}": step,
        f"with the square of {stepped}": step**2,
    }
    shape = max(shapes, key=lambda words: abs(float(np.corrcoef(shapes[words], misfit)[0, 1])))
    return f"{_trend_verb(float(misfit[np.argmin(step)]), float(misfit[np.argmax(step)]))} {shape}"


def _trend_verb(first: float, last: float) -> str:
    """Verb phrase for a misfit along a level: "grows", "fades" or "goes from above to below the model".

    Args:
        first, last: measured minus model stiffness, relative to |K|, at both ends of a level.
    """
    if first * last < 0.0 and min(abs(first), abs(last)) > _FLAT * max(abs(first), abs(last)):
        return f"goes from {'above to below' if first > 0.0 else 'below to above'} the model"
    return "grows" if abs(last) > abs(first) else "fades"


def _loop_regions(fit: FitResult) -> Iterator[MisfitRegion]:
    """Yield a region for each loop, with the harmonic in which its force deviates most from the model."""
    loops, _ = split_by_kind(fit.data_sets)
    for data_set in loops:
        columns, amplitude = data_set.smooth_changes(), float(data_set.amplitude[0])
        norms = np.maximum(np.linalg.norm(columns, axis=1), np.finfo(float).tiny)
        first = len(columns) // 2 + 1  # of the sines, which follow the mean and the cosines
        amounts = columns @ fit.residual[fit.residual_rows[data_set]] / norms
        by_order = [np.hypot(values[:first], [0.0, *values[first:]]) for values in (amounts, amounts / norms)]
        order = int(np.argmax(by_order[0]))
        share = by_order[1][order]
        if share < _LEAST:
            continue
        unit, factor = data_set.direction.display.displacement
        frequency = float(data_set.frequency[0])
        loop = f"the {data_set.direction} loop of {amplitude * factor:.3g} {unit} at {frequency:.3g} Hz"
        loop += f" ({data_set.name})" if len(loops) > 1 else ""
        yield MisfitRegion(
            data_set.direction,
            "loop",
            (frequency,) * 2,
            (amplitude,) * 2,
            "force",
            float(np.sqrt(np.mean(np.square(amounts)))),
            f"{add_preload(loop, data_set.test.preload, data_set.direction)} differs from the model most in "
            f"{_HARMONICS.get(order, f'harmonic {order}')}: {number(100 * share, 2)} % of half its force range",
        )
