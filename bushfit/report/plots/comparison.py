"""Figure of a comparison: stiffness and loss factor of several results, and their differences from the first."""

import numpy as np
from matplotlib.lines import Line2D

from bushfit.report.compared import ComparisonDocument, ContrastHeaders
from bushfit.report.plots import style
from bushfit.report.tables import numeric_columns, shorten
from bushfit.units import display_unit, format_range, split_header

#: Width of a line [point].
_STROKE = 1.3
#: Approximate number of markers on a line; markers distinguish lines in grey print.
_MARKS = 5
#: Smallest span of an axis of relative differences [%] and of differences of the loss factor.
_LEAST_PERCENT, _LEAST_LOSS = 1.0, 0.005


@style.fixed_settings()
def comparison_figure(comparison: ComparisonDocument) -> style.Chart:
    """Figure of stiffness and loss factor of all compared results, and of their differences from the first result.

    Curves are over frequency at the smallest and largest amplitude, or over amplitude if there is only one frequency.

    Args:
        comparison: validated comparison.

    Returns:
        Figure with four panels per direction or specimen: values above, differences below.
    """
    first, *other_labels = comparison.names
    figure = style.Chart(f"{', '.join(other_labels)} against {first}", 2 * len(comparison.places) * style.ROW)
    grid = figure.subplots(2 * len(comparison.places), 2, squeeze=False)
    looks = dict(zip(comparison.names, style.styles(len(comparison.names), "loop"), strict=True))
    for row, place in enumerate(comparison.places):
        tables = comparison.differences_at(place)
        heads = ContrastHeaders.from_table(tables[other_labels[0]])
        frequency, amplitude = numeric_columns(tables[other_labels[0]], "frequency [Hz]", heads.amplitude)
        over_frequency = bool(np.ptp(frequency))
        x_header, fixed_header = ("frequency [Hz]", heads.amplitude)[:: 1 if over_frequency else -1]
        levels = np.unique(np.unique(amplitude if over_frequency else frequency)[[0, -1]])
        values = [
            (first, tables[other_labels[0]], "reference "),
            *((label, tables[label], "other ") for label in other_labels),
        ]
        differences = [(label, tables[label], "") for label in other_labels]
        name, unit = split_header(heads.stiffness)
        largest = max(float(np.nanmax(table[f"{side}{heads.stiffness}"], initial=0.0)) for _, table, side in values)
        display, factor = display_unit(unit or "", 1.0, largest)
        panels = (
            (heads.stiffness, f"{place} {name} [{display}]", factor, values, 0.0),
            ("loss factor [-]", f"{place} loss factor [-]", 1.0, values, 0.0),
            (heads.relative, f"{name} minus {first} [% of {first}]", 100.0, differences, _LEAST_PERCENT),
            (heads.loss, f"loss factor minus {first} [-]", 1.0, differences, _LEAST_LOSS),
        )
        for axes, (header, y_label, scale, sides, least_span) in zip(
            grid[2 * row : 2 * row + 2].flat, panels, strict=True
        ):
            for label, table, side in sides:
                ends = [f"{side}{header}{end}" for end in ("", ", low", ", high")]
                x, level, *band = numeric_columns(table, x_header, fixed_header, *ends)
                look = looks[label]
                for drawn_level, dashes in zip(levels, style.DASHES, strict=False):
                    value, low, high = (scale * end[level == drawn_level] for end in band)
                    line = axes.plot(x[level == drawn_level], value, color=look.color, ls=dashes, lw=_STROKE)[0]
                    line.set(marker=look.marker, markevery=max(value.size // _MARKS, 1), **style.POINT)
                    # transparent: bands of several results overlap
                    axes.fill_between(x[level == drawn_level], low, high, color=look.color, alpha=0.18, lw=0)
            style.label_axes(axes, x_header, y_label, numeric_columns(tables[other_labels[0]], x_header)[0])
            if least_span:
                axes.axhline(0.0, color=looks[first].color, lw=_STROKE)
                style.widen_span(axes, least_span)
        lines = [style.Style(look.color, "-", look.marker).handle(True) for look in looks.values()]
        level_names = [format_range(split_header(fixed_header)[1] or "", float(level)) for level in levels]
        dashed = [Line2D([], [], color=style.INK, lw=_STROKE, ls=dashes) for dashes in style.DASHES[: len(levels)]]
        names = [f"{label}: {shorten(name, 20)}" for label, name in comparison.names.items()]
        style.legend(grid[2 * row, 1], lines, names, "", dict(zip(level_names, dashed, strict=True)))
    return figure.explain(
        "Shaded: 95 % band of each single point. Stated differences hold for all points together, with wider bands."
    )
