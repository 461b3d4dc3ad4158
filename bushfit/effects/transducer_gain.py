"""Transducer gain: the load cell used at one place, or the amplifier behind it, is off by one factor."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

from bushfit.effects import stiffness_factor
from bushfit.effects.contract import Effect, Family, Level, Parameter
from bushfit.geometry import Direction


@lru_cache
def of_place(place: str) -> Effect:
    """The effect of one place: a direction of the bushing, or a specimen by its name."""
    return replace(
        stiffness_factor.of_place(place),
        name=f"transducer_gain.{place}",
        sentence=f"The load cell of the {place} tests, or its amplifier, is off by one factor.",
        level=Level.INSTRUMENT,
        parameters=(
            Parameter("factor", "1", (0.6, 1.4), 1.0, 0.05, meaning=f"recorded over true force in {place} tests"),
        ),
        source="sensitivity error of a force transducer, ISO 376:2011",
        confirmed_by="swap the load cell, or hang a known weight on it",
        twins=(),
    )


FAMILY = Family("transducer_gain", of_place)
EFFECT = of_place(Direction.RADIAL.value)
