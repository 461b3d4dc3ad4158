"""A benchmark of diagnosis: sealed campaigns made from a seed, tools run on them, and their answers scored."""

import hashlib
import json
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import click
import numpy as np
from baselines import BASELINES
from kinds import SIZES
from lab_campaign import RUBBERS, campaign
from listed_kinds import LISTED
from mistaken_records import MISTAKEN
from rig_faults import RIG_FAULTS
from scipy.stats import binomtest

from bushfit.campaign.campaign import load_campaign
from bushfit.commands.diagnose import diagnose
from bushfit.diagnosis.next_test import MEASURE_AGAIN
from bushfit.effects import LIBRARY
from bushfit.effects.mistakes import MISTAKES
from bushfit.errors import BushfitError

#: Seed of the published benchmark.
SEED = 55
#: Rig faults that are planted in rubber of other laws.
_FAULTS = ("delay", "inertia", "compliance", "stiffness_factor")
#: Names of a claim at most, for a true one among them to count.
LARGEST_SET = 4
#: Relative tolerance of frequency and amplitude where a point is sought in a region.
_SAME = 0.03
_ANSWERS, _VOCABULARY = "answers.json", "vocabulary.csv"

#: What a tool answers of a campaign: `sees`, `claims` and `where`.
ToolAnswer = dict[str, Any]
#: Places at fault, by the words in which bushfit reports them.
_PLACES = {"repeat": "repeat", "loop": "loop", "level": "level", "frequency": " Hz", "direction": ""}
FOLDER = click.argument("folder", type=click.Path(path_type=Path))


def tasks(seed: int, count: int) -> list[tuple[str, str, float, int, str]]:
    """Group, kind, size, seed and law of so many campaigns, in random order; 300 contain all of every group."""
    random = np.random.default_rng([seed, 300])
    faults, records = [*RIG_FAULTS], [*MISTAKEN]
    drawn = [("own law", name, SIZES[turn], "") for turn in range(3) for name in LISTED]
    drawn += [("rig fault", name, SIZES[1 + turn], "") for turn in range(2) for name in faults]
    drawn += [("record", name, 0.0, "") for _ in range(2) for name in records]
    for law in RUBBERS:
        drawn += [("other law", "", 0.0, law)] * 3
        drawn += [("other law", str(name), 0.07, law) for name in random.choice(_FAULTS, 3, replace=False)]
    drawn += [("clean", "", 0.0, "")] * max(300 - len(drawn), 0)
    chosen = random.permutation(len(drawn))[:count]
    return [(*drawn[i][:3], int(random.integers(2**31)), drawn[i][3]) for i in chosen.tolist()]


def make(folder: Path, seed: int, count: int) -> tuple[str, str]:
    """Write campaigns/campaign_000/bushing.toml and so on, vocabulary.csv, and apart from them answers.json.

    Returns:
        SHA-256 of the campaigns' files, and of answers.json.
    """
    answers = {}
    for number, (group, kind, size, own_seed, law) in enumerate(tasks(seed, count)):
        name = f"campaign_{number:03d}"
        answer = campaign(kind, size, own_seed, folder / "campaigns" / name, law=law)
        answers[name] = {"group": group, **asdict(answer), "visible": answer.visible}
    (folder / _ANSWERS).write_text(json.dumps(answers, indent=1) + "\n", encoding="utf-8")
    words = {**LIBRARY, **MISTAKES}
    lines = [f'{name.partition(".")[0]},{word.level.name.lower()},"{word.sentence}"' for name, word in words.items()]
    places = [f'fault.{place},record,"these tests alone are wrong"' for place in _PLACES]
    (folder / _VOCABULARY).write_text(
        "\n".join(["name,level,sentence", *dict.fromkeys(lines), *places]) + "\n", encoding="utf-8"
    )
    return sha256(folder / "campaigns"), sha256(folder / _ANSWERS)


def sha256(path: Path) -> str:
    """SHA-256 of a file, or of the names and contents of all files below a folder, in order."""
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    digest = hashlib.sha256()
    for file in files:
        if file.is_file():
            digest.update(file.relative_to(path).as_posix().encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _vocabulary_name(name: str) -> str:
    """The name of an effect without its direction, of a mistake without its file, of a fault by its kind of place."""
    if name.startswith("fault"):
        return "fault." + next(place for place, word in _PLACES.items() if word in name)
    return name.partition(":")[0].partition(".")[0]


def ask_bushfit(folder: Path) -> ToolAnswer:
    """The answer of `bushfit diagnose`."""
    diagnosed = diagnose(load_campaign(folder / "bushing.toml"))
    document = json.loads(json.dumps(diagnosed.document, default=float))
    verdict, effects = document["verdict"], [effect for effect in document["effects"] if effect["name"] != "unnamed"]
    claims = list[list[str]]()
    if verdict in ("named", "partly"):
        claims = [[effect["name"]] for effect in effects]
    elif verdict == "ambiguous":
        claims = [[effect["name"], *effect["alternatives"]] for effect in effects] or [
            [" + ".join(names) for names in diagnosed.diagnosis.odds.labels]
        ]
    elif document["next_test"].startswith(MEASURE_AGAIN):
        claims = [[f"fault: {document['next_test'].removeprefix(MEASURE_AGAIN)}"]]
    claims = [[*dict.fromkeys(" + ".join(map(_vocabulary_name, x.split(" + "))) for x in claim)] for claim in claims]
    where = [
        {key: region[key] for key in ("direction", "frequency_Hz", "amplitude_mm")}
        for region in document["where"]
        if region["kind"] == "sweep"
    ]
    return {"sees": verdict != "consistent", "claims": claims, "where": where, "verdict": verdict}


TOOLS: Mapping[str, Callable[[Path], ToolAnswer]] = {"bushfit": ask_bushfit, **BASELINES}


def run(folder: Path, tool: str) -> Iterator[str]:
    """Answers of a tool in folder/TOOL.jsonl, a line a campaign; those that are there are kept."""
    file = folder / f"{tool}.jsonl"
    done = set(read_answers(file)) if file.exists() else set()
    for place in sorted((folder / "campaigns").iterdir()):
        if place.name in done:
            continue
        started = time.process_time()
        try:
            answer = TOOLS[tool](place)
        except BushfitError as refusal:  # bushfit's readers serve all three tools
            answer = {"sees": True, "claims": [], "where": [], "refused": str(refusal)}
        except Exception as error:  # a campaign without an answer is scored as one
            answer = {"sees": False, "claims": [], "where": [], "error": f"{type(error).__name__}: {error}"}
        answer = {"campaign": place.name, **answer, "seconds": round(time.process_time() - started, 2)}
        with file.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps(answer) + "\n")
        yield f"{place.name} {answer['claims'] or answer.get('verdict', answer['sees'])} {answer['seconds']:.1f} s"


def read_answers(file: Path) -> dict[str, ToolAnswer]:
    """Answers of a tool by campaign, from JSON lines."""
    lines = map(json.loads, file.read_text(encoding="utf-8").splitlines())
    return {line["campaign"]: line for line in lines}


def judge(truth: Mapping[str, Any], answer: ToolAnswer) -> dict[str, bool | float | None]:
    """What an answer is worth by each measure; None where a measure does not apply.

    A name is right if it is in `right`, or is "fault." and a `place`; a combination "a + b" if one of its parts is. A
    claim of one name is a name, a claim of two to four a set.
    """
    right = {*truth["right"], *(f"fault.{place}" for place in truth["place"])}
    true = right | {*truth["also"]}

    def holds(names: Sequence[str], wanted: set[str]) -> bool:
        return any(part in wanted for name in names for part in name.split(" + "))

    names = [claim for claim in answer["claims"] if len(claim) == 1]
    claims = [claim for claim in answer["claims"] if len(claim) <= LARGEST_SET]
    nothing = not (truth["kind"] or truth["law"])
    named, planted = truth["visible"] and bool(right), any(point[3] for point in truth["points"])
    return {
        "hits": any(holds(claim, right) for claim in names) if named else None,
        "in the set": any(holds(claim, right) for claim in claims) if named else None,
        "wrong names": any(not holds(claim, true) for claim in names),
        "false alarms": bool(answer["sees"]) if nothing else None,
        "passed over": not answer["sees"] if truth["visible"] else None,
        "location F1": location_score(truth["points"], answer["where"]) if truth["visible"] and planted else None,
    }


def location_score(points: Sequence[Sequence[Any]], regions: Sequence[Mapping[str, Any]]) -> float:
    """F1 of the operating points inside the regions against those that are planted: 2 TP/(2 TP + FP + FN)."""

    def inside(point: Sequence[Any], region: Mapping[str, Any]) -> bool:
        ends = (region["frequency_Hz"], region["amplitude_mm"])
        near = (
            (1.0 - _SAME) * low <= x <= (1.0 + _SAME) * high for x, (low, high) in zip(point[1:3], ends, strict=True)
        )
        return bool(point[0] == region["direction"] and all(near))

    told = np.array([any(inside(point, region) for region in regions) for point in points])
    planted = np.array([bool(point[3]) for point in points])
    both = np.count_nonzero(told & planted)
    return float(2.0 * both / max(np.count_nonzero(told) + np.count_nonzero(planted), 1))


def score(answers: Mapping[str, Any], told: Mapping[str, ToolAnswer], group: str = "") -> dict[str, str]:
    """Each measure of a tool with its 95 % interval and number of campaigns: Clopper-Pearson, of F1 the mean +- 1.96
    standard errors."""
    mute: ToolAnswer = {"sees": False, "claims": [], "where": []}
    judged = [judge(truth, told.get(name, mute)) for name, truth in answers.items() if group in ("", truth["group"])]
    cells = {}
    for measure in ("hits", "in the set", "wrong names", "false alarms", "passed over", "location F1"):
        values = [float(row[measure]) for row in judged if row[measure] is not None]  # type: ignore[arg-type]
        cells[measure] = "-"
        if values and measure == "location F1":
            mean, error = np.mean(values), 1.96 * np.std(values) / np.sqrt(len(values))
            cells[measure] = f"{mean:.2f} ({max(mean - error, 0.0):.2f} to {min(mean + error, 1.0):.2f})"
        elif values:
            ends = binomtest(round(sum(values)), len(values)).proportion_ci()
            cells[measure] = f"{100 * np.mean(values):.1f} % ({100 * ends.low:.1f} to {100 * ends.high:.1f})"
        cells[measure] += f" of {len(values)}"
    return cells


def table(answers: Mapping[str, Any], tools: Mapping[str, Mapping[str, ToolAnswer]], *, groups: bool) -> str:
    """Scores as Markdown, a row a tool, or a tool and group."""
    rows = [
        (f"{tool}{', ' * bool(group)}{group}", score(answers, told, group))
        for tool, told in tools.items()
        for group in ["", *(sorted({truth["group"] for truth in answers.values()}) if groups else ())]
    ]
    measures = list(rows[0][1])
    lines = [["tool", *measures], ["---"] * (len(measures) + 1), *([name, *cells.values()] for name, cells in rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


@click.group("benchmark")
def benchmark() -> None:
    """Make sealed campaigns, run a tool on them, score its answers: make FOLDER, run FOLDER, score FOLDER."""
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@benchmark.command("make")
@FOLDER
@click.option("--seed", type=int, default=SEED, show_default=True)
@click.option("--campaigns", type=click.IntRange(1, 300), default=300, show_default=True)
def make_command(folder: Path, seed: int, campaigns: int) -> None:
    """Write the campaigns, the vocabulary, and apart from them the answers; print their SHA-256."""
    for name, digest in zip(("campaigns", _ANSWERS), make(folder, seed, campaigns), strict=True):
        click.echo(f"{digest}  {name}")


@benchmark.command("run")
@FOLDER
@click.option("--tool", type=click.Choice(list(TOOLS)), default="bushfit", show_default=True)
def run_command(folder: Path, tool: str) -> None:
    """Append the tool's answers to FOLDER/TOOL.jsonl; a run that was stopped continues."""
    for line in run(folder, tool):
        click.echo(line)


@benchmark.command("score")
@FOLDER
@click.option("--groups", is_flag=True, help="A row for each group of campaigns, too.")
@click.option("--answered", is_flag=True, help="Only campaigns that every tool has answered.")
def score_command(folder: Path, groups: bool, answered: bool) -> None:
    """Score every FOLDER/TOOL.jsonl against the answers; a campaign without an answer counts as seen to be clean."""
    answers = json.loads((folder / _ANSWERS).read_text(encoding="utf-8"))
    tools = {file.stem: read_answers(file) for file in sorted(folder.glob("*.jsonl"))}
    if answered:
        answers = {name: truth for name, truth in answers.items() if all(name in told for told in tools.values())}
    click.echo(f"{len(answers)} campaigns; sha256 of the answers {sha256(folder / _ANSWERS)}")
    click.echo(table(answers, tools, groups=groups))
