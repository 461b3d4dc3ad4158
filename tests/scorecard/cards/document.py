"""What a score card writes as JSON, key by key: scorecard.json, and the lines of outcomes.jsonl.

Their JSON Schemas are made of these types, and the type checker holds to them what is written.
"""

from typing import Literal

from typing_extensions import TypedDict

from cards.card import Row
from cards.families import Family
from cards.outcome import Outcome


class Asked(TypedDict):
    """What a score card is made of: the first line of outcomes.jsonl, and part of scorecard.json.

    Args:
        schema: of this file.
        version: of bushfit that made it.
        families: of hidden campaigns.
        campaigns: how many of each family.
        seed: of everything random.
        session: hours of the session that is planned, and simulated, where effects are left open; null for none.
    """

    schema: Literal["bushfit/scorecard/2"]
    version: str
    families: list[str]
    campaigns: int
    seed: int
    session: float | None


class Scorecard(Asked):
    """How often diagnose is right on hidden campaigns.

    Args:
        card: the measures of each family, with their targets.
        confusion: of each family: by what was hidden, how often which verdict with which names was given.
        outcomes: every campaign.
    """

    card: dict[Family, list[Row]]
    confusion: dict[Family, dict[str, dict[str, int]]]
    outcomes: list[Outcome]


#: A line of outcomes.jsonl: the first says what was asked for, each other is an outcome.
Line = Asked | Outcome
