"""What a gap figure shows: how far measurement and model are apart, in units of noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import numpy as np

from bushfit.effects.contract import Array
from bushfit.fitting.terms import LoopTerm, SweepTerm, Term
from bushfit.geometry import Direction
from bushfit.model import Model
from bushfit.plots.points import Repeats, over_sectors

_T = TypeVar("_T", SweepTerm, LoopTerm)


class Map(NamedTuple):
    """Measured less model at each operating point of a direction, over the noise of its mean."""

    points: Repeats
    storage: Array
    loss: Array


class Curve(NamedTuple):
    """Measured less model over the cycle of a loop [deg], over the noise of a sector's mean."""

    phase: Array
    values: Array


class Side(NamedTuple):
    """A column: a model's title and all that is drawn of it."""

    title: str
    gap: float
    maps: Mapping[Direction, Map]
    loops: Mapping[Direction, Sequence[Curve]]


def by_direction(terms: Sequence[_T]) -> dict[Direction, list[_T]]:
    """In the order of the tests."""
    directions = dict.fromkeys(term.direction for term in terms)
    return {direction: [term for term in terms if term.direction is direction] for direction in directions}


def columns(before: Model, after: Model, terms: Sequence[Term]) -> list[tuple[Model, str]]:
    """What stands side by side, and its title: one model where both respond alike."""
    if all(np.array_equal(term.residual(before), term.residual(after)) for term in terms):
        return [(before, "nothing added")]
    added = [name for name in after.effects if name not in before.effects]
    return [(before, "before"), (after, f"after adding {' and '.join(added)}" if added else "after")]


def side_of(
    model: Model,
    name: str,
    terms: Sequence[Term],
    sweeps: Mapping[Direction, Sequence[SweepTerm]],
    loops: Mapping[Direction, Sequence[LoopTerm]],
) -> Side:
    """A model against all tests."""
    gap = float(np.sqrt(np.mean(np.square(np.concatenate([term.residual(model) for term in terms])))))
    return Side(
        name,
        gap,
        {direction: _map(model, mine) for direction, mine in sweeps.items()},
        {direction: [_curve(model, term) for term in mine] for direction, mine in loops.items()},
    )


def _map(model: Model, terms: Sequence[SweepTerm]) -> Map:
    """Repeats differ by what scatters from point to point and by what each block shares: both average out."""
    points = Repeats.of(terms)
    deviation = -np.concatenate([term.deviation(model) for term in terms])
    noise = np.array([term.noise.random[term.name, float(x)] for term in terms for x in term.amplitude])
    shared = np.array([term.noise.shared for term in terms for _ in term.amplitude])
    variance = np.square(noise) + np.square(shared)
    storage, loss = (
        points.summed(part) / np.sqrt(points.summed(square))
        for part, square in zip((deviation.real, deviation.imag), variance.T, strict=True)
    )
    return Map(points, storage, loss)


def _curve(model: Model, term: LoopTerm) -> Curve:
    phase, mean, count = over_sectors(term, -term.residual(model))
    return Curve(phase, mean * np.sqrt(count))


def has_holes(drawn: Map) -> bool:
    """Whether a level lacks a frequency that another has."""
    points = drawn.points
    return points.frequency.size < np.unique(points.frequency).size * np.unique(points.amplitude).size
