"""Campaign file of a plan, with which `bushfit simulate` computes the planned tests."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bushfit.campaign.simulated import SimulatedLoop, SimulatedSweep, SimulateSettings
from bushfit.campaign.toml import specimen_lines, toml_value
from bushfit.effects import BASE, qualified_name
from bushfit.geometry import Specimen, Unit
from bushfit.planning.contract import Knowledge, Noise, Test
from bushfit.templates import render_template


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
        noise=float(np.sqrt(np.mean(np.square(noise.random)))),
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
    specimens = dict.fromkeys(test.direction for test in planned if isinstance(test.direction, Specimen))
    return render_template(
        Path(__file__).with_name("campaign.toml.jinja"),
        specimens=specimens,
        settings=simulation_settings(planned, knowledge.noise),
        model=knowledge.model,
        base=BASE,
        percent=Unit("%", 100.0),
        radian=Unit("rad", 1.0),
        hertz=Unit("Hz", 1.0),
        qualified_name=qualified_name,
        specimen_lines=specimen_lines,
        toml_value=toml_value,
    )
