"""What each test of a plan is for: the parameter that would be known least without it."""

from collections import Counter

import numpy as np

from bushfit.effects.contract import Array
from bushfit.planning.contract import Plan, Test
from bushfit.planning.criterion import View
from bushfit.planning.sensitivity import Grid, relative_slopes
from bushfit.units import number

#: Growth of a parameter's standard error without a test from which on the test is for that parameter; chosen.
_MATTERS = 1.005


def purposes(plan: Plan) -> dict[Test, str]:
    """In words, of each test with all its repeats, what would be lost without it."""
    known, counts = plan.knowledge, Counter(plan.planned.tests)
    grid = Grid(known, tuple(counts))
    slopes = relative_slopes(known, grid.data_sets)
    told = grid.told(slopes, np.empty((0, slopes.shape[-1])))
    view = View(told, known.precision, grid.level, len(known.bounded))
    runs = np.array(list(counts.values()))
    whole = _errors(view, runs)[: len(known.names)]
    rest = "tells the rivals apart" if plan.wanted.aim == "rivals" else "shows effects that the model lacks"
    found = {}
    for place, test in enumerate(counts):
        growth = _errors(view, np.where(np.arange(runs.size) == place, 0, runs))[: whole.size] / whole
        worst = int(np.argmax(growth))
        lost = 100.0 * float(growth[worst] - 1.0)
        told_by_it = f"{known.names[worst]}: error {number(lost, 2)} % larger without it"
        found[test] = told_by_it if growth[worst] >= _MATTERS else rest
    return found


def _errors(view: View, runs: Array) -> Array:
    """Standard error of each parameter's relative change, after so many runs of each test."""
    return np.sqrt(np.diag(view.off(view.together(runs))[0]))
