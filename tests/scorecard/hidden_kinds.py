"""Hidden campaigns of kinds that no page lists, diagnosed as typed: what was acceptable, passed over, wrongly named.

    python tests/scorecard/hidden_kinds.py --seed 1 --campaigns 80 --set working

The rig is that of time_rig.py, which shares no law with bushfit. What is visible there, and what may be said of it,
stands in lab_campaign.py, working_kinds.py and held_back_kinds.py.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as bushfit does: small matrices, and times that mean one processor

import json
import signal
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path
from types import FrameType
from typing import Any, Literal

import click
import numpy as np
from click.testing import CliRunner, Result
from judging import Judged, acceptable, against_truth
from kinds import SIZES
from lab_campaign import HELD_BACK, WORKING, Answer, campaign
from scipy.stats import binomtest

from bushfit.cli import cli

#: Processor time [s] after which a diagnosis is given up: no answer at all.
_LONGEST = 60.0
#: What is aimed at, least and largest share; a rate meets it only where its whole interval lies there.
AIMS = {
    "without an answer": (0.0, 0.01),
    "model not read back": (0.0, 0.01),
    "visible, acceptable": (0.95, 1.0),
    "visible, passed over": (0.0, 0.03),
    "clean, false alarms": (0.0, 0.01),
    "wrong name kept": (0.0, 0.015),
    "which the tests deny": (0.0, 0.015),
    "set without the truth": (0.0, 0.015),
}
#: ln likelihood of the truth over what was told, from which on an observer who knows both, and takes both for equally
#: likely beforehand, would not have told it: 97 in 100.
DENIED = float(np.log(0.97 / 0.03))
#: Campaigns of either half of the kinds, or of none.
SETS = ("working", "held_back", "clean")
KINDS_OF = {"working": WORKING, "held_back": HELD_BACK}


@dataclass(frozen=True)
class Outcome:
    """What became of one campaign: the truth, the verdict with what was said, and its worth.

    Args:
        seed: of the campaign.
        answer: the truth.
        verdict: "none" where the command ended with an error, or not in time.
        words: names that were told, or the summary where there are none, or the error.
        judged: None where there is none; what was visible then counts as not acceptable.
        seconds: processor time of the command.
        readable: whether `predict` reads back the model that was written.
        against: of a wrong effect, ln likelihood of the tests by the truth over that by what was told; else None.
    """

    seed: int
    answer: Answer
    verdict: str
    words: str
    judged: Judged | None
    seconds: float
    readable: bool
    against: float | None = None


def _give_up(number: int, frame: FrameType | None) -> None:
    raise TimeoutError(f"no answer within {_LONGEST:g} s")


def diagnosed(folder: Path) -> tuple[dict[str, Any] | None, str, float]:
    """diagnosis.json of the campaign in a folder, or the error, and processor time."""
    signal.signal(signal.SIGVTALRM, _give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, _LONGEST)
    started = time.process_time()
    done = typed("diagnose", folder / "bushing.toml", "-o", folder / "out", "--no-report", "--json")
    seconds = time.process_time() - started
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
    if done.exit_code:
        return None, f"{done.exception!r} {done.stderr}".strip(), seconds
    return json.loads((folder / "out" / "diagnosis.json").read_text(encoding="utf-8")), "", seconds


def usable(folder: Path) -> bool:
    """Whether `predict` reads back the model that was written."""
    return typed("predict", folder / "out" / "model.json", "-o", folder / "predicted").exit_code == 0


def typed(*arguments: object) -> Result:
    return CliRunner().invoke(cli, [*map(str, arguments), "--no-plots"])


def hidden(kind: str, size: float, seed: int) -> Outcome:
    """One campaign, made, diagnosed and judged."""
    with tempfile.TemporaryDirectory() as folder:
        answer = campaign(kind, size, seed, Path(folder))
        diagnosis, error, seconds = diagnosed(Path(folder))
        if diagnosis is None:
            return Outcome(seed, answer, "none", error, None, seconds, readable=False)
        readable, judged, against = usable(Path(folder)), acceptable(answer, diagnosis), None
        of_record = any(each.get("correction") for each in diagnosis["effects"])  # the model is of the tests unmended
        if judged.wrong_name and not of_record:
            silent = Path(folder) / "silent"
            campaign(kind, size, seed, silent, silent=True)
            against = against_truth(Path(folder), silent, Path(folder) / "out" / "model.json")
    names = [" / ".join((each["name"], *each["alternatives"])) for each in diagnosis["effects"]]
    words = "; ".join(names) or str(diagnosis["summary"])
    return Outcome(seed, answer, diagnosis["verdict"], words, judged, seconds, readable, against)


def asked(chosen: str, seed: int) -> Iterator[tuple[str, float, int]]:
    """Kind, size and seed of one campaign after the other, each kind as often as any other."""
    random = np.random.default_rng([seed, SETS.index(chosen)])
    while True:
        for name in [""] if chosen == "clean" else random.permutation(list(KINDS_OF[chosen])).tolist():
            size = float(random.choice(SIZES)) if name else 0.0
            yield name, size, int(random.integers(2**31))


def diagnosed_all(chosen: str, seed: int, campaigns: int, jobs: int = 1) -> Iterator[Outcome]:
    """Outcomes of so many campaigns of a set, in order."""
    tasks = zip(*islice(asked(chosen, seed), campaigns), strict=True)
    if jobs == 1:
        yield from map(hidden, *tasks)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(hidden, *tasks)


def rates(outcomes: Sequence[Outcome]) -> dict[str, tuple[int, int]]:
    """What was told of how many; of what is visible, no answer is none that is acceptable."""
    told = [each for each in outcomes if each.judged]
    judged = [each.judged for each in told if each.judged]
    visible = [each.judged for each in outcomes if each.answer.visible]
    clean = [each.judged for each in told if each.judged and not each.answer.kind]
    return {
        "without an answer": (len(outcomes) - len(told), len(outcomes)),
        "model not read back": (sum(not each.readable for each in told), len(told)),
        "visible, acceptable": (sum(bool(each and each.acceptable) for each in visible), len(visible)),
        "visible, passed over": (sum(bool(each and each.passed_over) for each in visible), len(visible)),
        "clean, false alarms": (sum(each.seen for each in clean), len(clean)),
        "wrong name kept": (sum(each.wrong_name for each in judged), len(judged)),
        "which the tests deny": (sum(each.against is not None and each.against > DENIED for each in told), len(judged)),
        "set without the truth": (sum(each.wrong_set for each in judged), len(judged)),
    }


def interval(count: int, of: int) -> tuple[float, float]:
    """Ends of the 95 % interval of a share (Clopper and Pearson)."""
    ends = binomtest(count, of).proportion_ci()
    return ends.low, ends.high


def aimed(name: str, count: int, of: int) -> Literal["met", "open", "missed"]:
    """Whether the interval of a rate lies within its aim, partly, or not at all."""
    (low, high), (least, largest) = interval(count, of), AIMS[name]
    if least <= low and high <= largest:
        return "met"
    return "missed" if high < least or low > largest else "open"


def table(outcomes: Sequence[Outcome]) -> str:
    """Rates with their intervals, and processor times."""
    lines = []
    for name, (count, of) in rates(outcomes).items():
        if of:
            low, high = interval(count, of)
            share = f"{100.0 * count / of:5.1f} % ({100.0 * low:.1f} to {100.0 * high:.1f}), {aimed(name, count, of)}"
            lines.append(f"{name:22s} {count:4d} of {of:4d} = {share}")
    seconds = [each.seconds for each in outcomes]
    middle, most = np.quantile(seconds, (0.5, 0.9))
    return "\n".join([*lines, f"processor time [s]: median {middle:.2f}, 90 % {most:.2f}, longest {max(seconds):.2f}"])


def line(outcome: Outcome) -> str:
    """One campaign in a line."""
    answer, judged = outcome.answer, outcome.judged
    marks = [name for name in ("passed_over", "wrong_name", "wrong_set") if judged and getattr(judged, name)]
    odds = "" if outcome.against is None else f" (truth over it {outcome.against:+.1f} in ln likelihood)"
    worth = "no answer" if judged is None else "acceptable" if judged.acceptable else " ".join(marks) or "false alarm"
    size = f"{100 * answer.size:4.1f} %, left {100 * answer.left:5.1f} %, {answer.misfit:7.0f}"
    truth = f"{answer.kind or 'clean':20s} {size} {'seen' if answer.visible else '-':4s}"
    return f"{outcome.seed:10d} {truth} {outcome.verdict:11s} {worth}: {outcome.words}{odds}"


@click.command()
@click.option("--seed", type=int, required=True)
@click.option("--campaigns", type=click.IntRange(1), default=40, show_default=True)
@click.option("--set", "chosen", type=click.Choice(SETS), default="working", show_default=True)
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True)
@click.option("--lines/--no-lines", help="A line a campaign; of the set that is held back there are none.")
@click.option("--keep", type=click.Path(path_type=Path), help="A file for outcomes, one a line as JSON.")
def main(seed: int, campaigns: int, chosen: str, jobs: int, lines: bool, keep: Path | None) -> None:
    """Diagnose hidden campaigns and print rates with their 95 % intervals."""
    outcomes = []
    for outcome in diagnosed_all(chosen, seed, campaigns, jobs):
        outcomes.append(outcome)
        if lines and chosen != "held_back":
            click.echo(line(outcome))
        if keep:
            with keep.open("a", encoding="utf-8") as file:
                file.write(json.dumps(asdict(outcome)) + "\n")
    click.echo(table(outcomes))


if __name__ == "__main__":
    main()
