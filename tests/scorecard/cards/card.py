"""The rows of a score card: every target, measured, with the exact 95 % interval of each rate."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from scipy.stats import binomtest

from cards.families import KINDS, Family
from cards.outcome import REFUSED, Outcome

#: Gain in chi-square from which an effect counts as plain: ten times what chance makes.
PLAIN = 200.0
#: Processor time that a diagnosis may take, median and longest [s]: what an engineer waits without a second thought.
_QUICK = (0.5, 4.0)
#: Held-out gap before, in units of noise, from which there is something to describe: noise makes 1.1.
_SHOWS = 1.2
#: Share of |K| that a plain model leaves of an effect which counts as visible.
_VISIBLE = 0.02
#: Probabilities at which what is told is counted: less than an even chance leads no one, and from the last but one on a
#: name is kept.
_BINS = (0.5, 0.8, 0.97, 1.0)
#: Probability of nothing from which on it is counted.
_NOTHING = 0.99


@dataclass(frozen=True)
class Row:
    """One measure of the card.

    Args:
        measure: what is measured.
        figure: as text: a rate with its 95 % interval.
        over: how many cases are counted.
        target: as text; empty where there is none.
        met: whether the target is met, the whole interval within it; None where there is no target, no case, or where
            the rate lies within the target and its interval does not.
    """

    measure: str
    figure: str
    over: int
    target: str
    met: bool | None


def card(outcomes: Sequence[Outcome], family: Family) -> list[Row]:
    """Every target of a family, measured over the outcomes that did not fail."""
    good = [outcome for outcome in outcomes if not outcome.error]
    kinds = {kind: [outcome for outcome in good if outcome.task.kind == kind] for kind in KINDS[family]}
    return [*_ROWS[family](good, *kinds.values()), *_of_odds(good), *_of_sessions(good), _times(good)]


def _of_effects(
    good: Sequence[Outcome],
    single: Sequence[Outcome],
    clean: Sequence[Outcome],
    pair: Sequence[Outcome],
    outside: Sequence[Outcome],
    lacking: Sequence[Outcome],
) -> list[Row]:
    plain = [outcome for outcome in single if outcome.gain >= PLAIN]
    covered = [hit for outcome in good if outcome.exact for hit in outcome.covered]
    strange, hidden = [*outside, *lacking], [*single, *pair, *outside]
    return [
        _share("false alarm on clean campaigns", [o.seen for o in clean], high=0.01),
        _share("truth named alone or in a set of at most three", [o.truth_in_sets for o in single], low=0.97),
        _share("  seen at all", [o.seen for o in single]),
        _share("a single, confident, wrong name", [o.single_wrong for o in hidden], high=0.02),
        _share("single name where the effect is plain", [o.exact for o in plain], low=0.9),
        _share("two effects at once, both named", [o.truth_in_sets for o in pair], low=0.9),
        _share("outside the list: no confident name", [o.verdict != "named" for o in strange], low=0.9),
        _share("  of these a disturbance of the rig", [o.verdict != "named" for o in outside]),
        _share("  of these an effect the library lacks", [o.verdict != "named" for o in lacking]),
        _share("95 % interval covers the truth, where named", covered, low=0.93, high=0.97),
    ]


def _of_mistakes(_: Sequence[Outcome], made: Sequence[Outcome], clean: Sequence[Outcome]) -> list[Row]:
    matters = [outcome for outcome in made if outcome.matters]
    silent = [outcome for outcome in made if not outcome.matters]
    read = [outcome for outcome in matters if outcome.verdict != REFUSED]
    return [
        _share("mistake told where it matters", [o.mistake_told for o in matters], low=0.95),
        _share("  of these by the reader, which refuses the file", [o.verdict == REFUSED for o in matters]),
        _share("  of what can be read: named alone", [o.mistake_alone for o in read]),
        _share("  of what can be read: seen at all", [o.seen for o in read]),
        _share("told where it does not matter or cannot show", [o.mistake_told for o in silent]),
        _share("another mistake or an effect named", [o.single_wrong for o in made], high=0.01),
        _share("anything named on clean campaigns", [o.seen for o in clean], high=0.01),
    ]


def _of_awkward(good: Sequence[Outcome], *_: Sequence[Outcome]) -> list[Row]:
    return [
        _share("false alarm on clean but awkward campaigns", [o.seen for o in good], high=0.01),
        _share("  of these a name kept in the model", _kept(good)),
    ]


def _of_faults(good: Sequence[Outcome], *_: Sequence[Outcome]) -> list[Row]:
    return [
        _share("faults of the rig: a confident wrong name", [o.single_wrong for o in good], high=0.02),
        _share("  a wrong name kept, under any verdict", _kept(good)),
        _share("  a set of look-alikes without the truth", [o.wrong_set for o in good]),
        _share("  seen at all", [o.seen for o in good]),
    ]


def _of_outside(good: Sequence[Outcome], laws: Sequence[Outcome], three: Sequence[Outcome]) -> list[Row]:
    shows = [outcome for outcome in good if outcome.before is not None and outcome.before > _SHOWS]
    return [
        _share("physics the library lacks: a wrong name or part kept", _kept(good), high=0.05),
        _share("  of these laws that the library never gains", _kept(laws)),
        _share("  of these three effects of the library at once", _kept(three)),
        _share("  a set of look-alikes without the truth", [o.wrong_set for o in good]),
        _share("  seen at all", [o.seen for o in good]),
        _share("excess of the held-out gap at least halved, where it shows", [o.halved for o in shows], low=0.8),
    ]


def _of_library(good: Sequence[Outcome], *_: Sequence[Outcome]) -> list[Row]:
    visible = [outcome for outcome in good if outcome.sealed and outcome.sealed.visible > _VISIBLE]
    told = [outcome.truth_in_sets for outcome in visible]
    return [
        _share("effects of the library, of any size: a wrong name kept", _kept(good), high=0.01),
        _share("  a set of look-alikes without the truth", [o.wrong_set for o in good]),
        _share("where visible: named, level unresolved, or in a set of three", told, low=0.95),
        _share("  seen at all", [o.seen for o in visible]),
    ]


def _kept(outcomes: Sequence[Outcome]) -> list[bool]:
    return [bool(outcome.wrong_kept) for outcome in outcomes]


#: The rows of each family, by its outcomes and those of each of its kinds.
_ROWS: dict[Family, Callable[..., list[Row]]] = {
    "effects": _of_effects,
    "mistakes": _of_mistakes,
    "awkward": _of_awkward,
    "faults": _of_faults,
    "outside": _of_outside,
    "library": _of_library,
}


def _of_sessions(good: Sequence[Outcome]) -> list[Row]:
    """What planned sessions settled of what was left open; no rows where none was asked for."""
    told = [outcome for outcome in good if outcome.settled]
    if not told:
        return []
    made = [outcome for outcome in told if outcome.settled != "elsewhere"]
    left = [outcome for outcome in told if outcome.verdict == "ambiguous"]
    return [
        _share("ambiguous, settled rightly by a session", [o.settled == "rightly" for o in made], low=0.8),
        _share("  settled wrongly", [o.settled == "wrongly" for o in made]),
        _share("ambiguous, and no session would tell", [o.settled == "elsewhere" for o in left]),
        Row("level unresolved: a test without the bushing decides", str(len(told) - len(left)), len(told), "", None),
    ]


def _of_odds(good: Sequence[Outcome]) -> list[Row]:
    """Whether probabilities are true: the share right of all that were told with about the same, and the risk taken."""
    sure = [not outcome.shows for outcome in good if outcome.nothing is not None and outcome.nothing >= _NOTHING]
    told = [(o.odds, o.leader_right is True) for o in good if o.leader and o.leader_right is not None]
    rows = []
    for low, high in pairwise(_BINS):
        own = [pair for pair in told if low <= pair[0] < high or pair[0] == high == _BINS[-1]]
        row = _share(f"the likeliest, told {low:g} to {high:g}: right", [right for _, right in own])
        if own:
            ends = binomtest(sum(right for _, right in own), len(own)).proportion_ci()
            mean = float(np.mean([odds for odds, _ in own]))
            wide = ends.low <= low and high <= ends.high  # the interval says no more than the bin
            row = replace(row, target=f"{100 * mean:.0f} %", met=None if wide else bool(ends.low <= mean <= ends.high))
        rows.append(row)
    for least in _BINS[:-1]:  # what a reader risks who takes no answer below these odds
        taken = [not right for odds, right in told if odds >= least]
        answered = f"{100 * len(taken) / max(len(told), 1):.0f} % of answers"
        rows.append(_share(f"told {least:g} and more, {answered}: wrong", taken))
    return [*rows, _share("nothing, told 0.99 and more: nothing to see", sure, low=0.99)]


def _times(good: Sequence[Outcome]) -> Row:
    """Processor times of the diagnoses."""
    (middle, longest), seconds = _QUICK, [outcome.seconds for outcome in good]
    measure, target = "processor time of one diagnosis, median / longest", f"<= {middle:g} s / {longest:g} s"
    if not seconds:
        return Row(measure, "no case", 0, target, None)
    found, most = float(np.median(seconds)), max(seconds)
    return Row(measure, f"{found:.1f} s / {most:.1f} s", len(seconds), target, found <= middle and most <= longest)


def _share(measure: str, hits: Sequence[bool], low: float = 0.0, high: float = 1.0) -> Row:
    """A rate that is to lie between two."""
    words = {(False, True): f"<= {100 * high:g} %", (True, False): f">= {100 * low:g} %", (False, False): ""}
    target = words.get((low > 0.0, high < 1.0), f"{100 * low:g} to {100 * high:g} %")
    if not hits:
        return Row(measure, "no case", 0, target, None)
    share = float(np.mean(hits))
    ends = binomtest(sum(hits), len(hits)).proportion_ci()  # exact, after Clopper and Pearson (1934)
    figure = f"{100 * share:.1f} % ({100 * ends.low:.1f} to {100 * ends.high:.1f})"
    if low <= ends.low and ends.high <= high:
        return Row(measure, figure, len(hits), target, True if target else None)
    both = low > 0.0 and high < 1.0  # where a few that are all right are no miss
    may_be = ends.low <= high and low <= ends.high if both else low <= share <= high
    return Row(measure, figure, len(hits), target, None if may_be else False)
