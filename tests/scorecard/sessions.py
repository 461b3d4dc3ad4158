"""Planned sessions judged: `python -m tests.scorecard sessions --help`."""

from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import click
import numpy as np
from hidden import hidden_campaign
from scipy.stats import binomtest

from bushfit.campaign.campaign import Campaign
from bushfit.commands.plan import plan
from bushfit.diagnosis.record import Diagnosis
from bushfit.diagnosis.workflow import diagnose
from bushfit.effects import LIBRARY, twins_of
from bushfit.errors import ModelError
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.planning.campaign import simulation_settings
from bushfit.planning.contract import Noise, Test
from bushfit.planning.search import RIVALS_APART
from bushfit.simulation.measured import SimulatedData, simulate

#: Effects that are hidden.
HIDDEN = (
    *("viscous", "maxwell", "strain_stiffening", "asymmetry", "second_friction", "mullins_softening"),
    *("rate_dependent_friction", "coupled_breakdown", "self_heating", "clearance", "interface_slip", "bump_stop"),
    *("stiffness_factor.radial", "rig_compliance", "inertia", "fixture_resonance", "delay", "amplitude_rolloff"),
    *("force_gain", "force_offset"),
)
#: Highest frequency of the rig that makes the session over that of the tests so far: `diagnose` asks for no more.
FASTER = 2.0


def tasks(count: int, seed: int) -> Iterator[tuple[int, tuple[str, ...]]]:
    """Seed and hidden effects of so many campaigns: five of eight hide one effect in turn, two none, and one a pair."""
    random = np.random.default_rng(seed)
    for number in range(count):
        kind, own = number * 8 // count, int(random.integers(2**31))
        if kind < 5:
            yield own, (HIDDEN[number % len(HIDDEN)],)
        else:
            yield own, () if kind < 7 else tuple(random.choice(HIDDEN, 2, replace=False).tolist())


def diagnosed(campaign: Campaign) -> Diagnosis:
    return diagnose(PreparedCampaign.from_campaign(campaign))


def evaluate(task: tuple[int, tuple[str, ...]], hours: float) -> str:
    """What a planned session makes of a campaign whose effects are left open; "decided" where none are.

    "elsewhere": no session tells, "rightly": one true name for each set, "wrongly": a wrong name, else "open".
    """
    seed, hidden = task
    simulated = hidden_campaign(seed, hidden)
    campaign = simulated.campaign()
    if diagnosed(campaign).verdict != "ambiguous":
        return "decided"
    tests = planned_session(campaign, hours)
    return judge(diagnosed(with_session(campaign, simulated, tests)), hidden) if tests else "elsewhere"


def judge(diagnosis: Diagnosis, hidden: tuple[str, ...]) -> str:
    """Whether each name is true of what is hidden, or of the simpler effect that this is at an end of its range."""
    true = {*hidden, *(LIBRARY[name].limit for name in hidden if name in LIBRARY)}
    if diagnosis.verdict not in ("named", "partly", "ambiguous"):
        return "open"
    alone = [effect.name for effect in diagnosis.effects if diagnosis.verdict != "ambiguous" or not effect.alternatives]
    if any(not true & {*twins_of(name)} for name in alone if name != "unnamed"):
        return "wrongly"
    decided = diagnosis.verdict != "ambiguous" and not any(effect.alternatives for effect in diagnosis.effects)
    return "rightly" if decided and "unnamed" not in alone else "open"


def planned_session(campaign: Campaign, hours: float) -> tuple[Test, ...]:
    """The tests that `bushfit plan --for rivals` chooses after a campaign; none where it says that none would tell."""
    fastest = max(float(sweep.frequency.max()) for sweep in campaign.sweeps)
    rig = replace(campaign.rig, max_frequency=FASTER * fastest)
    try:
        planned = plan(replace(campaign, rig=rig), aim="rivals", hours=hours)
    except ModelError:  # rivals of which the fit of either is no model: no test is planned for them
        return ()
    rivals = planned.document["rivals"]
    return planned.tests if rivals and rivals["planned"] >= RIVALS_APART else ()


def with_session(campaign: Campaign, hidden: SimulatedData, tests: tuple[Test, ...]) -> Campaign:
    """A campaign with further tests of what is hidden in it, on the same rig.

    What depends on the order of the tests is measured anew as a whole, all in one session.
    """
    before, further = hidden.plan, simulation_settings(tests, Noise())
    loops, sweeps, anew = further.loops, further.sweeps, hidden.truth.depends_on
    if anew:
        repeated = (replace(sweep, repeats=sweep.repeats or before.repeats) for sweep in before.sweeps)
        loops, sweeps = (*before.loops, *loops), (*repeated, *sweeps)
    made = simulate(hidden.truth, replace(before, loops=loops, sweeps=sweeps, seed=before.seed + 1)).campaign()
    kept = replace(campaign, loops=(), sweeps=()) if anew else campaign
    return replace(
        campaign,
        loops=(*kept.loops, *(replace(loop, name=f"planned_{loop.name}") for loop in made.loops)),
        sweeps=(*kept.sweeps, *(replace(sweep, name=f"planned_{sweep.name}") for sweep in made.sweeps)),
    )


@click.command("sessions")
@click.option("--seed", type=int, default=1, show_default=True, help="Of everything random.")
@click.option("--campaigns", type=click.IntRange(1), default=240, show_default=True)
@click.option("--hours", type=float, default=8.0, show_default=True, help="Of the planned session.")
@click.option("--jobs", type=click.IntRange(1), default=1, show_default=True, help="Cores.")
def sessions_command(seed: int, campaigns: int, hours: float, jobs: int) -> None:
    """Plan tests where `diagnose` leaves effects open, simulate them, and print what the diagnosis then names."""
    with ProcessPoolExecutor(jobs) as pool:
        results = Counter(pool.map(partial(evaluate, hours=hours), tasks(campaigns, seed)))
    made = results["rightly"] + results["wrongly"] + results["open"]
    click.echo(f"{made + results['elsewhere']} of {campaigns} campaigns ambiguous, {made} sessions")
    for result in ("rightly", "wrongly") if made else ():
        ends = binomtest(results[result], made).proportion_ci()
        click.echo(f"{result}: {results[result]} ({100 * ends.low:.0f} to {100 * ends.high:.0f} %)")
