"""From what the search found to a verdict, in the order in which a careful engineer doubts it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bushfit.diagnosis.again import searched_again
from bushfit.diagnosis.described import describe
from bushfit.diagnosis.document import Description, Verdict
from bushfit.diagnosis.evidence import Evidence, fit, result_of
from bushfit.diagnosis.faults import Fault
from bushfit.diagnosis.form import other_form
from bushfit.diagnosis.holdout import HoldOut, hold_out
from bushfit.diagnosis.leads import leads
from bushfit.diagnosis.locate import contrasts, largest_smooth_misfit, locate
from bushfit.diagnosis.next_test import deciding_test
from bushfit.diagnosis.propose import Proposal
from bushfit.diagnosis.record import Diagnosis, Judged, Named, Where
from bushfit.diagnosis.refit import Candidate
from bushfit.diagnosis.score_test import PATTERN_LEFT, ScoreTest
from bushfit.diagnosis.search import CHANCE_LEVEL, SAME, Search, Step
from bushfit.effects import effect_named, effect_of, qualified
from bushfit.effects.unnamed import NAME as UNNAMED
from bushfit.fitting.data_sets import parted
from bushfit.units import number

#: Held-out gap, in units of noise, up to which little is left (`partly`): chosen, wrong names leave more.
_PARTLY = 1.15
#: Share of the tolerance that a remainder may have beside a name: more may be another effect that the name bends to.
_BESIDE_A_NAME = 0.25
#: Share of all that is smooth in the residuals that may stay beside a fault for it to be all there is: chosen, a wrong
#: level leaves up to a third, physics that one level shows best a half and more.
_BESIDE_A_FAULT = 0.4
#: Faults that no physics makes: a level or a loop that stands out may be what a wrong name leaves.
_NO_PHYSICS = ("frequency", "repeat", "row")
#: Parts without which another name comes out, from which on a single name is doubted: one may do so by chance. Of
#: several effects one part is enough: wrong ones are mostly added several at a time.
_ELSEWHERE = 2
#: Share of the parts without which a name has to come out again, more than this: of 64 simulated campaigns right ones
#: did in four of seven or more, a wrong one in three of six.
_STANDS = 0.5
#: What is said where there is no gap.
_NOTHING = "nothing is missing beyond noise and tolerance"
#: What is said of a gap without a name.
_NO_NAME = "a real gap stays that no known effect closes"
#: Names in one set at most, for it to be a finding: more than three tell an engineer nothing.
_LARGEST_SET = 3


@dataclass(frozen=True)
class Remainder:
    """A real gap that stays: its words, and the fault that explains it, if one does."""

    words: str
    fault: Fault | None


def judge(search: Search, final: Evidence, added: Sequence[str]) -> Diagnosis:
    """Doubt the finding: a fault instead, look-alikes, held-out data, what remains, the same name found again."""
    base = search.base
    if not added:
        trace = search.trace()
        remainder = find_remainder(search, trace.evidence if trace else base)
        if remainder is None:
            return consistent(search)
        return unexplained(search, remainder.words, fault=remainder.fault)
    fault = worst_fault(search, base)
    worth = base.bic - final.bic
    if fault and fault.worth > worth + SAME:
        return unexplained(search, _fault_words(fault), fault=fault)
    if fault and fault.worth > worth - SAME:
        either = (f"fault: {fault.suspect.words}",)
        leaders = [replace(_named(step), alternatives=either) for step in search.steps(final, added)]
        words = f"{_all(added)}, or a fault of the measurement: {fault.suspect.words}"
        return finish(search, "ambiguous", f"these tests cannot tell {words}", base, leaders, fault=fault)
    if beyond := _at_bound(final, added):
        words = f"{_closing(added)} the gap only with {beyond} at the edge of what is possible"
        return unexplained(search, words, added)
    remainder = find_remainder(search, final, _BESIDE_A_NAME)
    gross = remainder and not remainder.fault and largest_smooth_misfit(final) > search.settings.tolerance
    if remainder and gross and find_remainder(search, base):
        return unexplained(search, remainder.words, added)  # whatever held-out tests would say
    held = hold_out(base, final, search.bounds)
    if not held.passed:
        words = f"{_closing(added)} the gap only where fitted, so the name is taken back"
        if find_remainder(search, base):
            return unexplained(search, words, added)
        return finish(search, "consistent", f"{_NOTHING}; {words}", base, ())
    steps = search.steps(final, added)
    if bent := _bent(final, steps):
        words = f"these tests show {bent} with another dependence on frequency and amplitude than its law has"
        return unexplained(search, words, added)
    if remainder and (gross or not _is_little(remainder, held)):
        return unexplained(search, remainder.words, added, fault=remainder.fault)
    names = [_named(step) for step in steps]
    again = searched_again(search, final, steps, held)
    counted = (sum(each.came_again for each in again), len(again)) if again else None
    others = sorted({other for each in again for other in each.others})
    if sum(bool(each.others) for each in again) >= (_ELSEWHERE if len(steps) == 1 else 1):
        return _another_name(search, names, others, counted)
    if any(step.rivals for step in steps):
        return _ambiguous(search, final, steps, names, counted)
    if counted and counted[0] <= _STANDS * counted[1]:
        words = f"without a part of the tests {_all(added)} seldom comes out again"
        return unexplained(search, words, added, again=counted)
    untested = _untested(held, steps)
    if untested and any(step.gain < step.place.critical + SAME for step in steps):
        return unexplained(search, f"{_closing(added)} the gap by little{untested}", added, again=counted)
    words = f"{_closing(added)} {'part of the gap; ' + remainder.words if remainder else 'the gap'}{untested}"
    verdict: Verdict = "partly" if remainder else "named"
    fault = remainder.fault if remainder else None
    return finish(search, verdict, words, final, names, fault=fault, held=held, again=counted)


def _bent(final: Evidence, steps: Sequence[Step]) -> str | None:
    """An effect that the tests show with another form than its law has, with all that cannot be told from it."""
    bent = other_form(final, [step.name for step in steps], CHANCE_LEVEL)
    rivals = [rival for step in steps if step.name == bent for rival in step.rivals]
    every = all(other_form(rival.evidence, [rival.name], CHANCE_LEVEL) for rival in rivals)
    return bent if every else None


def _is_little(remainder: Remainder, held: HoldOut) -> bool:
    """Whether a name may stand beside what remains, within the tolerance or a fault that no physics makes."""
    little = held.after is not None and held.after <= _PARTLY
    return little and (remainder.fault is None or remainder.fault.suspect.kind in _NO_PHYSICS)


def unexplained(
    search: Search,
    words: str,
    added: Sequence[str] = (),
    *,
    fault: Fault | None = None,
    again: tuple[int, int] | None = None,
) -> Diagnosis:
    """The finding that a real gap stays, described where it can be: effects that shrink the gap are leads only.

    Where it cannot, the model stays as it was.
    """
    lead = leads(search)
    if added and not lead:
        lead = f"; no more than a lead: {_all(added)}"
    alone = fault and fault.suspect.kind != "frequency" and _share_beside(search.base, fault) < _BESIDE_A_FAULT
    alone = alone or not search.settings.max_effects  # then nothing is to be added, without a name either
    start, held, bounds = search.start, search.held, search.bounds
    if alone or not (found := describe(search.base, CHANCE_LEVEL, start, held, bounds)):
        return finish(search, "unexplained", words + lead, search.base, (), fault=fault, again=again)
    told = "" if words == _NO_NAME else f"; {words}"
    said = f"{_NO_NAME}: {found.size}; {found.words}{told}{lead}"
    names, out, about = [Named(UNNAMED, found.evidence)], found.correction.held, found.description
    return finish(search, "described", said, found.after, names, fault=fault, held=out, description=about, again=again)


def _share_beside(evidence: Evidence, fault: Fault) -> float:
    """The share of all that is smooth in the residuals that stays beside a fault."""
    columns, solution = contrasts(evidence), evidence.solution
    freed = replace(solution, jacobian=np.concatenate((solution.jacobian, fault.suspect.columns)))
    tests = [
        ScoreTest(each, columns, [np.arange(len(columns))], PATTERN_LEFT)
        for each in (evidence, replace(evidence, solution=freed))
    ]
    every, rest = (max(test.gains()[0] - test.sizes[0], 1.0) for test in tests)  # less what noise makes
    return rest / every


def _another_name(
    search: Search,
    names: Sequence[Named],
    others: Sequence[str],
    again: tuple[int, int] | None,
) -> Diagnosis:
    """The finding where another name comes out without some part: a set of look-alikes, or no name."""
    added = [name.name for name in names]
    words = f"without some of the tests {' or '.join(others)} comes out in place of {_all(added)}"
    alternatives = tuple(dict.fromkeys((*names[0].alternatives, *others)))
    if len(names) > 1 or len(alternatives) >= _LARGEST_SET:
        return unexplained(search, words, added, again=again)
    doubtful = [replace(names[0], alternatives=alternatives)]
    return finish(search, "ambiguous", words, search.base, doubtful, again=again)


def _untested(held: HoldOut, steps: Sequence[Step]) -> str:
    """What hold-out could not show of the effects that were added, in words."""
    if held.after is None:
        return "; nothing can be held out of these tests, so it stands on the fit alone"
    own = {step.name for step in steps}
    open_parts = [skipped.part for skipped in held.skipped if own & set(skipped.effects)]
    return (
        f"; what shows it ({', '.join(open_parts)}) cannot be held out, and no part held out is that one"
        if open_parts
        else ""
    )


def _at_bound(final: Evidence, added: Sequence[str]) -> str | None:
    """The amount of an added effect that came to rest on a bound: what is missing is then another thing."""
    amounts = {qualified(effect, effect.amount) for effect in map(effect_named, added)}
    return next((name for name in final.solution.at_bound if name in amounts), None)


def _ambiguous(
    search: Search,
    final: Evidence,
    steps: Sequence[Step],
    names: Sequence[Named],
    again: tuple[int, int] | None,
) -> Diagnosis:
    """Keep what is certain; leave out what has look-alikes.

    More than three that close the gap alike are listed all the same, as leads: that nothing closes it would be wrong.
    """
    model = search.base.model
    for step in steps:
        if not step.rivals:
            own = {key: value for key, value in final.model.values.items() if effect_of(key) == step.name}
            model = model.with_effect(step.name, own)
    kept = search.base if model is search.base.model else fit(model, final.data_sets, search.held, search.bounds)
    sets = "; ".join(f"{name.name} from {' or '.join(name.alternatives)}" for name in names if name.alternatives)
    rivals = [[final.model, *(rival.evidence.model for rival in step.rivals)] for step in steps if step.rivals]
    words = f"these tests cannot tell {sets}"
    if any(len(name.alternatives) >= _LARGEST_SET for name in names):
        words += "; so many names are no more than leads"
    advice = deciding_test(rivals[0], final.data_sets)
    return finish(search, "ambiguous", words, kept, names, next_test=advice, again=again)


def consistent(search: Search) -> Diagnosis:
    """The finding that nothing is missing, once that stands; what stays below the tolerance is said."""
    trace = search.trace()
    words = _NOTHING + (f"; what there is of {trace.name} stays below the tolerance" if trace else "")
    return finish(search, "consistent", words, search.base, ())


def is_consistent(search: Search) -> bool:
    """Whether nothing is missing beyond noise and tolerance."""
    trace = search.trace()
    return not search.matters and find_remainder(search, trace.evidence if trace else search.base) is None


def find_remainder(search: Search, evidence: Evidence, share: float = 1.0) -> Remainder | None:
    """What is left beyond noise and tolerance: a fault at one place, repeats that disagree by more than a rig makes, or
    something smooth beyond a share of it."""
    fault = worst_fault(search, evidence)
    if fault:
        return Remainder(_fault_words(fault), fault)
    for sweep in parted(evidence.data_sets)[1]:
        if sweep.name in sweep.noise.beyond:
            return Remainder(f"{sweep.name}: {sweep.noise.beyond[sweep.name]}", None)
    columns = contrasts(evidence)
    smooth = ScoreTest(evidence, columns, [np.arange(len(columns))], PATTERN_LEFT)
    if (
        smooth.gains()[0] > smooth.largest_by_chance(CHANCE_LEVEL)
        and largest_smooth_misfit(evidence) > share * search.settings.tolerance
    ):
        return Remainder(_NO_NAME, None)
    return None


def worst_fault(search: Search, evidence: Evidence) -> Fault | None:
    """The worthiest of the faults that are larger than the tolerance and more than chance and their price.

    Where few levels tell the errors of levels, chance has no end: a level that is off by more than a rig of the class
    makes it then has to be more than chance were these errors known.
    """
    told = search.faults(evidence)

    def is_real(fault: Fault) -> bool:
        of_no_rig = fault.suspect.kind == "level" and fault.size > search.most_of_level
        return fault.gain > (told.chance_of_known if of_no_rig else told.chance)

    large = (fault for fault in told.places if fault.size >= search.settings.tolerance)
    real = (fault for fault in large if fault.worth >= SAME and is_real(fault))
    return max(real, key=lambda fault: fault.worth, default=None)


def _fault_words(fault: Fault) -> str:
    return f"{fault.suspect.words} stands out from all other tests: measure it again before looking for physics"


def _closing(added: Sequence[str]) -> str:
    return f"{_all(added)} {'closes' if len(added) == 1 else 'close'}"


def _all(added: Sequence[str]) -> str:
    return " and ".join(added)


def _named(step: Step) -> Named:
    """The effect of a step, with its gain and how far the next best is behind in words."""
    words = f"takes {step.gain:.0f} off chi-square"
    tried = step.place.tried
    if tried and tried[0].name == step.name:
        others, bic = [rival for rival in tried[1:] if not rival.left], tried[0].evidence.bic
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
    held: HoldOut | None = None,
    description: Description | None = None,
    again: tuple[int, int] | None = None,
) -> Diagnosis:
    """The whole finding, once the verdict stands; what was held out is held out here where it was not yet.

    Args:
        again: in how many parts, and of how many, what was added came out again, whether it was believed or not.
    """
    base = search.base
    told = {*base.model.effects} - {*search.settings.unresolved}
    if not next_test and effects:
        next_test = effect_named(effects[0].name).confirmed_by
    where = (*([_fault_where(fault)] if fault else []), *locate(base))
    return Diagnosis(
        verdict,
        summary,
        tuple(effects),
        where,
        where if after is base else locate(after),
        replace(held or hold_out(base, after, search.bounds), name_again=again),
        f"measure again: {fault.suspect.words}" if fault else next_test,
        tuple(_candidates(search, {named.name for named in effects})),
        base,
        after,
        result_of(after, search.bounds, told),
        _notes(search),
        description,
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
    held = hold_out(evidence, evidence, search.bounds).after
    return Judged(proposal.name, proposal.score, candidate.gain, base.bic - evidence.bic, held, own, why)


def _notes(search: Search) -> tuple[str, ...]:
    """What these tests could not show at all."""
    unseen = [proposal.name for proposal in search.first.proposed if not proposal.visible]
    blind = [name for name in unseen if not effect_named(name).under]  # what no test states is not asked for
    return (f"not identifiable from these tests: {', '.join(blind)}",) if blind else ()
