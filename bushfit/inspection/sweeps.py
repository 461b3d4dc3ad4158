"""Contents of a sweep: its frequencies, amplitudes, repeats and noise, and what is odd about it."""

from collections.abc import Iterator

import numpy as np
from scipy.special import pdtrc, stdtr

from bushfit.effects.contract import Array
from bushfit.effects.mistakes import MISTAKES
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.fitting.measured_test import shown_amplitude
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.fitting.outliers import least_absolute
from bushfit.inspection.labels import wrong_labels
from bushfit.inspection.plausible import implausible_sizes
from bushfit.inspection.record import Findings, format_frequencies
from bushfit.reading.measurement import Sweep, loss_factor
from bushfit.reading.names import Labels
from bushfit.reading.runs import group_rows
from bushfit.reduction.arrays import MEDIAN_TO_SIGMA
from bushfit.reduction.result import MISSED_LEVEL
from bushfit.units import number

#: Number of standard deviations from which a point or a block is an outlier; chosen: no noise reaches it.
_FAR = 8.0
#: Minimum distance of an outlier in ln K from its repeats, and from the smooth curve of its run; chosen: less does not
#: matter to a fit, and a parabola follows rubber to a few per cent.
_SMALLEST_OUTLIER, _SMALLEST_FROM_CURVE = 0.01, 0.1
#: Minimum number of points of a run that is checked for outliers, and maximum number for which the curve is a line.
_FEWEST_POINTS, _FEW_POINTS = 5, 8
#: Minimum distance in ln |K| of an outlying block from the other repeats; chosen: mountings differ by less.
_SMALLEST_BLOCK_OFFSET = 0.02
#: Minimum number of blocks whose scatter can be judged.
_FEWEST_BLOCKS = 5
#: Probability below which equal points, or a drift of |K| over the repeats, are not due to chance; chosen.
_CHANCE = 1e-4
#: Minimum reported change of ln |K| from the first to the last repeat; chosen: less does not matter to a fit.
_SMALLEST_DRIFT = 5e-3
#: Smallest assumed probability that two phases are equal; chosen: some files contain phases in few digits.
_SAME_PHASE_P = 0.05
#: Step in ln amplitude between levels below which they may be repeats of one level; chosen: no test has finer levels.
_SMALLEST_STEP = 0.02
#: Maximum number of listed points or frequencies, and of listed levels; chosen: the length of a sentence or line.
_MOST_LISTED, _MOST_LEVELS = 4, 8


def describe_sweep(sweep: Sweep, labels: Labels) -> Findings:
    """Facts and oddities of a sweep.

    Args:
        sweep: sweep [SI].
        labels: labels in the names of its file and sheet.

    Returns:
        Facts by name, and a sentence on each oddity.
    """
    unit, factor = sweep.direction.display.displacement
    frequencies, levels = np.unique(sweep.frequency), np.unique(sweep.amplitude)
    noise, distance = sweep_noise([sweep]), distance_from_repeats(sweep)
    level_texts = [f"{factor * level:.4g}" for level in levels[:_MOST_LEVELS]] + ["..."] * (levels.size > _MOST_LEVELS)
    facts = {
        "frequencies": format_frequencies(frequencies),
        "amplitudes": f"{', '.join(level_texts)} {unit} zero-to-peak",
        "repeats": f"{np.unique(sweep.repeat).size}",
        "noise": noise.describe(),
    }
    odd = [
        *MeasuredSweep(sweep, noise).notes,
        *implausible_sizes(sweep.direction, sweep.frequency, sweep.amplitude, np.abs(sweep.stiffness)),
        *wrong_labels(labels, sweep.direction, levels.tolist(), frequencies.tolist()),
        *copied_rows(sweep, noise),
        *odd_levels(sweep),
        *missing_frequencies(sweep),
        *outlying_points(sweep, noise, distance),
        *outlying_blocks(sweep, distance),
        *odd_losses(sweep),
    ]
    return facts, odd


def copied_rows(sweep: Sweep, noise: SweepNoise) -> Iterator[str]:
    """Warn of rows with exactly the stiffness of another row at the same frequency and amplitude.

    Returns:
        One sentence, if noise is unlikely to make this number of rows equal in the digits of the file.
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
    for rows in group_rows(sweep.frequency, sweep.amplitude):
        points = np.stack((magnitude[rows], phase[rows]))
        _, start, count = np.unique(points, axis=1, return_index=True, return_counts=True)
        copies += int((count - 1).sum())
        first = min([first, *rows[start[count > 1]].tolist()])
        scatter = noise.random[sweep.name, float(sweep.held_value[rows[0]])][0] * magnitude[rows[0]]
        same_digit = min(float(finest[rows[0]] / scatter), 1.0)  # two draws fall on the same last digit
        expected += rows.size * (rows.size - 1) / 2.0 * same_digit * max(same_digit, _SAME_PHASE_P)
    if copies and pdtrc(copies - 1, expected) < _CHANCE:
        verb = "s repeat others" if copies > 1 else " repeats another"
        yield (
            f"{copies} row{verb} digit by digit, the first of them at {sweep.frequency[first]:.4g} Hz (data row "
            f"{first + 1}): copied instead of measured?"
        )


def odd_levels(sweep: Sweep) -> Iterator[str]:
    """Warn of amplitude levels that may be repeats of one level, and of a level that the rig did not reach.

    Returns:
        A sentence on amplitudes at one frequency that are too close for separate levels and not numbered as repeats;
        and a sentence on the point whose reached amplitude is farthest from its level.
    """
    passes, of_frequency = np.unique(sweep.repeat).size, sweep.frequency.size / np.unique(sweep.frequency).size
    steps = [
        (float(np.diff(np.log(levels)).min()), float(sweep.frequency[rows[0]]))
        for rows in group_rows(sweep.frequency)
        if (levels := np.unique(sweep.amplitude[rows])).size > 1
    ]
    smallest, frequency = min(steps, default=(np.inf, 0.0))
    if smallest < _SMALLEST_STEP and round(of_frequency) != passes:
        yield (
            f"two amplitudes at {frequency:.4g} Hz differ by {number(100 * np.expm1(smallest), 2)} % and are treated "
            "as two levels; if they are repeats, number them in a column repeat"
        )
    relative_miss = np.abs(sweep.amplitude_reached / sweep.amplitude - 1.0)
    row = int(np.argmax(relative_miss))
    if relative_miss[row] > MISSED_LEVEL:
        both = sweep.amplitude_reached[row], sweep.amplitude[row]
        reached, level = (shown_amplitude(sweep.direction, size) for size in both)
        yield f"{reached} was reached instead of the nominal {level} ({sweep.frequency[row]:.4g} Hz)"


def missing_frequencies(sweep: Sweep) -> Iterator[str]:
    """Warn of blocks (one repeat of one level) that lack frequencies which most other blocks contain.

    Returns:
        One sentence for each incomplete block.
    """
    frequencies, blocks = np.unique(sweep.frequency), group_rows(sweep.amplitude, sweep.repeat.astype(float))
    measured = np.array([np.isin(frequencies, sweep.frequency[rows]) for rows in blocks])
    usual = measured.mean(axis=0) > 0.5
    for rows, has in zip(blocks, measured, strict=True):
        absent = [f"{frequency:.4g}" for frequency in frequencies[usual & ~has]]
        if absent and len(blocks) > 1:
            of_repeat = f", repeat {sweep.repeat[rows[0]]}," if np.unique(sweep.repeat).size > 1 else ""
            listed = ", ".join(absent[:_MOST_LISTED] + ["..."] * (len(absent) > _MOST_LISTED))
            level = shown_amplitude(sweep.direction, sweep.amplitude[rows[0]])
            yield f"{level}{of_repeat} lacks {listed} Hz, which most others have"


def distance_from_repeats(sweep: Sweep) -> Array:
    """Complex difference of ln K (gain + i phase [rad]) of each point from the median of its repeats, (n,).

    The value is NaN for points with fewer than three repeats.
    """
    log_stiffness, distance = np.log(sweep.stiffness), np.full(sweep.frequency.size, np.nan + 0j)
    for rows in group_rows(sweep.frequency, sweep.amplitude):
        if rows.size > 2:
            distance[rows] = log_stiffness[rows] - complex_median(log_stiffness[rows])
    return distance


def distance_from_curve(sweep: Sweep) -> Array:
    """Complex difference of ln K (gain + i phase [rad]) of each point from a smooth curve through its run.

    A run is one pass of a sweep over the frequencies at one amplitude, or over the amplitudes at one frequency.

    Returns:
        Difference of the points that deviate far more than the scatter of their run; 0 for the others, (n,).

    Notes:
        Two curves are fitted by least absolute distances, which a few outliers do not bend, even at an end of the run:
        a line over the logarithm of the stepped quantity, and a parabola over the index of the step. The smaller of the
        two distances is returned.
    """
    distance = np.zeros(sweep.frequency.size, dtype=complex)
    runs = group_rows(sweep.repeat.astype(float), sweep.held_value) if sweep.stepped else []
    for rows in runs:
        steps, rank = np.unique(sweep.step[rows], return_inverse=True)
        if steps.size < _FEWEST_POINTS:
            continue
        log_stiffness = np.log(sweep.stiffness[rows])
        values = np.stack((log_stiffness.real, log_stiffness.imag), axis=1)
        smaller = np.full(rows.size, np.inf + 0j)
        for x, degree in ((np.log(steps), 1), (np.arange(float(steps.size)), 2 if steps.size > _FEW_POINTS else 1)):
            basis = np.polynomial.legendre.legvander((2.0 * (x - x[0]) / (x[-1] - x[0]) - 1.0)[rank], degree)
            residual = (values - basis @ least_absolute(basis, values, 1e-8)) @ np.array([1.0, 1.0j])
            # the curve passes through as many points as it has coefficients
            scatter = MEDIAN_TO_SIGMA * float(np.median(np.sort(np.abs(residual))[degree + 1 :]))
            residual = np.where(np.abs(residual) > _FAR * scatter, residual, 0.0)
            smaller = np.where(np.abs(residual) < np.abs(smaller), residual, smaller)
        distance[rows] = smaller
    return distance


def outlying_points(sweep: Sweep, noise: SweepNoise, from_repeats: Array) -> Iterator[str]:
    """Warn of points far from their repeats or, for fewer than three repeats, from the smooth curve of their run.

    Args:
        sweep: sweep [SI].
        noise: noise of the sweep.
        from_repeats: complex distance of ln K from the median of its repeats, (n,).

    Returns:
        A sentence on each of the first four outliers, and one on the number of further outliers.
    """
    distance = np.nan_to_num(from_repeats)
    for rows in group_rows(sweep.repeat.astype(float), sweep.amplitude):  # what a block has in common is no outlier
        distance[rows] -= complex_median(distance[rows])
    random = np.array([noise.random[sweep.name, float(level)] for level in sweep.held_value])
    curve = distance_from_curve(sweep)
    parts = np.stack((distance.real, distance.imag), axis=1)
    far = np.any((np.abs(parts) > _FAR * random) & (np.abs(parts) > _SMALLEST_OUTLIER), axis=1)
    alone = np.isnan(from_repeats) & (np.abs(curve) > _SMALLEST_FROM_CURVE)
    parts[alone] = np.stack((curve[alone].real, curve[alone].imag), axis=1)
    outliers = np.flatnonzero(far | alone)
    for row in outliers[:_MOST_LISTED]:
        level = shown_amplitude(sweep.direction, sweep.amplitude[row])
        repeat = "" if alone[row] else f", repeat {sweep.repeat[row]}"
        reference = "the smooth curve through the others" if alone[row] else "its repeats"
        yield (
            f"data row {row + 1} ({sweep.frequency[row]:.4g} Hz, {level}{repeat}) deviates by "
            f"{number(100 * np.expm1(parts[row, 0]), 2, '+')} % in |K| and {np.degrees(parts[row, 1]):+.2g} deg from "
            f"{reference}"
        )
    if outliers.size > _MOST_LISTED:
        yield f"{outliers.size - _MOST_LISTED} more points deviate as much"


def outlying_blocks(sweep: Sweep, from_repeats: Array) -> Iterator[str]:
    """Warn of blocks (one repeat of one level) that differ from the other repeats, and of a drift over the repeats.

    Args:
        sweep: sweep [SI].
        from_repeats: complex distance of ln K from the median of its repeats, (n,).

    Returns:
        One sentence for each outlying block, and one on the drift.
    """
    blocks = group_rows(sweep.repeat.astype(float), sweep.amplitude)
    blocks = [rows for rows in blocks if not np.isnan(from_repeats[rows]).any()]
    if len(blocks) < _FEWEST_BLOCKS:
        return
    gain = np.array([np.median(from_repeats[rows].real) for rows in blocks])
    usual = MEDIAN_TO_SIGMA * float(np.median(np.abs(gain[gain != 0.0]))) if np.any(gain) else 0.0
    for rows, block_gain in zip(blocks, gain, strict=True):
        if abs(block_gain) > max(_FAR * usual, _SMALLEST_BLOCK_OFFSET):
            yield (
                f"{shown_amplitude(sweep.direction, sweep.amplitude[rows[0]])}, repeat {sweep.repeat[rows[0]]} differs "
                f"by {number(100 * np.expm1(block_gain), 2, '+')} % in |K| from the other repeats at all frequencies: "
                "other amplitude, temperature or mounting?"
            )
    repeat = np.array([sweep.repeat[rows[0]] for rows in blocks], dtype=float)
    if np.unique(repeat).size > 2 and np.ptp(gain) > 0.0:
        correlation, freedom = float(np.corrcoef(repeat, gain)[0, 1]), repeat.size - 2
        drift = correlation * float(np.std(gain) / np.std(repeat) * np.ptp(repeat))  # of the line through the gains
        t = abs(correlation) * np.sqrt(freedom / max(1.0 - correlation**2, 1e-20))
        if 2.0 * stdtr(freedom, -t) < _CHANCE and abs(drift) > _SMALLEST_DRIFT:
            change = number(100 * drift, 2, "+")
            yield f"|K| drifts by {change} % from the first repeat to the last: warming up, or settling?"


def odd_losses(sweep: Sweep) -> Iterator[str]:
    """Warn of negative loss factors, and of a median loss factor that is unusual for rubber.

    Returns:
        A sentence for each, with possible causes.
    """
    negative = np.flatnonzero(sweep.stiffness.imag < 0.0)
    if negative.size:
        level = shown_amplitude(sweep.direction, sweep.amplitude[negative[0]])
        yield (
            f"{negative.size} point{'s' * (negative.size > 1)} with a loss factor below zero, the first at "
            f"{sweep.frequency[negative[0]]:.4g} Hz, {level}: is the force channel late?"
        )
    mistakes = [mistake for mistake in MISTAKES.values() if mistake.doubt and mistake.possible(sweep)]
    if mistakes:
        causes = ", or ".join(mistake.in_words(sweep) for mistake in mistakes)
        loss = number(float(np.median(loss_factor(sweep.stiffness))), 2)
        yield f"the loss factor is {loss} in the median, unusual for rubber; possible causes: {causes}"


def complex_median(values: Array) -> complex:
    """Median of the real parts and median of the imaginary parts of complex values, as one complex number."""
    return complex(np.median(values.real), np.median(values.imag))
