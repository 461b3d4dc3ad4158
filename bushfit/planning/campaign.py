"""Campaign file of a plan, with which `bushfit simulate` computes the planned tests."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.campaign.toml import body_lines, place_lines, toml_value
from bushfit.effects import BASE, qualified_name
from bushfit.geometry import Specimen
from bushfit.planning.contract import Noise, Plan, Test

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


def simulation_settings(tests: Sequence[Test], noise: Noise) -> SimulateSettings:
    """Convert planned tests to the settings of `bushfit simulate`.

    Args:
        tests: runs of the plan; equal sweeps become one sweep with repeats.
        noise: measurement errors of the rig.

    Returns:
        Settings of the table [simulate].

    Notes:
        The rows of a loop are correlated like the output of a first-order filter, AR(1) with coefficient r: n rows
        have the information of n (1 - r)/(1 + r) independent rows.
    """
    counts = Counter(tests)
    return SimulateSettings(
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


def campaign_toml(plan: Plan) -> str:
    """Format the planned tests as a campaign file in TOML for `bushfit simulate`, with the model of the plan."""
    knowledge, settings = plan.knowledge, simulation_settings(plan.planned.tests, plan.knowledge.noise)
    tested = [test.direction for test in plan.planned.tests]
    lines = [
        "# Planned by bushfit plan; bushfit simulate computes these tests from the model below. No rubber was tested.",
        "# All repeats of a sweep follow each other here; the order on the rig is that of the sheet.",
        *body_lines(knowledge.model.bushing, dict.fromkeys(place for place in tested if isinstance(place, Specimen))),
        *("", "[simulate]", *(_toml_line(key, getattr(settings, key)) for key in _SETTINGS)),
        *("", "[simulate.parameters]"),
    ]
    for record in knowledge.model.records:
        lines += [] if record.name in BASE else ["", f"[simulate.effects.{toml_value(record.name)}]"]
        for parameter in record.parameters:
            value = _twelve_digits(knowledge.model.values[qualified_name(record, parameter)])
            text = value if parameter.unit == "1" else toml_value(f"{value} {parameter.unit}")
            lines.append(f"{parameter.name} = {text}")
    for kind, tests in (("loops", settings.loops), ("sweeps", settings.sweeps)):
        for test in tests:
            lines += ["", f"[[simulate.{kind}]]", *place_lines(test.direction)]
            for key in fields(test):  # values other than the default
                value = getattr(test, key.name)
                if key.name not in ("direction", "temperature") and value != key.default:
                    lines.append(_toml_line(key.name, value, test))
    return "\n".join(lines) + "\n"


def _toml_line(key: str, value: Any, test: Test | None = None) -> str:
    """Format one line of a campaign file, with a unit if the key needs one.

    Args:
        key: key of the line.
        value: value in SI.
        test: test whose direction or specimen gives the unit of an amplitude; None if the value is no amplitude.
    """
    if key not in _UNITS:
        share = isinstance(value, float)
        return f"{key} = {toml_value(f'{_twelve_digits(100.0 * value)} %') if share else toml_value(value)}"
    unit, factor = _UNITS[key], 1.0
    if unit is None and test:
        unit, factor = test.direction.display.displacement
    values: Iterable[float] = value if isinstance(value, tuple) else (value,)
    texts = [toml_value(f"{_twelve_digits(factor * number)} {unit}") for number in values]
    return f"{key} = [{', '.join(texts)}]" if isinstance(value, tuple) else f"{key} = {texts[0]}"


def _twelve_digits(value: float) -> str:
    """Format a number with twelve digits, which hides the rounding errors of unit conversions."""
    return f"{value:.12g}"
