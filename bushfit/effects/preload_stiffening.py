"""Preload stiffening: a preload at one place, which other tests do not have, stiffens all alike by one factor."""

from __future__ import annotations

from dataclasses import replace

from bushfit.effects import stiffness_factor
from bushfit.effects.contract import Family, Parameter

FAMILY = Family(
    replace(
        stiffness_factor.FAMILY.record,
        name="preload_stiffening",
        sentence="A preload of the {place} tests makes them stiffer (or softer) by one factor than without it.",
        parameters=(
            Parameter("factor", "1", (0.6, 1.4), 1.0, 0.05, meaning="stiffness of {place} under preload over without"),
        ),
        source="small motion on a large one: K. N. Morman, J. C. Nagtegaal, Int. J. Numer. Meth. Eng. 19 (1983) 1079",
        confirmed_by="repeat the test at two other preloads: the factor must follow",
        twins=(),
    )
)
