"""Contents of a hysteresis loop, several loops in one record, or a raw stepped-sine history: sizes, noise, oddities."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from bushfit.caveat import Caveat
from bushfit.effects.mistakes import MISTAKES
from bushfit.fitting.loop_cycles import waveform
from bushfit.fitting.measured_loop import MeasuredLoop
from bushfit.fitting.prepare_loop import REPORTED_MEAN, correlation_text, prepare_loop, recorded_means
from bushfit.inspection.channels import EVEN_CLOCK, describe_sampling, odd_recording
from bushfit.inspection.record import Findings, format_frequencies
from bushfit.reading.measurement import Loop
from bushfit.reading.names import Labels
from bushfit.reduction.harmonics import basis, cycle_harmonics, least_squares, resolved_order, series
from bushfit.reduction.steps import reduce
from bushfit.reduction.turning_points import noise_threshold
from bushfit.units import display_unit, format_aligned, number

#: Minimum change between cycles in standard errors; chosen: noise does not reach it in any of many tests.
_REAL_CHANGE = 6.0
#: Minimum change between cycles, relative to half the range of the force; chosen: less does not matter to a fit.
_SMALLEST_CHANGE = 2e-3
#: Minimum offset of a loop's zero, relative to half the range; chosen: less does not matter; preloads are more.
_SMALLEST_OFFSET = 0.02
#: Ratio of a mean displacement to that which the stiffness of the loop gives for its mean force, above which it counts
#: from another zero, as the position of an actuator; chosen: rubber creeps and softens by less.
_MOST_SOFTENING = 10.0
#: Maximum number of cycles that are compared at each end of a loop; chosen: enough to show settling.
_MOST_END_CYCLES = 6
#: Harmonic of the motion above which a spectral line is a ripple, unless a triangle; chosen: waveforms have fewer.
_RIPPLE_ORDER = 20
#: Minimum ripple relative to the amplitude, and relative to the median spectral line; chosen: less is noise.
_SMALLEST_RIPPLE, _RIPPLE_LINE = 3e-4, 10.0
#: Minimum number of rows whose spectrum distinguishes a line from noise.
_FEWEST_RIPPLE_ROWS = 200
#: Duration of a cycle [s] above which the time column is in doubt; chosen: quasi-static tests take minutes.
_LONGEST_CYCLE = 3000.0


def describe_loop(loop: Loop, labels: Mapping[str, Labels]) -> Findings:
    """Describe a loop: facts such as frequency, amplitude and noise, and anything unusual.

    Args:
        loop: loop [SI].
        labels: amplitudes and frequencies stated in texts, by origin: "name" or "text above the table".

    Returns:
        Facts as texts by name, such as "sampling", and a warning on each oddity.

    Raises:
        FitError: no whole cycle, or a loop that runs the wrong way round.
    """
    prepared, units, names = prepare_loop(loop), loop.direction.display, loop.direction.motion.words
    (length, to_length), half_force = units.displacement, float(np.ptp(prepared.test.force)) / 2.0
    force, to_force = display_unit(*units.force, half_force)
    half_motion = float(np.ptp(prepared.test.displacement)) / 2.0
    frequency, amplitude = float(prepared.frequency[0]), float(prepared.amplitude[0])
    # the mean of a Fourier series, whatever part of a cycle the record begins or ends in
    mean_force = float(least_squares(basis(prepared.phase, 2), prepared.measured_force, prepared.weights)[0])
    mean_motion = prepared.coefficients[0].real
    noise = f"{number(100 * prepared.noise / half_force, 2)} % of half the {names[1]} range, per row"
    noise += correlation_text(prepared)
    facts = {
        "cycles": f"{prepared.cycles:.3g}, {'the first from rest' if prepared.from_rest else 'treated as steady'}",
        "frequency": f"{frequency:.4g} Hz, {waveform(prepared.coefficients)}",
        "sampling": f"{describe_sampling(loop)}, {prepared.test.time.size / prepared.cycles:.4g} rows per cycle",
        "amplitude": f"{number(to_length * amplitude, 4)} {length} zero-to-peak",
        # down to the last digit of the amplitude: what lies below is noise
        f"mean {names[0]}": f"{format_aligned([to_length * amplitude, to_length * mean_motion], 4)[1]} {length}",
        f"mean {names[1]}": f"{format_aligned([to_force * half_force, to_force * mean_force], 4)[1]} {force}",
        "noise": noise if prepared.noise <= half_force else "not known: the record is not a steady loop",
    }
    if means := recorded_means(prepared):
        # without a mean force, a mean displacement may be a preload after which the force was set to zero
        at_mean_force = amplitude * (abs(mean_force) / half_force if len(means) > 1 else 1.0)
        is_position = abs(mean_motion) > _MOST_SOFTENING * at_mean_force
        if len(means) > 1 or not is_position:
            facts["preload"] = means[-1 if is_position else 0].text(loop.direction)
    odd = odd_recording(loop, labels, [frequency], [amplitude, half_motion], [half_force / amplitude])
    odd += odd_cycles(prepared)
    if means and "preload" not in facts:
        position = means[0].text(loop.direction, 3)
        sentence = (
            f"a mean {names[0]} of {position} without a mean {names[1]} is taken for the position of the actuator; "
            f'if it is a preload, state preload = "{position}" in the campaign'
        )
        odd.append(Caveat("mean_motion", sentence))
    if prepared.cycles < 1.5 and abs(mean_motion) > 0.9 * half_motion:
        sentence = (
            f"one loading and unloading from {number(to_length * loop.displacement[0], 3)} {length}: a static curve is "
            "read as a loop about its mean. Record three cycles or more, because the first cycles settle the rubber"
        )
        odd.append(Caveat("single_cycle", sentence))
    if frequency * _LONGEST_CYCLE < 1.0:  # longer than any laboratory waits: what may the file say instead?
        mistakes = [mistake.sentence_for(prepared.test) for mistake in MISTAKES.values() if mistake.time < 1.0]
        minutes = number(1.0 / frequency / 60.0, 2)
        sentence = f"one cycle takes {minutes} min, which is unusual; possible causes: {', or '.join(mistakes)}"
        odd.append(Caveat("slow_cycle", sentence))
    if _SMALLEST_OFFSET * half_motion < abs(mean_motion) <= REPORTED_MEAN * amplitude and prepared.datum is not None:
        sentence = (
            f"the mean displacement is {number(to_length * mean_motion, 3)} {length}, "
            f"{number(100 * mean_motion / half_motion, 2)} % of its amplitude: the fit uses the loop about its mean"
        )
        odd.append(Caveat("mean_motion", sentence))
    return facts, odd


def describe_history(history: Loop, labels: Mapping[str, Labels]) -> Findings:
    """Describe a raw stepped-sine history: facts such as frequencies and amplitudes, and anything unusual.

    Args:
        history: record of the raw history [SI].
        labels: amplitudes and frequencies stated in texts, by origin: "name" or "text above the table".

    Returns:
        Facts as texts by name, such as "sampling", and a warning on each oddity.

    Raises:
        MeasurementError: no steady sine in it.
    """
    reduction = reduce([history])
    steps, (unit, factor) = reduction.steps, history.direction.display.displacement
    levels = sorted({step.level for step in steps})
    frequencies = sorted({step.nominal_frequency for step in steps})
    rows = min(step.rows_per_cycle for step in steps)
    facts = {
        "steps": f"{len(steps)} with steady cycles, at most {max(step.repeat for step in steps)} per point",
        "frequencies": format_frequencies(frequencies),
        "amplitudes": f"{', '.join(f'{factor * level:.4g}' for level in levels)} {unit} zero-to-peak, as reached",
        "sampling": f"{describe_sampling(history)}, {rows:.3g} rows per cycle at least",
        "noise": f"{100 * max(step.gain_error for step in steps):.2g} % of |K| at most, a point",
    }
    notes = history.source.notes if history.source else ()
    odd = odd_recording(history, labels, frequencies, levels, [max(abs(step.stiffness) for step in steps)])
    return facts, [*notes, *odd, *reduction.warnings]


def describe_programme(record: Loop, loops: Sequence[Loop], labels: Mapping[str, Labels]) -> Findings:
    """Describe a record of several loops: facts such as frequencies and amplitudes, and anything unusual.

    Args:
        record: the whole record [SI].
        loops: loops of the record, in order.
        labels: amplitudes and frequencies stated in texts, by origin: "name" or "text above the table".

    Returns:
        Facts as texts by name, such as "sampling", and a warning on each oddity.

    Raises:
        FitError: a part without a whole cycle, or one that runs the wrong way round.
    """
    prepared_loops = [prepare_loop(loop) for loop in loops]
    unit, factor = record.direction.display.displacement
    amplitudes = [float(prepared.amplitude[0]) for prepared in prepared_loops]
    frequencies = [float(prepared.frequency[0]) for prepared in prepared_loops]
    cycles = [prepared.cycles for prepared in prepared_loops]
    left_out = 1 - sum(prepared.test.displacement.size for prepared in prepared_loops) / record.displacement.size
    sizes, rates, ends = (
        list(dict.fromkeys(f"{value:.3g}" for value in values))
        for values in ([factor * size for size in amplitudes], frequencies, (min(cycles), max(cycles)))
    )
    facts = {
        "programme": f"{len(loops)} loops in one record: {', '.join(sizes)} {unit} at {', '.join(rates)} Hz, "
        f"{' to '.join(ends)} cycles used of each; {100 * left_out:.2g} % of the rows left out"
    }
    stiffness = [float(prepared.half_range / prepared.amplitude[0]) for prepared in prepared_loops]
    odd = odd_recording(record, labels, frequencies, amplitudes, stiffness)
    for place, (loop, prepared) in enumerate(zip(loops, prepared_loops, strict=True), start=1):
        rest = loop.part.left_out if loop.part else None
        size, course = number(factor * float(prepared.amplitude[0]), 4), waveform(prepared.coefficients)
        percent = number(100 * prepared.noise / prepared.half_range, 2)
        noise = f"noise {percent} % of half the range, per row{correlation_text(prepared)}"
        words = f"{size} {unit} at {prepared.frequency[0]:.4g} Hz, {course}", noise, rest
        facts[f"loop {place}"] = "; ".join(filter(None, words))
        odd += [note.about(f"loop {place}") for note in odd_cycles(prepared) if note.text != rest]
    facts["sampling"] = describe_sampling(record)
    return facts, odd


def odd_cycles(prepared: MeasuredLoop) -> list[Caveat]:
    """List the notes on a loop, changes from cycle to cycle, and a ripple on its motion."""
    return [*prepared.record_notes, *changing_cycles(prepared), *ripple(prepared)]


def changing_cycles(prepared: MeasuredLoop) -> Iterator[Caveat]:
    """Warn of a force amplitude, mean force or mean motion that changes from the first to the last cycles of a loop.

    Loops of one cycle, or with too few rows in a cycle, are not checked.

    Returns:
        One warning for each change beyond chance.
    """
    loop, count = prepared.test, int(prepared.cycles + 0.01)
    phase = (loop.time - loop.time[0]) * prepared.frequency
    numbers = sorted({*range(min(count, _MOST_END_CYCLES)), *range(max(count - _MOST_END_CYCLES, 0), count)})
    outliers = prepared.faulty_rows["force"].rows
    parts = [np.setdiff1d(np.flatnonzero((phase >= n) & (phase < n + 1)), outliers) for n in numbers]
    rows = min((part.size for part in parts), default=0)
    order = resolved_order(rows, 7)  # a loop of rubber has next to nothing beyond
    if count < 2 or rows < 4 * order:
        return
    if max(np.diff(phase[part], append=phase[part[0]] + 1.0).max() for part in parts) * order > 1.0:
        return  # a series says nothing about a part without rows, such as that of a force that is cut off
    both = np.stack((loop.force, loop.displacement), axis=1)
    fitted = [cycle_harmonics(phase[part], both[part], order) for part in parts]
    # the first cycle from rest has another mean, by the memory of the rubber
    means = np.array([mean for mean, *_ in fitted])[int(prepared.from_rest) :]
    amplitude = np.array([abs(first[0]) for _, first, _ in fitted])
    noise = max(prepared.noise, *(scatter[0] for *_, scatter in fitted))
    error = noise * np.sqrt(1.0 / rows)  # of the force [N or N m]
    (motion, force, _), units = loop.direction.motion.words, loop.direction.display
    smallest = _SMALLEST_CHANGE * np.ptp(loop.force) / 2.0
    # the standard error of an amplitude is sqrt(2) `error`, that of a difference of two is 2 `error`
    change, last_change = amplitude[-1] - amplitude[0], amplitude[-1] - amplitude[-2]
    if abs(change) > max(_REAL_CHANGE * 2.0 * error, smallest):
        force_unit, factor = display_unit(*units.force, float(amplitude[-1]))
        last, first = format_aligned([factor * amplitude[-1], factor * amplitude[0]], 4)
        percent = number(100 * change / amplitude[0], 2, "+")
        is_settled = abs(last_change) < max(_REAL_CHANGE * error, smallest / 2.0) and amplitude.size > 2
        yield Caveat(
            "settling_cycles",
            f"the cycles {'settle' if is_settled else 'are still settling'}: the {force} amplitude goes from "
            f"{first} {force_unit} in the first cycle to {last} in the last ({percent} %)",
        )
    # a time that was made from the motion turns its noise into drift
    smallest_drift = (
        2.0 * _SMALLEST_CHANGE * prepared.amplitude[0] if loop.has_recorded_time else noise_threshold(loop.displacement)
    )
    limits = max(_REAL_CHANGE * 1.5 * error, smallest), smallest_drift
    for name, unit, mean, limit in zip(
        (force, motion), (units.force, units.displacement), means.T, limits, strict=True
    ):
        if abs(mean[-1] - mean[0]) > limit:
            last, first = format_aligned([unit.factor * mean[-1], unit.factor * mean[0]], 3, minimum_digits=1)
            yield Caveat("drift", f"the {name} drifts: its mean goes from {first} to {last} {unit.name}")


def ripple(prepared: MeasuredLoop) -> Iterator[Caveat]:
    """Warn of a fast sine superposed on the motion of a loop: mains hum, servo oscillation or sensor noise.

    Returns:
        One warning on the ripple; none without one.

    Notes:
        The slow harmonics are subtracted from the motion; the ripple is the largest line in the spectrum of the
        remainder, with a Hann window. White noise makes lines up to about five times the median.
    """
    loop, steps = prepared.test, np.diff(prepared.test.time)
    is_even = np.ptp(steps) <= 2.0 * EVEN_CLOCK * np.median(steps)
    if not (loop.has_recorded_time and steps.size >= _FEWEST_RIPPLE_ROWS and is_even):
        return
    phase = (loop.time - loop.time[0]) * prepared.frequency
    is_triangle = waveform(prepared.coefficients) == "a triangle"
    slow = prepared.coefficients if is_triangle else prepared.coefficients[: _RIPPLE_ORDER + 1]
    rest = loop.displacement - series(slow, phase)
    rest[prepared.faulty_rows["displacement"].rows] = 0.0
    window = np.hanning(rest.size)
    lines = np.abs(np.fft.rfft((rest - rest.mean()) * window)) * (2.0 / window.sum())
    frequency = np.fft.rfftfreq(rest.size, float(np.mean(steps)))
    lines[frequency < _RIPPLE_ORDER * prepared.frequency] = 0.0
    line = int(np.argmax(lines))
    if lines[line] > max(_SMALLEST_RIPPLE * float(prepared.amplitude[0]), _RIPPLE_LINE * float(np.median(lines))):
        unit, factor = loop.direction.display.displacement
        is_mains = min(abs(frequency[line] % mains - offset) for mains in (50.0, 60.0) for offset in (0.0, mains)) < 1.0
        yield Caveat(
            "ripple",
            f"a ripple of about {number(factor * lines[line], 2)} {unit} at {frequency[line]:.3g} Hz "
            f"({number(100 * lines[line] / prepared.amplitude[0], 2)} % of the amplitude) is superposed on the motion: "
            f"{'mains hum' if is_mains else 'an oscillating controller, or play at the reversals'}? The loop is the "
            "slow motion",
        )
