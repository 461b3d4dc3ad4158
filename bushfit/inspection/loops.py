"""A hysteresis loop looked at: cycles, sampling, waveform, noise, and what is odd."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.drive import Drive, drive_of
from bushfit.fitting.waveform import waveform
from bushfit.inspection.channels import clock, odd_channels
from bushfit.inspection.labels import wrong_labels
from bushfit.inspection.record import Looked
from bushfit.reading.measurement import Loop
from bushfit.reduction.cycles import least_turn
from bushfit.units import alike, for_people, number

#: Cycles differ beyond so many standard errors and this share of half the force's range.
_SURE, _SHARE = 6.0, 2e-3
#: A loop's zero is off by this share of half the range.
_OFF_ZERO = 0.02
#: At most so many cycles are looked at from either end, with so many harmonics.
_ENDS, _HARMONICS = 6, 7


def look_at_loop(loop: Loop, file: Path) -> Looked:
    """Facts and oddities of a loop.

    Raises:
        FitError: no whole cycle, or a loop that runs the wrong way round.
    """
    drive = drive_of(loop)
    units = loop.direction.display
    (length, to_length), half_force = units.displacement, np.ptp(loop.force) / 2.0
    force, to_force = for_people(*units.force, float(half_force))
    names = loop.direction.motion.words
    rows = loop.time.size / drive.cycles
    half_motion = np.ptp(loop.displacement) / 2.0
    amplitude, mean_motion, mean_force = drive.amplitude, drive.coefficients[0].real, _mean(drive)
    facts = {
        "cycles": f"{drive.cycles:.3g}, {'the first from rest' if drive.from_rest else 'taken as steady'}",
        "frequency": f"{drive.frequency:.4g} Hz, {waveform(drive.coefficients)}",
        "sampling": f"{clock(loop) if loop.timed else 'no time in the file'}, {rows:.4g} rows a cycle",
        "amplitude": f"{number(to_length * amplitude, 4)} {length} zero-to-peak",
        # as far down as the amplitude is told: what lies below is noise
        f"mean {names[0]}": f"{alike([to_length * amplitude, to_length * mean_motion], 4)[1]} {length}",
        f"mean {names[1]}": f"{alike([to_force * half_force, to_force * mean_force], 4)[1]} {force}",
        "noise": f"{number(100 * drive.noise / half_force, 2)} % of half the {names[1]}'s range, a row",
    }
    odd = [
        *wrong_labels(file, loop.direction, [amplitude, half_motion], [drive.frequency]),
        *odd_channels(loop),
        *drive.notes,
        *_changing(drive, names),
    ]
    if abs(mean_motion) > _OFF_ZERO * half_motion and not drive.from_rest:
        odd.append(
            f"the motion is off zero by {number(to_length * mean_motion, 3)} {length}, "
            f"{number(100 * mean_motion / half_motion, 2)} % of its amplitude: the loop counts from its own middle"
        )
    return Looked(facts, tuple(odd))


def _mean(drive: Drive) -> float:
    return float(np.average(drive.force, weights=np.ones_like(drive.weight)))


def _changing(drive: Drive, names: tuple[str, str]) -> Iterator[str]:
    """Whether force amplitude, mean force or mean motion change from cycle to cycle."""
    loop = drive.loop
    count = int(drive.cycles + 0.01)
    if count < 2:
        return
    units = loop.direction.display
    phase = (loop.time - loop.time[0]) * drive.frequency
    numbers = sorted({*range(min(count, _ENDS)), *range(max(count - _ENDS, 0), count)})
    wild = drive.outliers["force"].rows
    parts = [np.setdiff1d(np.flatnonzero((phase >= n) & (phase < n + 1)), wild) for n in numbers]
    rows = min(part.size for part in parts)
    order = int(np.clip(rows // 5, 1, _HARMONICS))
    if rows < 4 * order:
        return
    fitted = [
        _cycle(phase[part], np.stack((loop.force[part], loop.displacement[part]), axis=1), order) for part in parts
    ]
    means, force = np.array([mean for mean, *_ in fitted]), np.array([abs(first[0]) for _, first, _ in fitted])
    half = np.ptp(loop.force) / 2.0
    error = max(drive.noise, *(left for *_, left in fitted)) * np.sqrt(1.0 / rows)
    change = force[-1] - force[0]
    if abs(change) > max(_SURE * 2.0 * error, _SHARE * half):
        last = force[-1] - force[-2]
        unit, factor = for_people(*units.force, float(force[-1]))
        final, first = alike([factor * force[-1], factor * force[0]], 4)
        settled = abs(last) < max(_SURE * error, _SHARE * half / 2.0) and count > 2
        yield (
            f"the cycles {'settle' if settled else 'are still settling'}: the {names[1]} amplitude goes from "
            f"{first} {unit} in the first cycle to {final} in the last ({number(100 * change / force[0], 2, '+')} %)"
        )
    for name, (unit, factor), mean, least in (
        (names[1], units.force, means[:, 0], max(_SURE * 1.5 * error, _SHARE * half)),
        # a time that was made from the motion turns its noise into drift
        (names[0], units.displacement, means[:, 1], _least_drift(drive)),
    ):
        drift = mean[-1] - mean[0]
        if abs(drift) > least:
            last, first = alike([factor * mean[-1], factor * mean[0]], 3, least=1)
            yield f"the {name} drifts: its mean goes from {first} to {last} {unit}"


def _least_drift(drive: Drive) -> float:
    return 2.0 * _SHARE * drive.amplitude if drive.loop.timed else least_turn(drive.loop.displacement)


def _cycle(phase: Array, values: Array, order: int) -> tuple[Array, Array, float]:
    """Mean and complex fundamental of the columns over one cycle, and what the fit leaves of the first."""
    turns = 2.0 * np.pi * np.outer(phase, np.arange(1, order + 1))
    basis = np.hstack((np.ones((phase.size, 1)), np.cos(turns), -np.sin(turns)))
    solution = np.linalg.lstsq(basis, values, rcond=None)[0]
    left = float(np.std(values[:, 0] - basis @ solution[:, 0]))
    return solution[0], solution[1] + 1j * solution[1 + order], left
