"""Hold-out: does what was added also close the gap where it was not fitted?

A line (an amplitude level, or a frequency where amplitudes are stepped), the top third of the steps, a direction and a
loop are held out in turn, and predicted from the rest.

Notes:
    Refitting without a part is one Gauss-Newton step from the full fit, which is exact where the model is linear over
    that step.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from bushfit.diagnosis.evidence import Evidence
from bushfit.effects.contract import Array
from bushfit.fitting.agreement import LeaveOut
from bushfit.fitting.data_sets import DataSet, parted
from bushfit.reading.measurement import Stepped

#: Held-out gap, in units of noise, that counts as closed: noise and its own estimate make 1.1.
_CLOSED = 1.2
#: Share of the held-out gap before, below which the gap after counts as closed too.
_SHRUNK = 0.5
#: Factor by which the gap of a single part may grow: chance makes about a tenth.
_MOST_WORSENED = 1.1
#: Share of all sweep points, those of the highest steps, that is one part.
_TOP = 1.0 / 3.0
#: By what is stepped in sweeps: what is held, and what the top third is of.
_NAMES: dict[Stepped | None, tuple[str, str]] = {
    "frequency": ("amplitude level", "frequencies"),
    "amplitude": ("frequency", "amplitudes"),
    None: ("run", ""),
}
#: Every point of a data set.
_ALL = np.array(True)


@dataclass(frozen=True)
class HeldOut:
    """Root mean square residual of one part, in units of noise, predicted from the other parts."""

    part: str
    before: float
    after: float


@dataclass(frozen=True)
class HoldOut:
    """All parts held out in turn, and the verdict."""

    parts: tuple[HeldOut, ...]
    before: float
    after: float

    @property
    def passed(self) -> bool:
        """Whether the gap shrinks where it was not fitted, and nowhere grows."""
        closed = self.after <= max(_CLOSED, _SHRUNK * self.before)
        return closed and all(part.after <= max(_MOST_WORSENED * part.before, _CLOSED) for part in self.parts)


def hold_out(before: Evidence, after: Evidence) -> HoldOut:
    """Compare two models of the same tests on every part that both can predict from the rest."""
    models = (before, after)
    whole = [LeaveOut.of(evidence.solution.jacobian, evidence.residual) for evidence in models]
    gaps = {name: list(map(_predicted, models, whole, [chosen] * 2)) for name, chosen in _parts(after)}
    told = {name: pair for name, pair in gaps.items() if all(gap.size for gap in pair)}
    parts = tuple(HeldOut(name, *map(_rms, pair)) for name, pair in told.items())
    together = zip(*told.values(), strict=True) if told else [[evidence.residual] for evidence in models]
    return HoldOut(parts, *(_rms(np.concatenate(list(each))) for each in together))


def _rms(gap: Array) -> float:
    return float(np.sqrt(np.mean(np.square(gap))))


def _predicted(evidence: Evidence, whole: LeaveOut, chosen: Array) -> Array:
    """Residuals of the chosen rows with the model fitted to the others; none where those leave it open."""
    step = whole.step(chosen)
    return np.empty(0) if step is None else evidence.residual[chosen] + step @ evidence.solution.jacobian[:, chosen]


def _parts(evidence: Evidence) -> Iterator[tuple[str, Array]]:
    """Name and rows of each part: lines, the top third of what they step through, directions, loops."""
    loops, sweeps = parted(evidence.data_sets)
    for stepped, (held, top) in _NAMES.items():
        mine = [sweep for sweep in sweeps if sweep.sweep.stepped == stepped]
        ranks = [np.unique(sweep.held, return_inverse=True)[1] for sweep in mine]
        for rank in range(max((int(r.max()) + 1 for r in ranks), default=0)):
            yield f"{held} {rank + 1}", _rows(evidence, zip(mine, [r == rank for r in ranks], strict=True))
        if mine and top:
            limit = np.quantile(np.concatenate([sweep.step for sweep in mine]), 1.0 - _TOP)
            yield f"top third of the {top}", _rows(evidence, ((sweep, sweep.step > limit) for sweep in mine))
    for direction in dict.fromkeys(data_set.direction for data_set in evidence.data_sets):
        whole = [data_set for data_set in evidence.data_sets if data_set.direction == direction]
        if len(whole) < len(evidence.data_sets):
            yield f"{direction} direction", _rows(evidence, ((data_set, _ALL) for data_set in whole))
    for loop in loops if len(loops) > 1 else ():
        yield f"loop {loop.name}", _rows(evidence, [(loop, _ALL)])


def _rows(evidence: Evidence, picked: Iterable[tuple[DataSet, Array]]) -> Array:
    """Residuals of some points of some data sets, (n,) bool."""
    chosen = np.zeros(evidence.residual.size, dtype=bool)
    for data_set, points in picked:
        chosen[evidence.place[data_set]].reshape(data_set.parts, -1)[:] = points
    return chosen
