"""Where model and measurement disagree: smooth misfit per level and part, ranked, and put into words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.record import Where
from bushfit.effects.contract import Array
from bushfit.fitting.data_sets import parted
from bushfit.fitting.sweep_data import Level
from bushfit.units import number

#: Smooth misfit, in units of the noise of its root mean square, from which a region is worth a line.
_WORTH_A_LINE = 2.5
#: Regions listed at most, the worst first: more is nothing that a reader takes in.
_MOST_LINES = 6
#: Smooth misfit, relative to |K| or to half a loop's force range, below which a region has no line whatever the noise.
_LEAST = 1e-3
#: Share of the strongest misfit from which a level, or a frequency, belongs to the region.
_STRONG = 0.5
#: Share of a misfit's sum of squares that a flat line may leave for it to be called flat.
_FLAT = 0.2
#: Share of the largest mean by which the means of the levels must differ to be said to rise or fall with amplitude.
_CHANGES = 0.5
_PARTS = ("storage", "loss")
#: What the harmonics of a loop's misfit mean, by order.
_HARMONICS = {
    0: "a constant force",
    1: "its first harmonic (slope or area)",
    2: "its second harmonic (one way stiffer than the other)",
    3: "its third harmonic (a bend at the ends)",
}


def contrasts(evidence: Evidence) -> Array:
    """Whitened columns of all that is smooth: per level and part a polynomial in ln f, per loop its harmonics."""
    return np.array(
        [evidence.embedded(row, data_set) for data_set in evidence.data_sets for row in data_set.contrasts()]
    )


def largest_smooth_misfit(evidence: Evidence) -> float:
    """Largest smooth misfit anywhere, relative to |K| or to half a loop's force range."""
    return max(data_set.smooth_misfit(evidence.model) for data_set in evidence.data_sets)


def locate(evidence: Evidence) -> tuple[Where, ...]:
    """Regions of smooth misfit, the worst first."""
    found = [*_sweep_regions(evidence), *_loop_regions(evidence)]
    worth = [where for where in found if where.excess > _WORTH_A_LINE]
    return tuple(sorted(worth, key=lambda where: -where.excess)[:_MOST_LINES])


def _sweep_regions(evidence: Evidence) -> Iterator[Where]:
    """Per direction, where the storage and the loss stiffness of its sweeps depart smoothly from the model."""
    _, sweeps = parted(evidence.data_sets)
    levels = [level for sweep in sweeps for level in sweep.levels(evidence.model)]
    for direction in dict.fromkeys(level.direction for level in levels):
        mine = [level for level in levels if level.direction == direction]
        for part, name in enumerate(_PARTS):
            pieces = [(np.real if part == 0 else np.imag)(level.smooth) for level in mine]
            sizes = [piece / level.noise[part] for piece, level in zip(pieces, mine, strict=True)]
            excess = float(np.sqrt(np.mean(np.square(np.concatenate(sizes)))))
            strongest = max(float(np.abs(size).max()) for size in sizes)
            touched = [i for i, size in enumerate(sizes) if np.abs(size).max() > _STRONG * strongest]
            strong = [mine[i].frequency[np.abs(sizes[i]) > _STRONG * strongest] for i in touched]
            band = float(min(f.min() for f in strong)), float(max(f.max() for f in strong))
            if max(float(np.abs(piece).max()) for piece in pieces) < _LEAST:
                continue
            yield Where(
                direction,
                "sweep",
                band,
                (mine[touched[0]].amplitude, mine[touched[-1]].amplitude),
                name,
                excess,
                _read_sweep(name, direction, mine, pieces, touched, band),
            )


def _read_sweep(
    part: str,
    direction: object,
    levels: Sequence[Level],
    pieces: Sequence[Array],
    touched: Sequence[int],
    band: tuple[float, float],
) -> str:
    """A sentence: which way, how much, how it goes with frequency and with amplitude."""
    what = "stiffness" if part == "storage" else "loss"
    worst = max(touched, key=lambda i: float(np.abs(pieces[i]).max()))
    largest = max(pieces[worst].tolist(), key=abs)
    size = f"{number(100 * abs(largest), 2)} % of |K| {'above' if largest > 0 else 'below'} the model"
    level = f"at every amplitude{_over_amplitude(pieces)}"
    if len(touched) < len(levels):
        unit, factor = levels[0].direction.display.displacement
        level = "at " + ", ".join(f"{levels[i].amplitude * factor:.3g}" for i in touched) + f" {unit}"
    trend = _trend(levels[worst].frequency, pieces[worst])
    span = f"{band[0]:.3g} to {band[1]:.3g} Hz"
    return f"measured {direction} {what} is up to {size}, {trend} ({span}), {level}"


def _trend(frequency: Array, misfit: Array) -> str:
    """How a misfit goes with frequency: flat, or as the line over it that leaves the least."""
    if np.var(misfit) < _FLAT * np.mean(np.square(misfit)):
        return "much the same at every frequency"
    shapes = {
        "changing with the logarithm of frequency": np.log(frequency),
        "changing in proportion to frequency": frequency,
        "changing with the square of frequency": frequency**2,
    }
    return max(shapes, key=lambda words: abs(float(np.corrcoef(shapes[words], misfit)[0, 1])))


def _over_amplitude(pieces: Sequence[Array]) -> str:
    means = [float(np.mean(piece)) for piece in pieces]
    if len(means) < 2 or np.ptp(means) < _CHANGES * max(abs(mean) for mean in means):
        return ""
    return ", rising with amplitude" if means[-1] > means[0] else ", falling with amplitude"


def _loop_regions(evidence: Evidence) -> Iterator[Where]:
    """Per loop, the harmonic in which its force departs most from the model."""
    loops, _ = parted(evidence.data_sets)
    for data_set in loops:
        columns, amplitude = data_set.contrasts(), data_set.drive.amplitude
        amounts = columns @ evidence.residual[evidence.place[data_set]] / np.linalg.norm(columns, axis=1)
        sizes = np.hypot(amounts[::2], [0.0, *amounts[1::2]])
        order = int(np.argmax(sizes))
        share = sizes[order] * np.sqrt(2.0 / data_set.size) * data_set.relative_noise
        if share < _LEAST:
            continue
        unit, factor = data_set.direction.display.displacement
        yield Where(
            data_set.direction,
            "loop",
            (data_set.drive.frequency,) * 2,
            (amplitude,) * 2,
            "force",
            float(np.sqrt(np.mean(np.square(amounts)))),
            f"the {data_set.direction} loop of {amplitude * factor:.3g} {unit} departs from the model most in "
            f"{_HARMONICS.get(order, f'harmonic {order}')}: {number(100 * share, 2)} % of half its force range",
        )
