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

    Amplitudes count zero-to-peak. The force, moment or stress is what the model expects at most, to choose a load cell.
    """
    tests = plan.planned.tests
    counts, seen, rows = Counter(tests), Counter[Test](), []
    for order, (test, minutes) in enumerate(zip(tests, plan.planned.minutes, strict=True), start=1):
        seen[test] += 1
        (frequency, amplitude), (length, force, _) = operating_points(test), test.direction.display
        stiffness = np.abs(plan.knowledge.model.stiffness(test.direction, frequency, amplitude))
        most = number(force.factor * float(np.max(stiffness * amplitude)), 2)
        rows.append(
            {
                "order": order,
                "direction": str(test.direction),
                "test": "loop" if isinstance(test, SimulatedLoop) else f"sweep over {test.stepped}",
                "amplitude": f"{_listed(length.factor * amplitude)} {length.name}",
                "frequency [Hz]": _listed(frequency),
                "cycles": str(test.cycles) if isinstance(test, SimulatedLoop) else "until steady",
                "repeat": f"{seen[test]} of {counts[test]}",
                "force up to": f"{most} {force.name}",
                "minutes": round(float(minutes), 1),
                "minutes so far": round(float(np.sum(plan.planned.minutes[:order])), 1),
                "what for": plan.purposes[test],
            }
        )
    return pd.DataFrame(rows, columns=_COLUMNS)


def _listed(values: Array) -> str:
    """The distinct numbers among some, in their order."""
    return " ".join(dict.fromkeys(number(value, 4) for value in values.tolist()))
