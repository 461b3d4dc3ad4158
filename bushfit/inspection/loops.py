"""What a hysteresis loop or a raw stepped-sine history holds: cycles or steps, sampling, noise, and what is odd."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from bushfit.effects.contract import Array
from bushfit.effects.mistakes import MISTAKES
from bushfit.fitting.drive import TOLD_MEAN, Drive, drive_of
from bushfit.fitting.loop_cycles import waveform
from bushfit.geometry import Unit
from bushfit.inspection.channels import odd_channels, sampling
from bushfit.inspection.labels import wrong_labels
from bushfit.inspection.record import Findings, told_frequencies
from bushfit.reading.measurement import Loop
from bushfit.reading.names import Labels
from bushfit.reduction.cycles import least_prominence
from bushfit.reduction.harmonics import cycle_harmonics, resolved_order
from bushfit.reduction.steps import reduce
from bushfit.units import alike, for_people, number

#: Standard errors beyond which cycles differ; chosen: noise does not go that far in any of many tests.
_REAL_CHANGE = 6.0
#: Share of half the force's range beyond which cycles differ; chosen: less does not matter to a fit.
_WORTH_TELLING = 2e-3
#: Share of half its range by which a loop's zero is off; chosen: less does not matter to a fit. A preload is more.
_OFF_ZERO = 0.02
#: Cycles that are looked at from either end of a loop; chosen: what settles shows in them.
_MOST_END_CYCLES = 6
#: [s] A cycle that takes longer is in doubt; chosen: quasi-static tests take minutes.
_LONGEST_CYCLE = 3000.0


def look_at_loop(loop: Loop, labels: Labels) -> Findings:
    """Facts and oddities of a loop; `labels` are what the names of its file and sheet say.

    Raises:
        FitError: no whole cycle, or a loop that runs the wrong way round.
    """
    drive = drive_of(loop)
    units = loop.direction.display
    (length, to_length), half_force = units.displacement, np.ptp(loop.force) / 2.0
    force, to_force = for_people(*units.force, float(half_force))
    names = loop.direction.motion.words
    half_motion = np.ptp(loop.displacement) / 2.0
    amplitude, mean_motion, mean_force = drive.amplitude, drive.coefficients[0].real, float(drive.force.mean())
    facts = {
        "cycles": f"{drive.cycles:.3g}, {'the first from rest' if drive.from_rest else 'taken as steady'}",
        "frequency": f"{drive.frequency:.4g} Hz, {waveform(drive.coefficients)}",
        "sampling": f"{sampling(loop) if loop.timed else 'no time in the file'}, "
        f"{loop.time.size / drive.cycles:.4g} rows a cycle",
        "amplitude": f"{number(to_length * amplitude, 4)} {length} zero-to-peak",
        # as far down as the amplitude is told: what lies below is noise
        f"mean {names[0]}": f"{alike([to_length * amplitude, to_length * mean_motion], 4)[1]} {length}",
        f"mean {names[1]}": f"{alike([to_force * half_force, to_force * mean_force], 4)[1]} {force}",
        "noise": f"{number(100 * drive.noise / half_force, 2)} % of half the {names[1]}'s range, a row"
        f"{drive.correlated}",
    }
    odd = [
        *wrong_labels(labels, loop.direction, [amplitude, half_motion], [drive.frequency]),
        *odd_channels(loop),
        *drive.notes,
        *_changing(drive),
        *_too_slow(drive),
    ]
    if _OFF_ZERO * half_motion < abs(mean_motion) <= TOLD_MEAN * amplitude and drive.datum is not None:
        odd.append(
            f"the motion is off zero by {number(to_length * mean_motion, 3)} {length}, "
            f"{number(100 * mean_motion / half_motion, 2)} % of its amplitude: the loop counts from its own middle"
        )
    return facts, odd


def look_at_history(history: Loop, labels: Labels) -> Findings:
    """Facts and oddities of a history; `labels` are what the names of its file and sheet say.

    Raises:
        MeasurementError: no steady sine in it.
    """
    reduction = reduce([history])
    steps = reduction.steps
    unit, factor = history.direction.display.displacement
    levels = sorted({step.level for step in steps})
    frequencies = sorted({step.nominal_frequency for step in steps})
    facts = {
        "steps": f"{len(steps)} with steady cycles, {max(step.repeat for step in steps)} at most at one point",
        "frequencies": told_frequencies(frequencies),
        "amplitudes": f"{', '.join(f'{factor * level:.4g}' for level in levels)} {unit} zero-to-peak, as reached",
        "sampling": f"{sampling(history)}, {min(step.rows_per_cycle for step in steps):.3g} rows a cycle at least",
        "noise": f"{100 * max(step.gain_error for step in steps):.2g} % of |K| at most, a point",
    }
    odd = [
        *(history.source.notes if history.source else ()),
        *wrong_labels(labels, history.direction, levels, frequencies),
        *odd_channels(history),
        *reduction.warnings,
    ]
    return facts, odd


def _too_slow(drive: Drive) -> Iterator[str]:
    """A sentence on a loop that takes longer than any laboratory waits, and on what the file may say instead."""
    if drive.frequency * _LONGEST_CYCLE < 1.0:
        mistakes = [mistake for mistake in MISTAKES.values() if mistake.time < 1.0]
        unless = ", or ".join(mistake.in_words(drive.loop) for mistake in mistakes)
        yield f"one cycle takes {number(1.0 / drive.frequency / 60.0, 2)} min, as hardly any test does, unless {unless}"


def look_at_programme(record: Loop, loops: Sequence[Loop], labels: Labels) -> Findings:
    """Facts and oddities of a record that holds several loops, in order.

    Raises:
        FitError: a part that has no whole cycle, or runs the wrong way round.
    """
    drives = [drive_of(loop) for loop in loops]
    unit, factor = record.direction.display.displacement
    amplitudes, frequencies = [drive.amplitude for drive in drives], [drive.frequency for drive in drives]
    cycles = [drive.cycles for drive in drives]
    used = sum(drive.loop.displacement.size for drive in drives)
    facts = {
        "programme": f"{len(loops)} loops in one record: {_listed([factor * size for size in amplitudes])} {unit} "
        f"at {_listed(frequencies)} Hz, {_listed([min(cycles), max(cycles)], ' to ')} cycles used of each; "
        f"{100 * (1 - used / record.displacement.size):.2g} % of the rows left out"
    }
    odd = [*wrong_labels(labels, record.direction, amplitudes, frequencies), *odd_channels(record)]
    for place, (loop, drive) in enumerate(zip(loops, drives, strict=True), start=1):
        left_out = loop.part.left_out if loop.part else None
        motion = (
            f"{number(factor * drive.amplitude, 4)} {unit} at {drive.frequency:.4g} Hz, {waveform(drive.coefficients)}"
        )
        noise = f"noise {number(100 * drive.noise / drive.half_range, 2)} % of half the range, a row{drive.correlated}"
        facts[f"loop {place}"] = "; ".join(filter(None, (motion, noise, left_out)))
        odd += [f"loop {place}: {note}" for note in (*drive.notes, *_changing(drive)) if note != left_out]
    facts["sampling"] = sampling(record) if record.timed else "no time in the file"
    return facts, odd


def _listed(values: Sequence[float], between: str = ", ") -> str:
    """Values in their order, each once: "0.2, 0.5, 1"."""
    return between.join(dict.fromkeys(f"{value:.3g}" for value in values))


class _EndCycles(NamedTuple):
    """Force amplitude, mean force and mean motion of the cycles at both ends of a loop, (k,) each.

    `error` is the noise of the force over the root of the rows of a cycle [N or N m].
    """

    amplitude: Array
    mean_force: Array
    mean_motion: Array
    error: float


def _end_cycles(drive: Drive) -> _EndCycles | None:
    """The first and the last cycles of a loop; None where it has only one, or too few rows in each."""
    loop, count = drive.loop, int(drive.cycles + 0.01)
    if count < 2:
        return None
    phase = (loop.time - loop.time[0]) * drive.frequency
    numbers = sorted({*range(min(count, _MOST_END_CYCLES)), *range(max(count - _MOST_END_CYCLES, 0), count)})
    outliers = drive.outliers["force"].rows
    parts = [np.setdiff1d(np.flatnonzero((phase >= n) & (phase < n + 1)), outliers) for n in numbers]
    rows = min(part.size for part in parts)
    order = resolved_order(rows, 7)  # a loop of rubber has next to nothing beyond
    if rows < 4 * order:
        return None
    fitted = [
        cycle_harmonics(phase[part], np.stack((loop.force[part], loop.displacement[part]), axis=1), order)
        for part in parts
    ]
    mean_force, mean_motion = np.array([mean for mean, *_ in fitted]).T
    amplitude = np.array([abs(first[0]) for _, first, _ in fitted])
    error = max(drive.noise, *(left[0] for *_, left in fitted)) * np.sqrt(1.0 / rows)
    return _EndCycles(amplitude, mean_force, mean_motion, error)


def _settling(cycles: _EndCycles, least: float, name: str, unit: Unit) -> Iterator[str]:
    """A sentence where the force amplitude changes over the cycles, by `least` or more [N or N m]."""
    force, error = cycles.amplitude, cycles.error
    change, last_change = force[-1] - force[0], force[-1] - force[-2]
    # the standard error of an amplitude is sqrt(2) `error`, that of a difference of two is 2 `error`
    if abs(change) > max(_REAL_CHANGE * 2.0 * error, least):
        shown, factor = for_people(*unit, float(force[-1]))
        last, first = alike([factor * force[-1], factor * force[0]], 4)
        settled = abs(last_change) < max(_REAL_CHANGE * error, least / 2.0) and force.size > 2
        yield (
            f"the cycles {'settle' if settled else 'are still settling'}: the {name} amplitude goes from "
            f"{first} {shown} in the first cycle to {last} in the last ({number(100 * change / force[0], 2, '+')} %)"
        )


def _drifting(mean: Array, least: float, name: str, unit: Unit) -> Iterator[str]:
    """A sentence where the mean of a channel changes over the cycles by more than `least`."""
    if abs(mean[-1] - mean[0]) > least:
        last, first = alike([unit.factor * mean[-1], unit.factor * mean[0]], 3, least=1)
        yield f"the {name} drifts: its mean goes from {first} to {last} {unit.name}"


def _changing(drive: Drive) -> Iterator[str]:
    """Sentences where force amplitude, mean force or mean motion change from cycle to cycle."""
    cycles = _end_cycles(drive)
    if cycles is None:
        return
    loop = drive.loop
    (motion, force, _), units = loop.direction.motion.words, loop.direction.display
    least = _WORTH_TELLING * np.ptp(loop.force) / 2.0
    yield from _settling(cycles, least, force, units.force)
    yield from _drifting(cycles.mean_force, max(_REAL_CHANGE * 1.5 * cycles.error, least), force, units.force)
    # a time that was made from the motion turns its noise into drift
    least_drift = 2.0 * _WORTH_TELLING * drive.amplitude if loop.timed else least_prominence(loop.displacement)
    yield from _drifting(cycles.mean_motion, least_drift, motion, units.displacement)
