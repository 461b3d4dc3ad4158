"""The score card: how often `diagnose` is right on campaigns whose hidden effect it is not told.

Campaigns are written to disk as files; the workflow reads the campaign, never the sealed truth, which is opened
afterwards. The same seed makes the same card.
"""

from __future__ import annotations

import json
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.stats import binomtest

from bushfit.campaign.campaign import load_campaign
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.locate import largest_smooth_misfit
from bushfit.diagnosis.record import Diagnosis, Settings
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects.mistakes import MISTAKES, mistake_named
from bushfit.errors import MeasurementError
from bushfit.fitting.data import Data
from bushfit.report.folder import write_files
from bushfit.scorecard.hidden import OUTSIDE, Sealed, hidden_campaign, hideable
from bushfit.scorecard.mistaken import mistaken_campaign
from bushfit.scorecard.swept import swept_campaign
from bushfit.simulation import to_files

#: What is hidden in the campaigns of a card.
Family = Literal["effects", "mistakes", "amplitude_sweeps"]
#: The verdict of the reader, where it does not take a file with a mistake.
REFUSED = "refused"

#: Gain in chi-square from which an effect counts as plain: ten times what chance makes.
PLAIN = 200.0
#: Processor time that a diagnosis may take [s]: what an engineer at a terminal waits without a second thought.
_SLOWEST = 2.0
#: Names in a set at most, for the truth in it to count as named.
_LARGEST_SET = 3
#: Held-out gap at most, in units of noise, for a named effect to count as confirmed.
_CONFIRMED = 1.1
#: Shares of the kinds of campaigns in a card, by its family.
_KINDS = {
    "effects": {"single": 0.5, "clean": 0.2, "pair": 0.1, "outside": 0.1, "lacking": 0.1},
    "mistakes": {"mistake": 0.4, "clean": 0.6},
    "amplitude_sweeps": {"swept": 1.0},
}
#: What of |K|, or of a parameter, is off where a mistake in the record matters.
_MATTERS = 0.02


@dataclass(frozen=True)
class Task:
    """One hidden campaign to make and to diagnose.

    Args:
        hidden: effects; of a kind "mistake" the mistake.
        outside: what the library does not have.
        without: effects that the library is made to lack.
    """

    kind: str
    seed: int
    hidden: tuple[str, ...]
    outside: str = ""
    without: tuple[str, ...] = ()


@dataclass(frozen=True)
class Outcome:
    """What the workflow said of one campaign, and the truth.

    Args:
        named: effects it named or that lead a set.
        sets: all members of each set, leader first.
        richer: effects that contain what was named as a limit.
        gain: chi-square that the best single effect takes off, whether it was added or not.
        heldout: gap on held-out data after, in units of noise.
        covered: per hidden effect that was added, or per parameter of a swept campaign: whether the 95 % interval of
            its amount holds the truth.
        seconds: processor time of the diagnosis, whatever else the machine does.
        matters: of a mistake, whether it leaves more than the tolerance for a plain model, and more than _MATTERS of
            |K| or of a parameter.
        error: what went wrong, or "".
    """

    task: Task
    sealed: Sealed | None
    verdict: str
    named: tuple[str, ...] = ()
    sets: tuple[tuple[str, ...], ...] = ()
    richer: tuple[str, ...] = ()
    gain: float = 0.0
    heldout: float = 0.0
    covered: tuple[bool, ...] = ()
    seconds: float = 0.0
    matters: bool = False
    error: str = ""

    @property
    def truth_in_sets(self) -> bool:
        """Whether every hidden effect was named alone or in a set of at most three."""
        small = [members for members in self.sets if len(members) <= _LARGEST_SET]
        return all(any(name in members for members in small) or name in self.richer for name in self.task.hidden)

    @property
    def mistake_told(self) -> bool:
        """Whether the mistake, in the tests in which it was made, was named, stands in a set of at most three, or had
        its file refused by the reader."""
        hidden = set(self.sealed.hidden) if self.sealed else set()
        claims = [set(self.named), *(set(other.split(" + ")) for members in self.sets for other in members[1:])]
        small = all(len(members) <= _LARGEST_SET for members in self.sets)
        return self.verdict == REFUSED or (hidden in claims and small)

    @property
    def mistake_alone(self) -> bool:
        """Whether the mistake alone was named, in just the tests in which it was made."""
        return self.verdict == "named" and self.sealed is not None and set(self.named) == set(self.sealed.hidden)

    @property
    def single_wrong(self) -> bool:
        """A confident name (verdict named) that is neither the truth nor said to be a limit of it."""
        wrong = set(self.named) - {*self.task.hidden, *(self.sealed.hidden if self.sealed else ())}
        return self.verdict == "named" and bool(wrong) and not set(self.task.hidden) & set(self.richer)

    @property
    def exact(self) -> bool:
        """Exactly the hidden effects named, each alone."""
        return self.verdict == "named" and set(self.named) == set(self.task.hidden)


def tasks(count: int, seed: int, family: Family = "effects") -> list[Task]:
    """A balanced card: every effect alone in turn, none, pairs, outside the list, and leave-one-out; or every mistake
    in turn, and none."""
    random = np.random.default_rng(seed)
    made: list[Task] = []
    for kind, share in _KINDS[family].items():
        names = list(MISTAKES) if kind == "mistake" else hideable()
        for number in range(max(1, round(share * count))):
            own = int(random.integers(2**31))
            in_turn = kind in ("single", "lacking", "mistake")
            hidden: tuple[str, ...] = (names[number % len(names)],) if in_turn else ()
            if kind == "pair":
                hidden = tuple(random.choice(names, 2, replace=False).tolist())
            outside = OUTSIDE[number % len(OUTSIDE)] if kind == "outside" else ""
            made.append(Task(kind, own, hidden, outside, hidden if kind == "lacking" else ()))
    return made


def run(chosen: Sequence[Task], folder: Path, jobs: int, progress: Callable[[], None]) -> list[Outcome]:
    """Make, diagnose and judge every task, on several cores; campaigns and truths stay in the folder."""
    if jobs == 1:
        return [_counted(work(task, folder), progress) for task in chosen]
    with ProcessPoolExecutor(jobs) as pool:
        futures = [pool.submit(work, task, folder) for task in chosen]
        done = {future: _counted(future.result(), progress) for future in as_completed(futures)}
    return [done[future] for future in futures]


def _counted(outcome: Outcome, progress: Callable[[], None]) -> Outcome:
    progress()
    return outcome


def work(task: Task, folder: Path) -> Outcome:
    """One task: write the campaign, seal the truth apart, diagnose the files, open the truth."""
    place = folder / f"{task.kind}_{task.seed}"
    sealed_file = folder / "sealed" / f"{task.kind}_{task.seed}.json"
    try:
        if task.kind == "mistake":
            simulated, sealed = mistaken_campaign(task.seed, task.hidden[0])
        elif task.kind == "swept":
            simulated, sealed = swept_campaign(task.seed)
        else:
            simulated, sealed = hidden_campaign(task.seed, task.hidden, task.outside)
        files = to_files(simulated)
        del files["truth.json"]
        write_files(place, files, force=True)
        write_files(sealed_file.parent, {sealed_file.name: json.dumps(asdict(sealed)).encode()}, force=True)
        started = time.process_time()
        data = Data.of(load_campaign(place / "campaign.toml"))
        diagnosis = diagnose(data, None, Settings(without=task.without))
        seconds = time.process_time() - started
        truth = Sealed(**json.loads(sealed_file.read_text()))
    except MeasurementError as refusal:
        if task.kind != "mistake":
            return _failed(task, refusal)
        return Outcome(task, sealed, REFUSED, matters=True)
    except Exception as wrong:  # one campaign that fails is one row of the card, and is shown there
        return _failed(task, wrong)
    return _outcome(task, truth, diagnosis, seconds)


def _failed(task: Task, wrong: Exception) -> Outcome:
    return Outcome(task, None, "failed", error=f"{type(wrong).__name__}: {wrong}")


def _outcome(task: Task, truth: Sealed, diagnosis: Diagnosis, seconds: float) -> Outcome:
    result = diagnosis.result
    added = tuple(f"{name}." for name in task.hidden if name in result.model.effects)
    asked = [name for name in truth.values if task.kind == "swept" or (added and name.startswith(added))]
    intervals = {name: result.interval(name) for name in asked}
    covered = [ends[0] <= truth.values[name] <= ends[1] for name, ends in intervals.items() if ends is not None]
    return Outcome(
        task,
        truth,
        diagnosis.verdict,
        tuple(effect.label for effect in diagnosis.effects),
        tuple((effect.label, *effect.alternatives) for effect in diagnosis.effects),
        tuple(name for effect in diagnosis.effects for name in effect.richer),
        max((judged.gain or 0.0 for judged in diagnosis.candidates if not mistake_named(judged.name)), default=0.0),
        diagnosis.holdout.after,
        tuple(covered),
        seconds,
        task.kind == "mistake" and _matters(diagnosis.before, truth),
    )


def _matters(before: Evidence, truth: Sealed) -> bool:
    """Whether a mistake shows at all, and leaves more than _MATTERS of |K| or of a parameter."""
    gap = largest_smooth_misfit(before)
    off = max(abs(before.model.values[name] / value - 1.0) for name, value in truth.values.items())
    return gap > Settings().tolerance and max(gap, off) > _MATTERS


@dataclass(frozen=True)
class Row:
    """One measure of the card: its figure as text, a rate with its 95 % interval; what it counts, and the target."""

    measure: str
    figure: str
    over: int
    target: str
    met: bool | None


def card(outcomes: Sequence[Outcome]) -> list[Row]:
    """Every target of the workflow, measured."""
    good = [outcome for outcome in outcomes if not outcome.error]
    if any(outcome.task.kind == "mistake" for outcome in good):
        return _card_of_mistakes(good)
    if any(outcome.task.kind == "swept" for outcome in good):
        return _card_of_swept(good)
    kinds = {kind: [outcome for outcome in good if outcome.task.kind == kind] for kind in _KINDS["effects"]}
    single, clean, pair, outside, lacking = kinds.values()
    plain = [outcome for outcome in single if outcome.gain >= PLAIN]
    named = [outcome for outcome in good if outcome.verdict == "named" and outcome.task.hidden]
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
        ("held-out gap after <= 1.1, where named", named, lambda o: o.heldout <= _CONFIRMED, "all", 1.0, 1.0),
    ]
    rows = [_share(name, [hit(o) for o in over], target, low, high) for name, over, hit, target, low, high in shares]
    rows.append(_share("95 % interval covers the truth, where named", covered, "93 to 97 %", 0.93, 0.97))
    sizes = [len(members) for outcome in good for members in outcome.sets]
    members = f"{np.mean(sizes):.2f} / {max(sizes)}" if sizes else "no case"
    rows.append(Row("size of the sets of names, mean / largest", members, len(sizes), "", None))
    return [*rows, _time(good)]


def _card_of_mistakes(good: Sequence[Outcome]) -> list[Row]:
    """Every target of mistakes in the record, measured."""
    made, clean = ([outcome for outcome in good if outcome.task.kind == kind] for kind in _KINDS["mistakes"])
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
        _time(good),
    ]


def _card_of_swept(good: Sequence[Outcome]) -> list[Row]:
    """Every target of clean amplitude sweeps, measured."""
    alarm = [outcome.verdict != "consistent" for outcome in good]
    covered = [hit for outcome in good for hit in outcome.covered]
    return [
        _share("false alarm on clean amplitude sweeps", alarm, "<= 1 %", 0.0, 0.01),
        _share("95 % intervals that hold the true parameter", covered, "93 to 97 %", 0.93, 0.97),
        _time(good),
    ]


def _time(good: Sequence[Outcome]) -> Row:
    seconds = [outcome.seconds for outcome in good]
    took = f"{np.median(seconds):.1f} s / {max(seconds):.1f} s" if seconds else "no case"
    met = bool(max(seconds) <= _SLOWEST) if seconds else None
    return Row("processor time of one diagnosis, median / longest", took, len(seconds), "<= 2 s", met)


def _share(measure: str, hits: Sequence[bool], target: str, low: float, high: float) -> Row:
    if not hits:
        return Row(measure, "no case", 0, target, None)
    share = float(np.mean(hits))
    ends = binomtest(sum(hits), len(hits)).proportion_ci()  # exact, after Clopper and Pearson (1934)
    figure = f"{100 * share:.1f} % ({100 * ends.low:.1f} to {100 * ends.high:.1f})"
    return Row(measure, figure, len(hits), target, low <= share <= high if target else None)


def confusion(outcomes: Sequence[Outcome]) -> dict[str, Counter[str]]:
    """Per hidden effect (or kind): how often which verdict with which names was given."""
    table: defaultdict[str, Counter[str]] = defaultdict(Counter)
    for outcome in outcomes:
        hidden = outcome.sealed.hidden if outcome.sealed else outcome.task.hidden
        truth = " + ".join(hidden) or outcome.task.outside or "none"
        lacks = " (library lacks it)" if outcome.task.without else ""
        sets = " + ".join("|".join(members) for members in outcome.sets)
        table[truth + lacks][": ".join(filter(None, (outcome.verdict, sets)))] += 1
    return dict(sorted(table.items()))
