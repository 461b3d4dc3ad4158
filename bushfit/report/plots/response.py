"""Figure of a force over time: displacement, force with its band, and force over displacement."""

from collections.abc import Sequence

import numpy as np

from bushfit.effects.contract import Array
from bushfit.prediction.response import TimeResponse
from bushfit.report.plots import style

#: Largest number of rows of a curve over time, and of a curve over displacement; a figure has fewer pixels.
_MOST_OVER_TIME, _MOST_OVER_DISPLACEMENT = 3000, 20_000
#: Height of the panels of displacement and force over time [cm].
_STRIP = 3.4
#: Colours of prediction and measurement.
PREDICTED, MEASURED = "#3b528b", "#c1121f"


@style.in_own_style
def response_figure(
    title: str, time: Array, responses: Sequence[TimeResponse], note: str = "", measured: Array | None = None
) -> style.Chart:
    """Figure of responses: for each direction displacement and force over time, and force over displacement.

    Args:
        title: title of the figure.
        time: time of each row [s], (n,).
        responses: responses to histories with these times.
        note: further sentences below the figure.
        measured: measured force of the only response [N, N m or Pa], (n,), for comparison; None without measurement.

    Returns:
        Figure with three panels per direction.
    """
    figure = style.Chart(title, len(responses) * 2 * _STRIP)
    grid = figure.add_gridspec(2 * len(responses), 3)
    for row, response in enumerate(responses):
        (length, length_factor), (unit, force_factor), _ = response.direction.display
        moves, resists, _ = response.direction.motion.words
        displacement, band = length_factor * response.history.value, response.force
        motion = figure.add_subplot(grid[2 * row, :2])
        course = figure.add_subplot(grid[2 * row + 1, :2], sharex=motion)
        loop = figure.add_subplot(grid[2 * row : 2 * row + 2, 2])
        rows = turning_rows(displacement, _MOST_OVER_TIME)
        motion.plot(time[rows], displacement[rows], color=style.GREY, lw=0.7)
        rows = turning_rows(band.value, _MOST_OVER_TIME)
        low, high = force_factor * band.low[rows], force_factor * band.high[rows]
        course.fill_between(time[rows], low, high, color=PREDICTED, alpha=0.3, lw=0)
        for force, color in ((measured, MEASURED), (band.value, PREDICTED)):
            if force is not None:
                rows = turning_rows(force, _MOST_OVER_TIME)
                course.plot(time[rows], force_factor * force[rows], color=color, lw=0.7)
                rows = turning_rows(force, _MOST_OVER_DISPLACEMENT)
                loop.plot(displacement[rows], force_factor * force[rows], color=color, lw=0.5)
        motion.set_title(str(response.direction), fontsize=style.TEXT, loc="left", color=style.GREY)
        style.label_axes(motion, "", f"{moves} [{length}]")
        style.label_axes(course, "time [s]", f"{resists} [{unit}]")
        style.label_axes(loop, f"{moves} [{length}]", f"{resists} [{unit}]")
    return figure.explain("Blue: model; shaded: its 95 % band.", "Red: measured." * (measured is not None), note=note)


def turning_rows(values: Array, most: int) -> Array:
    """Rows to draw of a long curve: those with the lowest and the highest value of each of `most`/2 parts."""
    if values.size <= most:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, most // 2 + 1).astype(int)[:-1]
    parts = np.split(values, edges[1:])
    low, high = (edges + [choose(part) for part in parts] for choose in (np.argmin, np.argmax))
    return np.unique(np.concatenate(([0], low, high, [values.size - 1])))
