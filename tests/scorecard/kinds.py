"""What a kind of discrepancy is made for and of: by a bench, what changes in rig, rubber, software or record.

Kinds that a library of laws lists stand in listed_kinds.py, mistakes in files in mistaken_records.py, and kinds that no
page of bushfit lists in rig_faults.py. All but mistakes are brought to one of three sizes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from time_rig import Array, Change, Complex, Response, Rubber, Tests, projected, respond

#: Shares of |K| to which a kind is brought: hardly seen, plain, gross.
SIZES = (0.015, 0.04, 0.10)
#: Tries in which its amount is found, and how near is near enough (logarithm of the ratio).
_TRIES, _NEAR = 14, 0.05

Place = Literal["level", "frequency", "repeat", "loop", "direction"]
Mask = NDArray[np.bool_]
Rows = NDArray[np.int_]
#: What changes by an amount, which is about the share of |K| that changes at most.
Sized = Callable[[float], Change]


@dataclass(frozen=True)
class Bench:
    """What a kind is made for: the tests, the rubber, and draws that are its own."""

    tests: Tests
    rubber: Rubber
    random: Generator

    @cached_property
    def clean(self) -> Response:
        return respond(self.tests, self.rubber)

    @cached_property
    def size(self) -> Array:
        """|K| of every point [N/m]."""
        return np.abs(self.clean.stiffness)

    @property
    def sweeps(self) -> Mask:
        return ~self.tests.loop

    @property
    def steps(self) -> Array:
        return np.unique(self.tests.frequency[self.sweeps])

    @property
    def force(self) -> float:
        """Middle of the force amplitudes of the sweeps [N]."""
        return float(np.median((self.size * self.tests.amplitude)[self.sweeps]))

    def direction(self) -> int:
        """A direction that has sweeps."""
        return int(self.random.choice(np.unique(self.tests.direction[self.sweeps])))

    def level(self, least: int = 0) -> Mask:
        """The points of one level of one direction, all repeats of it; least is the lowest that may be."""
        mine = self.sweeps & (self.tests.direction == self.direction())
        levels = np.unique(self.tests.level[mine])
        return mine & (self.tests.level == self.random.choice(levels[min(least, levels.size - 1) :]))

    def runs_of_a_level(self) -> list[Rows]:
        chosen = self.level()
        return [rows for rows in self.tests.runs() if chosen[rows].all()]

    def strain(self) -> float:
        """A strain that the largest of the sweeps pass, and the smallest do not."""
        strains = (self.tests.strain[:, 0] * self.tests.amplitude)[self.sweeps]
        return float(self.random.uniform(0.35, 0.65) * strains.max())

    def sign(self) -> float:
        return float(self.random.choice([-1.0, 1.0]))


Made = Callable[[Bench], Sized]


@dataclass(frozen=True)
class Kind:
    """A kind of discrepancy, and what may be said of it.

    Args:
        sentence: what happened.
        made: by a bench, what changes by an amount.
        right: effects of the library that describe it truly; a family, such as "stiffness_factor", is all its places.
        place: parts of the tests that alone are off.
        needs: what the tests must have.
        form: columns of the sweeps' files, 0 for loss factor, 1 for phase, 2 for storage and loss; None for any.
        in_sizes: False for a mistake that is made or not made.
    """

    sentence: str
    made: Made
    right: tuple[str, ...] = ()
    place: tuple[Place, ...] = ()
    needs: tuple[Literal["both", "loop", "repeats"], ...] = ()
    form: int | None = None
    in_sizes: bool = True

    @classmethod
    def into(cls, kinds: dict[str, Kind], sentence: str, **said: Any) -> Callable[[Made], Made]:
        """A decorator of how a kind is made, which puts the kind under that name among others."""

        def register(made: Made) -> Made:
            kinds[made.__name__] = cls(sentence, made, **said)
            return made

        return register


def gain(factor: Array) -> Change:
    """The force of each point times a factor, (n,)."""
    return Change(force=lambda _, force: force * factor[:, None])


def read(factor: Array | Complex) -> Change:
    """What the software makes of each sweep's point times a factor, (n,)."""
    return Change(reading=lambda motion, force: projected(motion, force) * factor)


def reordered(runs: Sequence[Rows], order: Callable[[int], Rows]) -> Change:
    """The stiffness of some runs with its rows in another order, by their number."""

    def record(stiffness: Complex) -> Complex:
        made = stiffness.copy()
        for rows in runs:
            made[rows] = stiffness[rows[order(rows.size)]]
        return made

    return Change(record=record)


def largest(bench: Bench, response: Response, change: Change) -> float:
    """Largest difference of a noise-free record from the clean one, of |K|."""
    stiffness = change.record(response.stiffness)
    return float(np.max(np.abs(stiffness - bench.clean.stiffness) / bench.size))


def sized(bench: Bench, kind: Kind, size: float) -> Change:
    """The kind, brought as near to a size as it comes: one that goes in steps may not reach it."""
    by, amount = kind.made(bench), size
    if not kind.in_sizes:
        return by(amount)
    best, off = by(amount), np.inf
    for _ in range(_TRIES):
        change = by(amount)
        ratio = np.log(max(largest(bench, respond(bench.tests, bench.rubber, change), change), 1e-12) / size)
        if abs(ratio) < off:
            best, off = change, abs(ratio)
        if off < _NEAR:
            break
        amount *= float(np.exp(-np.clip(ratio, -2.0, 2.0)))
    return best
