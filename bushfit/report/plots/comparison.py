"""Several results over one grid: stiffness and loss factor with bands, and below how far each is off the first."""

from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from bushfit.report.compared import SideBySide
from bushfit.report.plots import style

#: Width of a line [point].
_LINE = 1.3
#: Dashes of the smallest and of the largest value that is held.
_DASHES = ("-", (0, (4, 1.5)))
#: Markers on a line, or fewer: they tell lines apart in grey print.
_MARKS = 5


def comparison_figure(found: SideBySide) -> Figure:
    """All results at every place they are compared at: two rows of panels a place, the differences below the values.

    Drawn over frequency at the smallest and the largest amplitude, or over amplitude where there is one frequency.
    """
    first, *others = found.names
    shown = [found.sides(place) for place in found.places]
    figure = style.new_figure(f"{', '.join(others)} against {first}", 2 * len(shown) * style.ROW)
    grid = figure.subplots(2 * len(shown), 2, squeeze=False)
    looks = dict(zip(found.names, style.styles(len(found.names), "loop"), strict=True))
    for i, sides in enumerate(shown):
        for axes, panel in zip(grid[2 * i : 2 * i + 2].flat, sides.panels, strict=True):
            for line in panel.lines:
                look, along = looks[line.label], {"ls": _DASHES[line.level], "lw": _LINE, **style.POINT}
                markers = {"marker": look.marker, "markevery": max(line.x.size // _MARKS, 1)}
                axes.plot(line.x, line.value, color=look.color, **markers, **along)
                # bands of several results lie on each other
                axes.fill_between(line.x, line.low, line.high, color=look.color, alpha=0.18, lw=0)
            style.label_axes(axes, sides.along, panel.header if panel.least else f"{sides.place} {panel.header}")
            style.log_if_wide(axes, panel.lines[0].x)
            if panel.least:
                axes.axhline(0.0, color=looks[first].color, lw=_LINE)
                style.least_span(axes, panel.least)
        lines = [look._replace(dashes="-").handle(True) for look in looks.values()]
        dashes = [Line2D([], [], color=style.INK, lw=_LINE, ls=_DASHES[level]) for level, _ in enumerate(sides.levels)]
        called = [f"{label}: {style.file_name(name)}" for label, name in found.names.items()]
        style.legend(grid[2 * i, 1], lines, called, "", besides=dict(zip(sides.levels, dashes, strict=True)))
    style.explain(
        figure,
        "Shaded: 95 % bands. Lower panels: the band of each point by itself; "
        "compare.json and the terminal say what holds at all points at once.",
    )
    return figure
