"""A plan on the virtual rig: the campaign that `bushfit simulate` runs, and a check of the predicted errors.

Notes:
    The check simulates the plan many times and fits each campaign. The fit estimates the noise from the repeats and its
    start values from the data, as for a measured campaign; it receives only the class of the rig.
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
#: Unit of each number in [simulate] and its tests, by key; None for the unit of the displacement.
_UNITS: Mapping[str, str | None] = {
    "phase_error": "rad",
    "level_phase_error": "rad",
    "frequency": "Hz",
    "frequencies": "Hz",
    "amplitude": None,
    "amplitudes": None,
}
#: Relative errors of the k parameters fitted to one simulated campaign, (k,); None if no fit was possible.
RelativeErrors = Array | None
#: Calls a function for all seeds in any order; returns the number and the result of each.
SeedRunner = Callable[[Sequence[int], Callable[[int], RelativeErrors]], Iterable[tuple[int, RelativeErrors]]]


def settings_of(tests: Sequence[Test], noise: Noise, seed: int = 0) -> SimulateSettings:
    """Convert planned tests to the settings of `bushfit simulate`; repeated sweeps become one sweep with repeats.

    Args:
        tests: runs of the plan.
        noise: measurement errors of the rig.
        seed: seed of the random numbers.

    Returns:
        Settings of the table [simulate].

    Notes:
        The rows of a loop are correlated like the output of a first-order filter, AR(1) with coefficient r: n rows
        have the information of n (1 - r)/(1 + r) independent rows.
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
    """Write the planned tests as a campaign file for `bushfit simulate`.

    Args:
        plan: planned tests, and the model that the simulation uses.
        seed: seed of the random numbers.

    Returns:
        Text of the TOML file.
    """
    knowledge, settings = plan.knowledge, settings_of(plan.planned.tests, plan.knowledge.noise, seed)
    tested = [test.direction for test in plan.planned.tests]
    lines = [
        "# Planned by bushfit plan; bushfit simulate computes these tests from the model below. No rubber was tested.",
        "# All repeats of a sweep follow each other here; the order on the rig is that of the sheet.",
        *body_lines(knowledge.model.bushing, dict.fromkeys(place for place in tested if isinstance(place, Specimen))),
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
            for key in fields(test):  # values other than the default
                value = getattr(test, key.name)
                if key.name not in ("direction", "temperature") and value != key.default:
                    lines.append(_line(key.name, value, test))
    return "\n".join(lines) + "\n"


def _line(key: str, value: Any, test: Test | None = None) -> str:
    """Write one TOML line of a campaign file, with a unit if the key needs one.

    Args:
        key: key of the line.
        value: value in SI.
        test: test whose direction or specimen gives the unit of an amplitude; None if the value is no amplitude.
    """
    if key not in _UNITS:
        share = isinstance(value, float)
        return f"{key} = {toml_value(f'{_number(100.0 * value)} %') if share else toml_value(value)}"
    unit, factor = _UNITS[key], 1.0
    if unit is None and test:
        unit, factor = test.direction.display.displacement
    values: Iterable[float] = value if isinstance(value, tuple) else (value,)
    texts = [toml_value(f"{_number(factor * number)} {unit}") for number in values]
    return f"{key} = [{', '.join(texts)}]" if isinstance(value, tuple) else f"{key} = {texts[0]}"


def _number(value: float) -> str:
    """Format a number with twelve digits, which hides the rounding errors of unit conversions."""
    return f"{value:.12g}"


@dataclass(frozen=True, eq=False)
class Check:
    """Comparison of the standard errors that a plan predicts with the scatter of fits to simulated campaigns.

    Args:
        names: names of the k parameters.
        predicted: relative standard error of each parameter from the plan, (k,).
        deviations: relative deviation of the fitted from the true parameters in each campaign, (campaigns, k).
        failed: number of campaigns that could not be fitted.
        seed: seed of the first campaign; each further campaign has the next integer.
    """

    names: tuple[str, ...]
    predicted: Array
    deviations: Array
    failed: int
    seed: int

    @property
    def observed(self) -> Array:
        """Observed standard errors: root mean square relative deviation of fitted from true parameters, (k,)."""
        return np.sqrt(np.mean(np.square(self.deviations), axis=0))

    @property
    def interval(self) -> tuple[Array, Array]:
        """Lower and upper ends of the 95 % interval of each observed standard error, (k,) each.

        Notes: observed * sqrt(n / chi-square quantile with n degrees of freedom), for n campaigns.
        """
        n = len(self.deviations)
        low, high = (self.observed * np.sqrt(n / chdtri(n, p)) for p in (0.025, 0.975))
        return low, high


def check(plan: Plan, count: int, seed: int, run_all: SeedRunner) -> Check:
    """Simulate a plan several times and fit each simulated campaign, to check the predicted standard errors.

    A plan that continues a campaign is simulated with the tests of the campaign, because all tests are fitted together.

    Args:
        plan: plan to simulate.
        count: number of simulated campaigns.
        seed: seed of the first campaign; each further campaign has the next integer.
        run_all: function that calls a function for all seeds, such as `batch.executor.run_rows` on all cores.

    Returns:
        Predicted and observed standard errors.

    Raises:
        FitError: none of the campaigns could be fitted.
    """
    knowledge = plan.knowledge
    settings = settings_of((*knowledge.tests, *plan.planned.tests), knowledge.noise)
    work = partial(fit_campaign, undisturbed(knowledge.model, settings), settings, plan.request.rig, knowledge.names)
    errors = [row for _, row in sorted(run_all(range(seed, seed + count), work), key=lambda pair: pair[0])]
    fitted = [row for row in errors if row is not None]
    if not fitted:
        raise FitError("no simulated campaign of this plan could be fitted", found=f"{count} campaigns")
    predicted = plan.planned.errors if knowledge.tests else plan.planned.alone
    return Check(knowledge.names, predicted, np.array(fitted), count - len(fitted), seed)


def fit_campaign(
    clean: Undisturbed, settings: SimulateSettings, rig: RigSettings, names: Sequence[str], seed: int
) -> RelativeErrors:
    """Simulate one campaign and fit it.

    Args:
        clean: simulated tests without noise.
        settings: settings of the virtual rig, with its noise.
        rig: settings [rig] that the fit receives, with the class of the rig.
        names: names of the k parameters to compare.
        seed: seed of the random numbers.

    Returns:
        Relative deviations of the fitted from the true parameters, (k,); None if no fit was possible.
    """
    truth = clean.truth
    coordinates, sizes = Coordinates.of_parameters(truth, names), relative_sizes(truth, names)
    with threadpool_limits(1), suppress(FitError):
        campaign = replace(measure(clean, replace(settings, seed=seed)).campaign(), rig=rig)
        data = PreparedCampaign.from_campaign(campaign)
        places = list(dict.fromkeys(str(data_set.direction) for data_set in data.data_sets))
        model = fit_joint(data, effects=truth.effects, directions=places).model
        return np.asarray((coordinates.point(model.values) - coordinates.point(truth.values)) / sizes)
    return None
