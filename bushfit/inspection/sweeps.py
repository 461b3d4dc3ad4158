"""Contents of a sweep: frequencies, amplitudes, repeats, noise and oddities."""

from collections.abc import Iterator, Mapping

import numpy as np
import pandas as pd
from scipy.special import pdtrc, stdtr

from bushfit.caveat import Caveat
from bushfit.effects.contract import Array
from bushfit.effects.mistakes import MISTAKES
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.fitting.measured_test import shown_amplitude
from bushfit.fitting.noise import SweepNoise, sweep_noise
from bushfit.fitting.outliers import least_absolute
from bushfit.geometry import Place
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


def describe_sweep(sweep: Sweep, labels: Mapping[str, Labels]) -> Findings:
    """Describe a sweep: facts such as frequencies, amplitudes and noise, and anything unusual.

    Args:
        sweep: sweep [SI].
        labels: amplitudes and frequencies stated in texts, by origin: "name" or "text above the table".

    Returns:
        Facts as texts by name, such as "frequencies", and a warning on each oddity.
    """
    unit, factor = sweep.direction.display.displacement
    frequencies, levels = np.unique(sweep.frequency), np.unique(sweep.amplitude)
    noise, log_stiffness = sweep_noise([sweep]), np.log(sweep.stiffness)
    keys = {"frequency": sweep.frequency, "amplitude": sweep.amplitude, "repeat": sweep.repeat}
    points = pd.DataFrame({**keys, "gain": log_stiffness.real, "phase": log_stiffness.imag})
    repeats = points.groupby(["frequency", "amplitude"])
    from_median = points[["gain", "phase"]] - repeats[["gain", "phase"]].transform("median")
    from_repeats = from_median.where(repeats["gain"].transform("size") >= 3)  # of fewer, the median is no reference
    level_texts = [f"{factor * level:.4g}" for level in levels[:_MOST_LEVELS]] + ["..."] * (levels.size > _MOST_LEVELS)
    facts = {
        "frequencies": format_frequencies(frequencies),
        "amplitudes": f"{', '.join(level_texts)} {unit} zero-to-peak",
        "repeats": f"{np.unique(sweep.repeat).size}",
        "noise": noise.describe(),
    }
    odd = [
        *MeasuredSweep(test=sweep, noise=noise).notes,
        *implausible_sizes(sweep.direction, sweep.frequency, sweep.amplitude, np.abs(sweep.stiffness), sweep.preload),
        *wrong_labels(labels, sweep.direction, levels.tolist(), frequencies.tolist()),
        *copied_rows(sweep, noise, points),
        *odd_levels(sweep, points),
        *missing_frequencies(sweep.direction, points),
        *outlying_points(sweep, noise, points, from_repeats),
        *outlying_blocks(sweep.direction, points, from_repeats),
        *odd_losses(sweep),
    ]
    return facts, odd


def copied_rows(sweep: Sweep, noise: SweepNoise, points: pd.DataFrame) -> Iterator[Caveat]:
    """Warn of rows with exactly the stiffness of another row at the same frequency and amplitude.

    Args:
        sweep: sweep [SI].
        noise: noise of the sweep.
        points: frequency, amplitude, repeat and ln K (gain and phase) of its points.

    Returns:
        One warning, if noise is unlikely to make this number of rows equal in the digits of the file.
    """
    keys = ["frequency", "amplitude"]
    rows = points[[*keys, "gain", "phase"]].round({"gain": 9, "phase": 9})  # the conversion of units changes the 16th
    copied, first, repeats = rows.duplicated(), ~rows.duplicated(keys), rows.groupby(keys, sort=False).size()
    # the value of one in the last digit, if all have as many digits as the longest
    magnitude = np.abs(sweep.stiffness)
    digits = max(len(f"{value:.8e}".partition("e")[0].replace(".", "").rstrip("0")) for value in magnitude)
    finest = 10.0 ** (np.floor(np.log10(magnitude[first])) + 1 - digits)
    scatter = np.array([noise.random[sweep.name, float(value)][0] for value in sweep.run_level[first]])
    same_digit = np.minimum(finest / (scatter * magnitude[first]), 1.0)  # two draws fall on the same last digit
    expected = np.sum(repeats * (repeats - 1) / 2.0 * same_digit * np.maximum(same_digit, _SAME_PHASE_P))
    if (count := int(copied.sum())) and pdtrc(count - 1, expected) < _CHANCE:
        row = int(np.argmax(rows.duplicated(keep=False)))
        yield Caveat(
            "copied_rows",
            f"{count} row{'s equal other rows' if count > 1 else ' equals another row'} in all digits, the first at "
            f"{sweep.frequency[row]:.4g} Hz (data row {row + 1}): copied instead of measured?",
        )


def odd_levels(sweep: Sweep, points: pd.DataFrame) -> Iterator[Caveat]:
    """Warn of amplitude levels that may be repeats of one level, and of a level that the rig did not reach.

    Args:
        sweep: sweep [SI].
        points: frequency, amplitude, repeat and ln K (gain and phase) of its points.

    Returns:
        A warning if two amplitudes at one frequency are so close that they may be repeats of one level, without
        numbers in a column `repeat`; and a warning on the point that missed its level most, if it missed it by much.
    """
    passes, of_frequency = np.unique(sweep.repeat).size, sweep.frequency.size / np.unique(sweep.frequency).size
    levels = points[["frequency", "amplitude"]].drop_duplicates().sort_values(["frequency", "amplitude"])
    steps = np.log(levels["amplitude"]).groupby(levels["frequency"]).diff().dropna()
    if not steps.empty and steps.min() < _SMALLEST_STEP and round(of_frequency) != passes:
        yield Caveat(
            "close_levels",
            f"two amplitudes at {levels['frequency'][steps.idxmin()]:.4g} Hz differ by "
            f"{number(100 * np.expm1(steps.min()), 2)} % and are treated as two levels. If the levels are repeats, "
            "number the repeats in a column repeat",
        )
    relative_miss = np.abs(sweep.amplitude_reached / sweep.amplitude - 1.0)
    row = int(np.argmax(relative_miss))
    if relative_miss[row] > MISSED_LEVEL:
        reached, level = (shown_amplitude(sweep.direction, x[row]) for x in (sweep.amplitude_reached, sweep.amplitude))
        sentence = f"{reached} was reached instead of the nominal {level} ({sweep.frequency[row]:.4g} Hz)"
        yield Caveat("missed_level", sentence)


def missing_frequencies(place: Place, points: pd.DataFrame) -> Iterator[Caveat]:
    """Warn of blocks (one repeat of one level) that lack frequencies which most other blocks contain.

    Args:
        place: direction or specimen.
        points: frequency, amplitude, repeat and ln K (gain and phase) of the points of a sweep.

    Returns:
        One warning for each incomplete block.
    """
    measured = pd.crosstab([points["amplitude"], points["repeat"]], points["frequency"]) > 0
    usual = measured.mean() > 0.5
    for (amplitude, repeat), has in zip(measured.index, measured.to_numpy(), strict=True):
        absent = [f"{frequency:.4g}" for frequency in measured.columns[usual & ~has]]
        if absent:
            of_repeat = f", repeat {repeat}," if np.unique(points["repeat"]).size > 1 else ""
            listed = ", ".join(absent[:_MOST_LISTED] + ["..."] * (len(absent) > _MOST_LISTED))
            block = f"{shown_amplitude(place, amplitude)}{of_repeat}"
            yield Caveat("missing_frequencies", f"{block} lacks {listed} Hz, which most other levels contain")


def distance_from_curve(sweep: Sweep, points: pd.DataFrame) -> Array:
    """Gain and phase [rad] of each point of a sweep minus a smooth curve through its run, (n, 2).

    A run is one pass of a sweep over the frequencies at one amplitude, or over the amplitudes at one frequency.

    Args:
        sweep: sweep [SI].
        points: frequency, amplitude, repeat and ln K (gain and phase) of its points.

    Returns:
        Difference of the points that deviate far more than the scatter of their run; 0 for the others, (n, 2).

    Notes:
        Two curves are fitted by least absolute distances, which a few outliers do not bend, even at an end of the run:
        a line over the logarithm of the stepped quantity, and a parabola over the index of the step. The smaller of the
        two distances is returned.
    """
    distance = np.zeros((len(points), 2))
    for rows in group_rows(sweep.repeat.astype(float), sweep.run_level) if sweep.stepped else ():
        steps, rank = np.unique(sweep.step[rows], return_inverse=True)
        if steps.size < _FEWEST_POINTS:
            continue
        values = points.loc[rows, ["gain", "phase"]].to_numpy()
        both = []
        for x, degree in ((np.log(steps), 1), (np.arange(float(steps.size)), 2 if steps.size > _FEW_POINTS else 1)):
            basis = np.polynomial.legendre.legvander((2.0 * (x - x[0]) / (x[-1] - x[0]) - 1.0)[rank], degree)
            residual = values - basis @ least_absolute(basis, values, 1e-8)
            size = np.linalg.norm(residual, axis=1)
            # the curve passes through as many points as it has coefficients
            scatter = MEDIAN_TO_SIGMA * float(np.median(np.sort(size)[degree + 1 :]))
            both.append(np.where(size > _FAR * scatter, residual.T, 0.0).T)
        is_first_smaller = np.linalg.norm(both[0], axis=1) <= np.linalg.norm(both[1], axis=1)
        distance[rows] = np.where(is_first_smaller[:, None], *both)
    return distance


def outlying_points(
    sweep: Sweep, noise: SweepNoise, points: pd.DataFrame, from_repeats: pd.DataFrame
) -> Iterator[Caveat]:
    """Warn of points far from their repeats or, for fewer than three repeats, from the smooth curve of their run.

    Args:
        sweep: sweep [SI].
        noise: noise of the sweep.
        points: frequency, amplitude, repeat and ln K (gain and phase) of its points.
        from_repeats: gain and phase [rad] of each point minus the median of its repeats; nan for fewer than three.

    Returns:
        A warning on each of the first four outliers, and one on the number of further outliers.
    """
    filled = from_repeats.fillna(0.0)  # what a block has in common is no outlier
    distance = np.array(filled - filled.groupby([points["repeat"], points["amplitude"]]).transform("median"))
    random = np.array([noise.random[sweep.name, float(value)] for value in sweep.run_level])
    far = np.any((np.abs(distance) > _FAR * random) & (np.abs(distance) > _SMALLEST_OUTLIER), axis=1)
    curve = distance_from_curve(sweep, points)
    alone = from_repeats["gain"].isna().to_numpy() & (np.linalg.norm(curve, axis=1) > _SMALLEST_FROM_CURVE)
    distance[alone] = curve[alone]
    outliers = np.flatnonzero(far | alone)
    for row in outliers[:_MOST_LISTED]:
        level = shown_amplitude(sweep.direction, sweep.amplitude[row])
        repeat = "" if alone[row] else f", repeat {sweep.repeat[row]}"
        reference = "the smooth curve through the others" if alone[row] else "its repeats"
        yield Caveat(
            "outlying_point",
            f"data row {row + 1} ({sweep.frequency[row]:.4g} Hz, {level}{repeat}) deviates by "
            f"{number(100 * np.expm1(distance[row, 0]), 2, '+')} % in |K| and {np.degrees(distance[row, 1]):+z.2g} deg "
            f"from {reference}",
        )
    if outliers.size > _MOST_LISTED:
        yield Caveat("more_outlying_points", f"{outliers.size - _MOST_LISTED} more points deviate as much")


def outlying_blocks(place: Place, points: pd.DataFrame, from_repeats: pd.DataFrame) -> Iterator[Caveat]:
    """Warn of blocks (one repeat of one level) that differ from the other repeats, and of a drift over the repeats.

    Args:
        place: direction or specimen.
        points: frequency, amplitude, repeat and ln K (gain and phase) of the points of a sweep.
        from_repeats: gain and phase [rad] of each point minus the median of its repeats; nan for fewer than three.

    Returns:
        One warning for each outlying block, and one on the drift.
    """
    blocks = from_repeats["gain"].groupby([points["repeat"], points["amplitude"]])
    gain = blocks.median()[blocks.count() == blocks.size()]  # of blocks in which all points have repeats
    if len(gain) < _FEWEST_BLOCKS:
        return
    usual = MEDIAN_TO_SIGMA * float(np.median(np.abs(gain[gain != 0.0]))) if np.any(gain) else 0.0
    for (repeat, amplitude), block_gain in zip(gain.index, gain, strict=True):
        if abs(block_gain) > max(_FAR * usual, _SMALLEST_BLOCK_OFFSET):
            yield Caveat(
                "outlying_block",
                f"{shown_amplitude(place, amplitude)}, repeat {repeat} differs by "
                f"{number(100 * np.expm1(block_gain), 2, '+')} % in |K| from the other repeats at all frequencies: "
                "other amplitude, temperature or mounting?",
            )
    repeat = gain.index.get_level_values("repeat").to_numpy(float)
    if np.unique(repeat).size > 2 and np.ptp(gain) > 0.0:
        correlation, freedom = float(np.corrcoef(repeat, gain)[0, 1]), repeat.size - 2
        drift = float(np.polyfit(repeat, gain, 1)[0]) * np.ptp(repeat)
        t = abs(correlation) * np.sqrt(freedom / max(1.0 - correlation**2, 1e-20))
        if 2.0 * stdtr(freedom, -t) < _CHANCE and abs(drift) > _SMALLEST_DRIFT:
            change = number(100 * drift, 2, "+")
            sentence = f"|K| drifts by {change} % from the first repeat to the last: warming up, or settling?"
            yield Caveat("drift", sentence)


def odd_losses(sweep: Sweep) -> Iterator[Caveat]:
    """Warn of negative loss factors, and of a median loss factor that is unusual for rubber.

    Returns:
        A warning for each, with possible causes.
    """
    negative = np.flatnonzero(sweep.stiffness.imag < 0.0)
    if negative.size:
        level = shown_amplitude(sweep.direction, sweep.amplitude[negative[0]])
        yield Caveat(
            "negative_loss",
            f"{negative.size} point{'s' * (negative.size > 1)} with a loss factor below zero, the first at "
            f"{sweep.frequency[negative[0]]:.4g} Hz, {level}: is the force channel late?",
        )
    mistakes = [mistake for mistake in MISTAKES.values() if mistake.doubt and mistake.is_possible(sweep)]
    if mistakes:
        causes = ", or ".join(mistake.sentence_for(sweep) for mistake in mistakes)
        loss = number(float(np.median(loss_factor(sweep.stiffness))), 2)
        sentence = f"the loss factor is {loss} in the median, unusual for rubber; possible causes: {causes}"
        yield Caveat("unusual_loss", sentence)
