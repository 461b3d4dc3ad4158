"""Does a plan keep what it promises? It is simulated many times on the virtual rig, and each campaign is fitted anew.

Notes:
    What is simulated is all that a fit would see: noise that it has to estimate from the repeats, errors of runs and
    levels, start values read off the data. Nothing is told to the fit but the rig's class, which a campaign states too.
"""

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import chdtri
from threadpoolctl import threadpool_limits

from bushfit.campaign.schema import RigSettings, SimulateSettings
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.coordinates import Coordinates
from bushfit.fitting.data import Data
from bushfit.fitting.information import relative_sizes
from bushfit.fitting.procedures import fit_joint
from bushfit.planning.campaign import settings_of
from bushfit.planning.contract import Plan
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import Undisturbed, undisturbed

#: Of one campaign what was found less the truth, (k,); None where no fit was possible.
Found = Array | None
#: Does work(seeds) for parts of the seeds, in some order, and gives the number and the result of each.
Every = Callable[[Sequence[int], Callable[[Sequence[int]], list[Found]]], Iterable[tuple[int, Found]]]


@dataclass(frozen=True, eq=False)
class Check:
    """Standard errors of relative changes of k parameters: those promised, and those that simulated campaigns show.

    Args:
        names: of the parameters.
        predicted: by the plan, (k,).
        off: found less true values of each campaign, relative, (campaigns, k).
        failed: campaigns that could not be fitted.
        seed: of the first campaign; the others count on.
    """

    names: tuple[str, ...]
    predicted: Array
    off: Array
    failed: int
    seed: int

    @property
    def found(self) -> Array:
        """Standard deviation of what the campaigns show about the truth, (k,)."""
        return np.sqrt(np.mean(np.square(self.off), axis=0))

    @property
    def interval(self) -> tuple[Array, Array]:
        """95 % interval of each standard error found, (k,) each: of n campaigns, n found^2 / chi-square of n."""
        n = len(self.off)
        low, high = (self.found * np.sqrt(n / chdtri(n, p)) for p in (0.025, 0.975))
        return low, high


def check(plan: Plan, count: int, seed: int, every: Every) -> Check:
    """Simulate and fit a plan `count` times.

    A plan that adds to tests of a campaign is simulated with those, as it will be fitted with them.

    Args:
        seed: of the first campaign; the others count on.
        every: gives work(seeds) of parts of the seeds, each with its number: as `batch.pool.run` does on all cores.

    Raises:
        FitError: none of the campaigns could be fitted.
    """
    known = plan.knowledge
    settings = settings_of((*known.tests, *plan.planned.tests), known.noise)
    work = partial(_several, undisturbed(known.model, settings), settings, plan.wanted.rig, known.names)
    found = dict(every(range(seed, seed + count), work))
    fitted = [row for _, row in sorted(found.items()) if row is not None]
    if not fitted:
        raise FitError("no simulated campaign of this plan could be fitted", found=f"{count} campaigns")
    predicted = plan.planned.errors if known.tests else plan.planned.alone
    return Check(known.names, predicted, np.array(fitted), count - len(fitted), seed)


def _several(
    clean: Undisturbed, settings: SimulateSettings, rig: RigSettings, names: Sequence[str], seeds: Sequence[int]
) -> list[Found]:
    """Of each seed the parameters found less the true ones, relative; None without a fit."""
    truth, found = clean.truth, list[Found]()
    coordinates, sizes = Coordinates.of(truth, names), relative_sizes(truth, names)
    with threadpool_limits(1):
        for seed in seeds:
            campaign = replace(measure(clean, replace(settings, seed=seed)).campaign(), rig=rig)
            with suppress(FitError):
                data = Data.of(campaign)
                places = list(dict.fromkeys(str(data_set.direction) for data_set in data.data_sets))
                model = fit_joint(data, effects=truth.effects, directions=places).model
                found.append((coordinates.point(model.values) - coordinates.point(truth.values)) / sizes)
                continue
            found.append(None)
    return found
