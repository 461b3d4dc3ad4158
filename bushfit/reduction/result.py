"""Result of a reduction of raw histories: operating points, stretches without a point, and warnings about both."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Required

import numpy as np
from typing_extensions import TypedDict

from bushfit.caveat import Caveat
from bushfit.geometry import Place
from bushfit.units import display_unit, number

#: Relative distance of an amplitude from its level above which a warning is due; chosen: |K| may then be 1 % off.
MISSED_LEVEL = 0.03
#: Rows per cycle below which a warning is due; chosen: 12 rows separate overtones up to the sixth.
_FEW_ROWS_PER_CYCLE = 12
#: Largest number of stretches without a point that are listed one by one; chosen: a screen has room for as many lines.
_MOST_LISTED = 5


class ReductionDocument(TypedDict, total=False):
    """JSON document of a sweep obtained by reduction of raw histories or of a resonance test.

    Args:
        direction: tested direction of the bushing; missing for a specimen.
        specimen: tested specimen; missing for a bushing.
        points: columns of sweep.csv by header, one entry for each operating point.
        warnings: warnings on the use of the numbers.
        warning_kinds: kind of each warning, as in bushfit/caveat.toml.
        campaign: text of the [[sweeps]] table for a campaign.
        mass_kg: mass on the mount [kg]; only for a resonance test, like the next two keys.
        resonance_Hz: frequency of the largest transmissibility [Hz].
        transmissibility_at_resonance: largest magnitude of the transmissibility [1].
    """

    direction: str
    specimen: str
    points: Required[dict[str, list[float | str | None]]]
    warnings: Required[list[str]]
    warning_kinds: Required[list[str]]
    campaign: Required[str]
    mass_kg: float
    resonance_Hz: float
    transmissibility_at_resonance: float


@dataclass(frozen=True, eq=False)
class Step:
    """Operating point computed from the steady cycles of one step (constant frequency and amplitude) of a history.

    Args:
        name: name of the history.
        start, end: beginning and end of the used cycles [s].
        cycles, found: number of whole cycles used for the operating point, and found in the step.
        rows_per_cycle: mean number of rows in a cycle.
        frequency: fundamental frequency [Hz].
        amplitude: zero-to-peak amplitude of the displacement's fundamental, as reached by the rig [m or rad].
        stiffness: complex stiffness K = F1/X1 of the fundamentals [N/m or N m/rad].
        gain_error: standard error of |K|, relative to |K|.
        phase_error: standard error of the phase of K [rad].
        displacement_distortion, force_distortion: total harmonic distortion, relative to the fundamental.
        nominal_frequency, level: common frequency [Hz] and amplitude [m or rad] of the group of steps to which this
            step belongs.
        repeat: number of this step among the steps at the same nominal frequency and level, from 1.
        mean_displacement, mean_force: mean values during the step [m or rad, N or N m].
    """

    name: str
    start: float
    end: float
    cycles: int
    found: int
    rows_per_cycle: float
    frequency: float
    amplitude: float
    stiffness: complex
    gain_error: float
    phase_error: float
    displacement_distortion: float
    force_distortion: float
    nominal_frequency: float = 0.0
    level: float = 0.0
    repeat: int = 1
    mean_displacement: float = 0.0
    mean_force: float = 0.0


@dataclass(frozen=True, eq=False)
class SkippedStretch:
    """Stretch of a history that gives no operating point.

    Args:
        name: name of the history.
        start, end: beginning and end of the stretch [s].
        why: reason, as a phrase.
        steady: True if the stretch has enough cycles for a step.
    """

    name: str
    start: float
    end: float
    why: str
    steady: bool


@dataclass(frozen=True, eq=False)
class Reduction:
    """Operating points obtained from the raw histories of one direction.

    Args:
        direction: direction or specimen.
        steps: operating points in the order of the histories and of time.
        skipped: stretches of the histories without an operating point.
        outliers: number of rows omitted as outliers.
    """

    direction: Place
    steps: tuple[Step, ...]
    skipped: tuple[SkippedStretch, ...]
    outliers: int = 0

    @property
    def warnings(self) -> tuple[Caveat, ...]:
        """Warnings on outliers, negative losses, means, levels, sampling, distortion, and parts without a point."""
        steps, warnings = self.steps, list[Caveat]()
        unit, factor = self.direction.display.displacement
        if self.outliers:
            sentence = f"{self.outliers} row{'s' * (self.outliers > 1)} far from their neighbours left out"
            warnings.append(Caveat("outlying_rows", sentence))
        if negative := [step for step in steps if step.stiffness.imag < 0.0]:
            sentence = (
                f"{len(negative)} of {len(steps)} points have a loss factor below zero, the first at "
                f"{negative[0].frequency:.4g} Hz: is the force or the displacement recorded late?"
            )
            warnings.append(Caveat("negative_loss", sentence))
        warnings += preload_warnings(steps, self.direction)
        # the steepest d ln|K| / d ln X between neighbouring levels at one frequency
        ordered = sorted(steps, key=lambda step: (step.nominal_frequency, step.amplitude))
        slopes = [
            float(np.log(abs(upper.stiffness / lower.stiffness)) / np.log(upper.amplitude / lower.amplitude))
            for lower, upper in pairwise(ordered)
            if upper.nominal_frequency == lower.nominal_frequency and upper.level != lower.level
        ]
        steepest = max(map(abs, slopes), default=0.0)
        for level in sorted({step.level for step in steps}):
            miss = np.array([step.amplitude / level - 1.0 for step in steps if step.level == level])
            if np.abs(miss).max() > MISSED_LEVEL:
                low, high = (factor * level * (1.0 + end) for end in (miss.min(), miss.max()))
                change = f"|K| changes by up to {number(100 * steepest * np.abs(miss).max(), 2)} %"
                sentence = f"the rig reached {low:.4g} to {high:.4g} {unit} instead of {factor * level:.4g} {unit}"
                sentence += f": {change} (fits use the reached amplitude)"
                warnings.append(Caveat("missed_level", sentence))
        if coarse := [step for step in steps if step.rows_per_cycle < _FEW_ROWS_PER_CYCLE]:
            worst = min(coarse, key=lambda step: step.rows_per_cycle)
            sentence = (
                f"{len(coarse)} of {len(steps)} points have fewer than {_FEW_ROWS_PER_CYCLE} rows per cycle "
                f"({worst.rows_per_cycle:.3g} at {worst.frequency:.4g} Hz): harmonics above half the sampling rate "
                "may fold onto the fundamental"
            )
            warnings.append(Caveat("coarse_sampling", sentence))
        if bent := [step for step in steps if step.displacement_distortion > 0.02]:  # rigs in order have less
            worst = max(bent, key=lambda step: step.displacement_distortion)
            sentence = (
                f"the displacement is not a clean sine at {len(bent)} of {len(steps)} points: up to "
                f"{number(100 * worst.displacement_distortion, 2)} % harmonic distortion ({worst.frequency:.4g} Hz, "
                f"{factor * worst.amplitude:.3g} {unit})"
            )
            warnings.append(Caveat("distorted_motion", sentence))
        longest = max((step.end - step.start for step in steps), default=0.0)
        # a stretch longer than every step is no ramp
        rejected = [skip for skip in self.skipped if skip.steady or skip.end - skip.start > longest]
        for skip in rejected[:_MOST_LISTED]:
            sentence = f"{skip.name}, {skip.start:.4g} to {skip.end:.4g} s gives no point: {skip.why}"
            warnings.append(Caveat("no_point", sentence))
        if len(rejected) > _MOST_LISTED:
            warnings.append(Caveat("more_without_point", f"{len(rejected) - _MOST_LISTED} more parts give no point"))
        return tuple(warnings)


def preload_warnings(steps: Sequence[Step], direction: Place) -> list[Caveat]:
    """Warning on a preload: a mean displacement or force that is too large for the zero offset of a sensor.

    Args:
        steps: operating points of one direction.
        direction: direction or specimen of the steps.

    Returns:
        One warning, or an empty list without a preload.
    """
    (motion, force, _), units = direction.motion.words, direction.display
    means = []
    for word, unit, values, largest in (
        (motion, units.displacement, [step.mean_displacement for step in steps], max(step.amplitude for step in steps)),
        (force, units.force, [step.mean_force for step in steps], max(abs(s.stiffness) * s.amplitude for s in steps)),
    ):
        if abs(np.median(values)) > 0.5 * largest:  # sensors are off zero by less
            written, factor = display_unit(*unit, max(values, key=abs))
            ends = dict.fromkeys(number(factor * end, 3) for end in sorted((min(values), max(values)), key=abs))
            means.append(f"a mean {word} of {' to '.join(ends)} {written}")
    about = f"recorded about {' and '.join(means)}; the points refer to this mean: state it as the preload of the sweep"
    return [Caveat("mean_load", about)] if means else []
