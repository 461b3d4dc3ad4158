"""Figure of a force over time: displacement, force with its band, and force over displacement."""

import numpy as np
import pandas as pd

from bushfit.effects.contract import Array
from bushfit.report.plots import style

#: Largest number of rows of a curve over time, and of a curve over displacement; a figure has fewer pixels.
_MOST_OVER_TIME, _MOST_OVER_DISPLACEMENT = 3000, 20_000
#: Height of the panels of displacement and force over time [cm].
_STRIP = 3.4
#: Colours of prediction and measurement.
PREDICTED, MEASURED = "#3b528b", "#c1121f"


@style.fixed_settings()
def response_figure(title: str, table: pd.DataFrame, note: str = "") -> style.Chart:
    """Figure of a response: for each direction displacement and force over time, and force over displacement.

    Args:
        title: title of the figure.
        table: time; for each direction displacement and force with "low" and "high" ends of its band; and, of a
            validation record, the measured force. Headers contain units (response.csv).
        note: further sentences below the figure.

    Returns:
        Figure with three panels per direction.

    Raises:
        KeyError: a column of the table is missing.
    """
    headers = [str(header) for header in table]
    measured = [table[header].to_numpy(dtype=float) for header in headers if header.startswith("measured ")]
    forces = [header.removesuffix(", low") for header in headers if header.endswith(", low")] or [headers[-1]]
    time = table["time [s]"].to_numpy(dtype=float)
    figure = style.Chart(title, len(forces) * 2 * _STRIP)
    grid = figure.add_gridspec(2 * len(forces), 3)
    for row, resists in enumerate(forces):
        force, low, high = (table[resists + end].to_numpy(dtype=float) for end in ("", ", low", ", high"))
        moves = headers[headers.index(resists) - 1]
        if moves == "time [s]" or moves.endswith(", high"):
            raise KeyError(f"displacement before {resists}")
        displacement = table[moves].to_numpy(dtype=float)
        motion = figure.add_subplot(grid[2 * row, :2])
        course = figure.add_subplot(grid[2 * row + 1, :2], sharex=motion)
        loop = figure.add_subplot(grid[2 * row : 2 * row + 2, 2])
        rows = extreme_rows(displacement, _MOST_OVER_TIME)
        motion.plot(time[rows], displacement[rows], color=style.GREY, lw=0.7)
        rows = extreme_rows(force, _MOST_OVER_TIME)
        course.fill_between(time[rows], low[rows], high[rows], color=PREDICTED, alpha=0.3, lw=0)
        for values, color in (*((values, MEASURED) for values in measured), (force, PREDICTED)):
            rows = extreme_rows(values, _MOST_OVER_TIME)
            course.plot(time[rows], values[rows], color=color, lw=0.7)
            rows = extreme_rows(values, _MOST_OVER_DISPLACEMENT)
            loop.plot(displacement[rows], values[rows], color=color, lw=0.5)
        style.label_axes(motion, "", moves)
        style.label_axes(course, "time [s]", resists)
        style.label_axes(loop, moves, resists)
    return figure.explain("Blue: model; shaded: its 95 % band.", "Red: measured." * len(measured), note=note)


def extreme_rows(values: Array, maximum: int) -> Array:
    """Indices of about `maximum` samples that show a long curve: minimum and maximum of each of `maximum`/2 parts."""
    if values.size <= maximum:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, maximum // 2 + 1).astype(int)[:-1]
    parts = np.split(values, edges[1:])
    low, high = (edges + [choose(part) for part in parts] for choose in (np.argmin, np.argmax))
    return np.unique(np.concatenate(([0], low, high, [values.size - 1])))
