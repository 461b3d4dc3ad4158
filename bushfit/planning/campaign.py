"""Campaign file of a plan, with which `bushfit simulate` computes the planned tests."""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import fields, replace
from typing import Any

import numpy as np

from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.campaign.toml import body_lines, place_lines, toml_value
from bushfit.effects import BASE, qualified_name
from bushfit.geometry import Specimen, Unit
from bushfit.planning.contract import Knowledge, Noise, Test

#: Unit and factor from SI of the numbers with a unit in [simulate] and its tests, by key, beside amplitudes.
_UNITS = {
    **dict.fromkeys(("phase_error", "level_phase_error"), Unit("rad", 1.0)),
    **dict.fromkeys(("frequency", "frequencies"), Unit("Hz", 1.0)),
}
#: Keys that are not written as a number or text.
_OTHER_KEYS = ("direction", "temperature", "parameters", "effects", "loops", "sweeps")


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


def campaign_toml(knowledge: Knowledge, planned: Sequence[Test]) -> str:
    """Format planned tests as a campaign for `bushfit simulate`.

    Args:
        knowledge: model and noise of the plan.
        planned: runs of the plan.

    Returns:
        Content of the campaign file, in TOML.
    """
    settings, tested = simulation_settings(planned, knowledge.noise), [test.direction for test in planned]
    lines = [
        "# Planned by bushfit plan; bushfit simulate computes these tests from the model below. No rubber was tested.",
        "# All repeats of a sweep follow each other here; the order on the rig is given in the plan sheet.",
        *body_lines(knowledge.model.bushing, dict.fromkeys(place for place in tested if isinstance(place, Specimen))),
        *("", "[simulate]", *_key_lines(settings)),
        *("", "[simulate.parameters]"),
    ]
    for record in knowledge.model.records:
        lines += [] if record.name in BASE else ["", f"[simulate.effects.{toml_value(record.name)}]"]
        for parameter in record.parameters:
            value = f"{knowledge.model.values[qualified_name(record, parameter)]:.12g}"
            text = value if parameter.unit == "1" else toml_value(f"{value} {parameter.unit}")
            lines.append(f"{parameter.name} = {text}")
    for kind, tests in (("loops", settings.loops), ("sweeps", settings.sweeps)):
        for test in tests:
            lines += ["", f"[[simulate.{kind}]]", *place_lines(test.direction), *_key_lines(test)]
    return "\n".join(lines) + "\n"


def _key_lines(table: SimulateSettings | Test) -> Iterator[str]:
    """Generate a line of TOML for each number or text of [simulate], or of a test in it, other than the default.

    Numbers have twelve digits, which hides the rounding errors of unit conversions.
    """
    units = dict(_UNITS)
    if not isinstance(table, SimulateSettings):
        units |= dict.fromkeys(("amplitude", "amplitudes"), table.direction.display.displacement)
    for key in fields(table):
        value = getattr(table, key.name)
        if key.name in _OTHER_KEYS or value == key.default:
            continue
        unit = units.get(key.name, Unit("%", 100.0))
        values: Iterable[Any] = value if isinstance(value, tuple) else (value,)
        texts = (f"{unit.factor * one:.12g} {unit.name}" if isinstance(one, float) else one for one in values)
        listed = ", ".join(map(toml_value, texts))
        yield f"{key.name} = [{listed}]" if isinstance(value, tuple) else f"{key.name} = {listed}"
