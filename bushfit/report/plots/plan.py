"""Figure of a test plan and the standard programme: operating points by direction, and expected errors of both."""

from collections import Counter

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bushfit.campaign.schema import SimulatedLoop
from bushfit.planning.contract import Plan, Programme, operating_points
from bushfit.report.plots import style
from bushfit.report.tables import spread
from bushfit.units import number

#: Colours of the plan, of the standard programme and of present knowledge, distinct in grey print.
_COLORS = {"planned": "#1b6ca8", "standard programme": "#d98324", "before": style.GREY}
#: Marker diameter of a single run [point]; the area of a marker is proportional to the number of runs.
_ONE_RUN = 2.8


@style.in_own_style
def plan_figure(plan: Plan) -> style.Chart:
    """Figure of the operating points of planned tests and of the standard programme, with the expected errors of both.

    Args:
        plan: planned tests, standard programme, and present knowledge of the parameters.

    Returns:
        Figure with a row of panels per direction (left: planned, right: standard programme) and a row of errors.
    """
    programmes = {"planned": plan.planned, "standard programme": plan.standard}
    tests = [test for programme in programmes.values() for test in programme.tests]
    places = list(dict.fromkeys(test.direction for test in tests))
    figure = style.Chart(f"{plan.knowledge.model.name}: planned tests", (len(places) + 1) * style.ROW)
    grid = figure.subplots(len(places) + 1, 2, squeeze=False)
    for row, place in zip(grid, places, strict=False):
        length, factor = place.display.displacement
        points = {
            test: np.stack(operating_points(test)) * np.array([[1.0], [factor]])
            for test in tests
            if test.direction == place
        }
        ends = np.concatenate([*points.values()], axis=1)
        for axes, (name, programme) in zip(row, programmes.items(), strict=True):
            runs = Counter(test for test in programme.tests if test in points)
            for test, count in sorted(runs.items(), key=lambda pair: -points[pair[0]].shape[1]):
                marker, size = "D" if isinstance(test, SimulatedLoop) else "o", _ONE_RUN * np.sqrt(count)
                line = axes.plot(*points[test], color=_COLORS[name], lw=0.8, marker=marker, ms=size)
                line[0].set(mec="white", mew=0.3, clip_on=False)
            style.label_axes(axes, "frequency [Hz]", f"{place} amplitude [{length}]")
            style.logarithmic(axes, ends[0], "x")
            style.logarithmic(axes, ends[1], "y")
            (low_x, low_y), (high_x, high_y) = ends.min(axis=1) / 1.6, ends.max(axis=1) * 1.6
            axes.set(xlim=(low_x, high_x), ylim=(low_y, high_y))
    for axes, (name, programme) in zip(grid[0], programmes.items(), strict=True):
        title = f"{name}: {len(programme.tests)} runs in {number(programme.hours, 2)} h"
        axes.set_title(title, loc="left", **style.NAMES)
    sizes = sorted({count for programme in programmes.values() for count in Counter(programme.tests).values()})
    sizes = [sizes[index] for index in spread(len(sizes), 4)]
    dots = [Line2D([], [], color=style.GREY, ls="", marker="o", ms=_ONE_RUN * np.sqrt(size)) for size in sizes]
    loop = {"loop": Line2D([], [], color=style.GREY, ls="", marker="D", ms=_ONE_RUN)}
    style.legend(grid[0, 1], dots, [f"sweep, {size} run{'s' * (size > 1)}" for size in sizes], "", loop)
    _draw_errors(grid[-1, 0], grid[-1, 1], plan, programmes)
    return figure.explain(
        "Above: points of each run; a line joins the points of a sweep. Below: expected relative standard errors "
        "of the parameters and of the stiffness at the wanted points, after each programme. All values are "
        "computed from a model: nothing was tested.",
    )


def _draw_errors(parameters: Axes, stiffness: Axes, plan: Plan, programmes: dict[str, Programme]) -> None:
    """Draw the standard errors [%] of the parameters, and of |K| at the wanted operating points in ascending order.

    Args:
        parameters: panel of the parameters' relative standard errors.
        stiffness: panel of the relative standard errors of |K|.
        plan: planned tests and present knowledge.
        programmes: programmes to compare, by their label.
    """
    errors = {name: programme.errors for name, programme in programmes.items()} | {"before": plan.knowledge.errors}
    rows = np.arange(len(plan.knowledge.names))
    for (name, values), marker in zip(errors.items(), "os^", strict=True):
        parameters.plot(100.0 * values, rows, marker, color=_COLORS[name], **style.POINT)
    style.label_axes(parameters, "standard error [%]", "")
    parameters.set_yticks(rows, plan.knowledge.names, **style.WORDS)
    parameters.invert_yaxis()
    style.logarithmic(parameters, 100.0 * np.concatenate(list(errors.values())))
    for (name, programme), marker in zip(programmes.items(), "os", strict=True):
        values = 100.0 * np.sort(programme.stiffness)
        share = 100.0 * (np.arange(values.size) + 0.5) / values.size
        step = max(values.size // 5, 1)
        stiffness.plot(share, values, color=_COLORS[name], lw=1.3, marker=marker, markevery=step, **style.POINT)
    style.label_axes(stiffness, "share of the wanted points [%]", "error of stiffness [%]")
    stiffness.set_ylim(bottom=0.0)
    marks = zip(_COLORS.values(), "os^", strict=True)
    style.legend(stiffness, [Line2D([], [], color=color, marker=mark, ls="") for color, mark in marks], [*_COLORS], "")
