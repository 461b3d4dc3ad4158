"""The score card: how often `diagnose` is right on campaigns whose hidden effect it is not told.

Campaigns are written to disk as files; the workflow reads the campaign, never the sealed truth, which is opened
afterwards. The same seed makes the same card.

Does the planned session settle what a diagnosis left open? The virtual rig makes its tests of what is hidden.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from pydantic import TypeAdapter
from threadpoolctl import threadpool_limits

from bushfit.batch.executor import local_workers, run_rows
from bushfit.campaign.campaign import Campaign, load_campaign
from bushfit.commands.diagnose import diagnose as diagnose_campaign
from bushfit.commands.plan import plan
from bushfit.diagnosis.evidence import Evidence
from bushfit.diagnosis.record import Diagnosis, DiagnosisSettings
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import effect_name_of
from bushfit.effects.mistakes import get_mistake
from bushfit.errors import MeasurementError, ModelError
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.planning.campaign import settings_of
from bushfit.planning.contract import Noise, Test
from bushfit.planning.problem import RIVALS_APART
from bushfit.report.page.record import read_results
from bushfit.report.results import Formats, write_files, write_results
from bushfit.simulation.files import to_files
from bushfit.simulation.measured import Simulated, simulate
from cards.families import RECIPES, campaign_of
from cards.hidden import Sealed
from cards.outcome import REFUSED, Outcome, Task

#: What of |K|, or of a parameter, is off where a mistake in the record matters.
_MATTERS = 0.02

_SEALED = TypeAdapter(Sealed)


def run(
    chosen: Sequence[Task],
    kept: Path | None,
    jobs: int,
    progress: Callable[[Outcome], None],
    hours: float | None = None,
) -> list[Outcome]:
    """Make, diagnose and judge every task, on several cores.

    Args:
        kept: folder in which campaigns and truths stay; none stay where it is None.
        progress: called in this process with each outcome, in the order in which they come.
        hours: of the session that is planned where effects are left open; None for none.

    Notes:
        A campaign that takes its worker down twice is a failure of its own row.
    """
    done: dict[int, Outcome] = {}
    for number, found in run_rows(chosen, partial(_in_worker, kept=kept, hours=hours), str, local_workers(jobs)):
        outcome = Outcome(chosen[number], None, "failed", error=found) if isinstance(found, str) else found
        progress(outcome)
        done[number] = outcome
    return [done[number] for number in range(len(chosen))]


def _in_worker(task: Task, kept: Path | None, hours: float | None) -> Outcome | str:
    """A task, with linear algebra on one thread: cores are for campaigns."""
    with threadpool_limits(1):
        return work(task, kept, hours)


def work(task: Task, kept: Path | None = None, hours: float | None = None) -> Outcome:
    """One task: write the campaign, seal the truth apart, diagnose the files as the command does, open the truth.

    Args:
        kept: folder in which both stay; where it is None, they are gone afterwards.
        hours: as of `run`.
    """
    with TemporaryDirectory() if kept is None else nullcontext(str(kept)) as folder:
        return _worked(task, Path(folder), hours)


def _worked(task: Task, folder: Path, hours: float | None) -> Outcome:
    place = folder / f"{task.kind}_{task.seed}"
    sealed_file = folder / "sealed" / f"{task.kind}_{task.seed}.json"
    try:
        simulated, sealed = campaign_of(task)
        files = to_files(simulated)
        del files["truth.json"]
        write_files(place, files)
        write_files(sealed_file.parent, {sealed_file.name: _SEALED.dump_json(sealed)})
        started = time.process_time()
        data = PreparedCampaign.from_campaign(load_campaign(place / "campaign.toml"))
        found = diagnose_campaign(data, without=task.without)
        diagnosis, seconds = found.diagnosis, time.process_time() - started
        write_results(place / "results", found.files, Formats(pictures=False, pages=False), overwrite=True)
        read_results(place / "results")  # as `bushfit report` reads back what `bushfit diagnose` wrote
        truth = _SEALED.validate_json(sealed_file.read_bytes())
        outcome = _outcome(task, truth, diagnosis, seconds)
        return _settled(outcome, truth, data.campaign, simulated, diagnosis.next_test, hours) if hours else outcome
    except MeasurementError as refusal:
        if task.kind != "mistake":
            return _failed(task, refusal)
        return Outcome(task, sealed, REFUSED, matters=True)
    except Exception as wrong:  # one campaign that fails is one row of the card, and is shown there
        return _failed(task, wrong)


def _settled(
    outcome: Outcome, truth: Sealed, campaign: Campaign, hidden: Simulated, next_test: str, hours: float
) -> Outcome:
    """The outcome with what came of a planned session, where effects of the library were hidden and left open."""
    task = outcome.task
    if task.kind in RECIPES or task.kind == "mistake" or task.without:
        return outcome
    tests = planned_session(campaign, hours) if outcome.verdict == "ambiguous" else ()
    if tests:
        again = diagnose(PreparedCampaign.from_campaign(with_session(campaign, hidden, tests)))
        return replace(outcome, settled=_outcome(task, truth, again, 0.0).settles)
    return replace(outcome, settled="elsewhere", decides=next_test) if outcome.left_open else outcome


def _names(alternatives: Sequence[str]) -> tuple[str, ...]:
    """Effects that look-alikes are made of, each once; what is no effect as it was told."""
    return tuple(dict.fromkeys(name for each in alternatives for name in each.split(" + ")))


def _failed(task: Task, wrong: Exception) -> Outcome:
    return Outcome(task, None, "failed", error=f"{type(wrong).__name__}: {wrong}")


def _outcome(task: Task, truth: Sealed, diagnosis: Diagnosis, seconds: float) -> Outcome:
    result, document = diagnosis.result, diagnosis.to_document()
    heldout = document["gap"]["heldout"] or {"before": None, "after": None}
    added = {name for name in task.hidden if name in result.model.effects}
    asked = [name for name in truth.values if effect_name_of(name) in added]
    intervals = {name: result.interval(name) for name in asked}
    (_, odds), leader = next(zip(diagnosis.odds.explanations, diagnosis.odds.labels, strict=True), (("", 0.0), ""))
    covered = [ends[0] <= truth.values[name] <= ends[1] for name, ends in intervals.items() if ends is not None]
    return Outcome(
        task,
        truth,
        diagnosis.verdict,
        tuple(tuple(dict.fromkeys((effect.label, *_names(effect.alternatives)))) for effect in diagnosis.effects),
        max((judged.gain or 0.0 for judged in diagnosis.candidates if not get_mistake(judged.name)), default=0.0),
        heldout["after"],
        tuple(covered),
        seconds,
        task.kind == "mistake" and _matters(diagnosis.before, truth),
        before=heldout["before"],
        nothing=diagnosis.odds.nothing,
        leader=leader,
        odds=odds,
    )


def _matters(before: Evidence, truth: Sealed) -> bool:
    """Whether a mistake shows at all, and leaves more than _MATTERS of |K| or of a parameter."""
    gap = max(test.smooth_misfit(before.model) for test in before.data_sets)
    off = max(abs(before.model.values[name] / value - 1.0) for name, value in truth.values.items())
    return gap > DiagnosisSettings().tolerance and max(gap, off) > _MATTERS


#: Highest frequency of the rig that makes the session, over that of the tests so far: what `diagnose` asks for at most.
_FASTER = 2.0
#: What is added to the seed of a campaign for the noise of its session.
_OTHER_NOISE = 1


def planned_session(campaign: Campaign, hours: float) -> tuple[Test, ...]:
    """The tests that `bushfit plan --for rivals` chooses after a campaign; none where it says that none would tell."""
    fastest = max(float(sweep.frequency.max()) for sweep in campaign.sweeps)
    rig = replace(campaign.rig, max_frequency=_FASTER * fastest)
    try:
        found = plan(replace(campaign, rig=rig), aim="rivals", hours=hours).plan.planned
    except ModelError:  # rivals of which the fit of either is no model: no test is planned for them
        return ()
    apart = found.rival_chi_square
    return found.tests if apart is not None and apart >= RIVALS_APART else ()


def with_session(campaign: Campaign, hidden: Simulated, tests: Sequence[Test]) -> Campaign:
    """A campaign with further tests of what is hidden in it, on the same rig.

    What depends on the order of the tests is measured anew as a whole, all in one session.
    """
    before, further = hidden.plan, settings_of(tests, Noise())
    loops, sweeps, anew = further.loops, further.sweeps, hidden.truth.depends_on_conditions
    if anew:
        repeated = (replace(sweep, repeats=sweep.repeats or before.repeats) for sweep in before.sweeps)
        loops, sweeps = (*before.loops, *loops), (*repeated, *sweeps)
    seed = before.seed + _OTHER_NOISE
    made = simulate(hidden.truth, replace(before, loops=loops, sweeps=sweeps, seed=seed)).campaign()
    kept = replace(campaign, loops=(), sweeps=()) if anew else campaign
    return replace(
        campaign,
        loops=(*kept.loops, *(replace(loop, name=f"planned_{loop.name}") for loop in made.loops)),
        sweeps=(*kept.sweeps, *(replace(sweep, name=f"planned_{sweep.name}") for sweep in made.sweeps)),
    )
