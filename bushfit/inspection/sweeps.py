"""A sweep looked at: frequencies, amplitudes, repeats, noise, and what is odd."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.stats import linregress, poisson

from bushfit.effects.contract import Array
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.inspection.labels import wrong_labels
from bushfit.inspection.record import Looked
from bushfit.reading.measurement import Sweep
from bushfit.reduction.scatter import MEDIAN_TO_SIGMA
from bushfit.units import number

#: A point is wild beyond so many standard deviations from its repeats and this share of |K|.
_WILD, _WILD_SHARE = 8.0, 0.01
#: A block is off beyond so many (robust) standard deviations of the others and this share of |K|.
_BLOCK_OFF, _BLOCK_SHARE, _FEWEST_BLOCKS = 8.0, 0.02, 5
#: |K| drifts from repeat to repeat where chance would do so this rarely, and by this share.
_DRIFT_P, _DRIFT_SHARE = 1e-4, 5e-3
#: The amplitude reached is off that of the level by this share.
_MISSED = 0.03
#: Equal points are copies where chance would make as many equal this rarely; phases of few digits agree this often.
_COPIED, _SAME_PHASE = 1e-4, 0.05
_MOST_LISTED = 4


def look_at_sweep(sweep: Sweep, file: Path) -> Looked:
    """Facts and oddities of a sweep."""
    unit, factor = sweep.direction.display.displacement
    frequencies, levels = np.unique(sweep.frequency), np.unique(sweep.amplitude)
    repeats = np.unique(sweep.repeat)
    noise = sweep_noise([sweep])
    facts = {
        "frequencies": f"{frequencies.size}, from {frequencies[0]:.4g} to {frequencies[-1]:.4g} Hz",
        "amplitudes": f"{', '.join(f'{factor * level:.4g}' for level in levels[:8])}"
        f"{', ...' if levels.size > 8 else ''} {unit} zero-to-peak",
        "repeats": f"{repeats.size}",
        "noise": noise.describe(),
    }
    odd = [
        *wrong_labels(file, sweep.direction, [float(x) for x in levels], [float(x) for x in frequencies]),
        *_copies(sweep, noise),
        *_missing(sweep, unit, factor),
        *_wild(sweep, noise, unit, factor),
        *_blocks(sweep, unit, factor),
        *_missed(sweep, unit, factor),
        *_negative(sweep, unit, factor),
    ]
    return Looked(facts, tuple(odd))


def _copies(sweep: Sweep, noise: SweepNoise) -> Iterator[str]:
    """Rows that hold the same numbers as others at the same frequency and amplitude, digit by digit, where the digits
    of the file and the noise would hardly make as many equal by chance."""
    magnitude, phase = (_rounded(values) for values in (np.abs(sweep.stiffness), np.angle(sweep.stiffness)))
    finest = _finest(magnitude)
    copies, expected, first = 0, 0.0, sweep.frequency.size
    for rows in _groups(sweep.frequency, sweep.amplitude):
        points = np.stack((magnitude[rows], phase[rows]))
        _, start, count = np.unique(points, axis=1, return_index=True, return_counts=True)
        copies += int((count - 1).sum())
        first = min([first, *rows[start[count > 1]].tolist()])
        scatter = noise.random[sweep.name, float(sweep.amplitude[rows[0]])][0] * magnitude[rows[0]]
        same = min(float(finest[rows[0]] / scatter), 1.0)  # two draws fall on the same last digit
        expected += rows.size * (rows.size - 1) / 2.0 * same * max(same, _SAME_PHASE)
    if copies and poisson.sf(copies - 1, expected) < _COPIED:
        verb = "s repeat others" if copies > 1 else " repeats another"
        yield (
            f"{copies} row{verb} digit by digit, the first of them at {sweep.frequency[first]:.4g} Hz (data row "
            f"{first + 1}): copied, not measured again?"
        )


def _rounded(values: Array) -> Array:
    """Values without what units and roots leave in the last digits."""
    return np.array([float(f"{value:.9g}") for value in values])


def _finest(values: Array) -> Array:
    """What the last digit of each value counts, if all have as many digits as the longest."""
    digits = max(len(f"{value:.8e}".partition("e")[0].replace(".", "").rstrip("0")) for value in values)
    return 10.0 ** (np.floor(np.log10(values)) + 1 - digits)


def _missing(sweep: Sweep, unit: str, factor: float) -> Iterator[str]:
    """Frequencies that a level, or a repeat of it, lacks while most others have them."""
    blocks = np.stack((sweep.amplitude, sweep.repeat.astype(float)), axis=1)
    names, block = np.unique(blocks, axis=0, return_inverse=True)
    frequencies, column = np.unique(sweep.frequency, return_inverse=True)
    there = np.zeros((len(names), frequencies.size), dtype=bool)
    there[block.ravel(), column] = True
    usual = there.mean(axis=0) > 0.5
    for (level, repeat), has in zip(names, there, strict=True):
        absent = frequencies[usual & ~has]
        if absent.size and len(names) > 1:
            which = f", repeat {repeat:.0f}," if np.unique(sweep.repeat).size > 1 else ""
            listed = ", ".join(f"{f:.4g}" for f in absent[:_MOST_LISTED]) + (
                ", ..." if absent.size > _MOST_LISTED else ""
            )
            yield f"{factor * level:.4g} {unit}{which} lacks {listed} Hz, which most others have"


def _wild(sweep: Sweep, noise: SweepNoise, unit: str, factor: float) -> Iterator[str]:
    """Points far off the other repeats at the same frequency and amplitude, three or more."""
    off = _from_repeats(sweep)
    random = np.array([noise.random[sweep.name, float(x)] for x in sweep.amplitude])
    parts = np.stack((off.real, off.imag), axis=1)
    far = np.any((np.abs(parts) > _WILD * random) & (np.abs(parts) > _WILD_SHARE), axis=1)
    for row in np.flatnonzero(far)[:_MOST_LISTED]:
        yield (
            f"data row {row + 1} ({sweep.frequency[row]:.4g} Hz, {factor * sweep.amplitude[row]:.4g} {unit}, repeat "
            f"{sweep.repeat[row]}) is {number(100 * np.expm1(parts[row, 0]), 2, '+')} % in |K| and "
            f"{np.degrees(parts[row, 1]):+.2g} deg off its repeats"
        )
    if far.sum() > _MOST_LISTED:
        yield f"{int(far.sum()) - _MOST_LISTED} more points are as far off their repeats"


def _from_repeats(sweep: Sweep) -> Array:
    """ln K less the median of its repeats, and less what its block shares; 0 where there are fewer than three."""
    off = np.zeros(sweep.frequency.size, dtype=complex)
    value = np.log(sweep.stiffness)
    for rows in _groups(sweep.frequency, sweep.amplitude):
        if rows.size > 2:
            off[rows] = value[rows] - _median(value[rows])
    for rows in _groups(sweep.repeat.astype(float), sweep.amplitude):
        off[rows] -= _median(off[rows])
    return off


def _blocks(sweep: Sweep, unit: str, factor: float) -> Iterator[str]:
    """Repeats that lie apart as a whole, and a drift over the repeats."""
    value, offsets = np.log(sweep.stiffness), np.full(sweep.frequency.size, np.nan + 0j)
    for rows in _groups(sweep.frequency, sweep.amplitude):
        if rows.size > 2:
            offsets[rows] = value[rows] - _median(value[rows])
    found = [
        (float(sweep.amplitude[rows[0]]), int(sweep.repeat[rows[0]]), _median(offsets[rows]))
        for rows in _groups(sweep.repeat.astype(float), sweep.amplitude)
        if not np.isnan(offsets[rows]).any()
    ]
    if len(found) < _FEWEST_BLOCKS:
        return
    gain = np.array([offset.real for *_, offset in found])
    usual = MEDIAN_TO_SIGMA * float(np.median(np.abs(gain[gain != 0.0]))) if np.any(gain) else 0.0
    for (level, repeat, offset), own in zip(found, gain, strict=True):
        if abs(own) > max(_BLOCK_OFF * usual, _BLOCK_SHARE):
            yield (
                f"{factor * level:.4g} {unit}, repeat {repeat} lies "
                f"{number(100 * np.expm1(offset.real), 2, '+')} % off the other repeats as a whole: "
                "other amplitude, temperature or mounting?"
            )
    numbers = np.array([repeat for _, repeat, _ in found], dtype=float)
    if np.unique(numbers).size > 2 and np.ptp(gain) > 0.0:
        line = linregress(numbers, gain)
        drift = line.slope * np.ptp(numbers)
        if line.pvalue < _DRIFT_P and abs(drift) > _DRIFT_SHARE:
            share = number(100 * drift, 2, "+")
            yield f"|K| drifts by {share} % from the first repeat to the last: warming up, or settling?"


def _missed(sweep: Sweep, unit: str, factor: float) -> Iterator[str]:
    off = sweep.amplitude_reached / sweep.amplitude - 1.0
    row = int(np.argmax(np.abs(off)))
    if abs(off[row]) > _MISSED:
        yield (
            f"{factor * sweep.amplitude_reached[row]:.4g} {unit} was reached where the level is "
            f"{factor * sweep.amplitude[row]:.4g} {unit} ({sweep.frequency[row]:.4g} Hz)"
        )


def _negative(sweep: Sweep, unit: str, factor: float) -> Iterator[str]:
    bad = np.flatnonzero(sweep.stiffness.imag < 0.0)
    if bad.size:
        row = int(bad[0])
        yield (
            f"{bad.size} point{'s' * (bad.size > 1)} with a loss factor below zero, the first at "
            f"{sweep.frequency[row]:.4g} Hz, {factor * sweep.amplitude[row]:.4g} {unit}"
        )


def _groups(*keys: Array) -> list[Array]:
    """Rows that share all keys."""
    _, group = np.unique(np.stack(keys), axis=1, return_inverse=True)
    order = np.argsort(group.ravel(), kind="stable")
    return np.split(order, np.cumsum(np.bincount(group.ravel()))[:-1])


def _median(values: Array) -> complex:
    return complex(np.median(values.real), np.median(values.imag))
