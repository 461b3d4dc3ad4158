"""Elastic preload: a preload at one place, which other tests do not have, stiffens what is elastic, and no loss."""

from __future__ import annotations

from bushfit.effects.contract import Condition, Family, Level, Modifier, Parameter, Value, Values, scaled_values


def adjust(p: Values, condition: Condition) -> dict[str, Value]:
    """mu times the factor."""
    return scaled_values(p, ("mu",), p["factor"])


FAMILY = Family(
    Modifier(
        name="elastic_preload",
        sentence="A preload of the {place} tests makes the elastic branch alone stiffer, or softer: losses stay.",
        equation="factor mu, {place} only",
        level=Level.COMPONENT,
        parameters=(
            Parameter("factor", "1", (0.4, 2.0), 1.0, 0.05, meaning="mu of {place} under preload over without"),
        ),
        source="small motion about a static stretch: L. R. G. Treloar, The Physics of Rubber Elasticity, 1975, ch. 11",
        confirmed_by="repeat the test at two other preloads: the factor must follow, and the loss stiffness must not",
        adjust=adjust,
    )
)
