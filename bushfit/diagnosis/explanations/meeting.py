"""A frequency at which points of several runs lie far off: a disturbance there, and no rows that went wrong singly."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np
from scipy.special import bdtrc

from bushfit.diagnosis.explanations.contract import FaultyPlace
from bushfit.effects.contract import Array
from bushfit.fitting.measured_sweep import MeasuredSweep
from bushfit.model.model import Model
from bushfit.model.result import Outlier


@dataclass(frozen=True, eq=False)
class Meeting(FaultyPlace):
    """Points that were left out as outliers, all at one frequency.

    Args:
        apart: root mean square distance of the points, in units of noise.
        size: largest distance of a point, relative to |K|.
        log_odds: log of the odds of a disturbance at the frequency over single rows that meet by chance.

    Notes:
        Single wrong rows meet at a frequency by chance: of n such rows, k lie at the frequency of one of them with the
        binomial probability of k - 1 or more among the n - 1 others, each with one over the number of frequencies.
    """

    apart: float
    size: float
    log_odds: float

    def distance(self, residual: Array) -> float:  # noqa: ARG002
        return self.apart


def meetings(outliers: Sequence[Outlier], sweeps: Sequence[MeasuredSweep], model: Model) -> list[Meeting]:
    """Find frequencies at which several outliers lie.

    Args:
        outliers: points that were left out.
        sweeps: the sweeps as they were read.
        model: the fitted model.

    Returns:
        One explanation for each frequency with two or more outliers.
    """
    distances = {(outlier.test, outlier.row): outlier.distance for outlier in outliers}
    found: dict[float, list[_Left]] = defaultdict(list)
    for sweep in sweeps:
        for point, (frequency, row) in enumerate(zip(sweep.frequency.tolist(), sweep.order.tolist(), strict=True)):
            points = found[frequency]
            if (sweep.name, row + 1) in distances:
                points.append((sweep, point, distances[sweep.name, row + 1]))
    chance = 1.0 / max(len(found), 1)
    return [
        _meeting(frequency, points, len(outliers), chance, model)
        for frequency, points in found.items()
        if len(points) > 1
    ]


#: A point that was left out: its sweep, its number there, and how far it lies off in units of noise.
_Left = tuple[MeasuredSweep, int, float]


def _meeting(frequency: float, points: Sequence[_Left], outlier_count: int, chance: float, model: Model) -> Meeting:
    """Explanation for the outliers at one frequency; `chance` is the probability of any other frequency."""
    first, *other_directions = dict.fromkeys(str(sweep.direction) for sweep, *_ in points)
    location = "several directions" if other_directions else first
    amplitudes = [float(sweep.amplitude[point]) for sweep, point, _ in points]
    by_chance = max(float(bdtrc(len(points) - 2, outlier_count - 1, chance)), np.finfo(float).tiny)
    return Meeting(
        "place",
        "frequency",
        f"{frequency:.4g} Hz in {location} ({len(points)} points left out)",
        None,
        points[0][0].direction,
        (frequency, frequency),
        (min(amplitudes), max(amplitudes)),
        float(np.sqrt(np.mean(np.square([distance for *_, distance in points])))),
        max(float(np.linalg.norm(sweep.relative_difference(model)[:, point])) for sweep, point, _ in points),
        -log(by_chance),
    )
