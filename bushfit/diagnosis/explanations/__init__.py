"""Explanations of a gap: each kind proposes its own members, as columns with a prior."""

from bushfit.diagnosis.explanations.compound import compound
from bushfit.diagnosis.explanations.contract import Explanation, FaultyPlace, MissingEffect, is_pattern
from bushfit.diagnosis.explanations.effects import effects
from bushfit.diagnosis.explanations.meeting import Meeting, meetings
from bushfit.diagnosis.explanations.places import places
from bushfit.diagnosis.explanations.unnamed import unnamed

__all__ = [
    "Explanation",
    "FaultyPlace",
    "Meeting",
    "MissingEffect",
    "compound",
    "effects",
    "is_pattern",
    "meetings",
    "places",
    "unnamed",
]
