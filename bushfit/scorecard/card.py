"""The rows of a score card: every target, measured, with the exact 95 % interval of each rate."""

from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import binomtest

from bushfit.scorecard.families import KINDS, Family
from bushfit.scorecard.outcome import REFUSED, Outcome

#: Gain in chi-square from which an effect counts as plain: ten times what chance makes.
PLAIN = 200.0
#: Processor time that a diagnosis may take, median and longest [s]: what an engineer waits without a second thought.
_QUICK = (1.0, 6.0)
#: Processor time where the name is searched again without each part, longest [s].
_SLOWEST_AGAIN = 15.0
#: Held-out gap at most, in units of noise, for a named effect to count as confirmed.
_CONFIRMED = 1.1
#: Held-out gap before, in units of noise, from which there is something to describe: noise makes 1.1.
_SHOWS = 1.2
#: Share of |K| that a plain model leaves of an effect which counts as visible.
_VISIBLE = 0.02
#: By the largest rate that a target allows: the upper end that its interval may have for the target to be met.
_UPPER_ENDS = {0.01: 0.03, 0.02: 0.03, 0.05: 0.08}


@dataclass(frozen=True)
class Row:
    """One measure of the card.

    Args:
        measure: what is measured.
        figure: as text: a rate with its 95 % interval.
        over: how many cases are counted.
        target: as text; empty where there is none.
        met: whether the target is met; None where there is no target, no case, or where the rate lies within the target
            and its interval is still too wide to say so.
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
    return [*_ROWS[family](good, *kinds.values()), *_of_sessions(good), *_times(good)]


def _of_effects(
    good: Sequence[Outcome],
    single: Sequence[Outcome],
    clean: Sequence[Outcome],
    pair: Sequence[Outcome],
    outside: Sequence[Outcome],
    lacking: Sequence[Outcome],
) -> list[Row]:
    plain = [outcome for outcome in single if outcome.gain >= PLAIN]
    named = [o for o in good if o.verdict == "named" and o.task.hidden and o.heldout is not None]
    covered = [hit for outcome in good if outcome.exact for hit in outcome.covered]
    strange, hidden = [*outside, *lacking], [*single, *pair, *outside]
    shares: list[tuple[str, Sequence[Outcome], Callable[[Outcome], bool], str, float, float]] = [
        ("false alarm on clean campaigns", clean, lambda o: o.verdict != "consistent", "<= 1 %", 0.0, 0.01),
        ("truth named alone or in a set of at most three", single, lambda o: o.truth_in_sets, ">= 97 %", 0.97, 1.0),
        ("a single, confident, wrong name", hidden, lambda o: o.single_wrong, "<= 2 %", 0.0, 0.02),
        ("single name where the effect is plain", plain, lambda o: o.exact, ">= 90 %", 0.9, 1.0),
        ("two effects at once, both named", pair, lambda o: o.truth_in_sets, ">= 90 %", 0.9, 1.0),
        ("outside the list: no confident name", strange, lambda o: o.verdict != "named", ">= 90 %", 0.9, 1.0),
        ("  of these a disturbance of the rig", outside, lambda o: o.verdict != "named", "", 0.0, 1.0),
        ("  of these an effect the library lacks", lacking, lambda o: o.verdict != "named", "", 0.0, 1.0),
        ("held-out gap after <= 1.1, where named", named, _is_confirmed, "all", 1.0, 1.0),
    ]
    rows = [_share(name, [hit(o) for o in over], target, low, high) for name, over, hit, target, low, high in shares]
    rows.append(_share("95 % interval covers the truth, where named", covered, "93 to 97 %", 0.93, 0.97))
    sizes = [len(members) for outcome in good for members in outcome.sets]
    members = f"{np.mean(sizes):.2f} / {max(sizes)}" if sizes else "no case"
    return [*rows, Row("size of the sets of names, mean / largest", members, len(sizes), "", None)]


def _is_confirmed(outcome: Outcome) -> bool:
    return outcome.heldout is not None and outcome.heldout <= _CONFIRMED


def _of_mistakes(_: Sequence[Outcome], made: Sequence[Outcome], clean: Sequence[Outcome]) -> list[Row]:
    matters = [outcome for outcome in made if outcome.matters]
    silent = [outcome for outcome in made if not outcome.matters]
    read = [outcome for outcome in matters if outcome.verdict != REFUSED]
    return [
        _share("mistake told where it matters", [o.mistake_told for o in matters], ">= 95 %", 0.95, 1.0),
        _share("  of these by the reader, which refuses the file", [o.verdict == REFUSED for o in matters], "", 0, 1),
        _share("  of what can be read: named alone", [o.mistake_alone for o in read], "", 0.0, 1.0),
        _share("told where it does not matter or cannot show", [o.mistake_told for o in silent], "", 0.0, 1.0),
        _share("another mistake or an effect named", [o.single_wrong for o in made], "<= 1 %", 0.0, 0.01),
        _share("anything named on clean campaigns", [o.verdict != "consistent" for o in clean], "<= 1 %", 0.0, 0.01),
    ]


def _of_swept(good: Sequence[Outcome], *_: Sequence[Outcome]) -> list[Row]:
    covered = [hit for outcome in good for hit in outcome.covered]
    return [
        _share("false alarm on clean amplitude sweeps", _alarms(good), "<= 1 %", 0.0, 0.01),
        _share("95 % intervals that hold the true parameter", covered, "93 to 97 %", 0.93, 0.97),
    ]


def _alarms(outcomes: Sequence[Outcome]) -> list[bool]:
    return [outcome.verdict != "consistent" for outcome in outcomes]


def _of_awkward(good: Sequence[Outcome], *_: Sequence[Outcome]) -> list[Row]:
    return [
        _share("false alarm on clean but awkward campaigns", _alarms(good), "<= 1 %", 0.0, 0.01),
        _share("  of these a name kept in the model", [bool(o.wrong_kept) for o in good], "", 0.0, 1.0),
    ]


def _of_faults(good: Sequence[Outcome], *_: Sequence[Outcome]) -> list[Row]:
    return [
        _share("faults of the rig: a confident wrong name", [o.single_wrong for o in good], "<= 2 %", 0.0, 0.02),
        _share("  a wrong name kept, under any verdict", [bool(o.wrong_kept) for o in good], "", 0.0, 1.0),
        _share("  a set of look-alikes without the truth", [o.wrong_set for o in good], "", 0.0, 1.0),
        _share("  seen at all: any verdict but consistent", _alarms(good), "", 0.0, 1.0),
    ]


def _of_outside(good: Sequence[Outcome], laws: Sequence[Outcome], three: Sequence[Outcome]) -> list[Row]:
    shows = [outcome for outcome in good if outcome.before is not None and outcome.before > _SHOWS]
    return [
        _share(
            "physics the library lacks: a wrong name or part kept",
            [bool(o.wrong_kept) for o in good],
            "<= 5 %",
            0.0,
            0.05,
        ),
        _share("  of these laws that the library never gains", [bool(o.wrong_kept) for o in laws], "", 0.0, 1.0),
        _share("  of these three effects of the library at once", [bool(o.wrong_kept) for o in three], "", 0.0, 1.0),
        _share("  a set of look-alikes without the truth", [o.wrong_set for o in good], "", 0.0, 1.0),
        _share(
            "excess of the held-out gap at least halved, where it shows", [o.halved for o in shows], ">= 80 %", 0.8, 1.0
        ),
    ]


def _of_library(good: Sequence[Outcome], *_: Sequence[Outcome]) -> list[Row]:
    visible = [outcome for outcome in good if outcome.sealed and outcome.sealed.visible > _VISIBLE]
    told = [outcome.truth_in_sets for outcome in visible]
    return [
        _share(
            "effects of the library, of any size: a wrong name kept",
            [bool(o.wrong_kept) for o in good],
            "none",
            0.0,
            0.0,
        ),
        _share("  a set of look-alikes without the truth", [o.wrong_set for o in good], "", 0.0, 1.0),
        _share("where visible: named, level unresolved, or in a set of three", told, ">= 95 %", 0.95, 1.0),
    ]


#: The rows of each family, by its outcomes and those of each of its kinds.
_ROWS: dict[Family, Callable[..., list[Row]]] = {
    "effects": _of_effects,
    "mistakes": _of_mistakes,
    "amplitude_sweeps": _of_swept,
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
        _share("ambiguous, settled rightly by a session", [o.settled == "rightly" for o in made], ">= 80 %", 0.8, 1.0),
        _share("  settled wrongly", [o.settled == "wrongly" for o in made], "", 0.0, 1.0),
        _share("ambiguous, and no session would tell", [o.settled == "elsewhere" for o in left], "", 0.0, 1.0),
        Row("level unresolved: a test without the bushing decides", str(len(told) - len(left)), len(told), "", None),
    ]


def _times(good: Sequence[Outcome]) -> list[Row]:
    """Processor times of the diagnoses without the name searched again, and of those with it."""
    measure, (middle, longest) = "processor time of one diagnosis, median / longest", _QUICK
    once, again = ([o.seconds for o in good if (o.again is None) is first] for first in (True, False))
    target = f"<= {middle:.0f} s / {longest:.0f} s"
    rows = [_time(measure, once, target, lambda: float(np.median(once)) <= middle and max(once) <= longest)]
    if again:
        target = f"<= {_SLOWEST_AGAIN:.0f} s"
        rows.append(_time("  with the name searched again", again, target, lambda: max(again) <= _SLOWEST_AGAIN))
    return rows


def _time(measure: str, seconds: Sequence[float], target: str, met: Callable[[], bool]) -> Row:
    if not seconds:
        return Row(measure, "no case", 0, target, None)
    return Row(measure, f"{np.median(seconds):.1f} s / {max(seconds):.1f} s", len(seconds), target, met())


def _share(measure: str, hits: Sequence[bool], target: str, low: float, high: float) -> Row:
    if not hits:
        return Row(measure, "no case", 0, target, None)
    share = float(np.mean(hits))
    ends = binomtest(sum(hits), len(hits)).proportion_ci()  # exact, after Clopper and Pearson (1934)
    figure = f"{100 * share:.1f} % ({100 * ends.low:.1f} to {100 * ends.high:.1f})"
    within = low <= share <= high
    narrow = ends.high <= _UPPER_ENDS.get(high, 1.0)
    return Row(measure, figure, len(hits), target, None if not target or (within and not narrow) else within)


def confusion(outcomes: Sequence[Outcome]) -> dict[str, Counter[str]]:
    """Per hidden effect (or kind): how often which verdict with which names was given."""
    table: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for outcome in outcomes:
        hidden = outcome.sealed.hidden if outcome.sealed else outcome.task.hidden
        truth = outcome.task.outside or " + ".join(hidden) or "none"
        lacks = " (library lacks it)" if outcome.task.without else ""
        sets = " + ".join("|".join(members) for members in outcome.sets)
        table[truth + lacks][": ".join(filter(None, (outcome.verdict, sets)))] += 1
    return dict(sorted(table.items()))
