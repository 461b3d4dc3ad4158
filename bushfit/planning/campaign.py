"""A plan on the virtual rig: the campaign that `bushfit simulate` runs, and whether the plan keeps what it promises.

Notes:
    For that it is simulated many times, and each campaign is fitted anew. What is simulated is all that a fit would
    see: noise that it has to estimate from the repeats, errors of runs and levels, start values read off the data.
    The fit is given the class of the rig only, which a campaign states too.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.special import chdtri
from threadpoolctl import threadpool_limits

from bushfit.campaign.schema import RigSettings, SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.campaign.toml import body_lines, place_line, toml_value
from bushfit.effects import BASE, qualified_name
from bushfit.effects.contract import Array
from bushfit.errors import FitError
from bushfit.fitting.coordinates import Coordinates
from bushfit.fitting.information import relative_sizes
from bushfit.fitting.prepared_campaign import PreparedCampaign
from bushfit.fitting.procedures import fit_joint
from bushfit.geometry import Specimen
from bushfit.planning.contract import Noise, Plan, Test
from bushfit.simulation.measured import measure
from bushfit.simulation.undisturbed import Undisturbed, undisturbed

#: Settings of [simulate] that are written as they are, in the order of the file.
_SETTINGS = (
    "seed", "noise", "force_noise", "force_correlation",
    "gain_error", "phase_error", "level_gain_error", "level_phase_error",
)  # fmt: skip
#: By key of [simulate] and its tests, the unit that a number is written with; the displacement's stands for None.
_UNITS: Mapping[str, str | None] = {
    "phase_error": "rad",
    "level_phase_error": "rad",
    "frequency": "Hz",
    "frequencies": "Hz",
    "amplitude": None,
    "amplitudes": None,
}
#: Of one campaign what was found less the truth, (k,); None where no fit was possible.
Found = Array | None
#: Does work(seeds) for parts of the seeds, in some order, and gives the number and the result of each.
Every = Callable[[Sequence[int], Callable[[int], Found]], Iterable[tuple[int, Found]]]


def settings_of(tests: Sequence[Test], noise: Noise, seed: int = 0) -> SimulateSettings:
    """Settings of the virtual rig for planned tests, each with as many repeats as the plan has runs of it.

    Notes:
        Rows of a loop are correlated as those of a filter with one time constant, AR(1) with r; n of them tell as much
        as n (1 - r)/(1 + r) independent ones.
    """
    counts = Counter(tests)
    return SimulateSettings(
        seed=seed,
        noise=float(np.sqrt(np.mean(np.square(noise.scatter)))),
        force_noise=noise.force,
        force_correlation=(noise.rows_as_one - 1.0) / (noise.rows_as_one + 1.0),
        gain_error=noise.shared[0],
        phase_error=noise.shared[1],
        level_gain_error=noise.level[0],
        level_phase_error=noise.level[1],
        loops=tuple(test for test in tests if isinstance(test, SimulatedLoop)),
        sweeps=tuple(replace(test, repeats=n) for test, n in counts.items() if isinstance(test, SimulatedSweep)),
    )


def campaign_toml(plan: Plan, seed: int = 0) -> str:
    """The planned tests as a campaign file for `bushfit simulate`."""
    knowledge, settings = plan.knowledge, settings_of(plan.planned.tests, plan.knowledge.noise, seed)
    tested = [test.direction for test in plan.planned.tests]
    lines = [
        "# Planned by bushfit plan; bushfit simulate makes these tests of the model below. No rubber was tested.",
        "# All repeats of a sweep follow each other here; the order on the rig is that of the sheet.",
        *body_lines(knowledge.model.bushing, dict.fromkeys(each for each in tested if isinstance(each, Specimen))),
        *("", "[simulate]", *(_line(key, getattr(settings, key)) for key in _SETTINGS)),
        *("", "[simulate.parameters]"),
    ]
    for record in knowledge.model.records:
        lines += [] if record.name in BASE else ["", f"[simulate.effects.{toml_value(record.name)}]"]
        for parameter in record.parameters:
            value = _number(knowledge.model.values[qualified_name(record, parameter)])
            text = value if parameter.unit == "1" else toml_value(f"{value} {parameter.unit}")
            lines.append(f"{parameter.name} = {text}")
    for kind, tests in (("loops", settings.loops), ("sweeps", settings.sweeps)):
        for test in tests:
            lines += ["", f"[[simulate.{kind}]]", place_line(test.direction)]
            for each in fields(test):  # what it states other than the default
                value = getattr(test, each.name)
                if each.name not in ("direction", "temperature") and value != each.default:
                    lines.append(_line(each.name, value, test))
    return "\n".join(lines) + "\n"


def _line(key: str, value: Any, test: Test | None = None) -> str:
    """One key with its value, which has a unit where the file wants one."""
    if key not in _UNITS:
        share = isinstance(value, float)
        return f"{key} = {toml_value(f'{_number(100.0 * value)} %') if share else toml_value(value)}"
    unit, factor = _UNITS[key], 1.0
    if unit is None and test:
        unit, factor = test.direction.display.displacement
    values: Iterable[float] = value if isinstance(value, tuple) else (value,)
    texts = [toml_value(f"{_number(factor * each)} {unit}") for each in values]
    return f"{key} = [{', '.join(texts)}]" if isinstance(value, tuple) else f"{key} = {texts[0]}"


def _number(value: float) -> str:
    """A number to twelve digits, in which no rounding of a unit is left."""
    return f"{value:.12g}"


@dataclass(frozen=True, eq=False)
class Check:
    """Standard errors of relative changes of k parameters: those promised, and those that simulated campaigns show.

    Args:
        names: of the parameters.
        predicted: by the plan, (k,).
        deviations: found less true values of each campaign, relative, (campaigns, k).
        failed: campaigns that could not be fitted.
        seed: of the first campaign; the others count on.
    """

    names: tuple[str, ...]
    predicted: Array
    deviations: Array
    failed: int
    seed: int

    @property
    def found(self) -> Array:
        """Standard deviation of what the campaigns show about the truth, (k,)."""
        return np.sqrt(np.mean(np.square(self.deviations), axis=0))

    @property
    def interval(self) -> tuple[Array, Array]:
        """95 % interval of each standard error found, (k,) each: of n campaigns, n found^2 / chi-square of n."""
        n = len(self.deviations)
        low, high = (self.found * np.sqrt(n / chdtri(n, p)) for p in (0.025, 0.975))
        return low, high


def check(plan: Plan, count: int, seed: int, every: Every) -> Check:
    """Simulate and fit a plan `count` times.

    A plan that adds to tests of a campaign is simulated with those, as it will be fitted with them.

    Args:
        seed: of the first campaign; the others count on.
        every: gives work(seed) of each seed with its number, in any order: as `batch.executor.run_rows` on all cores.

    Raises:
        FitError: none of the campaigns could be fitted.
    """
    knowledge = plan.knowledge
    settings = settings_of((*knowledge.tests, *plan.planned.tests), knowledge.noise)
    work = partial(_fit_one, undisturbed(knowledge.model, settings), settings, plan.wanted.rig, knowledge.names)
    found = dict(every(range(seed, seed + count), work))
    fitted = [row for _, row in sorted(found.items()) if row is not None]
    if not fitted:
        raise FitError("no simulated campaign of this plan could be fitted", found=f"{count} campaigns")
    predicted = plan.planned.errors if knowledge.tests else plan.planned.alone
    return Check(knowledge.names, predicted, np.array(fitted), count - len(fitted), seed)


def _fit_one(
    clean: Undisturbed, settings: SimulateSettings, rig: RigSettings, names: Sequence[str], seed: int
) -> Found:
    """Relative errors of the parameters that are fitted to one simulated campaign; None without a fit."""
    truth = clean.truth
    coordinates, sizes = Coordinates.of_parameters(truth, names), relative_sizes(truth, names)
    with threadpool_limits(1), suppress(FitError):
        campaign = replace(measure(clean, replace(settings, seed=seed)).campaign(), rig=rig)
        data = PreparedCampaign.from_campaign(campaign)
        places = list(dict.fromkeys(str(data_set.direction) for data_set in data.data_sets))
        model = fit_joint(data, effects=truth.effects, directions=places).model
        return np.asarray((coordinates.point(model.values) - coordinates.point(truth.values)) / sizes)
    return None
