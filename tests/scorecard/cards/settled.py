"""Does the planned session settle what a diagnosis left open? The virtual rig makes its tests of what is hidden."""

from collections.abc import Sequence
from dataclasses import replace

from bushfit.campaign.campaign import Campaign
from bushfit.errors import ModelError
from bushfit.jobs.plan import PlanTests
from bushfit.planning.campaign import settings_of
from bushfit.planning.contract import Noise, Test
from bushfit.planning.offer import RIVALS_APART
from bushfit.simulation.measured import Simulated, simulate

#: Highest frequency of the rig that makes the session, over that of the tests so far: what `diagnose` asks for at most.
_FASTER = 2.0
#: What is added to the seed of a campaign for the noise of its session.
_OTHER_NOISE = 1


def planned_session(campaign: Campaign, hours: float) -> tuple[Test, ...]:
    """The tests that `bushfit plan --for rivals` chooses after a campaign; none where it says that none would tell."""
    fastest = max(float(sweep.frequency.max()) for sweep in campaign.sweeps)
    rig = replace(campaign.rig, max_frequency=_FASTER * fastest)
    try:
        found = PlanTests("rivals", hours).run(replace(campaign, rig=rig)).plan.planned
    except ModelError:  # rivals of which the fit of either is no model: no test is planned for them
        return ()
    return found.tests if found.apart is not None and found.apart >= RIVALS_APART else ()


def with_session(campaign: Campaign, hidden: Simulated, tests: Sequence[Test]) -> Campaign:
    """A campaign with further tests of what is hidden in it, on the same rig.

    What depends on the order of the tests is measured anew as a whole, all in one session.
    """
    before, further = hidden.plan, settings_of(tests, Noise())
    loops, sweeps, anew = further.loops, further.sweeps, hidden.truth.knows_circumstances
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
