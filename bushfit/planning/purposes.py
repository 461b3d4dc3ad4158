"""What each planned test is for: what would be lost without it, of what is wanted or of what the model may lack."""

import numpy as np

from bushfit.effects.contract import Array
from bushfit.planning.contract import Test
from bushfit.planning.criterion import noncentrality_of
from bushfit.planning.offer import Offer
from bushfit.planning.targets import percent
from bushfit.units import number

#: What a test has to be worth of an error, or of an amount found, to be made for its sake; chosen.
_WORTH_SAYING = 1.005
#: From which growth on the amount found without a test is no amount that a bushing or a rig could have.
_UNSEEN = 100.0


def purposes(offer: Offer, least: Array, counts: Array) -> dict[Test, str]:
    """In words, of each test with all its repeats, what would be lost without it: first of the targets that would be
    missed, else of effects."""
    found = {}
    for test in np.flatnonzero(counts).tolist():
        without = np.where(np.arange(counts.size) == test, 0, counts)
        repeated = "its repeats show how points scatter, and a drift" if counts[test] > 1 else "a little of all"
        aim, effects = _lost_of_aim(offer, counts, without), _lost_of_effects(offer, least, counts, without)
        spare = offer.goals and all(goal.met(offer.off(without)) for goal in offer.goals)
        found[offer.tests[test]] = (effects or aim if spare else aim or effects) or repeated
    return found


def _lost_of_aim(offer: Offer, counts: Array, without: Array) -> str | None:
    """What fewer runs lose of what is wanted, the worst of it; None of next to nothing."""
    off, less = offer.off(counts), offer.off(without)
    if offer.wanted.aim == "rivals":
        apart, closer = (float(offer.apart(runs, offer.tellable).min()) for runs in (counts, without))
        far = f"rivals {number(closer, 2)} apart in expected chi-square without it, {number(apart, 2)} with it"
        return far if closer * _WORTH_SAYING <= apart else None
    if offer.goals:
        lost = [goal for goal in offer.goals if goal.half(less) >= _WORTH_SAYING * goal.half(off)]
        lost.sort(key=lambda goal: goal.half(less) / goal.target.half)
        halves = [
            f"{goal.target}: {percent(goal.half(less), 3)} without it, {percent(goal.half(off), 3)} with it"
            for goal in lost[-1:]
        ]
        return next(iter(halves), None)
    errors = [np.sqrt(np.diag(each)) for each in (off, less)]
    growths = dict(zip(offer.known.names, errors[1] / errors[0], strict=False))
    if offer.wanted.aim == "predictions":
        growths = {"stiffness": float(np.sqrt(np.sum(less * offer.weight) / np.sum(off * offer.weight)))}
    growth, name = max((growths[name], name) for name in growths if name in ("stiffness", *offer.wanted.parameters))
    larger = f"{name}: error {number(100.0 * (growth - 1.0), 2)} % larger without it"
    return larger if growth >= _WORTH_SAYING else None


def _lost_of_effects(offer: Offer, least: Array, counts: Array, without: Array) -> str | None:
    """Which effect that the model may lack shows less with fewer runs, the worst of all; None of next to nothing."""
    asked = least > 0.0
    reached, less = (noncentrality_of(offer.views[0].together(runs))[0, asked] for runs in (counts, without))
    if not asked.any():
        return None
    shares = np.sqrt(np.maximum(reached, 1e-12) / np.maximum(less, 1e-12 * np.maximum(reached, 1.0)))  # finite
    worst = int(np.argmax(shares))
    name, growth = offer.columns[int(np.flatnonzero(asked)[worst])].effect.name, float(shares[worst])
    more = f"{number(100.0 * (growth - 1.0), 2)} % larger" if growth < _UNSEEN else "beyond all use"
    return f"{name}: smallest amount found {more} without it" if growth >= _WORTH_SAYING else None
