"""Elastic preload: a preload at one place, which other tests do not have, stiffens what is elastic, and no loss."""

from __future__ import annotations

from functools import lru_cache, partial

from bushfit.effects.contract import Condition, Family, Level, Modifier, Parameter, Value, Values, scaled_values
from bushfit.geometry import Direction


def adjust(place: str, p: Values, condition: Condition) -> dict[str, Value]:
    """mu times the factor at the place."""
    return scaled_values(p, ("mu",), p["factor"]) if str(condition.setting.direction) == place else {}


@lru_cache
def elastic_preload(place: str) -> Modifier:
    """The effect of one place: a direction of the bushing, or a specimen by its name."""
    return Modifier(
        name=f"elastic_preload.{place}",
        sentence=f"A preload of the {place} tests makes the elastic branch alone stiffer, or softer: losses stay.",
        equation=f"factor mu, {place} only",
        level=Level.COMPONENT,
        parameters=(
            Parameter("factor", "1", (0.4, 2.0), 1.0, 0.05, meaning=f"mu of {place} under preload over without"),
        ),
        source="small motion about a static stretch: L. R. G. Treloar, The Physics of Rubber Elasticity, 1975, ch. 11",
        confirmed_by="repeat the test at two other preloads: the factor must follow, and the loss stiffness must not",
        adjust=partial(adjust, place),
    )


FAMILY = Family("elastic_preload", elastic_preload)
EFFECT = elastic_preload(Direction.RADIAL.value)
