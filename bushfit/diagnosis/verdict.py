"""From what the search found to a verdict, in the order in which a careful engineer doubts it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.diagnosis.evidence import Evidence, fit
from bushfit.diagnosis.faults import Fault, faults
from bushfit.diagnosis.holdout import hold_out
from bushfit.diagnosis.locate import contrasts, largest_smooth_misfit, locate
from bushfit.diagnosis.next_test import deciding_test
from bushfit.diagnosis.propose import Proposal
from bushfit.diagnosis.record import Diagnosis, Judged, Named, Verdict, Where
from bushfit.diagnosis.refit import Candidate
from bushfit.diagnosis.score_test import PATTERN_LEFT, ScoreTest
from bushfit.diagnosis.search import SAME, Search, Step
from bushfit.effects import effect_named, effect_of, qualified
from bushfit.fitting.agreement import misfits, usable
from bushfit.fitting.assess import Stage, covariance, measured_range, quality
from bushfit.fitting.data_sets import parted, sources
from bushfit.fitting.plausible import apart_in_temperature
from bushfit.fitting.procedures import cautions
from bushfit.fitting.solve import Bounds
from bushfit.model.result import Result
from bushfit.units import number

#: Probability with which noise alone stays below the thresholds of a remainder and of a fault: both are asked of every
#: clean campaign, and one false alarm in 250 is what the score card's 1 % leaves room for.
_CHANCE_LEVEL = 0.998
#: Share of the held-out gap that may be left for the verdict `partly`.
_PARTLY = 0.5


@dataclass(frozen=True)
class Remainder:
    """A real gap that stays: its words, and the fault that explains it, if one does."""

    words: str
    fault: Fault | None


def judge(search: Search, final: Evidence, steps: Sequence[Step]) -> Diagnosis:
    """Doubt the finding: a fault instead, look-alikes, held-out data, what remains."""
    base = search.base
    if not steps:
        trace = search.trace()
        remainder = find_remainder(search, trace.evidence if trace else base)
        if remainder is None:
            words = "nothing is missing beyond noise and tolerance"
            words += f"; what there is of {trace.name} stays below the tolerance" if trace else ""
            return finish(search, "consistent", words, base, ())
        return finish(search, "unexplained", remainder.words, base, (), fault=remainder.fault)
    fault = worst_fault(search, base)
    worth = base.bic - final.bic
    if fault and fault.worth > worth + SAME:
        return finish(search, "unexplained", _fault_words(fault), base, (), fault=fault)
    if fault and fault.worth > worth - SAME:
        leaders = [replace(_named(step), alternatives=(f"fault: {fault.suspect.words}",)) for step in steps]
        words = f"{' and '.join(step.name for step in steps)}, or a fault of the measurement: {fault.suspect.words}"
        return finish(search, "ambiguous", f"these tests cannot tell {words}", base, leaders, fault=fault)
    names = [_named(step) for step in steps]
    if beyond := _at_bound(final, steps):
        words = f"{_closing(names)} the gap only with {beyond} at the edge of what is possible"
        return finish(search, "unexplained", words, base, ())
    held = hold_out(base, final)
    if not held.passed:
        words = f"{_closing(names)} the gap only where fitted, so the name is taken back"
        return finish(search, "unexplained", words, base, ())
    if any(step.rivals for step in steps):
        return _ambiguous(search, final, steps, names)
    remainder = find_remainder(search, final)
    if remainder is None:
        return finish(search, "named", f"{_closing(names)} the gap", final, names)
    if held.after < _PARTLY * held.before:
        words = f"{_closing(names)} part of the gap; {remainder.words}"
        return finish(search, "partly", words, final, names, fault=remainder.fault)
    return finish(search, "unexplained", remainder.words, base, (), fault=remainder.fault)


def _at_bound(final: Evidence, steps: Sequence[Step]) -> str | None:
    """The amount of an added effect that came to rest on a bound: what is missing is then another thing."""
    amounts = {qualified(effect, effect.amount) for effect in map(effect_named, (step.name for step in steps))}
    return next((name for name in final.solution.at_bound if name in amounts), None)


def _ambiguous(search: Search, final: Evidence, steps: Sequence[Step], names: Sequence[Named]) -> Diagnosis:
    """Keep what is certain; leave out what has look-alikes."""
    model = search.base.model
    for step in steps:
        if not step.rivals:
            own = {key: value for key, value in final.model.values.items() if effect_of(key) == step.name}
            model = model.with_effect(step.name, own)
    kept = search.base if model is search.base.model else fit(model, final.data_sets, search.held, search.bounds)
    sets = "; ".join(f"{name.name} from {' or '.join(name.alternatives)}" for name in names if name.alternatives)
    rivals = [[final.model, *(rival.evidence.model for rival in step.rivals)] for step in steps if step.rivals]
    words = f"these tests cannot tell {sets}"
    return finish(search, "ambiguous", words, kept, names, next_test=deciding_test(rivals[0], final.data_sets))


def is_consistent(search: Search) -> bool:
    """Whether nothing is missing beyond noise and tolerance."""
    trace = search.trace()
    return not search.matters and find_remainder(search, trace.evidence if trace else search.base) is None


def find_remainder(search: Search, evidence: Evidence) -> Remainder | None:
    """What is left beyond noise and tolerance: a fault at one place, or something smooth."""
    fault = worst_fault(search, evidence)
    if fault:
        return Remainder(_fault_words(fault), fault)
    columns = contrasts(evidence)
    smooth = ScoreTest(evidence, columns, [np.arange(len(columns))], PATTERN_LEFT)
    if (
        smooth.gains()[0] > smooth.largest_by_chance(_CHANCE_LEVEL)
        and largest_smooth_misfit(evidence) > search.settings.tolerance
    ):
        return Remainder("a real gap stays that no known effect closes", None)
    return None


def worst_fault(search: Search, evidence: Evidence) -> Fault | None:
    """The worthiest fault, where it is more than chance, more than its price and larger than the tolerance."""
    found, chance = faults(evidence, _CHANCE_LEVEL)
    worst = max(found, key=lambda fault: fault.worth, default=None)
    if worst is None or worst.worth < SAME or worst.size < search.settings.tolerance:
        return None
    return worst if worst.gain > chance else None


def _fault_words(fault: Fault) -> str:
    return f"{fault.suspect.words} stands out from all other tests: measure it again before looking for physics"


def _closing(names: Sequence[Named]) -> str:
    return f"{' and '.join(named.name for named in names)} {'closes' if len(names) == 1 else 'close'}"


def _named(step: Step) -> Named:
    """The effect of a step, with its gain and how far the next best is behind in words."""
    words = f"takes {step.gain:.0f} off chi-square"
    if step.tried and step.tried[0].name == step.name:
        others, bic = [rival for rival in step.tried[1:] if not rival.left], step.tried[0].evidence.bic
        behind = [f"next best {rival.name}, {rival.evidence.bic - bic:.0f} behind by BIC" for rival in others]
        words += "; " + (behind[0] if behind else "no other comes near")
    alternatives, richer = (tuple(rival.name for rival in rivals) for rivals in (step.rivals, step.richer))
    return Named(step.name, words, alternatives, richer)


def finish(
    search: Search,
    verdict: Verdict,
    summary: str,
    after: Evidence,
    effects: Sequence[Named],
    *,
    fault: Fault | None = None,
    next_test: str = "",
) -> Diagnosis:
    """The whole finding, once the verdict stands."""
    base = search.base
    if not next_test and effects:
        next_test = effect_named(effects[0].name).confirmed_by
    where = (*([_fault_where(fault)] if fault else []), *locate(base))
    return Diagnosis(
        verdict,
        summary,
        tuple(effects),
        where,
        where if after is base else locate(after),
        hold_out(base, after),
        f"measure again: {fault.suspect.words}" if fault else next_test,
        tuple(_candidates(search, {named.name for named in effects})),
        base,
        after,
        _result(after, search.bounds),
        _notes(search, after),
    )


def _fault_where(fault: Fault) -> Where:
    suspect = fault.suspect
    kind, component = ("loop", "force") if suspect.kind == "loop" else ("sweep", "storage")
    excess = float(np.sqrt(fault.gain / max(fault.columns, 1)))
    reading = f"{suspect.words} departs by {number(100 * fault.size, 2)} % from what all other tests say"
    return Where(suspect.direction, kind, suspect.frequency, suspect.amplitude, component, excess, reading)


def _candidates(search: Search, kept: set[str]) -> list[Judged]:
    """Every effect of the library on the base model: score, refit, and why it won or lost."""
    tried = {candidate.name: candidate for candidate in search.first.tried}
    return [_judged(search, proposal, tried.get(proposal.name), kept) for proposal in search.first.proposed]


def _judged(search: Search, proposal: Proposal, candidate: Candidate | None, kept: set[str]) -> Judged:
    first, base = search.first, search.base
    if candidate is None or candidate.left:
        unseen = "score too small to refit" if proposal.visible else "not visible in these tests"
        why = "left on its way, far behind the best" if candidate else unseen
        return Judged(proposal.name, proposal.score, None, None, None, {}, why)
    evidence = candidate.evidence
    if proposal.name in kept:
        why = "kept"
    elif candidate.gain < first.critical:
        why = f"gain below {number(first.critical, 3)}, which chance alone can make"
    elif base.bic - evidence.bic < SAME:
        why = "gain below its price in parameters"
    else:
        why = f"{number(evidence.bic - min(c.evidence.bic for c in first.tried), 3)} behind the best by BIC"
    own = {name: value for name, value in evidence.model.values.items() if name not in base.model.values}
    held = hold_out(base, evidence).after
    return Judged(proposal.name, proposal.score, candidate.gain, base.bic - evidence.bic, held, own, why)


def _result(evidence: Evidence, bounds: Bounds) -> Result:
    """The model with its uncertainty; a parameter at rest on a bound counts as held there."""
    model, names = evidence.model, evidence.solution.coordinates.names
    moving = tuple(name for name in names if name not in evidence.solution.at_bound)
    cov = covariance(model, [Stage(moving, evidence.data_sets)])
    return Result(
        model,
        moving,
        cov,
        quality(model, evidence.data_sets, len(moving)),
        measured_range(model, evidence.data_sets),
        (
            *apart_in_temperature(evidence.data_sets),
            *cautions(model, evidence.solution, evidence.data_sets, bounds, cov),
        ),
        sources(evidence.data_sets),
        at_bound=evidence.solution.at_bound,
        tests=misfits(model, evidence.data_sets),
        usable=usable(evidence.solution, evidence.data_sets),
    )


def _notes(search: Search, after: Evidence) -> tuple[str, ...]:
    """What these tests could not show at all."""
    blind = [proposal.name for proposal in search.first.proposed if not proposal.visible]
    notes = [f"not identifiable from these tests: {', '.join(blind)}"] if blind else []
    _, sweeps = parted(after.data_sets)
    if sweeps and sweeps[0].noise.origin == "assumed":
        notes.append(
            "nothing was repeated at three points or more: "
            "errors shared by a run are assumed, 0.5 % gain and 0.25 deg phase"
        )
    return tuple(notes)
