"""A plan as a campaign that `bushfit simulate` runs: its tests, the errors of the rig, and the model."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from bushfit.campaign.schema import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.campaign.toml import body_lines, place_line, toml_value
from bushfit.effects import BASE, qualified
from bushfit.geometry import Specimen
from bushfit.model.model import Model
from bushfit.planning.contract import Noise, Plan, Test

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


def settings_of(tests: Sequence[Test], noise: Noise, seed: int = 0) -> SimulateSettings:
    """What the virtual rig does for a plan: each test once, with as many repeats as it stands in the plan.

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
    known, settings = plan.knowledge, settings_of(plan.planned.tests, plan.knowledge.noise, seed)
    tested = [test.direction for test in plan.planned.tests]
    lines = [
        "# Planned by bushfit plan; bushfit simulate makes these tests of the model below. No rubber was tested.",
        "# All repeats of a sweep follow each other here; the order on the rig is that of the sheet.",
        *body_lines(known.model.bushing, dict.fromkeys(each for each in tested if isinstance(each, Specimen))),
        *("", "[simulate]", *(_line(key, getattr(settings, key)) for key in _SETTINGS)),
        *_model_lines(known.model),
    ]
    for kind, tests in (("loops", settings.loops), ("sweeps", settings.sweeps)):
        for test in tests:
            lines += ["", f"[[simulate.{kind}]]", *_test_lines(test)]
    return "\n".join(lines) + "\n"


def _model_lines(model: Model) -> Iterator[str]:
    """The lines of [simulate.parameters] and of each added effect, in SI."""
    yield from ("", "[simulate.parameters]")
    for record in model.records:
        if record.name not in BASE:
            yield from ("", f"[simulate.effects.{toml_value(record.name)}]")
        for parameter in record.parameters:
            value = _number(model.values[qualified(record, parameter)])
            yield f"{parameter.name} = {value if parameter.unit == '1' else toml_value(f'{value} {parameter.unit}')}"


def _test_lines(test: Test) -> Iterator[str]:
    """The lines of one test: what it states other than the default."""
    yield place_line(test.direction)
    for each in fields(test):
        value = getattr(test, each.name)
        if each.name not in ("direction", "temperature") and value != each.default:
            yield _line(each.name, value, test)


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
