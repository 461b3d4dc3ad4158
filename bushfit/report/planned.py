"""A plan as a sheet for who runs the rig, and as a picture."""

from collections import Counter
from functools import partial

import numpy as np
import pandas as pd

from bushfit.campaign.schema import SimulatedLoop
from bushfit.effects.contract import Array
from bushfit.planning.contract import Plan, Test, operating_points
from bushfit.report import plots
from bushfit.report.contents import Contents
from bushfit.units import number

#: Columns of the sheet, those of a plan without any test too.
_COLUMNS = (
    *("order", "direction", "test", "amplitude", "frequency [Hz]", "cycles", "repeat", "force up to", "minutes"),
    *("minutes so far", "what for"),
)


def plan_contents(plan: Plan) -> Contents:
    """`plan`: the sheet as a table, and the picture."""
    return Contents.shown("plan", partial(plan_sheet, plan), lambda: plots.plan.plan_figure(plan))


def plan_sheet(plan: Plan) -> pd.DataFrame:
    """A row for each run of the rig, in the order in which they are made.

    Amplitudes count zero-to-peak. The force is what the model expects at most, so that a load cell can be chosen.
    """
    tests = plan.planned.tests
    counts, seen, rows = Counter(tests), Counter[Test](), []
    for order, (test, minutes) in enumerate(zip(tests, plan.planned.minutes, strict=True), start=1):
        seen[test] += 1
        rows.append(
            {
                "order": order,
                "direction": str(test.direction),
                "test": "loop" if isinstance(test, SimulatedLoop) else f"sweep over {test.stepped}",
                **_motion(test),
                "cycles": str(test.cycles) if isinstance(test, SimulatedLoop) else "until steady",
                "repeat": f"{seen[test]} of {counts[test]}",
                **_force(plan, test),
                "minutes": round(float(minutes), 1),
                "minutes so far": round(float(np.sum(plan.planned.minutes[:order])), 1),
                "what for": plan.purposes[test],
            }
        )
    return pd.DataFrame(rows, columns=_COLUMNS)


def _motion(test: Test) -> dict[str, str]:
    """Amplitudes and frequencies in the units of engineers."""
    unit, factor = test.direction.display.displacement
    frequency, amplitude = operating_points(test)
    return {"amplitude": f"{_listed(factor * amplitude)} {unit}", "frequency [Hz]": _listed(frequency)}


def _listed(values: Array) -> str:
    """The distinct numbers among some, in their order."""
    return " ".join(dict.fromkeys(number(value, 4) for value in values.tolist()))


def _force(plan: Plan, test: Test) -> dict[str, str]:
    """The largest force, moment or stress expected, zero-to-peak."""
    frequency, amplitude = operating_points(test)
    stiffness = np.abs(plan.knowledge.model.stiffness(test.direction, frequency, amplitude))
    unit, factor = test.direction.display.force
    return {"force up to": f"{number(factor * float(np.max(stiffness * amplitude)), 2)} {unit}"}
