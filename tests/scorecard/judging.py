"""Whether what diagnose says of a campaign is acceptable, by the keys of its diagnosis.json alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from lab_campaign import Answer

#: Verdicts under which names stay in the model.
_KEEPING = ("named", "partly")
#: What a correction without a name is called in the list of effects.
UNNAMED = "unnamed"
#: Names in a set at most, its leader among them, for the truth in it to count.
_LARGEST_SET = 4


class Judged(NamedTuple):
    """What an answer is worth.

    Args:
        acceptable: nothing wrong is said, and what is visible is told in some form.
        passed_over: what is visible is called consistent; of a clean campaign never.
        wrong_name: a name is kept that is not true, nor said to be a limit of a true one or equal to it.
        seen: the verdict is not "consistent"; of a clean campaign a false alarm.
        wrong_set: look-alikes are told, and the truth is not among them.
    """

    acceptable: bool
    passed_over: bool
    wrong_name: bool
    seen: bool
    wrong_set: bool


def acceptable(answer: Answer, diagnosis: Mapping[str, Any]) -> Judged:
    """Judge a diagnosis beside the truth.

    A name must be one of those that describe the kind truly. Where there is none, or beside it, a gap described or told
    unexplained is acceptable; so is a place at fault where the kind is off at such a place alone. What cannot be seen
    may be called consistent.
    """
    verdict = str(diagnosis["verdict"])
    claims = [_claim(effect) for effect in diagnosis["effects"] if effect["name"] != UNNAMED]
    kept = [claim for claim in claims if verdict in _KEEPING or (verdict == "ambiguous" and not claim.others)]
    sets = [claim for claim in claims if verdict == "ambiguous" and claim.others]
    wrong_name = any(not _true(answer, claim.names) for claim in kept)
    wrong_set = any(
        not _true(answer, (*claim.names, *claim.others)) or len(claim.others) >= _LARGEST_SET for claim in sets
    )
    seen = verdict != "consistent"
    passed_over = answer.visible and not seen
    false_alarm = seen and not answer.kind
    return Judged(not (wrong_name or wrong_set or passed_over or false_alarm), passed_over, wrong_name, seen, wrong_set)


class _Claim(NamedTuple):
    """Names that an effect goes by: its own and its twins; and what it cannot be told from."""

    names: tuple[str, ...]
    others: tuple[str, ...]


def _claim(effect: Mapping[str, Any]) -> _Claim:
    return _Claim((effect["name"], *effect.get("twins", ())), tuple(effect.get("alternatives", ())))


def _true(answer: Answer, names: Sequence[str]) -> bool:
    """Whether one of the names, or of a pair of names, tells the kind truly, or a place of its sort is among them."""
    parts = [part for name in names for part in name.split(" + ")]
    return any(part.partition(".")[0] in answer.right or part in answer.right for part in parts) or any(
        _is_place(answer, part) for part in parts
    )


#: Words by which a place at fault is told, after "fault: ".
_WORDS = {"frequency": " Hz", "level": "level", "repeat": "repeat", "loop": "loop", "direction": ""}


def _is_place(answer: Answer, name: str) -> bool:
    return name.startswith("fault") and any(_WORDS[place] in name for place in answer.place)
