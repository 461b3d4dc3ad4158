"""The families of a score card: which kinds of campaigns each has, and how a campaign of a kind is made.

Notes:
    Seeds from `CARD_SEEDS` on are kept for cards that are shown. Whatever is tried or tuned takes those below: a
    workflow that was tuned on the campaigns of its card would be judged by what it had seen.
"""

from collections.abc import Mapping
from typing import Literal, get_args

import numpy as np

from bushfit.effects.mistakes import MISTAKES
from bushfit.simulation.measured import Simulated
from cards.awkward import AWKWARD
from cards.faults import FAULTS
from cards.hidden import FIRST, Sealed, hidden_campaign, hideable
from cards.mistaken import mistaken_campaign
from cards.outcome import Task
from cards.outside import OUTSIDE_LAWS
from cards.recipe import Recipe, cooked

#: What is hidden in the campaigns of a card.
Family = Literal["effects", "mistakes", "awkward", "faults", "outside", "library"]
#: Every family, in the order of the card.
FAMILIES: tuple[Family, ...] = get_args(Family)
#: The first seed of cards that are shown; chosen.
CARD_SEEDS = 77000
#: Shares of the kinds of campaigns in a card, by its family.
KINDS: dict[Family, dict[str, float]] = {
    "effects": {"single": 0.5, "clean": 0.2, "pair": 0.1, "outside": 0.1, "lacking": 0.1},
    "mistakes": {"mistake": 0.4, "clean": 0.6},
    "awkward": {"awkward": 1.0},
    "faults": {"fault": 1.0},
    "outside": {"law": 0.9, "three": 0.1},
    "library": {"alone": 0.5, "two": 0.5},
}
#: Of the faults of rigs and of the laws outside the library, those of the family `effects`.
DISTURBANCES = ("narrow_resonance", "mislabelled_level", "velocity_weakening_slip")
#: Recipes of the kinds that are made by one.
RECIPES: dict[str, Mapping[str, Recipe]] = {
    "awkward": AWKWARD,
    "fault": FAULTS,
    "law": OUTSIDE_LAWS,
    "outside": {name: (FAULTS | OUTSIDE_LAWS)[name] for name in DISTURBANCES},
}
#: Effects that are hidden at once, of the kinds that hide several.
_AT_ONCE = {"pair": 2, "two": 2, "three": 3}
#: Least and largest size of what stays visible in the family `library`: from a fifth of what counts as visible to ten
#: times it.
_FROM_INVISIBLE = (0.004, 0.2)


def tasks(count: int, seed: int, family: Family = "effects") -> list[Task]:
    """A balanced card: what a kind has in turn, or drawn at random where it has several at once; the same seed the
    same."""
    random = np.random.default_rng(seed)
    made: list[Task] = []
    for kind, share in KINDS[family].items():
        names = _names(kind)
        for number in range(max(1, round(share * count))):
            own = int(random.integers(2**31))
            name, outside = names[number % len(names)] if names else "", ""
            hidden: tuple[str, ...] = ()
            if kind in _AT_ONCE:
                hidden = tuple(random.choice(names, _AT_ONCE[kind], replace=False).tolist())
            elif kind in RECIPES:
                outside = name
            elif name:
                hidden = (name,)
            made.append(Task(kind, own, hidden, outside, hidden if kind == "lacking" else ()))
    return made


def _names(kind: str) -> list[str]:
    """What is hidden in campaigns of a kind in turn, or drawn from; nothing in clean ones."""
    if kind in RECIPES:
        return list(RECIPES[kind])
    if kind in ("alone", "two"):
        return hideable()
    return {"mistake": list(MISTAKES), "clean": []}.get(kind, list(FIRST))


def campaign_of(task: Task) -> tuple[Simulated, Sealed]:
    """The campaign of a task, and its truth."""
    if task.kind in RECIPES:
        return cooked(RECIPES[task.kind][task.outside], task.seed)
    if task.kind == "mistake":
        return mistaken_campaign(task.seed, task.hidden[0])
    if task.kind in ("alone", "two"):
        return hidden_campaign(task.seed, task.hidden, visible=_FROM_INVISIBLE)
    return hidden_campaign(task.seed, task.hidden)
