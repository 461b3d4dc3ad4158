"""What a sweep holds: its frequencies, amplitudes, repeats and noise, and what is odd about it."""

from collections.abc import Iterator

import numpy as np
from scipy.special import pdtrc, stdtr

from bushfit.effects.contract import Array
from bushfit.effects.mistakes import MISTAKES
from bushfit.fitting.data_set import shown_amplitude
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.fitting.sweep_data import SweepData
from bushfit.inspection.labels import wrong_labels
from bushfit.inspection.record import Findings, told_frequencies
from bushfit.reading.measurement import Sweep, loss_factor
from bushfit.reading.names import Labels
from bushfit.reading.runs import rows_alike
from bushfit.reduction.arrays import MEDIAN_TO_SIGMA
from bushfit.reduction.result import MISSED_LEVEL
from bushfit.units import number

#: Standard deviations from which a point is off its repeats, or a block off the others; chosen: no noise goes that far.
_FAR = 8.0
#: Distance of ln K from its repeats from which a point is an outlier; chosen: less does not matter to a fit.
_LEAST_OUTLIER = 0.01
#: Distance of ln |K| from the other repeats from which a block is off; chosen: mountings differ by less.
_LEAST_BLOCK_OFFSET = 0.02
#: Blocks whose scatter can be judged.
_FEWEST_BLOCKS = 5
#: Probability of chance below which equal points are copies, and |K| drifts over the repeats; chosen.
_CHANCE = 1e-4
#: Change of ln |K| from the first repeat to the last that is told; chosen: less does not matter to a fit.
_LEAST_DRIFT = 5e-3
#: Probability at the least that two phases are equal; chosen: some files have them in few digits.
_SAME_PHASE_P = 0.05
#: Step in ln X from one level to the next below which they may be repeats of one; chosen: nobody sets finer levels.
_LEAST_STEP = 0.02
#: Points or frequencies that are told one by one; chosen: they make a sentence.
_MOST_LISTED = 4
#: Levels that are listed one by one; chosen: they make a line.
_MOST_LEVELS = 8


def look_at_sweep(sweep: Sweep, labels: Labels) -> Findings:
    """Facts and oddities of a sweep; `labels` are what the names of its file and sheet say."""
    unit, factor = sweep.direction.display.displacement
    frequencies, levels = np.unique(sweep.frequency), np.unique(sweep.amplitude)
    repeats = np.unique(sweep.repeat)
    noise = sweep_noise([sweep])
    facts = {
        "frequencies": told_frequencies(frequencies),
        "amplitudes": f"{', '.join(f'{factor * level:.4g}' for level in levels[:_MOST_LEVELS])}"
        f"{', ...' if levels.size > _MOST_LEVELS else ''} {unit} zero-to-peak",
        "repeats": f"{repeats.size}",
        "noise": noise.describe(),
    }
    odd = [
        *SweepData(sweep, noise).notes,
        *wrong_labels(labels, sweep.direction, [float(x) for x in levels], [float(x) for x in frequencies]),
        *_copies(sweep, noise),
        *_untold_repeats(sweep),
        *_missing_frequencies(sweep),
        *_outliers(sweep, noise),
        *_odd_blocks(sweep),
        *_missed_level(sweep),
        *_odd_loss(sweep),
    ]
    return facts, odd


def _copies(sweep: Sweep, noise: SweepNoise) -> Iterator[str]:
    """A sentence on rows that repeat others at the same frequency and amplitude digit by digit.

    It is due where noise would hardly make as many equal by chance, in as many digits as the file has.
    """
    # nine digits leave out what the conversion of units leaves in the last ones
    magnitude, phase = (
        np.array([float(f"{value:.9g}") for value in values])
        for values in (np.abs(sweep.stiffness), np.angle(sweep.stiffness))
    )
    # the value of one in the last digit, if all have as many digits as the longest
    digits = max(len(f"{value:.8e}".partition("e")[0].replace(".", "").rstrip("0")) for value in magnitude)
    finest = 10.0 ** (np.floor(np.log10(magnitude)) + 1 - digits)
    copies, expected, first = 0, 0.0, sweep.frequency.size
    for rows in rows_alike(sweep.frequency, sweep.amplitude):
        points = np.stack((magnitude[rows], phase[rows]))
        _, start, count = np.unique(points, axis=1, return_index=True, return_counts=True)
        copies += int((count - 1).sum())
        first = min([first, *rows[start[count > 1]].tolist()])
        scatter = noise.random[sweep.name, float(sweep.held[rows[0]])][0] * magnitude[rows[0]]
        same = min(float(finest[rows[0]] / scatter), 1.0)  # two draws fall on the same last digit
        expected += rows.size * (rows.size - 1) / 2.0 * same * max(same, _SAME_PHASE_P)
    if copies and pdtrc(copies - 1, expected) < _CHANCE:
        verb = "s repeat others" if copies > 1 else " repeats another"
        yield (
            f"{copies} row{verb} digit by digit, the first of them at {sweep.frequency[first]:.4g} Hz (data row "
            f"{first + 1}): copied, not measured again?"
        )


def _untold_repeats(sweep: Sweep) -> Iterator[str]:
    """A sentence where amplitudes of one frequency lie too close for levels, and no passes tell them for repeats."""
    passes, of_frequency = np.unique(sweep.repeat).size, sweep.frequency.size / np.unique(sweep.frequency).size
    steps = [
        (float(sweep.frequency[rows[0]]), float(np.diff(np.log(levels)).min()))
        for rows in rows_alike(sweep.frequency)
        if (levels := np.unique(sweep.amplitude[rows])).size > 1
    ]
    frequency, least = min(steps, key=lambda step: step[1], default=(0.0, np.inf))
    if least < _LEAST_STEP and round(of_frequency) != passes:
        yield (
            f"two amplitudes at {frequency:.4g} Hz lie {number(100 * np.expm1(least), 2)} % apart and count as two "
            "levels: if they are repeats, a column repeat with their numbers tells so"
        )


def _missing_frequencies(sweep: Sweep) -> Iterator[str]:
    """A sentence for each block, a repeat of a level, that lacks frequencies which most others have."""
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
            listed = ", ".join([*(f"{f:.4g}" for f in absent[:_MOST_LISTED]), *["..."] * (absent.size > _MOST_LISTED)])
            yield f"{shown_amplitude(sweep.direction, level)}{which} lacks {listed} Hz, which most others have"


def _outliers(sweep: Sweep, noise: SweepNoise) -> Iterator[str]:
    """A sentence for each of the points that lie far off their repeats at the same frequency and amplitude."""
    off = np.nan_to_num(_from_repeats(sweep))
    for rows in _blocks(sweep):
        off[rows] -= _median(off[rows])
    random = np.array([noise.random[sweep.name, float(held)] for held in sweep.held])
    parts = np.stack((off.real, off.imag), axis=1)
    far = np.any((np.abs(parts) > _FAR * random) & (np.abs(parts) > _LEAST_OUTLIER), axis=1)
    for row in np.flatnonzero(far)[:_MOST_LISTED]:
        level = shown_amplitude(sweep.direction, sweep.amplitude[row])
        yield (
            f"data row {row + 1} ({sweep.frequency[row]:.4g} Hz, {level}, repeat {sweep.repeat[row]}) is "
            f"{number(100 * np.expm1(parts[row, 0]), 2, '+')} % in |K| and {np.degrees(parts[row, 1]):+.2g} deg off "
            "its repeats"
        )
    if far.sum() > _MOST_LISTED:
        yield f"{int(far.sum()) - _MOST_LISTED} more points are as far off their repeats"


def _from_repeats(sweep: Sweep) -> Array:
    """Distance of ln K from the median of its repeats, nan where there are fewer than three, (n,)."""
    value, off = np.log(sweep.stiffness), np.full(sweep.frequency.size, np.nan + 0j)
    for rows in rows_alike(sweep.frequency, sweep.amplitude):
        if rows.size > 2:
            off[rows] = value[rows] - _median(value[rows])
    return off


def _blocks(sweep: Sweep) -> list[Array]:
    """The rows of each block: a repeat of a level over all frequencies."""
    return rows_alike(sweep.repeat.astype(float), sweep.amplitude)


def _odd_blocks(sweep: Sweep) -> Iterator[str]:
    """A sentence for each block that lies apart as a whole, and one on a drift over the repeats."""
    off = _from_repeats(sweep)
    blocks = [rows for rows in _blocks(sweep) if not np.isnan(off[rows]).any()]
    if len(blocks) < _FEWEST_BLOCKS:
        return
    gain = np.array([_median(off[rows]).real for rows in blocks])
    usual = MEDIAN_TO_SIGMA * float(np.median(np.abs(gain[gain != 0.0]))) if np.any(gain) else 0.0
    for rows, own in zip(blocks, gain, strict=True):
        if abs(own) > max(_FAR * usual, _LEAST_BLOCK_OFFSET):
            yield (
                f"{shown_amplitude(sweep.direction, sweep.amplitude[rows[0]])}, repeat {sweep.repeat[rows[0]]} lies "
                f"{number(100 * np.expm1(own), 2, '+')} % off the other repeats as a whole: "
                "other amplitude, temperature or mounting?"
            )
    repeat = np.array([sweep.repeat[rows[0]] for rows in blocks], dtype=float)
    if np.unique(repeat).size > 2 and np.ptp(gain) > 0.0:
        correlation, freedom = float(np.corrcoef(repeat, gain)[0, 1]), repeat.size - 2
        drift = correlation * float(np.std(gain) / np.std(repeat) * np.ptp(repeat))  # of the line through the gains
        t = abs(correlation) * np.sqrt(freedom / max(1.0 - correlation**2, 1e-20))
        if 2.0 * stdtr(freedom, -t) < _CHANCE and abs(drift) > _LEAST_DRIFT:
            yield (
                f"|K| drifts by {number(100 * drift, 2, '+')} % from the first repeat to the last: warming up, or "
                "settling?"
            )


def _missed_level(sweep: Sweep) -> Iterator[str]:
    """A sentence on the point that missed the amplitude of its level by most."""
    off = sweep.amplitude_reached / sweep.amplitude - 1.0
    row = int(np.argmax(np.abs(off)))
    if abs(off[row]) > MISSED_LEVEL:
        both = sweep.amplitude_reached[row], sweep.amplitude[row]
        reached, level = (shown_amplitude(sweep.direction, size) for size in both)
        yield f"{reached} was reached where the level is {level} ({sweep.frequency[row]:.4g} Hz)"


def _odd_loss(sweep: Sweep) -> Iterator[str]:
    """Sentences on losses below zero, and on one that hardly any rubber has, with what the file may say instead."""
    bad = np.flatnonzero(sweep.stiffness.imag < 0.0)
    if bad.size:
        level = shown_amplitude(sweep.direction, sweep.amplitude[bad[0]])
        yield (
            f"{bad.size} point{'s' * (bad.size > 1)} with a loss factor below zero, the first at "
            f"{sweep.frequency[bad[0]]:.4g} Hz, {level}: is the force channel late?"
        )
    mistakes = [mistake for mistake in MISTAKES.values() if mistake.doubt and mistake.possible(sweep)]
    if mistakes:
        unless = ", or ".join(mistake.in_words(sweep) for mistake in mistakes)
        loss = float(np.median(loss_factor(sweep.stiffness)))
        yield f"the loss factor is {number(loss, 2)} in the median, that of hardly any rubber, unless {unless}"


def _median(values: Array) -> complex:
    """Median of the real and of the imaginary parts."""
    return complex(np.median(values.real), np.median(values.imag))
