"""How the campaigns of a family are made: a random bushing on the rig, and what a recipe changes about it.

A recipe may change the plan of the tests, what the rig does in time around the model, and what was measured. The rig
alone makes the data; the closed forms that fits use never do.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator

from bushfit.campaign.schema import SimulateSettings
from bushfit.effects.contract import UNKNOWN, Array, ForceBelow, RubberConditions, Setting
from bushfit.effects.history import History
from bushfit.geometry import Direction, Place
from bushfit.model.model import Kind, Model
from bushfit.simulation.measured import Simulated, measure
from bushfit.simulation.undisturbed import undisturbed
from cards.hidden import STEPS, Sealed, plan_of, random_bushing

#: Force [N] over time of a motion that the rig imposes, by the model's own force and the test.
Around = Callable[[ForceBelow, History, Setting], Array]
#: Least and largest size of what is wrong, relative to |K|: hardly seen to plain.
_SIZE = (0.02, 0.12)
#: Frequency in the middle of a sweep [Hz], at which sizes are meant.
MIDDLE = 80.0


@dataclass(frozen=True, eq=False)
class Rigged(Model):
    """A model on a rig that does what no model here does: its force over time is `around` that of the model."""

    around: Around = lambda below, history, _: below(history)

    def force(
        self,
        direction: Place | str,
        displacement: History,
        *,
        kind: Kind = "sweep",
        values: Any = None,
        conditions: RubberConditions = UNKNOWN,
    ) -> Array:
        """The force that the rig records, as of `Model`."""
        place = Direction(direction) if isinstance(direction, str) else direction
        below = partial(super().force, place, kind=kind, values=values, conditions=conditions)
        return self.around(below, displacement, Setting(self.bushing, place, kind, conditions))


@dataclass(frozen=True)
class Bench:
    """A random bushing and the plan of its tests; `size` of what is wrong, relative to |K|."""

    bushing: Model
    plan: SimulateSettings
    size: float
    random: Generator

    def between(self, low: float, high: float) -> float:
        """A random number, even in its logarithm."""
        return float(np.exp(self.random.uniform(np.log(low), np.log(high))))

    def levels(self, direction: Place = Direction.AXIAL) -> Array:
        """Amplitudes [m] of the sweep of a direction, (levels,)."""
        return np.array(next(test.amplitudes for test in self.plan.sweeps if test.direction == direction))

    def stiffness(self, direction: Place = Direction.AXIAL) -> float:
        """|K| [N/m] of the plain bushing at the middle level and frequency: what sizes are relative to."""
        return float(abs(self.bushing.stiffness(direction, MIDDLE, float(np.median(self.levels(direction))))))


@dataclass(frozen=True)
class Recipe:
    """One kind of campaign.

    Args:
        sentence: what is done, for the reader of a card.
        truths: names that say it, of other levels, too; a family that is no effect itself stands for all its places.
        plan: the tests, by the bench with the plan of any campaign.
        rig: what the rig does around the model.
        file: what was written, by what was measured.
    """

    sentence: str
    truths: tuple[str, ...] = ()
    plan: Callable[[Bench], SimulateSettings] = lambda bench: bench.plan
    rig: Callable[[Bench], Around] | None = None
    file: Callable[[Simulated, Bench], Simulated] = lambda measured, _: measured


def cooked(recipe: Recipe, seed: int) -> tuple[Simulated, Sealed]:
    """One campaign of a recipe; the same seed makes the same, and all recipes start from the same bushing."""
    random = np.random.default_rng([seed, 23])
    plain = random_bushing(random)
    bench = Bench(plain, plan_of(plain, random, seed), float(np.exp(random.uniform(*np.log(_SIZE)))), random)
    bench = replace(bench, plan=recipe.plan(bench))
    own = plain.bushing, plain.effects, plain.values
    rigged = plain if recipe.rig is None else Rigged(*own, around=recipe.rig(bench))
    clean = replace(undisturbed(rigged, bench.plan, steps_per_cycle=STEPS), truth=plain)
    measured = recipe.file(measure(clean, bench.plan), bench)
    sealed = Sealed(recipe.truths, dict(plain.values), bench.size, bench.plan.gain_error > 0.0, seed)
    return measured, sealed
