"""Places of the tests gone wrong: a frequency, a level, a repeat, or a loop that disagrees with all the others."""

from collections.abc import Iterator, Sequence

import numpy as np

from bushfit.diagnosis.currency import Group
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.explanations.contract import Explanation
from bushfit.effects.contract import Array
from bushfit.fitting.data_set import Suspect
from bushfit.fitting.data_sets import SweepData, parted

#: Neighbouring frequencies that one disturbance covers at most: mains hum and its sidebands.
_WIDEST = 3
#: Frequencies that a campaign has at least before one of them can be a suspect.
_FEWEST_FREQUENCIES = 5
#: Suspects of one frequency at most; of more frequencies neighbours count as one. Chosen for time.
_MOST_FREQUENCIES = 100


def places(evidence: Evidence) -> list[Explanation]:
    """Every place whose points may be off together, in gain and phase; levels and repeats with a slope along them.

    What its points share does not depend on the model.
    """
    loops, sweeps = parted(evidence.data_sets)
    found = [*_frequencies(evidence, sweeps), *_levels(evidence, sweeps), *_repeats(evidence, sweeps)]
    found += _loops(evidence) if len(loops) < len(evidence.data_sets) else []
    return [
        Explanation(
            "place", suspect.kind, suspect.words, Group(columns, np.ones(len(columns)), together=True), suspect=suspect
        )
        for suspect in found
        for columns in [np.array(suspect.columns)]
    ]


def _loops(evidence: Evidence) -> Iterator[Suspect]:
    for loop in parted(evidence.data_sets)[0]:
        for suspect in loop.suspects():
            yield _suspect(
                evidence, suspect.words, "loop", [loop], [evidence.embedded(c, loop) for c in suspect.columns]
            )


def _suspect(
    evidence: Evidence, words: str, kind: str, tests: Sequence, columns: Sequence[Array], chosen: Sequence[Array] = ()
) -> Suspect:
    rows = chosen or [slice(None)] * len(tests)
    ends = [
        np.concatenate([np.atleast_1d(getattr(test, axis))[mine] for test, mine in zip(tests, rows, strict=True)])
        for axis in ("frequency", "amplitude")
    ]
    spans = [(float(each.min()), float(each.max())) for each in ends]
    return Suspect(words, kind, columns, tests[0].direction, spans[0], spans[1])


def _levels(evidence: Evidence, sweeps: Sequence[SweepData]) -> Iterator[Suspect]:
    for sweep in sweeps:
        every = np.unique(sweep.held)
        for held in every:
            here = sweep.held == held
            words = sweep.line_words(int(np.argmax(here)))
            if every.size > 1:
                yield _suspect(evidence, words, "level", [sweep], _off(evidence, [sweep], [here], sloping=True), [here])
            numbers = np.unique(sweep.repeat[here])
            for number in numbers if numbers.size > 2 else ():
                mine = here & (sweep.repeat == number)
                columns = _off(evidence, [sweep], [mine])
                yield _suspect(evidence, f"repeat {number} of {words}", "repeat", [sweep], columns, [mine])


def _repeats(evidence: Evidence, sweeps: Sequence[SweepData]) -> Iterator[Suspect]:
    """A repeat as a whole, of one direction or of all."""
    for scope in _scopes(sweeps):
        if not all(np.unique(sweep.repeat).size > 1 for sweep in scope):
            continue
        for number in sorted({int(each) for sweep in scope for each in sweep.repeat}):
            chosen = [sweep.repeat == number for sweep in scope]
            if all(rows.any() for rows in chosen):
                where = "every sweep" if len(scope) > 1 else f"the {scope[0].direction} sweep {scope[0].name}"
                columns = _off(evidence, scope, chosen, sloping=True)
                yield _suspect(evidence, f"repeat {number} of {where}", "repeat", scope, columns, chosen)


def _frequencies(evidence: Evidence, sweeps: Sequence[SweepData]) -> Iterator[Suspect]:
    """A disturbance at one frequency or a few neighbours, in one direction or in all."""
    steps = np.unique(np.concatenate([sweep.frequency for sweep in sweeps])) if sweeps else np.empty(0)
    if steps.size < _FEWEST_FREQUENCIES:
        return
    bands = [part[[0, -1]] for part in np.array_split(steps, min(steps.size, _MOST_FREQUENCIES))]
    for scope in _scopes(sweeps):
        touched = [[(low <= sweep.frequency) & (sweep.frequency <= high) for sweep in scope] for low, high in bands]
        columns = [_off(evidence, scope, chosen) for chosen in touched]
        where = scope[0].direction if len(scope) == 1 else "all directions"
        for width in range(1, _WIDEST + 1):
            for first in range(len(bands) - width + 1):
                window = slice(first, first + width)
                if not all(rows.any() for chosen in touched[window] for rows in chosen):
                    continue
                low, high = float(bands[first][0]), float(bands[first + width - 1][-1])
                span = " to ".join(f"{step:.4g}" for step in dict.fromkeys((low, high)))
                words = f"{span} Hz in {where}, at every amplitude"
                rows = [np.any([chosen[place] for chosen in touched[window]], axis=0) for place in range(len(scope))]
                own = [column for each in columns[window] for column in each]
                yield _suspect(evidence, words, "frequency", scope, own, rows)


def _scopes(sweeps: Sequence[SweepData]) -> list[Sequence[SweepData]]:
    return [*([sweep] for sweep in sweeps), *([sweeps] if len(sweeps) > 1 else [])]


def _off(
    evidence: Evidence, sweeps: Sequence[SweepData], chosen: Sequence[Array], *, sloping: bool = False
) -> list[Array]:
    """Residuals of some points of sweeps that are off together: in gain, in phase, and with `sloping` along the step."""
    columns = []
    for slope in (False, True)[: 1 + sloping]:
        for unit in (1.0, 1.0j):
            column = np.zeros(evidence.residual.size)
            for sweep, rows in zip(sweeps, chosen, strict=True):
                value = rows * (_along(sweep.step) if slope else 1.0)
                column[evidence.place[sweep]] = sweep.whiten(value * unit)
            columns.append(column)
    return columns


def _along(step: Array) -> Array:
    x = np.log(step)
    return 2.0 * (x - x.mean()) / max(float(np.ptp(x)), 1e-9)
