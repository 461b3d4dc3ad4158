"""Candidate refits: the best proposals fitted together with all parameters of the model, side by side.

A refit that cannot come near the best, or comes nearer too slowly, is stopped before its end.
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass

import numpy as np

from bushfit.diagnosis.evidence import EVALUATIONS, Evidence, fit_from
from bushfit.diagnosis.propose import Proposal, stroke
from bushfit.effects import effect_named, qualified
from bushfit.errors import FitError, ModelError
from bushfit.fitting.data_sets import DataSet
from bushfit.fitting.descent import Descent
from bushfit.fitting.solve import Bounds

#: Chi-square beyond that of the best at which a candidate is excluded without asking what the tests could tell.
EXCLUDED = 60.0
#: Fall of chi-square that a fit may yet make, over the fall that a linear model expects: chosen.
_MOST_FALL = 4.0
#: Evaluations of the model before which a refit is stopped only where it would have to fall by so many times what a
#: linear model expects; chosen: of 259 refits that came near the best in the end none had to fall by more than 2.8
#: times, but one that at first saw no way down at all.
_FIRST_EVALUATIONS, _MOST_FALL_AT_FIRST = 4, 8.0
#: Fall of chi-square that a linear model has to expect for it to tell a way down.
_SEES_A_WAY = 1.0
#: Evaluations of the model that the best refit may take: where it stops short, the next effect makes up for it.
_TO_ITS_END = 100
#: Share of what the best refit is above the noise that `_PACE` evaluations have to take off it; chosen: less decides
#: nothing.
_HARDLY = 1e-3
#: Evaluations before which a refit goes on where its proposal claimed to come near the best.
_CLAIM_HOLDS = 12
#: Every so many evaluations a refit is asked how far it came since the last time; and the share of what it is still
#: behind that it has to have come, where its proposal claimed less; chosen: at less it would take forty more.
_PACE, _LEAST_PACE = 6, 0.15
#: Of the pace of one that came near, so many times which has to bring it to the best before its evaluations are used
#: up; chosen: one that creeps along a bent valley may come to a better stretch.
_SPEEDS_UP = 2.0
#: Chi-square behind the best at which a candidate may still be as good by BIC: the margin and the price of a parameter.
_AS_GOOD = 12.0


@dataclass(frozen=True, eq=False)
class Candidate:
    """One effect refitted together with everything else, and what it took off chi-square.

    `left` tells that the fit was stopped before its end, far behind the best. One that came near and crept is stopped
    as well, where nothing depends on its last digits.
    """

    name: str
    evidence: Evidence
    gain: float
    left: bool = False


def refits(
    evidence: Evidence,
    proposed: Sequence[Proposal],
    known: Sequence[Candidate],
    starts: Mapping[str, Mapping[str, float]],
    held: Sequence[str],
    bounds: Bounds,
    near: Mapping[str, float] | None = None,
) -> list[Candidate]:
    """Fit proposals until they converge or cannot come near the best; with the candidates known already, best first.

    The best is then taken to its end, where it is not far behind one that is known.

    Args:
        evidence, proposed: the fitted model without the effects, and the effects to fit.
        known: candidates that need no fit.
        starts: by name of a proposal values to start from.
        held, bounds: parameters that do not move, and limits inside the parameters' own.
        near: values of the model to start from for all others, where that promises more than the proposal's own.
    """
    fits: dict[str, Descent] = {}
    for proposal in proposed:
        limits = {**_within_stroke(evidence.data_sets, proposal.name), **bounds}
        with suppress(FitError, ModelError):  # no response with this effect: no candidate
            fits[proposal.name] = _begun(evidence, proposal, starts.get(proposal.name), near, held, limits)
    claimed = {proposal.name: evidence.chi_square - proposal.score for proposal in proposed}
    least = min((candidate.evidence.chi_square for candidate in known), default=np.inf)
    fits = raced(fits, claimed, least)
    first = min(fits, key=lambda name: fits[name].chi_square, default="")
    nearest = min(least, *(fit.chi_square for fit in fits.values())) if fits else least
    left = {name for name, fit in fits.items() if not _ended(fit) and fit.chi_square > nearest + EXCLUDED}
    if first and fits[first].chi_square < least + EXCLUDED:
        fits[first] = near_its_end(fits[first], evidence.residual.size, _HARDLY, _TO_ITS_END)
    refitted = [
        Candidate(name, Evidence(fit.solution, evidence.data_sets), evidence.chi_square - fit.chi_square, name in left)
        for name, fit in fits.items()
    ]
    return sorted([*known, *refitted], key=lambda candidate: candidate.evidence.bic)


def _begun(
    evidence: Evidence,
    proposal: Proposal,
    start: Mapping[str, float] | None,
    near: Mapping[str, float] | None,
    held: Sequence[str],
    limits: Bounds,
) -> Descent:
    """A refit before its first step: from its start, or else from what is near, where it has a response there and that
    promises more than its proposal."""

    def at(values: Mapping[str, float]) -> Descent:
        known = {name: value for name, value in values.items() if name in proposal.model.values}
        return fit_from(proposal.model.with_values(known), evidence.data_sets, held, limits)

    if near and not start:
        with suppress(FitError, ModelError):
            fit = at(near)
            if fit.chi_square - fit.expected_fall <= evidence.chi_square - proposal.score:
                return fit
    return at(start or {})


def raced(fits: Mapping[str, Descent], claimed: Mapping[str, float], least: float) -> dict[str, Descent]:
    """All fits step by step, until each has ended, or cannot come near the best or a chi-square that is known, or comes
    nearer too slowly though it never claimed to come near, or came near and is too slow to be as good.

    Args:
        claimed: the chi-square that each proposal promised.
        least: of what is known.
    """
    fits, running, before, rounds = {**fits}, [*fits], dict[str, float](), 0
    while running:
        for name in running:
            fits[name] = fits[name].stepped()
        least, rounds = min(least, *(fits[name].chi_square for name in running)), rounds + 1
        goal = least + EXCLUDED
        running = [name for name in running if can_reach(fits[name], goal, claimed[name])]
        if rounds % _PACE == 0:
            came = {name: before.get(name, np.inf) - fits[name].chi_square for name in running}
            running = [name for name in running if _keeps_pace(fits[name], came[name], least, claimed[name])]
            before = {name: fits[name].chi_square for name in running}
    return fits


def _keeps_pace(fit: Descent, came: float, least: float, claimed: float) -> bool:
    """Whether a fit that came so far down in `_PACE` evaluations may yet come near the best, and there as near as to be
    as good."""
    goal = least + EXCLUDED
    if fit.chi_square > goal:
        return came > _LEAST_PACE * (fit.chi_square - goal) or claimed < goal
    return fit.chi_square - _SPEEDS_UP * came * (EVALUATIONS - fit.evaluations) / _PACE <= least + _AS_GOOD


def near_its_end(fit: Descent, floor: float, share: float, evaluations: int = EVALUATIONS) -> Descent:
    """The fit at its end, after so many evaluations, or where it hardly comes down: by less than a share of what it is
    above a floor of chi-square."""
    while fit.chi_square > floor and not fit.converged and fit.evaluations < evaluations:
        before = fit.chi_square
        fit = fit.finished(min(fit.evaluations + _PACE, evaluations))
        if 0.0 < before - fit.chi_square < share * (before - floor):
            return fit
    return fit.finished(evaluations)


def can_reach(fit: Descent, goal: float, claimed: float = np.inf) -> bool:
    """Whether a fit that goes on may yet bring chi-square below a goal; what its proposal claimed counts at first."""
    if _ended(fit):
        return False
    if fit.evaluations == 1 or (fit.evaluations < _CLAIM_HOLDS and claimed < goal):
        return True
    early, expected = fit.evaluations < _FIRST_EVALUATIONS, fit.expected_fall
    most = _MOST_FALL_AT_FIRST if early else _MOST_FALL
    return fit.chi_square - most * expected < goal or (early and expected < _SEES_A_WAY)


def comes_below(fit: Descent, goal: float) -> bool:
    """Whether a fit from where it once ended, or was left, comes below a chi-square; it is left where it cannot."""
    while not _ended(fit) and fit.chi_square - _MOST_FALL * fit.expected_fall < goal <= fit.chi_square:
        fit = fit.stepped()
    return fit.chi_square < goal


def _ended(fit: Descent) -> bool:
    return fit.converged or fit.evaluations >= EVALUATIONS


def _within_stroke(data_sets: Sequence[DataSet], name: str) -> Bounds:
    """Limits of an effect's displacements [m] to what the tests can show: a stop that is always met is no stop."""
    effect = effect_named(name)
    scaled = [parameter for parameter in effect.parameters if parameter.scale == "displacement"]
    return {qualified(effect, parameter): stroke(data_sets) for parameter in scaled}
