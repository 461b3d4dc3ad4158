"""[compound]: what is known of a rubber before it is tested: its hardness, its polymer, its filler."""

import re
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from bushfit.errors import CampaignError, UnitError
from bushfit.validation import converted, text

#: Polymers whose density is known, by the names that rubber engineers use; NR is natural rubber.
Polymer = Literal["natural", "SBR", "EPDM", "NBR", "CR", "IIR"]
#: Hardness between which Gent's relation is used [Shore A]: outside of it a durometer hardly tells rubbers apart.
_HARDNESS = (20.0, 90.0)
#: Carbon black at most [phr]: more is not mixed into rubber that is to move.
_MOST_FILLER = 120.0


def hardness(raw: object) -> float:
    """The number of a text such as "61 Shore A".

    Raises:
        UnitError: no such text.
        CampaignError: a hardness for which Gent's relation does not hold.
    """
    found = _number(raw, r"sh(?:ore)?\.?\s*a", "a hardness", '"61 Shore A"')
    if not _HARDNESS[0] <= found <= _HARDNESS[1]:
        expected = f"{_HARDNESS[0]:g} to {_HARDNESS[1]:g} Shore A"
        raise CampaignError("no modulus follows from this hardness", found=str(raw), expected=expected)
    return found


def filler(raw: object) -> float:
    """The carbon black per hundred parts of rubber of a text such as "27 phr", or "27 phr carbon black".

    Raises:
        UnitError: no such text.
        CampaignError: more filler than there is in bushings.
    """
    found = _number(raw, r"phr(?:\s+(?:of\s+)?carbon[\s-]black)?", "a filler", '"27 phr", of carbon black')
    if found > _MOST_FILLER:
        raise CampaignError("impossible filler", found=str(raw), expected=f"0 to {_MOST_FILLER:g} phr of carbon black")
    return found


def _number(raw: object, unit: str, what: str, expected: str) -> float:
    """The number before a unit that pint does not know."""
    match = re.fullmatch(rf"\s*(\d{{1,4}}(?:\.\d{{1,6}})?)\s*(?:{unit})\s*", str(raw), re.ASCII | re.IGNORECASE)
    if not (isinstance(raw, str) and match):
        raise UnitError(f"this is not {what}", found=str(raw), expected=expected)
    return float(match[1])


def _written(read: Any, example: str) -> Any:
    return converted(lambda raw, _: read(raw), text(f"such as {example}"))


@dataclass(frozen=True)
class Compound:
    """[compound]: a rubber that was not tested yet, for `bushfit plan`.

    Args:
        hardness: [Shore A].
        filler: carbon black, parts by weight per hundred of rubber [phr].
        rubber: the polymer.
    """

    hardness: Annotated[float, _written(hardness, '"61 Shore A"')]
    filler: Annotated[float, _written(filler, '"27 phr"')]
    rubber: Polymer = "natural"
