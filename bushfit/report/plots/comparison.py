"""Figure of a comparison: stiffness and loss factor of several results, and their differences from the first."""

import numpy as np
from matplotlib.lines import Line2D

from bushfit.report.compare_document import ComparisonFile
from bushfit.report.compared import LOSS, place_differences
from bushfit.report.plots import style
from bushfit.report.tables import shorten
from bushfit.units import display_unit, format_range, split_header

#: Approximate number of markers on a line; markers distinguish lines in grey print.
_MARKS = 5
#: Smallest span of an axis of relative differences [%] and of differences of the loss factor.
_LEAST_PERCENT, _LEAST_LOSS = 1.0, 0.005


@style.fixed_settings()
def comparison_figure(comparison: ComparisonFile) -> style.Chart:
    """Figure of stiffness and loss factor of all compared results, and of their differences from the first result.

    Curves are over frequency at the smallest and largest amplitude, or over amplitude if there is only one frequency.

    Args:
        comparison: validated comparison.

    Returns:
        Figure with four panels per direction or specimen: values above, differences below.
    """
    (first, *other_labels), by_place = comparison.names, place_differences(comparison)
    figure = style.Chart(f"{', '.join(other_labels)} against {first}", 2 * len(by_place) * style.ROW)
    grid = figure.subplots(2 * len(by_place), 2, squeeze=False)
    looks = dict(zip(comparison.names, style.styles(len(comparison.names), "loop"), strict=True))
    for row, (place, differences) in enumerate(by_place.items()):
        reference = differences[0]
        over_frequency = np.ptp(reference.table["frequency [Hz]"]) > 0.0  # at fixed amplitudes, or the other way round
        x_header, fixed_header = ("frequency [Hz]", reference.amplitude)[:: 1 if over_frequency else -1]
        levels = np.unique(np.unique(reference.table[fixed_header])[[0, -1]])
        values = [(first, reference, "reference "), *((one.label, one, "other ") for one in differences)]
        changes = [(one.label, one, "") for one in differences]
        name, unit = split_header(reference.stiffness)
        largest = max(np.nanmax(one.band(side + one.stiffness)[0], initial=0.0) for _, one, side in values)
        display, factor = display_unit(unit or "", 1.0, float(largest))
        panels = (
            (reference.stiffness, f"{place} {name} [{display}]", factor, values, 0.0),
            (LOSS, f"{place} loss factor [-]", 1.0, values, 0.0),
            (reference.changes[0], f"{name} minus {first} [% of {first}]", 100.0, changes, _LEAST_PERCENT),
            (reference.changes[1], f"loss factor minus {first} [-]", 1.0, changes, _LEAST_LOSS),
        )
        of_place = grid[2 * row : 2 * row + 2].flat
        for axes, (header, y_label, scale, sides, least_span) in zip(of_place, panels, strict=True):
            for label, one, side in sides:
                x, level = (one.table[name].to_numpy() for name in (x_header, fixed_header))
                band, look = scale * one.band(side + header), looks[label]
                for drawn_level, dashes in zip(levels, style.DASHES, strict=False):
                    drawn_x, (value, low, high) = x[level == drawn_level], band[:, level == drawn_level]
                    line = axes.plot(drawn_x, value, color=look.color, ls=dashes, lw=style.LINE)[0]
                    line.set(marker=look.marker, markevery=max(value.size // _MARKS, 1), **style.POINT)
                    # transparent: bands of several results overlap
                    axes.fill_between(drawn_x, low, high, color=look.color, alpha=0.18, lw=0)
            style.label_axes(axes, x_header, y_label, reference.table[x_header].to_numpy())
            if least_span:
                axes.axhline(0.0, color=looks[first].color, lw=style.LINE)
                style.widen_span(axes, least_span)
        lines = [style.Style(look.color, "-", look.marker).handle(True) for look in looks.values()]
        level_names = [format_range(split_header(fixed_header)[1] or "", float(level)) for level in levels]
        dashed = [Line2D([], [], color=style.INK, lw=style.LINE, ls=dashes) for dashes in style.DASHES[: len(levels)]]
        names = [f"{label}: {shorten(name, 20)}" for label, name in comparison.names.items()]
        style.legend(grid[2 * row, 1], lines, names, "", dict(zip(level_names, dashed, strict=True)))
    return figure.explain("Shaded: 95 % band of each point. The stated differences hold for all points together.")
