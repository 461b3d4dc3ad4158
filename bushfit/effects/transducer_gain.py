"""Transducer gain: the load cell used at one place, or the amplifier behind it, is off by one factor."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import stiffness_factor
from bushfit.effects.contract import Family, Level, Parameter

FAMILY = Family(
    replace(
        stiffness_factor.FAMILY.record,
        name="transducer_gain",
        sentence="The load cell of the {place} tests, or its amplifier, is off by one factor.",
        level=Level.INSTRUMENT,
        parameters=(
            Parameter("factor", "1", (0.6, 1.4), 1.0, 0.05, meaning="recorded over true force in {place} tests"),
        ),
        source="sensitivity error of a force transducer, ISO 376:2011",
        confirmed_by="swap the load cell, or hang a known weight on it",
        twins=(),
    )
)
