"""A plan and the standard programme: operating points by direction, and the expected errors of both."""

from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bushfit.campaign.schema import SimulatedLoop
from bushfit.effects.contract import Array
from bushfit.planning.contract import Plan, Programme, Test, operating_points
from bushfit.report.plots import style
from bushfit.report.tables import spread
from bushfit.units import number

#: Colours of the plan, of the standard programme and of present knowledge, distinct in grey print.
_COLORS = {"planned": "#1b6ca8", "standard programme": "#d98324", "known now": style.GREY}
#: Markers of sweeps and loops.
_MARKERS = {False: "o", True: "D"}
#: Diameter of the marker of one run [point]; that of n runs grows with the root of n, so that its area counts them.
_ONE_RUN = 2.8


@style.in_own_style
def plan_figure(plan: Plan) -> Figure:
    """Operating points of the plan (left) and the standard programme (right) by direction, and the errors of both.

    Args:
        plan: plan, standard programme and present knowledge.

    Returns:
        Figure with a row of panels per direction and one of errors.
    """
    programmes = {"planned": plan.planned, "standard programme": plan.standard}
    tests = [test for programme in programmes.values() for test in programme.tests]
    places = list(dict.fromkeys(test.direction for test in tests))
    figure = style.new_figure(f"{plan.knowledge.model.name}: planned tests", (len(places) + 1) * style.ROW)
    grid = figure.subplots(len(places) + 1, 2, squeeze=False)
    sizes = sorted({n for programme in programmes.values() for n in Counter(programme.tests).values()})
    for row, place in zip(grid, places, strict=False):
        ends = np.concatenate([_points(test) for test in tests if test.direction == place])
        for axes, (name, programme) in zip(row, programmes.items(), strict=True):
            _draw(axes, [test for test in programme.tests if test.direction == place], _COLORS[name])
            style.label_axes(axes, "frequency [Hz]", f"{place} amplitude [{place.display.displacement.name}]")
            for axis_name, values in zip(("x", "y"), ends.T, strict=True):
                style.logarithmic(axes, values, axis_name)  # type: ignore[arg-type]
                axes.set(**{f"{axis_name}lim": (values.min() / 1.6, values.max() * 1.6)})
    for axes, (name, programme) in zip(grid[0], programmes.items(), strict=True):
        title = f"{name}: {len(programme.tests)} runs in {number(programme.hours, 2)} h"
        axes.set_title(title, loc="left", **style.NAMES)
    _name_sizes(grid[0, 1], sizes)
    _draw_errors(grid[-1, 0], plan, programmes)
    _draw_stiffness(grid[-1, 1], programmes)
    return style.explained(
        figure,
        "Above: points of each run; a line joins the points of a sweep. Below: expected relative standard errors "
        "of the parameters and of the stiffness at the wanted points, after each programme. All values are "
        "computed from a model: nothing was tested.",
    )


def _points(test: Test) -> Array:
    """Frequency [Hz] and amplitude [mm, deg or %] of the points of a run, (n, 2)."""
    frequency, amplitude = operating_points(test)
    return np.stack([frequency, test.direction.display.displacement.factor * amplitude], axis=-1)


def _draw(axes: Axes, tests: Sequence[Test], color: str) -> None:
    """Draw the points of each run, larger the more often it is repeated; runs of many points first."""
    for test, count in sorted(Counter(tests).items(), key=lambda pair: -len(_points(pair[0]))):
        loop = isinstance(test, SimulatedLoop)
        diameter = _ONE_RUN * np.sqrt(count)
        drawn: dict[str, Any] = {"color": color, "lw": 0.8, "mec": "white", "mew": 0.3, "clip_on": False}
        axes.plot(*_points(test).T, marker=_MARKERS[loop], ms=diameter, **drawn)


def _name_sizes(axes: Axes, sizes: Sequence[int]) -> None:
    chosen_sizes = [sizes[place] for place in spread(len(sizes), 4)]
    looks: dict[str, Any] = {"color": style.GREY, "ls": "", "mec": "white", "mew": 0.3}
    handles = [Line2D([], [], marker="o", ms=_ONE_RUN * np.sqrt(size), **looks) for size in chosen_sizes]
    words = [f"sweep, {size} run{'s' * (size > 1)}" for size in chosen_sizes]
    loop = {"loop": Line2D([], [], marker="D", ms=_ONE_RUN, **looks)}
    style.legend(axes, handles, words, "", extra_lines=loop)


def _draw_errors(axes: Axes, plan: Plan, programmes: dict[str, Programme]) -> None:
    errors = {name: programme.errors for name, programme in programmes.items()} | {"known now": plan.knowledge.errors}
    places = np.arange(len(plan.knowledge.names))
    for (name, values), marker in zip(errors.items(), "os^", strict=True):
        axes.plot(100.0 * values, places, marker, color=_COLORS[name], label=name, **style.POINT)
    style.label_axes(axes, "standard error [%]", "")
    axes.set_yticks(places, plan.knowledge.names, **style.WORDS)
    axes.invert_yaxis()
    style.logarithmic(axes, 100.0 * np.concatenate(list(errors.values())))


def _draw_stiffness(axes: Axes, programmes: dict[str, Programme]) -> None:
    """Draw the error of the stiffness at each wanted point, from the smallest to the largest."""
    for (name, programme), marker in zip(programmes.items(), "os", strict=True):
        values = 100.0 * np.sort(programme.stiffness)
        share = 100.0 * (np.arange(values.size) + 0.5) / values.size
        marker_step = max(values.size // 5, 1)
        axes.plot(share, values, color=_COLORS[name], lw=1.3, marker=marker, markevery=marker_step, **style.POINT)
    style.label_axes(axes, "share of the points wanted [%]", "error of stiffness [%]")
    axes.set_ylim(bottom=0.0)
    marks = zip(_COLORS.items(), "os^", strict=True)
    handles = [Line2D([], [], color=color, marker=mark, ls="", **style.POINT) for (_, color), mark in marks]
    style.legend(axes, handles, list(_COLORS), "")
